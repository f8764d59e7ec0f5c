"""Commands are read from a CSV, and what is wrong with one is said with line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from seecr.command_file import read_commands
from seecr.errors import InputFileError
from seecr.mjcf import load_robot
from seecr.robot import Robot
from seecr.shipped import model_path

LENGTHS = ",".join(f"length_{i}_mm" for i in range(1, 9))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(model_path("demobot_cogiro"))


def written(folder: Path, text: str) -> Path:
    path = folder / "poses.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_poses_in_any_unit_order_and_separator(tmp_path: Path, robot: Robot) -> None:
    text = "# a note\nnote;cmd_z_mm;cmd_x_m;cmd_y_cm;cmd_ry_deg;t_s\nabc;100;0,4;25;90;1,5\n"
    read = read_commands(written(tmp_path, text), robot)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(read.commands.pose, [[0.4, 0.25, 0.1, half, 0, half, 0]], atol=1e-15)
    assert read.commands.time is not None and read.commands.time.tolist() == [1.5]
    assert read.commands.lengths is None and read.wanted is None


def test_lengths_with_the_poses_they_are_for(tmp_path: Path, robot: Robot) -> None:
    text = f"run,want_x_m,want_y_m,want_z_m,{LENGTHS}\n" + "\n".join(
        f"{run},0.3,0.2,0.1," + ",".join(["500"] * 8) for run in "aab"
    )
    read = read_commands(written(tmp_path, text), robot)
    assert read.commands.lengths is not None
    np.testing.assert_array_equal(read.commands.lengths, np.full((3, 8), 0.5))
    np.testing.assert_array_equal(read.commands.pose[:, :3], [[0.3, 0.2, 0.1]] * 3)
    assert read.run == ("a", "a", "b") and read.commands.starts.tolist() == [True, False, True]


def test_a_planar_robot_needs_no_third_coordinate(tmp_path: Path) -> None:
    planar = load_robot(model_path("planar_vertical"))
    read = read_commands(written(tmp_path, "cmd_x_m,cmd_z_m\n0.3,0.2\n"), planar)
    np.testing.assert_array_equal(read.commands.pose, [[0.3, 0, 0.2, 1, 0, 0, 0]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty; expected a CSV of commands"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n", "has no rows below its header"),
        ("a,b\n1,2\n", "no commands; expected a CSV of commands with a header row, such as cmd_x"),
        ("cmd_x_m,cmd_y_m\n1,2\n", "positions half there; expected cmd_z too"),
        ("cmd_x_ft,cmd_y_m,cmd_z_m\n1,2,3\n", "column cmd_x_ft: unknown unit 'ft'; expected cmd_x"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n1,2,\n", "line 2, column cmd_z_m: expected a finite number, got "
         "an empty cell"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n1,2,nan\n", "expected a finite number, got 'nan'"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n1,2\n", "line 2: expected 3 cells as in the header, got 2"),
        ("cmd_x_m,cmd_x_mm,cmd_z_m\n1,2,3\n", "column cmd_x_mm: repeated column"),
        ("cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz\n0,0,0,1,1,0,0\n",
         "line 2, column cmd_qw: expected a unit quaternion, scalar first, got norm 1.41421"),
        ("cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw\n0,0,0,1\n", "quaternion half there; expected cmd_qx"),
        ("length_1_m\n1\n", "lengths half there; expected length_2 length_3"),
        (f"{LENGTHS}\n" + ",".join(["-1"] * 8), "column length_1_mm: expected a length above zero"),
        ("run,cmd_x_m,cmd_y_m,cmd_z_m\na,0,0,0\nb,0,0,0\na,0,0,0\n", "line 4, column run: run 'a' "
         "comes back"),
        ("t_s,cmd_x_m,cmd_y_m,cmd_z_m\n1,0,0,0\n0,0,0,0\n", "line 3, column t_s: rows out of time"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(
    tmp_path: Path, robot: Robot, text: str, words: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputFileError) as error:
        read_commands(path, robot)
    assert str(error.value).startswith(f"{path}: ") and words in str(error.value)
