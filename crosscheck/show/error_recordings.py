"""Recordings of a model's errors: of a comparison pose by pose, of a diagnosis model by model.

In a diagnosis the timeline ``model_step`` shows every pose's error under one model after the other,
and ``pose`` goes through the measured poses: as measured, under the first model and under the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from crosscheck.comparison.quantities import channels
from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.problem import Kind, kinds_read
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import State
from crosscheck.show import misfit
from crosscheck.show.comparison import pose_errors_text, verdict_text
from crosscheck.show.diagnosis import diagnosis_text, pose_of_step_text, step_text
from crosscheck.show.misfit import MEASURED, Misfit
from seecr.pose import Array
from seecr.show import colours, layout, plots
from seecr.show.colours import Rgba
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import Scene, extent
from seecr.show.stream import MODEL_STEP, Index, Recording, pose_index, recording_file
from seecr.units import short

VERDICT, NOW = "text/verdict", "text/now"
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


def _pose_by_pose(recording: Recording, scene: Scene, shown: Misfit, state: State) -> rr.TimeColumn:
    """What was measured and a model at each pose, and the maps, on which a ring follows."""
    problem, states = shown.problem, misfit.states_of(state)
    index = pose_index(problem.data.n_rows)
    measured = np.where(problem.use[:, None], shown.measured, np.nan)
    scene.platform("measured", index, measured, MEASURED)
    predicted = np.where(states.known[:, None], misfit.predicted_poses(state), np.nan)
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, states)
    misfit.maps(recording, pose_index(1), shown, [shown.first])
    misfit.cursor(recording, index, shown)
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
    n, kinds = problem.data.n_rows, shown.kinds
    with recording_file(path, name, _comparison_layout(found, shown, name)) as recording:
        top = colours.round_up(float(np.nanmax(found.state.prediction.tensions, initial=0.0)))
        scene = Scene(recording, problem.robot, shown.seen, top)
        scene.surroundings()
        misfit.arrows(recording, pose_index(1), shown, [found.state], scene.size)
        index = _pose_by_pose(recording, scene, shown, found.state)
        for kind in kinds:
            _reading_plots(recording, index, found, kind)
        recording.texts(NOW, index, [pose_errors_text(found, k) for k in range(n)])
        recording.text(VERDICT, verdict_text(found, kinds, misfit.misfit_words(shown)))


def _comparison_layout(found: Comparison, shown: Misfit, name: str) -> rrb.Blueprint:
    many = len(shown.kinds)
    root = rrb.Horizontal(
        _scene_view(shown, name, 0.76),
        rrb.Vertical(
            *misfit.map_views(shown),
            misfit.panels(shown, [_reading_legend(found, kind) for kind in shown.kinds]),
            row_shares=[*[1.0] * many, float(many)],
        ),
        _texts(2.4, 2.0),
        column_shares=[4.6, 3.8, 2.8],
    )
    return layout.blueprint(root)


def _errors_of(found: Comparison, kind: Kind) -> list[tuple[int, str, Array]]:
    """Number, name and errors (n,) of each reading of one kind; NaN where one does not count.

    The name is that in a plot whose title states the kind.
    """
    names = channels(found.problem)[0][kind.columns]
    read = found.problem.counted[:, kind.columns]
    raw = np.where(read, found.state.raw[:, kind.columns], np.nan) * kind.factor
    return [
        (k, name.removeprefix("tension of ").removeprefix("rotation "), raw[:, k])
        for k, name in enumerate(names)
        if read[:, k].any()
    ]


def _reading_legend(found: Comparison, kind: Kind) -> Legend:
    _numbers, names, curves = zip(*_errors_of(found, kind), strict=True)
    return legend_of([np.stack(curves, axis=1)], names, _HALF)


def _reading_plots(recording: Recording, index: Index, found: Comparison, kind: Kind) -> None:
    """The errors of one kind, reading by reading, over the poses."""
    shades = colours.cable_colours(len(channels(found.problem)[0][kind.columns]))
    starts = found.problem.experiment.commands.starts
    for k, name, values in _errors_of(found, kind):
        entity = f"plot/{kind.name}/reading_{k + 1}"
        plots.line_by_runs(recording, entity, index, values, starts, name, shades[k], 1.5)


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
    with recording_file(path, name, _diagnosis_layout(found, stages, shown, name)) as recording:
        scene = Scene(recording, problem.robot, shown.seen, top)
        scene.surroundings()
        _over_steps(recording, scene, found, stages, shown)
        _over_poses(recording, scene, stages, shown)
        recording.text(VERDICT, diagnosis_text(found, misfit.misfit_words(shown)))


def _diagnosis_layout(
    found: Diagnosis, stages: Sequence[Stage], shown: Misfit, name: str
) -> rrb.Blueprint:
    low, many = bars_share(found, stages), len(shown.kinds)
    legends = [_model_legend(stages, shown, kind) for kind in shown.kinds]
    root = rrb.Horizontal(
        rrb.Vertical(
            _scene_view(shown, name, 1.22), misfit.panels(shown, legends), row_shares=[3.0, 1.3]
        ),
        rrb.Vertical(
            *misfit.map_views(shown), _bars_view(found, stages),
            row_shares=[*[(1.0 - low) / many] * many, low],
        ),
        _texts(1.6, 2.0),
        column_shares=[5.0, 3.6, 2.8],
    )  # fmt: skip
    return layout.blueprint(root, timeline=(MODEL_STEP, 1.0), poses_a_second=_STEPS_A_SECOND)


def _over_steps(
    recording: Recording, scene: Scene, found: Diagnosis, stages: Sequence[Stage], shown: Misfit
) -> None:
    """Everything that changes from model to model."""
    count, worst = len(stages), misfit.worst_row(shown)
    index = rr.TimeColumn(MODEL_STEP, sequence=range(count))
    states = [stage.state for stage in stages]
    misfit.arrows(recording, index, shown, states, scene.size)
    misfit.maps(recording, index, shown, states)
    for block, kind in enumerate(shown.kinds):
        _bars_of(recording, index, found, stages, kind, block * _block_height(count))
    scene.platform("measured", index, np.tile(shown.measured[worst], (count, 1)), MEASURED)
    predicted = np.stack([misfit.predicted_poses(state)[worst] for state in states])
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, misfit.stacked([(state, worst) for state in states]))
    line = int(shown.problem.data.line[worst])
    texts = [step_text(found, stages, k, shown.kinds, line) for k in range(count)]
    recording.texts(NOW, index, texts)


def _over_poses(recording: Recording, scene: Scene, stages: Sequence[Stage], shown: Misfit) -> None:
    """The measured poses one by one, under the first and the last model."""
    index = _pose_by_pose(recording, scene, shown, stages[-1].state)
    if len(stages) > 1:
        scene.platform("first", index, misfit.predicted_poses(shown.first), colours.PINK)
    for kind in shown.kinds:
        _model_plots(recording, index, stages, shown, kind)
    problem, n = shown.problem, shown.problem.data.n_rows
    texts = [pose_of_step_text(problem, stages, shown.kinds, k) for k in range(n)]
    recording.texts(NOW, index, texts)


def _model_plots(
    recording: Recording, index: rr.TimeColumn, stages: Sequence[Stage], shown: Misfit, kind: Kind
) -> None:
    """The error of each pose under each model; over the steps, that on all test runs."""
    starts = shown.problem.experiment.commands.starts
    for k, stage in enumerate(stages):
        sizes = kind.sizes(shown.problem, stage.state.raw) * kind.factor
        shade = colours.VERMILION if k == 0 else _BETWEEN[(k - 1) % len(_BETWEEN)]
        shade = colours.SKY if 0 < k == len(stages) - 1 else shade
        entity = f"plot/{kind.name}/model_{k}"
        plots.line_by_runs(recording, entity, index, sizes, starts, stage.label, shade, 1.5)
    entity = f"plot/{kind.name}/left_out"
    steps = rr.TimeColumn(MODEL_STEP, sequence=range(len(stages)))
    rms = [kind.factor * (stage.held_out.rms[kind.key] or 0.0) for stage in stages]
    recording.scalars(entity, steps, rms)
    plots.as_line(recording, entity, "rms on test runs", colours.SILVER, 2.0)


def _model_legend(stages: Sequence[Stage], shown: Misfit, kind: Kind) -> Legend:
    """Its corner only: a longer axis would leave little room for the one curve over the steps."""
    sizes = [kind.sizes(shown.problem, stage.state.raw) * kind.factor for stage in stages]
    legend = legend_of([np.stack(sizes, axis=1)], [stage.label for stage in stages], _PLOT)
    return replace(legend, values=None)


# --- bars of the errors, model by model, compared with the noise; the current one is bright -------

_BARS = "bars"
# The drawing is 100 wide; y points down, with one row per model.
_LEFT, _RIGHT, _ROW, _HEAD = 31.0, 82.0, 4.4, 5.6
_DIM, _LABEL = 0.45, 2.2
# Screen points per unit of the drawing, of the title, of a column; largest part of a column.
_POINTS, _TITLE, _COLUMN, _MOST = 5.2, 32.0, 1010.0, 0.6


def _bars_view(found: Diagnosis, stages: Sequence[Stage]) -> rrb.Spatial2DView:
    """The bars' view."""
    assert found.path is not None
    height = _height(found, stages)
    return rrb.Spatial2DView(
        name="rms error on test runs, logarithmic; the line is the noise",
        origin=_BARS,
        background=rrb.Background(color=layout.GROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, 100.0), y_range=(-1.0, height)),
    )


def bars_share(found: Diagnosis, stages: Sequence[Stage]) -> float:
    """Height relative to a column in a window of 1080 points, with room for the labels.

    The viewer's letters keep their size whatever the size of the drawing.
    """
    return min((_POINTS * _height(found, stages) + _TITLE) / _COLUMN, _MOST)


def _height(found: Diagnosis, stages: Sequence[Stage]) -> float:
    assert found.path is not None
    return len(kinds_read(found.path.problem)) * _block_height(len(stages))


def _block_height(rows: int) -> float:
    return _HEAD + rows * _ROW + 1.5


def _bars_of(
    recording: Recording, index: rr.TimeColumn, found: Diagnosis, stages: Sequence[Stage],
    kind: Kind, top: float,
) -> None:  # fmt: skip
    """A block: bars of one kind of reading, from half the noise to the error on test runs."""
    values = np.array([kind.factor * (s.held_out.rms[kind.key] or 0.0) for s in stages])
    floor = kind.factor * (found.floor.get(kind.key) or 0.0)
    ends = _bar_ends(values, values, floor)
    rows = top + _HEAD + _ROW * (np.arange(len(stages)) + 0.5)
    lit = np.array([_lit(stage, found) for stage in stages], dtype=np.uint8)
    root = f"{_BARS}/{kind.name}"
    strips = [np.array([[_LEFT, y], [x, y]]) for x, y in zip(ends, rows, strict=True)]
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
    recording.labels(f"{root}/names", [(0.5 * _LEFT, y) for y in above], names)
    recording.labels(f"{root}/numbers", np.stack([ends + 8.0, above], axis=1), numbers)
    title = f"{kind.name} [{kind.unit}], noise {short(floor)}"
    place = (0.5 * (_LEFT + _RIGHT), top + 0.55 * _HEAD - _LABEL)
    recording.labels(f"{root}/title", [place], [title])


def _bar_ends(values: np.ndarray, every: np.ndarray, floor: float) -> np.ndarray:
    """Ends of the bars: logarithmic from half the noise, or linear without noise."""
    if floor <= 0.0:
        return _LEFT + (_RIGHT - _LEFT) * values / max(float(every.max()), 1e-300)
    low = np.log(0.5 * min(floor, float(every[every > 0].min(initial=floor))))
    high = np.log(max(float(every.max()), 2.0 * floor))
    part = (np.log(np.maximum(values, 1e-300)) - low) / (high - low)
    return np.asarray(_LEFT + (_RIGHT - _LEFT) * np.clip(part, 0.01, 1.0))


def _lit(stage: Stage, found: Diagnosis) -> Rgba:
    if not stage.added:
        calm = found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
        return colours.SILVER if calm else colours.VERMILION
    return colours.SKY
