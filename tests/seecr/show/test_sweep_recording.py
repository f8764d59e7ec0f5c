"""The recording of a sweep, read back: rotations are plotted where the platform can turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recordings import Readback
from slab import slides

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.show.sweep_recording import write_sweep_recording

AWAY, TURN, PULL = "Deviation from the command [mm]", "Rotation from the command [°]", "Tension [N]"


@pytest.mark.parametrize(
    ("robot", "views"),
    [(slides(), {AWAY, PULL}), (load_robot("planar_vertical"), {AWAY, TURN, PULL})],
    ids=["slides", "turns"],
)
def test_rotations_have_a_panel_where_the_platform_turns(
    robot: Robot, views: set[str], tmp_path: Path
) -> None:
    commands = np.tile(robot.reference_pose, (4, 1))
    commands[:, 0] += np.linspace(0.0, 0.06, 4)
    found = solve(robot, commands)
    assert found.converged.all()
    write_sweep_recording(found, tmp_path / "sweep.rrd")
    back = Readback(tmp_path / "sweep.rrd")
    assert {name.split(",")[0] for name in back.views} & {AWAY, TURN, PULL} == views
    drawn = {entity for entity in back.entities("pose") if entity.startswith("/plot/rotation")}
    assert len(drawn) == (4 if TURN in views else 0)
    np.testing.assert_allclose(
        back.scalars("/plot/deviation/dz"), 1e3 * found.deviation[:, 2], atol=1e-9
    )
