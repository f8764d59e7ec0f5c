"""The result of a case: both physics' answers, their differences, and how the case ended.

The functions at the end give its numbers units and rounding, as people read them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.settler import SettlingBatch
from crosscheck.suite.agreement import QUANTITIES, Allowance, Differences, ratios
from crosscheck.suite.cases import Case
from crosscheck.suite.verdicts import UNSOLVED, Outcome, PoseFinding, Verdict
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.result import COORDINATES, Record, Result, named, rows_of
from seecr.statics.solution import Solution

_UNITS = {name: name.rpartition("_")[2] for name in QUANTITIES}
QUANTITY_HEADS = {name: f"{head} [{_UNITS[name]}]" for name, (head, _words) in QUANTITIES.items()}
"""Column heads of the quantities, in their order."""
QUANTITY_NAMES = {name: words for name, (_head, words) in QUANTITIES.items()}
_SHORT = {
    Verdict.NEUTRAL: "free to move",
    Verdict.BRANCH: "two equilibria",
    Verdict.DIFFERS: "differ",
    Verdict.SEECR_UNSOLVED: "SEECR unsolved",
    Verdict.MUJOCO_UNSOLVED: "MuJoCo unsolved",
}


@dataclass(frozen=True, eq=False)
class Worst:
    """The largest difference of one quantity over a case, relative to its allowance.

    Attributes:
        quantity: one of ``QUANTITIES``.
        value: the difference [m, rad or N].
        allowed: its allowance at that pose.
        pose: its number in the case, from 0.
    """

    quantity: str
    value: float
    allowed: float
    pose: int

    @property
    def ratio(self) -> float:
        """Difference over allowance: above 1 it fails."""
        return self.value / self.allowed

    def as_json(self) -> dict[str, Any]:
        """As in ``results.json``."""
        return {**asdict(self), "ratio": self.ratio}


@dataclass(frozen=True, eq=False, repr=False)
class CaseResult(Result):
    """One case as both physics answered it. All arrays have the n poses of the case in order.

    Attributes:
        case: what was run; ``case.poses`` (n, 7) are the commanded poses.
        robot: as SEECR read it, with the case's cable.
        solution: SEECR's answers: ``pose`` (n, 7), ``tensions`` (n, m) [N], ``slack`` (n, m),
            ``deviation`` (n, 6), ``residual``, ``status``, ``smallest_eigenvalue``, ... (n,).
        settling: MuJoCo's answers, the same way: ``settled_pose`` (n, 7) after plain settling,
            ``pose`` (n, 7), ``tensions`` (n, m) [N], ``slack`` (n, m) after the polish,
            ``settled_residual``, ``residual``, ``steps``, ``simulated_s``, ``status``,
            ``smallest_eigenvalue``, ... (n,).
        mujoco_rest_lengths: (n, m) [m] as MuJoCo's side paid them out.
        ignored: features of MuJoCo's MJCF that were switched off, such as "contacts".
        difference: between the two, NaN if one has no answer.
        allowance: allowed differences, (n,) each.
        verdict: (n,) of :class:`crosscheck.suite.verdicts.Verdict`.
        findings: details of every pose whose verdict is not ``AGREES``.
        seecr_s: [s] SEECR's time for all poses on one processor, after compilation.
        wall_s: [s] time of the whole case, recording included.
        recording: name of its recording in the results' folder; None if there is none.
    """

    case: Case
    robot: Robot
    solution: Solution
    settling: SettlingBatch
    mujoco_rest_lengths: Array
    ignored: tuple[str, ...]
    difference: Differences
    allowance: Allowance
    verdict: NDArray[np.object_]
    findings: tuple[PoseFinding, ...]
    seecr_s: float
    wall_s: float = np.nan
    recording: str | None = None

    def __len__(self) -> int:
        return len(self.verdict)

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""
        return int(np.sum(self.verdict == verdict))

    @property
    def compared(self) -> NDArray[np.bool_]:
        """Poses whose differences are meaningful: no free motion or second equilibrium, (n,)."""
        return np.asarray((self.verdict == Verdict.AGREES) | (self.verdict == Verdict.DIFFERS))

    @property
    def outcome(self) -> Outcome:
        """How the case ended."""
        if self.count(Verdict.DIFFERS) or any(one.beyond_limits for one in self.findings):
            return Outcome.DIFFER
        unsolved = any(self.count(verdict) for verdict in UNSOLVED)
        return Outcome.NOT_CONVERGED if unsolved else Outcome.AGREE

    @property
    def worst(self) -> dict[str, Worst]:
        """Largest difference of each quantity over its allowance; empty if nothing compares."""
        rows = np.flatnonzero(self.compared)
        if len(rows) == 0:
            return {}
        table = ratios(self.difference, self.allowance)[rows]
        found = {}
        for name, column in zip(QUANTITIES, table.T, strict=True):
            i = int(rows[np.argmax(column)])
            value, allowed = getattr(self.difference, name)[i], getattr(self.allowance, name)[i]
            found[name] = Worst(name, float(value), float(allowed), i)
        return found

    @property
    def seecr_us(self) -> float:
        """Microseconds that SEECR takes per pose, on one processor."""
        return 1e6 * self.seecr_s / len(self)

    @property
    def mujoco_ms(self) -> float:
        """Milliseconds that MuJoCo takes per pose, both stages, on one processor."""
        return 1e3 * float(np.mean(self.settling.settle_s + self.settling.polish_s))

    def lines(self) -> list[str]:
        """The outcome, the worst difference, and each pose that does not simply agree."""
        return [case_line(self), *failure_lines(self), *finding_lines(self)]

    def records(self) -> list[Record]:
        """One row per pose: the command, both answers, and their differences [SI]."""
        poses = {"cmd": self.case.poses, "seecr": self.solution.pose, "mujoco": self.settling.pose}
        columns: Record = {
            "pose": range(len(self)),
            "verdict": [verdict.name.lower() for verdict in self.verdict],
        }
        for name, rows in poses.items():
            columns |= named(f"{name}_{{}}", COORDINATES, rows)
        gaps = {f"difference_{name}": getattr(self.difference, name) for name in QUANTITIES}
        return rows_of(columns | gaps)

    def as_json(self) -> dict[str, Any]:
        """As in ``results.json``: every number, pose by pose."""
        case = self.case
        return {
            "name": case.name,
            "model": str(case.model),
            "mujoco_model": str(case.mujoco_model),
            "cable": case.cable,
            "kind": case.kind,
            "exit_status": self.outcome.exit_status,
            "poses": {"total": len(self), **counts(self.count)},
            "worst": self.worst,
            "widened": np.flatnonzero(self.allowance.widened),
            "findings": self.findings,
            "timing": {
                "seecr_us_per_pose": self.seecr_us,
                "mujoco_settle_ms_per_pose": 1e3 * float(np.mean(self.settling.settle_s)),
                "mujoco_polish_ms_per_pose": 1e3 * float(np.mean(self.settling.polish_s)),
                "case_s": self.wall_s,
            },
            "recording": self.recording,
            "ea_N": self.robot.ea,
            "command": case.poses,
            "start": case.begins,
            "rest_lengths_m": self.solution.rest_lengths,
            "verdict": self.verdict,
            "seecr": self.solution,
            "mujoco": {"rest_lengths_m": self.mujoco_rest_lengths, **self.settling.as_json()},
            "difference": asdict(self.difference) | {"tension_N": self.difference.tension_N},
            "allowed": self.allowance,
        }


def worst_of(results: Sequence[CaseResult]) -> tuple[CaseResult, Worst] | None:
    """The case and difference nearest to its allowance, or farthest beyond it."""
    pairs = [(result, worst) for result in results for worst in result.worst.values()]
    return max(pairs, key=lambda pair: pair[1].ratio, default=None)


def counts(count: Callable[[Verdict], int]) -> dict[str, int]:
    """Number of poses with each verdict, by the verdict's name in lower case."""
    return {verdict.name.lower(): count(verdict) for verdict in Verdict}


def remarks(result: CaseResult) -> str:
    """Counts of poses that do not simply agree, and of widened thresholds."""
    parts = []
    for verdict, words in _SHORT.items():
        if count := result.count(verdict):
            beyond = sum(one.beyond_limits for one in result.findings if one.verdict is verdict)
            parts.append(f"{count} {words}{f' ({beyond} beyond limits)' if beyond else ''}")
    if widened := int(result.allowance.widened.sum()):
        parts.append(f"{widened} widened")
    return ", ".join(parts)


def case_cells(result: CaseResult) -> list[str]:
    """A case as a row: name, poses, the five worst differences, times, result, remarks."""
    worst = result.worst
    return [
        result.case.name,
        str(len(result)),
        *(f"{worst[name].value:.1e}" if name in worst else "–" for name in QUANTITIES),
        f"{result.seecr_us:.0f}",
        f"{result.mujoco_ms:.1f}",
        result.outcome.value,
        remarks(result),
    ]


TABLE_HEADS = [
    "case",
    "poses",
    *QUANTITY_HEADS.values(),
    "SEECR [µs]",
    "MuJoCo [ms]",
    "result",
    "remarks",
]


def worst_sentence(pair: tuple[CaseResult, Worst] | None) -> str:
    """The worst difference, with case and pose."""
    if pair is None:
        return "no pose could be compared"
    result, worst = pair
    return (
        f"worst difference {worst.value:.2e} {_UNITS[worst.quantity]} "
        f"({QUANTITY_NAMES[worst.quantity]}), {_share(worst.ratio)} the allowed one, "
        f"in {result.case.name} at pose {worst.pose}"
    )


def failure_lines(result: CaseResult) -> list[str]:
    """One line for each pose that makes a case fail."""
    return [_line(result, finding) for finding in result.findings if finding.fails]


def finding_lines(result: CaseResult) -> list[str]:
    """One line for each finding that does not make a case fail."""
    return [_line(result, finding) for finding in result.findings if not finding.fails]


def _line(result: CaseResult, finding: PoseFinding) -> str:
    limits = " (beyond the limits in thresholds.toml)" if finding.beyond_limits else ""
    return f"{_pose_words(result, finding.pose)}: {finding.text}{limits}"


def case_line(result: CaseResult) -> str:
    """A case in a line: name, poses, outcome, the worst difference."""
    worst = max(result.worst.values(), key=lambda one: one.ratio, default=None)
    poses, pair = counted(len(result), "pose"), None if worst is None else (result, worst)
    notes = f" ({remarks(result)})" if remarks(result) else ""
    return f"{result.case.name}: {poses}, {result.outcome.value}{notes}; {worst_sentence(pair)}"


def widened_lines(result: CaseResult) -> list[str]:
    """One line for each pose with widened thresholds."""
    out = []
    for i in np.flatnonzero(result.allowance.widened).tolist():
        allowed = [
            f"{getattr(result.allowance, name)[i]:.1e} {_UNITS[name]} ({QUANTITY_NAMES[name]})"
            for name in QUANTITIES
        ]
        softest = result.solution.smallest_eigenvalue[i]
        out.append(
            f"{_pose_words(result, i)}: allowed {', '.join(allowed)}; the smallest stiffness there "
            f"is {softest:.1e} N/m"
        )
    return out


def _pose_words(result: CaseResult, pose: int) -> str:
    """A commanded pose, position [m] and quaternion, and its start if that is elsewhere."""
    case = result.case
    begun = "" if case.starts is None else f", started at {_numbers(case.starts[pose])}"
    return f"pose {pose}, commanded {_numbers(case.poses[pose])}{begun}"


def _numbers(row: Array) -> str:
    return f"({' '.join(f'{v:.4g}' for v in row[:3])}; {' '.join(f'{v:.4g}' for v in row[3:])})"


def _share(ratio: float) -> str:
    """A ratio as a percentage, with no more digits than it needs."""
    if ratio >= 10.0:
        return f"{ratio:.3g} times"
    return f"{100 * ratio:.{2 if ratio < 1.0 else 4}g} % of"
