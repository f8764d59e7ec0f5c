"""Measurements that are read and solved: shared data, lines of answers, wanted equilibria."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.columns.commands import read_commands
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.inverse.correction import correct
from seecr.pose import pose_difference


@pytest.mark.parametrize("number", range(1, 13))
def test_shipped_twins_load(shared_data, number, tmp_path):
    folder = shared_data / "twins" / f"L{number:02d}"
    robot = load_robot(folder / "robot.xml")
    data = load_measurements(folder / "measured.csv", robot)
    assert data.n_rows == 144
    assert data.has_position and data.quat_wxyz is not None
    assert data.sigma.position_m and data.sigma.orientation_rad
    assert data.unused_columns == () and data.notes == ()
    # Written back, the header is the same and the numbers differ by rounding at most.
    write_measurements(tmp_path / "measured.csv", data)
    original = (folder / "measured.csv").read_text().partition("\n")[0]
    assert (tmp_path / "measured.csv").read_text().partition("\n")[0] == original
    again = load_measurements(tmp_path / "measured.csv", robot)
    measured = [np.concatenate([d.position, d.quat_wxyz], axis=1) for d in (data, again)]
    assert np.abs(pose_difference(*measured)).max() < 1e-8
    assert (tmp_path / "measured.toml").read_text() == (folder / "measured.toml").read_text()


def test_shipped_real_data_load(shared_data):
    folder = shared_data / "real" / "irma4u"
    data = load_measurements(folder / "measured.csv", load_robot(folder / "robot.xml"))
    assert (data.n_rows, data.has_position, data.tension_mask.all()) == (27, False, True)
    assert data.quat_wxyz.shape == (27, 4)
    assert data.sigma == Sigma(orientation_rad=0.009, tension_N=1.0, length_m=0.003)
    folder = shared_data / "real" / "hangprinter"
    data = load_measurements(folder / "measured.csv", load_robot(folder / "robot.xml"))
    assert (data.n_rows, data.has_position, data.has_orientation) == (41, True, False)
    assert data.command_lengths[0].tolist() == [1.597, 1.794996, 1.5825, 2.355]
    assert data.sigma == Sigma(position_m=0.001, length_m=0.001)


ROBOT = load_robot("demobot_cogiro")
THREE = """# a comment
cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m
0.4,0.25,0.1,0.4
0.4,0.25,0.6,0.4
0.3,0.25,0.12,0.3
"""


@pytest.fixture
def measured(tmp_path: Path) -> Measurements:
    path = tmp_path / "measured.csv"
    path.write_text(THREE)
    return load_measurements(path, ROBOT)


def test_an_answer_names_lines(measured: Measurements) -> None:
    found = solve(ROBOT, measured)
    assert found.place(1) == "line 4"
    assert "from the command: line 4, " in str(found)
    assert solve(ROBOT, measured.rows([2])).place(0) == "line 5"


def test_a_correction_names_lines(measured: Measurements) -> None:
    found = correct(ROBOT, measured, lowest=0.1, highest=2.0)
    assert not found.held[1] and found.held[0]
    assert "  line 4: " in str(found) and "pose 1" not in str(found)
    assert [row["line"] for row in found.as_json()["rows"]] == [3, 4, 5]


def test_of_several_files_a_line_alone_would_name_no_row(
    measured: Measurements, tmp_path: Path
) -> None:
    other = tmp_path / "tuesday.csv"
    other.write_text(THREE)
    both = load_measurements([measured.path, other], ROBOT)
    assert solve(ROBOT, both).place(4) == "pose 4"


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
