"""Commands are read from a CSV, and what is wrong with one is said with line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.read import load_commands
from seecr.columns.commands import read_commands
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.errors import InputFileError

LENGTHS = ",".join(f"length_{i}_mm" for i in range(1, 9))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(model_path("demobot_cogiro"))


def written(folder: Path, text: str) -> Path:
    path = folder / "poses.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_poses_in_any_unit_order_and_separator(tmp_path: Path, robot: Robot) -> None:
    names = "note;cmd_z_mm;cmd_x_m;cmd_y_cm;cmd_ry_deg;cmd_rx_deg;cmd_rz_rad;t_s"
    text = f"# a note\n{names}\nabc;100;0,4;25;90;0;0;1,5\n"
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


@pytest.mark.parametrize("cells", ["0.3,", ","])
def test_any_part_of_a_wanted_pose_may_be_missing(tmp_path: Path, robot: Robot, cells: str) -> None:
    """As in measurements, which ``compare`` reads: their files were refused here."""
    lengths = ",".join(["500"] * 8)
    text = f"want_x_m,want_y_m,{LENGTHS}\n0.4,0.25,{lengths}\n{cells},{lengths}\n"
    path = written(tmp_path, text)
    read = read_commands(path, robot)
    assert "no deviations are given" in " ".join(read.notes)
    assert read.wanted is not None and np.isnan(read.wanted[:, 2:]).all()
    begun = load_commands(path, robot).as_commands(robot).pose
    np.testing.assert_array_equal(read.commands.pose, begun)
    np.testing.assert_array_equal(read.commands.pose[0, :3], [0.4, 0.25, robot.reference_pose[2]])


def test_what_commanded_poses_were_for_does_not_count(tmp_path: Path, robot: Robot) -> None:
    text = "want_x_m,want_y_m,cmd_x_m,cmd_y_m,cmd_z_m\n,0.1,0.3,0.2,0.1\n"
    read = read_commands(written(tmp_path, text), robot)
    assert read.wanted is None and not any("want" in note for note in read.notes)
    np.testing.assert_array_equal(read.commands.pose[:, :3], [[0.3, 0.2, 0.1]])


def test_a_planar_robot_needs_no_third_coordinate(tmp_path: Path) -> None:
    planar = load_robot(model_path("planar_vertical"))
    read = read_commands(written(tmp_path, "cmd_x_m,cmd_z_m\n0.3,0.2\n"), planar)
    np.testing.assert_array_equal(read.commands.pose, [[0.3, 0, 0.2, 1, 0, 0, 0]])


def test_the_toml_beside_says_what_lengths_mean_and_where_runs_start(
    tmp_path: Path, robot: Robot
) -> None:
    path = written(tmp_path, f"{LENGTHS}\n" + ",".join(["500"] * 8))
    assert not read_commands(path, robot).commands.told
    beside = path.with_suffix(".toml")
    beside.write_text('lengths = "told"\nstart = "first_row"\n')
    commands = read_commands(path, robot).commands
    assert commands.told and commands.starts_here.tolist() == [True]
    beside.write_text('start = "anywhere"\n')
    with pytest.raises(InputFileError, match='line 1: start must be "reference" or "first_row"'):
        read_commands(path, robot)


# What is wrong with columns and cells is held by the tests of what reads measurements, which is
# the same reader; these are of commands alone.
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "line 1: no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or length_1"),
        ("cmd_x_m,cmd_y_m\n1,2\n", "incomplete commanded pose columns: expected cmd_x_m cmd_y_m "
         "cmd_z_m, cmd_z_m missing"),
        (f"want_qw,want_qx,{LENGTHS}\n1,0," + ",".join(["500"] * 8),
         "incomplete quaternion columns: expected all four or none, want_qy want_qz missing"),
        ("want_qw,want_rx_deg,cmd_x_m\n1,0,0\n",
         "the orientation is given twice, as want_qw and as want_rx_d"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n1,2,nan\n", "line 2, column cmd_z_m: expected a number in "
         "every row, got 'nan'"),
        (f"{LENGTHS}\n" + ",".join(["-1"] * 8), "column length_1_mm: expected a length above zero"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(
    tmp_path: Path, robot: Robot, text: str, words: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputFileError) as error:
        read_commands(path, robot)
    assert str(error.value).startswith(f"{path}: ") and words in str(error.value)
