"""Frames of a tracker and of its body: transforms that were made are found again."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.errors import CrosscheckError
from crosscheck.importing.align import Frames, place_of_target, to_commands
from seecr.pose import Array, quat_conjugate, quat_multiply, quat_rotate

# The tracker in the base frame, and the body on the platform.
TURN = Rotation.from_rotvec([0.2, -1.1, 0.7]).as_quat(scalar_first=True)
SHIFT = np.array([1.5, -0.3, 0.8])
TARGET = np.array([0.05, 0.02, -0.07])
NONE = np.array([1.0, 0, 0, 0])


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
    # also of a body that is mounted turned
    inside = Rotation.from_rotvec([0.5, 0.1, -0.2]).as_quat(scalar_first=True)
    mounted = quat_multiply(quat, np.tile(inside, (len(quat), 1)))
    _place, turned = to_commands(position, mounted, poses, None).poses(position, mounted)
    assert turned == pytest.approx(poses[:, 3:] * np.sign(poses[:, 3:4]), abs=1e-6)


def test_a_body_that_is_stated_stays_where_it_is() -> None:
    poses = told()
    found = to_commands(*tracked(poses), poses, TARGET)
    assert found.target_shift is TARGET and found.free == ("tracker_frame",)
    assert found.shift == pytest.approx(SHIFT)


def test_for_a_known_frame_one_wrong_dwell_does_not_move_the_body() -> None:
    poses = told()
    position, _quat = tracked(poses)
    position[4] += 5.0
    found = place_of_target(Frames(TURN, SHIFT, NONE, np.zeros(3), "", ()), position, poses)
    assert found.target_shift == pytest.approx(TARGET)


@pytest.mark.parametrize(("times", "said"), [(1e3, "1000 times as far"), (1e-3, "0.001 of that")])
def test_readings_in_another_unit_are_asked_about(times: float, said: str) -> None:
    poses = told()
    position, quat = tracked(poses, 0.0 * TARGET)
    with pytest.raises(CrosscheckError, match=f"spread by {said}: are they in the unit that"):
        to_commands(times * position, quat, poses, None)
    with pytest.raises(CrosscheckError, match=r"\(--clock\)\?$"):
        to_commands(position[::-1], quat, poses, None)
