"""How far tensions stay inside their limits: two cables by hand, others by their balance."""

from __future__ import annotations

import numpy as np
import pytest
from from_python import from_python

from seecr.compiled.tensions import innermost_of, margins_at, margins_of, null_space
from seecr.description.mjcf import load_robot

# Two cables that pull a body along a line, one each way.
LINE = np.array([[1.0, -1.0]])
LOW, HIGH = np.array([1.0, 1.0]), np.array([11.0, 11.0])


def margin(load: float, high: np.ndarray = HIGH) -> tuple[float, np.ndarray]:
    out, tensions = np.empty(1), np.empty((1, 2))
    innermost_of(LINE[None], np.array([[load]]), LOW[None], high[None], np.ones(1), out, tensions)
    return float(out[0]), tensions[0]


@pytest.mark.parametrize(
    ("load", "inside", "tensions"),
    [(0.0, 5.0, (6.0, 6.0)), (2.0, 4.0, (7.0, 5.0)), (10.0, 0.0, (11.0, 1.0))],
)
def test_on_a_line_both_are_as_far_from_their_limits(
    load: float, inside: float, tensions: tuple[float, float]
) -> None:
    found, there = margin(load)
    assert found == pytest.approx(inside, abs=1e-12) and there == pytest.approx(tensions)


def test_what_cannot_be_balanced_lacks_half_of_what_is_too_much() -> None:
    assert margin(20.0)[0] == pytest.approx(-5.0)


def test_cables_that_can_be_tightened_without_limit_have_no_margin_to_name() -> None:
    found, there = margin(2.0, np.full(2, np.inf))
    assert found == np.inf and np.isnan(there).all()


def test_the_smallest_of_several_loads_counts() -> None:
    out = np.empty(1)
    margins_of(LINE[None], np.array([[[0.0], [-6.0], [2.0]]]), LOW, HIGH, 1.0, out)
    assert out[0] == pytest.approx(2.0)


def test_the_null_space_is_orthonormal_and_the_particular_solution_balances() -> None:
    rng = np.random.default_rng(2)
    matrix, load = rng.standard_normal((3, 6)), rng.standard_normal(3)
    particular, null, spans = np.empty(6), np.empty((6, 3)), from_python(null_space)
    assert spans(matrix, load, np.empty((6, 4)), particular, null)
    assert matrix @ particular == pytest.approx(load)
    assert np.abs(matrix @ null).max() < 1e-14
    assert null.T @ null == pytest.approx(np.eye(3), abs=1e-14)
    matrix[2] = matrix[0] + matrix[1]
    assert not spans(matrix, load, np.empty((6, 4)), particular, null)


def test_margins_of_poses_are_those_of_their_matrices() -> None:
    robot = load_robot("demobot_cogiro")
    pose = robot.reference_pose + np.array([0.05, -0.03, 0.02, 0, 0, 0, 0])
    weight = robot.mass * robot.gravity
    low, high = np.full(8, 0.1), np.full(8, 4.0)
    ways = robot.exit_points - pose[:3] - robot.anchor_points
    units = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    moments = np.cross(robot.anchor_points, units)
    matrix = np.ascontiguousarray(np.concatenate([units, moments], axis=1).T)
    load = np.concatenate([weight, np.cross(robot.centre_of_mass, weight)])
    scale, at_pose, of_matrix = robot.weight, np.empty(1), np.empty(1)
    margins_at(
        pose[None], robot.exit_points, robot.anchor_points, robot.centre_of_mass, weight,
        np.zeros((1, 6)), low, high, 1.0, scale, at_pose,
    )  # fmt: skip
    margins_of(matrix[None], -load[None, None], low, high, scale, of_matrix)
    assert at_pose[0] == pytest.approx(of_matrix[0], rel=1e-9) and at_pose[0] > -0.1
