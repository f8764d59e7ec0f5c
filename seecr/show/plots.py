"""Plots and lanes: how numbers and states are logged, and where legends cover no curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from seecr.pose import Array, pose_difference
from seecr.show import colours
from seecr.show.colours import Rgba, alike, joined
from seecr.show.stream import Index, Recording, entity_of

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
    """Draw numbers (n,) as a line that is interrupted where runs start, (n,) bool.

    Every other run is on a second line of the same name: the viewer interrupts lines at gaps, and
    its legend shows the common name once.
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
    """Deviation of poses (k, 7) from commands (k, 7) or (7,) [mm, deg], by name."""
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
    """Words (k, m) for each cable: taut, slack, differs between the two physics, no answer (k,)."""
    words = np.where(slack, SLACK, TAUT).astype(object)
    words[differs] = DIFFER
    words[~known] = NONE
    return words


def lane(recording: Recording, entity: str, index: Index, words: Sequence[str]) -> None:
    """One lane over a timeline, (k,) words."""
    recording.rows(entity, index, rr.StateChange.columns(state=list(words)))


def state_colours(recording: Recording, entity: str, shades: dict[str, Rgba]) -> None:
    """The colours of a lane's words."""
    style = rr.StateConfiguration(
        values=list(shades), labels=list(shades), colors=list(shades.values())
    )
    recording.always(entity, style)


def _dim(colour: Rgba) -> Rgba:
    red, green, blue = (int(_DIM * c) for c in colour[:3])
    return red, green, blue, 255


# Size of the viewer's legend, in points of a window of 1920 by 1080: height of a name and of the
# margins, width of a letter and of the rest beside a name.
_NAME, _AROUND, _LETTER, _ASIDE = 23.0, 8.0, 6.0, 42.0
# An axis is extended by no more than this factor for a legend: curves would become flat.
_LONGER = 2.0
# Part of the axis that the viewer leaves free at both ends.
_MARGIN = 0.04
_CORNERS = (
    rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop, rrb.Corner2D.RightBottom, rrb.Corner2D.LeftBottom,
)  # fmt: skip


@dataclass(frozen=True)
class Legend:
    """The place of a legend.

    Attributes:
        corner: of the plot. values: the range of the axis, None for the viewer's choice.
        fits: whether it covers nothing.
    """

    corner: rrb.Corner2D = rrb.Corner2D.RightTop
    values: tuple[float, float] | None = None
    fits: bool = True


def legend_of(curves: Sequence[Array], names: Sequence[str], size: tuple[float, float]) -> Legend:
    """The corner in which a legend covers no curve, with a longer axis if necessary.

    Curves (n, k) of each timeline are at times that are roughly evenly spaced; the plot's size is
    in points of a window of 1920 by 1080.
    """
    known = [values for values in curves if np.isfinite(values).any()]
    if not known or not names:
        return Legend()
    low = min(float(np.nanmin(values)) for values in known)
    high = max(float(np.nanmax(values)) for values in known)
    wide = min((_LETTER * max(map(len, names)) + _ASIDE) / size[0], 1.0)
    tall = min((_NAME * len(names) + _AROUND) / size[1], 0.95)
    span = max(high - low, 1e-12)
    best, taken = _CORNERS[0], np.inf
    for corner in _CORNERS:
        left = corner in (rrb.Corner2D.LeftTop, rrb.Corner2D.LeftBottom)
        top = corner in (rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop)
        reach = max(_reach(values, low, high, wide, left=left, top=top) for values in known)
        # the legend takes the part ``tall`` of an axis of this length
        longer = max(reach / (1.0 - tall), span) / span
        if longer < taken:
            best, taken = corner, longer
    if taken <= 1.0 + _MARGIN and len(known) == 1:
        return Legend(best)
    if taken > _LONGER:
        return Legend(best, fits=False)
    more, edge = (taken - 1.0) * span, _MARGIN * span
    if best in (rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop):
        return Legend(best, (low - edge, high + more + edge))
    return Legend(best, (low - more - edge, high + edge))


def plot(
    name: str, contents: Sequence[str], legend: Legend, *, listed: bool = True
) -> rrb.TimeSeriesView:
    """A plot with its legend inside, if it is ``listed``."""
    axis = None if legend.values is None else rrb.ScalarAxis(range=legend.values)
    return rrb.TimeSeriesView(
        name=name,
        contents=list(contents),
        plot_legend=rrb.PlotLegend(legend.corner, visible=listed),
        axis_y=axis,
    )


def _reach(values: Array, low: float, high: float, wide: float, *, left: bool, top: bool) -> float:
    """How far curves extend towards a corner, from the other end of the axis."""
    count = int(np.ceil(wide * (len(values) - 1))) + 1
    near = values[:count] if left else values[-count:]
    near = near[np.isfinite(near)]
    if len(near) == 0:
        return 0.0
    return float(near.max()) - low if top else high - float(near.min())


def merged_curves(
    curves: Sequence[Array], names: Sequence[str], size: tuple[float, float]
) -> tuple[dict[int, str], Legend]:
    """Curves that coincide are drawn once, if their legend has room; else each by itself.

    Returns:
        For each curve that is drawn the names that it stands for, and the legend.
    """
    said = {group[0]: joined([names[k] for k in group]) for group in alike(curves)}
    legend = legend_of(curves, list(said.values()), size)
    return (said if legend.fits else dict(enumerate(names))), legend


def cables_view(
    title: str, curves: Sequence[Array], names: Sequence[str], size: tuple[float, float],
    roots: Sequence[str],
) -> rrb.TimeSeriesView:  # fmt: skip
    """A curve for each cable, with a legend if there is room for one; lanes have the same colours.

    Args:
        title: of the plot. curves, names, size: see :func:`merged_curves`.
        roots: under which they are logged.
    """
    said, legend = merged_curves(curves, names, size)
    title += "" if legend.fits else ", cables in the colours of their lanes"
    contents = [f"{root}/{entity_of(names[k])}" for root in roots for k in said]
    return plot(title, contents, legend, listed=legend.fits)


def write_lanes(
    recording: Recording, root: str, index: Index, names: Sequence[str],
    states: NDArray[np.object_],
) -> None:  # fmt: skip
    """A lane for each cable with its states (k, m).

    Taut is in the cable's own colour, slack in grey; warnings stand out.
    """
    shades = colours.cable_colours(len(names))
    for name, column, colour in zip(names, states.T, shades, strict=True):
        entity = f"{root}/{entity_of(name)}"
        lane(recording, entity, index, list(column))
        words = {TAUT: _dim(colour), SLACK: _GREY, DIFFER: _RED, NONE: _BLACK}
        state_colours(recording, entity, words)
