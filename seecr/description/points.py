"""A robot's description from its points: what is not given is computed, deduced, or plausible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seecr.arguments import finite, numbers
from seecr.errors import InputError
from seecr.pose import NORM_TOLERANCE, Array, quat_to_matrix, transform_points

PLANES = {"yz": 0, "xz": 1, "xy": 2}
"""The planes of planar robots, and the axis that each leaves out."""

# Points are in one plane to this part of their extent: more than rounding.
_ALIKE = 1e-9
# A frame lower than this part of its width has all its exit points at one height.
_FLAT = 0.1


@dataclass(frozen=True, eq=False)
class Joint:
    """A slide or hinge joint of a platform that is not free.

    Attributes:
        kind: ``"slide"`` or ``"hinge"``.
        name: as in the MJCF.
        axis: (3,) unit vector in the base frame at the reference pose.
        point: (3,) [m] a point on the axis, base frame at the reference pose.
        ball: whether it is one of three hinges in a row, about axes at right angles through one
            point, that stand for a ball joint. Rests, tensions, stiffness and frequencies are those
            of the motion, whatever its coordinates.
    """

    kind: str
    name: str
    axis: Array
    point: Array
    ball: bool = False


def pose_from(at: ArrayLike) -> Array:
    """The pose (7,) of a pose (7,) or of a position (3,), which is not turned.

    Raises:
        InputError: something else, or a quaternion that is none.
    """
    pose = finite(at, "at")
    if pose.shape == (3,):
        pose = np.concatenate([pose, [1.0, 0.0, 0.0, 0.0]])
    norm = float(np.linalg.norm(pose[3:]))
    if pose.shape != (7,) or abs(norm - 1.0) > NORM_TOLERANCE:
        raise InputError(
            "at: expected a position (3,) [m], or a pose (7,) with a unit quaternion, scalar "
            f"first, got {np.asarray(at).tolist()}"
        )
    return np.concatenate([pose[:3], pose[3:] / norm])


def home_of(exit_points: Array, anchor_points: Array, plane: str | None) -> Array:
    """A reference pose (7,) where none is given: level, in the middle of the frame.

    Its height is half way between the highest exit point and the ground, which is z = 0 or the
    lowest exit point, whichever is lower. If all exit points are at the height of the ground, it is
    below them by half their largest distance. A planar platform is in the plane of its cables.
    """
    low, high = exit_points.min(axis=0), exit_points.max(axis=0)
    middle, wide = 0.5 * (low + high), float(np.linalg.norm(high - low))
    ground = min(float(low[2]), 0.0)
    hung = high[2] - ground <= _FLAT * wide
    middle[2] = high[2] - 0.5 * wide if hung else 0.5 * (ground + high[2])
    if plane in PLANES:
        across = PLANES[plane]
        middle[across] = np.mean(exit_points[:, across] - anchor_points[:, across])
    return pose_from(middle)


def plane_of(exit_points: Array, anchor_points: Array, pose: Array | None = None) -> str | None:
    """The coordinate plane that all points are in, at a pose; None if there is none.

    Without a pose: that to which exit points and anchor points are parallel.
    """
    ends = [exit_points, anchor_points]
    if pose is not None:
        ends = [np.concatenate([exit_points, transform_points(pose, anchor_points)])]
    wide = np.max([np.ptp(points, axis=0) for points in ends], axis=0)
    flat = [plane for plane, axis in PLANES.items() if wide[axis] <= _ALIKE * wide.max()]
    return flat[0] if len(flat) == 1 else None


def joints_in(plane: str | None, point: bool, pose: Array) -> tuple[Joint, ...]:
    """Joints of a platform: slides in its plane, and a hinge across it unless it is a point.

    Of a free platform there are none; of a point in space three slides.
    """
    if plane is None and not point:
        return ()
    kinds = [("slide", letter, "xyz".index(letter)) for letter in plane or "xyz"]
    if plane is not None and not point:
        kinds.append(("hinge", "turn", PLANES[plane]))
    return tuple(Joint(kind, name, np.eye(3)[axis], pose[:3].copy()) for kind, name, axis in kinds)


def physical_inertia(inertia: Array, joints: Sequence[Joint], pose: Array) -> Array | None:
    """The inertia (3, 3), or what a planar platform feels of it; None if no body has it.

    No body has one that is not positive, or with one principal moment larger than the sum of the
    others. A planar platform feels only the moment about its hinge, and files often have that
    alone: it gets the same moment about all axes.
    """
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] > 0.0 and moments[0] + moments[1] >= moments[2] * (1.0 - _ALIKE):
        return inertia
    hinges = [joint.axis for joint in joints if joint.kind == "hinge"]
    axis = quat_to_matrix(pose[3:]).T @ hinges[0] if len(hinges) == 1 else np.zeros(3)
    about = float(axis @ inertia @ axis)
    return about * np.eye(3) if about > 0.0 else None


def robot_numbers(
    exit_points: ArrayLike, anchor_points: ArrayLike, mass: float, ea: ArrayLike,
    stiffness: ArrayLike, at: ArrayLike | None, plane: str | None,
    centre_of_mass: ArrayLike, inertia: ArrayLike | None,
    joints: tuple[Joint, ...] | None = None,
) -> tuple[dict[str, Any], bool]:  # fmt: skip
    """The numbers of a robot, with its joints. See :meth:`Robot.from_points`.

    Args:
        ea, stiffness: for each cable one of them is a number, the other NaN.
        joints: of the platform, whatever the plane; None to deduce them.

    Returns:
        the numbers, and whether the inertia was that of no body and is replaced.

    Raises:
        InputError: shapes or numbers that are no robot's.
    """
    exits = finite(exit_points, "exit_points")
    if exits.ndim != 2 or exits.shape[1] != 3 or len(exits) == 0:
        raise InputError(f"exit_points: expected shape (m, 3), one row a cable, got {exits.shape}")
    m = len(exits)
    anchors = _in_shape(finite(anchor_points, "anchor_points"), "anchor_points", (m, 3))
    if plane not in (None, "auto", *PLANES):
        raise InputError(
            f"plane: expected {', '.join(PLANES)}, auto (if all points are in one of these) or "
            f"None for a free platform, got {plane!r}"
        )
    pose = home_of(exits, anchors, plane) if at is None else pose_from(at)
    if joints is None:
        flat = plane_of(exits, anchors, pose) if plane == "auto" else plane
        joints = joints_in(flat, bool(np.all(anchors == anchors[0])), pose)
    lengths = np.linalg.norm(exits - transform_points(pose, anchors), axis=1)
    by_ea, by_k = (
        _in_shape(numbers(values, name), name, (m,))
        for values, name in ((ea, "ea"), (stiffness, "stiffness"))
    )
    centre = _in_shape(finite(centre_of_mass, "centre_of_mass"), "centre_of_mass", (3,))
    weighs = float(_in_shape(finite(mass, "mass"), "mass", ()))
    # a box around the anchor points, at least as thick as a hundredth of a cable's length
    sides = np.maximum(np.ptp(anchors, axis=0), 0.01 * lengths.max())
    solid = weighs / 12.0 * np.diag((sides**2).sum() - sides**2)
    own = None
    if inertia is not None:
        own = _in_shape(finite(inertia, "inertia"), "inertia", (3, 3))
        own = physical_inertia(own, joints, pose)
    return {
        "exit_points": exits, "anchor_points": anchors, "rest_lengths": lengths, "mass": weighs,
        "ea": np.where(np.isnan(by_ea), by_k * lengths, by_ea), "reference_pose": pose,
        "centre_of_mass": centre, "joints": joints, "inertia": solid if own is None else own,
    }, inertia is not None and own is None  # fmt: skip


def _in_shape(array: Array, name: str, shape: tuple[int, ...]) -> Array:
    """Numbers in a shape; one may stand for all."""
    try:
        return np.array(np.broadcast_to(array, shape))
    except ValueError:
        raise InputError(f"{name}: expected shape {shape}, got {array.shape}") from None
