"""Positions that too few cables hold in some orientation: heavy cables by poses known to rest."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import least_squares

from seecr import Term, Terms, correct, load_robot, solve
from seecr.cli import main
from seecr.inverse.correction import margins_in_place
from seecr.pose import Array, pose_difference

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


def test_the_orientation_is_that_in_which_the_platform_rests_there() -> None:
    poses = rests(np.array([0.35, 0.5, 0.7]))
    level = poses.copy()
    level[:, 3:] = ROBOT.reference_pose[3:]
    found = correct(ROBOT, level, effects=HEAVY, prefer="position")
    assert found.stays.all()
    np.testing.assert_allclose(found.aimed, poses, atol=1e-9)


@pytest.mark.parametrize(("stiffer", "weight", "n"), [(1.0, 1.0, 101), (100.0, 0.3, 31)])
def test_positions_between_others_that_are_held_are_held(
    stiffer: float, weight: float, n: int
) -> None:
    """Where rounding, and the rounding of stiff steel, is all that is missing."""
    robot = replace(ROBOT, ea=stiffer * ROBOT.ea)
    heavy = Terms([Term.of(robot, "cable_weight", weight_N_per_m=weight)])
    level = np.tile(ROBOT.reference_pose, (n, 1))
    level[:, 0] = np.linspace(0.25, 0.75, n)
    margins = margins_in_place(robot, level, heavy, 0.0, np.inf)
    assert np.all(margins > 0.0)
    np.testing.assert_allclose(margins, margins[::-1], rtol=1e-6)


@pytest.mark.parametrize("effects", [Terms(), HEAVY])
def test_what_is_not_held_leaves_the_margins_of_others_as_they_are(effects: Terms) -> None:
    poses = np.tile(ROBOT.reference_pose, (4, 1))
    poses[:, 0] = [0.35, 0.4, 0.5, 0.7]
    poses[[0, 2], 2] += 10.0  # above all exit points
    margins = margins_in_place(ROBOT, poses, effects, 0.0, np.inf)
    one_by_one = [margins_in_place(ROBOT, pose[None], effects, 0.0, np.inf)[0] for pose in poses]
    assert np.isneginf(margins).tolist() == [True, False, True, False]
    np.testing.assert_allclose(margins, one_by_one, rtol=1e-6)


def level_at(places: Array) -> Array:
    """Level poses (n, 7) at positions (n, 2), x and z [m]."""
    poses = np.tile(ROBOT.reference_pose, (len(places), 1))
    poses[:, [0, 2]] = places
    return poses


@pytest.mark.parametrize("effects", [LEANING, OVER_PULLEYS])
def test_positions_are_kept_and_mapped_where_pulls_turn_with_their_size(effects: Terms) -> None:
    """All were lost. Lengths for them are those of a search through the equilibria alone."""
    poses = level_at(PLACES)
    found = correct(ROBOT, poses, effects=effects, prefer="position")
    assert found.stays.all() and found.settled.all()
    assert np.abs(found.left[:, :3]).max() < 1e-9
    assert np.all(margins_in_place(ROBOT, poses, effects, 0.0, np.inf) > 0.0)
    plain = correct(ROBOT, poses, prefer="position").solution
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
    margins = margins_in_place(ROBOT, poses, pulleys, 0.0, np.inf)
    assert margins[1] > 0.0 and not np.isnan(margins[0])


def test_where_the_balance_has_no_derivatives_searches_stay() -> None:
    """Beside this position one was not finite, and the pose that it led to was refused."""
    found = correct(ROBOT, level_at(np.array([[0.927, 1.083]])), effects=LEANING, prefer="position")
    assert not found.held[0] and found.stays[0]


# --- Positions alone are wanted: few cables hold no orientation of one's choice


# Beside the middle the platform hangs askew, and no pulls of two cables hold it level.
ASIDE = np.array([0.12, 0.0, 0.05])


def beside() -> np.ndarray:
    poses = np.tile(ROBOT.reference_pose, (2, 1))
    poses[0, :3] += ASIDE
    return poses


def test_a_position_that_is_held_askew_is_reached_if_no_orientation_is_beside() -> None:
    """Of a wall plotter "0 of 1 pose reached", 0.15 mm off, for an orientation nobody asked for."""
    level = correct(ROBOT, beside())
    assert not level.reached[0] and level.why_not[0]
    found = correct(ROBOT, beside(), any_orientation=True)
    assert found.reached.all() and found.why_not == ("", "")
    rests = solve(ROBOT, found.commands)
    off = pose_difference(rests.pose, beside())
    assert np.abs(off[:, :3]).max() < 1e-9
    assert np.linalg.norm(off[0, 3:]) > np.radians(0.1)


def test_what_no_orientation_holds_is_still_not_reached() -> None:
    poses = beside()
    poses[0, 2] += 10.0  # above the exit points
    found = correct(ROBOT, poses, any_orientation=True)
    assert found.reached.tolist() == [False, True] and found.why_not[0]


@pytest.mark.parametrize("states", [False, True])
def test_a_list_of_positions_alone_wants_no_orientation(states: bool, tmp_path: Path) -> None:
    x, _y, z = beside()[0, :3]
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
