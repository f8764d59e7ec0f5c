"""Every stable equilibrium of a command is found, by energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seecr import InputError, Robot, Status, Term, equilibria, load_robot, solve
from seecr.description.joints import pose_of_values
from seecr.equilibrium.following import moved
from seecr.equilibrium.search import elsewhere, starts_about
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply
from seecr.show.pose_words import other_lines, softest_words

# To one of this command's rests only few starts lead.
HARD = np.array([0.308667, 0.214797, 0.14935, 0.996763, -0.037391, -0.069476, 0.015419])


def commands_of(robot: Robot, n: int, random: np.random.Generator) -> Array:
    """Poses (n, 7) about the reference pose, tilted up to 40 degrees."""
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, :3] += 0.25 * np.ptp(robot.exit_points, axis=0) * random.uniform(-1, 1, (n, 3))
    axes = random.normal(size=(n, 3))
    turns = np.deg2rad(random.uniform(0, 40, (n, 1)))
    axes *= turns / np.linalg.norm(axes, axis=1, keepdims=True)
    poses[:, 3:] = quat_multiply(quat_from_rotvec(axes), poses[:, 3:])
    return poses


def rests_of_starts(robot: Robot, pose: Array, n: int, random: np.random.Generator) -> Array:
    """The different rests (k, 7) to which n starts near a command lead, turned in every way."""
    starts = np.tile(pose, (n, 1))
    size = 0.49 * np.max(np.ptp(robot.exit_points, axis=0))
    starts[:, :3] += random.uniform(-size, size, (n, 3))
    starts[:, 3:] = quat_from_rotvec(random.uniform(-np.pi, np.pi, (n, 3)))
    many = solve(robot, np.tile(pose, (n, 1)), start=starts)
    left, rests = many.pose[many.converged], []
    while len(left):
        rests.append(left[0])
        left = left[~same(robot, left, left[0])]
    return np.array(rests)


def same(robot: Robot, poses: Array, one: Array) -> Array:
    apart = pose_difference(poses, one) * np.repeat([1.0, robot.length], 3)
    return np.linalg.norm(apart, axis=1) < 1e-5 * robot.length


@pytest.mark.slow
@pytest.mark.parametrize("starts", [1500, pytest.param(3000, marks=pytest.mark.sweep)])
def test_what_thousands_of_starts_find_is_found(starts: int) -> None:
    """All but one in a hundred: there are rests to which one start in 40,000 leads."""
    there, lost = 0, []
    for name in ("demobot_off_centre", "demobot_cogiro", "cogiro_large", "demobot_parallel"):
        robot, random = load_robot(name), np.random.default_rng(7)
        for pose in [*commands_of(robot, 5, random), HARD]:
            found = equilibria(robot, pose)
            assert found.converged.all() and np.all(np.diff(found.energy) >= 0)
            rests = rests_of_starts(robot, pose, starts, random)
            there += len(rests)
            lost += [(name, r) for r in rests if not same(robot, found.pose, r).any()]
    assert there > 90 and len(lost) <= 0.01 * there


def test_search_goes_on_while_starts_lead_where_no_other_did() -> None:
    robot = load_robot("demobot_off_centre")
    found = equilibria(robot, HARD)
    np.testing.assert_allclose(found.pose[-1, :3], [0.31089, 0.17045, 0.19257], atol=1e-5)
    assert found.energy[-1] - found.energy[0] == pytest.approx(0.228, abs=0.001)
    assert len(equilibria(robot, HARD, most=256)) <= len(found) == 3


def test_the_tilted_command_with_two_rests() -> None:
    robot = load_robot("demobot_parallel")
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    pose = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    found = equilibria(robot, pose)
    np.testing.assert_allclose(found.energy, [-0.01533, -0.01372], atol=1e-5)
    apart = pose_difference(found.pose[:1], found.pose[1:])[0]
    assert 1e3 * np.linalg.norm(apart[:3]) == pytest.approx(15.7, abs=0.1)
    own = solve(robot, pose)
    (line,) = other_lines(own, found)
    assert line.startswith("could also rest 15.7") and "slack: cable2 cable3 cable5 cable7" in line


def test_where_it_drifts_to_without_resistance_is_no_other_equilibrium() -> None:
    """Two cables are tight, and the platform can turn until a third one is: that is one rest."""
    robot = load_robot("demobot_parallel")
    pose = np.array([0.1, 0.1, 0.1, 1.0, 0.0, 0.0, 0.0])
    own, found = solve(robot, pose, others=True), equilibria(robot, pose)
    assert own.status[0] is Status.SINGULAR and own.others is not None
    assert found.converged.any(), "where the third cable holds it"
    assert len(own.others[0]) == 0 and list(elsewhere(own, found)) == []
    assert list(other_lines(own, found)) == ["no other stable equilibrium was found"]
    # as far away, but uphill
    up = np.array([[0.0, 0.0, 0.01, 0.0, 0.0, 0.0]])
    hill = replace(found, pose=moved(robot, found.pose, up))
    assert list(elsewhere(own, hill)) == list(np.flatnonzero(found.converged))


def test_solve_tells_the_others() -> None:
    robot = load_robot("demobot_parallel")
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
    with pytest.raises(InputError, match="expected no other method, no start, no others"):
        solve(robot, tilted, effects=hysteresis, others=True)
    with pytest.raises(InputError, match="lead to one rest along their way"):
        equilibria(robot, tilted, effects=hysteresis)


def test_a_robot_with_one_rest_says_so() -> None:
    robot = load_robot("planar_vertical")
    found = equilibria(robot, robot.reference_pose)
    assert len(found) == 1
    own = solve(robot, robot.reference_pose)
    assert list(other_lines(own, found)) == ["no other stable equilibrium was found"]
    assert softest_words(own).startswith("move along ")
    free = load_robot("demobot_parallel")
    assert softest_words(solve(free, free.reference_pose)).startswith(("turn about", "move along"))


def test_several_poses_are_refused() -> None:
    robot = load_robot("demobot_cogiro")
    with pytest.raises(InputError, match=r"equilibria needs one commanded pose \(7,\), got 2"):
        equilibria(robot, np.tile(robot.reference_pose, (2, 1)))


def test_on_joints_starts_lie_about_the_command() -> None:
    robot = load_robot("planar_two_cable")
    command = pose_of_values(robot, np.array([[0.3, -0.1, 0.2]]))[0]
    assert np.allclose(starts_about(robot, command[0], np.full((1, 4), 0.5)), command)
