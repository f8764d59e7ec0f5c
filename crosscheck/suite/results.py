"""The suite's results as ``results.json``: everything that the other reports are made of."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from crosscheck.files import json_text
from crosscheck.settle.model import ignored_note
from crosscheck.suite.run import CaseResult, Outcome, Worst, worst_of
from crosscheck.suite.thresholds import Thresholds
from crosscheck.suite.verdicts import Verdict

if TYPE_CHECKING:
    from crosscheck.suite.effects import EffectResult

FORMAT = 1
"""Of ``results.json``; raised when a key changes its meaning or goes."""

_PACKAGES = ("seecr", "mujoco", "numpy", "scipy", "numba", "rerun-sdk")


@dataclass(frozen=True, eq=False)
class Run:
    """One run of the suite.

    Attributes:
        results: of its cases.
        thresholds: that held.
        seed: of the random poses.
        jobs: cases at a time.
        wall_s: [s] it took.
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
        """How it ended."""
        return Outcome.of_all(result.outcome for result in self.every)

    @property
    def worst(self) -> tuple[CaseResult, Worst] | None:
        """The case and difference nearest to, or furthest beyond, what is allowed."""
        return worst_of(self.results)

    @property
    def notes(self) -> list[str]:
        """What of the robots' files MuJoCo's side leaves out, a sentence per file."""
        found = {result.case.mujoco_model: result.ignored for result in self.results}
        return [ignored_note(path, names) for path, names in found.items() if names]

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""
        return sum(result.count(verdict) for result in self.results)


def results_json(run: Run) -> str:
    """The text of ``results.json``: a head to read, then one line per case."""
    head = json_text(_head(run), indent=2)
    lines = [json_text(_case(result), indent=None) for result in run.results]
    return head[: head.rindex("\n}")] + ',\n  "cases": [\n' + ",\n".join(lines) + "\n  ]\n}\n"


def package_versions() -> dict[str, str]:
    """Versions of what took part."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _head(run: Run) -> dict[str, Any]:
    worst = run.worst
    return {
        "format": FORMAT,
        "verdict": run.outcome,
        "exit_status": run.outcome.exit_status,
        "worst": None if worst is None else {"case": worst[0].case.name, **worst[1].as_json()},
        "poses": {"total": sum(len(r) for r in run.results), **_counts(run)},
        "thresholds": run.thresholds,
        "notes": run.notes,
        "seed": run.seed,
        "jobs": run.jobs,
        "wall_s": run.wall_s,
        "packages": package_versions(),
        "effects": run.effects,
    }


def _counts(counted: Run | CaseResult) -> dict[str, int]:
    return {verdict.name.lower(): counted.count(verdict) for verdict in Verdict}


def _case(result: CaseResult) -> dict[str, Any]:
    case = result.case
    return {
        "name": case.name,
        "model": str(case.model),
        "mujoco_model": str(case.mujoco_model),
        "cable": case.cable,
        "kind": case.kind,
        "exit_status": result.outcome.exit_status,
        "poses": {"total": len(result), **_counts(result)},
        "worst": result.worst,
        "widened": np.flatnonzero(result.allowance.widened),
        "findings": result.findings,
        "timing": _timing(result),
        "recording": result.recording,
        "ea_N": result.robot.ea,
        "command": case.poses,
        "rest_lengths_m": result.solution.rest_lengths,
        "verdict": [verdict.name.lower() for verdict in result.verdict],
        "seecr": _seecr(result),
        "mujoco": _mujoco(result),
        "difference": asdict(result.difference) | {"tension_N": result.difference.tension_N},
        "allowed": asdict(result.allowance),
    }


def _timing(result: CaseResult) -> dict[str, float]:
    settle_s = np.mean([one.rest.wall_s for one in result.settling])
    polish_s = np.mean([one.polished.wall_s for one in result.settling])
    return {
        "seecr_us_per_pose": result.seecr_us,
        "mujoco_settle_ms_per_pose": 1e3 * float(settle_s),
        "mujoco_polish_ms_per_pose": 1e3 * float(polish_s),
        "case_s": result.wall_s,
    }


def _seecr(result: CaseResult) -> dict[str, Any]:
    solution = result.solution
    return {
        "pose": solution.pose,
        "deviation": solution.deviation,
        "tensions_N": solution.tensions,
        "slack": solution.slack,
        "residual": solution.residual,
        "smallest_eigenvalue_N_per_m": solution.smallest_eigenvalue,
        "iterations": solution.iterations,
        "status": [status.name.lower() for status in solution.status],
    }


def _mujoco(result: CaseResult) -> dict[str, Any]:
    settling = result.settling
    return {
        "rest_lengths_m": result.mujoco_rest_lengths,
        "settled_pose": settling.settled_pose,
        "settled_residual": settling.settled_residual,
        "pose": settling.pose,
        "tensions_N": settling.tensions,
        "slack": settling.slack,
        "residual": settling.residual,
        "smallest_eigenvalue_N_per_m": settling.smallest_eigenvalue,
        "energy_J": settling.energy,
        "steps": settling.steps,
        "simulated_s": settling.simulated_s,
        "status": [status.name.lower() for status in settling.status],
    }
