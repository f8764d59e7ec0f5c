"""Before measuring: what planned poses will be able to show, and what to add to them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from crosscheck.fit.imitation import imitated
from crosscheck.fit.prepare import Progress
from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import commands_of
from crosscheck.planning.extensions import extensions
from crosscheck.planning.greedy import Wanted
from crosscheck.planning.planned import Planned, Reads, expected_sigma, near_slack, planned
from crosscheck.planning.proposer import propose
from crosscheck.planning.result import Plan, Visible
from crosscheck.planning.visibility import (
    EXACT,
    Signal,
    left_over,
    needed,
    signals,
    signals_like,
)
from seecr.pose import Array


def make_plan(
    robot: GivenRobot,
    commands: Measurements | str | Path,
    sigma: Sigma | None = None,
    progress: Progress = lambda _text, _part: None,
) -> Plan:
    """What planned commands will show of each effect.

    Args:
        robot: as described, or its MJCF.
        commands: planned poses or lengths, or their file; readings in it are ignored.
        sigma: noise to expect; the commands' own by default. With a tension noise, tensions
            count as recorded.
        progress: called with what is being done and the part of it that is done.
    """
    robot = robot_of(robot)
    commands = commands_of(commands, robot)
    full, assumed = expected_sigma(robot, sigma or commands.sigma)
    reads = Reads.whole(robot.n_cables, tensions=full.tension_N is not None)
    plan = planned(robot, commands, full, reads)
    notes = [*commands.notes, *assumed, *_unsolved(plan)]
    if not plan.problem.use.any():
        return Plan(plan, (), {}, ((), np.zeros((0, 0))), (), (), tuple(notes))
    progress("sensitivities", 0.1)
    own, missing = signals(plan)
    effects = _all_visible(own)
    progress("what could be added", 0.4)
    suggestions = propose(
        list(extensions(plan)), own, _wanted(own, effects), lambda there: signals_like(there, own),
        lambda text, part: progress(text, 0.5 + 0.5 * part),
    )  # fmt: skip
    names = robot.cable_names
    return Plan(
        planned=plan,
        effects=tuple(sorted(effects.values(), key=lambda v: v.factor)),
        missing=missing,
        confusion=_confusion(own),
        suggestions=suggestions,
        slack=tuple((int(commands.line[k]), names[i]) for k, i in near_slack(plan)),
        notes=tuple(dict.fromkeys(notes)),
    )


def _unsolved(plan: Planned) -> list[str]:
    rows = np.flatnonzero(plan.unsolved)
    if len(rows) == 0:
        return []
    lines = plan.problem.data.places(rows)
    status = plan.base.state.prediction.solution().status[rows[0]].value
    return [f"lines {lines} left out: {status}"]


def _all_visible(own: Mapping[str, Signal]) -> dict[str, Visible]:
    return {name: _visible(name, own) for name in own}


def _visible(name: str, own: Mapping[str, Signal]) -> Visible:
    g = own[name]
    need = needed(g.directions, len(own))
    power = g.power
    left = {other: left_over(g, s) for other, s in own.items() if other != name}
    twins = tuple(o for o, value in left.items() if power > 0 and value <= EXACT * power)
    rest = {o: value for o, value in left.items() if o not in twins}
    imitator = min(rest, key=lambda o: rest[o]) if rest else ""
    least = rest[imitator] if imitator else power
    confused: list[tuple[str, float]] = []
    if power >= need:
        near = sorted((value, o) for o, value in rest.items() if value < need)
        confused = [(o, value) for value, o in near]
    return Visible(
        g, need, _size(need, power), _size(need, least), imitator, tuple(confused), twins
    )


def _size(need: float, power: float) -> float:
    return float(np.sqrt(need / power)) if power > 0 else np.inf


def _confusion(own: Mapping[str, Signal]) -> tuple[tuple[str, ...], Array]:
    names = tuple(own)
    table = np.eye(len(names))
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            if i != j:
                table[i, j] = imitated(own[a].columns, own[b].basis)
    return names, table


def _wanted(own: Mapping[str, Signal], effects: Mapping[str, Visible]) -> list[Wanted]:
    """What these poses do not show or tell apart.

    Exact twins count: poses never part them, but a payload or a sensor may.
    """
    out = []
    for name, v in effects.items():
        if not v.visible:
            out.append(Wanted(name, "", own[name].power, v.needed))
            continue
        out += [Wanted(name, other, value, v.needed) for other, value in v.confused]
        out += [Wanted(name, twin, 0.0, v.needed) for twin in v.twins]
    return out
