"""The result of a case: both physics' answers, their differences, and how the case ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from crosscheck.suite.agreement import QUANTITIES, Allowance, Differences, ratios
from crosscheck.suite.cases import Case
from crosscheck.suite.mujoco_robot import MujocoRobot
from crosscheck.suite.outcome import Outcome
from crosscheck.suite.verdicts import UNSOLVED, PoseFinding, Verdict
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.result import COORDINATES, Record, Result, named, rows_of
from seecr.statics.solution import Solution

if TYPE_CHECKING:
    from crosscheck.settle.settler import SettlingBatch


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
        return 1e3 * float(np.sum(self.settling.wall_s)) / len(self)

    def lines(self) -> list[str]:
        """The outcome, the worst difference, and each pose that does not simply agree."""
        from crosscheck.suite import words

        return [words.case_line(self), *words.failures(self), *words.findings(self)]

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
            "poses": {"total": len(self), **counts(self)},
            "worst": self.worst,
            "widened": np.flatnonzero(self.allowance.widened),
            "findings": self.findings,
            "timing": _timing(self),
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

    def mujoco_robot(self) -> MujocoRobot:
        """A new MuJoCo robot for the case, to settle one of its poses again."""
        return MujocoRobot(self.case.mujoco_model, self.case.mujoco_ea)


def worst_of(results: Sequence[CaseResult]) -> tuple[CaseResult, Worst] | None:
    """The case and difference nearest to its allowance, or farthest beyond it."""
    pairs = [(result, worst) for result in results for worst in result.worst.values()]
    return max(pairs, key=lambda pair: pair[1].ratio, default=None)


class Counted(Protocol):
    """Objects that count poses by their verdict."""

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""


def counts(counted: Counted) -> dict[str, int]:
    """Number of poses with each verdict, by the verdict's name in lower case."""
    return {verdict.name.lower(): counted.count(verdict) for verdict in Verdict}


def _timing(result: CaseResult) -> dict[str, float]:
    settle_s = np.mean([one.rest.wall_s for one in result.settling])
    polish_s = np.mean([one.polished.wall_s for one in result.settling])
    return {
        "seecr_us_per_pose": result.seecr_us,
        "mujoco_settle_ms_per_pose": 1e3 * float(settle_s),
        "mujoco_polish_ms_per_pose": 1e3 * float(polish_s),
        "case_s": result.wall_s,
    }
