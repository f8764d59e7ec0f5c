"""The compiled functions for rows of poses, beside those of seecr.pose with NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

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

# Rotations by all sizes [rad], about the bound of the series and a half turn too.
ANGLES = (0.0, 1e-12, 1e-7, 1.9e-4, 2.1e-4, 0.1, 2.0, np.pi - 1e-9, np.pi, 4.0, 6.2)


def poses(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(len(ANGLES), 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = quat_from_rotvec(axis * np.array(ANGLES)[:, None])
    return np.concatenate([rng.normal(size=(len(ANGLES), 3)), turn], axis=1)


def deviated_by_numpy(poses: Array, deviation: Array) -> Array:
    turn = quat_multiply(deviation[:, 3:], poses[:, 3:])
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return np.concatenate([poses[:, :3] + deviation[:, :3], turn], axis=1)


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
    one, other = poses(0)[:, a:], poses(1)[::-1, b : 3 if fast is rotated else 7]
    np.testing.assert_allclose(fast(one, other), plain(one, other), rtol=0, atol=1e-14)


@pytest.mark.parametrize("size", [0.3, 1e-9])
def test_poses_are_moved_as_by_numpy(size: float) -> None:
    changes = size * np.random.default_rng(2).normal(size=(len(ANGLES), 6))
    found = moved_by(poses(0), changes)
    np.testing.assert_allclose(found, pose_add(poses(0), changes), rtol=0, atol=1e-14)
    np.testing.assert_allclose(changes_between(found, poses(0)), changes, rtol=0, atol=2e-15)


def test_rotation_vectors_are_as_by_numpy() -> None:
    turn = np.concatenate([poses(0)[:, 3:], -poses(1)[:, 3:]])
    np.testing.assert_allclose(
        rotation_vectors(turn), rotvec_from_quat(turn), rtol=1e-14, atol=1e-30
    )


@pytest.mark.parametrize(("fast", "plain", "a", "b"), PAIRS)
def test_one_row_is_for_all(
    fast: Callable[..., Array], plain: Callable[..., Array], a: int, b: int
) -> None:
    one, other = poses(0)[:, a:], poses(1)[:, b : 3 if fast is rotated else 7]
    for left, right in ((one[5:6], other), (one, other[5:6])):
        np.testing.assert_allclose(fast(left, right), plain(left, right), rtol=0, atol=1e-14)


def test_one_row_is_moved_by_all_changes_and_all_by_one() -> None:
    changes = 0.3 * np.random.default_rng(2).normal(size=(len(ANGLES), 6))
    for some, by in ((poses(0)[5:6], changes), (poses(0), changes[5:6])):
        np.testing.assert_allclose(moved_by(some, by), pose_add(some, by), rtol=0, atol=1e-14)


def test_shapes_are_kept() -> None:
    turn, places = poses(0)[5, 3:], poses(1)[:, :3]
    np.testing.assert_allclose(rotated(turn, places), quat_rotate(turn, places), atol=1e-14)
    pose = poses(0)[4]
    assert moved_by(pose, np.zeros(6)).shape == (7,)
    assert moved_by(pose[None], np.zeros(6)).shape == (1, 7)
    assert changes_between(np.ones((2, 3, 7)), np.ones((2, 3, 7))).shape == (2, 3, 6)
    assert rotation_vectors(turn).shape == (3,)


def test_from_a_pose_to_itself_nothing_changes() -> None:
    assert np.all(changes_between(poses(0), poses(0)) == 0.0)


def test_no_rows_are_no_rows() -> None:
    assert changes_between(np.empty((0, 7)), poses(0)[0]).shape == (0, 6)
    assert products(poses(0)[:1, 3:], np.empty((0, 4))).shape == (0, 4)


def test_other_numbers_of_rows_are_no_pairs() -> None:
    with pytest.raises(ValueError, match="expected as many rows as 11, or one, got 2"):
        changes_between(poses(0), poses(0)[:2])


def test_what_is_not_known_stays_so_and_nothing_given_is_changed() -> None:
    given = poses(0)
    given[3, 5] = np.nan
    given.flags.writeable = False
    found = changes_between(given, poses(1))
    assert np.isnan(found[3, 3:]).all() and np.isfinite(np.delete(found, 3, axis=0)).all()
