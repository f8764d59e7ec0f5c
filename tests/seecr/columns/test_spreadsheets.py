"""Files as spreadsheets and other programs write them: encodings, marks, headers, sheets."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from seecr import load_robot
from seecr.columns.cells import Style, decimals
from seecr.columns.commands import read_commands
from seecr.columns.csv import read_table
from seecr.columns.headers import parse_columns, renamed, spelled
from seecr.columns.known import know_columns
from seecr.errors import Faults, InputError, InputFileError

ROBOT = load_robot("demobot_parallel")
PLAIN = "cmd_x_mm,cmd_y_mm,cmd_z_mm\n300,250,100\n-1.5,260.25,1100.5\n"
PLACES = [[0.3, 0.25, 0.1], [-0.0015, 0.26025, 1.1005]]


def columns_of(tmp_path: Path, text: str | bytes, encoding: str = "utf-8"):
    path = tmp_path / "poses.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return know_columns(read_table(path), ROBOT.n_cables, ROBOT.cable_names)


def places(columns) -> np.ndarray:
    return columns.all_numbers(["cmd_x", "cmd_y", "cmd_z"])


SAME = {
    "plain": PLAIN,
    "sep=": "sep=;\n" + PLAIN.replace(",", ";"),
    "sep= quoted": '"sep=;"\r\n' + PLAIN.replace(",", ";"),
    "trailing": "cmd_x_mm;cmd_y_mm;cmd_z_mm;;\n300;250;100;;\n;;;;\n-1,5;260,25;1100,5;;\n;;;;\n",
    "thousands and points": "cmd_x_mm;cmd_y_mm;cmd_z_mm\n300;250;100\n-1.5;260.25;1,100.5\n",
    "quoted thousands": 'cmd_x_mm,cmd_y_mm,cmd_z_mm\n300,250,100\n-1.5,260.25,"1,100.5"\n',
    "thousands and commas": "cmd_x_mm;cmd_y_mm;cmd_z_mm\n300;250;100\n-1,5;260,25;1.100,5\n",
    "blanks": "cmd_x_mm;cmd_y_mm;cmd_z_mm\n300;250;100\n-1,5;260,25;1\u00a0100,5\n",
    "narrow blanks": "cmd_x_mm;cmd_y_mm;cmd_z_mm\n300;250;100\n-1,5;260,25;1\u202f100,5\n",
    "Swiss": "cmd_x_mm;cmd_y_mm;cmd_z_mm\n300;250;100\n-1.5;260.25;1'100.5\n",
    "minus": PLAIN.replace("-1.5", "\u22121.5"),
    "dash": PLAIN.replace("-1.5", "\u20131.5"),
    "brackets": "cmd_x [mm], cmd_y(mm) ,cmd_z [m]\n300,250,0.1\n-1.5,260.25,1.1005\n",
    "capitals": PLAIN.replace("cmd_x_mm", "CMD_X_MM").replace("cmd_y_mm", "Cmd Y [MM]"),
    "mean": PLAIN + "Mean,1,2\nStd. Dev.,,\n",
    "title": "Hall 3 in May\n" + PLAIN,
    "titles": "Hall 3;;\n\nposes of 4 May;;\n" + PLAIN.replace(",", ";"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_one_table_in_many_spellings(tmp_path: Path, name: str) -> None:
    columns = columns_of(tmp_path, SAME[name])
    assert places(columns) == pytest.approx(np.array(PLACES), abs=1e-15)
    said = " ".join(columns.notes)
    grouped = ("thousands and points", "quoted thousands", "thousands and commas", "blanks",
               "narrow blanks", "Swiss")  # fmt: skip
    assert ("Thousands" in said) == (name in grouped)
    title = {
        "title": "Left out: line 1 (Hall 3 in May), a title.",
        "titles": "Left out: lines 1 (Hall 3), 3 (poses of 4 May), titles.",
    }.get(name)
    assert title in columns.notes if title else "title" not in said
    assert ("Left out: lines 4 (Mean), 5 (Std. Dev.), computed" in said) == (name == "mean")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_encodings_of_excel(tmp_path: Path, encoding: str) -> None:
    text = "# gemessen in K\u00f6ln\n" + PLAIN.replace(",", "\t")
    columns = columns_of(tmp_path, text, encoding)
    assert places(columns) == pytest.approx(np.array(PLACES))
    said = [note for note in columns.notes if "Windows-1252" in note]
    assert said == (["Not UTF-8 from line 1 on: read as Windows-1252 (Latin-1)."]
                    if encoding == "cp1252" else [])  # fmt: skip


def test_groups_of_three_alone_are_decimal_and_said(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "cmd_x_mm;cmd_y_mm;cmd_z_mm\n1,234;2,345;300\n")
    assert places(columns)[0] == pytest.approx([1.234e-3, 2.345e-3, 0.3])
    assert "Commas are taken as decimal: 1,234 is read as 1.234, not as thousands." in columns.notes
    # a zero before or other than three digits behind tells which
    assert Style([["1,234", "0,5"]], comma=True).notes() == []
    assert Style([["0.5", "1,234"]], comma=True).plain("1,234") == "1234"
    assert Style([["0,5", "1.234"]], comma=True).plain("1.234") == "1234"
    assert Style([["1.234"]], comma=True).plain("1.234") == "1.234"
    assert Style([["1.5"]], comma=False).plain("0,123") == "0,123"


@pytest.mark.parametrize("mark", ["-", "--", "#N/A", "n/a", "NA", "#NV", "null", "\u2013", "NaN"])
def test_what_was_not_read(tmp_path: Path, mark: str) -> None:
    columns = columns_of(tmp_path, f"cmd_x_m,meas_x_m\n0,{mark}\n1,2\n")
    assert columns.numbers("meas_x", blank_is_nan=True).tolist() == pytest.approx(
        [np.nan, 2.0], nan_ok=True
    )
    columns = columns_of(tmp_path, f"cmd_x_m,meas_x_m\n{mark},1\n1,2\n")
    with pytest.raises(InputFileError, match=r"line 2, column cmd_x_m: expected a number in every"):
        columns.numbers("cmd_x")


def test_a_run_may_be_called_mean_or_max(tmp_path: Path) -> None:
    table = columns_of(tmp_path, "run,cmd_x_m\nmin,1\nmax,2\n").table
    assert list(table.cells[0]) == ["min", "max"]
    table = columns_of(tmp_path, "run,cmd_x_m\na,1\nb,2\nmean,1.5\n").table
    assert list(table.cells[0]) == ["a", "b"]
    # in the middle nothing is left out
    table = columns_of(tmp_path, "run,cmd_x_m\nmean,1\nb,2\n").table
    assert list(table.cells[0]) == ["mean", "b"]


def test_a_workbook_reads_as_its_csv(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    first = book.active
    first.append(["# by hand"])
    for row in (["cmd_x [mm]", "cmd_y_mm", "cmd_z_mm", None], [300, 250, 100], [],
                [-1.5, 260.25, "1 100.5"], ["Average", None, None]):  # fmt: skip
        first.append(row)
    second = book.create_sheet("day 2")
    second.append(["Tuesday", None, None])
    second.append(["cmd_x_m", "cmd_y_m", "cmd_z_m"])
    second.append([0.5, 0.25, 0.1])
    path = tmp_path / "poses.xlsx"
    book.save(path)
    columns = know_columns(read_table(path), ROBOT.n_cables)
    assert places(columns) == pytest.approx(np.array(PLACES))
    assert columns.table.line.tolist() == [3, 5]
    assert "Left out: row 6 (Average), computed from the other rows." in columns.notes
    there = read_commands(Path(f"{path}:day 2"), ROBOT)
    assert there.commands.pose[0, :3].tolist() == [0.5, 0.25, 0.1]
    (tmp_path / "poses.toml").write_text('lengths = "tell"\n')
    with pytest.raises(InputFileError, match=r"poses\.toml: line 1.*lengths must be"):
        read_commands(Path(f"{path}:day 2"), ROBOT)
    with pytest.raises(InputFileError, match=r"has no sheet 'day 3'; expected one of Sheet, day 2"):
        read_table(Path(f"{path}:day 3"))


def test_faults_of_a_workbook_name_their_rows(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    for row in (["cmd_x_m", "cmd_y_m", "cmd_z_m"], [0.3, "x", 0.1], [0.4, 0.25, "#REF!"]):
        book.active.append(row)
    path = tmp_path / "poses.xlsx"
    book.save(path)
    with pytest.raises(InputFileError) as caught:
        read_commands(path, ROBOT)
    first, second = str(caught.value).split("\n")
    assert first.endswith("row 2, column cmd_y_m: expected a number in every row, got 'x'")
    assert "row 3, column cmd_z_m: " in second and "an error of a formula" in second
    book.active["A2"] = "=1+1"  # nothing has computed it
    book.save(path)
    with pytest.raises(InputFileError, match=r"row 2, column A: expected a value, got the formula"):
        read_commands(path, ROBOT)
    path.write_bytes(b"PK\x03\x04 xl/ and then nothing")
    with pytest.raises(InputFileError, match="cannot be read as a workbook"):
        read_commands(path, ROBOT)


def test_all_faults_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("cmd_x_m,cmd_y_m,cmd_z,length_9_m,t_s,meas_qw_deg\n0,0,0,1,0,1\n")
    with pytest.raises(InputFileError) as caught:
        read_commands(path, ROBOT)
    lines = str(caught.value).split("\n")
    assert [re.search(r"line 1, column (\w+): ", line)[1] for line in lines] == [
        "cmd_z", "length_9_m", "meas_qw_deg"
    ]  # fmt: skip
    rows = "".join(f"{k},a,{'' if k else 'b'},0.1\n" for k in range(6))
    path.write_text("t_s,cmd_x_m,cmd_y_m,cmd_z_m\n" + rows)
    with pytest.raises(InputFileError) as caught:
        read_commands(path, ROBOT)
    lines = str(caught.value).split("\n")
    assert len(lines) == 8
    assert lines[3].endswith("column cmd_x_m: 3 more like these, lines 5, 6, 7")
    assert lines[4].endswith("line 2, column cmd_y_m: expected a number in every row, got 'b'")
    path.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n" + "0,0\n" * 5 + "0,0,0,0\n")
    with pytest.raises(InputFileError) as caught:
        read_commands(path, ROBOT)
    assert str(caught.value).count("\n") == 3
    assert "3 more like these, lines 5, 6, 7" in str(caught.value)


def test_many_faults_are_counted() -> None:
    faults = Faults()
    for k in range(25):
        faults.add(InputFileError.at("a.csv", f"fault {k}"))
        faults.add(InputFileError.at("a.csv", f"fault {k}"))
    for _ in range(2):  # nor does collecting them again lose any
        with pytest.raises(InputFileError) as caught:
            faults.check()
        assert str(caught.value).split("\n")[19:] == ["a.csv: fault 19", "and 5 more"]
        faults = Faults()
        faults.add(caught.value)


@pytest.mark.parametrize(
    ("name", "ours"),
    [("cmd_x [mm]", "cmd_x_mm"), ("Meas_RX (°)", "meas_rx_deg"), ("TENSION_1_N", "tension_1_N"),
     ("Tension_2 [kN]", "tension_2_kN"), ("meas_qw [-]", "meas_qw"), ("T [s]", "t_s"),
     ("temperature [°C]", "temperature_C"), ("moment_x [N m]", "moment_x_Nm"), ("Run", "run"),
     ("length_left [mm]", "length_left_mm"), ("Remark [x]", "Remark_x"), ("speed", "speed")],
)  # fmt: skip
def test_headers_as_people_spell_them(name: str, ours: str) -> None:
    assert spelled(name) == ours


def test_foreign_headers_have_ours(tmp_path: Path) -> None:
    text = "t,p_x,p_y,p_z,remark,px_ref\n0,300,250,100,7,1\n"
    said = parse_columns("t=t_s,p_*=cmd_*_mm,px_ref=meas_x_m")
    with renamed(said):
        columns = columns_of(tmp_path, text)
        assert places(columns)[0] == pytest.approx(PLACES[0])
        assert columns.unused == ("remark",)
        # a file that has our names already needs none
        assert places(columns_of(tmp_path, "t_s,px_ref," + PLAIN.replace("\n", ",0,0\n", 1).replace(
            "cmd_z_mm,0,0", "cmd_z_mm").replace("300", "0,0,300").replace("-1.5", "1,0,-1.5"))
        ).shape == (2, 3)  # fmt: skip
    with (
        renamed({"qx": "meas_x_m", "p_x": "measured", "cmd_y_m": "p_y"}),
        pytest.raises(InputFileError) as caught,
    ):
        columns_of(tmp_path, text)
    first, second, third = str(caught.value).split("\n")
    assert "columns qx=meas_x_m: the file has no column qx; expected one of" in first
    assert "columns p_x=measured: measured is no column that is read" in second
    assert "theirs comes first: p_y=cmd_y_m" in third
    for wrong in ("px", "px=", "px=a,px=b"):
        with pytest.raises(InputError, match="--columns: "):
            parse_columns(wrong)


def test_a_file_without_headers_has_columns_by_number(tmp_path: Path) -> None:
    with renamed({"3": "cmd_z_mm", "1": "cmd_x_mm", "2": "cmd_y_mm"}):
        columns = columns_of(tmp_path, PLAIN.partition("\n")[2])
        assert places(columns) == pytest.approx(np.array(PLACES))
        assert columns.table.line.tolist() == [1, 2]


def test_the_toml_may_say_what_headers_mean(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("a b,y,z\n0.3,0.25,0.1\n")
    path.with_suffix(".toml").write_text('[columns]\n"a b" = "cmd_x_m"\ny = "cmd_z_m"\n')
    with renamed({"y": "cmd_y_m", "z": "cmd_z_m"}):  # the command line comes last
        assert read_commands(path, ROBOT).commands.pose[0, :3].tolist() == [0.3, 0.25, 0.1]
    path.with_suffix(".toml").write_text("columns = 3\n")
    with pytest.raises(InputFileError, match=r"columns must be a table, \[columns\]"):
        read_commands(path, ROBOT)


def test_decimals_of_what_is_written() -> None:
    assert [decimals(cell) for cell in ("1", "1.50", "-0.001", "2e-3", "1.5e3", "")] == [
        0, 2, 3, 3, -2, 0
    ]  # fmt: skip
