"""Each mistake in a file of measurements gets one clear sentence with its place."""

from __future__ import annotations

import pytest
from measured_csv import CMD, LENGTHS, POSE, QUAT

from crosscheck.measurements.read import load_measurements
from seecr.errors import InputFileError

LOADED = POSE + ",payload_kg"
REFUSED = {
    "empty": ([""], "is empty; expected a CSV file in UTF-8 with a header row"),
    "comments only": (["# nothing", "#"], "is empty; expected a CSV file"),
    "header only": (["# x", POSE], "line 2: has a header but no rows; expected one row"),
    "json": (['{"run": [1, 2]}'], "line 1: looks like JSON; expected a CSV"),
    "toml": (["# sigma", "[sigma]", "a = 1"], "line 2: looks like JSON or TOML; expected a CSV"),
    "xml": (["<mujoco>", "</mujoco>"], "line 1: looks like XML, such as a robot's MJCF; expected"),
    "Motive": (["Format Version,1.23,Take Name,a take", "", ",Type,Rigid Body,Rigid Body"],
        "line 1: expected a CSV .*; this is an export of Motive: crosscheck import motive$"),
    "Vicon": (["", "Segments", "200", ",,a:platform", "Frame,Sub Frame,RX"],
        "line 2: expected a CSV .*; this is an export of Vicon: crosscheck import vicon$"),
    "Qualisys": (["NO_OF_FRAMES\t10", "BODY_NAMES\tplatform", "X\tY\tZ", "1\t2\t3"],
        "line 1: .*; this is an export of Qualisys: make a plain log of it, crosscheck import"),
    "two files in one": (
        ["run," + POSE, "a,0,0,0,0", "a,0,0,0,0.1", "run," + POSE, "a,0,0,0,0"],
        r"line 4: expected a row of cells, got the header \(line 1\) again; are two files in one."),
    "bars": ([POSE.replace(",", "|"), "0|0|0|0"],
        "line 1: expected commas, semicolons or tabs between cells, got bars"),
    "marks of two kinds": (["cmd_x_m;cmd_y_m,cmd_z_m;meas_x_m,run", "0;0,0;0,a"],
        "line 1: expected one kind of separator between the names, got as many of one as"),
    "points and commas": ([POSE.replace(",", ";"), "0;0;0;0.5", "0;0;0;1,5"],
        "line 3, column meas_x_m: .*got a decimal comma in '1,5'; write 1.5"),
    "no header": (["0,0,0,1.5", "0,0,0,1.6"],
        "line 1: expected a header row with column names such as cmd_x_m, got the number '0'"),
    "commented header": (["#" + POSE, "0,0,0,1.5", "0,0,0,1.6"],
        "put the names in the first row, without a # before them"),
    "open quote": ([POSE, "0,0,0,0", '"0,0,0,0', "0,0,0,0"],
        "line 3: cannot be split into cells: .*quotation mark"),
    "no unit": (["cmd_x,cmd_y_m,cmd_z_m,meas_x_m", "0,0,0,0"],
        "line 1, column cmd_x: missing unit; expected cmd_x_m, cmd_x_cm, cmd_x_mm or cmd_x_um"),
    "inches": (["cmd_x_in,cmd_y_m,cmd_z_m,meas_x_m", "0,0,0,0"],
        "line 1, column cmd_x_in: unknown unit 'in'; expected cmd_x_m, cmd_x_cm"),
    "metres as angle": ([CMD + ",meas_rx_m", "0,0,0,0"],
        "column meas_rx_m: unknown unit 'm'; expected meas_rx_rad or meas_rx_deg"),
    "small n": ([CMD + ",tension_1_n", "0,0,0,0"], "unknown unit 'n'; expected tension_1_N"),
    "minutes": (["t_min," + POSE, "0,0,0,0,0"],
        "column t_min: unknown unit 'min'; expected t_s or t_ms"),
    "time without unit": (["t," + POSE, "0,0,0,0,0"], "column t: missing unit; expected t_s"),
    "kelvin": (["temperature_K," + POSE, "0,0,0,0,0"], "unknown unit 'K'; expected temperature_C"),
    "quaternion unit": ([CMD + ",meas_qw_rad", "0,0,0,1"],
        "column meas_qw_rad: a quaternion has no unit, got 'rad'; expected meas_qw"),
    "repeated": ([CMD + ",meas_x_m,meas_x_m", "0,0,0,0,0"],
        "line 1, column meas_x_m: repeated header, columns 4 and 5; expected each once"),
    "repeated unused": (["a,a," + POSE, "0,0,0,0,0,0"],
        "column a: repeated header, columns 1 and 2"),
    "two units": ([CMD + ",meas_x_m,meas_x_mm", "0,0,0,0,0"],
        "column meas_x_mm: says the same as meas_x_m; expected only one of the two"),
    "the orientation is given twice": (
        [QUAT + ",meas_rx_deg", "0,0,0,1,0,0,0,0"],
        "the orientation is given twice, as meas_qw and as meas_rx_deg; expected only one of the "
        "two"),
    "commands are given twice": ([LENGTHS + "," + POSE, "1,1,1,1,0,0,0,0"],
        "commands are given twice, as cmd_x_m and as length_1_m; expected poses or lengths"),
    "no command": (["run,t_s,meas_x_m", "a,0,0"],
        "line 1: no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or "
        "length_1_m to length_4_m; if they have other names, say so with --columns THEIRS="),
    "misspelt command": (["cmdx_m,cmdy_m,cmdz_m,meas_x_m", "0,0,0,0"],
        r"no command; .* \(Column 'cmdx_m' is not used; did you mean cmd_x_m\?; "),
    "no measurement": (["run," + CMD, "a,0,0,0"],
        r"no measurement; expected readings in at least one column such as meas_x_m, "
        r".*tension_1_N$"),
    "empty measurement": ([POSE, "0,0,0,"], "no measurement"),
    "misspelt measurement": ([CMD + ",measx_m", "0,0,0,0"],
        r"no measurement; .*\(Column 'measx_m' is not used; did you mean meas_x_m\?\)"),
    "position half there": (["cmd_x_m,cmd_z_m,meas_x_m", "0,0,0"],
        "line 1: incomplete commanded pose columns: expected cmd_x_m cmd_y_m "
        "cmd_z_m, cmd_y_m missing"),
    "orientation without position": (["cmd_rx_deg,cmd_ry_deg,cmd_rz_deg,meas_x_m", "0,0,0,0"],
        "cmd_x_m cmd_y_m cmd_z_m missing"),
    "angles half there": ([CMD + ",cmd_rx_deg,meas_x_m", "0,0,0,0,0"],
        "incomplete commanded pose columns: expected cmd_rx_deg cmd_ry_deg "
        "cmd_rz_deg, cmd_ry_deg cmd_rz_deg missing"),
    "commanded quaternion half there": ([CMD + ",cmd_qw,cmd_qx,meas_x_m", "0,0,0,1,0,0"],
        "incomplete quaternion columns: expected all four or none, cmd_qy cmd_qz missing"),
    "measured quaternion half there": ([QUAT.removesuffix(",meas_qz"), "0,0,0,1,0,0"],
        "expected all four or none, meas_qz missing"),
    "lengths half there": (["length_1_m,length_2_m,length_3_m,meas_x_m", "1,1,1,0"],
        "incomplete length columns: expected all 4 cables of the robot, length_4_m missing"),
    "misspelt half": (["cmd_x_m,cmd_y_m,cmdz_m,meas_x_m", "0,0,0,0"],
        r"cmd_z_m missing \(Column 'cmdz_m' is not used; did you mean cmd_z_m\?\)"),
    "cable nine": ([POSE + ",tension_9_N", "0,0,0,0,1"],
        "column tension_9_N: there is no cable 9; the robot has 4 cables, expected "
        "tension_1 to tension_4"),
    "cable five": ([LENGTHS + ",length_5_mm,meas_x_m", "1,1,1,1,1,0"],
        "column length_5_mm: there is no cable 5; the robot has 4 cables"),
    "cable zero": ([POSE + ",tension_0_N", "0,0,0,0,1"], "there is no cable 0"),
    "too few cells": ([POSE, "0,0,0,0", "0,0,0"],
        r"line 3: expected 4 cells as in the header \(line 1\), got 3 cells; .* cut off\?$"),
    "too many cells": ([POSE, "0,0,0,0,5"],
        "line 2: expected 4 cells .* got 5 cells; a decimal comma splits a number in two"),
    "word": ([POSE, "0,0,0,0", "0,0,zero,0"],
        "line 3, column cmd_z_m: expected a number in every row, got 'zero'"),
    "unit in cell": ([POSE, "0,0,0,12.5 mm"],
        "line 2, column meas_x_m: .*got '12.5 mm'; a unit belongs in the column's name"),
    "decimal comma": ([POSE, '0,0,0,"1,5"'], "got a decimal comma in '1,5'; write 1.5"),
    "underscore": ([POSE, "0,0,0,1_000"], "line 2, column meas_x_m: .*got '1_000'"),
    "NaN command": ([POSE, "0,NaN,0,0"],
        "line 2, column cmd_y_m: expected a number in every row, got 'NaN'; "
        "fill it or drop the row"),
    "not available": ([POSE, "0,0,0,0", "0,0,N/A,0"],
        "line 3, column cmd_z_m: expected a number in every row, got 'N/A'"),
    "broken formula": ([POSE, "0,0,0,0", "0,0,0,#DIV/0!"],
        "line 3, column meas_x_m: .* got '#DIV/0!', an error of a formula; mend it in"),
    "infinite": ([POSE, "0,0,0,-inf"], "line 2, column meas_x_m: .*got '-inf'"),
    "overflow": ([POSE, "0,0,0,1e999"], "line 2, column meas_x_m: .*got '1e999'"),
    "blank command": ([POSE, "0,0,,0"],
        "line 2, column cmd_z_m: expected a number in every row, got an empty "
        "cell; fill it or drop the row"),
    "blank length": ([LENGTHS + ",meas_x_m", "1,1,1,1,0", "1,,1,1,0"],
        "line 3, column length_2_m: .*got an empty cell"),
    "hot": (["temperature_C," + POSE, "20,0,0,0,0", "1e9,0,0,0,0"],
        r"line 3, column temperature_C: expected a temperature from -100 to 200 C, got 1e\+09 C"),
    "another world": (
        [POSE.replace("_x_m", "_x_mm"), "0,0,0,0", "0,0,0,-999999"],
        r"line 3, column meas_x_mm: expected a reading within \d+ m of the robot, got -999999 mm; "
        "leave the cells empty where nothing was read, and subtract a constant from coordinates in "
        "a survey's grid$"),
    "thousands of turns": ([POSE.replace("meas_x_m", "meas_rx_deg"), "0,0,0,9999.5"],
        "line 2, column meas_rx_deg: expected a reading of at most ten turns, got 9999.5 deg"),
    "nines": ([POSE + ",tension_2_N", *["0,0,0,0,9999"] * 2, "0,0,0,0,", *["0,0,0,0,9999"] * 2],
        "line 2, column tension_2_N: expected readings, got 9999 in every row; leave the"),
    "length zero": (
        [LENGTHS + ",meas_x_m", "1,1,0,1,0"],
        "line 2, column length_3_m: expected a length above zero, got 0 m: it is all of the cable "
        "from its exit point on; to changes since the reference pose add its rest length there, "
        '1.3 m, and put lengths = "told" into measured.toml$'),
    "changes of lengths": (
        [LENGTHS.replace("_m", "_mm") + ",meas_x_m", "12,-51.5,3,4,0"],
        r"column length_2_mm: expected a length above zero, got -51\.5 mm: .* there, 1300 mm, and"),
    "a cable of another name": (
        [LENGTHS.replace("length_3", "length_rear") + ",meas_x_m", "1,1,1,1,0"],
        r"expected all 4 cables of the robot, length_3_m missing \(Column length_rear_m is not "
        r"used: the robot's cables are 1 \(cable1\), 2 \(cable2\), .*, by number or name\)$"),
    "norm": ([QUAT, "0,0,0,1,0,0,0", "0,0,0,0.9,0,0,0"],
        "line 3, column meas_qw: expected a unit quaternion, scalar first, got 0.9 "
        "0 0 0 with norm 0.9;"),
    "zero quaternion": ([QUAT, "0,0,0,0,0,0,0"], "line 2, column meas_qw: .* with norm 0;"),
    "quaternion cells half there": ([QUAT, "0,0,0,1,0,,0"],
        "line 2, column meas_qy: incomplete quaternion; expected all four cells "
        "filled or all four empty"),
    "payload without unit": ([f"{POSE},payload", "0,0,0,0,1"],
        "line 1, column payload: missing unit; expected payload_kg or payload_g"),
    "pounds": ([f"{POSE},payload_lb", "0,0,0,0,1"], "unknown unit 'lb'; expected payload_kg or"),
    "empty payload": ([LOADED, "0,0,0,0,1", "0,0,0,0,"],
        "line 3, column payload_kg: expected a number in every row, got an empty cell"),
    "nan force": ([f"{POSE},force_x_N", "0,0,0,0,nan"], "line 2, column force_x_N: .*got 'nan'"),
    "half a centre": ([f"{LOADED},payload_x_m", "0,0,0,0,1,0"],
        "incomplete payload columns: expected .*, payload_y_m payload_z_m missing"),
    "centre of nothing": ([f"{POSE},payload_x_m,payload_y_m,payload_z_m", "0,0,0,0,1,0,0"],
        "incomplete payload columns: expected .*, payload_kg missing"),
    "centre half filled": ([f"{LOADED},payload_x_m,payload_y_m,payload_z_m", "0,0,0,0,1,0,,0"],
        "line 2, column payload_y_m: incomplete centre; expected all three cells filled or all"),
    "moment in newtons": ([f"{POSE},moment_x_N", "0,0,0,0,1"],
        "column moment_x_N: unknown unit 'N'; expected moment_x_Nm"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_mistakes_get_one_sentence_with_their_place(csv_file, robot, case):
    lines, expected = REFUSED[case]
    path = csv_file(*lines)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert caught.value.exit_status == 2


def test_nines_that_may_be_readings_are_readings(csv_file, robot):
    """A few of them, or two digits: an angle held, a load cell that ends there."""
    header = CMD + ",meas_x_m,tension_1_N"
    few = load_measurements(csv_file(header, *["0,0,0,0,999"] * 3), robot)
    assert few.tensions[:, 0] == pytest.approx([999.0] * 3)
    load_measurements(csv_file(header, *["0,0,0,0,99"] * 9), robot)


def test_norm_tolerance_lies_between_rounding_and_mistake(csv_file, robot):
    load_measurements(csv_file(QUAT, "0,0,0,1.0009,0,0,0"), robot)
    with pytest.raises(InputFileError, match=r"with norm 1\.0011"):
        load_measurements(csv_file(QUAT, "0,0,0,1.0011,0,0,0"), robot)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"\x89PNG\r\n\x1a\n\0\0", "is a PNG picture; expected a CSV file in UTF-8"),
        (b"PK\x03\x04\x14\0", "is a zip archive or an Excel workbook; expected"),
        (b"%PDF-1.7\n", "is a PDF; expected"),
        (b"RRF2\0\0", "is a Rerun recording; expected"),
        ("run,cmd_x_m\n".encode("utf-16"), "line 1: has a header but no rows"),
        (b"\x01\x02\0\x03", "is a binary file; expected"),
        (
            b"run,meas_x_m\n# caf\xe9\x81\na,0\n",
            r"line 2: byte 0xE9 \(number 19 of the file\) is not UTF-8; expected text in UTF-8",
        ),
        (b"PAR1 and then nothing", "cannot be read as Parquet"),
    ],
)
def test_files_of_another_kind(tmp_path, robot, content, expected):
    path = tmp_path / "measured.csv"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder(tmp_path, robot):
    with pytest.raises(InputFileError, match=r"nowhere\.csv: no such file; expected a CSV file"):
        load_measurements(tmp_path / "nowhere.csv", robot)
    with pytest.raises(InputFileError, match="is a folder; expected a CSV file"):
        load_measurements(tmp_path, robot)


def test_lengths_for_another_robot(csv_file, robots):
    with pytest.raises(InputFileError, match="expected all 8 cables of the robot, length_5_m"):
        load_measurements(csv_file(LENGTHS + ",meas_x_m", "1,1,1,1,0"), robots["eight"])
