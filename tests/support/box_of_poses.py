"""Measurements of poses spread over a box, in runs, for tests of residuals by themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot, model_path

SIGMA = Sigma(position_m=3e-5, orientation_rad=3.5e-4)
RUNS, ROWS = 6, 12


def box_of_poses(runs: int = RUNS, rows: int = ROWS) -> Problem:
    """Runs of so many rows with poses read in full."""
    robot = load_robot(model_path("demobot_cogiro"))
    n = runs * rows
    rng = np.random.default_rng(0)
    pose = np.tile(robot.reference_pose, (n, 1))
    pose[:, :3] += rng.uniform(-0.1, 0.1, (n, 3))
    data = Measurements(
        path=Path("box.csv"),
        n_cables=robot.n_cables,
        run=np.repeat([f"run {k}" for k in range(runs)], rows),
        command_pose=pose,
        t_s=10.0 * np.arange(n),
        position=pose[:, :3],
        quat_wxyz=pose[:, 3:],
        sigma=SIGMA,
    )
    return Problem(robot, data, SIGMA, np.ones(n, dtype=bool))
