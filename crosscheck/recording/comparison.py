"""The recording of a comparison: the model compared with measurements, pose by pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun.blueprint as rrb

from crosscheck.comparison.quantities import channels
from crosscheck.fit.least_squares.problem import Kind
from crosscheck.recording import misfit, words
from crosscheck.recording.misfit import MEASURED, Misfit
from crosscheck.recording.words import plain
from seecr.recording import colours, layout, plots, shapes
from seecr.recording.legends import Legend, legend_of
from seecr.recording.scene import Scene
from seecr.recording.stream import Index, Recording, pose_index, recording_file
from seecr.units import in_unit, short

if TYPE_CHECKING:
    from crosscheck.comparison.result import Comparison

_MOST_LISTED, _MOST_WORST = 5, 6


def write_comparison_recording(found: Comparison, path: str | Path) -> None:
    """Write the recording of a comparison.

    Args:
        found: the comparison; if nothing could be compared, there is only text.
        path: the ``.rrd`` file, written through a temporary one.

    Raises:
        CrosscheckError: the file cannot be written.
    """
    problem = found.problem
    name = f"comparison of {problem.robot.name}, {problem.data.name}"
    if found.whiteness is None:
        root = rrb.Vertical(layout.text("Verdict", "text/verdict"))
        with recording_file(path, name, layout.blueprint(root)) as recording:
            _verdict(recording, found, None)
        return
    shown = Misfit(problem, found.state)
    with recording_file(path, name, _blueprint(found, shown, name)) as recording:
        top = colours.round_up(float(np.nanmax(found.state.prediction.tensions, initial=0.0)))
        scene = Scene(recording, problem.robot, shown.seen, top)
        scene.surroundings()
        _over_poses(recording, scene, found, shown)
        _verdict(recording, found, shown)


def _blueprint(found: Comparison, shown: Misfit, name: str) -> rrb.Blueprint:
    robot = found.problem.robot
    low, high = shapes.extent(robot, shown.seen)
    # half of a column of a window of 1920 by 1080 points
    size = (630.0, 445.0)
    root = rrb.Horizontal(
        layout.scene_view(robot, low, high, name, 0.76),
        rrb.Vertical(
            *misfit.map_views(shown),
            misfit.panels(shown, [_legend(found, kind, size) for kind in shown.kinds]),
            row_shares=[*[1.0] * len(shown.kinds), float(len(shown.kinds))],
        ),
        rrb.Vertical(
            layout.text("Verdict", "text/verdict"),
            layout.text("Now", "text/now"),
            row_shares=[2.4, 2.0],
        ),
        column_shares=[4.6, 3.8, 2.8],
    )
    return layout.blueprint(root)


def _over_poses(recording: Recording, scene: Scene, found: Comparison, shown: Misfit) -> None:
    """The measured poses one by one, with all errors visible at each."""
    n = found.problem.data.n_rows
    index, begin = pose_index(n), pose_index(1)
    misfit.arrows(recording, begin, shown, [found.state], scene.size)
    misfit.maps(recording, begin, shown, [found.state])
    misfit.cursor(recording, index, shown)
    measured = np.where(found.problem.use[:, None], shown.measured, np.nan)
    scene.platform("measured", index, measured, MEASURED)
    predicted = misfit.predicted_poses(found.state)
    states = misfit.states_of(found.state)
    predicted = np.where(states.known[:, None], predicted, np.nan)
    scene.platform("model", index, predicted, colours.SEECR, solid=True)
    scene.cables("model", index, states)
    for kind in shown.kinds:
        _plots(recording, index, found, kind)
    recording.texts("text/now", index, [_pose(found, k) for k in range(n)])


def _errors_of(found: Comparison, kind: Kind) -> tuple[np.ndarray, np.ndarray]:
    """(n, k) which readings of one kind count, and their errors, NaN for the others."""
    counted = found.problem.counted[:, kind.columns]
    return counted, np.where(counted, found.state.raw[:, kind.columns], np.nan) * kind.factor


def _short(name: str) -> str:
    """A reading's name in a plot whose title states its kind."""
    return name.removeprefix("tension of ").removeprefix("rotation ")


def _legend(found: Comparison, kind: Kind, size: tuple[float, float]) -> Legend:
    counted, raw = _errors_of(found, kind)
    read = np.flatnonzero(counted.any(axis=0))
    names = channels(found.problem)[0][kind.columns]
    return legend_of([raw[:, read]], [_short(names[k]) for k in read], size)


def _plots(recording: Recording, index: Index, found: Comparison, kind: Kind) -> None:
    """The errors of one kind, reading by reading, over the poses."""
    names, _units = channels(found.problem)
    counted, raw = _errors_of(found, kind)
    shades = colours.cable_colours(raw.shape[1])
    for k, (name, colour) in enumerate(zip(names[kind.columns], shades, strict=True)):
        if not counted[:, k].any():
            continue
        entity = f"plot/{kind.name}/reading_{k + 1}"
        starts = found.problem.experiment.commands.starts
        plots.line_by_runs(recording, entity, index, raw[:, k], starts, _short(name), colour, 1.5)


def _noise_words(found: Comparison) -> str:
    """Whether the errors are noise, as a headline."""
    if found.is_open:
        return "Noise, or something missing"
    return "Noise" if found.is_noise else "Not noise"


def _verdict(recording: Recording, found: Comparison, shown: Misfit | None) -> None:
    parts = [f"# {_noise_words(found)}\n{plain(found.sentence)}\n"]
    if found.terms:
        parts.append("Model: SEECR + " + ", ".join(map(plain, found.terms.names)) + ".\n")
    if shown is not None:
        rms = [(found.rms.get(kind.key), found.floor.get(kind.key)) for kind in shown.kinds]
        parts.append(words.errors(shown.kinds, rms, ("model", "noise")))
        parts.append(
            f"\n**Scene.** {misfit.misfit_words(shown)} Blue box and cables: the model; orange "
            "edges: what was measured.\n"
        )
        parts.append(_worst(found))
    if found.notes:
        lines = [f"- {plain(note)}" for note in found.notes[:_MOST_LISTED]]
        parts.append("\n".join(["## Notes", *lines]))
    recording.text("text/verdict", "\n".join(parts))


def _worst(found: Comparison) -> str:
    rows = [
        (str(row.row), str(row.line), plain(row.run), short(row.times_noise))
        for row in found.worst[:_MOST_WORST]
    ]
    return "## Worst poses\n" + words.table(rows, ("pose", "line", "run", "times the noise"))


def _pose(found: Comparison, k: int) -> str:
    data = found.problem.data
    head = words.row_heading(data, k)
    missing = [row.why for row in found.unsolved if row.row == k]
    if missing:
        return head + f"\nNo equilibrium to compare with: {plain(missing[0])}."
    if not found.problem.use[k]:
        return head + words.unused(data, k)
    names, units = channels(found.problem)
    rows = [
        (name, short(in_unit(unit)[0] * float(found.state.raw[k, c])), in_unit(unit)[1])
        for c, (name, unit) in enumerate(zip(names, units, strict=True))
        if found.problem.counted[k, c]
    ]
    rows.append(("moving", str(found.way.direction[k]), ""))
    return head + "\n" + words.table(rows, ("measured minus predicted", "", ""))
