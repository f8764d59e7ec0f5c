"""The recording of a diagnosis: its timeline steps through the models, effect by effect.

The timeline ``model_step`` shows every pose's error under one model after the other. The timeline
``pose`` goes through the measured poses: as measured, under the first model and under the last.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.least_squares.problem import Kind
from crosscheck.recording import bars, misfit
from crosscheck.recording.diagnosis_words import model_words, pose_words, verdict_words
from crosscheck.recording.misfit import MEASURED, Misfit
from seecr.recording import colours, layout, plots, shapes
from seecr.recording.legends import Legend, legend_of
from seecr.recording.scene import Scene
from seecr.recording.stream import MODEL_STEP, Recording, pose_index, recording_file

_STEPS_A_SECOND = 1.0
# Size of the plot, in points of a window of 1920 by 1080.
_PLOT = (820.0, 250.0)
_BETWEEN = (colours.YELLOW, colours.PINK, colours.GREEN, colours.SILVER)


def write_diagnosis_recording(found: Diagnosis, path: str | Path) -> None:
    """Write the recording of a diagnosis.

    Args:
        found: the diagnosis; without a search (no verdict) there is only text.
        path: the ``.rrd`` file, written through a temporary one.

    Raises:
        CrosscheckError: the file cannot be written.
    """
    if found.path is None:
        _write_words(found, path)
        return
    stages = list(found.path.stages)
    shown = Misfit(found.path.problem, stages[0].state)
    with recording_file(path, _name(found), _blueprint(found, stages, shown)) as recording:
        scene = Scene(recording, shown.problem.robot, shown.seen, _top_tension(stages))
        scene.surroundings()
        _over_steps(recording, scene, found, stages, shown)
        _over_poses(recording, scene, stages, shown)
        recording.text("text/verdict", verdict_words(found, shown))


def _name(found: Diagnosis) -> str:
    assert found.path is not None
    problem = found.path.problem
    return f"diagnosis of {problem.robot.name}, {problem.data.name}"


def _write_words(found: Diagnosis, path: str | Path) -> None:
    root = rrb.Vertical(layout.text("Verdict", "text/verdict"))
    with recording_file(path, "diagnosis", layout.blueprint(root)) as recording:
        recording.text("text/verdict", verdict_words(found, None))


def _top_tension(stages: list[Stage]) -> float:
    tensions = [stage.state.prediction.tensions for stage in (stages[0], stages[-1])]
    return colours.round_up(float(np.nanmax(tensions, initial=0.0)))


def _blueprint(found: Diagnosis, stages: list[Stage], shown: Misfit) -> rrb.Blueprint:
    low, high = shapes.extent(shown.problem.robot, shown.seen)
    robot = shown.problem.robot
    low_part = bars.share(found, stages)
    middle = [*misfit.map_views(shown), bars.view(found, stages)]
    root = rrb.Horizontal(
        rrb.Vertical(
            layout.scene_view(robot, low, high, _name(found), 1.22),
            misfit.panels(shown, [_legend(stages, shown, kind) for kind in shown.kinds]),
            row_shares=[3.0, 1.3],
        ),
        rrb.Vertical(
            *middle,
            row_shares=[*[(1.0 - low_part) / len(shown.kinds)] * len(shown.kinds), low_part],
        ),
        rrb.Vertical(
            layout.text("Verdict", "text/verdict"),
            layout.text("Now", "text/now"),
            row_shares=[1.6, 2.0],
        ),
        column_shares=[5.0, 3.6, 2.8],
    )
    return layout.blueprint(root, timeline=(MODEL_STEP, 1.0), poses_a_second=_STEPS_A_SECOND)


def _over_steps(
    recording: Recording, scene: Scene, found: Diagnosis, stages: list[Stage], shown: Misfit
) -> None:
    """Everything that changes from model to model."""
    index = rr.TimeColumn(MODEL_STEP, sequence=range(len(stages)))
    states = [stage.state for stage in stages]
    misfit.arrows(recording, index, shown, states, scene.size)
    misfit.maps(recording, index, shown, states)
    bars.write_bars(recording, index, found, stages)
    worst = misfit.worst_row(shown)
    count = len(stages)
    measured = np.tile(shown.measured[worst], (count, 1))
    scene.platform("measured", index, measured, MEASURED)
    predicted = np.stack([misfit.predicted_poses(state)[worst] for state in states])
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, misfit.stacked([(state, worst) for state in states]))
    texts = [model_words(found, stages, k, shown, worst) for k in range(count)]
    recording.texts("text/now", index, texts)


def _over_poses(recording: Recording, scene: Scene, stages: list[Stage], shown: Misfit) -> None:
    """The measured poses one by one, under the first and the last model."""
    n = shown.problem.data.n_rows
    index = pose_index(n)
    last = stages[-1].state
    measured = np.where(shown.problem.use[:, None], shown.measured, np.nan)
    scene.platform("measured", index, measured, MEASURED)
    scene.platform("model", index, misfit.predicted_poses(last), colours.SEECR, solid=True)
    scene.cables("model", index, misfit.states_of(last))
    if len(stages) > 1:
        scene.platform("first", index, misfit.predicted_poses(shown.first), colours.PINK)
    misfit.maps(recording, pose_index(1), shown, [shown.first])
    misfit.cursor(recording, index, shown)
    for kind in shown.kinds:
        _plots(recording, index, stages, shown, kind)
    recording.texts("text/now", index, [pose_words(stages, shown, k) for k in range(n)])


def _plots(
    recording: Recording, index: rr.TimeColumn, stages: list[Stage], shown: Misfit, kind: Kind
) -> None:
    """The error of each pose under each model; over the steps, that on all held-out runs."""
    for k, stage in enumerate(stages):
        entity = f"plot/{kind.name}/model_{k}"
        sizes = kind.sizes(shown.problem, stage.state.raw) * kind.factor
        shade = colours.VERMILION if k == 0 else _BETWEEN[(k - 1) % len(_BETWEEN)]
        shade = colours.SKY if 0 < k == len(stages) - 1 else shade
        starts = shown.problem.experiment.commands.starts
        plots.line_by_runs(recording, entity, index, sizes, starts, stage.label, shade, 1.5)
    entity = f"plot/{kind.name}/left_out"
    steps = rr.TimeColumn(MODEL_STEP, sequence=range(len(stages)))
    rms = [kind.factor * (stage.held_out.rms[kind.key] or 0.0) for stage in stages]
    recording.scalars(entity, steps, rms)
    plots.as_line(recording, entity, "rms on held-out runs", colours.SILVER, 2.0)


def _legend(stages: list[Stage], shown: Misfit, kind: Kind) -> Legend:
    """Its corner only: a longer axis would leave little room for the one curve over the steps."""
    sizes = [kind.sizes(shown.problem, stage.state.raw) * kind.factor for stage in stages]
    legend = legend_of([np.stack(sizes, axis=1)], [stage.label for stage in stages], _PLOT)
    return replace(legend, values=None)
