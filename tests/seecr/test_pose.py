"""Rotations and poses, against SciPy's and near the identity, where the series branches live."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seecr import pose
from seecr.pose import (
    Array,
    changes_between,
    deviated,
    moved_by,
    pose_add,
    pose_difference,
    products,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    rotated,
    rotation_vectors,
    rotvec_from_quat,
)


def rotations(count: int, seed: int = 0) -> tuple[np.ndarray, Rotation]:
    xyzw = np.random.default_rng(seed).normal(size=(count, 4))
    rotation = Rotation.from_quat(xyzw)
    return np.roll(rotation.as_quat(), 1, axis=1), rotation


def poses(count: int, seed: int = 0) -> np.ndarray:
    places = np.random.default_rng(seed + 100).normal(size=(count, 3))
    return np.column_stack([places, rotations(count, seed)[0]])


def test_products_and_inverses_are_those_of_rotations() -> None:
    a, rot_a = rotations(50, 1)
    b, rot_b = rotations(50, 2)
    taken = pose.quat_to_matrix(pose.quat_multiply(a, b))
    assert taken == pytest.approx((rot_a * rot_b).as_matrix(), abs=1e-14)
    back = pose.quat_to_matrix(pose.quat_conjugate(a))
    assert back == pytest.approx(rot_a.inv().as_matrix(), abs=1e-14)


def test_rotating_vectors_broadcasts_over_leading_axes() -> None:
    q, rot = rotations(6)
    vectors = np.random.default_rng(3).normal(size=(6, 3))
    assert pose.quat_rotate(q, vectors) == pytest.approx(rot.apply(vectors), abs=1e-14)
    grid = pose.quat_rotate(q.reshape(2, 3, 1, 4), vectors[:4])
    assert grid.shape == (2, 3, 4, 3)
    assert grid[1, 2] == pytest.approx(rot[5].apply(vectors[:4]), abs=1e-14)


def test_the_matrix_of_a_quaternion_is_scalar_first() -> None:
    q, rot = rotations(40)
    assert pose.quat_to_matrix(q) == pytest.approx(rot.as_matrix(), abs=1e-15)
    quarter = pose.quat_to_matrix(np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]))
    assert quarter == pytest.approx(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-8, 9e-5, 1.1e-4, 2e-4, 0.1, 3.0, 3.1415])
def test_rotation_vectors_return_to_the_last_digits(size: float) -> None:
    direction = np.array([2.0, -3.0, 6.0]) / 7.0
    there = pose.quat_from_rotvec(size * direction)
    assert np.linalg.norm(there) == pytest.approx(1.0, abs=1e-15)
    assert pose.rotvec_from_quat(there) == pytest.approx(size * direction, rel=2e-15, abs=0)


def test_both_signs_of_a_quaternion_are_one_rotation() -> None:
    q, rot = rotations(30)
    assert pose.rotvec_from_quat(-q) == pytest.approx(rot.as_rotvec(), abs=1e-14)
    assert np.max(np.linalg.norm(pose.rotvec_from_quat(q), axis=1)) <= np.pi


def test_angles_are_inverse_of_each_other() -> None:
    angles = np.random.default_rng(4).uniform(-1.5, 1.5, (50, 3))
    q = pose.quat_from_rxyz(angles)
    assert pose.rxyz_from_quat(q) == pytest.approx(angles, abs=1e-13)
    intrinsic = Rotation.from_euler("XYZ", angles).as_matrix()
    assert pose.quat_to_matrix(q) == pytest.approx(intrinsic, abs=1e-14)


def test_difference_is_left_handed_in_the_base_frame() -> None:
    a, b = poses(20, 5), poses(20, 6)
    taken = pose.pose_difference(a, b)
    turn = Rotation.from_quat(np.roll(a[:, 3:], -1, axis=1))
    turn = turn * Rotation.from_quat(np.roll(b[:, 3:], -1, axis=1)).inv()
    assert np.array_equal(taken[:, :3], a[:, :3] - b[:, :3])
    assert taken[:, 3:] == pytest.approx(turn.as_rotvec(), abs=1e-13)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4, 0.3, 2.0])
def test_adding_undoes_differencing(size: float) -> None:
    start = poses(20)
    change = size * np.random.default_rng(7).uniform(-1, 1, (20, 6))
    after = pose.pose_add(start, change)
    assert pose.pose_difference(after, start) == pytest.approx(change, abs=1e-14 * (1 + 10 * size))
    assert np.linalg.norm(after[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-15)


def test_points_of_the_platform_in_the_base_frame() -> None:
    points = np.random.default_rng(8).normal(size=(5, 3))
    for one in poses(4):
        turn = Rotation.from_quat(np.roll(one[3:], -1))
        expected = turn.apply(points) + one[:3]
        assert pose.transform_points(one, points) == pytest.approx(expected, abs=1e-14)
    assert pose.transform_points(poses(6).reshape(2, 3, 7), points).shape == (2, 3, 5, 3)


# Rotations by all sizes [rad], about the bound of the series and a half turn too.
ANGLES = (0.0, 1e-12, 1e-7, 1.9e-4, 2.1e-4, 0.1, 2.0, np.pi - 1e-9, np.pi, 4.0, 6.2)


def rows_of_poses(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(len(ANGLES), 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = quat_from_rotvec(axis * np.array(ANGLES)[:, None])
    return np.concatenate([rng.normal(size=(len(ANGLES), 3)), turn], axis=1)


def deviated_by_numpy(rows_of_poses: Array, deviation: Array) -> Array:
    turn = quat_multiply(deviation[:, 3:], rows_of_poses[:, 3:])
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return np.concatenate([rows_of_poses[:, :3] + deviation[:, :3], turn], axis=1)


PAIRS = [
    (products, quat_multiply, 3, 3),
    (rotated, quat_rotate, 3, 0),
    (changes_between, pose_difference, 0, 0),
    (deviated, deviated_by_numpy, 0, 0),
]


@pytest.mark.parametrize(("fast", "plain", "a", "b"), PAIRS)
def test_rows_are_as_by_numpy(
    fast: Callable[..., Array], plain: Callable[..., Array], a: int, b: int
) -> None:
    one, other = rows_of_poses(0)[:, a:], rows_of_poses(1)[::-1, b : 3 if fast is rotated else 7]
    np.testing.assert_allclose(fast(one, other), plain(one, other), rtol=0, atol=1e-14)


@pytest.mark.parametrize("size", [0.3, 1e-9])
def test_poses_are_moved_as_by_numpy(size: float) -> None:
    changes = size * np.random.default_rng(2).normal(size=(len(ANGLES), 6))
    found = moved_by(rows_of_poses(0), changes)
    np.testing.assert_allclose(found, pose_add(rows_of_poses(0), changes), rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        changes_between(found, rows_of_poses(0)), changes, rtol=0, atol=2e-15
    )


def test_rotation_vectors_are_as_by_numpy() -> None:
    turn = np.concatenate([rows_of_poses(0)[:, 3:], -rows_of_poses(1)[:, 3:]])
    np.testing.assert_allclose(
        rotation_vectors(turn), rotvec_from_quat(turn), rtol=1e-14, atol=1e-30
    )


@pytest.mark.parametrize(("fast", "plain", "a", "b"), PAIRS)
def test_one_row_is_for_all(
    fast: Callable[..., Array], plain: Callable[..., Array], a: int, b: int
) -> None:
    one, other = rows_of_poses(0)[:, a:], rows_of_poses(1)[:, b : 3 if fast is rotated else 7]
    for left, right in ((one[5:6], other), (one, other[5:6])):
        np.testing.assert_allclose(fast(left, right), plain(left, right), rtol=0, atol=1e-14)


def test_one_row_is_moved_by_all_changes_and_all_by_one() -> None:
    changes = 0.3 * np.random.default_rng(2).normal(size=(len(ANGLES), 6))
    for some, by in ((rows_of_poses(0)[5:6], changes), (rows_of_poses(0), changes[5:6])):
        np.testing.assert_allclose(moved_by(some, by), pose_add(some, by), rtol=0, atol=1e-14)


def test_shapes_are_kept() -> None:
    turn, places = rows_of_poses(0)[5, 3:], rows_of_poses(1)[:, :3]
    np.testing.assert_allclose(rotated(turn, places), quat_rotate(turn, places), atol=1e-14)
    pose = rows_of_poses(0)[4]
    assert moved_by(pose, np.zeros(6)).shape == (7,)
    assert moved_by(pose[None], np.zeros(6)).shape == (1, 7)
    assert changes_between(np.ones((2, 3, 7)), np.ones((2, 3, 7))).shape == (2, 3, 6)
    assert rotation_vectors(turn).shape == (3,)


def test_from_a_pose_to_itself_nothing_changes() -> None:
    assert np.all(changes_between(rows_of_poses(0), rows_of_poses(0)) == 0.0)


def test_no_rows_are_no_rows() -> None:
    assert changes_between(np.empty((0, 7)), rows_of_poses(0)[0]).shape == (0, 6)
    assert products(rows_of_poses(0)[:1, 3:], np.empty((0, 4))).shape == (0, 4)


def test_other_numbers_of_rows_are_no_pairs() -> None:
    with pytest.raises(ValueError, match="expected as many rows as 11, or one, got 2"):
        changes_between(rows_of_poses(0), rows_of_poses(0)[:2])


def test_what_is_not_known_stays_so_and_nothing_given_is_changed() -> None:
    given = rows_of_poses(0)
    given[3, 5] = np.nan
    given.flags.writeable = False
    found = changes_between(given, rows_of_poses(1))
    assert np.isnan(found[3, 3:]).all() and np.isfinite(np.delete(found, 3, axis=0)).all()
