"""Every stable equilibrium of a command is found, by energy."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.effects import Term
from seecr.equilibrium import solve
from seecr.errors import InputError
from seecr.mjcf import load_robot
from seecr.multiple import equilibria
from seecr.pose import pose_difference, quat_from_rotvec
from seecr.report.words import other_lines, softest_words
from seecr.shipped import model_path


@pytest.mark.slow
def test_what_thousands_of_starts_find_is_found() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    pose = np.array([0.4, 0.25, 0.15, 1, 0, 0, 0])
    found = equilibria(robot, pose)
    assert found.converged.all() and np.all(np.diff(found.energy) >= 0)
    random = np.random.default_rng(3)
    starts = np.tile(pose, (3000, 1))
    starts[:, :3] += random.uniform(-0.35, 0.35, (3000, 3))
    starts[:, 3:] = quat_from_rotvec(random.uniform(-np.pi, np.pi, (3000, 3)))
    many = solve(robot, np.tile(pose, (3000, 1)), start=starts)
    unit = np.repeat([1.0, robot.length], 3)
    for rest in many.pose[many.converged]:
        apart = pose_difference(found.pose, np.tile(rest, (len(found), 1))) * unit
        assert np.linalg.norm(apart, axis=1).min() < 1e-6


def test_the_tilted_command_with_two_rests() -> None:
    robot = load_robot(model_path("demobot_parallel"))
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    pose = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    found = equilibria(robot, pose)
    np.testing.assert_allclose(found.energy, [-0.01533, -0.01372], atol=1e-5)
    apart = pose_difference(found.pose[:1], found.pose[1:])[0]
    assert 1e3 * np.linalg.norm(apart[:3]) == pytest.approx(15.7, abs=0.1)
    own = solve(robot, pose)
    (line,) = other_lines(own, found)
    assert line.startswith("could also rest 15.7") and "slack: cable2 cable3 cable5 cable7" in line


def test_solve_tells_the_others() -> None:
    robot = load_robot(model_path("demobot_parallel"))
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    tilted = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    found = solve(robot, [tilted, robot.reference_pose], others=True)
    assert found.others is not None
    first, second = found.others
    assert len(first) == 1 and len(second) == 0
    assert first.energy[0] == pytest.approx(-0.01533, abs=1e-5)
    np.testing.assert_array_equal(first.command[0], found.command[0])
    assert solve(robot, tilted).others is None and found.rows([1]).others == (second,)
    # under a force that holds it the other way round, with the same lengths
    pushed = solve(robot, tilted, others=True, wrench=[0, 0, 0, 0, 0.05, 0])
    assert pushed.others is not None and len(pushed.others) == 1
    hysteresis = [Term.of(robot, "hysteresis", amplitude_N=0.1)]
    with pytest.raises(
        InputError, match="expected no other method, no start, no others, no follow"
    ):
        solve(robot, tilted, effects=hysteresis, others=True)
    with pytest.raises(InputError, match="lead to one rest along their way"):
        equilibria(robot, tilted, effects=hysteresis)


def test_a_robot_with_one_rest_says_so() -> None:
    robot = load_robot(model_path("planar_vertical"))
    found = equilibria(robot, robot.reference_pose)
    assert len(found) == 1
    own = solve(robot, robot.reference_pose)
    assert list(other_lines(own, found)) == ["no other stable equilibrium was found"]
    assert softest_words(own).startswith("move along ")
    free = load_robot(model_path("demobot_parallel"))
    assert softest_words(solve(free, free.reference_pose)).startswith(("turn about", "move along"))


def test_several_poses_are_refused() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    with pytest.raises(InputError, match=r"equilibria needs one commanded pose \(7,\), got 2"):
        equilibria(robot, np.tile(robot.reference_pose, (2, 1)))
