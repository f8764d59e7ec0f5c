"""Legends that cover no curve, names of cables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from recordings import Readback
from slab import slides

from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.show.colours import alike, joined
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import cable_labels, extent
from seecr.show.sweep_recording import write_sweep_recording

SIZE = (600.0, 200.0)
RIGHT_TOP, LEFT_TOP = rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop
RIGHT_BOTTOM, LEFT_BOTTOM = rrb.Corner2D.RightBottom, rrb.Corner2D.LeftBottom
# So wide a part at either end, and so high a part, is surely the legend's of two short names.
WIDE, TALL = 0.08, 0.2


def curves(*ends: tuple[float, float]) -> np.ndarray:
    """Straight lines over 50 times from their first values to their last ones."""
    return np.stack([np.linspace(*pair, 50) for pair in ends], axis=1)


@pytest.mark.parametrize(
    ("ends", "corner"),
    [
        (((0.0, 1.0), (0.0, 0.0)), LEFT_TOP),
        (((1.0, 0.0), (0.0, 0.0)), RIGHT_TOP),
        (((1.0, 1.0), (1.0, 0.0)), LEFT_BOTTOM),
        (((1.0, 1.0), (0.0, 1.0)), RIGHT_BOTTOM),
    ],
)
def test_a_corner_that_is_free_is_the_legends(
    ends: tuple[tuple[float, float], ...], corner: rrb.Corner2D
) -> None:
    assert legend_of([curves(*ends)], ["a", "b"], SIZE) == Legend(corner)


def test_where_no_corner_is_free_the_axis_is_longer() -> None:
    both = curves((0.0, 1.0), (1.0, 0.0))
    found = legend_of([both], ["dx", "dy"], SIZE)
    assert found.fits and found.values is not None
    low, high = found.values
    assert low < 0.0 and high > 1.0 and high - low < 2.5
    top = found.corner in (RIGHT_TOP, LEFT_TOP)
    free = high - 1.0 if top else -low
    assert free > TALL * (high - low), "as high as the legend is"


def test_a_legend_of_many_says_that_it_does_not_fit() -> None:
    both = curves((0.0, 1.0), (1.0, 0.0))
    assert not legend_of([both], [f"cable{k}" for k in range(8)], SIZE).fits
    assert legend_of([both * np.nan], ["a"], SIZE) == Legend()


def test_all_timelines_have_room_on_one_axis() -> None:
    rising, high = curves((0.0, 1.0)), curves((9.0, 9.0))
    found = legend_of([rising, high], ["a"], SIZE)
    assert found.values is not None and found.values[0] < 0.0 and found.values[1] > 9.0
    assert found.corner in (LEFT_BOTTOM, RIGHT_BOTTOM) or found.values[1] > 10.0


def test_cables_that_leave_side_by_side_have_one_label_and_those_in_front_stand_above() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    low, high = extent(robot, robot.reference_pose[None])
    places, names = cable_labels(robot, low, high)
    assert names == ["cable1, 2", "cable3, 4", "cable5, 6", "cable7, 8"]
    lifted = places[:, 2] > robot.exit_points[:, 2].max() + 0.02
    assert lifted.sum() == 2
    assert np.ptp(places[lifted][:, 1]) < 0.1 < np.ptp(places[:, 1])
    apart = replace(robot, exit_points=3.0 * robot.exit_points)
    assert len(cable_labels(apart, low, high)[1]) > 4


def test_curves_that_lie_on_each_other_have_one_name() -> None:
    one = curves((0.0, 1.0), (2.0, 3.0), (0.0, 1.0))
    assert alike([one]) == [[0, 2], [1]]
    assert alike([one, curves((0.0, 1.0), (2.0, 3.0), (0.0, 2.0))]) == [[0], [1], [2]]
    assert joined(["cable1", "cable3"]) == "cable1, 3"
    assert joined(["left", "right"]) == "left, right"
    assert joined(["a1", "b1"]) == "a1, b1" and joined(["rope"]) == "rope"


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
