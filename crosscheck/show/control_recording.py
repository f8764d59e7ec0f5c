"""The recording of a scheme of control in MuJoCo: wanted, believed, true and read platform."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from crosscheck.controlled.result import TimedScheme
from crosscheck.show.control import away_mm
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, MUJOCO, SERIES
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import SETTLING, entity_of, recording_file, settling_index

_AWAY, _PULL, _TURN = "plot/error", "plot/tension", "plot/winches"
_MOST = 4000  # instants that a recording shows


def write_timed_recording(one: TimedScheme, path: str | Path) -> None:
    """Write what happened under a scheme for the Rerun viewer, over time."""
    found, trace = one.rest.solution, one.trace
    robot, some = found.robot, slice(None, None, max(1, len(trace.t) // _MOST))
    row = trace.row[some]
    wanted, believed = found.command[row], one.rest.believed[row]
    poses, pulls, turned = trace.pose[some], trace.tensions[some], trace.paid[some]
    index, name = settling_index(trace.t[some]), f"{robot.name} {one.rest.scheme}"
    seen, size = np.concatenate([wanted, poses]), (850.0, 290.0)
    top = colours.round_up(float(np.nanmax(pulls, initial=0.0)))
    away = np.log10(np.maximum(away_mm(one)[some], 1e-5))
    curves = 1e3 * (turned - robot.rest_lengths)
    views = [
        plots.plot("From the wanted position, 10^… mm", [_AWAY], plots.Legend()),
        plots.tension_view([pulls], robot.cable_names, size, [_PULL]),
        plots.plot("Winches from home [mm]", [f"{_TURN}/**"], plots.Legend(), listed=False),
    ]
    left = layout.scene_and_lanes(robot, seen, name, "lanes", robot.n_cables, 1.2)
    root = rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[6, 5])
    opens = layout.blueprint(root, timeline=(SETTLING, 1.0))
    with recording_file(path, name, opens) as recording:
        scene = Scene(recording, robot, seen, top)
        scene.surroundings()
        shown = (
            ("wanted", wanted, COMMAND, False), ("believed", believed, SERIES[2], False),
            ("read", trace.read[some], SERIES[4], False), ("mujoco", poses, MUJOCO, True),
        )  # fmt: skip
        for who, at, shade, solid in shown:
            scene.platform(who, index, at, shade, solid=solid)
        write_legend(recording, top, {"wanted": COMMAND, "read": SERIES[4], "true": MUJOCO})
        slack = pulls <= 0.0
        scene.cables("mujoco", index, States(poses, pulls, turned, slack))
        recording.scalars(_AWAY, index, away)
        for k, shade in enumerate(colours.cable_colours(robot.n_cables)):
            entity = entity_of(robot.cable_names[k])
            for place, values in ((_PULL, pulls), (_TURN, curves)):
                recording.scalars(f"{place}/{entity}", index, values[:, k])
                plots.as_line(recording, f"{place}/{entity}", robot.cable_names[k], shade, 1.2)
        known = np.asarray(np.isfinite(poses).all(axis=1))
        states = plots.lane_states(slack, slack & False, known)
        plots.write_lanes(recording, "lanes", index, robot.cable_names, states)
