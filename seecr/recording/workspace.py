"""The recording of a workspace: the poses that can be held as points, coloured by their margin.

With an elastic map, further tabs show where the platform comes to rest.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from seecr.pose import Array
from seecr.recording import colours, layout, shapes
from seecr.recording.elastic import HIDDEN, Elastic
from seecr.recording.scene import LEGEND, ROOT, Scene, write_scale
from seecr.recording.stream import POSE, recording_file
from seecr.workspace.grid import Workspace

__all__ = ["write_map_recording"]

# Viewers do not turn more points than these smoothly.
_MOST = 200_000
# A pose is unsure if the probability that it can be held is between these.
_SURELY_NOT, _SURELY = 0.05, 0.95


def write_map_recording(found: Workspace, path: str | Path, edge: Array | None = None) -> None:
    """Write the robot and the positions at which its platform can be held.

    Args:
        found: the workspace.
        path: the ``.rrd`` file.
        edge: (k, 7) poses at the edge of the workspace.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, name = found.robot, f"{found.robot.name} workspace"
    places = found.places[found.feasible]
    margins = found.margin[found.feasible]
    step = 1 + len(places) // _MOST
    places, margins = places[::step], margins[::step]
    finite = margins[np.isfinite(margins)]
    top = colours.round_up(float(np.quantile(finite, 0.95)) if len(finite) else 1.0)
    corners = np.tile(robot.reference_pose, (2, 1))
    every = found.places.reshape(-1, 3)
    corners[:, :3] = every.min(axis=0), every.max(axis=0)
    low, high = shapes.extent(robot, corners)
    contents = ("$origin/**", f"- /{HIDDEN}")
    view = layout.scene_view(robot, low, high, name, 1.9, contents)
    held = rrb.Vertical(view, layout.legend(LEGEND), row_shares=[0.9, 0.1], name="Can be held")
    elastic = Elastic(found) if np.any(found.rests) else None
    root = held if elastic is None else rrb.Tabs(held, *elastic.tabs(low, high))
    opens = (POSE, 1.0) if elastic is None else elastic.opening
    with recording_file(path, name, layout.blueprint(root, timeline=opens)) as recording:
        scene = Scene(recording, robot, corners, top)
        scene.surroundings()
        scene.axes()
        words = "how far inside their limits all tensions can stay"
        more = "" if found.chance is None else "; red: the model is not certain"
        write_scale(recording, top, words + more)
        points = rr.Points3D(
            places,
            radii=0.004 * scene.size,
            colors=colours.scale_colours(np.minimum(margins, top), top),
        )
        recording.always(f"{ROOT}/held", points)
        if found.chance is not None:
            recording.always(f"{ROOT}/unsure", _unsure(found, 0.004 * scene.size))
        if edge is not None:
            some = edge[:: 1 + len(edge) // _MOST, :3]
            dots = rr.Points3D(some, radii=0.002 * scene.size, colors=colours.VERMILION)
            recording.always(f"{ROOT}/edge", dots)
        if elastic is not None:
            elastic.write(recording, scene)


def _unsure(found: Workspace, radius: float) -> rr.Points3D:
    """Positions for which the model leaves open whether they can be held."""
    assert found.chance is not None
    unsure = (found.chance > _SURELY_NOT) & (found.chance < _SURELY)
    places = found.places[unsure]
    every = 1 + len(places) // _MOST
    return rr.Points3D(places[::every], radii=1.5 * radius, colors=colours.VERMILION)
