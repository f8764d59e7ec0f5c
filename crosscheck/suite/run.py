"""The cross-check suite: every pose of every case solved by SEECR and settled by MuJoCo."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenRobot
from crosscheck.settle.physics import ignored_note
from crosscheck.settle.settler import settle_batch
from crosscheck.suite.agreement import (
    Thresholds,
    allowances,
    by_quantity,
    differences_of,
    load_thresholds,
)
from crosscheck.suite.cases import Case, select, shipped_cases, user_cases
from crosscheck.suite.effects import (
    GROUP,
    PREFIX,
    EffectCase,
    EffectResult,
    effect_failures,
    effects_line,
    run_effects,
    shipped_effect_cases,
)
from crosscheck.suite.results import (
    CaseResult,
    Worst,
    counts,
    failure_lines,
    worst_of,
    worst_sentence,
)
from crosscheck.suite.verdicts import FINDINGS, Answers, Outcome, Verdict, held_to, judge_poses
from seecr.arguments import whole
from seecr.counted import counted, some
from seecr.description.mjcf import load_robot, model_names
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve as seecr_solve
from seecr.errors import ExecutorError, InputError, InputFileError
from seecr.files import json_text
from seecr.parallel import processes, run_tasks
from seecr.result import Record, Result
from seecr.statics.solution import Solution

# Cases as callers give them: cases, names of shipped ones, robots.

GivenCase: TypeAlias = Case | EffectCase | GivenRobot
"""A case, the name of shipped ones or a pattern such as "cogiro-*", a robot or its MJCF."""


def chosen_cases(
    given: GivenCase | Iterable[GivenCase] | None, seed: int
) -> list[Case | EffectCase]:
    """The chosen cases. A robot stands for a sweep and random poses; None for all shipped cases.

    Raises:
        CrosscheckError: a name or pattern that no shipped case has; the message names the nearest.
        InputError: no case, one without poses, or something else.
    """
    shipped = every_shipped(seed)
    if given is None:
        return shipped
    every = [given] if isinstance(given, GivenCase) else given
    if not isinstance(every, Iterable):
        raise _no_case(given)
    found: list[Case | EffectCase] = []
    for one in every:
        found += [case for case in _cases_of(one, shipped, seed) if case not in found]
    if not found:
        raise InputError("expected at least one case to run, got none; without any all are run")
    empty = [case.name for case in found if len(case) == 0]
    if empty:
        raise InputError(f"case {empty[0]} has no poses; expected at least one")
    return found


def every_shipped(seed: int) -> list[Case | EffectCase]:
    """All shipped cases, and after them the effects."""
    return [*shipped_cases(seed), *shipped_effect_cases(seed)]


def shipped_like(
    every: Sequence[Case | EffectCase], patterns: Sequence[str], option: str = ""
) -> list[Case | EffectCase]:
    """Those that match any of the patterns; the group's name stands for all its effects."""
    return select(every, [f"{PREFIX}*" if name == GROUP else name for name in patterns], option)


def _cases_of(
    given: GivenCase, shipped: Sequence[Case | EffectCase], seed: int
) -> Sequence[Case | EffectCase]:
    if isinstance(given, Case | EffectCase):
        return [given]
    if isinstance(given, str):
        # a robot's file, or the name of a shipped one, and not of a case
        path = Path(given)
        if not (given in model_names() or path.suffix.lower() == ".xml" or path.is_file()):
            return shipped_like(shipped, [given])
    if isinstance(given, GivenRobot):
        return user_cases(given, seed=seed)
    raise _no_case(given)


def _no_case(got: object) -> InputError:
    return InputError(
        "expected cases, names of shipped ones, robots or their MJCF, got " + type(got).__name__
    )


FORMAT = 1
"""Version of ``results.json``; raised when a key changes its meaning or is removed."""

_PACKAGES = ("seecr", "mujoco", "numpy", "scipy", "numba", "rerun-sdk")
# SEECR takes microseconds: the shortest of this many runs is its time, the rest is other load.
_REPEATS = 3

Recorder = Callable[[CaseResult], str]
"""Writes the recording of a case and returns its name."""


@dataclass(frozen=True, eq=False, repr=False)
class Run(Result):
    """One run of the suite.

    Attributes:
        results: of its cases.
        thresholds: that were applied.
        seed: of the random poses.
        jobs: number of processes.
        wall_s: [s] time taken.
        effects: results of its effects.
    """

    results: Sequence[CaseResult]
    thresholds: Thresholds
    seed: int
    jobs: int
    wall_s: float
    effects: Sequence[EffectResult] = ()

    @property
    def every(self) -> list[CaseResult | EffectResult]:
        """Results of cases and effects."""
        return [*self.results, *self.effects]

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome.of_all(result.outcome for result in self.every)

    @property
    def worst(self) -> tuple[CaseResult, Worst] | None:
        """The case and difference nearest to its allowance, or farthest beyond it."""
        return worst_of(self.results)

    @property
    def notes(self) -> list[str]:
        """Features of the robots' files that MuJoCo's side ignores, a sentence per file."""
        found = {result.case.mujoco_model: result.ignored for result in self.results}
        return [ignored_note(path, names) for path, names in found.items() if names]

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""
        return sum(result.count(verdict) for result in self.results)

    def lines(self) -> list[str]:
        """The verdict, the failures, and what MuJoCo's side ignores."""
        failures = [f"{r.case.name}, {line}" for r in self.results for line in failure_lines(r)]
        notes = [f"note: {note}" for note in self.notes]
        return [verdict_line(self), *failures, *effect_failures(self.effects), *notes]

    def records(self) -> list[Record]:
        """One row per pose of every case; effects have none."""
        return [
            {"case": result.case.name, **record}
            for result in self.results
            for record in result.records()
        ]

    def as_json(self) -> dict[str, Any]:
        """As in ``results.json``."""
        return {**self.head_json(), "cases": self.results}

    def head_json(self) -> dict[str, Any]:
        """Everything but the cases."""
        worst = self.worst
        return {
            "format": FORMAT,
            "verdict": self.outcome,
            "exit_status": self.outcome.exit_status,
            "worst": None if worst is None else {"case": worst[0].case.name, **worst[1].as_json()},
            "poses": {"total": sum(len(r) for r in self.results), **counts(self.count)},
            "thresholds": self.thresholds,
            "notes": self.notes,
            "seed": self.seed,
            "jobs": self.jobs,
            "wall_s": self.wall_s,
            "packages": package_versions(),
            "effects": self.effects,
        }


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
    return f"{start}; {_why(run)}."


def _why(run: Run) -> str:
    """The worst difference; where a run fails though that is allowed, what it fails for."""
    worst = run.worst
    if run.outcome is not Outcome.DIFFER or (worst is not None and worst[1].ratio > 1.0):
        return worst_sentence(worst)
    for result in run.results:
        for line in failure_lines(result):
            return f"all differences are allowed, but in {result.case.name} at {line}"
    return "all differences are allowed, but the effects named fail"


def threshold_cells(run: Run) -> list[str]:
    """The thresholds as a row of the same table."""
    values = by_quantity(run.thresholds).values()
    return ["allowed", "", *(f"{value:.0e}" for value in values), "", "", "", ""]


def run_case(case: Case, thresholds: Thresholds, record: Recorder | None = None) -> CaseResult:
    """Solve and settle the poses of a case and compare them.

    Args:
        case: what to run.
        thresholds: what counts as agreement.
        record: called with the result; returns the name of the recording that it wrote.
    """
    began = time.perf_counter()
    robot = load_robot(case.model, case.passive)
    if case.ea is not None:
        robot = replace(robot, ea=np.where(robot.driven, case.ea, robot.ea))
    solution, seecr_s = _solve(robot, case)
    mujoco = case.settler()
    if (m := mujoco.physics.n_cables) != robot.n_cables:
        raise InputFileError(
            f"{case.mujoco_model}: {counted(m, 'cable')}; expected {robot.n_cables} as in "
            f"{case.model}"
        )
    told = mujoco.paid_out(case.poses)
    settling = settle_batch(mujoco, case.begins, told)
    allowance = allowances(thresholds, solution, settling)
    difference = differences_of(solution, settling, allowance.tension_N)
    verdict, findings = judge_poses(
        Answers(mujoco, told, solution, settling, difference, allowance)
    )
    result = CaseResult(
        case=case,
        robot=robot,
        solution=solution,
        settling=settling,
        mujoco_rest_lengths=told,
        ignored=mujoco.physics.ignored,
        difference=difference,
        allowance=allowance,
        verdict=verdict,
        findings=held_to(thresholds.findings, case, findings),
        seecr_s=seecr_s,
    )
    name = None if record is None else record(result)
    return replace(result, recording=name, wall_s=time.perf_counter() - began)


def run_suite(
    cases: GivenCase | Iterable[GivenCase] | None = None,
    thresholds: Thresholds | str | Path | None = None,
    *,
    seed: int = 0,
    jobs: int = 1,
    record: Recorder | None = None,
    progress: Callable[[CaseResult | EffectResult], None] | None = None,
    executor: Executor | None = None,
) -> Run:
    """Run cases and effects, several at a time.

    Args:
        cases: what to run: cases; names of shipped ones, and patterns such as "cogiro-*"; robots or
            their MJCF, each along a sweep and at random poses. All shipped ones by default.
        thresholds: what counts as agreement, or a file with it; the shipped ones by default.
        seed: of the shipped cases' random poses and of the effects' sizes.
        jobs: number of processes.
        record: see :func:`run_case`; a function of a module, so that other processes find it.
        progress: called with each result as it comes.
        executor: runs the cases in place of ``jobs`` processes, as any
            ``concurrent.futures.Executor``. Its workers read the same files as this process, and
            write those of ``record``.

    Returns:
        the results in the order of the cases.

    Raises:
        InputError: no case, something that is not one, or ``jobs`` not a whole number from 1 on.
        CrosscheckError: a name that no shipped case has, or a process that was killed.
        ExecutorError: the executor ended before its work.

    Example:
        ``crosscheck.run_suite(crosscheck.shipped_cases()[:1]).outcome``
    """
    began, jobs = time.perf_counter(), whole(jobs, "jobs", least=1)
    chosen = chosen_cases(cases, seed)
    if not isinstance(thresholds, Thresholds):
        thresholds = load_thresholds(thresholds)
    poses = [case for case in chosen if isinstance(case, Case)]
    effects = [case for case in chosen if isinstance(case, EffectCase)]
    tell = progress or (lambda result: None)
    one = partial(run_case, thresholds=thresholds, record=record)
    order = sorted(range(len(poses)), key=lambda i: -len(poses[i]))
    count = min(jobs, len(chosen)) if executor is None else 1
    if count > 1:  # the loop is compiled into the cache before several processes need it
        robot = load_robot(chosen[0].model)
        seecr_solve(robot, robot.reference_pose[None])
    try:
        with processes(count) as own:
            results = run_tasks(one, poses, executor or own, order, tell)
            found = run_effects(effects, executor or own, tell)
    except ExecutorError:
        if executor is not None:
            raise
        raise CrosscheckError(
            f"one of {count} processes was killed, perhaps for lack of memory; try --jobs 1"
        ) from None
    return Run(results, thresholds, seed, jobs, time.perf_counter() - began, found)


def results_json(run: Run) -> str:
    """The text of ``results.json``: a head to read, then one line per case."""
    head = json_text(run.head_json(), indent=2)
    lines = [json_text(result.as_json(), indent=None) for result in run.results]
    return head[: head.rindex("\n}")] + ',\n  "cases": [\n' + ",\n".join(lines) + "\n  ]\n}\n"


def package_versions() -> dict[str, str]:
    """Versions of the packages involved."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _solve(robot: Robot, case: Case) -> tuple[Solution, float]:
    seecr_solve(robot, case.poses[:1])
    best = np.inf
    for _ in range(_REPEATS):
        began = time.perf_counter()
        solution = seecr_solve(robot, case.poses, start=case.starts, threads=1)
        best = min(best, time.perf_counter() - began)
    return solution, best
