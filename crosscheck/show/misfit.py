"""Drawings of a model's errors: arrows in the 3D view, maps with axes, poses of the platform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from crosscheck.fit.problem import POSITION, Kind, Problem, kinds_read
from crosscheck.fit.state import State
from crosscheck.show.arrows import drawn, magnification, views_of
from crosscheck.show.blocks import Bold
from seecr.compiled.columns import REST
from seecr.pose import Array, quat_from_rxyz, rxyz_from_quat
from seecr.show import colours, layout, plots
from seecr.show.plots import Legend
from seecr.show.scene import States
from seecr.show.stream import Index, Recording

MEASURED: colours.Rgba = colours.MUJOCO
# Top of a colour scale: this percentile of the errors.
_LARGEST = 95.0
# Radii of arrows relative to the robot's size; of dots, rings and thin arrows in points of the
# screen at any zoom, which Rerun expects as negative numbers.
_ARROW, _DOT, _RING, _THIN = 0.0021, -5.0, -9.0, -0.8


@dataclass(frozen=True, eq=False)
class Misfit:
    """The measurements, and the scales with which all models are drawn.

    Attributes:
        problem: the data.
        first: the model whose errors set the scales, and whose predictions are the positions.
    """

    problem: Problem
    first: State

    @property
    def kinds(self) -> list[Kind]:
        """Kinds of reading in the data."""
        return kinds_read(self.problem)

    @property
    def rows(self) -> NDArray[np.int64]:
        """Indices of the rows that count."""
        return np.flatnonzero(self.problem.use)

    @property
    def place(self) -> Array:
        """(n, 3) [m] positions at which the rows are drawn."""
        return self.first.prediction.readings.position

    @property
    def magnify(self) -> float:
        """Factor on the length of arrows; 0 if no position was read."""
        return magnification(self.problem, self.first)

    def top(self, kind: Kind) -> float:
        """End of the colour scale of a kind, in its unit for people."""
        sizes = kind.sizes(self.problem, self.first.raw)
        return colours.round_up(float(np.nanpercentile(sizes, _LARGEST)) * kind.factor)

    def shades(self, state: State, kind: Kind) -> colours.Colours:
        """(k, 4) colours of the rows that count."""
        sizes = np.nan_to_num(kind.sizes(self.problem, state.raw)[self.rows])
        return colours.scale_colours(sizes * kind.factor, self.top(kind))

    @property
    def measured(self) -> Array:
        """(n, 7) measured poses, completed by the first model's predictions."""
        data, readings = self.problem.data, self.first.prediction.readings
        position = np.where(np.isfinite(data.position), data.position, readings.position)
        if data.quat_wxyz is not None:
            known = np.isfinite(data.quat_wxyz)
            quat = np.where(known, data.quat_wxyz, readings.quat_wxyz)
        else:
            angles = rxyz_from_quat(readings.quat_wxyz)
            known = np.isfinite(data.angles_rad)
            quat = quat_from_rxyz(np.where(known, data.angles_rad, angles))
        return np.concatenate([position, quat], axis=1)

    @property
    def seen(self) -> Array:
        """(k, 7) poses that the scene has to show: those measured and those predicted."""
        return np.concatenate([self.measured[self.rows], predicted_poses(self.first)[self.rows]])


def predicted_poses(state: State) -> Array:
    """(n, 7) poses that would be read according to the model."""
    readings = state.prediction.readings
    return np.concatenate([readings.position, readings.quat_wxyz], axis=1)


def states_of(state: State) -> States:
    """The model's platform and cables at every row; NaN without equilibrium."""
    prediction = state.prediction
    pose = np.where(prediction.solved[:, None], prediction.pose, np.nan)
    lengths = prediction.tables.cables[..., REST]
    return States(pose, prediction.tensions, lengths, prediction.slack)


def stacked(rows: list[tuple[State, int]]) -> States:
    """One row of each of several models, stacked."""
    parts = [(states_of(state), k) for state, k in rows]
    return States(
        np.stack([s.pose[k] for s, k in parts]),
        np.stack([s.tensions[k] for s, k in parts]),
        np.stack([s.rest_lengths[k] for s, k in parts]),
        np.stack([s.slack[k] for s, k in parts]),
    )


def worst_row(misfit: Misfit) -> int:
    """The row with the largest error, in units of the noise."""
    table = np.zeros(misfit.problem.measured.shape)
    table[misfit.problem.row_of, misfit.problem.column_of] = misfit.first.white
    return int(np.argmax((table**2).sum(axis=1)))


def arrows(
    recording: Recording, index: Index, misfit: Misfit, states: list[State], size: float
) -> None:
    """At each time the errors of one model: arrows of position, or dots if none was read."""
    rows, place = misfit.rows, misfit.place
    count = [len(rows)] * len(states)
    kind = misfit.kinds[0]
    shade = np.concatenate([misfit.shades(state, kind) for state in states])
    origins = np.tile(place[rows], (len(states), 1))
    if misfit.magnify:
        vectors = np.concatenate([_vectors(misfit, state)[rows] for state in states])
        columns = rr.Arrows3D.columns(origins=origins, vectors=vectors, colors=shade)
        recording.rows("scene/errors", index, columns.partition(count))
        recording.always("scene/errors", rr.Arrows3D.from_fields(radii=[_ARROW * size]))
    else:
        columns = rr.Points3D.columns(positions=origins, colors=shade)
        recording.rows("scene/errors", index, columns.partition(count))
        dots = rr.Points3D.from_fields(radii=[4.0 * _ARROW * size])
        recording.always("scene/errors", dots)


def _vectors(misfit: Misfit, state: State) -> Array:
    """(n, 3) arrows [m] from predictions to measurements, magnified."""
    counted = misfit.problem.counted[:, POSITION]
    return misfit.magnify * np.where(counted, state.raw[:, POSITION], 0.0)


def maps(recording: Recording, index: Index, misfit: Misfit, states: list[State]) -> None:
    """One map per kind of reading, with dots coloured by the error."""
    rows = misfit.rows
    for kind in misfit.kinds:
        words = f"{misfit.top(kind):g} {kind.unit}"
        draw_axes(recording, f"map/{kind.name}", _flat(misfit, misfit.place)[rows], words)
    points = np.tile(_flat(misfit, misfit.place)[rows], (len(states), 1))
    count = [len(rows)] * len(states)
    for kind in misfit.kinds:
        entity = f"map/{kind.name}/errors"
        shade = np.concatenate([misfit.shades(state, kind) for state in states])
        columns = rr.Points2D.columns(positions=points, colors=shade)
        recording.rows(entity, index, columns.partition(count))
        recording.always(entity, rr.Points2D.from_fields(radii=[_DOT]))
        if kind.name == "position" and misfit.magnify:
            vectors = [_flat(misfit, _vectors(misfit, state))[rows] for state in states]
            thin = rr.Arrows2D.columns(vectors=np.concatenate(vectors), origins=points)
            recording.rows(f"map/{kind.name}/arrows", index, thin.partition(count))
            style = rr.Arrows2D.from_fields(radii=[_THIN], colors=[colours.SILVER])
            recording.always(f"map/{kind.name}/arrows", style)


def panels(misfit: Misfit, legends: Sequence[Legend]) -> rrb.Tabs:
    """The plots of the errors, one per kind of reading, each with its legend."""
    return rrb.Tabs(
        *(
            plots.plot(
                f"{kind.name.capitalize()} error [{kind.unit}]", [f"plot/{kind.name}/**"], legend
            )
            for kind, legend in zip(misfit.kinds, legends, strict=True)
        )
    )


def cursor(recording: Recording, index: Index, misfit: Misfit) -> None:
    """A ring around the dot of the current row, on every map."""
    points = _flat(misfit, misfit.place)
    for kind in misfit.kinds:
        entity = f"map/{kind.name}/here"
        recording.rows(entity, index, rr.Points2D.columns(positions=points))
        white = rr.Points2D.from_fields(radii=[_RING], colors=[(255, 255, 255, 120)])
        recording.always(entity, white)


def _flat(misfit: Misfit, vectors: Array) -> Array:
    """(n, 2) coordinates in the map's plane, with the second axis up."""
    first, second = views_of(misfit.place[misfit.rows])[0]
    return np.stack([vectors[:, first], -vectors[:, second]], axis=1)


def map_views(misfit: Misfit) -> list[rrb.Spatial2DView]:
    """The maps' views."""
    points = _flat(misfit, misfit.place)[misfit.rows]
    across, down = bounds(points)
    plane = ", ".join("xyz"[k] for k in views_of(misfit.place[misfit.rows])[0])
    arrows = f", arrows {drawn(misfit.magnify)}" if misfit.magnify else ""
    return [
        rrb.Spatial2DView(
            name=f"{kind.name.capitalize()} error [{kind.unit}] over {plane} [m]"
            + arrows * (kind.name == "position"),
            origin=f"map/{kind.name}",
            background=rrb.Background(color=layout.GROUND),
            visual_bounds=rrb.VisualBounds2D(x_range=across, y_range=down),
        )
        for kind in misfit.kinds
    ]


def misfit_words(misfit: Misfit) -> Sequence[str]:
    """The meaning of arrows and colours, in a sentence or two."""
    kind = misfit.kinds[0]
    scale = f"from dark (none) to yellow ({misfit.top(kind):g} {kind.unit} or more)"
    if not misfit.magnify:
        return [f"Dots are measured poses, coloured by their {kind.name} error {scale}."]
    return [
        "Arrows at the measured poses point from the predicted to the measured position; they are "
        "drawn ",
        Bold(drawn(misfit.magnify)),
        f" and coloured {scale}.",
    ]


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
    """Two axes with round numbers in metres, for points (n, 2) whose second axis points down; the
    bar of colours ends at ``words``, such as "5 mm".
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
    recording.labels(f"{entity}/numbers", [*places, *ends], [*labels, words, "0"])


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
