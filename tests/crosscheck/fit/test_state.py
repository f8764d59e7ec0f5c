"""A model compared with data: in which equilibrium it rests, and how the tracker is turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured

from crosscheck.fit.problem import Problem
from crosscheck.fit.registration import turn_of_points
from crosscheck.fit.state import State, evaluate
from crosscheck.measurements.data import Measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
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
