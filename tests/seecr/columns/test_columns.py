"""Cells, names and times of columns, and poses made of them: each step by itself."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from random_robots import random_robot

from seecr.columns.commands import began, runs, temperatures, times, times_of_day
from seecr.columns.csv import read_table, table_text
from seecr.columns.known import (
    know_columns,
    meant_by,
    no_cable_note,
    numbered,
    of_no_cable,
    other_rotations,
    unused_note,
)
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


# --- Runs, times and temperatures as cells say them


NIGHT = ("2024-02-28T23:59:30", "2024-02-28 23:59:30.5", "2024-02-29T00:00:15")


def test_rows_without_a_run_are_one_called_all() -> None:
    columns = columns_of("t_s", "1", "2")
    assert runs(columns).tolist() == ["all", "all"]
    assert columns.notes == ['No column run: all rows count as one run called "all".']


def test_runs_have_the_names_of_their_cells() -> None:
    columns = columns_of("t_s,run", "1,b", "2,b", "0,a")
    assert runs(columns).tolist() == ["b", "b", "a"]
    assert columns.notes == []


def test_a_run_may_not_come_back_after_another() -> None:
    expected = r"line 5, column run: rows out of time order: run 'b' ended at line 3 and"
    with pytest.raises(InputFileError, match=expected):
        runs(columns_of("run", "b", "b", "a", "b"))


def test_every_row_has_the_name_of_a_run() -> None:
    with pytest.raises(InputFileError, match=r"line 3, column run: .* got an empty cell"):
        runs(columns_of("run,t_s", "a,0", ",1"))


def test_a_file_without_times_has_none() -> None:
    columns = columns_of("run", "a")
    assert times(columns, runs(columns)) is None


@pytest.mark.parametrize(("name", "cells", "seconds"), [
    ("t_s", ("0.5", "0.5", "-3"), [0.5, 0.5, -3.0]),
    ("t_ms", ("1500", "2000", "250"), [1.5, 2.0, 0.25]),
    ("t_s", NIGHT, [0.0, 0.5, 45.0]),
])  # fmt: skip
def test_times_are_seconds_and_start_again_with_each_run(
    name: str, cells: tuple[str, ...], seconds: list[float]
) -> None:
    columns = columns_of(f"run,{name}", f"a,{cells[0]}", f"a,{cells[1]}", f"b,{cells[2]}")
    found = times(columns, runs(columns))
    assert found is not None and found.tolist() == seconds


def test_times_of_two_runs_may_both_begin_at_zero_but_one_run_may_not_go_back() -> None:
    columns = columns_of("t_s", "0", "2", "0", "2")
    assert times(columns, np.array(["a", "a", "b", "b"])) is not None
    expected = r"line 4, column t_s: .* expected 2 s or later within run 'a', got 0 s"
    with pytest.raises(InputFileError, match=expected):
        times(columns, np.array(["a", "a", "a", "b"]))


def test_times_of_day_that_go_back_are_shown_as_they_are_written() -> None:
    columns = columns_of("t_s", NIGHT[2], NIGHT[0])
    expected = rf"expected {NIGHT[2]} or later within run 'all', got {NIGHT[0]}; sort"
    with pytest.raises(InputFileError, match=expected):
        times(columns, runs(columns))


@pytest.mark.parametrize("name", ["t_s", "t_ms"])
def test_a_note_tells_from_when_times_of_day_count_and_in_which_column(name: str) -> None:
    columns = columns_of(name, *NIGHT)
    times(columns, np.full(3, "all"))
    assert columns.notes == [f"Column {name} holds times of day: counted from '{NIGHT[0]}'."]


def test_time_zones_count() -> None:
    """The clocks go forward: from half past one to three o'clock are 30 minutes."""
    columns = columns_of("t_s", "2024-03-31T01:30:00+01:00", "2024-03-31T03:00:00+02:00")
    assert times_of_day(columns.table, 0).tolist() == [0.0, 1800.0]
    assert began(columns.table, 0) == datetime(2024, 3, 31, 0, 30, tzinfo=UTC)


@pytest.mark.parametrize("cells", [
    ("2024-03-31T01:30:00Z", "2024-03-31T01:30:01"),
    ("2024-03-31T01:30:00", "2024-03-31T01:30:01Z"),
])  # fmt: skip
def test_a_time_zone_stands_in_every_row_or_in_none(cells: tuple[str, str]) -> None:
    expected = rf"line 3, column t_s: .* in none, got '{cells[1]}' after '{cells[0]}'$"
    with pytest.raises(InputFileError, match=expected):
        times_of_day(columns_of("t_s", *cells).table, 0)


@pytest.mark.parametrize(("cell", "moment"), [
    ("2024-03-01", datetime(2024, 3, 1)),
    ("20240301T121530", datetime(2024, 3, 1, 12, 15, 30)),
    ("2024-03-01 12:15", datetime(2024, 3, 1, 12, 15)),
    ("20240301", None),
    ("1709290000", None),
    ("12:15:30", None),
    ("-3.5", None),
])  # fmt: skip
def test_a_date_is_a_moment_and_digits_alone_are_a_number(
    cell: str, moment: datetime | None
) -> None:
    assert began(columns_of("t_s", cell).table, 0) == moment


@pytest.mark.parametrize(("cells", "line"), [
    (("2024-13-01T00:00:00",), 2),
    (("2024-02-30",), 2),
    (("2024-03-01T00:00:00", "2024-03-01T00:60:00"), 3),
    (("2024-03-01T00:00:00", "12.5"), 3),
    (("2024-03-01T00:00:00", ""), 3),
])  # fmt: skip
def test_what_looks_like_a_moment_but_is_none_is_refused(cells: tuple[str, ...], line: int) -> None:
    columns = columns_of("t_s", *cells)
    expected = rf"line {line}, column t_s: expected a time in ISO 8601, .*, got '{cells[-1]}'$"
    with pytest.raises(InputFileError, match=expected):
        times(columns, np.full(len(cells), "all"))


def test_temperatures_are_celsius_and_may_be_left_out_altogether() -> None:
    assert temperatures(columns_of("t_s", "1")) is None
    found = temperatures(columns_of("temperature_C", "-100", "0", "200"))
    assert found is not None and found.tolist() == [-100.0, 0.0, 200.0]


@pytest.mark.parametrize(("cell", "said"), [
    ("-100.5", "from -100 to 200 C, got -100.5 C"),
    ("293.15", r"from -100 to 200 C, got 293\.15 C"),
    ("", "got an empty cell"),
])  # fmt: skip
def test_temperatures_that_no_cable_bears_are_refused(cell: str, said: str) -> None:
    columns = columns_of("t_s,temperature_C", "0,20", f"1,{cell}")
    with pytest.raises(InputFileError, match=rf"line 3, column temperature_C: .*{said}"):
        temperatures(columns)


# --- A guess of what a name means never chooses an axis or a cable


POSITION = ("cmd_x_m", "cmd_y_m", "cmd_z_m")


@pytest.mark.parametrize(
    ("name", "absent", "meant"),
    [
        ("cmdy_m", POSITION, "cmd_y_m"),
        ("CMD_Z_M", POSITION, "cmd_z_m"),
        ("tension3_N", ("tension_1_N", "tension_3_N"), "tension_3_N"),
        ("temperatur_C", ("temperature_C",), "temperature_C"),
        ("timestamp", ("t_s",), "t_s"),
    ],
)
def test_another_spelling_is_the_name_that_is_missing(
    name: str, absent: tuple[str, ...], meant: str
) -> None:
    assert meant_by([name], absent) == {name: meant}


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("cmd_y_mm", ("cmd_x_m", "cmd_z_m")),  # y is there already
        ("cmd_m", POSITION),
        ("tension_4_N", ("tension_1_N", "tension_3_N")),
        ("tension_13_N", ("tension_1_N", "tension_3_N")),
        ("meas_q", ("meas_qw",)),
        ("timestamp", POSITION),
        ("operator", POSITION),
    ],
)
def test_of_which_axis_or_cable_is_not_guessed(name: str, absent: tuple[str, ...]) -> None:
    assert meant_by([name], absent) == {}


def test_words_for_rotations_are_neither_guessed_nor_found_within_others() -> None:
    turns = ["Roll", "yaw_deg", "euler_x", "meas_rotvec_1", "phi", "meas_theta_deg", "rot_x"]
    others = ["graphite", "delphi", "rotor_speed", "scroll_", "epsilon", "psig"]
    assert other_rotations([*turns, *others]) == [*turns, "scroll_"]
    assert meant_by(["meas_rot_rx_deg"], ["meas_rx_deg"]) == {}


def test_one_column_is_not_several() -> None:
    (one,) = unused_note([], ["yaw"])
    several, rest = unused_note(["a", "b"], ["roll", "yaw"])
    assert one.startswith("Column yaw is not used, because ")
    assert several.startswith("Columns roll yaw are not used, because ")
    assert rest == "Not used: a, b." and unused_note([], []) == []


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("length_left_mm", "length_1_mm"),
        ("tension_upper_left_N", "tension_2_N"),
        ("tension_upper_N", "tension_3_N"),
        ("tension_left", "tension_1"),
        ("tension_4_N", "tension_4_N"),  # the fourth, though the first has that name
        ("tension_Left_N", "tension_Left_N"),
        ("tension_left_stderr_N", "tension_left_stderr_N"),
        ("meas_left_m", "meas_left_m"),
    ],
)
def test_a_cable_is_its_number_or_its_name(name: str, same: str) -> None:
    assert numbered(name, ("left", "upper_left", "upper", "1")) == same


def test_what_is_of_no_cable_is_said_with_those_there_are() -> None:
    results = ["tension_1_stderr_N", "length_scale_of_all", "cmd_x_m", "tensions_N"]
    assert of_no_cable(["length_rear_mm", "tension_rear", *results]) == [
        "length_rear_mm", "tension_rear",
    ]  # fmt: skip
    assert no_cable_note(["length_rear_mm"], ("left", "right")) == [
        "Column length_rear_mm is not used: the robot's cables are 1 (left), 2 (right), by number "
        "or name."
    ]
    assert no_cable_note(["length_a_m", "length_b_m"], ("left",))[0].startswith(
        "Columns length_a_m, length_b_m are not used: "
    )
    assert no_cable_note([], ("left",)) == []


@pytest.mark.parametrize("cables", [("a_m", "a"), ("a", "a_m")])
def test_a_cable_named_like_another_with_a_unit_is_meant_by_its_whole_name(
    cables: tuple[str, str],
) -> None:
    """Which was meant depended on their order."""
    first, second = cables.index("a") + 1, cables.index("a_m") + 1
    assert numbered("length_a_m", cables) == f"length_{first}_m"
    assert numbered("length_a_m_m", cables) == f"length_{second}_m"
