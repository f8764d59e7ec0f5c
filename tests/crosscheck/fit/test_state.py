"""A model compared with data: its equilibrium, the tracker's turn, values that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from made_diagnoses import POINTS, robot
from made_diagnoses import SIGMA as WITH_TENSIONS

from crosscheck.calibration import calibrate
from crosscheck.comparison.residuals import compare
from crosscheck.fit.problem import Problem
from crosscheck.fit.registration import turn_of_points
from crosscheck.fit.state import State, can_be, contradictions, evaluate
from crosscheck.measurements.data import Measurements
from crosscheck.model.fitted import Fitted
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Term, Terms, layout_of
from seecr.equilibrium.search import equilibria
from seecr.pose import Array, quat_from_rotvec, quat_rotate

PARALLEL = load_robot(model_path("demobot_parallel"))
QUAT = np.array([0.943, 0.163, -0.288, -0.038])
# At this command the platform may rest in two places, 15.7 mm apart.
TWO_RESTS = np.array([0.351, 0.216, 0.109, *(QUAT / np.linalg.norm(QUAT))])


def data_with(rest: Array) -> Measurements:
    """Readings, the fourth of a robot that was told to go to that command, and rests there."""
    data = measured(PARALLEL)
    assert data.quat_wxyz is not None
    command, position, quat = (a.copy() for a in (data.command_pose, data.position, data.quat_wxyz))
    command[3], position[3], quat[3] = TWO_RESTS, rest[:3], rest[3:]
    return replace(data, command_pose=command, position=position, quat_wxyz=quat)


def state_of(data: Measurements) -> State:
    problem = Problem(PARALLEL, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    return evaluate(problem, Terms(), problem.noise(problem.experiment.predict(())))


@pytest.mark.slow
def test_a_row_far_off_is_predicted_in_the_equilibrium_that_was_read() -> None:
    rests = equilibria(PARALLEL, TWO_RESTS).pose
    assert len(rests) == 2
    for rest in rests:
        state = state_of(data_with(rest))
        assert state.valid
        np.testing.assert_allclose(state.prediction.pose[3, :3], rest[:3], atol=1e-6)
        assert np.abs(state.raw[3, :3]).max() < 1e-6


def test_a_reading_that_is_no_equilibrium_moves_no_row() -> None:
    first = equilibria(PARALLEL, TWO_RESTS).pose[0]
    off = first + np.array([0.004, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    state = state_of(data_with(off))
    assert np.abs(state.raw[3, :3]).max() > 3e-3


CORNERS = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.3, 0.0], [0.1, 0.2, 0.4]])


@pytest.mark.parametrize("count", [3, 4])
def test_the_turn_that_was_made_is_found(count: int) -> None:
    turn = quat_from_rotvec(np.array([0.3, -1.2, 2.0]))
    found = turn_of_points(CORNERS[:count], quat_rotate(turn, CORNERS[:count]) + 2.0)
    assert found is not None
    np.testing.assert_allclose(found * np.sign(found @ turn), turn, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_points_in_one_line_show_no_turn(count: int) -> None:
    """So do fewer than three; of one a singular value was looked up that it does not have."""
    line = np.linspace(0.0, 1.0, count)[:, None] * np.array([[0.2, 0.1, -0.4]])
    assert turn_of_points(line, line + 1.0) is None


ROBOT = load_robot("planar_vertical")
SAID = "pulley_radius: radius_m is 60 standard errors from what was measured independently"


def known(value: float, stderr: float, now: float) -> Term:
    """A radius that a caliper gave, and its value now."""
    pulleys = Term.of(ROBOT, "pulley_radius").measured(radius_m=(value, stderr))
    return pulleys.with_vector(np.array([now]))


@pytest.mark.parametrize(("now", "is_said"), [(0.0, True), (0.0286, False), (0.0284, True)])
def test_more_than_three_standard_errors_are_said(now: float, is_said: bool) -> None:
    assert bool(contradictions([known(0.03, 0.0005, now)])) == is_said


def test_what_is_fixed_or_unknown_contradicts_nothing() -> None:
    fixed = replace(
        known(0.03, 0.0005, 0.0),
        knowledge=replace(known(0.03, 0.0005, 0.0).knowledge, fixed=np.array([True])),
    )
    assert contradictions([fixed, term(ROBOT, "stiffness", factor=3.0)]) == []


def test_a_comparison_says_it_of_the_model_and_a_calibration_of_what_it_fitted() -> None:
    """Both said nothing: sixty standard errors from the caliper, a model simply agreed."""
    data = measured(ROBOT, [], points=POINTS, sigma=WITH_TENSIONS, tensions=True)
    there = compare(ROBOT, data, Terms([known(0.03, 0.0005, 0.0)]))
    assert any(note.startswith(SAID) for note in there.notes)
    begun = Terms([known(0.03, 0.0005, 0.03)])
    fitted = calibrate(ROBOT, data, begun, only=["stiffness"])
    assert any(note.startswith("pulley_radius: radius_m is ") for note in fitted.notes)


NONE = Terms()


@pytest.mark.parametrize("factor", [0.02, 50.0])
def test_what_is_stopped_by_a_bound_cannot_be_found(factor: float) -> None:
    """A cable 50 times as soft: with stiffening ones it had explained what something else does."""
    stopped = Terms([Term.of(robot(), "cable_stiffness", factor_1=1.2, factor_3=factor)])
    assert not can_be(robot(), stopped, NONE)
    half = 0.5 * (1.0 + factor)
    within = Terms([Term.of(robot(), "cable_stiffness", factor_1=1.2, factor_3=half)])
    assert can_be(robot(), within, NONE)


def test_what_the_user_states_or_fixes_may_be_at_its_bound() -> None:
    stated = Terms([Term.of(robot(), "stiffness", factor=50.0)])
    assert can_be(robot(), stated, stated)
    assert can_be(robot(), Terms([stated["stiffness"].fixed()]), NONE)


def test_nothing_and_shapes_may_be_at_a_bound() -> None:
    radius = Terms([Term.of(robot(), "pulley_radius", radius_m=0.0)])
    assert layout_of("pulley_radius", robot()).lower[0] == 0.0 and can_be(robot(), radius, NONE)
    creep = layout_of("creep", robot())
    late = Terms([Term.of(robot(), "creep", amount=0.1, time_s=float(creep.upper[1]))])
    assert can_be(robot(), late, NONE)


def test_what_is_not_determined_has_no_value_unless_it_is_at_its_bound() -> None:
    """In a plane, shift_y was 1.227e-09 mm."""
    radius = term(soft_cogiro(), "pulley_radius", radius_m=0.01)
    for error, bound, line in [
        (np.inf, False, "radius = not determined by these data"),
        (np.inf, True, "radius = 10 mm (at its bound)"),
        (1e-4, False, "radius = 10.00 ± 0.10 mm"),
        (1e-4, True, "radius = 10.00 ± 0.10 mm (at its bound)"),
    ]:
        assert Fitted(radius, np.array([error]), np.array([bound])).value_lines() == [line]
