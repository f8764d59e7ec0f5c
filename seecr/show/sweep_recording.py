"""The recording of a sweep: commands and equilibria, cables by tension, plots, lanes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from seecr.pose import Array
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, SEECR
from seecr.show.plots import legend_of
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import (
    Index,
    Recording,
    entity_of,
    opening,
    pose_index,
    recording_file,
    sweep_index,
)
from seecr.statics.solution import Solution

# Width of a plot, in points of a window of 1920 by 1080.
_WIDTH = 850.0
_LANES, _AWAY, _TURN, _PULL = "lanes", "plot/deviation", "plot/rotation", "plot/tension"
_TITLES = {_AWAY: "Deviation from the command [mm]", _TURN: "Rotation from the command [°]"}


def write_sweep_recording(solution: Solution, path: str | Path, commanded: bool = True) -> None:
    """Write a sweep, of commanded poses or of lengths, for the Rerun viewer.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, name = solution.robot, f"{solution.robot.name} sweep"
    seen = np.concatenate([solution.command, solution.pose])
    top = colours.round_up(float(np.nanmax(solution.tensions, initial=0.0)))
    index = sweep_index(solution.command) if commanded else [pose_index(len(solution))]
    off = _off_command(solution) if commanded else {}
    size = _WIDTH, 1000.0 / (1 + len(off)) - 55.0
    views = [_component_view(root, parts, size) for root, parts in off.items()]
    views.append(plots.tension_view([solution.tensions], robot.cable_names, size, [_PULL]))
    left = layout.scene_and_lanes(robot, seen, name, _LANES, robot.n_cables, 1.2)
    root = rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[6, 5])
    opens = layout.blueprint(root, timeline=opening(index))
    with recording_file(path, name, opens) as recording:
        scene = Scene(recording, robot, seen, top)
        scene.surroundings()
        scene.platform("seecr", index, solution.pose, SEECR, solid=True)
        states = States(solution.pose, solution.tensions, solution.rest_lengths, solution.slack)
        scene.cables("seecr", index, states)
        who = {"SEECR": SEECR}
        if commanded:
            scene.platform("command", index, solution.command, COMMAND)
            who = {"command": COMMAND, **who}
        write_legend(recording, top, who)
        _plots(recording, index, solution, off, size)


def _off_command(solution: Solution) -> dict[str, dict[str, Array]]:
    """Deviations from the command by plot and name; no rotations where the platform never turns."""
    parts = plots.deviation(solution.pose, solution.command)
    moved = {name: parts.pop(name) for name in plots.TRANSLATIONS}
    return {_AWAY: moved, _TURN: parts} if solution.robot.turns else {_AWAY: moved}


def _component_view(
    root: str, parts: dict[str, Array], size: tuple[float, float]
) -> rrb.TimeSeriesView:
    curves = np.stack(list(parts.values()), axis=1)
    return plots.plot(_TITLES[root], [f"{root}/**"], legend_of([curves], list(parts), size))


def _plots(
    recording: Recording, index: Index, solution: Solution, off: dict[str, dict[str, Array]],
    size: tuple[float, float],
) -> None:  # fmt: skip
    lines = [(root, *line) for root, parts in off.items() for line in parts.items()]
    for (root, name, values), colour in zip(lines, colours.SERIES, strict=False):
        entity = f"{root}/{entity_of(name)}"
        recording.scalars(entity, index, values)
        plots.as_line(recording, entity, name, colour, 1.5)
    names = solution.robot.cable_names
    said, _legend = plots.curves_of_cables([solution.tensions], names, size)
    for k, colour in enumerate(colours.cable_colours(len(names))):
        entity = f"{_PULL}/{entity_of(names[k])}"
        recording.scalars(entity, index, solution.tensions[:, k])
        plots.as_line(recording, entity, said.get(k, names[k]), colour, 1.5)
    known = np.asarray(np.isfinite(solution.pose).all(axis=1))
    states = plots.lane_states(solution.slack, solution.slack & False, known)
    plots.write_lanes(recording, _LANES, index, names, states)
