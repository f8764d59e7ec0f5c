"""A robot's states from one of the physics, and the positions of its parts in the 3D view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.curves import joined
from seecr.description.robot import Robot
from seecr.pose import Array, quat_rotate, transform_points

# Slack cables are drawn as this many dashes of this many points.
_DASHES, _DASH_POINTS = 12, 3
# A cable that is far too long is drawn with a sag of no more than this part of its span.
_DEEPEST = 0.35
# Thickness of a flat platform, relative to its largest side.
_FLAT = 0.12
# Exit points closer than this, relative to the robot's size, share a label; else labels overlap.
_NEAR = 0.1
# Points nearer than the centre by more than the first number, relative to the robot's size, are in
# front; their labels are raised by the second.
_BEFORE, _LIFT = 0.05, 0.08


@dataclass(frozen=True, eq=False)
class States:
    """Poses and cables at k commands, or at k instants.

    Attributes:
        pose: (k, 7); rows with NaN are not drawn.
        tensions: (k, m) [N].
        rest_lengths: (k, m) [m].
        slack: (k, m).
    """

    pose: Array
    tensions: Array
    rest_lengths: Array
    slack: NDArray[np.bool_]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Whether each row has an answer, (k,)."""
        return np.asarray(np.isfinite(self.pose).all(axis=1))


@dataclass(frozen=True, eq=False)
class Box:
    """The platform as a box around its anchor points, platform frame.

    Attributes:
        half_size: (3,) [m].
        centre: (3,) [m].
    """

    half_size: Array
    centre: Array

    def centres(self, poses: Array) -> Array:
        """Centres (n, 3) [m] in the base frame at poses (n, 7)."""
        return poses[:, :3] + quat_rotate(poses[:, 3:], self.centre)


def platform_box(robot: Robot, size: float) -> Box:
    """Box around the anchor points; a flat one is given some thickness.

    Args:
        robot: the robot.
        size: of the whole robot [m], for platforms with one anchor point.
    """
    low, high = robot.anchor_points.min(axis=0), robot.anchor_points.max(axis=0)
    half = (high - low) / 2.0
    thinnest = max(_FLAT * float(half.max()), 0.006 * size)
    return Box(np.maximum(half, thinnest), (low + high) / 2.0)


def extent(robot: Robot, poses: Array) -> tuple[Array, Array]:
    """Corners (3,), (3,) [m] of the visible box: exit points and the platform's poses."""
    seen = poses[np.isfinite(poses).all(axis=-1)]
    anchors = transform_points(seen, robot.anchor_points).reshape(-1, 3)
    points = np.concatenate([robot.exit_points, anchors, seen[:, :3]])
    return points.min(axis=0), points.max(axis=0)


def front(robot: Robot, low: Array, high: Array) -> tuple[Array, Array]:
    """Directions (3,) along the wide side of the visible box, and towards the viewer.

    Args:
        robot: for its vertical. low, high: (3,) corners of the visible box [m].
    """
    span = high - low
    across = np.eye(3)[int(np.argmax(span - np.abs(robot.up) * span))]
    towards = np.cross(across, robot.up)
    return across, towards / max(float(np.linalg.norm(towards)), 1e-9)


def cable_labels(robot: Robot, low: Array, high: Array) -> tuple[Array, list[str]]:
    """Positions (k, 3) [m] and texts of cables' labels, one for exit points close to each other.

    The viewer draws labels below their points. Those in front are raised above them, clear of those
    behind.

    Args:
        robot: the robot. low, high: (3,) corners of the visible box [m].
    """
    points, size = robot.exit_points, float(np.linalg.norm(high - low))
    groups: list[list[int]] = []
    for k, point in enumerate(points):
        apart = [float(np.linalg.norm(points[group[0]] - point)) for group in groups]
        near = int(np.argmin(apart)) if apart else 0
        if apart and apart[near] < _NEAR * size:
            groups[near].append(k)
        else:
            groups.append([k])
    places = np.stack([points[group].mean(axis=0) for group in groups])
    depth = (places - points.mean(axis=0)) @ front(robot, low, high)[1]
    places += np.where(depth > _BEFORE * size, _LIFT * size, 0.0)[:, None] * robot.up
    return places, [joined([robot.cable_names[k] for k in group]) for group in groups]


def frame_edges(low: Array, high: Array) -> list[Array]:
    """Edges of the box between two corners, as strips (2, 3) [m]; a flat one has four."""
    flat = (high - low) < 1e-3 * float(np.max(high - low))
    edges = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for corner in np.ndindex(2, 2):
            ends = np.array([low, low], dtype=float)
            ends[1, axis] = high[axis]
            for k, side in zip(others, corner, strict=True):
                ends[:, k] = high[k] if side else low[k]
            doubled = any(flat[k] and side for k, side in zip(others, corner, strict=True))
            if not flat[axis] and not doubled:
                edges.append(ends)
    return edges


def taut_strips(robot: Robot, poses: Array, slack: NDArray[np.bool_]) -> list[Array]:
    """Straight lines (2, 3) [m] of the cables that pull, pose by pose."""
    anchors = transform_points(poses, robot.anchor_points)
    exits = np.broadcast_to(robot.exit_points, anchors.shape)
    return list(np.stack([exits, anchors], axis=2)[~slack])


def slack_strips(
    robot: Robot, poses: Array, slack: NDArray[np.bool_], rest_lengths: Array
) -> list[Array]:
    """Dashes of the slack cables, pose by pose; a fixed number per cable.

    A slack cable has no weight in the statics, and thus no shape of its own. It is drawn as the
    shallow parabola of its length, whose sag s over a span d follows from l0 = d + 8 s^2 / (3 d).

    Args:
        robot: the robot.
        poses: (n, 7).
        slack: (n, m).
        rest_lengths: (n, m) [m].
    """
    anchors = transform_points(poses, robot.anchor_points)
    start = np.broadcast_to(robot.exit_points, anchors.shape)[slack]
    end = anchors[slack]
    span = np.linalg.norm(end - start, axis=-1)
    loose = np.maximum(rest_lengths[slack] - span, 0.0)
    sag = np.minimum(np.sqrt(3.0 * span * loose / 8.0), _DEEPEST * span)
    part = _dash_grid()[None, :, :, None]
    chord = start[:, None, None] + part * (end - start)[:, None, None]
    drop = sag[:, None, None, None] * 4.0 * part * (1.0 - part) * -robot.up
    return list((chord + drop).reshape(-1, _DASH_POINTS, 3))


def dashes_per_cable() -> int:
    """The number of strips that :func:`slack_strips` makes of one cable."""
    return _DASHES


def _dash_grid() -> Array:
    """Fractions along a cable, 0 to 1, of the dashes' points, (dashes, points)."""
    begin = np.arange(_DASHES) / (_DASHES - 0.4)
    return begin[:, None] + np.linspace(0.0, 0.6 / (_DASHES - 0.4), _DASH_POINTS)
