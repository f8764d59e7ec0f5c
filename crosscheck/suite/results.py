"""The suite's results as ``results.json``: everything that the other reports are made of."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from crosscheck.files import json_text
from crosscheck.suite.run import EXIT_AGREES, EXIT_DIFFERS, CaseResult, Worst, exit_status, worst_of
from crosscheck.suite.thresholds import Thresholds
from crosscheck.suite.verdicts import Verdict

if TYPE_CHECKING:
    from crosscheck.suite.effect_suite import EffectResult

FORMAT = 1
"""Of ``results.json``; raised when a key changes its meaning or goes."""

_PACKAGES = ("seecr", "mujoco", "numpy", "scipy", "numba", "rerun-sdk")
_WORDS = {EXIT_AGREES: "agree", EXIT_DIFFERS: "differ"}


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
    def exit_status(self) -> int:
        """0 all agree, 1 a threshold exceeded, 3 a solve did not converge."""
        return exit_status([*self.results, *self.effects])

    @property
    def verdict(self) -> str:
        """``agree``, ``differ`` or ``not_converged``."""
        return _WORDS.get(self.exit_status, "not_converged")

    def count(self, verdict: Verdict) -> int:
        """Number of poses with a verdict."""
        return sum(result.count(verdict) for result in self.results)


def results_json(run: Run) -> str:
    """The text of ``results.json``: a head to read, then one line a case."""
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
    worst = worst_of(run.results)
    return {
        "format": FORMAT,
        "verdict": run.verdict,
        "exit_status": run.exit_status,
        "worst": None if worst is None else {"case": worst[0].case.name, **_worst(worst[1])},
        "poses": {"total": sum(len(r) for r in run.results), **_counts(run)},
        "thresholds": run.thresholds.as_dict(),
        "seed": run.seed,
        "jobs": run.jobs,
        "wall_s": run.wall_s,
        "packages": package_versions(),
        "effects": [_effect(result) for result in run.effects],
    }


def _counts(counted: Run | CaseResult) -> dict[str, int]:
    return {verdict.name.lower(): counted.count(verdict) for verdict in Verdict}


def _worst(worst: Worst) -> dict[str, Any]:
    return {**asdict(worst), "ratio": worst.ratio}


def _effect(result: EffectResult) -> dict[str, Any]:
    return {
        "name": result.task.name,
        "robot": result.task.robot,
        "effect": result.task.effect,
        "agrees": result.agrees,
        "exit_status": result.exit_status,
        "position_m": result.position_m,
        "orientation_rad": result.orientation_rad,
        "tension_N": result.tension_N,
        "moved_m": result.moved_m,
        "poses": {"total": result.rows, "unsolved": result.unsolved},
        "wall_s": result.wall_s,
    }


def _case(result: CaseResult) -> dict[str, Any]:
    case = result.case
    return {
        "name": case.name,
        "model": str(case.model),
        "mujoco_model": str(case.mujoco_model),
        "cable": case.cable,
        "kind": case.kind,
        "exit_status": result.exit_status,
        "poses": {"total": len(result), **_counts(result)},
        "worst": {name: _worst(worst) for name, worst in result.worst.items()},
        "widened": np.flatnonzero(result.allowance.widened),
        "findings": [asdict(finding) for finding in result.findings],
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
