"""Numbers that stand for "not read", and those that no instrument reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from rectangle import RECTANGLE

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.plausible import check_readings
from seecr.errors import InputFileError

REMEDY = "; leave the cells empty where nothing was read"


def refusal(name: str, *cells: str) -> str:
    """What is said of a column, "" if nothing is."""
    columns = columns_of(f"note,{name}", *(f"x,{c}" for c in cells))
    pose = np.tile(RECTANGLE.reference_pose, (len(cells), 1))
    data = Measurements(Path("a.csv"), 4, np.full(len(cells), "a"), command_pose=pose)
    try:
        check_readings(columns, RECTANGLE, data)
    except InputFileError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(("name", "inside", "outside"), [
    ("meas_x_m", "501.5", "501.6"),
    ("meas_x_m", "-498.5", "-498.6"),
    ("meas_y_mm", "-498000", "-498001"),
    ("meas_z_cm", "49850", "49851"),
    ("meas_rx_deg", "-3599", "-3601"),
    ("meas_rz_rad", "62.8", "62.9"),
])  # fmt: skip
def test_readings_are_within_a_hundred_frames_and_ten_turns(
    name: str, inside: str, outside: str
) -> None:
    """The frame is 5 m across, and its middle at (1.5, 2, -1.5) m."""
    assert refusal(name, "0", inside) == ""
    said = refusal(name, "0", inside, outside)
    assert f"line 4, column {name}: expected a reading " in said
    assert f"got {outside} {name.rpartition('_')[2]}; " in said and REMEDY[2:] in said


def test_only_of_positions_a_survey_is_said() -> None:
    assert refusal("meas_x_m", "-8000").endswith(
        f"within 500 m of the robot, got -8000 m{REMEDY}, and subtract a constant from coordinates "
        "in a survey's grid"
    )
    assert "got 1200 m; if it is in mm, name the column meas_x_mm; " in refusal("meas_x_m", "1200")
    assert "in mm" not in refusal("meas_x_mm", "1200000")
    assert refusal("meas_ry_rad", "600").endswith(f"of at most ten turns, got 600 rad{REMEDY}")


@pytest.mark.parametrize(("name", "cell"), [
    ("meas_x_mm", "999"), ("meas_x_mm", "-9999.0"), ("meas_rx_deg", "999"),
    ("tension_4_N", "99999"), ("tension_1_N", "-999"),
])  # fmt: skip
def test_only_nines_in_every_row_are_no_readings(name: str, cell: str) -> None:
    said = refusal(name, "", *[cell] * 2, "nan", *[cell] * 2)
    assert f"line 3, column {name}: expected readings, got {float(cell):g} in every row" in said


@pytest.mark.parametrize("cells", [
    ["999"] * 3,
    ["99"] * 4,
    ["99.9"] * 4,
    ["998"] * 4,
    ["9990"] * 4,
    ["999", "999", "999", "9999"],
    ["999", "-999", "999", "-999"],
    [""] * 4,
])  # fmt: skip
def test_other_numbers_may_be_readings(cells: list[str]) -> None:
    assert refusal("tension_2_N", *cells) == ""


def test_nines_count_in_the_unit_of_the_column() -> None:
    """9.99 m is nothing special, and 999 cm is."""
    assert refusal("meas_y_m", *["9.99"] * 4) == ""
    assert "got 999 in every row" in refusal("meas_y_cm", *["999"] * 4)


def test_other_columns_are_not_looked_at() -> None:
    assert "expected reading" not in refusal("cmd_x_m", *["99999"] * 4)
    assert refusal("t_s", *["99999"] * 4) == ""
