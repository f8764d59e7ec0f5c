"""Cables about as heavy as what they carry: a margin is only said where lengths hold the pose."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest

from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.equilibrium.solving import solve
from seecr.prediction.experiment import Experiment, effects_of
from seecr.statics.tables import Tables, assemble
from seecr.tensions.max_margin import MaxMargin, max_margin_tensions
from seecr.tensions.rest_lengths import hold
from seecr.workspace.maps import default_axes
from seecr.workspace.zones import margins_with

CAMERA = load_robot(model_path("camera"))
COGIRO = load_robot(model_path("demobot_cogiro"))


def grid(robot: Robot, values: int) -> np.ndarray:
    """Poses (n, 7) up to the height of the exit points, and at the exit points themselves."""
    axes = [np.linspace(axis[0], axis[-1], values) for axis in default_axes(robot)]
    places = np.array(list(itertools.product(*axes)))
    return np.column_stack([places, np.tile(robot.reference_pose[3:], (len(places), 1))])


def tables_of(robot: Robot, poses: np.ndarray, weight: float) -> Tables:
    told = Commands(poses, lengths=robot.commanded_lengths(poses), told=True)
    heavy = [Term.of(robot, "cable_weight", weight_N_per_m=weight)]
    return assemble(Experiment(robot, told).setup(effects_of(heavy, robot)))


def inside_of(robot: Robot, tables: Tables, high: float = np.inf) -> MaxMargin:
    return max_margin_tensions(tables, np.zeros(robot.n_cables), np.full(robot.n_cables, high))


# The large robot with either limit at one of its weights each; with both at both in a sweep.
@pytest.mark.parametrize(
    ("robot", "weight", "high"),
    [
        (CAMERA, 0.5, np.inf),
        (CAMERA, 3.0, 3000.0),
        (COGIRO, 2.0, np.inf),
        (COGIRO, 2.0, 3000.0),
        pytest.param(CAMERA, 0.5, 3000.0, marks=pytest.mark.sweep),
        pytest.param(CAMERA, 3.0, np.inf, marks=pytest.mark.sweep),
    ],
)
def test_what_has_a_margin_is_held_and_what_is_held_has_one(
    robot: Robot, weight: float, high: float
) -> None:
    """Once a linearised balance was believed: 223 of 2,588 margins had no lengths to them."""
    poses = grid(robot, 7)
    tables, m = tables_of(robot, poses, weight), robot.n_cables
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the grid's corners are exit points
        margins = inside_of(robot, tables, high).margins
        held = hold(tables, np.zeros((len(poses), m)), np.zeros(m), np.full(m, high))
    assert np.array_equal(margins >= -1e-9 * tables.scale, held.fine)
    assert 0 < held.fine.sum() < len(poses)
    told = Commands(poses[held.fine], lengths=held.rest[held.fine], told=True)
    there = solve(robot, told, effects=[Term.of(robot, "cable_weight", weight_N_per_m=weight)])
    assert np.abs(there.deviation[there.converged, :3]).max() < 1e-6
    assert np.all(there.tensions <= high * (1.0 + 1e-9))


def test_level_cables_hold_nothing_up() -> None:
    """At the height of the exit points, cables with weight pull down however tight they are."""
    poses = grid(CAMERA, 5)
    top = poses[np.isclose(poses[:, 2], CAMERA.exit_points[0, 2])]
    weighs = [Term.of(CAMERA, "cable_weight", weight_N_per_m=0.6)]
    assert len(top) == 25 and np.all(margins_with(CAMERA, top, weighs) < 0.0)


def test_where_two_vertices_of_the_linear_program_take_turns() -> None:
    """No round ends where it began: the margin is that of tensions which do balance."""
    pose = np.array([[0.13027, 0.25, 0.426625, *COGIRO.reference_pose[3:]]])
    found = inside_of(COGIRO, tables_of(COGIRO, pose, 2.0))
    assert 0.0 <= found.margins[0] < 0.21


def test_loose_cables_are_sought_from_several_lengths() -> None:
    """Once a hole in the map, between poses that are held."""
    pose = np.array([[0.31009, 0.4075, 0.193125, *COGIRO.reference_pose[3:]]])
    found = inside_of(COGIRO, tables_of(COGIRO, pose, 2.0))
    assert found.loose[0] and found.margins[0] == 0.0


def test_without_an_upper_limit_all_is_held_that_is_held_with_one() -> None:
    """Tensions that seem unlimited were sought up to thirty loads; some poses need more."""
    poses = grid(COGIRO, 8)
    tables = tables_of(COGIRO, poses, 0.3)
    limited, free = (inside_of(COGIRO, tables, high).margins for high in (3000.0, np.inf))
    assert np.all(free[limited >= 0.0] >= 0.0) and np.isposinf(free).any()
    few = np.flatnonzero(np.isposinf(free))
    m = COGIRO.n_cables
    tight = tables_of(COGIRO, poses[few], 0.3)
    held = hold(tight, np.zeros((len(few), m)), np.zeros(m), np.full(m, np.inf))
    assert held.fine.all()
