"""A robot that is a bar on two cables: its equilibria, against the elastic solve and itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.description.shipped import model_path
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.planar import bar_equilibria
from seecr.pose import transform_points
from seecr.workspace.bars import bar_balances
from seecr.workspace.zones import balance_equations

BAR = load_robot(model_path("planar_two_cable"))


def flipped(robot: Robot) -> Robot:
    """Its cables in the other order: the same robot."""
    order = np.array([1, 0])
    return replace(
        robot, exit_points=robot.exit_points[order], anchor_points=robot.anchor_points[order],
        ea=robot.ea[order], rest_lengths=robot.rest_lengths[order], cable_names=(),
    )  # fmt: skip


@pytest.mark.parametrize("place", [(0.3, 0.5), (0.2, 0.3), (0.5, 0.8), (0.75, 0.6)])
@pytest.mark.parametrize("robot", [BAR, flipped(BAR)], ids=["as shipped", "flipped"])
def test_where_it_rests_one_of_them_is_its_pose(robot: Robot, place: tuple[float, float]) -> None:
    found = solve(robot, [place[0], 0.0, place[1], 1, 0, 0, 0])
    rests = bar_balances(robot, found.pose[0])
    assert rests is not None and found.converged[0]
    (here,) = [one for one in rests if one.here]
    assert here.stable and here.tensions == pytest.approx(found.tensions[0], abs=1e-9)
    assert here.pose == pytest.approx(found.pose[0], abs=1e-9)
    assert "as it rests here" in str(here)


@pytest.mark.parametrize("place", [(0.3, 0.5), (0.15, 0.93)])
def test_they_are_all_tilts_of_the_closed_form_and_balance_the_weight(
    place: tuple[float, float],
) -> None:
    pose = np.array([place[0], 0.0, place[1], 1, 0, 0, 0])
    rests = bar_balances(BAR, pose)
    by_hand = bar_equilibria(BAR.exit_points[:, [0, 2]], place, 0.1)
    assert rests is not None and len(rests) == len(by_hand) >= 2
    for one, plain in zip(rests, by_hand, strict=True):
        assert (one.theta, one.stable) == (plain.theta, plain.stable)
        matrix, load = balance_equations(BAR, one.pose[None])
        assert matrix[0] @ one.tensions == pytest.approx(load[0], abs=1e-8)
        ends = transform_points(one.pose[None], BAR.anchor_points)[0]
        assert ends.mean(axis=0) == pytest.approx(pose[:3], abs=1e-12)
        assert np.arctan2(*(ends[1] - ends[0])[[2, 0]]) == pytest.approx(one.theta, abs=1e-9)
        assert ("not stable" in str(one)) == (not one.stable)
    assert not any(one.here for one in rests)


def test_other_robots_are_no_bars() -> None:
    pose = BAR.reference_pose
    heavy_end = replace(BAR, centre_of_mass=np.array([0.01, 0.0, 0.0]))
    lifted = replace(BAR, centre_of_mass=np.array([0.0, 0.0, 0.01]))
    free = replace(BAR, joints=())
    still = replace(BAR, gravity=np.zeros(3))
    sideways = replace(BAR, gravity=np.array([0.0, -9.81, 0.0]))
    on_rail = replace(BAR, joints=BAR.joints[:1] + BAR.joints[2:])
    for other in (heavy_end, lifted, free, still, sideways, on_rail):
        assert bar_balances(other, pose) is None
    vertical = load_robot(model_path("planar_vertical"))
    assert bar_balances(vertical, vertical.reference_pose) is None
    with pytest.raises(InputError, match="needs one pose"):
        bar_balances(BAR, np.tile(pose, (2, 1)))
