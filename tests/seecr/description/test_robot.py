"""The robot as numbers: what it refuses, its lengths, its joints, and its fingerprint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_robots import random_poses, random_robot
from robots import RECTANGLE, THREE, WAYS, rejointed

from seecr.description import joints
from seecr.description.fingerprint import check_robot, fingerprint
from seecr.description.joints import locked, motion_columns, pose_of_values, values_of_pose
from seecr.description.mjcf import load_robot
from seecr.description.robot import Joint, Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError, InputFileError, RobotError
from seecr.pose import pose_difference, quat_from_rotvec, quat_multiply, quat_rotate


def one_cable(**changes: Any) -> Robot:
    numbers: dict[str, Any] = {
        "name": "bob",
        "exit_points": [[0.0, 0, 1]],
        "anchor_points": [[0.0, 0, 0]],
        "ea": [100.0],
        "rest_lengths": [1.0],
        "mass": 2.0,
    }
    return Robot(**{**numbers, **changes})


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"anchor_points": [[0.0, 0]]}, InputError, r"anchor_points must be \(1, 3\), got \("),
        ({"ea": [1.0, 2.0]}, InputError, r"ea must be \(1,\), got \(2,\)"),
        ({"ea": [np.nan]}, InputError, "stiffness x rest length of cable1 holds a number"),
        ({"ea": [1e300]}, InputError, "stiffness x rest length of cable1 holds .* beyond 1e.30"),
        ({"rest_lengths": [1e31]}, InputError, "rest_lengths of cable1 holds a number"),
        ({"mass": 1e300}, RobotError, r"expected a mass from 0 to 1e\+30 kg, got 1e\+300 kg"),
        ({"gravity": [0.0, 0, np.inf]}, InputError, "gravity holds a number that is not finite"),
        ({"reference_pose": np.zeros(6)}, InputError, r"reference_pose must be \(7,\), got \(6,\)"),
        ({"ea": [0.0]}, RobotError, "cable1 has stiffness 0 N; expected .* above zero"),
        ({"rest_lengths": [-1.0]}, RobotError, "cable1 has rest length -1 m; expected a positive"),
        ({"mass": -1.0}, RobotError, "expected a mass from 0 to 1e\\+30 kg, got -1 kg"),
        ({"mass": np.nan}, RobotError, "expected a mass from 0 to 1e\\+30 kg, got nan kg"),
        ({"exit_points": [[0.0, 0, 0]]}, RobotError, "cable1 has its anchor point on its exit"),
        (
            {"exit_points": np.zeros((0, 3)), "anchor_points": np.zeros((0, 3)), "ea": [],
             "rest_lengths": []},
            RobotError, "expected at least one cable, got none",
        ),
    ],
)  # fmt: skip
def test_what_is_no_robot(changes: dict[str, Any], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=f"^robot bob: .*{text}") as caught:
        one_cable(**changes)
    assert "\n" not in str(caught.value)


def test_arrays_are_frozen_copies() -> None:
    mine = np.array([[0.0, 0, 1]])
    robot = one_cable(exit_points=mine)
    mine[0, 2] = 5.0
    assert robot.exit_points[0, 2] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        robot.exit_points[0, 2] = 5.0
    assert replace(robot, mass=3.0).mass == 3.0 and robot.mass == 2.0


def test_own_length_is_half_the_largest_anchor_distance() -> None:
    robot = load_robot("planar_two_cable")
    assert robot.length == pytest.approx(0.1, rel=1e-15)
    assert one_cable().length == 0.01  # one anchor point: a hundredth of the way to the exit
    hung_from_its_origin = one_cable(exit_points=[[0.0, 0, 0]], anchor_points=[[0.0, 0, -3]])
    assert hung_from_its_origin.length == pytest.approx(0.03)


def test_commanded_lengths_keep_the_pretension_of_the_reference_pose() -> None:
    rng = np.random.default_rng(2)
    plain = random_robot(rng)
    tight = replace(plain, rest_lengths=plain.rest_lengths - 0.01)
    poses = random_poses(rng, plain, 4)
    assert plain.commanded_lengths(poses) == pytest.approx(plain.nominal_lengths(poses), rel=1e-15)
    shorter = plain.nominal_lengths(poses) - tight.commanded_lengths(poses)
    assert shorter == pytest.approx(np.full(shorter.shape, 0.01), abs=1e-14)


# --- joints ------------------------------------------------------------------------------------


def test_motion_columns_against_finite_differences() -> None:
    rng = np.random.default_rng(3)
    robot = random_robot(rng, "jointed")
    values = rng.uniform(-0.3, 0.3, robot.n_dof)
    pose, screws = pose_of_values(robot, values)
    columns = motion_columns(screws, pose[:, :3])[0]
    for j in range(robot.n_dof):
        step = 1e-6 * np.eye(robot.n_dof)[j]
        ahead, behind = (pose_of_values(robot, values + s)[0] for s in (step, -step))
        assert columns[:, j] == pytest.approx(pose_difference(ahead, behind)[0] / 2e-6, abs=1e-8)


def test_a_pose_off_the_joints_is_named() -> None:
    robot = load_robot("planar_vertical")
    with pytest.raises(InputError, match=r"reach commanded pose 1, it is off by 0.1 m in y; exp"):
        values_of_pose(robot, np.array([[0.4, 0, 0.1, 1, 0, 0, 0], [0.4, 0.1, 0.1, 1, 0, 0, 0]]))
    turned = np.array([[0.4, 0, 0.1, np.cos(0.1), np.sin(0.1), 0, 0]])
    with pytest.raises(
        InputError, match=r"cannot reach the commanded pose, it is off by 0.2 rad in x"
    ):
        values_of_pose(robot, turned)


def test_a_point_mass_on_a_free_joint_is_told_its_cure() -> None:
    """It is free to turn at every pose; without joints that turn it is none of these."""
    camera = load_robot("camera")
    loose = replace(camera, joints=())
    assert not camera.is_point and camera.notes == ()
    assert loose.is_point
    (note,) = loose.notes
    assert "anchored at one point" in note and "three slide joints instead of the free" in note
    apart = loose.anchor_points.copy()
    apart[0, 0] += 0.05
    assert not replace(loose, anchor_points=apart).is_point


def test_a_robot_prints_as_a_few_lines() -> None:
    """It had been all of its arrays."""
    assert str(load_robot("planar_vertical")).splitlines() == [
        "planar_vertical: 4 cables, a platform on joints (slide x, slide z, hinge tilt) of 0.4 kg",
        "exit points: x 0.04 to 0.76, y 0, z 0.45 to 0.486 m",
        "at the reference pose, x y z 0.4 0 0.15 m, cables are 0.4431 m long",
        "E S: 3000 N",
    ]
    assert "8 cables, a free platform of 0.4 kg" in repr(load_robot("demobot_cogiro"))


# --- Which robot a model was made for


PATH = Path("model.toml")
ROBOT = load_robot("demobot_cogiro")


def test_its_own_fingerprint_fits_a_robot_without_a_word() -> None:
    assert check_robot(PATH, fingerprint(ROBOT), ROBOT) == ()
    assert check_robot(PATH, {}, ROBOT) == ()


def test_a_model_that_says_nothing_is_the_users_business() -> None:
    assert check_robot(PATH, None, ROBOT) == (
        "model.toml does not say which robot it was made for",
    )


@pytest.mark.parametrize(
    "change, words",
    [
        (
            {"exit_points": ROBOT.exit_points + np.eye(3)[0] * 2e-3},
            "its exit point of cable1 is 2 mm from that in /",
        ),
        ({"anchor_points": 1.1 * ROBOT.anchor_points}, "its anchor point of cable"),
        ({"reference_pose": [0.4, 0.25, 0.3, 1, 0, 0, 0]}, "its reference pose is"),
    ],
)
def test_points_elsewhere_are_another_robot(change: dict, words: str) -> None:
    with pytest.raises(InputFileError, match=f"robot of the same name, demobot_cogiro: .*{words}"):
        check_robot(PATH, fingerprint(replace(ROBOT, **change)), ROBOT)


def test_other_numbers_than_points_are_noted() -> None:
    heavier = replace(ROBOT, mass=1.25 * ROBOT.mass, ea=2.0 * ROBOT.ea)
    notes = check_robot(PATH, fingerprint(heavier), ROBOT)
    assert [key in note for key, note in zip(("mass_kg", "ea_N"), notes, strict=True)] == [True] * 2
    assert all("its effects may be counted twice" in note for note in notes)


def test_a_table_of_another_kind_is_refused() -> None:
    with pytest.raises(InputFileError, match=r"expected a table \[robot\], got 'cogiro'"):
        check_robot(PATH, "cogiro", ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] ea_N: expected numbers of shape \(8,\)"):
        check_robot(PATH, {"ea_N": [3000.0] * 7}, ROBOT)
    with pytest.raises(InputFileError, match="with 4 cables; demobot_cogiro has 8"):
        check_robot(PATH, {"name": "other", "cables": list("abcd")}, ROBOT)
    for wrong in ({"value": 8}, "cable1", list(range(8))):
        with pytest.raises(InputFileError, match=r"\[robot\] cables: expected a list of names"):
            check_robot(PATH, {"cables": wrong}, ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] mass_kg: expected a number, got 10000"):
        check_robot(PATH, {"mass_kg": 10**400}, ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] name: expected a text, got 3"):
        check_robot(PATH, {"name": 3}, ROBOT)


def test_a_hundredth_of_a_micrometre_is_the_same_robot() -> None:
    moved = replace(ROBOT, exit_points=ROBOT.exit_points + 1e-8 * np.ones((8, 3)))
    assert check_robot(PATH, fingerprint(moved), ROBOT) == ()


# --- Joint values of poses: slides and hinges in any order, along and about any axes


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
