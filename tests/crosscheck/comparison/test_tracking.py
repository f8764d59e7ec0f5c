"""Tracking errors: readings against the wanted poses, whatever the model says."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from called import run
from made_data import SIGMA, case, measured, soft_cogiro, term
from measured_csv import PLANAR, mjcf
from written_pages import text_of

from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Tracking
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import load_measurements, together
from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.pose import Array, pose_add, pose_difference

ROBOT = soft_cogiro()


@cache
def readings() -> Measurements:
    return measured(ROBOT, points=4)


def poses_read() -> Array:
    return np.concatenate([readings().position, readings().quat_wxyz], axis=1)


def off_by_row() -> Array:
    """3 4 0 mm and 0 0.6 0.8 mrad times the number of the row."""
    rows = np.arange(readings().n_rows)
    return rows[:, None] * 1e-3 * np.array([3.0, 4.0, 0.0, 0.0, 0.6, 0.8])


def tracked(wanted: Array | None, *model: Term, **changes: object) -> Tracking:
    data = replace(readings(), wanted=wanted, **changes)  # type: ignore[arg-type]
    found = compare(ROBOT, data, model).tracking
    assert found is not None
    return found


def test_distances_are_lengths_of_vectors_from_the_wanted_poses() -> None:
    found, n = tracked(pose_add(poses_read(), -off_by_row())), readings().n_rows
    mean_square = np.mean(np.arange(n) ** 2.0)
    assert found.wanted and not found.through_tracker
    place, turn = found.away
    assert (place.kind, place.unit, place.rows, place.row) == ("position", "m", n, n - 1)
    assert place.line == readings().line[-1]
    assert place.max == pytest.approx(5e-3 * (n - 1)) and turn.max == pytest.approx(1e-3 * (n - 1))
    assert place.rms == pytest.approx(5e-3 * np.sqrt(mean_square))
    assert turn.rms == pytest.approx(1e-3 * np.sqrt(mean_square))


def test_without_wanted_poses_distances_are_from_the_commanded_ones() -> None:
    found = tracked(None)
    off = np.linalg.norm(pose_difference(poses_read(), readings().command_pose)[:, :3], axis=1)
    assert not found.wanted and found.away[0].rms == pytest.approx(np.sqrt(np.mean(off**2)))
    lengths = replace(
        readings(), command_pose=None, command_lengths=ROBOT.nominal_lengths(poses_read())
    )
    assert compare(ROBOT, lengths).tracking is None


def test_only_what_was_wanted_and_read_counts() -> None:
    wanted = pose_add(poses_read(), -off_by_row())
    wanted[:, 1] = wanted[3, 0] = np.nan  # y not at all, x not in one row
    wanted[:, 3:] = np.nan
    read = readings().position.copy()
    read[-1, 0] = np.nan
    (place,) = tracked(wanted, position=read).away
    assert place.rows == readings().n_rows and place.max == pytest.approx(
        3e-3 * (readings().n_rows - 2)
    )
    angles = np.outer((-1.0) ** np.arange(readings().n_rows), [0.1, np.nan, np.nan])
    level = np.tile([np.nan, np.nan, np.nan, 1.0, 0.0, 0.0, 0.0], (readings().n_rows, 1))
    (turn,) = tracked(level, quat_wxyz=None, angles_rad=angles).away
    assert turn.kind == "orientation" and turn.rms == pytest.approx(0.1)


def test_of_a_model_only_what_its_tracker_reads_matters() -> None:
    plain = tracked(poses_read(), term(ROBOT, "stiffness", factor=3.0))
    assert not plain.through_tracker and plain.away[0].max < 1e-12
    frame = term(ROBOT, "tracker_frame", shift_x_m=0.01, shift_z_m=-0.02)
    found = tracked(pose_add(poses_read(), np.array([-0.01, 0, 0.02, 0, 0, 0])), frame)
    assert found.through_tracker and found.away[0].max < 1e-12
    assert found.title == "off the wanted poses, read through the model's tracker"


def test_files_without_wanted_poses_do_not_count() -> None:
    days = [
        replace(readings(), path=Path("before.csv")),
        replace(readings(), path=Path("after.csv"), wanted=pose_add(poses_read(), -off_by_row())),
    ]
    found = compare(ROBOT, together(days)).tracking
    assert found is not None and found.away[0].rows == readings().n_rows
    assert found.away[0].row == 2 * readings().n_rows - 1


def planar(folder: Path, head: str, row: str) -> Measurements:
    xml, csv = folder / "planar.xml", folder / "measured.csv"
    xml.write_text(mjcf(PLANAR, 'pos="0 0.05 0"'))
    csv.write_text(f"{head}\n" + "\n".join([row] * 3) + "\n")
    return load_measurements(csv, load_robot(xml))


def test_what_the_joints_lock_is_no_error(tmp_path: Path) -> None:
    lengths = ",".join(f"length_{i}_m" for i in range(1, 5))
    wanted, read = "want_x_mm,want_y_mm,want_z_mm,want_ry_deg", "meas_x_m,meas_y_m,meas_z_m"
    head = f"{lengths},{wanted},{read},meas_ry_rad"
    data = planar(tmp_path, head, "1.3,1.3,1.3,1.3,100,50,-20,1,0.103,0.9,-0.016,0.02")
    found = compare(load_robot(tmp_path / "planar.xml"), data).tracking
    assert found is not None and [one.kind for one in found.away] == ["position", "orientation"]
    assert found.away[0].max == pytest.approx(5e-3)
    assert found.away[1].max == pytest.approx(0.02 - np.radians(1.0))


@pytest.mark.slow
def test_the_command_says_it_once_on_the_terminal_on_the_page_and_in_json(tmp_path: Path) -> None:
    xml, csv = case(tmp_path, points=4)
    robot = load_robot(xml)
    data = load_measurements(csv, robot)
    wanted = np.concatenate([data.position + np.array([0.003, 0.004, 0.0]), data.quat_wxyz], axis=1)
    write_measurements(csv, replace(data, wanted=wanted))
    result = run("compare", xml, csv, "--no-recording", "--out", tmp_path / "out")
    (line,) = [line for line in result.stdout.splitlines() if line.startswith("off the")]
    start = "off the wanted poses: position 5.00 mm rms, 5.00 mm at most (line "
    assert line.startswith(start) and "; orientation 0" in line
    page = text_of((tmp_path / "out" / "comparison.html").read_text())
    assert "How far the platform is off the wanted poses" in page and "position 5 5 mm" in page
    told = json.loads((tmp_path / "out" / "comparison.json").read_text())["tracking"]
    assert told["from"] == "wanted" and told["through_tracker"] is False
    assert told["position"]["rms"] == pytest.approx(0.005) and told["position"]["unit"] == "m"
    assert told["position"]["rows"] == data.n_rows
    assert told["orientation"]["max"] < SIGMA.orientation_rad
