"""A drawing of the robot at its reference pose, with the culprits marked."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.spatial import ConvexHull, QhullError

from crosscheck.diagnosis.result import MissingEffect
from crosscheck.show.figures import blank, image, styled
from seecr.description.robot import Robot
from seecr.pose import Array, transform_points
from seecr.show.colours import AFTER, BEFORE, GREY, INK, NOISE

# Size of the drawing [in]; it is as high as the robot needs, within these bounds.
_WIDTH, _LOWEST, _HIGHEST = 4.9, 1.7, 3.6
# From where a spatial robot is seen: turned about the vertical, then looked at from above [rad].
_TURN, _ABOVE = np.radians(-32.0), np.radians(22.0)
# A cable is marked if its value is at least this part of the largest one.
_LARGE = 0.5
_NUMBER = re.compile(r"_(\d+)(?:_|$)")
# What an effect is drawn at, by its name, or else by its place in the catalogue.
_AT = {
    "anchor_point_error": "anchors", "pulley_radius": "exits", "exit_point_error": "exits",
    "winch_side_length": "exits", "exit_friction": "exits", "initial_pose_error": "platform",
    "actuation": "exits", "geometry": "exits", "cable": "cables", "structure": "exits",
    "load": "platform", "sensing": "target",
}  # fmt: skip


def robot_figure(robot: Robot, missing: Sequence[MissingEffect]) -> str:
    """The robot as an element of the page; what is missing is drawn where it acts."""
    exits = robot.exit_points
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    flat = projection(robot, np.concatenate([exits, anchors]))
    a, b = exits @ flat.T, anchors @ flat.T
    wide, high = np.ptp(np.concatenate([a, b]), axis=0)
    with styled():
        figure = blank(float(np.clip(_WIDTH * high / wide, _LOWEST, _HIGHEST)), _WIDTH)
        figure.patch.set_alpha(0.0)
        axes = figure.subplots()
        origin = (robot.reference_pose[:3]) @ flat.T
        _draw(axes, robot, a, b)
        for finding in missing:
            _mark(axes, finding, a, b, origin)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.margins(0.12)
        where = "; marked: " + ", ".join(one.title for one in missing) if missing else ""
        return image(figure, f"The robot at its reference pose{where}")


def projection(robot: Robot, points: Array) -> Array:
    """Two directions (2, 3) of the paper in the base frame: to the right, and upwards.

    A flat robot is seen at right angles to its plane.
    """
    up = robot.up
    spread = points - points.mean(axis=0)
    _u, sizes, axes = np.linalg.svd(spread, full_matrices=False)
    if sizes[-1] <= 0.02 * sizes[0]:
        normal = axes[-1]
        if abs(normal @ up) < 0.9:
            right = np.cross(up, normal)
            right *= np.sign(right[int(np.argmax(np.abs(right)))])
            return np.stack([right / np.linalg.norm(right), up])
        return axes[:2]
    side = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = side - (side @ up) * up
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    right = np.cos(_TURN) * first + np.sin(_TURN) * second
    away = -np.sin(_TURN) * first + np.cos(_TURN) * second
    return np.stack([right, np.cos(_ABOVE) * up + np.sin(_ABOVE) * away])


def _draw(axes: Axes, robot: Robot, exits: Array, anchors: Array) -> None:
    for start, end in zip(exits, anchors, strict=True):
        axes.plot(*np.stack([start, end]).T, color=GREY, linewidth=0.9, zorder=1)
    try:
        corners = anchors[ConvexHull(anchors).vertices]
        axes.fill(*corners.T, facecolor=NOISE, edgecolor=INK, linewidth=1.0, zorder=2)
    except (QhullError, ValueError):  # a point, or a bar seen from its side
        axes.plot(*anchors.T, color=INK, linewidth=2.5, marker="o", markersize=4, zorder=2)
    axes.plot(*exits.T, linestyle="none", marker="s", markersize=4.5, color=INK, zorder=3)
    middle = exits.mean(axis=0)
    for name, place in zip(robot.cable_names, exits, strict=True):
        right = place[0] > middle[0]
        axes.annotate(
            name, place, xytext=(9 if right else -9, 0), textcoords="offset points",
            ha="left" if right else "right", va="center", fontsize=7, color=GREY,
        )  # fmt: skip


def _mark(axes: Axes, finding: MissingEffect, exits: Array, anchors: Array, origin: Array) -> None:
    effect = finding.layout.effect
    at = _AT.get(finding.effect, _AT.get(effect.place, "platform"))
    which = cables_of(finding, len(exits))
    ring: dict[str, Any] = {
        "linestyle": "none", "marker": "o", "markersize": 12, "markerfacecolor": "none",
        "markeredgewidth": 1.8, "markeredgecolor": BEFORE, "zorder": 4,
    }  # fmt: skip
    if at == "cables":
        for k in which:
            axes.plot(*np.stack([exits[k], anchors[k]]).T, color=BEFORE, linewidth=2.2, zorder=1.5)
    elif at == "platform":
        axes.plot(*origin, **{**ring, "markersize": 22})
    elif at == "target":
        axes.plot(*origin, **{**ring, "marker": "+", "markersize": 18, "markeredgecolor": AFTER})
    else:
        points = exits if at == "exits" else anchors
        axes.plot(*points[which].T, **ring)


def cables_of(finding: MissingEffect, cables: int) -> list[int]:
    """The cables, from 0, whose values are large; all if it has no values for each cable."""
    layout = finding.layout
    size = np.zeros(cables)
    for name, value in zip(layout.names, finding.term.sizes, strict=True):
        number = _NUMBER.search(name)
        if number is not None and 1 <= int(number[1]) <= cables:
            size[int(number[1]) - 1] = max(size[int(number[1]) - 1], abs(float(value)))
    if not size.any():
        return list(range(cables))
    return np.flatnonzero(size >= _LARGE * size.max()).tolist()
