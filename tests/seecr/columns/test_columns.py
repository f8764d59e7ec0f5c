"""Cells, the columns they stand in, and poses made of them: each step by itself."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from random_robots import random_robot

from seecr.columns.csv import read_table, table_text
from seecr.columns.known import know_columns
from seecr.columns.poses import command_lengths, command_poses, measured_orientation
from seecr.description.robot import Joint, Robot
from seecr.errors import InputFileError
from seecr.pose import quat_from_rxyz


def test_a_table_keeps_texts_by_column_and_the_line_of_each_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text('# made\na , b\n\n"x\ny",2\n  # more\n z,\n')
    table = read_table(path)
    assert table.names == ("a", "b") and table.header_line == 2
    assert [list(cells) for cells in table.cells] == [["x\ny", "z"], ["2", ""]]
    assert table.line.tolist() == [4, 7]
    assert table.numbers(1, blank_is_nan=True)[0] == 2.0
    with pytest.raises(InputFileError, match=r"a\.csv: line 7, column b: .*got an empty cell"):
        table.numbers(1, blank_is_nan=False)


def test_columns_are_known_by_quantity_in_si() -> None:
    columns = columns_of("length_10_mm,meas_rx_deg,cmdx_m,note", "103,90,0,a", n_cables=10)
    assert set(columns.known) == {"length_10", "meas_rx"}
    assert columns.numbers("length_10").tolist() == [0.103]
    assert columns.numbers("meas_rx") == pytest.approx(np.pi / 2, rel=1e-15)
    assert columns.cables("length") == (10,)
    assert columns.present("meas", ("rx", "ry")) == ("rx",)
    assert columns.unused == ("cmdx_m", "note") and columns.meant == {"cmdx_m": "cmd_x_m"}
    assert columns.near_misses() == " (Column 'cmdx_m' is not used; did you mean cmd_x_m?)"


def test_the_first_wrong_row_is_named() -> None:
    columns = columns_of("t_s", "1", "2", "3")
    columns.refuse(np.zeros(3, dtype=bool), "t", lambda row: "never")
    with pytest.raises(
        InputFileError, match=r"a\.csv: line 3, column t_s: row 1 \(also at line 4\)$"
    ):
        columns.refuse(np.array([False, True, True]), "t", lambda row: f"row {row}")


def on_a_slide(robot: Robot) -> Robot:
    """The robot with its platform on one slide along y."""
    return replace(
        robot, joints=(Joint("slide", "along y", np.array([0.0, 1.0, 0.0]), np.zeros(3)),)
    )


def test_what_the_joints_hold_still_may_be_left_out() -> None:
    robot = on_a_slide(random_robot(np.random.default_rng(3)))
    columns = columns_of("cmd_y_mm", "100", "-200", n_cables=robot.n_cables)
    poses = command_poses(columns, robot)
    assert poses[:, 1].tolist() == [0.1, -0.2]
    assert np.all(poses[:, [0, 2, 3, 4, 5, 6]] == robot.reference_pose[[0, 2, 3, 4, 5, 6]])
    assert any("No cmd_x cmd_z: the robot cannot move there" in note for note in columns.notes)
    with pytest.raises(InputFileError, match="expected cmd_y_m, cmd_y_m missing"):
        command_poses(columns_of("cmd_x_m", "0", n_cables=robot.n_cables), robot)


def test_lengths_come_in_the_order_of_the_cables() -> None:
    robot = random_robot(np.random.default_rng(3))
    numbers = list(range(robot.n_cables, 0, -1))
    header = ",".join(f"length_{i}_m" for i in numbers)
    columns = columns_of(header, ",".join(map(str, numbers)), n_cables=robot.n_cables)
    lengths = command_lengths(columns, robot)
    assert lengths is not None and lengths[0].tolist() == sorted(map(float, numbers))
    assert command_lengths(columns_of("cmd_x_m", "0"), robot) is None


def test_whole_angles_become_quaternions_and_parts_stay_angles() -> None:
    whole, angles = measured_orientation(
        columns_of("meas_rx_rad,meas_ry_rad,meas_rz_rad", "0.1,0.2,0.3", ",,")
    )
    assert whole is not None and np.isnan(angles).all() and np.isnan(whole[1]).all()
    assert whole[0] == pytest.approx(quat_from_rxyz(np.array([0.1, 0.2, 0.3])), abs=1e-15)
    none, some = measured_orientation(columns_of("meas_rx_rad,meas_ry_rad", "0.1,0.2"))
    assert none is None and some[0, :2].tolist() == [0.1, 0.2] and np.isnan(some[0, 2])


ODD = ("#a", " #b", "a#b", "b, c", 'said "d"', "two\nlines", "two\r\nlines", "1;5", "'", "µ")


@pytest.mark.parametrize("last", ["#", "e"])
def test_odd_names_come_back(tmp_path: Path, last: str) -> None:
    names = [*ODD, last]
    path = tmp_path / "rows.csv"
    text = table_text({"run": names, "x_m": np.arange(len(names)), "note": names[::-1]})
    path.write_bytes(text.encode())
    table = read_table(path)
    assert list(table.cells[0]) == [name.strip() for name in names]
    assert list(table.cells[2]) == [name.strip() for name in names[::-1]]
    assert list(table.cells[1]) == [str(k) for k in range(len(names))]


def test_numbers_have_all_digits_or_those_asked_for() -> None:
    values = [0.1 + 0.2, -0.0, math.nan, math.inf, np.float64(1e-9), None, 3, "a"]
    cells = ["0.30000000000000004", "0.0", "", "", "1e-09", "", "3", "a"]
    assert table_text({"x": values}).splitlines() == ["x", *cells]
    assert table_text({"x": values, "y": values}, 4).splitlines()[1:3] == ["0.3,0.3", "0,0"]


@pytest.mark.slow
def test_a_hundred_thousand_columns_are_read_in_seconds(tmp_path: Path) -> None:
    """Each name was compared with all: minutes of work, eight times as much for twice as many."""
    names = ["cmd_x_m", "cmd_y_m", "cmd_z_m", *(f"a{k}" for k in range(100_000)), "timestamp"]
    path = tmp_path / "wide.csv"
    path.write_text(",".join(names) + "\n" + ",".join(["0.5"] * len(names)) + "\n")
    start = time.process_time()
    known = know_columns(read_table(path), 4)
    assert time.process_time() - start < 40.0
    assert len(known.unused) == 100_001 and known.meant == {"timestamp": "t_s"}
    assert all(len(note) < 500 for note in known.notes)


@pytest.mark.parametrize("where", [b"zz", b"yy"], ids=["name", "text"])
def test_a_parquet_that_is_not_utf_8_is_refused(tmp_path: Path, where: bytes) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "odd.parquet"
    table = pyarrow.table({"cmd_x_m": [0.1], "zz": ["yy"]})
    parquet.write_table(table, path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(where, b"\xff\xfe"))
    with pytest.raises(InputFileError, match="in UTF-8") as caught:
        read_table(path)
    assert "odd.parquet" in str(caught.value) and "\n" not in str(caught.value)
