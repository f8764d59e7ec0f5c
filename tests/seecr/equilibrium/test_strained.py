"""Cables strained as no rope is are named: their robot has most likely a number in another unit."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from crosscheck.planning.design import make_plan
from seecr.cli import main
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_names, model_path
from seecr.equilibrium.strained import strained


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
    assert said in CliRunner().invoke(main, words).stdout
    robot = load_robot(tmp_path / "soft.xml")
    poses = np.tile(robot.reference_pose, (7, 1))
    poses[:, 2] += np.linspace(0.0, 0.06, 7)
    assert any(said in note for note in make_plan(robot, poses).notes)
