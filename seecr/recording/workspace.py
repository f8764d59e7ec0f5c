"""The recording of a workspace: the poses that can be held as points, coloured by their margin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from seecr.maps import Workspace
from seecr.recording import colours, layout, shapes
from seecr.recording.scene import LEGEND, ROOT, Scene, write_scale
from seecr.recording.stream import recording_file

__all__ = ["write_map_recording"]

# More points than these no viewer turns smoothly.
_MOST = 200_000


def write_map_recording(found: Workspace, path: str | Path) -> None:
    """Write the robot and the places at which its platform can be held.

    Args:
        found: the workspace.
        path: the ``.rrd`` file.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, name = found.robot, f"{found.robot.name} workspace"
    places = np.stack(np.meshgrid(*found.axes, indexing="ij"), axis=-1)[found.feasible]
    margins = found.margin[found.feasible]
    every = 1 + len(places) // _MOST
    places, margins = places[::every], margins[::every]
    finite = margins[np.isfinite(margins)]
    top = colours.round_up(float(np.quantile(finite, 0.95)) if len(finite) else 1.0)
    corners = np.tile(robot.reference_pose, (2, 1))
    corners[:, :3] = [[axis[end] for axis in found.axes] for end in (0, -1)]
    low, high = shapes.extent(robot, corners)
    view = layout.scene_view(robot, low, high, name, 1.9)
    root = rrb.Vertical(view, layout.legend(LEGEND), row_shares=[0.9, 0.1])
    with recording_file(path, name, layout.blueprint(root)) as recording:
        scene = Scene(recording, robot, corners, top)
        scene.surroundings()
        scene.axes()
        write_scale(recording, top, "tensions can stay so far inside their limits")
        points = rr.Points3D(
            places,
            radii=0.004 * scene.size,
            colors=colours.scale_colours(np.minimum(margins, top), top),
        )
        recording.always(f"{ROOT}/held", points)
