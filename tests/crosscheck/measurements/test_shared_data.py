"""The measurements that are shared with this project are read."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot
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
