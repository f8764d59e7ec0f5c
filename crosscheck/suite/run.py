"""The cross-check suite: every pose of every case solved by SEECR and settled by MuJoCo."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.suite.agreement import (
    QUANTITIES,
    Allowance,
    Differences,
    allowances,
    compare,
    ratios,
)
from crosscheck.suite.cases import Case, shipped_cases
from crosscheck.suite.mujoco_robot import MujocoRobot
from crosscheck.suite.pool import Pool
from crosscheck.suite.thresholds import Thresholds, load_thresholds
from crosscheck.suite.verdicts import UNSOLVED, Answers, PoseFinding, Verdict, held_to, judge
from seecr.equilibrium import solve as seecr_solve
from seecr.errors import InputFileError
from seecr.mjcf import load_robot
from seecr.pose import Array
from seecr.result import Record as Row
from seecr.result import Result
from seecr.robot import Robot
from seecr.solution import Solution

if TYPE_CHECKING:
    from crosscheck.settle.settler import SettlingBatch

# Columns of poses in a data frame.
_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
# SEECR takes microseconds: the best of this many runs is what it needs, the rest is the machine.
_REPEATS = 3


class Outcome(Enum):
    """How a case or a run ended; the value is the word that people read."""

    AGREE = "agree"
    DIFFER = "DIFFER"
    NOT_CONVERGED = "NOT CONVERGED"

    @property
    def exit_status(self) -> int:
        """0 agree (findings within limits), 1 differ by too much, 3 a solve did not converge."""
        return {Outcome.AGREE: 0, Outcome.DIFFER: 1, Outcome.NOT_CONVERGED: 3}[self]

    @classmethod
    def of_all(cls, outcomes: Iterable[Outcome]) -> Outcome:
        """A difference outweighs a solve without an answer."""
        found = set(outcomes)
        return next((one for one in (cls.DIFFER, cls.NOT_CONVERGED) if one in found), cls.AGREE)


@dataclass(frozen=True, eq=False)
class Worst:
    """The largest difference of one quantity over a case, against what was allowed there.

    Attributes:
        quantity: one of ``QUANTITIES``.
        value: the difference [m, rad or N].
        allowed: at that pose.
        pose: its number in the case, from 0.
    """

    quantity: str
    value: float
    allowed: float
    pose: int

    @property
    def ratio(self) -> float:
        """Difference over what is allowed: above 1 it fails."""
        return self.value / self.allowed

    def as_json(self) -> dict[str, Any]:
        """As in ``results.json``."""
        return {**asdict(self), "ratio": self.ratio}


@dataclass(frozen=True, eq=False, repr=False)
class CaseResult(Result):
    """One case as both physics answered it. All arrays have the n poses of the case in order.

    Attributes:
        case: what was run; ``case.poses`` (n, 7) are the commanded poses.
        robot: as SEECR read it, on the case's cable.
        solution: SEECR's answers: ``pose`` (n, 7), ``tensions`` (n, m) [N], ``slack`` (n, m),
            ``deviation`` (n, 6), ``residual``, ``status``, ``smallest_eigenvalue``, ... (n,).
        settling: MuJoCo's answers, the same way: ``settled_pose`` (n, 7) after plain settling,
            ``pose`` (n, 7), ``tensions`` (n, m) [N], ``slack`` (n, m) after the polish,
            ``settled_residual``, ``residual``, ``steps``, ``simulated_s``, ``status``,
            ``smallest_eigenvalue``, ... (n,).
        mujoco_rest_lengths: (n, m) [m] as MuJoCo's side paid them out.
        ignored: what of MuJoCo's MJCF was switched off, such as "contacts".
        difference: between the two, NaN where one has no answer.
        allowance: what may differ, (n,) each.
        verdict: (n,) of :class:`crosscheck.suite.verdicts.Verdict`.
        findings: more about every pose whose verdict is not ``AGREES``.
        seecr_s: [s] SEECR took for all poses on one processor, compiled beforehand.
        wall_s: [s] the whole case took, recording included.
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

    def lines(self) -> list[str]:
        """How it ended, the worst difference, and each pose that does not simply agree."""
        from crosscheck.suite import words

        pair = worst_of([self])
        remarks = words.remarks(self)
        return [
            f"{self.case.name}: {self.outcome.value}, {len(self)} poses"
            + (f" ({remarks})" if remarks else ""),
            words.worst_sentence(pair),
            *words.failures(self),
            *words.findings(self),
        ]

    def records(self) -> list[Row]:
        """A record for each pose: what was commanded, what both say of it, how far apart [SI]."""
        differences = {name: getattr(self.difference, name) for name in QUANTITIES}
        columns = {
            **{f"cmd_{c}": self.case.poses[:, k] for k, c in enumerate(_POSE)},
            **{f"seecr_{c}": self.solution.pose[:, k] for k, c in enumerate(_POSE)},
            **{f"mujoco_{c}": self.settling.pose[:, k] for k, c in enumerate(_POSE)},
            **{f"difference_{name}": values for name, values in differences.items()},
        }
        return [
            {"pose": i, "verdict": self.verdict[i].name.lower()}
            | {name: float(values[i]) for name, values in columns.items()}
            for i in range(len(self))
        ]

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""
        return int(np.sum(self.verdict == verdict))

    @property
    def compared(self) -> NDArray[np.bool_]:
        """Poses whose differences mean something: no free motion or branch between, (n,)."""
        return np.asarray((self.verdict == Verdict.AGREES) | (self.verdict == Verdict.DIFFERS))

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        if self.count(Verdict.DIFFERS) or any(one.beyond_limits for one in self.findings):
            return Outcome.DIFFER
        unsolved = any(self.count(verdict) for verdict in UNSOLVED)
        return Outcome.NOT_CONVERGED if unsolved else Outcome.AGREE

    @property
    def worst(self) -> dict[str, Worst]:
        """Largest difference of each quantity over its allowance; none if nothing compares."""
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
        """Microseconds that SEECR takes a pose, on one processor."""
        return 1e6 * self.seecr_s / len(self)

    @property
    def mujoco_ms(self) -> float:
        """Milliseconds that MuJoCo takes a pose, both stages, on one processor."""
        return 1e3 * float(np.sum(self.settling.wall_s)) / len(self)

    def mujoco_robot(self) -> MujocoRobot:
        """MuJoCo's robot of the case, anew: to settle one of its poses again."""
        return MujocoRobot(self.case.mujoco_model, self.case.mujoco_ea)


Record = Callable[[CaseResult], str]
"""Writes the recording of a case and returns its name."""


def run_case(case: Case, thresholds: Thresholds, record: Record | None = None) -> CaseResult:
    """Solve and settle the poses of a case and compare them.

    Args:
        case: what to run.
        thresholds: what counts as agreement.
        record: called with the result; returns the name of the recording that it wrote.
    """
    began = time.perf_counter()
    robot = load_robot(case.model)
    if case.ea is not None:
        robot = replace(robot, ea=np.full(robot.n_cables, case.ea))
    solution, seecr_s = _solve(robot, case.poses)
    mujoco = MujocoRobot(case.mujoco_model, case.mujoco_ea)
    _check_same_cables(case, robot, mujoco)
    settling = mujoco.settle(case.poses)
    allowance = allowances(thresholds, solution, settling)
    difference = compare(solution, settling, allowance.tension_N)
    verdict, findings = judge(Answers(mujoco, solution, settling, difference, allowance))
    result = CaseResult(
        case=case,
        robot=robot,
        solution=solution,
        settling=settling,
        mujoco_rest_lengths=mujoco.rest_lengths(case.poses),
        ignored=mujoco.ignored,
        difference=difference,
        allowance=allowance,
        verdict=verdict,
        findings=held_to(thresholds.findings, case, findings),
        seecr_s=seecr_s,
    )
    name = None if record is None else record(result)
    return replace(result, recording=name, wall_s=time.perf_counter() - began)


def run_suite(
    cases: Sequence[Case] | None = None,
    thresholds: Thresholds | str | Path | None = None,
    *,
    jobs: int = 1,
    record: Record | None = None,
    progress: Callable[[CaseResult], None] | None = None,
    pool: Pool | None = None,
) -> list[CaseResult]:
    """Run cases, several at a time.

    Args:
        cases: what to run; all shipped ones if not given.
        thresholds: what counts as agreement, or a file of it; the shipped ones if not given.
        jobs: how many at a time.
        record: see :func:`run_case`; of a module, so that other processes find it.
        progress: called with each result as it comes.
        pool: processes to run in, instead of ``jobs`` of its own.

    Returns:
        the results in the order of the cases.
    """
    if cases is None:
        cases = shipped_cases()
    if not cases:
        return []
    if not isinstance(thresholds, Thresholds):
        thresholds = load_thresholds(thresholds)
    if pool is None:
        with Pool(min(jobs, len(cases))) as own:
            return run_suite(cases, thresholds, record=record, progress=progress, pool=own)
    if pool.jobs > 1:
        warm_up(cases[0])
    one = partial(run_case, thresholds=thresholds, record=record)
    order = sorted(range(len(cases)), key=lambda i: -len(cases[i].poses))
    return pool.run(one, cases, order, progress or (lambda result: None))


def warm_up(case: Case) -> None:
    """Have the compiled loop on disk before several processes want it."""
    seecr_solve(load_robot(case.model), case.poses[:1])


def worst_of(results: Sequence[CaseResult]) -> tuple[CaseResult, Worst] | None:
    """The case and difference nearest to, or furthest beyond, what is allowed."""
    pairs = [(result, worst) for result in results for worst in result.worst.values()]
    return max(pairs, key=lambda pair: pair[1].ratio, default=None)


def _solve(robot: Robot, poses: Array) -> tuple[Solution, float]:
    seecr_solve(robot, poses[:1])
    best = np.inf
    for _ in range(_REPEATS):
        began = time.perf_counter()
        solution = seecr_solve(robot, poses, threads=1)
        best = min(best, time.perf_counter() - began)
    return solution, best


def _check_same_cables(case: Case, robot: Robot, mujoco: MujocoRobot) -> None:
    m = mujoco.settler.physics.n_cables
    if m != robot.n_cables:
        raise InputFileError(
            f"{case.mujoco_model}: {m} cables; expected {robot.n_cables} as in {case.model}"
        )
