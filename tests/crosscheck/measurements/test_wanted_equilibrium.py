"""Lengths that several equilibria have: that near the wanted pose is meant, by every command."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crosscheck.measurements.read import load_measurements
from seecr.columns.commands import read_commands
from seecr.description.mjcf import load_robot, model_path
from seecr.equilibrium.solving import solve
from seecr.pose import pose_difference

ROBOT = load_robot(model_path("demobot_cogiro"))


def test_measured_rows_start_where_their_lengths_were_to_lead(tmp_path: Path) -> None:
    """Once ``compare`` began at the reference pose, where ``seecr sweep`` began at the wanted."""
    level = solve(ROBOT, np.array([[0.4, 0.25, 0.2, 1, 0, 0, 0]]), others=True)
    assert level.others is not None
    rolled = level.others[0].pose[0]  # at rest with the same lengths
    lengths = np.tile(level.rest_lengths[0], (3, 1))
    wanted = np.stack([rolled, level.pose[0], np.r_[rolled[:2], np.nan, rolled[3:]]])
    names = [f"length_{i}_m" for i in range(1, 9)]
    names += [f"want_{k}" for k in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")] + ["meas_x_m"]
    rows = np.column_stack([lengths, wanted, np.full(3, 0.4)])
    csv = tmp_path / "rows.csv"
    text = "\n".join(",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in rows)
    csv.write_text(",".join(names) + "\n" + text + "\n")
    found = solve(ROBOT, load_measurements(csv, ROBOT))
    assert found.converged.all()
    away = pose_difference(found.pose, np.stack([rolled, level.pose[0], rolled]))
    assert np.abs(away).max() < 1e-6
    whole = tmp_path / "whole.csv"
    whole.write_text("\n".join(csv.read_text().splitlines()[:3]) + "\n")
    swept = solve(ROBOT, read_commands(whole, ROBOT).commands)
    assert np.abs(pose_difference(swept.pose, found.pose[:2])).max() < 1e-9
