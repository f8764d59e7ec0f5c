"""Cables strained as no rope is are named: their robot has most likely a number in another unit."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from crosscheck.planning.design import make_plan
from seecr import Commands, load_robot, model_names, model_path, solve
from seecr.cli import main
from seecr.equilibrium.strange import strained, strained_rows


def test_what_a_rest_length_or_a_stiffness_too_small_does_is_told() -> None:
    robot = load_robot("demobot_cogiro")
    short = robot.rest_lengths.copy()
    short[3] *= 0.6
    (note,) = strained(replace(robot, rest_lengths=short))
    assert f"{robot.source}: cable4 is strained by 66.7 % at the reference pose" in note
    assert "is springlength about the distance of the sites [m], are stiffness in N/m" in note
    # 3 N per strain of one: the weight stretches the cables
    (note,) = strained(replace(robot, ea=np.full(8, 3.0)))
    assert "cable1, cable2 and 6 more are strained by up to" in note


def test_one_cable_is_one() -> None:
    """In closed form: a weight of 2 N on a cable of 10 N per strain of one."""
    robot = load_robot("planar_vertical")
    bob = replace(
        robot, exit_points=[[0.4, 0.0, 1.0]], anchor_points=[[0.0, 0.0, 0.0]], ea=[10.0],
        rest_lengths=[0.8], mass=2.0 / 9.81, cable_names=("rope",), joints=robot.joints[1:2],
        centre_of_mass=np.zeros(3), reference_pose=[0.4, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0],
    )  # fmt: skip
    (note,) = strained(bob)
    assert "rope is strained by 20 % at the reference pose" in note
    assert strained(replace(bob, ea=[20.1])) == ()


def test_of_rows_the_most_strained_one_is_told() -> None:
    """In closed form: cables of 0.2 m stretched to the 0.4 m between exits and bar."""
    robot = load_robot("planar_two_cable")
    at = np.tile(robot.reference_pose, (3, 1))
    rows = Commands(at, lengths=np.array([[0.6, 0.6], [0.2, 0.2], [0.21, 0.21]]))
    found = solve(robot, rows)
    (note,) = strained_rows(found)
    assert "cable1, cable2 are strained by up to 100 % at pose 1, which is much for a rope" in note
    (note,) = strained_rows(replace(found, line=np.array([2, 3, 4])))
    assert "at line 3," in note
    assert strained_rows(found.rows(np.array([0]))) == ()
    (note,) = strained_rows(found.rows(np.array([1])))
    assert "where the platform rests," in note


def test_a_robot_that_is_told_to_be_strained_is_so_in_all_rows() -> None:
    robot = replace(load_robot("demobot_cogiro"), ea=np.full(8, 3.0))
    assert strained(robot) and strained_rows(solve(robot, robot.reference_pose)) == ()


@pytest.mark.parametrize("command", ["sweep", "pose", "correct"])
def test_every_command_tells_of_strained_rows_once(command: str, tmp_path: Path) -> None:
    """Of lengths that strain cables by all their length nothing was said."""
    (tmp_path / "len.csv").write_text("length_1_m,length_2_m\n0.6,0.6\n0.2,0.2\n")
    (tmp_path / "cmd.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.5,0,0.9\n")
    words, said = {
        "sweep": ([tmp_path / "len.csv", "--out", tmp_path / "s"], " 100 % at line 3, "),
        "pose": (["0.5", "0", "0.95", "--cable", "30", "--alone"], " % where the platform rests, "),
        "correct": (
            [tmp_path / "cmd.csv", "--cable", "60", "--highest", "90", "--out", tmp_path / "c"],
            " % at line 2, ",
        ),
    }[command]
    words = ["planar_two_cable", *map(str, words)]
    out = CliRunner().invoke(main, [command, *words]).stdout
    assert out.count("which is much for a rope") == 1 and said in out


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_no_shipped_robot_is(name: str) -> None:
    assert strained(load_robot(name)) == ()


@pytest.mark.slow
def test_it_is_told_where_notes_on_a_robot_are(tmp_path: Path) -> None:
    text = model_path("demobot_cogiro").read_text()
    (tmp_path / "soft.xml").write_text(
        re.sub(r'stiffness="([^"]*)"', lambda m: f'stiffness="{float(m[1]) / 1e3}"', text)
    )
    said = "strained by up to "
    words = ["pose", str(tmp_path / "soft.xml"), "0.4", "0.25", "0.15", "--alone"]
    assert said in CliRunner().invoke(main, words).stderr
    robot = load_robot(tmp_path / "soft.xml")
    poses = np.tile(robot.reference_pose, (7, 1))
    poses[:, 2] += np.linspace(0.0, 0.06, 7)
    assert any(said in note for note in make_plan(robot, poses).notes)
