"""Axes and a colour scale around a map in a plane; y of the drawing points down."""

from __future__ import annotations

import numpy as np
import rerun as rr

from seecr.pose import Array
from seecr.recording import colours
from seecr.recording.stream import Recording

# Ticks of an axis; slices of the bar; radii of lines in points of the screen.
_TICKS, _SLICES, _LINE = 3, 32, 0.8
# Margin of the dots, and positions of axes and bar in it, relative to the larger side of the map.
_MARGIN, _ABOVE, _BELOW, _BAR = 0.08, 0.12, 0.24, 0.14
# Numbers are left of the map, the bar and its words right of it; text keeps its size in points.
_LEFT, _RIGHT = 0.3, 0.7
_TICK, _THICK, _WORDS = 0.02, 0.035, 0.27


def bounds(points: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ranges of a view along both axes, for a map of points (n, 2)."""
    low, high, size = _box(points)
    return (low[0] - _LEFT * size, high[0] + _RIGHT * size), (
        low[1] - _ABOVE * size,
        high[1] + _BELOW * size,
    )


def draw_axes(recording: Recording, entity: str, points: Array, words: str) -> None:
    """Two axes with round numbers in metres, for points (n, 2) whose second axis points down.

    Args:
        recording: where. entity: under which. points: what is in the map.
        words: at the end of the bar, such as "5 mm".
    """
    low, high, size = _box(points)
    corner = np.array([low[0], high[1]])
    tick = _TICK * size
    lines = [np.array([corner, [high[0], high[1]]]), np.array([corner, [low[0], low[1]]])]
    labels, places = [], []
    for value in _round(low[0], high[0]):
        lines.append(np.array([[value, high[1]], [value, high[1] + tick]]))
        labels.append(f"{value:g}")
        places.append((value, high[1] + tick))
    for value in _round(-high[1], -low[1]):
        lines.append(np.array([[low[0] - tick, -value], [low[0], -value]]))
        labels.append(f"{value:g}")
        # the viewer draws labels below their points
        places.append((low[0] - 5.0 * tick, -value - 2.2 * tick))
    strips = rr.LineStrips2D(lines, radii=-_LINE, colors=colours.FRAME)
    recording.always(f"{entity}/axes", strips)
    _bar(recording, f"{entity}/scale", low, high, size)
    x = high[0] + (_BAR + _WORDS) * size
    ends = [(x, low[1] - 2.2 * tick), (x, high[1] - 2.2 * tick)]
    recording.always(
        f"{entity}/numbers",
        rr.Points2D(
            [*places, *ends], radii=0.0, colors=colours.COMMAND,
            labels=[*labels, words, "0"], show_labels=True,
        ),
    )  # fmt: skip


def _bar(recording: Recording, entity: str, low: Array, high: Array, size: float) -> None:
    """The colour scale, with 0 at the bottom."""
    x, y = high[0] + _BAR * size, np.linspace(high[1], low[1], _SLICES + 1)
    pieces = [np.array([[x, y[i]], [x, y[i + 1]]]) for i in range(_SLICES)]
    shades = colours.scale_colours(np.linspace(0.0, 1.0, _SLICES), 1.0)
    radius = 0.5 * _THICK * size
    recording.always(entity, rr.LineStrips2D(pieces, radii=radius, colors=shades))


def _box(points: Array) -> tuple[Array, Array, float]:
    """Corners of the axes' frame, and the map's larger side, positive even for one point."""
    size = max(float(np.max(np.ptp(points, axis=0))), 1e-9)
    margin = _MARGIN * size
    return points.min(axis=0) - margin, points.max(axis=0) + margin, size


def _round(low: float, high: float) -> Array:
    """Round numbers within a range."""
    step = colours.round_up((high - low) / _TICKS)
    # the smallest integer above -0.3 is -0, which would be written so
    return step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) + 0.0
