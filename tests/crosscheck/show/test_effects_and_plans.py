"""Plans and the catalogue on the terminal, from made ones."""

from __future__ import annotations

from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from crosscheck.fit.reasons import Reason, Why
from crosscheck.planning.planned import Adding
from crosscheck.planning.proposer import Gain, Suggestion
from crosscheck.planning.result import Plan, Visible
from crosscheck.planning.visibility import Signal
from crosscheck.show.plan import print_plan
from seecr.description.mjcf import load_robot
from seecr.effects import layout_of
from seecr.pose import quat_from_rotvec

ROBOT = load_robot("demobot_cogiro")
RADIUS = layout_of("pulley_radius", ROBOT)
SHOWS = Visible(Signal(RADIUS, {}, np.ones((4, 1))), 15.0, 0.5, 0.75, "", (), ())
TURNED = np.array([[0.4, 0.25, 0.1, *quat_from_rotvec(np.radians([0.0, 30.0, 0.0]))]])


def plan(**changes: Any) -> Plan:
    data = SimpleNamespace(n_rows=2)
    planned: Any = SimpleNamespace(
        unsolved=np.zeros(2, bool), problem=SimpleNamespace(data=data, robot=ROBOT)
    )
    return replace(Plan(planned, (SHOWS,), {}, ((), np.zeros((0, 0))), (), (), ()), **changes)


def printed(found: Plan, files: tuple[str, ...] = ()) -> list[str]:
    with redirect_stdout(StringIO()) as out:
        print_plan(found, Path("here"), files)
    return out.getvalue().splitlines()


def test_an_effect_with_an_exact_twin_has_no_size_to_name_it() -> None:
    size = f"radius {0.5e3 * RADIUS.scale[0]:.2g} mm"
    named = f"radius {0.75e3 * RADIUS.scale[0]:.2g} mm"
    for found, cells in (
        (SHOWS, [size, named]), (replace(SHOWS, twins=("a",)), [size, "-", "a (exactly)"]),
    ):  # fmt: skip
        row = next(x for x in printed(plan(effects=(found,))) if x.startswith("pulley_radius"))
        rest = row.removeprefix("pulley_radius").split("  ")
        assert [cell.strip() for cell in rest if cell.strip()] == cells


def test_only_what_reaches_the_needed_signal_is_proposed_and_three_gains_are_told() -> None:
    enough = tuple(Gain(name, "", 0.0, 20.0, 15.0) for name in "abcd")
    little = Gain("e", "", 0.0, 10.0, 15.0)
    add = Suggestion(Adding.POSES, "turn it", (*enough, little), TURNED)
    near = Suggestion(Adding.TENSIONS, "read tensions", (little,))
    found = plan(suggestions=(add, near))
    lines = printed(found)
    (line,) = [line for line in lines if line.startswith("add: ")]
    assert line.startswith("add: turn it: makes a visible ") and line.endswith("; and 1 more")
    assert "     (0.4 0.25 0.1) m, turned by (0 30 0) deg" in lines
    assert [line for line in found.lines() if line.startswith("add")] == ["add: turn it"]


def test_poses_that_leave_cables_slack_name_these() -> None:
    two = np.concatenate([TURNED, TURNED])
    add = Suggestion(Adding.POSES, "", (), two, slack=((), ("cable2", "cable7")))
    assert [place.partition(" deg")[2] for place in add.places] == ["", ", slack: cable2 cable7"]
    assert add.as_json()["slack"] == ((), ("cable2", "cable7"))
    assert Suggestion(Adding.PAYLOAD, "", ()).as_json()["slack"] is None


def test_cables_near_slack_are_listed_up_to_five() -> None:
    slack = tuple((line, "cable1") for line in range(2, 9))
    (line,) = [line for line in printed(plan(slack=slack)) if line.startswith("Close to the limit")]
    assert "line 6 (cable1) and 2 more. At these" in line
    assert not any("Close to" in line for line in printed(plan()))


def test_what_cannot_be_looked_for_and_what_is_written_is_said() -> None:
    missing = {"creep": Reason(Why.UNSEEN)}
    lines = printed(plan(missing=missing), ("a.csv", "b.csv"))
    assert f"creep: not testable with these data: {Reason(Why.UNSEEN).words}" in lines
    assert lines[-1] == "Results in here/, commands in a.csv, b.csv"
    assert printed(plan())[-1] == "Results in here/"


def test_a_plan_counts_what_shows_and_what_can_be_named() -> None:
    hidden = replace(SHOWS, factor=2.0)
    twin = replace(SHOWS, twins=("a",))
    words = plan(effects=(SHOWS, twin, hidden)).sentence
    assert words.startswith("Of 3 effects, 2 would be visible at an expected size and 1 of these")
    assert "so few rows (2)" in plan(effects=()).sentence
    lost: Any = SimpleNamespace(unsolved=np.ones(2, bool), problem=None)
    assert "no equilibrium at any of the rows" in plan(effects=(), planned=lost).sentence
