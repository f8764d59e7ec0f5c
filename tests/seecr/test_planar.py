"""The paper's planar systems: a bar on two cables, and four cables in two parallelograms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import transform_points
from seecr.statics.solution import Solution, Status
from seecr.workspace.margins import slack_zones
from seecr.workspace.planar import bar_equilibria, bar_tilt, midline_point, solution_manifold

EXITS = np.array([[0.0, 0.5], [1.0, 0.5]])
PLACE = np.array([0.3, 0.0])
IN_PLANE = [0, 2]  # x and z of the shipped robots are the paper's x and y


def planar(name: str, ea: float | None = None) -> Robot:
    robot = load_robot(f"planar_{name}")
    return robot if ea is None else replace(robot, ea=np.full(robot.n_cables, ea))


def level(x: np.ndarray, z: float) -> np.ndarray:
    return np.array([[value, 0, z, 1, 0, 0, 0] for value in x])


def tilt(answer: Solution) -> np.ndarray:
    """The paper's theta, from x to y upwards, of robots in the x-z plane [rad]."""
    assert np.all(answer.converged)
    return np.asarray(-answer.deviation[:, 4])


# --- closed form -------------------------------------------------------------------------------


def test_tilt_of_the_digests_example() -> None:
    assert np.rad2deg(bar_tilt(EXITS, PLACE)) == pytest.approx(-25.46334506187162, rel=1e-14)
    assert np.rad2deg(bar_tilt(EXITS, PLACE, 0.1)) == pytest.approx(-30.898736, abs=1e-6)
    assert round(float(np.rad2deg(bar_tilt(EXITS, PLACE))), 1) == -25.5
    assert round(float(np.rad2deg(bar_tilt(EXITS, PLACE, 0.1))), 1) == -30.9


@pytest.mark.parametrize("h", [1e-9, 1e-6, 0.01, 0.1, 0.3])
def test_the_root_is_exact_and_the_forces_really_balance(h: float) -> None:
    """Against tensions found from scratch: both positive, and no torque is left over."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        exits = np.array([rng.uniform([-1, 0.6], [-0.5, 1.5]), rng.uniform([0.5, 0.6], [1, 1.5])])
        place = rng.uniform([-0.4, -1], [0.4, 0.1])
        theta = float(bar_tilt(exits, place, h))
        ends = h * np.array([[-1.0], [1.0]]) * [np.cos(theta), np.sin(theta)]
        pulls = exits - (place + ends)
        tension = np.linalg.solve(pulls.T, [0.0, 1.0])  # over lengths; weight 1
        assert np.all(tension > 0)
        forces = pulls * tension[:, None]
        torque = np.sum(ends[:, 0] * forces[:, 1] - ends[:, 1] * forces[:, 0])
        assert abs(torque) < 1e-13 * h


def test_half_length_to_zero_is_the_closed_form() -> None:
    differences = [abs(float(bar_tilt(EXITS, PLACE, h) - bar_tilt(EXITS, PLACE))) for h in
                   (1e-2, 1e-4, 1e-6)]  # fmt: skip
    assert differences[0] / differences[1] == pytest.approx(100, rel=0.02)  # of first order in h
    assert differences[1] / differences[2] == pytest.approx(100, rel=0.02)
    assert differences[2] < 1e-5


def test_where_the_cables_cannot_hold_the_bar() -> None:
    for h in (0.0, 0.1):
        assert np.isnan(bar_tilt(EXITS, [-0.3, 0.0], h))  # beside both exit points
        assert np.isnan(bar_tilt(EXITS, [0.4, 0.8], h))  # above both
        assert np.isfinite(bar_tilt(EXITS, [0.4, 0.2], h))


@pytest.mark.parametrize("x", [0.3, 0.5])
def test_no_tension_holds_a_bar_that_is_level_with_both_exit_points(x: float) -> None:
    """Rounding made it a stable rest at 180 degrees, with 6.5e16 weights in each cable."""
    exits = [[0.0, 1.0], [1.0, 1.0]]
    assert np.isnan(bar_tilt(exits, [x, 1.0], 0.1)) and bar_equilibria(exits, [x, 1.0], 0.1) == ()
    below = bar_equilibria(exits, [x, 0.9], 0.1)
    assert any(rest.stable for rest in below)
    assert all(np.isfinite(rest.tensions).all() for rest in below)


def test_of_two_ways_to_hang_the_more_level_one_is_taken() -> None:
    """A short bar can also hang upside down, its cables crossed; both ways are stable."""
    exits, place, h = [[-0.277, 0.974], [0.170, 0.653]], [-0.010, -0.998], 0.011
    theta = float(bar_tilt(exits, place, h))
    assert np.rad2deg(theta) == pytest.approx(43.685, abs=1e-3)
    other = [one for one in bar_equilibria(exits, place, h) if -2.5 < one.theta < -2.4]
    assert [one.stable for one in other] == [True]


def test_a_balanced_bar_that_would_topple_is_no_answer() -> None:
    """Both cables pull at 106.8 degrees and the forces meet, but SEECR leaves the pose."""
    exits, place, h = np.array([[-0.19, 0.55], [0.09, -0.48]]), np.array([0.01, -0.4]), 0.47
    tilts = [one.theta for one in bar_equilibria(exits, place, h)]
    (theta,) = [t for t in tilts if 106 < np.rad2deg(t) < 107.5]
    assert np.isnan(bar_tilt(exits, place, h))
    robot = planar("two_cable", 1e5)
    robot = replace(
        robot,
        exit_points=np.insert(exits, 1, 0.0, axis=1),
        anchor_points=np.array([[-h, 0, 0], [h, 0, 0]]),
    )
    pose = np.array([[place[0], 0, place[1], np.cos(theta / 2), 0, -np.sin(theta / 2), 0]])
    ends = h * np.array([[-1.0], [1.0]]) * [np.cos(theta), np.sin(theta)]
    pulls = exits - (place + ends)
    tension = np.linalg.solve(pulls.T, [0.0, robot.weight]) * np.linalg.norm(pulls, axis=1)
    assert np.all(tension > 0)
    lengths = robot.nominal_lengths(pose) / (1 + tension / robot.ea)  # eq 10
    balanced = solve(robot, poses=pose, rest_lengths=lengths, method="least_squares", start=pose)
    assert balanced.status[0] is Status.UNSTABLE
    assert np.abs(balanced.deviation).max() < 1e-9
    rest = solve(robot, poses=pose, rest_lengths=lengths)
    assert rest.converged[0] and np.abs(rest.deviation[0, :3]).max() > 0.1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (([[0.0, 1]], PLACE), r"exit_points must be \(2, 2\) finite numbers, got \(1, 2\)"),
        ((EXITS * np.nan, PLACE), r"exit_points must be \(2, 2\) finite"),
        ((EXITS, [0.0, 1, 2]), r"positions must be \(\.\.\., 2\), x y, got \(3,\)"),
        ((EXITS, PLACE, -0.1), r"half_length must not be negative \[m\], got -0.1"),
        ((EXITS, [np.nan, 0.2], 0.1), r"positions holds numbers that are not finite"),
        ((EXITS, "ab"), r"positions: expected numbers, got 'ab'"),
        ((EXITS, PLACE, "h"), r"half_length: expected numbers, got 'h'"),
        ((EXITS, PLACE, [0.1, 0.2]), r"half_length must be one number \[m\], got \(2,\)"),
    ],
)
def test_bad_input(arguments: tuple, text: str) -> None:
    with pytest.raises(InputError, match=text):
        bar_tilt(*arguments)


def test_midlines_need_two_pairs() -> None:
    with pytest.raises(InputError, match=r"must be \(\.\.\., 4, 2\), got \(4, 2\) and \(2, 2\)"):
        midline_point(np.ones((4, 2)), EXITS)


# --- two cables (Figs 2 to 4) ------------------------------------------------------------------


def test_manifold_is_flat_below_and_s_shaped_above() -> None:
    """Fig 3: nearly straight in x near the ground, level in the middle and steep at the sides."""
    x = np.linspace(0.1, 0.9, 33)
    low, high = solution_manifold(EXITS, x, [-2.0, 0.3])
    assert np.all(np.diff(low) > 0) and np.all(np.diff(high) > 0)
    assert low + low[::-1] == pytest.approx(0, abs=1e-14)

    def steepness(edge: np.ndarray) -> float:
        slope = np.diff(edge)
        return float(slope[0] / slope[16])

    assert steepness(low) < 1.0 < 4.0 < steepness(high)
    assert solution_manifold(EXITS, x, [-2.0, 0.3], 0.1).shape == (2, 33)


@pytest.mark.parametrize("ea", [300.0, 3000.0, 1e5, 1e7])
def test_every_answer_lies_on_the_manifold(ea: float) -> None:
    """Fig 4: wherever SEECR ends, the closed form gives its tilt there, whatever the cable."""
    robot = planar("two_cable", ea)
    x, z = np.meshgrid(np.linspace(0.1, 0.9, 9), [0.2, 0.5, 0.7])
    poses = np.column_stack([x.ravel(), 0 * x.ravel(), z.ravel(), np.tile([1.0, 0, 0, 0], (27, 1))])
    answer = solve(robot, poses)
    expected = bar_tilt(robot.exit_points[:, IN_PLANE], answer.pose[:, IN_PLANE], 0.1)
    assert tilt(answer) == pytest.approx(expected, abs=1e-12)


def test_the_bar_drifts_towards_the_centre_and_tilts_the_way_of_the_closed_form() -> None:
    """Section III-C: parasitic tilt, lateral motion towards the centre, and downwards."""
    robot = planar("two_cable")
    x = np.array([0.1, 0.2, 0.3, 0.4])
    left, right = solve(robot, level(x, 0.5)), solve(robot, level(1 - x, 0.5))
    assert np.all(left.deviation[:, 0] > 0.01) and np.all(right.deviation[:, 0] < -0.01)
    assert np.all(left.deviation[:, 2] < 0)
    assert np.all(tilt(left) < 0)
    assert right.deviation[:, 0] == pytest.approx(-left.deviation[:, 0], abs=1e-12)
    # less far than where the bar would have to hang at the commanded position
    green = bar_tilt(robot.exit_points[:, IN_PLANE], level(x, 0.5)[:, IN_PLANE], 0.1)
    assert np.all(np.abs(tilt(left)) < np.abs(green))


def test_from_stiff_to_soft_the_bar_sinks_along_the_manifold() -> None:
    """Fig 3's curves: the softer the cable the lower; the stiff end is the inextensible limit."""
    pose = level(np.array([0.25]), 0.5)
    elastic = [1e7, 1e6, 1e5, 1e4, 3000.0, 1000.0, 300.0, 100.0]
    heights = [solve(planar("two_cable", ea), pose).deviation[0, 2] for ea in elastic]
    assert np.all(np.diff(heights) < 0)
    first = np.diff(heights[:4])  # linear in the compliance near the limit
    assert first[1:] / first[:-1] == pytest.approx([10.0, 10.0], rel=0.01)
    limit = solve(planar("two_cable", 1e7), pose)
    straight = np.linalg.norm(
        limit.robot.exit_points - transform_points(limit.pose, limit.robot.anchor_points)[0], axis=1
    )
    assert straight == pytest.approx(limit.rest_lengths[0], rel=1e-6)


# --- four cables (Figs 6 to 9) -----------------------------------------------------------------

ACROSS = np.linspace(0.1, 0.7, 61)


def points(answer: Solution) -> np.ndarray:
    """V or H at each pose of a four-cable robot, in the plane."""
    anchors = transform_points(answer.pose, answer.robot.anchor_points)
    return midline_point(answer.robot.exit_points[:, IN_PLANE], anchors[..., IN_PLANE])


def test_vertical_parallelogram_tilts_and_loses_one_then_two_cables() -> None:
    """Fig 7: four taut in the middle, then three, then two on either side."""
    robot = planar("vertical")
    answer = solve(robot, level(ACROSS, 0.15))
    zones = slack_zones(answer)
    assert [zone.slack for zone in zones] == [2, 1, 0, 1, 2]
    assert zones[0].first == 0 and zones[-1].last == 60
    assert np.all(np.diff(np.abs(tilt(answer)[:31])) < 0)  # level only in the middle
    assert abs(np.rad2deg(tilt(answer)[0])) > 30 and abs(tilt(answer)[30]) < 1e-12
    assert answer.tensions[::-1][:, [2, 3, 0, 1]] == pytest.approx(answer.tensions, abs=1e-8)
    # cables under tension are not the same on the left and on the right
    assert np.array_equal(answer.slack[0], [False, True, True, False])
    assert np.array_equal(answer.slack[60], [True, False, False, True])


def test_two_taut_cables_of_four_are_a_bar_on_two_cables() -> None:
    """Section III-D: beyond three cables the robot is on a two-cable manifold, one a side."""
    robot = planar("vertical")
    answer = solve(robot, level(ACROSS, 0.15))
    for i in (0, 10, 50, 60):
        taut = np.flatnonzero(~answer.slack[i])
        assert len(taut) == 2
        two = replace(
            robot,
            **{n: getattr(robot, n)[taut] for n in ("exit_points", "anchor_points", "ea",
                                                    "rest_lengths")},
            cable_names=(),
        )  # fmt: skip
        alone = solve(two, answer.command[i])
        assert alone.deviation == pytest.approx(answer.deviation[[i]], abs=1e-10)


def test_the_weight_passes_v_only_in_the_middle() -> None:
    """Fig 9: equal tensions on each side need the weight to pass V; it does so at no tilt."""
    level_poses = solve(planar("vertical", 3e6), level(ACROSS, 0.15))
    robot = level_poses.robot
    anchors = transform_points(level_poses.command, robot.anchor_points)[..., IN_PLANE]
    at_command = midline_point(robot.exit_points[:, IN_PLANE], anchors)
    beside = at_command[:, 0] - level_poses.command[:, 0]
    assert abs(beside[30]) < 1e-12
    assert np.all(np.abs(beside[:20]) > 1e-3) and np.all(np.diff(np.abs(beside[:31])) < 0)
    answer = solve(planar("vertical"), level(ACROSS, 0.15))
    assert points(answer)[30, 0] == pytest.approx(0.4, abs=1e-12)
    sides = answer.tensions[:, [0, 2]] - answer.tensions[:, [1, 3]]
    assert np.abs(sides[30]).max() < 1e-9 < 0.1 < np.abs(sides[:25]).max(axis=1).min()


def test_horizontal_parallelogram_stays_level_with_equal_tensions_on_a_side() -> None:
    """Fig 8, and point H of Fig 9: above the centre of mass wherever the platform is level."""
    answer = solve(planar("horizontal"), level(ACROSS, 0.15))
    assert np.abs(tilt(answer)).max() < 1e-9
    assert [zone.slack for zone in slack_zones(answer)] == [0]
    assert answer.tensions[:, 0] == pytest.approx(answer.tensions[:, 1], abs=1e-7)
    assert answer.tensions[:, 2] == pytest.approx(answer.tensions[:, 3], abs=1e-7)
    assert np.all(np.diff(answer.tensions[:, 0]) < 0) and np.all(np.diff(answer.tensions[:, 2]) > 0)
    h = points(answer)
    assert h[:, 0] == pytest.approx(answer.pose[:, 0], abs=1e-9)
    # turned, the weight no longer passes H: no rotation but zero is balanced
    turned = answer.command[20].copy()
    turned[3:] = [np.cos(0.05), 0, np.sin(0.05), 0]
    robot = answer.robot
    anchors = transform_points(turned, robot.anchor_points)[:, IN_PLANE]
    away = midline_point(robot.exit_points[:, IN_PLANE], anchors)[0] - turned[0]
    assert abs(away) > 1e-3


def test_midlines_that_never_meet_are_infinitely_far() -> None:
    exits = np.array([[0.0, 1], [0.1, 1], [0.5, 1], [0.6, 1]])
    anchors = exits - [0.0, 1.0]
    assert np.all(np.isinf(midline_point(exits, anchors)))
    towards = anchors + np.array([[0.25, 0], [0.25, 0], [-0.25, 0], [-0.25, 0]])
    assert midline_point(exits, towards) == pytest.approx([0.3, 0.0])


def test_all_ways_of_a_bar_to_be_in_balance_are_found() -> None:
    exits, here, h = np.array([[0.0, 1.0], [1.0, 1.0]]), np.array([0.3, 0.5]), 0.1
    found = bar_equilibria(exits, here, h)
    grid = np.linspace(-np.pi, np.pi, 20001)
    # both cables' forces that lift the weight, and their torque about the middle, cleared of
    # the determinant that they are divided by
    arms = h * np.array([[[-1.0]], [[1.0]]]) * np.stack([np.cos(grid), np.sin(grid)], axis=-1)
    one, two = pulls = exits[:, None] - here - arms
    turn = arms[..., 0] * pulls[..., 1] - arms[..., 1] * pulls[..., 0]
    values = one[:, 0] * turn[1] - two[:, 0] * turn[0]
    crossings = np.flatnonzero(np.diff(np.sign(values)) != 0)
    np.testing.assert_allclose([one.theta for one in found], grid[crossings], atol=4e-4)
    assert bar_tilt(exits, here, h) in [one.theta for one in found if one.stable]
    for one in found:
        ends = h * np.array([[-1.0], [1.0]]) * [np.cos(one.theta), np.sin(one.theta)]
        unit = exits - here - ends
        unit /= np.linalg.norm(unit, axis=1)[:, None]
        np.testing.assert_allclose(np.asarray(one.tensions) @ unit, [0.0, 1.0], atol=1e-9)
        torque = ends[:, 0] * unit[:, 1] - ends[:, 1] * unit[:, 0]
        assert abs(np.asarray(one.tensions) @ torque) < 1e-9


def test_the_papers_unique_tilt_is_not_unique_for_a_long_bar() -> None:
    """A search over positions below the exit points finds bars with two stable tilts."""
    exits, h = np.array([[0.0, 1.0], [1.0, 1.0]]), 0.35
    stable = [
        [one.theta for one in bar_equilibria(exits, np.array([x, y]), h) if one.stable]
        for x in np.linspace(0.1, 0.5, 9)
        for y in np.linspace(0.5, 0.98, 13)
    ]
    assert max(len(some) for some in stable) == 2
    assert bar_equilibria(exits, np.array([0.5, 0.2]), h)[1].stable


def test_bars_without_length_are_refused() -> None:
    with pytest.raises(InputError, match="half_length must be above zero"):
        bar_equilibria([[0, 1], [1, 1]], [0.5, 0.5], 0.0)
    with pytest.raises(InputError, match=r"position must be \(2,\)"):
        bar_equilibria([[0, 1], [1, 1]], [[0.5, 0.5]], 0.1)
    with pytest.raises(InputError, match="position holds numbers that are not finite"):
        bar_equilibria([[0, 1], [1, 1]], [np.nan, 0.5], 0.1)
    with pytest.raises(InputError, match="exit_points must be two places, got one"):
        bar_equilibria([[1, 1], [1, 1]], [1.0, 0.5], 0.1)


@pytest.mark.parametrize(("x", "up"), [(0.0, -1.0), (1.0, 1.0)])
def test_a_bar_below_one_exit_point_hangs_there_and_the_other_cable_does_not_push(
    x: float, up: float
) -> None:
    """Rounding left it -2e-17 weights, and the bar was called not stable for that."""
    rests = bar_equilibria([[0.0, 1.0], [1.0, 1.0]], [x, 0.5], 0.1)
    upright = [one for one in rests if abs(abs(one.theta) - 0.5 * np.pi) < 1e-9]
    assert len(upright) == 2
    for one in upright:
        assert sorted(one.tensions) == [0.0, pytest.approx(1.0)]
        # it hangs from its upper end; held at the lower one it falls over
        assert one.stable == (np.sign(one.theta) == up)
