"""Commands as callers give them: poses, commands, or what holds commands among other things."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from seecr import Commands, Experiment
from seecr.pose import quat_from_rotvec, quat_multiply
from seecr.statics.starts import commands_from, poses_from_lengths

ROBOT = seecr.load_robot("demobot_cogiro")
POSES = np.array([[0.4, 0.25, 0.1, 1, 0, 0, 0], [0.0, 0.1, 0.2, 1, 0, 0, 0]])


def measured() -> crosscheck.Measurements:
    return crosscheck.Measurements(
        Path("here.csv"), ROBOT.n_cables, np.array(["one", "two"]), command_pose=POSES
    )


def test_measurements_stand_for_their_commands() -> None:
    found = commands_from(measured(), ROBOT)
    assert np.array_equal(found.pose, POSES)
    assert found.starts.tolist() == [True, True]


@pytest.mark.parametrize(
    "rests",
    [
        lambda given: seecr.predict(ROBOT, given).pose,
        lambda given: seecr.solve(ROBOT, given).pose,
        lambda given: seecr.correct(ROBOT, given).lengths,
    ],
    ids=["predict", "solve", "correct"],
)
def test_what_takes_poses_takes_measurements(rests: Callable[[Any], np.ndarray]) -> None:
    apart = seecr.Commands(POSES, run=np.array([0, 1]))
    assert np.array_equal(rests(measured()), rests(apart))


def test_something_else_is_refused() -> None:
    with pytest.raises(seecr.InputError, match="poses: expected numbers, got a Robot"):
        seecr.predict(ROBOT, ROBOT)  # type: ignore[arg-type]


# --- Commanded lengths lead to the rest that the robot comes to, not to the next one downhill


HALLS = ["ipanema", "cogiro_large"]


def commanded(robot: seecr.Robot, n: int = 60) -> np.ndarray:
    """Poses all over the hall, turned by a few degrees."""
    random = np.random.default_rng(5)
    half = 0.35 * np.ptp(robot.exit_points, axis=0)
    pose = np.tile(robot.reference_pose, (n, 1))
    pose[:, :3] += random.uniform(-1.0, 1.0, (n, 3)) * half
    turn = quat_from_rotvec(random.normal(0.0, 0.05, (n, 3)))
    pose[:, 3:] = quat_multiply(turn, pose[:, 3:])
    return pose


@pytest.mark.parametrize("name", HALLS)
def test_lengths_alone_bring_the_platform_where_the_poses_do(name: str) -> None:
    robot = seecr.load_robot(name)
    at = seecr.solve(robot, commanded(robot))
    home = np.tile(robot.reference_pose, (len(at), 1))
    fallen = seecr.solve(robot, rest_lengths=at.rest_lengths, start=home)
    by_lengths = seecr.solve(robot, rest_lengths=at.rest_lengths)
    assert at.converged.all() and by_lengths.converged.all()
    off = np.linalg.norm(fallen.pose[:, :3] - at.pose[:, :3], axis=1)
    assert np.sum(off > 0.01 * robot.length) >= 2  # the next rest downhill from home is another
    assert by_lengths.pose == pytest.approx(at.pose, abs=1e-7 * robot.length)
    # of lengths that some pose has, the search starts at one that has them
    straight = robot.nominal_lengths(at.pose)
    first = poses_from_lengths(robot, Commands(home, lengths=straight))
    assert robot.nominal_lengths(first) == pytest.approx(straight, abs=1e-6 * robot.length)


def test_data_with_lengths_are_predicted_where_the_runs_lead() -> None:
    robot = seecr.load_robot("ipanema")
    pose = commanded(robot)
    at = seecr.solve(robot, pose)
    run = np.repeat(np.arange(6), 10)
    home = np.tile(robot.reference_pose, (len(pose), 1))
    for told, lengths in (
        (False, at.rest_lengths),
        (True, robot.rest_lengths + robot.nominal_lengths(pose) - robot.reference_lengths),
    ):
        rows = Commands(home, lengths=lengths, run=run, told=told)
        found = Experiment(robot, rows).predict()
        assert found.solved.all()
        assert found.pose == pytest.approx(at.pose, abs=1e-7 * robot.length)


def test_poses_lead_nowhere() -> None:
    robot = seecr.load_robot("ipanema")
    assert poses_from_lengths(robot, Commands(commanded(robot))) is None


def test_where_a_search_is_to_start_is_kept() -> None:
    robot = seecr.load_robot("ipanema")
    pose = commanded(robot)
    lengths = seecr.solve(robot, pose).rest_lengths
    assert poses_from_lengths(robot, Commands(pose, lengths=lengths)) is None


@pytest.mark.parametrize("name", ["planar_two_cable", "planar_vertical", "camera"])
def test_joints_and_few_cables_have_a_start_that_fits(name: str) -> None:
    robot = seecr.load_robot(name)
    at = seecr.solve(robot, robot.reference_pose[None])
    lengths = at.rest_lengths * np.linspace(0.97, 1.05, 9)[:, None]
    first = poses_from_lengths(
        robot, Commands(np.tile(robot.reference_pose, (9, 1)), lengths=lengths)
    )
    assert first is not None
    off = robot.nominal_lengths(first) - lengths
    assert np.all(np.abs(off) < 0.06 * lengths)
    assert seecr.solve(robot, rest_lengths=lengths).converged.all()


def test_lengths_that_nothing_fits_have_a_start_all_the_same() -> None:
    robot = seecr.load_robot("ipanema")
    home = robot.reference_pose[None]
    first = poses_from_lengths(robot, Commands(home, lengths=1e-3 * robot.rest_lengths[None]))
    assert first is not None and np.isfinite(first).all()
