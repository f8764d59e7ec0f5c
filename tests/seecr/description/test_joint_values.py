"""Joint values of poses: slides and hinges in any order, along and about any axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import random_robot
from rectangle import RECTANGLE
from rejointed import WAYS, rejointed
from three_cables import THREE

from seecr.description import joints
from seecr.description.joints import locked, pose_of_values, values_of_pose
from seecr.description.mjcf import load_robot
from seecr.description.robot import Joint, Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import pose_difference, quat_from_rotvec, quat_multiply, quat_rotate

# Almost half a turn: beyond, a hinge's value is another one.
_TURN = 3.1


def jointed(rng: np.random.Generator, slides: int, hinges: int, parallel: bool = False) -> Robot:
    """A robot on so many joints in any order, with axes and points of any direction."""
    robot = random_robot(rng)
    home, across = robot.reference_pose[:3], np.linalg.qr(rng.normal(size=(3, 3)))[0]
    some = [Joint("slide", f"s{i}", across[i], home) for i in range(slides)]
    axes = rng.normal(size=(hinges, 3))
    axes = np.tile(axes[:1], (hinges, 1)) if parallel else axes
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    points = home + robot.length * rng.normal(size=(hinges, 3))
    some += [Joint("hinge", f"h{i}", axes[i], points[i]) for i in range(hinges)]
    return replace(robot, joints=tuple(some[i] for i in rng.permutation(len(some))))


def some_values(rng: np.random.Generator, robot: Robot, count: int = 20) -> np.ndarray:
    reach = np.where(robot.hinges, _TURN, 5.0 * robot.length)
    return rng.uniform(-1.0, 1.0, (count, robot.n_dof)) * reach


def plainly(robot: Robot, values: np.ndarray) -> np.ndarray:
    """The pose (7,) at joint values (d,): the innermost joint moves first, the outermost last."""
    place, quat = robot.reference_pose[:3], robot.reference_pose[3:]
    for joint, value in reversed(list(zip(robot.joints, values, strict=True))):
        if joint.kind == "slide":
            place = place + value * joint.axis
            continue
        turn = quat_from_rotvec(value * joint.axis)
        place = joint.point + quat_rotate(turn, place - joint.point)
        quat = quat_multiply(turn, quat)
    return np.concatenate([place, quat])


@pytest.mark.parametrize("seed", range(8))
def test_a_pose_is_that_of_each_joint_moved_in_turn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = jointed(rng, int(rng.integers(0, 4)), int(rng.integers(1, 4)))
    values = some_values(rng, robot)
    poses = pose_of_values(robot, values)[0]
    plain = np.array([plainly(robot, row) for row in values])
    assert np.abs(pose_difference(poses, plain)).max() < 1e-12 * max(robot.reach, 1.0)


@pytest.mark.parametrize("parallel", [False, True], ids=["any axes", "parallel axes"])
@pytest.mark.parametrize("hinges", [1, 2, 3])
def test_the_values_of_a_pose_lead_to_it_however_far_hinges_turn(
    hinges: int, parallel: bool
) -> None:
    """Newton's steps from the reference pose ended elsewhere for one robot in ten."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        robot = jointed(rng, int(rng.integers(1, 4)), hinges, parallel)
        poses = pose_of_values(robot, some_values(rng, robot))[0]
        values, screws = values_of_pose(robot, poses)  # raises where they do not
        there, same = pose_of_values(robot, values)
        assert np.abs(pose_difference(there, poses)).max() < 1e-8 * max(robot.reach, 1.0)
        assert screws == pytest.approx(same, abs=1e-9 * max(robot.reach, 1.0))


def test_of_two_sets_of_angles_the_smaller_ones_are_given() -> None:
    robot = replace(
        load_robot("demobot_cogiro"),
        joints=tuple(
            Joint(kind, f"{kind}{k}", np.eye(3)[k], np.array([0.4, 0.25, 0.15]))
            for kind in ("slide", "hinge")
            for k in range(3)
        ),
    )
    values = np.random.default_rng(0).uniform(-1.2, 1.2, (50, 6))
    back = values_of_pose(robot, pose_of_values(robot, values)[0])[0]
    assert back == pytest.approx(values, abs=1e-12)


def test_a_pose_without_numbers_does_not_keep_others_from_their_values() -> None:
    """Two hinges about one axis have no closed form; all rows are searched together."""
    rng = np.random.default_rng(1)
    robot = jointed(rng, 2, 2, parallel=True)
    poses = pose_of_values(robot, some_values(rng, robot, 3))[0]
    poses[1] = np.nan
    found = joints.reachable(robot, poses)
    assert np.abs(pose_difference(found, poses)[[0, 2]]).max() < 1e-8 * robot.reach
    with pytest.raises(InputError, match="cannot reach commanded pose 1"):
        values_of_pose(robot, poses)


@pytest.mark.parametrize("slides", [0, 1, 2])
def test_a_pose_off_two_hinges_is_refused(slides: int) -> None:
    """One closed form gives angles for any orientation; that these lead there is checked."""
    rng = np.random.default_rng(slides)
    robot = jointed(rng, slides, 2)
    pose = pose_of_values(robot, some_values(rng, robot, 1))[0]
    pose[0, 3:] = quat_multiply(quat_from_rotvec(np.array([0.1, 0.2, -0.1])), pose[0, 3:])
    with pytest.raises(InputError, match="cannot reach the commanded pose, it is off by"):
        values_of_pose(robot, pose)


@pytest.mark.parametrize("way", ["as it is", *WAYS])
def test_following_a_planar_robot_searches_no_joint_values(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They have a closed form: searching them was most of what following took."""
    plain = load_robot("planar_vertical")
    robot = plain if way == "as it is" else rejointed(plain, way)
    values = np.array([[0.02, 0.01, 0.02], [0.05, 0.02, 0.0]])
    poses = pose_of_values(plain, values)[0]

    def search(*_: object) -> np.ndarray:
        raise AssertionError("a search")

    monkeypatch.setattr(joints, "_by_newton", search)
    assert solve(robot, poses, follow=True).converged.all()


def test_joints_lock_what_none_of_them_changes() -> None:
    assert not locked(RECTANGLE).any()
    assert locked(THREE).tolist() == [False, True, False, True, False, True]
    slides = replace(THREE, joints=THREE.joints[:2])
    assert locked(slides).tolist() == [False, True, False, True, True, True]
    x, y = np.eye(3)[:2]
    home = THREE.reference_pose[:3]
    # two hinges turn the platform about every axis; one beside its origin moves that as well
    gimbal = replace(
        THREE, joints=tuple(Joint("hinge", n, a, home) for n, a in (("x", x), ("y", y)))
    )
    assert locked(gimbal).tolist() == [True, True, True, False, False, False]
    door = replace(THREE, joints=(Joint("hinge", "y", y, home + 0.5 * x),))
    assert locked(door).tolist() == [False, True, False, True, False, True]
