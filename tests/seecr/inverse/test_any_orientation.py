"""Positions alone are wanted: few cables hold no orientation of one's choice."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from seecr.cli import main
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.inverse.correction import correct
from seecr.pose import pose_difference

ROBOT = load_robot("planar_two_cable")
# Beside the middle the platform hangs askew, and no pulls of two cables hold it level.
ASIDE = np.array([0.12, 0.0, 0.05])


def wanted() -> np.ndarray:
    poses = np.tile(ROBOT.reference_pose, (2, 1))
    poses[0, :3] += ASIDE
    return poses


def test_a_position_that_is_held_askew_is_reached_if_no_orientation_is_wanted() -> None:
    """Of a wall plotter "0 of 1 pose reached", 0.15 mm off, for an orientation nobody asked for."""
    level = correct(ROBOT, wanted())
    assert not level.reached[0] and level.why_not[0]
    found = correct(ROBOT, wanted(), any_orientation=True)
    assert found.reached.all() and found.why_not == ("", "")
    rests = solve(ROBOT, found.commands)
    off = pose_difference(rests.pose, wanted())
    assert np.abs(off[:, :3]).max() < 1e-9
    assert np.linalg.norm(off[0, 3:]) > np.radians(0.1)


def test_what_no_orientation_holds_is_still_not_reached() -> None:
    poses = wanted()
    poses[0, 2] += 10.0  # above the exit points
    found = correct(ROBOT, poses, any_orientation=True)
    assert found.reached.tolist() == [False, True] and found.why_not[0]


@pytest.mark.parametrize("states", [False, True])
def test_a_list_of_positions_alone_wants_no_orientation(states: bool, tmp_path: Path) -> None:
    x, _y, z = wanted()[0, :3]
    head, row = ["cmd_x_m", "cmd_z_m"], [f"{x}", f"{z}"]
    if states:
        head, row = [*head, "cmd_ry_deg"], [*row, "0"]
    (tmp_path / "wanted.csv").write_text(f"{','.join(head)}\n{','.join(row)}\n")
    out = tmp_path / "out"
    result = CliRunner().invoke(
        main, ["correct", "planar_two_cable", str(tmp_path / "wanted.csv"), "--out", str(out)]
    )
    notes = json.loads((out / "correction.json").read_text())["notes"]
    assert result.exit_code == (3 if states else 0)
    assert any("turns as the balance demands" in note for note in notes) != states
