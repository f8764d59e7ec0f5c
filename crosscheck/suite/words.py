"""Figures of the suite as people read them: the one place where they get units and rounding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crosscheck.suite.agreement import QUANTITIES
from crosscheck.suite.verdicts import FINDINGS, Verdict

if TYPE_CHECKING:
    from crosscheck.suite.results import Run
    from crosscheck.suite.run import CaseResult, Worst

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
_RESULT = {0: "agree", 1: "DIFFER", 3: "NOT CONVERGED"}


def difference(worst: Worst | None) -> str:
    """A difference for a table's cell."""
    return "–" if worst is None else f"{worst.value:.1e}"


def outcome(result: CaseResult) -> str:
    """What became of a case, one word or two."""
    return _RESULT[result.exit_status]


def remarks(result: CaseResult) -> str:
    """Counts of poses that do not simply agree, and of widened thresholds."""
    parts = [f"{result.count(v)} {text}" for v, text in _SHORT.items() if result.count(v)]
    widened = int(result.allowance.widened.sum())
    if widened:
        parts.append(f"{widened} widened")
    return ", ".join(parts)


def cells(result: CaseResult) -> list[str]:
    """A case as a row: name, poses, the five worst differences, times, result, remarks."""
    worst = result.worst
    return [
        result.case.name,
        str(len(result)),
        *(difference(worst.get(name)) for name in QUANTITIES),
        f"{result.seecr_us:.0f}",
        f"{result.mujoco_ms:.1f}",
        outcome(result),
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
    """How it ended, and the difference nearest to, or furthest over, what is allowed.

    Of effects only those that fail are named here; where nothing else was run, it is theirs.
    """
    from crosscheck.suite import effect_words as effect_figures
    from crosscheck.suite.run import worst_of

    if not run.results:
        return effect_figures.line(run.effects)
    total = sum(len(result) for result in run.results)
    aside = sum(run.count(verdict) for verdict in FINDINGS)
    poses = f"{count(total, 'pose')} of {count(len(run.results), 'case')}"
    if aside:
        poses = f"{total - aside} of {poses} ({count(aside, 'finding')})"
    bad = [result.case.name for result in run.results if result.exit_status]
    bad += [result.task.name for result in run.effects if result.exit_status]
    start = {
        0: f"SEECR and MuJoCo agree at {poses}",
        1: f"SEECR and MuJoCo differ in {name_list(bad)}",
        3: f"not every solve converged: see {name_list(bad)}",
    }[run.exit_status]
    return f"{start}; {worst_sentence(worst_of(run.results))}."


def worst_sentence(pair: tuple[CaseResult, Worst] | None) -> str:
    """The worst difference with its place."""
    if pair is None:
        return "no pose could be compared"
    result, worst = pair
    return (
        f"worst difference {worst.value:.2e} {_UNITS[worst.quantity]} "
        f"({NAMES[worst.quantity]}), {_share(worst.ratio)} what is allowed, in "
        f"{result.case.name} at pose {worst.pose}"
    )


def failures(result: CaseResult) -> list[str]:
    """One line for each pose of a case that fails it."""
    return [
        f"pose {finding.pose}, commanded {command(result, finding.pose)}: {finding.text}"
        for finding in result.findings
        if finding.verdict not in FINDINGS
    ]


def findings(result: CaseResult) -> list[str]:
    """One line for each finding of a case that does not fail it."""
    return [
        f"pose {finding.pose}, commanded {command(result, finding.pose)}: {finding.text}"
        for finding in result.findings
        if finding.verdict in FINDINGS
    ]


def widened(result: CaseResult) -> list[str]:
    """One line for each pose whose thresholds are wider than those given."""
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
    """A commanded pose, position [m] and quaternion."""
    row = result.case.poses[pose]
    return f"({' '.join(f'{v:.4g}' for v in row[:3])}; {' '.join(f'{v:.4g}' for v in row[3:])})"


def _share(ratio: float) -> str:
    """A ratio as a percentage, in no more digits than it needs."""
    if ratio >= 10.0:
        return f"{ratio:.3g} times"
    return f"{100 * ratio:.2g} % of" if ratio < 1.0 else f"{100 * ratio:.4g} % of"


def count(number: int, noun: str) -> str:
    """A number with its noun."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def name_list(names: Sequence[str], most: int = 4) -> str:
    """The first few names, and how many more."""
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest
