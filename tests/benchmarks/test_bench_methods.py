"""How fast the three methods are, and how often each converges: ``pytest -m benchmark -s``."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import seecr
from crosscheck.suite.cases import shipped_cases
from seecr.description.mjcf import CABLES, model_path
from seecr.equilibrium.solving import METHODS
from seecr.pose import pose_difference

pytestmark = [pytest.mark.benchmark, pytest.mark.slow]

# A SciPy answer this close to Newton's [m] is the same equilibrium.
SAME = 1e-6


def poses_of(robot: str, cable: str) -> np.ndarray:
    """The suite's: both sweeps and the random ones."""
    chosen = [c.poses for c in shipped_cases() if c.name.startswith(f"{robot}-{cable}")]
    return np.concatenate(chosen)


def timed(robot: seecr.Robot, poses: np.ndarray, method: str) -> tuple[seecr.Solution, float]:
    """Answers, and microseconds per pose on one processor."""
    best = np.inf
    for _ in range(5 if method == "newton" else 1):
        start = time.perf_counter()
        solution = seecr.solve(robot, poses, method=method, threads=1)
        best = min(best, time.perf_counter() - start)
    return solution, 1e6 * best / len(poses)


@pytest.mark.parametrize("cable", list(CABLES))
@pytest.mark.parametrize("name", ["cogiro", "parallel"])
def test_methods(name, cable, capsys):
    robot = seecr.load_robot(model_path(f"demobot_{name}"))
    robot = replace(robot, ea=np.full(robot.n_cables, CABLES[cable]))
    poses = poses_of(name, cable)
    seecr.solve(robot, poses[:2])
    lines, newton = [], None
    for method in METHODS:
        solution, microseconds = timed(robot, poses, method)
        newton = newton or solution
        away = np.linalg.norm(pose_difference(solution.pose, newton.pose)[:, :3], axis=1)
        same = solution.converged & newton.converged & (away < SAME)
        count = {s.name: int(np.sum(solution.status == s)) for s in set(solution.status)}
        lines.append(
            f"{name:9s} {cable:8s} {method:14s} {microseconds:9.1f} µs per pose  "
            f"{np.mean(solution.iterations):6.1f} evaluations  "
            f"converged {np.mean(solution.converged):6.1%}  as newton {np.mean(same):6.1%}  {count}"
        )
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert np.all([s.name in ("CONVERGED", "SINGULAR") for s in newton.status])
