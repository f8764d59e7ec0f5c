"""The recording of one case of the suite: SEECR and MuJoCo at every pose, and one settling."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun.blueprint as rrb

from crosscheck.recording.material import Material, gather
from crosscheck.recording.panels import Panels
from crosscheck.recording.series import LANES, Series
from seecr.recording import layout, shapes
from seecr.recording.colours import COMMAND, MUJOCO, SEECR
from seecr.recording.scene import LEGEND, Scene, write_legend
from seecr.recording.stream import (
    Recording,
    opening,
    recording_file,
    settling_index,
)

if TYPE_CHECKING:
    from crosscheck.suite.results import CaseResult


def write_case_recording(result: CaseResult, path: str | Path) -> None:
    """Write the recording of a case: scene, plots, lanes, text, layout.

    Args:
        result: of :func:`crosscheck.suite.run.run_case`.
        path: the ``.rrd`` file, written through a temporary one.

    Raises:
        CrosscheckError: the file cannot be written.
    """
    material = gather(result)
    with recording_file(path, material.name, blueprint(material)) as recording:
        _draw_scene(recording, material)
        write_legend(recording, material.top)
        series = Series(recording, material)
        series.over_poses(material.index)
        panels = Panels(recording, material)
        panels.over_poses(material.index)
        if material.motion is not None:
            over_time = settling_index(material.motion.t_s)
            series.over_settling(over_time)
            panels.over_settling(over_time)


def blueprint(material: Material) -> rrb.Blueprint:
    """Scene, legend and lanes on the left, plots in the middle, text on the right."""
    low, high = shapes.extent(material.robot, material.seen)
    lanes = layout.lanes("Which cables pull, which are slack", LANES)
    share = layout.lanes_share(material.robot.n_cables + 1)
    high_part = 0.9 - share
    scene = layout.scene_view(
        material.robot, low, high, material.name, layout.COLUMN_ASPECT / (high_part - 0.03)
    )
    return layout.blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, layout.legend(LEGEND), lanes, row_shares=[high_part, 0.1, share]),
            rrb.Vertical(*Series.views(material), row_shares=Series.shares(material)),
            rrb.Vertical(
                layout.text("Read me", "text/read_me"),
                layout.text("Now", "text/now"),
                row_shares=[3.2, 2],
            ),
            column_shares=[5, 4, 2.6],
        ),
        playback_speed=material.playback_speed,
        timeline=opening(material.index),
    )


def _draw_scene(recording: Recording, material: Material) -> None:
    scene = Scene(recording, material.robot, material.seen, material.top)
    scene.surroundings()
    index = material.index
    scene.platform("command", index, material.command, COMMAND)
    scene.platform("seecr", index, material.seecr.pose, SEECR, solid=True)
    scene.platform("mujoco", index, material.mujoco.pose, MUJOCO)
    scene.cables("seecr", index, material.seecr)
    scene.cables("mujoco", index, material.mujoco)
    scene.anchors("mujoco", index, material.mujoco.pose, MUJOCO)
    if material.is_sweep:
        scene.path("command", material.command, COMMAND)
        scene.path("seecr", material.seecr.pose, SEECR)
    if material.motion is not None:
        _draw_settling(scene, material)


def _draw_settling(scene: Scene, material: Material) -> None:
    """MuJoCo's platform moves; the command and SEECR's answer stay where they are."""
    assert material.motion is not None
    begin, whole = settling_index(np.zeros(1)), settling_index(material.motion.t_s)
    i = material.watched
    scene.platform("command", begin, material.command[i : i + 1], COMMAND)
    scene.platform("seecr", begin, material.seecr.pose[i : i + 1], SEECR, solid=True)
    scene.platform("mujoco", whole, material.settling.pose, MUJOCO)
    scene.cables("mujoco", whole, material.settling)
    scene.anchors("mujoco", whole, material.settling.pose, MUJOCO)
