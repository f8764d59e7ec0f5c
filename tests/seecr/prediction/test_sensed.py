"""What a model's tracker reads, and where a platform has to be for it to read that."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from seecr import Commands, Term, correct, load_robot, placed, tracked
from seecr.cli import main
from seecr.description.joints import off_joints
from seecr.pose import pose_difference, quat_rotate

NAME = "demobot_cogiro"


def text_of(*terms: Term) -> str:
    """A model's file."""
    lines = ["format = 1"]
    for term in terms:
        lines += ["[[effect]]", f'name = "{term.name}"', "[effect.parameters]"]
        values = zip(term.layout.names, term.vector, strict=True)
        lines += [f"{name} = {{ value = {float(value)!r} }}" for name, value in values]
    return "\n".join(lines) + "\n"


def test_a_platform_is_placed_where_its_tracker_reads_what_is_wanted() -> None:
    robot = load_robot(NAME)
    target = Term.of(robot, "tracker_target", shift_z_m=0.05)
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002, rotation_z_rad=0.01)
    wanted = Commands(np.tile(robot.reference_pose, (3, 1)) + 0.01 * np.eye(3, 7))
    alone = tracked(robot, wanted, [target])
    up = wanted.pose[:, :3] + quat_rotate(wanted.pose[:, 3:], np.array([0.0, 0.0, 0.05]))
    np.testing.assert_allclose(alone[:, :3], up, atol=1e-12)
    assert (tracked(robot, wanted.pose, [target]) == alone).all()  # poses alone will do
    at = placed(robot, wanted, [target, frame])
    np.testing.assert_allclose(tracked(robot, at, [target, frame]), wanted.pose, atol=1e-11)
    assert np.abs(at.pose - wanted.pose).max() > 0.04
    found = correct(robot, at, effects=[target, frame])
    read = tracked(robot, Commands(found.solution.pose), [target, frame])
    assert found.reached.all() and np.abs(read - wanted.pose).max() < 1e-9


def test_on_joints_readings_are_as_near_as_these_allow(tmp_path: Path) -> None:
    """A tracker that stands a little askew reads no planar robot in its plane: it was refused."""
    robot = load_robot("planar_vertical")
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002, rotation_x_rad=0.001)
    target = Term.of(robot, "tracker_target", shift_z_m=0.05)
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, [0, 2]] += 0.01 * np.eye(3, 2)
    wanted = Commands(poses)
    at = placed(robot, wanted, [frame, target])
    assert off_joints(robot, at.pose) is None
    missed = pose_difference(wanted.pose, tracked(robot, at, [frame, target]))
    across = np.array([False, True, False, True, False, True])
    assert np.abs(missed[:, ~across]).max() < 1e-5 < np.abs(missed[:, across]).max() < 2e-3
    file, model = tmp_path / "wanted.csv", tmp_path / "model.toml"
    file.write_text("cmd_x_m,cmd_z_m\n0.4,0.15\n")
    model.write_text(text_of(frame, target))
    args = ["correct", "planar_vertical", str(file), "--out", str(tmp_path / "out"), "--as-read"]
    told = CliRunner().invoke(main, [*args, "--model", str(model)])
    assert told.exit_code == 0, told.output
    assert "the joints allow readings no nearer than 0.1" in told.output
    assert " mm and 0.0573 deg along single axes" in told.output


def test_the_command_tells_of_the_tracker(tmp_path: Path) -> None:
    poses, model = tmp_path / "wanted.csv", tmp_path / "model.toml"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.2\n0.45,0.25,0.2\n")
    robot = load_robot(NAME)
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002)
    model.write_text(text_of(frame, Term.of(robot, "tracker_target", shift_z_m=0.05)))
    args = ["correct", NAME, str(poses), "--out", str(tmp_path / "out")]
    told = CliRunner().invoke(main, [*args, "--model", str(model)])
    assert told.exit_code == 0, told.output
    assert "the model's tracker reads these poses up to 50 mm off" in told.output
    read = CliRunner().invoke(main, [*args, "--model", str(model), "--as-read", "--json"])
    rows = json.loads(read.stdout)["rows"]
    assert read.exit_code == 0 and rows[0]["wanted"][2] == pytest.approx(0.15, abs=1e-3)
    none = CliRunner().invoke(main, [*args, "--as-read"])
    assert none.exit_code == 2 and "expected --model M.toml" in none.output
