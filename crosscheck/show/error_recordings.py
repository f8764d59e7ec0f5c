"""Recordings of a model's errors: of a comparison pose by pose, of a diagnosis model by model.

In a diagnosis the timeline ``model_step`` shows every pose's error under one model after the other,
and ``pose`` goes through the measured poses: as measured, under the first model and under the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from crosscheck.comparison.quantities import channels
from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.problem import Kind
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import State
from crosscheck.show.blocks import Bold
from crosscheck.show.comparison import pose_errors_text, verdict_text
from crosscheck.show.diagnosis import diagnosis_text, pose_of_step_text, step_text
from crosscheck.show.residuals import Misfit, drawn_words, predicted_poses
from seecr.pose import Array
from seecr.show import colours, layout, plots
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import Scene, States, extent
from seecr.show.stream import MODEL_STEP, POSE, Index, Recording, pose_index, recording_file
from seecr.statics.tables import rest_lengths_of
from seecr.units import short

VERDICT, NOW = "text/verdict", "text/now"
MEASURED: colours.Rgba = colours.MUJOCO
# Radii of arrows relative to the robot's size; of dots, rings and thin arrows in points of the
# screen at any zoom, which Rerun expects as negative numbers.
_ARROW, _DOT, _RING, _THIN = 0.0021, -5.0, -9.0, -0.8
_STEPS_A_SECOND = 1.0
# Size of a plot of a diagnosis and of a comparison, in points of a window of 1920 by 1080.
_PLOT, _HALF = (820.0, 250.0), (630.0, 445.0)
_BETWEEN = (colours.YELLOW, colours.PINK, colours.GREEN, colours.SILVER)


def _words_alone(path: str | Path, name: str, text: str) -> None:
    """A recording where nothing can be drawn."""
    root = rrb.Vertical(layout.text("Verdict", VERDICT))
    with recording_file(path, name, layout.blueprint(root)) as recording:
        recording.text(VERDICT, text)


def _texts(*shares: float) -> rrb.Vertical:
    return rrb.Vertical(
        layout.text("Verdict", VERDICT), layout.text("Now", NOW), row_shares=list(shares)
    )


def _scene_view(shown: Misfit, name: str, aspect: float) -> rrb.Spatial3DView:
    robot = shown.problem.robot
    low, high = extent(robot, shown.seen)
    return layout.scene_view(robot, low, high, name, aspect)


def _flat_view(
    name: str, origin: str, across: tuple[float, float], down: tuple[float, float]
) -> rrb.Spatial2DView:
    """A view of a drawing within these ranges."""
    return rrb.Spatial2DView(
        name=name, origin=origin, background=rrb.Background(color=layout.GROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=across, y_range=down),
    )  # fmt: skip


def _pose_by_pose(recording: Recording, scene: Scene, shown: Misfit, state: State) -> rr.TimeColumn:
    """What was measured and a model at each pose, and the maps, on which a ring follows."""
    rows, states = shown.drawn, states_of(state, shown.drawn)
    index = rr.TimeColumn(POSE, sequence=rows)
    measured = np.where(shown.problem.use[:, None], shown.measured, np.nan)[rows]
    scene.platform("measured", index, measured, MEASURED)
    predicted = np.where(states.known[:, None], predicted_poses(state)[rows], np.nan)
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, states)
    maps(recording, pose_index(1), shown, [shown.first])
    cursor(recording, index, shown)
    return index


# --- comparison -----------------------------------------------------------------------------------


def write_comparison_recording(found: Comparison, path: str | Path) -> None:
    """Write the recording of a comparison; if nothing could be compared, there is only text.

    Raises:
        InputFileError: the file cannot be written.
    """
    problem = found.problem
    name = f"comparison of {problem.robot.name}, {problem.data.name}"
    if found.whiteness is None:
        _words_alone(path, name, verdict_text(found, (), ()))
        return
    shown = Misfit(problem, found.state)
    kinds = shown.kinds
    with recording_file(path, name, _comparison_layout(shown, name)) as recording:
        top = colours.round_up(float(np.nanmax(found.state.prediction.tensions, initial=0.0)))
        scene = Scene(recording, problem.robot, shown.seen, top)
        scene.surroundings()
        arrows(recording, pose_index(1), shown, [found.state], scene.size)
        index = _pose_by_pose(recording, scene, shown, found.state)
        for kind in kinds:
            shades = colours.cable_colours(len(channels(problem)[0][kind.columns]))
            for k, reading, values in _errors_of(shown, kind):
                entity, colour = f"plot/{kind.name}/reading_{k + 1}", shades[k]
                plots.line_by_runs(
                    recording, entity, index, values, shown.starts, reading, colour, 1.5
                )
        recording.texts(NOW, index, [pose_errors_text(found, k) for k in shown.drawn.tolist()])
        recording.text(VERDICT, verdict_text(found, kinds, misfit_words(shown)))


def _comparison_layout(shown: Misfit, name: str) -> rrb.Blueprint:
    many, legends = len(shown.kinds), []
    for kind in shown.kinds:
        _numbers, names, curves = zip(*_errors_of(shown, kind), strict=True)
        legends.append(legend_of([np.stack(curves, axis=1)], names, _HALF))
    maps_and_plots = rrb.Vertical(
        *map_views(shown), panels(shown, legends), row_shares=[*[1.0] * many, float(many)]
    )
    root = rrb.Horizontal(
        _scene_view(shown, name, 0.76), maps_and_plots, _texts(2.4, 2.0),
        column_shares=[4.6, 3.8, 2.8],
    )  # fmt: skip
    return layout.blueprint(root)


def _errors_of(shown: Misfit, kind: Kind) -> list[tuple[int, str, Array]]:
    """Number, name and errors (k,) of each reading of one kind; NaN where one does not count.

    The name is that in a plot whose title states the kind.
    """
    names = channels(shown.problem)[0][kind.columns]
    read = shown.problem.counted[shown.drawn, kind.columns]
    raw = np.where(read, shown.first.raw[shown.drawn, kind.columns], np.nan) * kind.factor
    return [
        (k, name.removeprefix("tension of ").removeprefix("rotation "), raw[:, k])
        for k, name in enumerate(names)
        if read[:, k].any()
    ]


# --- diagnosis ------------------------------------------------------------------------------------


def write_diagnosis_recording(found: Diagnosis, path: str | Path) -> None:
    """Write the recording of a diagnosis; without a search (no verdict) there is only text.

    Raises:
        InputFileError: the file cannot be written.
    """
    if found.path is None:
        _words_alone(path, "diagnosis", diagnosis_text(found, ()))
        return
    problem, stages = found.path.problem, found.path.stages
    shown = Misfit(problem, stages[0].state)
    name = f"diagnosis of {problem.robot.name}, {problem.data.name}"
    tensions = [stage.state.prediction.tensions for stage in (stages[0], stages[-1])]
    top = colours.round_up(float(np.nanmax(tensions, initial=0.0)))
    with recording_file(path, name, _diagnosis_layout(stages, shown, name)) as recording:
        scene = Scene(recording, problem.robot, shown.seen, top)
        scene.surroundings()
        _over_steps(recording, scene, found, stages, shown)
        _over_poses(recording, scene, stages, shown)
        recording.text(VERDICT, diagnosis_text(found, misfit_words(shown)))


def _diagnosis_layout(stages: Sequence[Stage], shown: Misfit, name: str) -> rrb.Blueprint:
    many = len(shown.kinds)
    low = bars_share(many, len(stages))
    bars = _flat_view("rms error on test runs, logarithmic; the line is the noise", _BARS,
                      (0.0, 100.0), (-1.0, many * _block_height(len(stages))))  # fmt: skip
    legends = [_model_legend(stages, shown, kind) for kind in shown.kinds]
    root = rrb.Horizontal(
        rrb.Vertical(
            _scene_view(shown, name, 1.22), panels(shown, legends), row_shares=[3.0, 1.3]
        ),
        rrb.Vertical(
            *map_views(shown), bars, row_shares=[*[(1.0 - low) / many] * many, low],
        ),
        _texts(1.6, 2.0),
        column_shares=[5.0, 3.6, 2.8],
    )  # fmt: skip
    return layout.blueprint(root, timeline=(MODEL_STEP, 1.0), poses_a_second=_STEPS_A_SECOND)


def _over_steps(
    recording: Recording, scene: Scene, found: Diagnosis, stages: Sequence[Stage], shown: Misfit
) -> None:
    """Everything that changes from model to model."""
    count, worst = len(stages), shown.worst_row
    index = rr.TimeColumn(MODEL_STEP, sequence=range(count))
    states = [stage.state for stage in stages]
    arrows(recording, index, shown, states, scene.size)
    maps(recording, index, shown, states)
    for block, kind in enumerate(shown.kinds):
        _bars_of(recording, index, found, stages, kind, block * _block_height(count))
    scene.platform("measured", index, np.tile(shown.measured[worst], (count, 1)), MEASURED)
    predicted = np.stack([predicted_poses(state)[worst] for state in states])
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, _row_of_each(states, worst))
    line = int(shown.problem.data.line[worst])
    texts = [step_text(found, stages, k, shown.kinds, line) for k in range(count)]
    recording.texts(NOW, index, texts)


def _over_poses(recording: Recording, scene: Scene, stages: Sequence[Stage], shown: Misfit) -> None:
    """The measured poses one by one, under the first and the last model."""
    index = _pose_by_pose(recording, scene, shown, stages[-1].state)
    if len(stages) > 1:
        scene.platform("first", index, predicted_poses(shown.first)[shown.drawn], colours.PINK)
    for kind in shown.kinds:
        _model_plots(recording, index, stages, shown, kind)
    rows = shown.drawn.tolist()
    texts = [pose_of_step_text(shown.problem, stages, shown.kinds, k) for k in rows]
    recording.texts(NOW, index, texts)


def _model_plots(
    recording: Recording, index: rr.TimeColumn, stages: Sequence[Stage], shown: Misfit, kind: Kind
) -> None:
    """The error of each pose under each model; over the steps, that on all test runs."""
    for k, stage in enumerate(stages):
        sizes = shown.sizes(stage.state, kind)[shown.drawn]
        shade = colours.VERMILION if k == 0 else _BETWEEN[(k - 1) % len(_BETWEEN)]
        shade = colours.SKY if 0 < k == len(stages) - 1 else shade
        entity = f"plot/{kind.name}/model_{k}"
        plots.line_by_runs(recording, entity, index, sizes, shown.starts, stage.label, shade, 1.5)
    entity = f"plot/{kind.name}/left_out"
    steps = rr.TimeColumn(MODEL_STEP, sequence=range(len(stages)))
    rms = [kind.factor * (stage.held_out.rms[kind.key] or 0.0) for stage in stages]
    recording.scalars(entity, steps, rms)
    plots.as_line(recording, entity, "rms on test runs", colours.SILVER, 2.0)


def _model_legend(stages: Sequence[Stage], shown: Misfit, kind: Kind) -> Legend:
    """Its corner only: a longer axis would leave little room for the one curve over the steps."""
    sizes = [shown.sizes(stage.state, kind)[shown.drawn] for stage in stages]
    legend = legend_of([np.stack(sizes, axis=1)], [stage.label for stage in stages], _PLOT)
    return replace(legend, values=None)


# --- arrows and maps -----------------------------------------------------------------------------


def states_of(state: State, rows: NDArray[np.int64] | slice) -> States:
    """The model's platform and cables at some rows; NaN without equilibrium."""
    prediction = state.prediction
    pose = np.where(prediction.solved[:, None], prediction.pose, np.nan)
    lengths = rest_lengths_of(prediction.tables)
    return States(pose[rows], prediction.tensions[rows], lengths[rows], prediction.slack[rows])


def _row_of_each(states: Sequence[State], k: int) -> States:
    """One row under several models."""
    some = [states_of(state, slice(k, k + 1)) for state in states]
    return States(*(np.concatenate([getattr(one, n) for one in some]) for n in vars(some[0])))


def _shades(misfit: Misfit, states: list[State], kind: Kind) -> colours.Colours:
    """(k, 4) colours of the rows that count, under one model after the other."""
    sizes = [np.nan_to_num(misfit.sizes(state, kind)[misfit.rows]) for state in states]
    return colours.scale_colours(np.concatenate(sizes), misfit.top(kind))


def arrows(
    recording: Recording, index: Index, misfit: Misfit, states: list[State], size: float
) -> None:
    """At each time the errors of one model: arrows of position, or dots if none was read."""
    rows = misfit.rows
    style: Any
    shade = _shades(misfit, states, misfit.kinds[0])
    origins = np.tile(misfit.place[rows], (len(states), 1))
    if misfit.magnify:
        vectors = np.concatenate([misfit.magnify * misfit.errors(state)[rows] for state in states])
        columns = rr.Arrows3D.columns(origins=origins, vectors=vectors, colors=shade)
        style = rr.Arrows3D.from_fields(radii=[_ARROW * size])
    else:
        columns = rr.Points3D.columns(positions=origins, colors=shade)
        style = rr.Points3D.from_fields(radii=[4.0 * _ARROW * size])
    recording.rows("scene/errors", index, columns.partition([len(rows)] * len(states)))
    recording.always("scene/errors", style)


def maps(recording: Recording, index: Index, misfit: Misfit, states: list[State]) -> None:
    """One map per kind of reading, with dots coloured by the error."""
    rows, count = misfit.rows, [len(misfit.rows)] * len(states)
    flat = _flat(misfit, misfit.place)[rows]
    points = np.tile(flat, (len(states), 1))
    for kind in misfit.kinds:
        draw_axes(recording, f"map/{kind.name}", flat, f"{misfit.top(kind):g} {kind.unit}")
        entity = f"map/{kind.name}/errors"
        columns = rr.Points2D.columns(positions=points, colors=_shades(misfit, states, kind))
        recording.rows(entity, index, columns.partition(count))
        recording.always(entity, rr.Points2D.from_fields(radii=[_DOT]))
        if kind.name == "position" and misfit.magnify:
            vectors = [
                misfit.magnify * _flat(misfit, misfit.errors(state))[rows] for state in states
            ]
            thin = rr.Arrows2D.columns(vectors=np.concatenate(vectors), origins=points)
            recording.rows(f"map/{kind.name}/arrows", index, thin.partition(count))
            style = rr.Arrows2D.from_fields(radii=[_THIN], colors=[colours.SILVER])
            recording.always(f"map/{kind.name}/arrows", style)


def panels(misfit: Misfit, legends: Sequence[Legend]) -> rrb.Tabs:
    """The plots of the errors, one per kind of reading, each with its legend."""
    titles = [f"{kind.name.capitalize()} error [{kind.unit}]" for kind in misfit.kinds]
    entities = [[f"plot/{kind.name}/**"] for kind in misfit.kinds]
    return rrb.Tabs(*map(plots.plot, titles, entities, legends))


def cursor(recording: Recording, index: Index, misfit: Misfit) -> None:
    """A ring around the dot of the current row, on every map."""
    points = _flat(misfit, misfit.place)[misfit.drawn]
    for kind in misfit.kinds:
        entity = f"map/{kind.name}/here"
        recording.rows(entity, index, rr.Points2D.columns(positions=points))
        white = rr.Points2D.from_fields(radii=[_RING], colors=[(255, 255, 255, 120)])
        recording.always(entity, white)


def _flat(misfit: Misfit, vectors: Array) -> Array:
    """(n, 2) coordinates in the map's plane, with the second axis up."""
    first, second = misfit.views[0]
    return np.stack([vectors[:, first], -vectors[:, second]], axis=1)


def map_views(misfit: Misfit) -> list[rrb.Spatial2DView]:
    """The maps' views."""
    points = _flat(misfit, misfit.place)[misfit.rows]
    plane = ", ".join("xyz"[k] for k in misfit.views[0])
    arrows = f", arrows {misfit.scale}" if misfit.magnify else ""
    return [
        _flat_view(
            f"{kind.name.capitalize()} error [{kind.unit}] over {plane} [m]"
            + arrows * (kind.name == "position"),
            f"map/{kind.name}", *bounds(points),
        )
        for kind in misfit.kinds
    ]  # fmt: skip


def misfit_words(misfit: Misfit) -> Sequence[str]:
    """The meaning of arrows and colours, in a sentence or two, and which rows are drawn."""
    kind, which = misfit.kinds[0], drawn_words(misfit.problem.data.n_rows)
    which = which and f" {which}"
    scale = f"from dark (none) to yellow ({misfit.top(kind):g} {kind.unit} or more)"
    if not misfit.magnify:
        return [f"Dots are measured poses, coloured by their {kind.name} error {scale}.{which}"]
    return [
        "Arrows at the measured poses point from the predicted to the measured position; they are "
        "drawn ",
        Bold(misfit.scale),
        f" and coloured {scale}.{which}",
    ]


# --- bars of the errors, model by model, compared with the noise; the current one is bright -------

_BARS = "bars"
# The drawing is 100 wide; y points down, with one row per model.
_BEGIN, _END, _ROW, _TITLE_ROW = 31.0, 82.0, 4.4, 5.6
_DIM, _LABEL = 0.45, 2.2
# Screen points per unit of the drawing, of the title, of a column; largest part of a column.
_POINTS, _TITLE, _COLUMN, _MOST = 5.2, 32.0, 1010.0, 0.6


def bars_share(kinds: int, models: int) -> float:
    """Height relative to a column in a window of 1080 points, with room for the labels.

    The viewer's letters keep their size whatever the size of the drawing.
    """
    return min((_POINTS * kinds * _block_height(models) + _TITLE) / _COLUMN, _MOST)


def _block_height(rows: int) -> float:
    return _TITLE_ROW + rows * _ROW + 1.5


def _bars_of(
    recording: Recording, index: rr.TimeColumn, found: Diagnosis, stages: Sequence[Stage],
    kind: Kind, top: float,
) -> None:  # fmt: skip
    """A block: bars of one kind of reading, from half the noise to the error on test runs."""
    values = np.array([kind.factor * (s.held_out.rms[kind.key] or 0.0) for s in stages])
    floor = kind.factor * (found.floor.get(kind.key) or 0.0)
    ends = _bar_ends(values, values, floor)
    rows = top + _TITLE_ROW + _ROW * (np.arange(len(stages)) + 0.5)
    calm = found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    alone = colours.SILVER if calm else colours.VERMILION
    lit = np.array([colours.SKY if one.added else alone for one in stages], dtype=np.uint8)
    root = f"{_BARS}/{kind.name}"
    strips = [np.array([[_BEGIN, y], [x, y]]) for x, y in zip(ends, rows, strict=True)]
    thick = 0.3 * _ROW
    # the viewer draws 2D boxes as outlines only, so bars are thick lines
    dim = (_DIM * lit).astype(np.uint8)
    dim[:, 3] = 255
    every = rr.LineStrips2D(strips, radii=thick, colors=dim, draw_order=20.0)
    recording.always(f"{root}/all", every)
    columns = rr.LineStrips2D.columns(strips=strips, colors=lit)
    recording.rows(f"{root}/now", index, columns.partition([1] * len(stages)))
    recording.always(f"{root}/now", rr.LineStrips2D.from_fields(radii=[thick], draw_order=40.0))
    noise = float(_bar_ends(np.array([floor]), values, floor)[0])
    line = [[noise, rows[0] - 0.6 * _ROW], [noise, rows[-1] + 0.6 * _ROW]]
    noise_line = rr.LineStrips2D([line], radii=0.18, colors=colours.COMMAND, draw_order=50.0)
    recording.always(f"{root}/noise", noise_line)
    # above their points, as the viewer draws labels below them
    above = rows - _LABEL
    names, numbers = [s.label for s in stages], [f"{short(v)} {kind.unit}" for v in values]
    recording.labels(f"{root}/names", [(0.5 * _BEGIN, y) for y in above], names)
    recording.labels(f"{root}/numbers", np.stack([ends + 8.0, above], axis=1), numbers)
    title = f"{kind.name} [{kind.unit}], noise {short(floor)}"
    place = (0.5 * (_BEGIN + _END), top + 0.55 * _TITLE_ROW - _LABEL)
    recording.labels(f"{root}/title", [place], [title])


def _bar_ends(values: np.ndarray, every: np.ndarray, floor: float) -> np.ndarray:
    """Ends of the bars: logarithmic from half the noise, or linear without noise."""
    if floor <= 0.0:
        return _BEGIN + (_END - _BEGIN) * values / max(float(every.max()), 1e-300)
    low = np.log(0.5 * min(floor, float(every[every > 0].min(initial=floor))))
    high = np.log(max(float(every.max()), 2.0 * floor))
    part = (np.log(np.maximum(values, 1e-300)) - low) / (high - low)
    return np.asarray(_BEGIN + (_END - _BEGIN) * np.clip(part, 0.01, 1.0))


# --- axes of maps ---------------------------------------------------------------------------------

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
    across = low[0] - _LEFT * size, high[0] + _RIGHT * size
    return across, (low[1] - _ABOVE * size, high[1] + _BELOW * size)


def draw_axes(recording: Recording, entity: str, points: Array, words: str) -> None:
    """Two axes with round numbers in metres, for points (n, 2) whose second axis points down; the
    bar of colours ends at ``words``, such as "5 mm".
    """
    low, high, size = _box(points)
    corner = np.array([low[0], high[1]])
    tick = _TICK * size
    right, up = _round(low[0], high[0]), _round(-high[1], -low[1])
    lines = [np.array([corner, high]), np.array([corner, low])]
    lines += [np.array([[value, high[1]], [value, high[1] + tick]]) for value in right]
    lines += [np.array([[low[0] - tick, -value], [low[0], -value]]) for value in up]
    strips = rr.LineStrips2D(lines, radii=-_LINE, colors=colours.FRAME)
    recording.always(f"{entity}/axes", strips)
    _bar(recording, f"{entity}/scale", low, high, size)
    x, above = high[0] + (_BAR + _WORDS) * size, 2.2 * tick  # labels are below their points
    places = [(value, high[1] + tick) for value in right]
    places += [(low[0] - 5.0 * tick, -value - above) for value in up]
    places += [(x, low[1] - above), (x, high[1] - above)]
    numbers = [f"{value:g}" for value in (*right, *up)]
    recording.labels(f"{entity}/numbers", places, [*numbers, words, "0"])


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
