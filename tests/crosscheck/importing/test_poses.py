"""Plain logs of poses: names, units and orientations of their columns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.importing.poses import read_poses
from seecr.errors import InputError, InputFileError


def log(folder: Path, *lines: str) -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "head",
    [
        "t_s,x_mm,y_mm,z_mm",
        "time [s],tx [mm],ty [mm],tz [mm]",
        "t,pos_x (mm),y_mm,z_mm",
        "Time [s],Pos X (mm),Pos Y (mm),Pos Z (mm)",
    ],
)
def test_units_are_read_from_names(tmp_path: Path, head: str) -> None:
    found = read_poses(log(tmp_path, head, "0,1,2,3", "0.5,4,5,6"))
    place, quat = found.bodies["log"]
    assert place == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]) * 1e-3) and quat is None
    assert found.t_s.tolist() == [0.0, 0.5] and found.line.tolist() == [2, 3]


def test_a_unit_is_stated_where_names_have_none(tmp_path: Path) -> None:
    path = log(tmp_path, "t,x,y,z", "0,1,2,3")
    assert read_poses(path, "mm").bodies["log"][0] == pytest.approx(np.array([[1, 2, 3]]) * 1e-3)
    with pytest.raises(InputFileError, match="expected a unit in the name of column x"):
        read_poses(path)
    with pytest.raises(InputError, match=r"the columns of log\.csv state their own"):
        read_poses(log(tmp_path, "t,x_m,y_m,z_m", "0,1,2,3"), "mm")


def test_columns_that_are_not_read_are_said(tmp_path: Path) -> None:
    """All orientations were lost without a word."""
    path = log(tmp_path, "t_s,x_mm,y_mm,z_mm,Roll [deg],Yaw [deg]", "0,1,2,3,4,5")
    (note,) = read_poses(path).notes
    assert note.startswith("columns not read: Roll [deg], Yaw [deg]; rotations are read from")
    turned = log(tmp_path, "t_s,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg,frame", "0,1,2,3,4,5,6,7")
    assert read_poses(turned).notes == ("columns not read: frame",)
    assert read_poses(log(tmp_path, "t_s,x_mm,y_mm,z_mm", "0,1,2,3")).notes == ()
    with pytest.raises(InputFileError, match="got no x, y, z among t_s, North, East; rename them"):
        read_poses(log(tmp_path, "t_s,North,East", "0,1,2"))


def test_numbers_that_stand_for_not_seen_are_refused(tmp_path: Path) -> None:
    rows = [f"{k},-9999,-9999,-9999" if k % 2 else f"{k},1,2,3" for k in range(8)]
    path = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *rows)
    with pytest.raises(InputFileError, match=r"line 3, column x_mm: expected a position, got -99"):
        read_poses(path)
    once = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *rows[:2], "8,1,2,3")
    assert read_poses(once).bodies["log"][0][1, 0] == pytest.approx(-9.999)
    high = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *(f"{k},1,2,999" for k in range(8)))
    assert read_poses(high).bodies["log"][0][3, 2] == pytest.approx(0.999), "a height"


def test_three_angles_turn_about_moving_axes(tmp_path: Path) -> None:
    """Rx(90) Ry(90): z of the body goes to x of the base."""
    head = "t_s,x_m,y_m,z_m,rx_deg,ry_deg,rz_deg"
    _place, quat = read_poses(log(tmp_path, head, "0,0,0,0,90,90,0", "1,0,0,0,,,")).bodies["log"]
    assert quat is not None and quat[0] == pytest.approx([0.5, 0.5, 0.5, 0.5])
    assert np.isnan(quat[1]).all()


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("t_s,x_m,y_m", "got no z"),
        ("t_s,x_m,y_m,z_m,x_mm", "expected one column for x, got x_m and x_mm"),
        ("x_m,y_m,z_m", "expected one column of times such as t_s, got none"),
        ("t_s,x_m,y_m,z_m,qw,qx,qy", "expected all of qw, qx, qy, qz or none, got no qz"),
    ],
)
def test_columns_that_are_no_poses_are_refused(tmp_path: Path, head: str, said: str) -> None:
    cells = ",".join("1" for _ in head.split(","))
    with pytest.raises(InputFileError, match=said):
        read_poses(log(tmp_path, head, cells))


def test_times_that_fall_are_two_recordings(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"line 3, column t_s: .* are two recordings in one"):
        read_poses(log(tmp_path, "t_s,x_m,y_m,z_m", "5,0,0,0", "4,0,0,0"))


def test_positions_of_exactly_nothing_are_not_seen_unless_others_are_near(tmp_path: Path) -> None:
    head = "t_s,x_m,y_m,z_m,qw,qx,qy,qz"
    rows = ["0,3,2,1,1,0,0,0", "1,0,0,0,1,0,0,0", "2,3.5,2,1,1,0,0,0"]
    read = read_poses(log(tmp_path, head, *rows))
    assert read.body(None).seen.all()
    found = read.seen_only()
    assert found.body(None).seen.tolist() == [True, False, True]
    assert found.notes == ("positions of exactly 0 0 0 count as not seen: log in 1 row",)
    near = read_poses(log(tmp_path, head, *rows, "3,0.01,0,0,1,0,0,0")).seen_only()
    assert near.body(None).seen.all() and near.notes == ()
    marked = replace(read, bodies={}, markers={"m": read.bodies["log"][0]}).seen_only()
    assert np.isnan(marked.marker("m")[:, 0]).tolist() == [False, True, False]
