"""A robot in MuJoCo commanded in poses, like SEECR's, with lengths that MuJoCo computes itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crosscheck.settle.settler import Settler, Settling, SettlingBatch, settle_batch
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply, quat_rotate

# Points checked between two poses that a free motion should join.
_STATIONS = 9
# A screw whose rotation [rad] is smaller is a translation to rounding, and its axis is undefined.
_STRAIGHT = 1e-7


class MujocoRobot:
    """A robot in MuJoCo that is commanded in poses, like SEECR's.

    Attributes:
        settler: the robot in MuJoCo.
        pretension: (m,) [m] rest lengths of the MJCF minus the straight lengths at its reference.
    """

    def __init__(
        self, model: str | Path, ea: float | Array | None = None, passive: Sequence[str] = ()
    ) -> None:
        """Compile the robot.

        Args:
            model: MJCF file.
            ea: k_c = E S [N], one number for all driven cables or (m,); None takes the MJCF's.
            passive: names of lines that no winch drives, besides those that the file names.
        """
        self.settler = Settler(model, ea=ea, passive=passive)
        physics = self.settler.physics
        self._at_home = physics.rest_lengths.copy()
        # The compiled model stands at its reference pose, its springs still as in the file.
        self.pretension = physics.rest_lengths - physics.data.ten_length

    @property
    def ignored(self) -> tuple[str, ...]:
        """Features of the MJCF that are switched off, such as "contacts"."""
        return self.settler.physics.ignored

    def rest_lengths(self, poses: Array) -> Array:
        """Lengths (n, m) [m] paid out for commanded poses (n, 7), from MuJoCo's kinematics.

        Those of passive lines are as in the MJCF.
        """
        physics = self.settler.physics
        lengths = np.empty((len(poses), physics.n_cables))
        for i, pose in enumerate(poses):
            physics.place(pose)
            lengths[i] = physics.data.ten_length
        return np.where(physics.driven, lengths + self.pretension, self._at_home)

    def settle(self, poses: Array, starts: Array | None = None) -> SettlingBatch:
        """Bring the platform to rest with the lengths of commanded poses (n, 7), each by itself.

        It is released at the commands, or at other poses (n, 7).
        """
        begins = poses if starts is None else starts
        return settle_batch(self.settler, begins, self.rest_lengths(poses))

    def settle_from(self, start: Array, command: Array) -> Settling:
        """The equilibrium with the lengths of one command (7,), started from another pose (7,)."""
        return self.settler.settle(start, self.rest_lengths(command[None])[0])

    def energy(self, pose: Array, command: Array) -> float:
        """Potential energy [J] at a pose (7,) with the lengths of a command (7,)."""
        return self.settler.energy(pose, self.rest_lengths(command[None])[0])

    def qpos(self, pose: Array) -> Array:
        """MuJoCo's coordinates (nq,) of a pose (7,)."""
        self.settler.physics.place(pose)
        return np.asarray(self.settler.physics.data.qpos.copy())

    def imbalance_between(self, pose_a: Array, pose_b: Array, command: Array) -> float:
        """Largest residual force, relative to the load, on the screw motion from pose a to pose b.

        Zero up to rounding means that the platform is free to move from one to the other.
        """
        physics = self.settler.physics
        physics.set_cables(self.rest_lengths(command[None])[0], self.settler.ea)
        physics.set_load()
        sizes = []
        for pose in screw_motion(pose_a, pose_b, _STATIONS):
            physics.place(pose)
            sizes.append(physics.relative(physics.residual()))
        return max(sizes)


def screw_motion(pose_a: Array, pose_b: Array, k: int) -> Array:
    """Poses (k, 7) from pose a to pose b along the one screw that joins them (Chasles).

    Unlike separate interpolation of position and orientation, it is a rotation about a fixed axis
    if such a rotation leads from a to b.
    """
    change = pose_difference(pose_b, pose_a)
    shift, turn = change[:3], change[3:]
    angle = float(np.linalg.norm(turn))
    part = np.linspace(0.0, 1.0, k)[:, None]
    quats = quat_from_rotvec(part * turn)
    along, arm = shift, np.zeros(3)
    if angle > _STRAIGHT:
        axis = turn / angle
        along = (shift @ axis) * axis
        across = shift - along
        # From the axis to the platform: half the chord back, and sideways by the cotangent.
        arm = -0.5 * (across + np.cross(axis, across) / np.tan(0.5 * angle))
    positions = pose_a[:3] + part * along + quat_rotate(quats, arm) - arm
    turned = quat_multiply(quats, pose_a[3:])
    return np.concatenate([positions, turned], axis=1)
