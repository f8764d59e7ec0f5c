"""Rotations and poses, against SciPy's and near the identity, where the series branches live."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seecr import pose


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
