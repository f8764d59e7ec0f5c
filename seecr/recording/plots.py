"""Plots and lanes: how numbers and states are logged and styled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from seecr.pose import Array, pose_difference
from seecr.recording.colours import Rgba
from seecr.recording.stream import Index, Recording

MM, DEG = 1e3, 180.0 / np.pi
TRANSLATIONS, TURNS = ("dx", "dy", "dz"), ("about x", "about y", "about z")
# Logarithms of zero are drawn here.
_NOTHING = 1e-18

_Marker = rr.components.MarkerShape
TAUT, SLACK, DIFFER, NONE = "taut", "slack", "differs", "no answer"
# Factor on a cable's own colour: white words on it are readable, bright dots stand out.
_DIM = 0.55
_GREY: Rgba = (70, 72, 76, 255)
_BLACK: Rgba = (20, 20, 20, 255)
_RED: Rgba = (215, 45, 45, 255)


def as_line(recording: Recording, entity: str, name: str, colour: Rgba, width: float) -> None:
    """Draw a series as a line."""
    style = rr.SeriesLines(names=name, colors=[colour], widths=[width])
    recording.always(entity, style)


def line_by_runs(
    recording: Recording, entity: str, index: Index, values: Array, starts: NDArray[np.bool_],
    name: str, colour: Rgba, width: float,
) -> None:  # fmt: skip
    """Draw numbers (n,) as a line that is interrupted between runs.

    Every other run is on a second line of the same name: the viewer interrupts lines at gaps, and
    its legend shows the common name once.
    Args:
        recording: where. entity: what. index: the timelines. values: (n,).
        starts: (n,) bool, first rows of runs. name, colour, width: of the line.
    """
    second = np.cumsum(starts) % 2 == 0
    both = np.stack([np.where(second, np.nan, values), np.where(second, values, np.nan)], axis=1)
    recording.scalars(entity, index, both)
    style = rr.SeriesLines(names=[name] * 2, colors=[colour] * 2, widths=[width] * 2)
    recording.always(entity, style)


def as_dots(recording: Recording, entity: str, name: str, colour: Rgba, size: float) -> None:
    """Draw a series as dots, so that a line under it remains visible."""
    style = rr.SeriesPoints(
        names=name, colors=[colour], markers=[_Marker.Circle], marker_sizes=[size]
    )
    recording.always(entity, style)


def as_crosses(recording: Recording, entity: str, name: str, colour: Rgba, size: float) -> None:
    """Draw a series as faint crosses, whose arms show above or below a dot."""
    style = rr.SeriesPoints(
        names=name, colors=[_dim(colour)], markers=[_Marker.Plus], marker_sizes=[size]
    )
    recording.always(entity, style)


def deviation(poses: Array, command: Array) -> dict[str, Array]:
    """Deviation from the command in millimetres and degrees, by name.

    Args:
        poses: (k, 7).
        command: (k, 7) or (7,).
    """
    change = pose_difference(poses, np.broadcast_to(command, poses.shape))
    parts = {name: change[:, i] * MM for i, name in enumerate(TRANSLATIONS)}
    parts |= {name: change[:, 3 + i] * DEG for i, name in enumerate(TURNS)}
    return parts | {"tilt": np.linalg.norm(change[:, 3:], axis=1) * DEG}


def log10(values: Array) -> Array:
    """Decimal logarithms, with zero at a lower end instead of at minus infinity."""
    return np.log10(np.maximum(np.abs(values), _NOTHING))


def lane_states(
    slack: NDArray[np.bool_], differs: NDArray[np.bool_], known: NDArray[np.bool_]
) -> NDArray[np.object_]:
    """Words (k, m) for each cable: taut, slack, differs between the two physics, no answer.

    Args:
        slack: (k, m).
        differs: (k, m) where the two physics disagree.
        known: (k,) whether there is an answer.
    """
    words = np.where(slack, SLACK, TAUT).astype(object)
    words[differs] = DIFFER
    words[~known] = NONE
    return words


def lane(recording: Recording, entity: str, index: Index, words: Sequence[str]) -> None:
    """One lane over a timeline, (k,) words."""
    recording.rows(entity, index, rr.StateChange.columns(state=list(words)))


def lane_style(recording: Recording, entity: str, colour: Rgba) -> None:
    """Taut in the cable's colour, slack in grey; warnings stand out."""
    shades = {TAUT: _dim(colour), SLACK: _GREY, DIFFER: _RED, NONE: _BLACK}
    state_colours(recording, entity, shades)


def state_colours(recording: Recording, entity: str, shades: dict[str, Rgba]) -> None:
    """The colours of a lane's words."""
    style = rr.StateConfiguration(
        values=list(shades), labels=list(shades), colors=list(shades.values())
    )
    recording.always(entity, style)


def _dim(colour: Rgba) -> Rgba:
    red, green, blue = (int(_DIM * c) for c in colour[:3])
    return red, green, blue, 255
