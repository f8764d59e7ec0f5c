"""The 3D view and the legend of its colours below it.

It shows frame, platforms and cables, at every pose and at every instant of a settling.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from seecr.description.robot import Robot
from seecr.pose import Array, transform_points
from seecr.show import colours, shapes
from seecr.show.colours import Rgba
from seecr.show.shapes import States
from seecr.show.stream import Index, Recording

ROOT, LEGEND = "scene", "legend"
# Radii of lines, relative to the robot's size.
_FRAME, _TAUT, _LOOSE, _EDGE, _PATH = 0.0045, 0.0022, 0.0011, 0.0018, 0.0008
_SLICES = 48
# The strip is 100 wide and 10 high; y points down.
_BAR = (4.0, 44.0, 5.2)
_PLACES = (56.0, 68.0, 79.0, 92.0)
PHYSICS: Mapping[str, Rgba] = {
    "command": colours.COMMAND, "SEECR": colours.SEECR, "MuJoCo": colours.MUJOCO,
}  # fmt: skip


class Scene:
    """Draws one robot into a recording.

    Attributes:
        size: of the visible box [m]; all widths are relative to it.
        top: tension [N] at the end of the colour scale.
    """

    def __init__(self, recording: Recording, robot: Robot, poses: Array, top: float) -> None:
        self.recording, self.robot, self.top = recording, robot, top
        self.low, self.high = shapes.extent(robot, poses)
        self.size = float(np.linalg.norm(self.high - self.low))
        self.box = shapes.platform_box(robot, self.size)

    def surroundings(self) -> None:
        """Draw what does not move: axes, frame, and exit points with the names of cables."""
        robot, record = self.robot, self.recording
        record.always(ROOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        record.always(
            f"{ROOT}/frame",
            rr.LineStrips3D(
                shapes.frame_edges(self.low, self.high),
                radii=_FRAME * self.size,
                colors=colours.FRAME,
            ),
        )
        record.always(
            f"{ROOT}/exit_points",
            rr.Points3D(
                robot.exit_points,
                radii=1.5 * _FRAME * self.size,
                colors=colours.SILVER,
            ),
        )
        places, names = shapes.cable_labels(robot, self.low, self.high)
        words = rr.Points3D(
            places, radii=0.0, colors=colours.SILVER, labels=names, show_labels=True
        )
        record.always(f"{ROOT}/cable_names", words)

    def axes(self) -> None:
        """Numbers in metres at the ends of the frame's three edges from its lowest corner."""
        ends = np.where(np.eye(3, dtype=bool), self.high, self.low)
        words = [
            f"{axis} {end[k]:.3g} m" for k, (axis, end) in enumerate(zip("xyz", ends, strict=True))
        ]
        corner = ", ".join(f"{value:.3g}" for value in self.low)
        numbers = rr.Points3D(
            [self.low, *ends], radii=0.0, colors=colours.COMMAND, labels=[f"{corner} m", *words],
            show_labels=True,
        )  # fmt: skip
        self.recording.always(f"{ROOT}/axes", numbers)

    def path(self, name: str, poses: Array, colour: Rgba) -> None:
        """Draw the path of the platform's origin."""
        points = poses[np.isfinite(poses).all(axis=1), :3]
        line = rr.LineStrips3D([points], radii=_PATH * self.size, colors=colour)
        self.recording.always(f"{ROOT}/{name}/path", line)

    def platform(
        self, name: str, index: Index, poses: Array, colour: Rgba, *, solid: bool = False
    ) -> None:
        """Draw the platform as a box: solid, or only its edges so that others show through."""
        seen = np.isfinite(poses).all(axis=1)
        k, box = int(seen.sum()), self.box
        fill = rr.components.FillMode.Solid if solid else rr.components.FillMode.MajorWireframe
        columns = rr.Boxes3D.columns(
            half_sizes=np.tile(box.half_size, (k, 1)),
            centers=box.centres(poses[seen]),
            quaternions=np.roll(poses[seen, 3:], -1, axis=1),  # Rerun's are scalar last
        ).partition(seen.astype(int))
        entity = f"{ROOT}/{name}/platform"
        self.recording.rows(entity, index, columns)
        style = rr.Boxes3D.from_fields(colors=[colour], radii=[_EDGE * self.size], fill_mode=fill)
        self.recording.always(entity, style)

    def anchors(self, name: str, index: Index, poses: Array, colour: Rgba) -> None:
        """Draw anchor points as dots, which also shows a platform that is a bar or a point."""
        seen = np.isfinite(poses).all(axis=1)
        points = transform_points(poses[seen], self.robot.anchor_points).reshape(-1, 3)
        columns = rr.Points3D.columns(positions=points)
        entity = f"{ROOT}/{name}/anchor_points"
        self.recording.rows(entity, index, columns.partition(seen * self.robot.n_cables))
        style = rr.Points3D.from_fields(radii=[1.6 * _TAUT * self.size], colors=[colour])
        self.recording.always(entity, style)

    def cables(self, name: str, index: Index, states: States) -> None:
        """Draw taut cables as thick lines coloured by tension, slack ones dashed and grey."""
        known = states.known
        poses = np.where(known[:, None], states.pose, self.robot.reference_pose)
        self._taut(f"{ROOT}/{name}/cables/taut", index, states, poses)
        slack = states.slack & known[:, None]
        strips = shapes.slack_strips(self.robot, poses, slack, states.rest_lengths)
        entity = f"{ROOT}/{name}/cables/slack"
        columns = rr.LineStrips3D.columns(strips=strips)
        counts = slack.sum(axis=1) * shapes.dashes_per_cable()
        self.recording.rows(entity, index, columns.partition(counts))
        style = rr.LineStrips3D.from_fields(radii=[_LOOSE * self.size], colors=[colours.SLACK])
        self.recording.always(entity, style)

    def _taut(self, entity: str, index: Index, states: States, poses: Array) -> None:
        pulls = ~states.slack & states.known[:, None]
        columns = rr.LineStrips3D.columns(
            strips=shapes.taut_strips(self.robot, poses, ~pulls),
            colors=colours.scale_colours(states.tensions[pulls], self.top),
        )
        self.recording.rows(entity, index, columns.partition(pulls.sum(axis=1)))
        self.recording.always(entity, rr.LineStrips3D.from_fields(radii=[_TAUT * self.size]))


def write_legend(recording: Recording, top: float, who: Mapping[str, Rgba] = PHYSICS) -> None:
    """The tension scale from 0 to ``top`` [N], and the colours of slack cables and platforms."""
    write_scale(recording, top)
    places = [(px, _BAR[2]) for px in _PLACES[: 1 + len(who)]]
    names, shades_of = ["slack", *who], [colours.SLACK, *who.values()]
    for (x, y), name, colour in zip(places, names, shades_of, strict=True):
        strips = [np.array([[x - 2.5 + d, y], [x - 1.5 + d, y]]) for d in (0, 2, 4)]
        dashed = strips if name == "slack" else [np.array([strips[0][0], strips[-1][1]])]
        radius = 0.25 if name == "slack" else 0.7
        line = rr.LineStrips2D(dashed, radii=radius, colors=colour)
        recording.always(f"{LEGEND}/{name}", line)
    below = [(px, y + 2.6) for px, y in places]
    recording.labels(f"{LEGEND}/names", below, names, shades_of)


def write_scale(
    recording: Recording, top: float, words: str = "", unit: str = "N", entity: str = LEGEND
) -> None:
    """The colour scale from 0 to ``top``, and words on what it means.

    Args:
        recording: where.
        top: end of the scale, in the unit; without a unit it counts, in whole numbers.
        words: on its meaning.
        unit: of its numbers, "" for counts.
        entity: the legend's.
    """
    left, right, y = _BAR
    steps = _SLICES if unit else round(top) + 1
    x = np.linspace(left, right, steps + 1)
    pieces = [np.array([[x[i], y], [x[i + 1], y]]) for i in range(steps)]
    shades = colours.scale_colours(np.arange(steps, dtype=float), max(steps - 1.0, 1.0))
    recording.always(f"{entity}/scale", rr.LineStrips2D(pieces, radii=0.9, colors=shades))
    parts = np.linspace(0.0, 1.0, 3) if unit else (np.arange(steps) + 0.5) / steps
    ticks = [f"{part * top:.4g} {unit}" for part in parts] if unit else map(str, range(steps))
    below = [(left + part * (right - left), y + 2.6) for part in parts]
    recording.labels(f"{entity}/ticks", below, list(ticks))
    if words:
        recording.labels(f"{entity}/of", [(_PLACES[1], y - 2.2)], [words])
