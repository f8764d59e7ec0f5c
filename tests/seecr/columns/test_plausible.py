"""Commands that are in another unit, or for another robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_columns import columns_of
from rectangle import RECTANGLE

from seecr.columns.plausible import check_commands
from seecr.errors import InputFileError
from seecr.pose import Array

HOME = RECTANGLE.reference_pose


def at(*places: tuple[float, float, float]) -> Array:
    """Poses (n, 7) at places, not turned."""
    return np.concatenate([np.array(places), np.tile(HOME[3:], (len(places), 1))], axis=1)


def check_places(unit: str, *places: tuple[float, float, float], per_metre: float = 1.0) -> None:
    """Check a file with these places in this unit."""
    header = ",".join(f"cmd_{axis}_{unit}" for axis in "xyz")
    rows = [",".join(f"{per_metre * value:.10g}" for value in place) for place in places]
    check_commands(columns_of(header, *rows), RECTANGLE, at(*places), None)


def check_lengths(unit: str, per_metre: float, *lengths: float) -> None:
    """Check a file with rows of four equal lengths."""
    header = ",".join(f"length_{i}_{unit}" for i in range(1, 5))
    rows = [",".join([f"{per_metre * length:.10g}"] * 4) for length in lengths]
    table = np.repeat(np.array(lengths)[:, None], 4, axis=1)
    check_commands(columns_of(header, *rows), RECTANGLE, None, table)


def test_commands_in_the_robot_pass_in_any_unit() -> None:
    for unit, per_metre in {"m": 1.0, "cm": 100.0, "mm": 1000.0}.items():
        check_places(unit, (1.5, 2.0, -1.5), (0.5, 3.0, -1.0), per_metre=per_metre)
        check_lengths(unit, per_metre, 2.5, 2.6)


def test_a_command_ten_frames_away_is_refused_and_not_one_just_inside() -> None:
    """The frame is 5 m across, and its middle at x = 1.5 m."""
    check_places("m", (51.4, 2.0, -1.5))
    with pytest.raises(InputFileError, match=r"line 3, column cmd_x_m: .* got 51\.6 m; are these"):
        check_places("m", (51.4, 2.0, -1.5), (51.6, 2.0, -1.5))
    with pytest.raises(InputFileError, match=r"column cmd_y_m: .* 5 m across, got -48\.1 m"):
        check_places("m", (1.5, -48.1, -1.5))
    with pytest.raises(InputFileError, match=r"line 2, column length_1_m: .* got 50\.1 m"):
        check_lengths("m", 1.0, 50.1)


@pytest.mark.parametrize(("unit", "per_metre", "hint"), [
    ("m", 1.0, r"really m\? Name the column by its unit, such as cmd_z_mm$"),
    ("cm", 100.0, r"really cm\? Name the column by its unit, such as cmd_z_mm$"),
    ("mm", 1e3, r"really mm\? Name the column by its unit, such as cmd_z_um$"),
    ("um", 1e6, r"really um\?$"),
])  # fmt: skip
def test_the_likeliest_smaller_unit_is_proposed(unit: str, per_metre: float, hint: str) -> None:
    with pytest.raises(InputFileError, match=hint):
        check_places(unit, (1.5, 2.0, 1500.0), per_metre=per_metre)


@pytest.mark.parametrize(("name", "cell"), [
    ("cmd_x_mm", "1.5"),
    ("cmd_x_mm", "6.4"),
    ("cmd_x_cm", "1.5"),
    ("cmd_x_cm", "4.9"),
])  # fmt: skip
def test_metres_under_the_name_of_a_smaller_unit_are_refused(name: str, cell: str) -> None:
    """1.5 mm is at the origin, where no command is; 1.5 m is in the middle of the robot."""
    unit = name[-2:]
    said = rf"line 2, column {name}: .* at most {cell} {unit}; are .* such as cmd_x_m$"
    poses = at((float(cell) / {"mm": 1000.0, "cm": 100.0}[unit], 2.0, -1.5))
    with pytest.raises(InputFileError, match=said):
        check_commands(columns_of(name, cell), RECTANGLE, poses, None)


def test_short_lengths_are_metres_too() -> None:
    said = r"column length_1_mm: .* at most 2\.5 mm; .* such as length_1_m$"
    with pytest.raises(InputFileError, match=said):
        check_lengths("mm", 1000.0, 2.5e-3)


@pytest.mark.parametrize(("name", "cells", "middle"), [
    ("cmd_x_cm", ("1.5", "5.1"), 1.5),  # 5.1 cm is more than a hundredth of the frame
    ("cmd_x_mm", ("1.5", "6.6"), 1.5),  # 6.6 m would be outside
    ("cmd_x_mm", ("0", "0"), 1.5),  # nothing is nothing in every unit
    ("cmd_x_mm", ("1.5", "2"), 0.4),  # the robot's middle is near its origin
])  # fmt: skip
def test_small_numbers_that_may_be_right_pass(
    name: str, cells: tuple[str, str], middle: float
) -> None:
    home = HOME.copy()
    home[0] = middle
    robot = replace(RECTANGLE, reference_pose=home)
    columns = columns_of(name, *cells)
    poses = at(*((value, 2.0, -1.5) for value in columns.numbers("cmd_x").tolist()))
    check_commands(columns, robot, poses, None)


def test_a_robot_that_most_commands_are_outside_of_is_another() -> None:
    """Half of them are 6 m away; of three commands nobody can tell."""
    inside, outside = (1.5, 2.0, -1.5), (1.5, 2.0, 4.5)
    check_places("m", outside, outside, outside)
    check_places("m", outside, outside, inside, inside, inside)
    said = r"most commands are outside the frame of robot rectangle: half of them are 6 m or more"
    with pytest.raises(InputFileError, match=said):
        check_places("m", inside, outside, outside, outside)
