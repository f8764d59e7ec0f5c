"""The suite: its results on the terminal, and the texts of a case's recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crosscheck.show.blocks import Block, Bold, Cell, Code, Items, Line, Styled, TextTable, section
from crosscheck.show.texts import markdown, pose_heading, printed, terminal
from crosscheck.suite.effects import effect_failures, effects_line
from crosscheck.suite.results import (
    QUANTITY_HEADS,
    TABLE_HEADS,
    CaseResult,
    case_cells,
    failure_lines,
    widened_lines,
)
from crosscheck.suite.run import Run, threshold_cells, verdict_line
from crosscheck.suite.verdicts import FINDINGS, Outcome, Verdict
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.pose import Array, pose_difference, rxyz_from_quat

_STYLE = {Outcome.AGREE: "green", Outcome.DIFFER: "bold red", Outcome.NOT_CONVERGED: "bold yellow"}
# Failures told on the terminal; summary.md and results.json have them all.
_MOST = 5
# Columns of words, of the case's result, and those shown on any terminal.
_RESULT = TABLE_HEADS.index("result")
_WORDS = (0, _RESULT, _RESULT + 1)
_ESSENTIAL = (0, *(TABLE_HEADS.index(head) for head in QUANTITY_HEADS.values()), _RESULT)
_ROOMY = 124

_KINDS = {
    "sweep": "poses along a line",
    "random": "poses at random",
    "starts": "starts of one command",
}
_TITLES = {
    "position_m": "position",
    "orientation_rad": "orientation",
    "tension_N": "tension",
    "settled_position_m": "position, plain settling",
    "settled_orientation_rad": "orientation, plain settling",
}
_LISTED = 12
_SCENE = (
    " White edges: the commanded platform. Blue box: SEECR's answer. Orange edges: MuJoCo's. Blue "
    "inside orange means that both agree. A thick cable pulls, coloured by its tension; a grey "
    "dashed one hangs slack."
)
_LINES, _CROSSES = "Lines are SEECR, dots MuJoCo.", "Crosses are SEECR, the dots on them MuJoCo."
_LOGARITHM = (
    "The lowest plot is their difference as a decimal logarithm: -9 is a billionth of a metre."
)


# --- terminal -------------------------------------------------------------------------------------


@printed
def print_run(run: Run, out: Path) -> Iterator[Block]:
    """Print the table, what needs a look, the verdict, and where the files are."""
    if run.results:
        yield _table(run, terminal().width)
    for result in run.results:
        name = result.case.name
        yield from _first([f"{name}, {line}" for line in _notes(result)], name)
    for verdict in FINDINGS:
        if run.count(verdict):
            poses = counted(run.count(verdict), "pose")
            yield Line(f"Finding at {poses}: {verdict.value}.")
    yield from _first(effect_failures(run.effects), "effects")
    if run.effects and run.results:
        yield Line(effects_line(run.effects))
    yield Line(verdict_line(run), _STYLE[run.outcome])
    yield Line(f"{run.wall_s:.1f} s; results in {out}/")


def _table(run: Run, width: int) -> TextTable:
    """The cases, without the columns that are left out where the terminal is narrow."""
    shown = [i for i in range(len(TABLE_HEADS)) if width >= _ROOMY or i in _ESSENTIAL]
    rows: list[list[Cell]] = []
    for result in run.results:
        cells: list[Cell] = [*case_cells(result)]
        cells[_RESULT] = Styled(str(cells[_RESULT]), _STYLE[result.outcome])
        rows.append([cells[i] for i in shown])
    limits = threshold_cells(run)
    return TextTable(
        [TABLE_HEADS[i] if i in _WORDS else f"#{TABLE_HEADS[i]}" for i in shown],
        [*rows, [limits[i] for i in shown]],
        [*([""] * len(rows)), "dim"],
        "whole",
    )


def _notes(result: CaseResult) -> list[str]:
    """Failures, branches and widened thresholds of a case; its free motions are only counted."""
    branches = [f for f in result.findings if f.verdict is Verdict.BRANCH and not f.fails]
    return [
        *failure_lines(result),
        *(f"pose {f.pose}: {f.text}" for f in branches),
        *widened_lines(result),
    ]


def _first(lines: list[str], name: str) -> Iterator[Block]:
    """The first few lines about a case or the effects, and how many more there are."""
    yield Items(lines[:_MOST])
    if len(lines) > _MOST:
        yield Line(f"{name}: {len(lines) - _MOST} more in summary.md")


# --- texts of a recording -------------------------------------------------------------------------


def guide_text(result: CaseResult, along: str, watched: int | None) -> str:
    """What to look at in a case, and its worst numbers.

    Poses are over the timeline ``along``; ``watched`` is the one whose settling is shown, if any.
    """
    case, robot, count = result.case, result.robot, len(result.case.poses)
    marks = _LINES if case.kind == "sweep" else _CROSSES
    settling = "" if watched is None else (
        " (choose it at the bottom left) is MuJoCo alone: it lets go of the platform at command "
        f"{watched}, which comes to rest on SEECR's answer. Seconds are simulated; the platform is "
        "stopped at each peak of its motion energy, so it swings less than a real one would."
    )  # fmt: skip
    more = [" The timeline ", Code("settling_time"), settling] if settling else []
    worst = [
        [_TITLES[name], _number(one.value, name.rsplit("_", 1)[1]), str(one.pose),
         _number(one.allowed, name.rsplit("_", 1)[1])]
        for name, one in result.worst.items()
    ]  # fmt: skip
    findings = _findings(result)
    blocks = [
        Line(f"{counted(robot.n_cables, 'cable')}, {robot.mass:g} kg, {robot.weight:.3g} N of "
             f"weight; {count} {_KINDS.get(case.kind, 'poses')}."),
        Line((Bold("Scene."), _SCENE)),
        Line((Bold("Plots."), f" {marks} {_LOGARITHM}")),
        Line((Bold("Play."), " The timeline ", Code(along),
              f" goes through the {counted(count, 'command')}.", *more)),
        section("Findings", Items(findings)) if findings else None,
        section("Largest differences",
                TextTable(["quantity", "largest", "pose", "allowed"], worst) if worst
                else Line("No pose could be compared: see the findings.")),
    ]  # fmt: skip
    return markdown([block for block in blocks if block is not None], case.name)


def _findings(result: CaseResult) -> list[str]:
    """Poses by verdict, except those that agree."""
    lines = []
    for verdict in Verdict:
        rows = [str(i) for i in np.flatnonzero(result.verdict == verdict)]
        if verdict is not Verdict.AGREES and rows:
            listed = ", ".join(rows[:_LISTED]) + (" …" if len(rows) > _LISTED else "")
            lines.append(f"pose {listed}: {verdict.value}")
    return lines


def pose_numbers_text(result: CaseResult, i: int, pose: Array) -> str:
    """The numbers of one pose.

    Args:
        result: the case's. i: the pose, counted from 0. pose: (7,) SEECR's answer, NaN for none.
    """
    command, gap = result.case.poses[i], result.difference
    x, y, z = 1e3 * command[:3]
    rx, ry, rz = np.degrees(rxyz_from_quat(command[3:])) + 0.0
    moves = turns = "no answer"
    if np.isfinite(pose).all():
        dx, dy, dz = 1e3 * (pose[:3] - command[:3])
        angle = np.degrees(np.linalg.norm(pose_difference(pose, command)[3:]))
        moves, turns = f"dx {dx:+.2f}, dy {dy:+.2f}, dz {dz:+.2f} mm", f"{angle:.2f}°"
    rows = [
        ("command", f"x {x:.2f}, y {y:.2f}, z {z:.2f} mm"),
        # R = Rx(rx) Ry(ry) Rz(rz)
        ("turned", f"rx {rx:.2f}, ry {ry:.2f}, rz {rz:.2f}°"),
        ("SEECR moves by", moves),
        ("SEECR turns by", turns),
        ("slack", slack_names(result.robot, result.solution.slack[i])),
        ("MuJoCo differs by", _number(gap.position_m[i], "m")),
        ("in orientation by", _number(gap.orientation_rad[i], "rad")),
        ("in tension by", _number(gap.tension_N[i], "N")),
    ]
    more = [Line(f.text) for f in result.findings if f.pose == i]
    blocks: list[Block] = [*(more or [Line(result.verdict[i].value)]), TextTable([], rows)]
    return f"{pose_heading(i, len(result.case.poses))}\n{markdown(blocks)}"


def instant_text(t_s: float, kinetic: float, distance: Array, slack: str) -> str:
    """The numbers of one instant of a settling: time [s], kinetic energy [J], and the distance (2,)
    [m, rad] from SEECR's answer.
    """
    rows = [
        ("from SEECR's answer", _number(1e3 * distance[0], "mm")),
        ("rotation from it", _number(np.degrees(distance[1]), "°")),
        ("kinetic energy", _number(kinetic, "J")),
        ("slack cables", slack),
    ]
    return f"## Settling, {t_s:.3f} s\n{markdown([TextTable([], rows)])}"


def slack_names(robot: Robot, slack: NDArray[np.bool_]) -> str:
    """The names of slack cables (m,)."""
    return ", ".join(n for n, yes in zip(robot.cable_names, slack, strict=True) if yes) or "none"


def _number(value: float, unit: str) -> str:
    """A number with its unit, or a dash if there is none."""
    return f"{value:.3g} {unit}" if np.isfinite(value) else "–"
