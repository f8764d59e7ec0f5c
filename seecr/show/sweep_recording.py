"""Recordings of platforms over poses or time: of a sweep, and of schemes of control.

All have the same parts: platforms and the cables of one of them, plots, and a lane for each cable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, SEECR, Rgba
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import (
    Recording,
    entity_of,
    opening,
    pose_index,
    recording_file,
    sweep_index,
)
from seecr.statics.solution import Solution

_LANES = "lanes"
# Width of a plot, and height of all with their titles, in points of a window of 1920 by 1080.
_WIDTH, _HEIGHT, _TITLE = 850.0, 1000.0, 55.0


@dataclass(frozen=True, eq=False)
class MovingPlatform:
    """A platform as it is drawn: poses (n, 7), its colour, solid or its edges alone."""

    name: str
    poses: Array
    colour: Rgba
    solid: bool = False


@dataclass(frozen=True, eq=False)
class Curves:
    """A plot: its title, and curves (n,) by name, logged below ``root``."""

    root: str
    title: str
    values: Mapping[str, Array]

    @property
    def table(self) -> Array:
        """(n, k) all curves."""
        return np.stack(list(self.values.values()), axis=1)


def write_sweep_recording(solution: Solution, path: str | Path, commanded: bool = True) -> None:
    """Write a sweep, of commanded poses or of lengths, for the Rerun viewer.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, shown = solution.robot, [MovingPlatform("seecr", solution.pose, SEECR, solid=True)]
    curves: list[Curves] = []
    who = {"SEECR": SEECR}
    index = [pose_index(len(solution))]
    if commanded:
        shown.append(MovingPlatform("command", solution.command, COMMAND))
        who, index = {"command": COMMAND, **who}, sweep_index(solution.command)
        off = plots.deviation(solution.pose, solution.command)
        moved = {name: off.pop(name) for name in plots.TRANSLATIONS}
        curves.append(Curves("plot/deviation", "Deviation from the command [mm]", moved))
        if robot.turns:
            curves.append(Curves("plot/rotation", "Rotation from the command [°]", off))
    write_platforms(
        path, f"{robot.name} sweep", robot, index, shown, ("seecr", states_of_solution(solution)),
        curves, who,
    )  # fmt: skip


def states_of_solution(solution: Solution) -> States:
    """Poses and cables of all commands."""
    return States(solution.pose, solution.tensions, solution.rest_lengths, solution.slack)


def write_platforms(
    path: str | Path, name: str, robot: Robot, index: Sequence[rr.TimeColumn],
    platforms: Sequence[MovingPlatform], cables: tuple[str, States], curves: Sequence[Curves],
    who: Mapping[str, Rgba], known: NDArray[np.bool_] | None = None,
) -> None:  # fmt: skip
    """Write a recording of platforms over timelines.

    Args:
        path: of the recording. name: in the viewer. robot: whose platforms these are.
        index: timelines over n poses or instants; it opens with the last one.
        platforms: n poses of each. cables: of which platform, and their states.
        curves: plots; the cables' tensions come below them.
        who: names and colours of the legend.
        known: (n,) where lanes say taut or slack; where there is a pose by default.

    Raises:
        InputFileError: the file cannot be written.
    """
    owner, states = cables
    pulls = dict(zip(robot.cable_names, states.tensions.T, strict=True))
    every = [*curves, Curves("plot/tension", "Tension [N]", pulls)]
    size = _WIDTH, _HEIGHT / len(every) - _TITLE
    seen = np.concatenate([one.poses for one in platforms])
    top = colours.round_up(float(np.nanmax(states.tensions, initial=0.0)))
    left = layout.scene_and_lanes(robot, seen, name, _LANES, robot.n_cables, 1.2)
    views = [_view(one, robot.cable_names, size) for one in every]
    root = rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[6, 5])
    opens = layout.blueprint(root, timeline=opening(index))
    with recording_file(path, name, opens) as recording:
        scene = Scene(recording, robot, seen, top)
        scene.surroundings()
        for one in platforms:
            scene.platform(entity_of(one.name), index, one.poses, one.colour, solid=one.solid)
        scene.cables(entity_of(owner), index, states)
        write_legend(recording, top, who)
        for plot in every:
            _draw(recording, index, plot, size)
        words = plots.lane_states(
            states.slack, states.slack & False, states.known if known is None else known
        )
        plots.write_lanes(recording, _LANES, index, robot.cable_names, words)


def _view(plot: Curves, cables: Sequence[str], size: tuple[float, float]) -> rrb.TimeSeriesView:
    """A plot with its legend; that of cables is left out where it has no room."""
    names = list(plot.values)
    if set(names) <= set(cables):
        return plots.cables_view(plot.title, [plot.table], names, size, [plot.root])
    said, legend = plots.merged_curves([plot.table], names, size)
    return plots.plot(plot.title, [f"{plot.root}/{entity_of(names[k])}" for k in said], legend)


def _draw(
    recording: Recording, index: Sequence[rr.TimeColumn], plot: Curves, size: tuple[float, float]
) -> None:
    """Each curve in its colour; one that coincides with others has all their names."""
    names = list(plot.values)
    said, _legend = plots.merged_curves([plot.table], names, size)
    for k, shade in enumerate(colours.cable_colours(len(names))):
        entity = f"{plot.root}/{entity_of(names[k])}"
        recording.scalars(entity, index, plot.values[names[k]])
        plots.as_line(recording, entity, said.get(k, names[k]), shade, 1.5)
