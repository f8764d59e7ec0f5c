"""The distance between two poses, measured by code that neither side uses."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.suite.agreement import gap
from seecr.pose import pose_difference, quat_from_rotvec, quat_multiply

AXIS = np.array([0.48, -0.6, 0.64])


def turned(angle: float) -> np.ndarray:
    """A pose turned by an angle about AXIS from one that is turned itself."""
    home = quat_from_rotvec(np.array([0.3, -1.1, 0.7]))
    return np.r_[1.0, 2.0, 3.0, quat_multiply(quat_from_rotvec(angle * AXIS), home)]


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-5, 0.1, 2.0, 3.0, np.pi - 1e-6])
def test_the_angle_is_that_of_the_turn(angle):
    distance, found = gap(turned(angle), turned(0.0))
    assert distance == 0.0
    assert found == pytest.approx(angle, rel=1e-7, abs=4e-16 if angle < 1 else 1e-9)


def test_small_angles_keep_their_digits():
    angles = np.array([1e-14, 1e-10, 1e-7])
    found = gap(np.stack([turned(a) for a in angles]), turned(0.0))[1]
    np.testing.assert_allclose(found, angles, rtol=0, atol=1e-15)


def test_a_quaternion_and_its_negative_are_one_rotation():
    other = turned(0.4) * np.r_[1, 1, 1, -1, -1, -1, -1]
    assert gap(other, turned(0.4))[1] < 1e-15


def test_both_rotations_of_two_random_poses_say_the_same():
    random = np.random.default_rng(2)
    a, b = random.normal(size=(2, 50, 7))
    a[:, 3:] /= np.linalg.norm(a[:, 3:], axis=1, keepdims=True)
    b[:, 3:] /= np.linalg.norm(b[:, 3:], axis=1, keepdims=True)
    distance, angle = gap(a, b)
    change = pose_difference(a, b)
    np.testing.assert_allclose(distance, np.linalg.norm(change[:, :3], axis=1), rtol=1e-14)
    np.testing.assert_allclose(angle, np.linalg.norm(change[:, 3:], axis=1), rtol=1e-7)


def test_where_there_is_no_pose_there_is_no_gap():
    nowhere = np.full(7, np.nan)
    distance, angle = gap(np.stack([nowhere, turned(0.2)]), turned(0.0))
    assert np.isnan(distance[0]) and np.isnan(angle[0])
    assert distance[1] == 0.0 and angle[1] == pytest.approx(0.2, rel=1e-12)
    assert np.isnan(gap(nowhere, nowhere)[1])
