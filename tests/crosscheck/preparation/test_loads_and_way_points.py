"""Rows that were only gone through, and rows that carried something, in a fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import soft_cogiro, term

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Unfit
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.held_out import blocks_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.planning.places import PAYLOAD, extensions
from crosscheck.planning.planned import Adding, Reads, planned
from crosscheck.preparation.prepare import prepare
from crosscheck.twin.lab import trajectory
from seecr.commands import Loads
from seecr.effects import Terms
from seecr.prediction.experiment import Experiment

ROBOT = soft_cogiro()
SIGMA = Sigma(position_m=1e-5, orientation_rad=1e-4)
TRUE = Terms([term(ROBOT, "platform_mass", added_kg=0.03), term(ROBOT, "stiffness", factor=1.1)])


def carried(loads: bool = True, told: bool = False) -> Measurements:
    """Readings of a robot with both effects, every fourth row being a way point."""
    way = trajectory(ROBOT, 3)
    n = len(way.pose)
    mass = np.where(np.arange(n) % 2, 0.2, 0.0)
    data = Measurements(
        path=Path("measured.csv"), n_cables=8, run=way.run, t_s=way.t_s, sigma=SIGMA,
        command_pose=None if told else way.pose,
        command_lengths=ROBOT.commanded_lengths(way.pose) if told else None, told=told,
        loads=Loads.of(n, mass=mass, centre=np.array([0.02, 0.0, -0.03])) if loads else None,
    )  # fmt: skip
    seen = Experiment(ROBOT, data.as_commands(ROBOT)).predict(TRUE.effects).readings
    rng = np.random.default_rng(0)
    stops = (np.arange(n) % 4 != 2)[:, None]
    noisy = seen.position + SIGMA.position_m * rng.standard_normal((n, 3))
    quat = np.where(stops, seen.quat_wxyz, np.nan)
    position = np.where(stops, noisy, np.nan)
    return replace(data, position=position, quat_wxyz=quat)


@pytest.mark.parametrize("told", [False, True])
def test_a_known_payload_tells_mass_from_stiffness(told: bool) -> None:
    found = {}
    for loads in (True, False):
        data = carried(loads, told)
        ready = prepare(ROBOT, data, Terms())
        problem = ready.problem
        assert ready.refusal is None and problem.use.tolist() == data.read.tolist()
        start = Terms([term(ROBOT, one.name) for one in TRUE])
        free = Data.of(problem, Terms())
        found[loads] = fit(free, free.state(start))
    error = np.abs(found[True].terms.vector - TRUE.vector)
    assert found[True].valid and np.all(error < 4 * found[True].stderr)
    # without the payload the two cannot be told apart
    assert np.all(found[False].stderr > 5 * found[True].stderr)


def test_way_points_are_no_readings_and_no_loss() -> None:
    data = carried()
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    assert not np.any(problem.counted[2::4]) and np.all(problem.counted[1::4, :6])
    assert not any(rows[2::4].any() for rows in blocks_of(problem))
    # two of three rows being way points is no loss of rows
    most = data.rows(np.flatnonzero(data.read))
    assert most.n_rows == 18
    quat, position = most.quat_wxyz, most.position.copy()
    assert quat is not None
    quat[6:], position[6:] = np.nan, np.nan
    assert prepare(ROBOT, replace(most, position=position, quat_wxyz=quat), Terms()).refusal is None


def test_one_pose_under_two_loads_is_no_constant_command() -> None:
    data = carried().rows(np.zeros(8, dtype=int))
    noise = SIGMA.position_m * np.random.default_rng(1).standard_normal((8, 3))
    data = replace(data, position=data.position + noise)
    again = replace(data, loads=Loads.of(8, mass=np.tile([0.0, 0.1], 4)))
    refusals = [prepare(ROBOT, one, Terms()).refusal for one in (data, again)]
    assert refusals[0] is not None and refusals[0].unfit is Unfit.CONSTANT_COMMANDS
    assert refusals[1] is None


def test_what_could_be_added_keeps_way_points_and_hangs_a_payload_on_top() -> None:
    data = carried()
    plan = planned(ROBOT, data, SIGMA, Reads.of(data), Terms())
    assert np.array_equal(plan.problem.use, data.read)
    found = {one.kind: one.plan.problem for one in extensions(plan) if one.kind is not Adding.POSES}
    loads = found[Adding.PAYLOAD].data.loads
    assert loads is not None and data.loads is not None
    more = PAYLOAD * ROBOT.mass
    assert loads.mass == pytest.approx(data.loads.mass + more)
    assert np.isnan(loads.centre[0]).all()  # nothing hung there: at the platform's own centre
    both = (0.2 * np.array([0.02, 0.0, -0.03]) + more * ROBOT.centre_of_mass) / (0.2 + more)
    assert loads.centre[1] == pytest.approx(both)
    back = found[Adding.WAY_BACK]
    assert back.use.sum() == data.read.sum() and back.data.n_rows == data.n_rows
