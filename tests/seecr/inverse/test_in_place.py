"""Positions that too few cables hold in some orientation: heavy cables by poses known to rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms
from seecr.equilibrium.solving import solve
from seecr.inverse import correction, in_place, nearest
from seecr.inverse.nearest import Best
from seecr.inverse.nearest_problem import NearestProblem, Spots
from seecr.pose import Array, quat_from_rotvec
from seecr.statics.tables import Tables

ROBOT = load_robot("planar_two_cable")
HEAVY = Terms([Term.of(ROBOT, "cable_weight", weight_N_per_m=1.0)])

# The directions of their pulls depend on how large these are: with lengths a little beside those of
# the tensions asked for, nothing was in balance any more.
LEANING = Terms([Term.of(ROBOT, "frame_compliance", sideways_m_per_N=2e-5, upwards_m_per_N=1e-5)])
OVER_PULLEYS = Terms(
    [
        Term.of(ROBOT, "cable_weight", weight_N_per_m=0.1),
        Term.of(ROBOT, "pulley_radius", radius_m=0.03),
    ]
)
PLACES = np.array([[0.4, 0.5], [0.25, 0.3], [0.6, 0.8], [0.12, 0.45]])


def rests(places: Array) -> Array:
    """Poses at which the bar rests on heavy cables, with level commands at places (n,) along x."""
    commands = np.tile(ROBOT.reference_pose, (len(places), 1))
    commands[:, 0] = places
    found = solve(ROBOT, commands, effects=HEAVY)
    assert found.converged.all()
    return found.pose


def problem_of(poses: Array, turned: float = 0.0) -> tuple[NearestProblem, Tables]:
    """The positions of poses, with the platform asked for at another turn [rad]."""
    wanted = poses.copy()
    wanted[:, 3:] = quat_from_rotvec(np.array([0.0, turned, 0.0]))
    search = correction._search_of(ROBOT, wanted, HEAVY, 0.0, np.inf, "minimum")
    rows, tables = np.arange(len(wanted)), search._tables(search.given)
    return search._nearest_problem(rows, tables.scale, fix_position=True), tables


def test_the_orientation_is_that_in_which_the_platform_rests_there() -> None:
    poses = rests(np.array([0.35, 0.5, 0.7]))
    there, found = in_place.poses_in_place(*problem_of(poses))
    assert found.all()
    np.testing.assert_allclose(there, poses, atol=1e-9)


@pytest.mark.parametrize(("stiffer", "weight", "n"), [(1.0, 1.0, 101), (100.0, 0.3, 31)])
def test_positions_between_others_that_are_held_are_held(
    stiffer: float, weight: float, n: int
) -> None:
    """Where rounding, and the rounding of stiff steel, is all that is missing."""
    robot = replace(ROBOT, ea=stiffer * ROBOT.ea)
    heavy = Terms([Term.of(robot, "cable_weight", weight_N_per_m=weight)])
    level = np.tile(ROBOT.reference_pose, (n, 1))
    level[:, 0] = np.linspace(0.25, 0.75, n)
    margins = correction.margins_in_place(robot, level, heavy, 0.0, np.inf)
    assert np.all(margins > 0.0)
    np.testing.assert_allclose(margins, margins[::-1], rtol=1e-6)


@pytest.mark.parametrize("effects", [Terms(), HEAVY])
def test_what_is_not_held_leaves_the_margins_of_others_as_they_are(effects: Terms) -> None:
    poses = np.tile(ROBOT.reference_pose, (4, 1))
    poses[:, 0] = [0.35, 0.4, 0.5, 0.7]
    poses[[0, 2], 2] += 10.0  # above all exit points
    margins = correction.margins_in_place(ROBOT, poses, effects, 0.0, np.inf)
    one_by_one = [
        correction.margins_in_place(ROBOT, pose[None], effects, 0.0, np.inf)[0] for pose in poses
    ]
    assert np.isneginf(margins).tolist() == [True, False, True, False]
    np.testing.assert_allclose(margins, one_by_one, rtol=1e-6)


@pytest.mark.parametrize("thorough", [True, False])
def test_full_searches_are_made_only_if_they_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, thorough: bool
) -> None:
    """Above all exit points nothing is found: 256 models of a map each searched there in full."""
    searched: list[int] = []
    own = in_place.any_that_stays

    def counted(problem: NearestProblem) -> Best:
        searched.append(len(problem.wanted))
        return own(problem)

    monkeypatch.setattr(in_place, "any_that_stays", counted)
    poses = np.tile(ROBOT.reference_pose, (3, 1))
    poses[:, 0], poses[2, 2] = [0.4, 0.5, 0.6], 10.0
    margins = correction.margins_in_place(ROBOT, poses, HEAVY, 0.0, np.inf, thorough)
    assert np.isneginf(margins).tolist() == [False, False, True]
    assert searched == ([1] if thorough else [])


def level_at(places: Array) -> Array:
    """Level poses (n, 7) at positions (n, 2), x and z [m]."""
    poses = np.tile(ROBOT.reference_pose, (len(places), 1))
    poses[:, [0, 2]] = places
    return poses


@pytest.mark.parametrize("effects", [LEANING, OVER_PULLEYS])
def test_positions_are_kept_and_mapped_where_pulls_turn_with_their_size(effects: Terms) -> None:
    """All were lost. Lengths for them are those of a search through the equilibria alone."""
    poses = level_at(PLACES)
    found = correction.correct(ROBOT, poses, effects=effects, prefer="position")
    assert found.stays.all() and found.settled.all()
    assert np.abs(found.left[:, :3]).max() < 1e-9
    assert np.all(correction.margins_in_place(ROBOT, poses, effects, 0.0, np.inf) > 0.0)
    plain = correction.correct(ROBOT, poses, prefer="position").solution
    for k, pose in enumerate(poses):

        def away(lengths: Array, pose: Array = pose, start: Array = plain.pose[k]) -> Array:
            there = solve(ROBOT, start[None], rest_lengths=lengths[None], effects=effects)
            return np.asarray((there.pose[0] - pose)[[0, 2]])

        lengths = least_squares(away, plain.rest_lengths[k], xtol=1e-12, gtol=1e-14).x
        assert np.abs(away(lengths)).max() < 1e-8
        np.testing.assert_allclose(found.solution.rest_lengths[k], lengths, atol=1e-6)


def test_a_position_with_a_cables_end_on_its_pulley_is_not_held() -> None:
    """The map of all others ended in an error of another library."""
    pulleys = Terms([Term.of(ROBOT, "pulley_radius", radius_m=0.02)])
    end = ROBOT.exit_points[0] - ROBOT.anchor_points[0]
    poses = level_at(np.array([[end[0], end[2]], [0.5, 0.5]]))
    margins = correction.margins_in_place(ROBOT, poses, pulleys, 0.0, np.inf)
    assert margins[1] > 0.0 and not np.isnan(margins[0])


def test_stable_poses_are_kept_from_which_searches_go_on_to_unstable_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def nowhere(_problem: NearestProblem, start: Spots) -> Spots:
        return start.only(np.zeros(0, dtype=np.intp))

    monkeypatch.setattr(nearest, "solve_sqp", nowhere)
    found = correction.correct(ROBOT, level_at(PLACES[:1]), prefer="position")
    assert found.stays.all() and np.abs(found.left[:, :3]).max() < 1e-9


def test_where_the_balance_has_no_derivatives_searches_stay() -> None:
    """Beside this position one was not finite, and the pose that it led to was refused."""
    found = correction.correct(
        ROBOT, level_at(np.array([[0.927, 1.083]])), effects=LEANING, prefer="position"
    )
    assert not found.held[0] and found.stays[0]
