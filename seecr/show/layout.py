"""The layout that a recording opens with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.show import scene
from seecr.show.stream import POSE

# Half the viewer's vertical field of view [rad], and the part of it to be filled.
_HALF_VIEW, _FILL = np.deg2rad(27.5), 0.88
_AIMING_ROUNDS = 8
# Width over height of the left column in a window of 1920 by 1080 points.
_COLUMN_ASPECT = 0.82
# One lane over the height of a column in a window of 1080 points.
_LANE_HEIGHT = 0.0405
# Poses per second when playing.
_FPS = 4.0
GROUND = (24, 27, 33)


def eye(
    robot: Robot, low: Array, high: Array, aspect: float, above: float | None = None
) -> rrb.EyeControls3D:
    """A camera towards the wide side of a box, from above and one side, as near as everything fits.

    The view is ``aspect`` times as wide as high; ``above`` is the height of the camera over its
    distance, low by default.
    """
    up, span = robot.up, high - low
    across, towards = scene.front(robot, low, high)
    flat = float(np.abs(towards) @ span) < 0.05 * float(np.linalg.norm(span))
    aside, low_above = (0.12, 0.1) if flat else (0.42, 0.34)
    gaze = towards + aside * across + (low_above if above is None else above) * up
    gaze = gaze / np.linalg.norm(gaze)
    target, distance = _aim(low, high, gaze, up, aspect)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + distance * gaze,
        look_target=target,
        eye_up=up,
        speed=float(np.linalg.norm(span)),
    )


def _aim(low: Array, high: Array, gaze: Array, up: Array, aspect: float) -> tuple[Array, float]:
    """Target (3,) and distance [m] from which a box, seen against ``gaze``, fills the view."""
    right = np.cross(up, gaze)
    right = right / np.linalg.norm(right)
    above = np.cross(gaze, right)
    corners = np.array([np.where(pick, high, low) for pick in np.ndindex(2, 2, 2)])
    half = _FILL * np.tan(_HALF_VIEW) * np.array([[aspect], [1.0]])
    target, distance = (low + high) / 2.0, 2.0 * float(np.linalg.norm(high - low))
    for _ in range(_AIMING_ROUNDS):
        flat = np.stack([right, above]) @ (corners - target).T
        depth = distance - gaze @ (corners - target).T
        seen = flat / depth
        # near corners look larger: the centre of the picture is not the centre of the box
        centre = (seen.max(axis=1) + seen.min(axis=1)) / 2.0 * distance
        target = target + centre @ np.stack([right, above])
        flat = np.stack([right, above]) @ (corners - target).T
        distance = float(np.max(gaze @ (corners - target).T + np.abs(flat) / half))
    return target, distance


def scene_view(
    robot: Robot, low: Array, high: Array, name: str, aspect: float,
    contents: Sequence[str] = ("$origin/**",), above: float | None = None,
) -> rrb.Spatial3DView:  # fmt: skip
    """The 3D view of one robot in a box (3,), (3,) [m], or of some entities; see :func:`eye`."""
    names, _words = scene.cable_labels(robot, low, high)
    return rrb.Spatial3DView(
        origin=scene.ROOT,
        contents=list(contents),
        name=name,
        background=rrb.Background(color=GROUND),
        eye_controls=eye(
            robot,
            np.minimum(low, names.min(axis=0)),
            np.maximum(high, names.max(axis=0)),
            aspect,
            above,
        ),
        line_grid=_floor(robot, low, high),
        spatial_information=rrb.SpatialInformation(
            target_frame=f"tf#/{scene.ROOT}", show_axes=False
        ),
    )


def _floor(robot: Robot, low: Array, high: Array) -> rrb.LineGrid3D:
    up = robot.up
    lowest = min(float(up @ low), float(up @ high))
    spacing = 10.0 ** np.floor(np.log10(0.5 * float(np.linalg.norm(high - low))))
    return rrb.LineGrid3D(
        visible=True,
        spacing=float(spacing),
        plane=rr.components.Plane3D(normal=up, distance=lowest),
        stroke_width=0.6,
        color=(58, 64, 74, 255),
    )


def text(name: str, entity: str) -> rrb.TextDocumentView:
    """A panel of text."""
    return rrb.TextDocumentView(name=name, origin=entity)


def legend(entity: str) -> rrb.Spatial2DView:
    """The strip with the meaning of the 3D view's colours."""
    return rrb.Spatial2DView(
        name="Colours",
        origin=entity,
        titlebar=False,
        background=rrb.Background(color=GROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, 100.0), y_range=(1.5, 11.5)),
    )


def scene_and_lanes(
    robot: Robot, poses: Array, name: str, root: str, count: int, wide: float = 1.0
) -> rrb.Vertical:
    """The 3D view, its legend, and the lanes of all cables: up to ten, then with a scroll bar.

    The column is ``wide`` times as wide as one of three.
    """
    low, high = scene.extent(robot, poses)
    share = min(_LANE_HEIGHT * (count + 1.2), 0.5)
    view = scene_view(robot, low, high, name, wide * _COLUMN_ASPECT / (0.87 - share))
    lanes = rrb.StateTimelineView(name="Which cables pull, which are slack", origin=root)
    return rrb.Vertical(view, legend(scene.LEGEND), lanes, row_shares=[0.9 - share, 0.1, share])


def blueprint(
    root: rrb.Container, *, playback_speed: float = 1.0, timeline: tuple[str, float] = (POSE, 1.0),
    poses_a_second: float = _FPS,
) -> rrb.Blueprint:  # fmt: skip
    """The layout of views, without other panels.

    It opens at a timeline, given with its step between two poses; the playback speed is that of
    timelines in seconds, relative to real time.
    """
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(
            state="collapsed",
            timeline=timeline[0],
            fps=poses_a_second * timeline[1] / playback_speed,
            playback_speed=playback_speed,
            play_state="paused",
            loop_mode="all",
        ),
        auto_layout=False,
        auto_views=False,
    )
