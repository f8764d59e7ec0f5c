"""Numbers of the suite as people read them: the one place where they get units and rounding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crosscheck.suite.agreement import QUANTITIES
from crosscheck.suite.effects import LOADS, ORIENTATION_RAD, POSITION_M, Counterpart
from crosscheck.suite.outcome import Outcome
from crosscheck.suite.verdicts import FINDINGS, PoseFinding, Verdict
from seecr.counted import counted, some

if TYPE_CHECKING:
    from crosscheck.suite.effects import EffectResult
    from crosscheck.suite.results import CaseResult, Worst
    from crosscheck.suite.run import Run
    from seecr.pose import Array

HEADS = {
    "settled_position_m": "settled [m]",
    "settled_orientation_rad": "settled [rad]",
    "position_m": "polished [m]",
    "orientation_rad": "polished [rad]",
    "tension_N": "tension [N]",
}
"""Column heads of the quantities, in the order of ``QUANTITIES``."""

NAMES = {
    "settled_position_m": "position after plain settling",
    "settled_orientation_rad": "orientation after plain settling",
    "position_m": "position",
    "orientation_rad": "orientation",
    "tension_N": "tension of a cable",
}
_UNITS = {name: head[head.index("[") + 1 : -1] for name, head in HEADS.items()}
_SHORT = {
    Verdict.NEUTRAL: "free to move",
    Verdict.BRANCH: "two equilibria",
    Verdict.DIFFERS: "differ",
    Verdict.SEECR_UNSOLVED: "SEECR unsolved",
    Verdict.MUJOCO_UNSOLVED: "MuJoCo unsolved",
}


def difference(worst: Worst | None) -> str:
    """A difference for a cell of a table."""
    return "–" if worst is None else f"{worst.value:.1e}"


def remarks(result: CaseResult) -> str:
    """Counts of poses that do not simply agree, and of widened thresholds."""
    parts = [_counted(result, verdict) for verdict in _SHORT if result.count(verdict)]
    widened = int(result.allowance.widened.sum())
    if widened:
        parts.append(f"{widened} widened")
    return ", ".join(parts)


def _counted(result: CaseResult, verdict: Verdict) -> str:
    beyond = sum(one.beyond_limits for one in result.findings if one.verdict is verdict)
    too_many = f" ({beyond} beyond limits)" if beyond else ""
    return f"{result.count(verdict)} {_SHORT[verdict]}{too_many}"


def cells(result: CaseResult) -> list[str]:
    """A case as a row: name, poses, the five worst differences, times, result, remarks."""
    worst = result.worst
    return [
        result.case.name,
        str(len(result)),
        *(difference(worst.get(name)) for name in QUANTITIES),
        f"{result.seecr_us:.0f}",
        f"{result.mujoco_ms:.1f}",
        result.outcome.value,
        remarks(result),
    ]


TABLE_HEADS = ["case", "poses", *HEADS.values(), "SEECR [µs]", "MuJoCo [ms]", "result", "remarks"]


def threshold_cells(run: Run) -> list[str]:
    """The thresholds as a row of the same table."""
    settled, polished = run.thresholds.settled, run.thresholds.polished
    values = [
        settled.position_m,
        settled.orientation_rad,
        polished.position_m,
        polished.orientation_rad,
        polished.tension_N,
    ]
    return ["allowed", "", *(f"{value:.0e}" for value in values), "", "", "", ""]


def verdict_line(run: Run) -> str:
    """How the run ended, and the difference nearest to its allowance or farthest beyond it.

    Effects are only named here if they fail; if nothing else was run, the line is about them.
    """
    if not run.every:
        return "Nothing was run."
    if not run.results:
        return effects_line(run.effects)
    total = sum(len(result) for result in run.results)
    aside = sum(run.count(verdict) for verdict in FINDINGS)
    poses = f"{counted(total, 'pose')} of {counted(len(run.results), 'case')}"
    if aside:
        poses = f"{total - aside} of {poses} ({counted(aside, 'finding')})"
    bad = [r.case.name for r in run.every if r.outcome is not Outcome.AGREE]
    start = {
        Outcome.AGREE: f"SEECR and MuJoCo agree at {poses}",
        Outcome.DIFFER: f"SEECR and MuJoCo differ in {some(bad)}",
        Outcome.NOT_CONVERGED: f"not every solve converged: see {some(bad)}",
    }[run.outcome]
    return f"{start}; {worst_sentence(run.worst)}."


def worst_sentence(pair: tuple[CaseResult, Worst] | None) -> str:
    """The worst difference, with case and pose."""
    if pair is None:
        return "no pose could be compared"
    result, worst = pair
    return (
        f"worst difference {worst.value:.2e} {_UNITS[worst.quantity]} ({NAMES[worst.quantity]}), "
        f"{_share(worst.ratio)} the allowed one, in {result.case.name} at pose {worst.pose}"
    )


def failures(result: CaseResult) -> list[str]:
    """One line for each pose that makes a case fail."""
    return [_line(result, finding) for finding in result.findings if finding.fails]


def findings(result: CaseResult) -> list[str]:
    """One line for each finding that does not make a case fail."""
    return [_line(result, finding) for finding in result.findings if not finding.fails]


def _line(result: CaseResult, finding: PoseFinding) -> str:
    limits = " (beyond the limits in thresholds.toml)" if finding.beyond_limits else ""
    return f"pose {finding.pose}, commanded {command(result, finding.pose)}: {finding.text}{limits}"


def case_line(result: CaseResult) -> str:
    """A case in a line: name, poses, outcome, the worst difference."""
    worst = max(result.worst.values(), key=lambda one: one.ratio, default=None)
    poses, pair = counted(len(result), "pose"), None if worst is None else (result, worst)
    notes = f" ({remarks(result)})" if remarks(result) else ""
    return f"{result.case.name}: {poses}, {result.outcome.value}{notes}; {worst_sentence(pair)}"


def widened_lines(result: CaseResult) -> list[str]:
    """One line for each pose with widened thresholds."""
    rows = [i for i, wide in enumerate(result.allowance.widened) if wide]
    return [
        f"pose {i}, commanded {command(result, i)}: allowed "
        + ", ".join(
            f"{getattr(result.allowance, name)[i]:.1e} {_UNITS[name]} ({NAMES[name]})"
            for name in QUANTITIES
        )
        + f"; the smallest stiffness there is {result.solution.smallest_eigenvalue[i]:.1e} N/m"
        for i in rows
    ]


def command(result: CaseResult, pose: int) -> str:
    """A commanded pose, position [m] and quaternion, and its start if that is elsewhere."""
    case = result.case
    begun = "" if case.starts is None else f", started at {_pose(case.starts[pose])}"
    return f"{_pose(case.poses[pose])}{begun}"


def _pose(row: Array) -> str:
    return f"({' '.join(f'{v:.4g}' for v in row[:3])}; {' '.join(f'{v:.4g}' for v in row[3:])})"


def _share(ratio: float) -> str:
    """A ratio as a percentage, with no more digits than it needs."""
    if ratio >= 10.0:
        return f"{ratio:.3g} times"
    return f"{100 * ratio:.2g} % of" if ratio < 1.0 else f"{100 * ratio:.4g} % of"


EFFECT_HEADS = [
    "effect", "robot", "moves [m]", "position [m]", "orientation [rad]", "tension [N]", "result",
    "against",
]  # fmt: skip


def effects_line(results: Sequence[EffectResult]) -> str:
    """How many effects agree, with what, the worst differences, and those that do not agree."""
    every = [result.case.model for result in results]
    robots = {model for model in every if every.count(model) > 1} or set(every)
    alone = [f"{r.case.effect} on {r.case.model.stem}" for r in results
             if r.case.model not in robots]  # fmt: skip
    effects = {result.case.effect for result in results} - {LOADS}
    loads = " and known loads" if any(result.case.effect == LOADS for result in results) else ""
    bad = [result.case.name for result in results if result.outcome is not Outcome.AGREE]
    verdict = "all agree"
    if bad:
        verb = "does" if len(bad) == 1 else "do"
        verdict = f"{len(bad)} of {counted(len(results), 'case')} {verb} not agree: {some(bad)}"
    worst = max(results, key=lambda result: result.worst[0])
    orientation = max(result.worst[1] for result in results)
    tension = max(result.worst[2] for result in results)
    return (
        f"{counted(len(effects), 'effect')}{loads} on {counted(len(robots), 'robot')}"
        f"{''.join(f', {name}' for name in alone)} against "
        f"{_counterparts(results)}: {verdict}; worst {worst.worst[0]:.1e} m "
        f"({worst.case.name}), {orientation:.1e} rad, {tension:.1e} N."
    )


def _counterparts(results: Sequence[EffectResult]) -> str:
    """How many effects are compared with what, in words."""
    kinds = {
        kind: {r.case.effect for r in results if r.case.against is kind} - {LOADS}
        for kind in Counterpart
    }
    parts = [f"{kind.value} ({len(names)})" for kind, names in kinds.items() if names]
    return " and ".join(parts)


def against_line(results: Sequence[EffectResult]) -> str:
    """What seecr's mathematics was compared with: MuJoCo's own means, or our own, written again."""
    kinds: dict[Counterpart, list[str]] = {}
    for result in results:
        kinds.setdefault(result.case.against, []).append(result.case.effect)
    return " ".join(
        f"Checked against {kind.value}: {', '.join(dict.fromkeys(names))}."
        for kind, names in kinds.items()
    )


def effect_text(result: EffectResult) -> str:
    """One effect's differences, the allowed ones, and the size of the effect itself."""
    position, orientation, tension = result.worst
    parts = [
        f"position {position:.1e} m, orientation {orientation:.1e} rad, tension {tension:.1e} N",
        f"allowed {POSITION_M:.0e} m, {ORIENTATION_RAD:.0e} rad, {result.tension_limit:.0e} N",
        f"the effect moves a reading by {result.moved_m:.1e} m",
    ]
    if result.unsolved:
        parts.append(
            f"no equilibrium at {result.unsolved} of {counted(len(result.compared), 'pose')}"
        )
    return "; ".join(parts)


def effect_failures(results: Sequence[EffectResult]) -> list[str]:
    """One line for each effect that fails."""
    bad = [result for result in results if result.outcome is not Outcome.AGREE]
    return [f"{result.case.name}: {effect_text(result)}" for result in bad]


def effect_cells(result: EffectResult) -> list[str]:
    """An effect as a row: name, robot, how far it moves a reading, differences, result."""
    values = (f"{value:.1e}" for value in (result.moved_m, *result.worst))
    case = result.case
    return [case.effect, case.model.stem, *values, result.outcome.value, case.against.value]
