"""Frames of a tracker and of its body: transforms that were made are found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.errors import CrosscheckError
from crosscheck.importing.align import Frames, as_they_are, by_points, place_of_target, to_commands
from seecr.pose import Array, quat_conjugate, quat_multiply, quat_rotate

# The tracker in the base frame, and the body on the platform.
TURN = Rotation.from_rotvec([0.2, -1.1, 0.7]).as_quat(scalar_first=True)
SHIFT = np.array([1.5, -0.3, 0.8])
TARGET = np.array([0.05, 0.02, -0.07])
NONE = np.array([1.0, 0, 0, 0])
NAMES = ["a", "b", "c", "d"]


def told(n: int = 12) -> Array:
    """Commanded poses (n, 7) in all places and some orientations."""
    rng = np.random.default_rng(3)
    turns = Rotation.from_rotvec(0.3 * rng.standard_normal((n, 3))).as_quat(scalar_first=True)
    return np.concatenate([rng.uniform(-1, 1, (n, 3)), turns], axis=1)


def tracked(poses: Array, target: Array = TARGET) -> tuple[Array, Array]:
    """What the tracker reads of a body with the platform's axes."""
    back = quat_conjugate(TURN)
    body = poses[:, :3] + quat_rotate(poses[:, 3:], np.tile(target, (len(poses), 1)))
    return quat_rotate(back, body - SHIFT), quat_multiply(back, poses[:, 3:])


def test_frames_take_the_trackers_poses_to_the_platforms() -> None:
    poses = told()
    frames = Frames(TURN, SHIFT, NONE, TARGET, "", ())
    place, quat = frames.poses(*tracked(poses))
    assert place == pytest.approx(poses[:, :3])
    assert quat is not None and quat == pytest.approx(poses[:, 3:] * np.sign(poses[:, 3:4]))
    inside = Rotation.from_rotvec([0.5, 0.1, -0.2]).as_quat(scalar_first=True)
    mounted = replace(frames, target_turn=inside)
    turned = quat_multiply(tracked(poses)[1], np.tile(inside, (len(poses), 1)))
    same = mounted.poses(tracked(poses)[0], turned)[1]
    assert same == pytest.approx(quat)
    alone, none = frames.poses(tracked(poses)[0], None)
    assert none is None and alone == pytest.approx(tracked(poses)[0] @ _matrix().T + SHIFT)


def _matrix() -> Array:
    return np.asarray(Rotation.from_quat(TURN, scalar_first=True).as_matrix())


def test_points_that_are_known_in_both_frames_align_them() -> None:
    here = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    there = (here - SHIFT) @ _matrix()
    found = by_points(NAMES, there, here)
    assert found.shift == pytest.approx(SHIFT) and found.free == ("tracker_frame",)
    assert abs(found.turn @ TURN) == pytest.approx(1.0)
    with pytest.raises(
        CrosscheckError, match=r"point c is .* m from where the other points put it"
    ):
        by_points(NAMES, there + np.outer(np.arange(4) == 2, [0.0, 0.0, 2.0]), here)
    with pytest.raises(CrosscheckError, match="three or more that are not on one line"):
        by_points(NAMES[:3], there[[0, 1, 1]], here[[0, 1, 1]])


def test_turned_commands_show_the_frame_and_where_the_body_is() -> None:
    poses = told()
    position, quat = tracked(poses)
    found = to_commands(position, quat, poses, None)
    assert found.turn == pytest.approx(TURN * np.sign(found.turn @ TURN), abs=1e-6)
    assert found.shift == pytest.approx(SHIFT, abs=1e-6)
    assert found.target_shift == pytest.approx(TARGET, abs=1e-6)
    assert found.free == ("tracker_frame", "tracker_target")
    place, _turned = found.poses(position, quat)
    assert place == pytest.approx(poses[:, :3], abs=1e-6)


def test_a_body_that_is_stated_stays_where_it_is() -> None:
    poses = told()
    found = to_commands(*tracked(poses), poses, TARGET)
    assert found.target_shift is TARGET and found.free == ("tracker_frame",)
    assert found.shift == pytest.approx(SHIFT)


@pytest.mark.parametrize(("count", "said"), [(2, "by 2 dwells"), (12, "lie on one line")])
def test_commands_that_show_no_frame_are_refused(count: int, said: str) -> None:
    poses = told(count)
    poses[:, 1:3], poses[:, 3:] = 0.0, NONE
    with pytest.raises(CrosscheckError, match=said):
        to_commands(*tracked(poses), poses, None)


def test_for_a_known_frame_one_wrong_dwell_does_not_move_the_body() -> None:
    poses = told()
    position, _quat = tracked(poses)
    position[4] += 5.0
    found = place_of_target(Frames(TURN, SHIFT, NONE, np.zeros(3), "", ()), position, poses)
    assert found.target_shift == pytest.approx(TARGET)


def test_a_tracker_in_the_base_frame_leaves_positions_as_they_are() -> None:
    place, quat = as_they_are(None).poses(np.ones((1, 3)), NONE[None])
    assert place.tolist() == [[1, 1, 1]] and quat is not None and quat.tolist() == [[1, 0, 0, 0]]


@pytest.mark.parametrize(("times", "said"), [(1e3, "1000 times as far"), (1e-3, "0.001 of that")])
def test_readings_in_another_unit_are_asked_about(times: float, said: str) -> None:
    poses = told()
    position, quat = tracked(poses, 0.0 * TARGET)
    with pytest.raises(CrosscheckError, match=f"spread by {said}: are they in the unit that"):
        to_commands(times * position, quat, poses, None)
    with pytest.raises(CrosscheckError, match=r"\(--clock\)\?$"):
        to_commands(position[::-1], quat, poses, None)
