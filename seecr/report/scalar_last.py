"""A note where quaternions seem to be written with their scalar last."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from seecr.counted import figures
from seecr.description.joints import off_joints
from seecr.description.robot import Robot
from seecr.pose import quat_conjugate, quat_multiply, rotvec_from_quat

__all__ = ["scalar_last"]

# Quaternions turn by so much [deg] as they are, and by less than this with the scalar last, if they
# were meant so; an axis with such a component is that of the base frame.
_TURNED, _UNTURNED, _ALONG = 90.0, 45.0, 1.0 - 1e-6


def scalar_last(robot: Robot, turns: ArrayLike) -> tuple[str, ...]:
    """That quaternions (n, 4) seem to have their scalar last, where all of them do.

    As they are they turn the platform by more than a right angle from its reference pose, and would
    by less than half of one.
    """
    given, home = np.reshape(turns, (-1, 4)), quat_conjugate(robot.reference_pose[3:])
    here, there = (
        np.degrees(rotvec_from_quat(quat_multiply(quat, np.tile(home, (len(quat), 1)))))
        for quat in (given, np.roll(given, 1, axis=1))
    )
    sizes, others = (np.linalg.norm(turn, axis=1) for turn in (here, there))
    if not len(given) or not (sizes.min() > _TURNED and others.max() < _UNTURNED):
        return ()
    home_at = np.tile(robot.reference_pose[:3], (len(given), 1))
    meant = np.concatenate([home_at, np.roll(given, 1, axis=1)], axis=1)
    if off_joints(robot, meant) is not None:  # nor could the robot take what it would be
        return ()
    first, axis = " ".join(figures(q, ".4g") for q in given[0]), here[0] / sizes[0]
    along = np.flatnonzero(np.abs(axis) > _ALONG)
    about = f" about {'xyz'[along[0]]}" if len(along) else ""
    last = " ".join(figures(q, ".4g") for q in np.roll(given[0], 1))
    return (
        f"quaternions are scalar first: {first} turns the platform by {sizes[0]:.4g} deg{about} "
        f"from its reference pose; if the scalar is last there, write {last}",
    )
