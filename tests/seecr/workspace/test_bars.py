"""A robot that is a bar on two cables: its equilibria, against the elastic solve and itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seecr.commands import Commands
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import transform_points
from seecr.workspace.bars import bar_balances, bar_manifold, midline_points
from seecr.workspace.margins import balance_equations
from seecr.workspace.planar import bar_equilibria, bar_tilt, midline_point

BAR = load_robot("planar_two_cable")


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


@pytest.mark.parametrize(("robot", "up"), [(BAR, 1.0), (flipped(BAR), -1.0)])
def test_it_rests_on_the_manifold_and_not_at_its_command(robot: Robot, up: float) -> None:
    """Tilts are upwards towards the second cable; beyond the exit points it hangs on one cable."""
    poses = np.tile(BAR.reference_pose, (5, 1))
    poses[:, 0], poses[:, 2] = [0.2, 0.35, 0.5, 0.65, 2.5], 0.5
    found = solve(robot, poses)
    met = bar_manifold(found)
    assert met is not None and found.converged.all() and found.slack[4].any()
    ends = transform_points(found.pose, BAR.anchor_points)
    along = ends[:, 1] - ends[:, 0]
    assert met.tilt == pytest.approx(up * np.arctan2(along[:, 2], along[:, 0]), abs=1e-12)
    assert met.there[:4] == pytest.approx(met.tilt[:4], abs=1e-9)
    closed = up * bar_tilt(BAR.exit_points[:, [0, 2]], poses[:, [0, 2]], 0.1)
    np.testing.assert_allclose(met.at_command, closed, atol=1e-12)
    assert met.there[4] == pytest.approx(met.tilt[4], abs=1e-9)  # the other one has no tension
    assert np.isnan(met.at_command[4]) and np.isfinite(closed[:4]).all()
    assert up * (met.tilt[0] - met.at_command[0]) > np.radians(10.0)


def test_of_lengths_no_tilt_at_a_command_is_told() -> None:
    """No pose was commanded, and the reference pose stood in for it."""
    lengths = Commands(BAR.reference_pose[None], lengths=np.array([[0.6, 0.7]]))
    met = bar_manifold(solve(BAR, lengths), commanded=False)
    assert met is not None and np.isnan(met.at_command).all() and np.isfinite(met.there).all()
    assert "commanded" not in str(met)


def test_off_the_manifold_it_is_said_by_how_much() -> None:
    found = solve(BAR, [0.3, 0.0, 0.5, 1, 0, 0, 0])
    aside = BAR.reference_pose - np.array([0.1, 0, 0, 0, 0, 0, 0])
    met = bar_manifold(replace(found, pose=aside[None]))
    assert met is not None and met.tilt[0] == 0.0
    off = np.degrees(abs(met.there[0]))
    assert f"on the manifold of its equilibria to within {off:.2g} deg" in str(met)


@pytest.mark.parametrize("tilt", [np.pi - 0.05, -2.5, 0.3])
def test_of_two_stable_tilts_the_nearer_one_counts_the_short_way_round(tilt: float) -> None:
    """Below a wide bar's exit points it may also hang upside down, with its cables crossed."""
    wide = replace(BAR, anchor_points=3.0 * BAR.anchor_points)
    stable = [r.theta for r in bar_equilibria(wide.exit_points[:, [0, 2]], (0.6, -0.2), 0.3)
              if r.stable]  # fmt: skip
    assert sorted(stable) == pytest.approx([-2.838, 0.746], abs=1e-3)
    found = solve(BAR, [0.3, 0.0, 0.5, 1, 0, 0, 0])
    turn = [np.cos(0.5 * tilt), 0.0, -np.sin(0.5 * tilt), 0.0]  # about -y: up towards +x
    posed = replace(found, robot=wide, pose=np.array([[0.6, 0.0, -0.2, *turn]]))
    met = bar_manifold(posed)
    assert met is not None and met.tilt[0] == pytest.approx(tilt)
    nearer = max(stable) if tilt == 0.3 else min(stable)
    assert met.there[0] == pytest.approx(nearer)
    off = np.degrees(abs(np.angle(np.exp(1j * (tilt - nearer)))))
    assert f"to within {off:.2g} deg" in str(met)


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
        assert bar_manifold(solve(other, pose)) is None
    vertical = load_robot("planar_vertical")
    assert bar_balances(vertical, vertical.reference_pose) is None
    with pytest.raises(InputError, match="needs one pose"):
        bar_balances(BAR, np.tile(pose, (2, 1)))


VERTICAL = load_robot("planar_vertical")
HORIZONTAL = load_robot("planar_horizontal")


def line(n: int) -> np.ndarray:
    poses = np.zeros((n, 7))
    poses[:, 0], poses[:, 2], poses[:, 3] = np.linspace(0.17, 0.63, n), 0.2, 1.0
    return poses


@pytest.mark.parametrize(("robot", "name"), [(VERTICAL, "V"), (HORIZONTAL, "H")])
def test_they_are_where_the_midlines_meet(robot: object, name: str) -> None:
    found = solve(robot, line(9))
    met = midline_points(found)
    assert met is not None and (met.name, met.axes) == (name, "xz")
    ends = transform_points(found.pose, found.robot.anchor_points)[..., [0, 2]]
    for k, point in enumerate(met.points):
        plain = midline_point(found.robot.exit_points[:, [0, 2]], ends[k])
        assert point[[0, 2]] == pytest.approx(plain, abs=1e-12) and point[1] == 0.0
        assert met.beside[k] == pytest.approx(point[0] - found.pose[k, 0], abs=1e-12)
    assert abs(met.beside[4]) < 1e-9
    assert (np.abs(met.beside).max() < 1e-9) == (name == "H")
    most = 1e3 * met.beside.max()
    far = f"; on the way it is between -{most:.2f} and +{most:.2f}" if name == "V" else ", +0.00"
    first, last = (f"x z {1e3 * x:.2f} {1e3 * z:.2f}" for x, _, z in met.points[[0, -1]])
    way = f"point {name} goes from {first} to {last} mm"
    assert str(met) == f"{way}{far} mm beside the line of the weight"
    (one,) = midline_points(solve(robot, line(1))).lines()
    assert one.startswith(f"point {name} is at {first} mm, ")


def test_a_centre_of_mass_that_is_off_counts() -> None:
    aside = replace(HORIZONTAL, centre_of_mass=np.array([0.004, 0.0, 0.0]))
    found = solve(aside, line(3))
    met = midline_points(found)
    assert met is not None
    centre = transform_points(found.pose, aside.centre_of_mass[None])[:, 0]
    assert met.beside == pytest.approx(met.points[:, 0] - centre[:, 0], abs=1e-12)
    assert np.abs(met.beside).max() > 1e-3


def test_other_robots_have_none() -> None:
    for name in ("demobot_parallel", "camera", "planar_two_cable"):
        robot = load_robot(name)
        assert midline_points(solve(robot, robot.reference_pose)) is None
    free = replace(VERTICAL, joints=())
    on_its_side = replace(VERTICAL, gravity=np.array([0.0, -9.81, 0.0]))
    askew = replace(VERTICAL, exit_points=VERTICAL.exit_points + np.eye(4, 3) * 1e-3)
    for other in (free, on_its_side, askew):
        assert midline_points(solve(other, VERTICAL.reference_pose)) is None
