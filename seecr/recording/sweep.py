"""The recording of a sweep: commands and equilibria, cables by tension, plots, lanes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from seecr.curves import alike, joined
from seecr.pose import Array
from seecr.recording import colours, layout, plots, shapes
from seecr.recording.colours import COMMAND, SEECR
from seecr.recording.legends import legend_of
from seecr.recording.scene import LEGEND, Scene, write_legend
from seecr.recording.shapes import States
from seecr.recording.stream import (
    Index,
    Recording,
    entity_of,
    opening,
    pose_index,
    recording_file,
    sweep_index,
)
from seecr.statics.solution import Solution

__all__ = ["write_sweep_recording"]

# Width of a plot, in points of a window of 1920 by 1080.
_WIDTH = 850.0
_LANES, _AWAY, _TURN, _PULL = "lanes", "plot/deviation", "plot/rotation", "plot/tension"
_TITLES = {_AWAY: "Deviation from the command [mm]", _TURN: "Rotation from the command [°]"}


def write_sweep_recording(solution: Solution, path: str | Path, commanded: bool = True) -> None:
    """Write a sweep for the Rerun viewer.

    Args:
        solution: of the sweep.
        path: the ``.rrd`` file.
        commanded: whether poses were commanded, and not lengths.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, name = solution.robot, f"{solution.robot.name} sweep"
    seen = np.concatenate([solution.command, solution.pose])
    top = colours.round_up(float(np.nanmax(solution.tensions, initial=0.0)))
    index = sweep_index(solution.command) if commanded else [pose_index(len(solution))]
    layouts = _blueprint(solution, seen, name, commanded, opening(index))
    with recording_file(path, name, layouts) as recording:
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
        _plots(recording, index, solution, commanded)


def _blueprint(
    solution: Solution, seen: Array, name: str, commanded: bool, timeline: tuple[str, float]
) -> rrb.Blueprint:
    robot = solution.robot
    share = layout.lanes_share(robot.n_cables)
    low, high = shapes.extent(robot, seen)
    scene = layout.scene_view(robot, low, high, name, 1.2 * layout.COLUMN_ASPECT / (0.87 - share))
    lanes = layout.lanes("Which cables pull, which are slack", _LANES)
    off = _off_command(solution) if commanded else {}
    size = (_WIDTH, 1000.0 / (len(off) + 1) - 55.0)
    drawn = [_component_view(_TITLES[root], root, parts, size) for root, parts in off.items()]
    drawn.append(_tension_view(solution, size))
    left = rrb.Vertical(scene, layout.legend(LEGEND), lanes, row_shares=[0.9 - share, 0.1, share])
    root = rrb.Horizontal(left, rrb.Vertical(*drawn), column_shares=[6, 5])
    return layout.blueprint(root, timeline=timeline)


def _off_command(solution: Solution) -> dict[str, dict[str, Array]]:
    """Deviations from the command by plot and name; no rotations where the platform never turns."""
    parts = plots.deviation(solution.pose, solution.command)
    moved = {name: parts.pop(name) for name in plots.TRANSLATIONS}
    return {_AWAY: moved, _TURN: parts} if solution.robot.turns else {_AWAY: moved}


def _component_view(
    title: str, root: str, parts: dict[str, Array], size: tuple[float, float]
) -> rrb.TimeSeriesView:
    curves = np.stack(list(parts.values()), axis=1)
    return layout.plot(title, [f"{root}/**"], legend_of([curves], list(parts), size))


def _tension_view(solution: Solution, size: tuple[float, float]) -> rrb.TimeSeriesView:
    """Tensions, one curve for those that coincide; lanes have the same colours."""
    names = solution.robot.cable_names
    said = _said(names, alike([solution.tensions]))
    legend = legend_of([solution.tensions], list(said.values()), size)
    title = "Tension [N]" + ("" if legend.fits else ", cables in the colours of their lanes")
    contents = [
        f"{_PULL}/{entity_of(names[k])}" for k in (said if legend.fits else range(len(names)))
    ]
    return layout.plot(title, contents, legend, listed=legend.fits)


def _said(names: Sequence[str], groups: list[list[int]]) -> dict[int, str]:
    """For the first cable of each group, the names of all of them."""
    return {group[0]: joined([names[k] for k in group]) for group in groups}


def _plots(recording: Recording, index: Index, solution: Solution, commanded: bool) -> None:
    off = _off_command(solution) if commanded else {}
    lines = [(root, *line) for root, parts in off.items() for line in parts.items()]
    for (root, name, values), colour in zip(lines, colours.SERIES, strict=False):
        entity = f"{root}/{entity_of(name)}"
        recording.scalars(entity, index, values)
        plots.as_line(recording, entity, name, colour, 1.5)
    known = np.asarray(np.isfinite(solution.pose).all(axis=1))
    nowhere = np.zeros(solution.slack.shape, dtype=bool)
    states = plots.lane_states(solution.slack, nowhere, known)
    names = solution.robot.cable_names
    said = _said(names, alike([solution.tensions]))
    for k, colour in enumerate(colours.cable_colours(solution.robot.n_cables)):
        entity = f"{_PULL}/{entity_of(names[k])}"
        recording.scalars(entity, index, solution.tensions[:, k])
        plots.as_line(recording, entity, said.get(k, names[k]), colour, 1.5)
        lane = f"{_LANES}/{entity_of(names[k])}"
        plots.lane(recording, lane, index, list(states[:, k]))
        plots.lane_style(recording, lane, colour)
