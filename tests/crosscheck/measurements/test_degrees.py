"""Degrees in columns of radians are refused, wherever the body and its counters are turned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from rectangle import RECTANGLE

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.plausible import check_readings
from crosscheck.measurements.read import load_commands, load_measurements
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import quat_from_rxyz, quat_multiply, rxyz_from_quat

COGIRO = load_robot("demobot_cogiro")
WHOLE = "meas_rx_rad,meas_ry_rad,meas_rz_rad"
TILTS = np.array([[1.0, -2.0, 0.5], [-1.5, 1.0, -2.0], [2.0, 2.5, 1.0], [0.0, -1.0, 3.0]])


def file_of(folder: Path, header: str, *rows: str) -> Path:
    path = folder / "a.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize("prefix", ["cmd", "meas"])
@pytest.mark.parametrize("angle", ["26.2376", "-90", "6.3"])
def test_more_than_a_turn_is_no_orientation_in_radians(
    tmp_path: Path, prefix: str, angle: str
) -> None:
    """They were a warning, 90 deg of noise and a model that "misses something"."""
    cmd, meas = ("0,0,0.1", angle) if prefix == "meas" else (f"0,0,{angle}", "0.1")
    path = file_of(
        tmp_path,
        "cmd_x_m,cmd_y_m,cmd_z_m,cmd_rx_rad,cmd_ry_rad,cmd_rz_rad,meas_rz_rad",
        "0.2,0.2,0.15,0,0,0.1,0.1",
        f"0.3,0.2,0.15,{cmd},{meas}",
    )
    expected = (
        f"line 3, column {prefix}_rz_rad: expected radians within one turn, at most 6.283, got "
        f"{angle}, as if in degrees; name the column {prefix}_rz_deg, or, if it counts turns, "
    )
    with pytest.raises(InputFileError, match=expected):
        load_measurements(path, COGIRO)


def test_degrees_and_a_whole_turn_may_be_as_large_as_they_are(tmp_path: Path) -> None:
    path = file_of(
        tmp_path,
        "cmd_x_m,cmd_y_m,cmd_z_m,cmd_rx_deg,cmd_ry_deg,cmd_rz_rad",
        "0.2,0.2,0.15,26,-9,6.2832",
    )
    assert load_commands(path, COGIRO).n_rows == 1


def read_as(
    angles: np.ndarray, told: np.ndarray | None = None, header: str = WHOLE, robot: Robot = COGIRO
) -> str:  # fmt: skip
    """What is said of angles (n, k), "" if nothing is."""
    rows = [",".join(f"{a:.9g}" for a in row) for row in angles]
    columns = columns_of(header, *rows, n_cables=robot.n_cables)
    pose = np.tile(robot.reference_pose, (len(rows), 1))
    if told is not None:
        pose[:, 3:] = told
    data = Measurements(Path("a.csv"), robot.n_cables, np.full(len(rows), "a"), command_pose=pose)
    try:
        check_readings(columns, robot, data)
    except InputFileError as error:
        return str(error)
    return ""


def test_tilts_of_some_degrees_are_no_radians() -> None:
    said = read_as(TILTS)
    assert "column meas_rz_rad: expected radians, got angles that scatter by 1.4 rad (rms)" in said
    assert said.endswith("follow them to 2.9 deg if they are degrees; name the column meas_rz_deg")
    assert read_as(np.radians(TILTS)) == ""
    assert read_as(TILTS[:3]) == ""  # too few to tell
    assert read_as(TILTS, header="meas_rx_deg,meas_ry_deg,meas_rz_deg") == ""
    assert "column meas_ry_rad" in read_as(TILTS[:, [1]], header="meas_ry_rad")
    # four cables, six degrees of freedom: it may tilt
    assert read_as(TILTS, robot=RECTANGLE) == ""


@pytest.mark.parametrize("turn", [[np.pi, 0.0, 0.0], [0.0, np.pi / 2.0, 0.0], [1.6, 0.0, -3.1]])
def test_a_body_turned_on_the_platform_reads_radians_all_the_same(turn: list[float]) -> None:
    """Its angles may be near half a turn, of either sign, or near that where two are one."""
    told = quat_from_rxyz(np.radians(TILTS))
    read = quat_multiply(told, np.tile(quat_from_rxyz(np.array(turn)), (4, 1)))
    assert read_as(rxyz_from_quat(read), told) == ""


def test_commanded_lengths_do_not_say_that_angles_are_degrees(tmp_path: Path) -> None:
    """A platform told to turn by 1.2 rad had its true angles refused: as degrees all are small."""
    robot = load_robot("planar_horizontal")
    lengths = robot.rest_lengths
    header = ",".join([*(f"length_{k}_m" for k in range(1, len(lengths) + 1)), "meas_ry_rad"])
    rows = [",".join(f"{one:.6f}" for one in (*lengths, angle)) for angle in (1.2, -1.1, 0.7, -0.9)]
    path = file_of(tmp_path, header, *rows)
    assert load_measurements(path, robot).n_rows == 4
