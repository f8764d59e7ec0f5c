"""The 3D view, at every pose and at every instant of a settling, and the legend of its colours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.pose import Array, quat_rotate, transform_points
from seecr.show import colours
from seecr.show.colours import Rgba, joined
from seecr.show.stream import Index, Recording

# Slack cables are drawn as this many dashes of this many points.
DASHES, _DASH_POINTS = 12, 3
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

    The viewer draws labels below their points. Those in front of the visible box are raised above
    them, clear of those behind.
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


def slack_strips(
    robot: Robot, poses: Array, slack: NDArray[np.bool_], rest_lengths: Array
) -> list[Array]:
    """Dashes of the slack cables (n, m), pose by pose (n, 7); a fixed number per cable.

    A slack cable has no weight in the statics, and thus no shape of its own. It is drawn as the
    shallow parabola of its length l0 [m], whose sag s over a span d follows from l0 = d + 8 s^2 /
    (3 d).
    """
    anchors = transform_points(poses, robot.anchor_points)
    start = np.broadcast_to(robot.exit_points, anchors.shape)[slack]
    end = anchors[slack]
    span = np.linalg.norm(end - start, axis=-1)
    loose = np.maximum(rest_lengths[slack] - span, 0.0)
    sag = np.minimum(np.sqrt(3.0 * span * loose / 8.0), _DEEPEST * span)
    # fractions along a cable, 0 to 1, of the dashes' points, (dashes, points)
    begin = np.arange(DASHES) / (DASHES - 0.4)
    part = begin[:, None] + np.linspace(0.0, 0.6 / (DASHES - 0.4), _DASH_POINTS)
    part = part[None, :, :, None]
    chord = start[:, None, None] + part * (end - start)[:, None, None]
    drop = sag[:, None, None, None] * 4.0 * part * (1.0 - part) * -robot.up
    return list((chord + drop).reshape(-1, _DASH_POINTS, 3))


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
        self.low, self.high = extent(robot, poses)
        self.size = float(np.linalg.norm(self.high - self.low))
        corners = robot.anchor_points.min(axis=0), robot.anchor_points.max(axis=0)
        half = (corners[1] - corners[0]) / 2.0
        # a flat platform is given some thickness, a point some of the robot's size
        thinnest = max(_FLAT * float(half.max()), 0.006 * self.size)
        self.half_size, self.centre = np.maximum(half, thinnest), (corners[0] + corners[1]) / 2.0

    def surroundings(self) -> None:
        """Draw what does not move: axes, frame, and exit points with the names of cables."""
        robot, record = self.robot, self.recording
        record.always(ROOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        frame = rr.Boxes3D(
            mins=[self.low], sizes=[self.high - self.low], radii=_FRAME * self.size,
            colors=colours.FRAME, fill_mode=rr.components.FillMode.MajorWireframe,
        )  # fmt: skip
        record.always(f"{ROOT}/frame", frame)
        record.always(
            f"{ROOT}/exit_points",
            rr.Points3D(robot.exit_points, radii=1.5 * _FRAME * self.size, colors=colours.SILVER),
        )
        places, names = cable_labels(robot, self.low, self.high)
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
        k, poses = int(seen.sum()), poses[seen]
        fill = rr.components.FillMode.Solid if solid else rr.components.FillMode.MajorWireframe
        columns = rr.Boxes3D.columns(
            half_sizes=np.tile(self.half_size, (k, 1)),
            centers=poses[:, :3] + quat_rotate(poses[:, 3:], self.centre),
            quaternions=np.roll(poses[:, 3:], -1, axis=1),  # Rerun's are scalar last
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
        pulls = ~states.slack & known[:, None]
        anchors = transform_points(poses, self.robot.anchor_points)
        exits = np.broadcast_to(self.robot.exit_points, anchors.shape)
        taut = rr.LineStrips3D.columns(
            strips=list(np.stack([exits, anchors], axis=2)[pulls]),
            colors=colours.scale_colours(states.tensions[pulls], self.top),
        )
        entity = f"{ROOT}/{name}/cables/taut"
        self.recording.rows(entity, index, taut.partition(pulls.sum(axis=1)))
        self.recording.always(entity, rr.LineStrips3D.from_fields(radii=[_TAUT * self.size]))
        slack = states.slack & known[:, None]
        strips = slack_strips(self.robot, poses, slack, states.rest_lengths)
        entity = f"{ROOT}/{name}/cables/slack"
        columns = rr.LineStrips3D.columns(strips=strips)
        counts = slack.sum(axis=1) * DASHES
        self.recording.rows(entity, index, columns.partition(counts))
        style = rr.LineStrips3D.from_fields(radii=[_LOOSE * self.size], colors=[colours.SLACK])
        self.recording.always(entity, style)


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
    """The colour scale from 0 to ``top``, and words on what it means; without a unit it counts, in
    whole numbers.
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
