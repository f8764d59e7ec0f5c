"""The recording of schemes of control: wanted poses, where the platform rests, what is believed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from seecr.controlled.result import Control, Controlled
from seecr.pose import Array
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, SERIES
from seecr.show.control import LEAST
from seecr.show.plots import legend_of
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import entity_of, opening, recording_file, sweep_index

_ERROR, _PULL = "plot/error", "plot/tension"


def write_control_recording(result: Control, path: str | Path) -> None:
    """Write a recording: the wanted platform, and where it rests under each scheme.

    With a single scheme also where its controller believes the platform, and what is read.
    """
    every = list(result.schemes.values())
    wanted, robot = every[0].solution.command, result.robot
    name, index = f"{robot.name} control", sweep_index(wanted)
    seen = np.concatenate([wanted, *(one.solution.pose for one in every)])
    pulls = np.concatenate([one.solution.tensions for one in every])
    top = colours.round_up(float(np.nanmax(pulls, initial=0.0)))
    size = 850.0, 445.0
    errors = {one.scheme: _off(one) for one in every}
    curves = np.stack(list(errors.values()), axis=1)
    shown = legend_of([curves], list(errors), size)
    views = [plots.plot("Position error, 10^… mm", [f"{_ERROR}/**"], shown)]
    last = every[-1].solution
    views.append(plots.tension_view([last.tensions], robot.cable_names, size, [_PULL]))
    left = layout.scene_and_lanes(robot, seen, name, "lanes", robot.n_cables, 1.2)
    root = rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[6, 5])
    opens = layout.blueprint(root, timeline=opening(index))
    shades = dict(zip(errors, SERIES * len(errors), strict=False))
    with recording_file(path, name, opens) as recording:
        scene = Scene(recording, robot, seen, top)
        scene.surroundings()
        scene.platform("wanted", index, wanted, COMMAND)
        for one in every:
            entity = entity_of(one.scheme)
            scene.platform(entity, index, one.solution.pose, shades[one.scheme], solid=True)
            recording.scalars(f"{_ERROR}/{entity}", index, errors[one.scheme])
            plots.as_line(recording, f"{_ERROR}/{entity}", one.scheme, shades[one.scheme], 1.5)
        who = {"wanted": COMMAND, **dict(list(shades.items())[:2])}
        if len(every) == 1:
            for which, poses, shade in (
                ("believed", every[0].believed, SERIES[2]), ("read", every[0].read, SERIES[4]),
            ):  # fmt: skip
                scene.platform(which, index, poses, shade)
            who = {"wanted": COMMAND, "believed": SERIES[2], "read": SERIES[4]}
        states = States(last.pose, last.tensions, last.rest_lengths, last.slack)
        scene.cables(entity_of(every[-1].scheme), index, states)
        write_legend(recording, top, who)
        _cables(recording, index, every[-1], size)


def _off(one: Controlled) -> Array:
    """Decimal logarithms (n,) of the distances [mm] from the wanted positions."""
    off = 1e3 * np.linalg.norm(one.solution.deviation[:, :3], axis=1)
    return np.asarray(np.log10(np.maximum(off, LEAST)))


def _cables(recording: Any, index: Any, one: Controlled, size: tuple[float, float]) -> None:
    """Tensions and lanes of a scheme's cables."""
    found, names = one.solution, one.solution.robot.cable_names
    said, _legend = plots.curves_of_cables([found.tensions], names, size)
    for k, colour in enumerate(colours.cable_colours(len(names))):
        entity = f"{_PULL}/{entity_of(names[k])}"
        recording.scalars(entity, index, found.tensions[:, k])
        plots.as_line(recording, entity, said.get(k, names[k]), colour, 1.5)
    states = plots.lane_states(found.slack, found.slack & False, one.rests)
    plots.write_lanes(recording, "lanes", index, names, states)
