"""Figures of the suite's effects as people read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crosscheck.suite.effect_cases import ORIENTATION_RAD, POSITION_M, TENSION_N
from crosscheck.suite.words import count, name_list

if TYPE_CHECKING:
    from crosscheck.suite.effect_suite import EffectResult

_VALUES = ["moves [m]", "position [m]", "orientation [rad]", "tension [N]"]
TABLE_HEADS = ["effect", "robot", *_VALUES, "result"]
_RESULT = {0: "agree", 1: "DIFFER", 3: "NOT CONVERGED"}


def line(results: Sequence[EffectResult]) -> str:
    """How many effects agree with MuJoCo, the worst differences, and those that do not agree."""
    robots = {result.task.robot for result in results}
    effects = {result.task.effect for result in results}
    bad = [result.task.name for result in results if result.exit_status]
    verdict = "all agree with MuJoCo"
    if bad:
        verdict = f"{len(bad)} of {count(len(results), 'case')} not as MuJoCo: {name_list(bad)}"
    worst = max(results, key=lambda result: result.position_m)
    orientation = max(result.orientation_rad for result in results)
    tension = max(result.tension_N for result in results)
    return (
        f"{count(len(effects), 'effect')} on {count(len(robots), 'robot')}: {verdict}; worst "
        f"{worst.position_m:.1e} m ({worst.task.name}), {orientation:.1e} rad, {tension:.1e} N."
    )


def text(result: EffectResult) -> str:
    """One effect's differences, what is allowed, and what the effect itself does."""
    parts = [
        f"position {result.position_m:.1e} m, orientation {result.orientation_rad:.1e} rad, "
        f"tension {result.tension_N:.1e} N",
        f"allowed {POSITION_M:.0e} m, {ORIENTATION_RAD:.0e} rad, {TENSION_N:.0e} N",
        f"the effect moves a reading by {result.moved_m:.1e} m",
    ]
    if result.unsolved:
        parts.append(f"no rest at {result.unsolved} of {count(result.rows, 'pose')}")
    return "; ".join(parts)


def failures(results: Sequence[EffectResult]) -> list[str]:
    """One line for each effect that fails."""
    return [f"{result.task.name}: {text(result)}" for result in results if result.exit_status]


def cells(result: EffectResult) -> list[str]:
    """An effect as a row: its name, robot, how far it moves a reading, differences, result."""
    values = (result.moved_m, result.position_m, result.orientation_rad, result.tension_N)
    names = [result.task.effect, result.task.robot]
    return [*names, *(f"{value:.1e}" for value in values), _RESULT[result.exit_status]]
