"""Measurements made ready: what is left out is named, what is not fit is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Reason, Refusal, Unfit, Why
from crosscheck.fit.residual_noise import outlying_rows
from crosscheck.fit.state import evaluate
from crosscheck.inference.catalogue import candidates
from crosscheck.inference.fit import Data, fit, unfitted
from crosscheck.inference.held_out import blocks_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.planning.places import PAYLOAD, extensions
from crosscheck.planning.planned import Adding, Reads, planned
from crosscheck.preparation.prepare import prepare
from crosscheck.twin.lab import trajectory
from seecr.commands import Loads
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import quat_from_rxyz, rxyz_from_quat
from seecr.prediction.experiment import Experiment


def loose(robot: Robot) -> Robot:
    """Every cable slack and nothing that pulls: the platform rests nowhere."""
    return replace(robot, gravity=np.zeros(3), rest_lengths=robot.rest_lengths + 1.0)


def test_what_is_not_fit_is_refused_with_the_reason(robot: Robot, data: Measurements) -> None:
    nowhere = prepare(loose(robot), data, Terms())
    assert nowhere.refusal is not None and nowhere.refusal.unfit is Unfit.NO_EQUILIBRIUM
    n = data.n_rows
    assert str(nowhere.refusal) == (
        f"the model has no equilibrium at {n} of {n} rows; see the notes"
    )
    strange, lost = nowhere.notes[:2]
    assert "rest lengths are not those of the reference pose" in strange  # far too long ones
    assert lost.startswith("lines 2, 3, 4, 5, 6, 7, 8, 9 and ")
    assert lost.endswith("more left out: the platform is free to move there")
    still = prepare(robot, data.rows(np.zeros(12, dtype=int)), Terms())
    assert still.refusal is not None and still.refusal.unfit is Unfit.CONSTANT_COMMANDS
    blank = replace(data, position=np.full_like(data.position, np.nan), quat_wxyz=None)
    none = prepare(robot, blank, Terms())
    assert none.refusal is not None and none.refusal.unfit is Unfit.NO_READINGS
    few = prepare(robot, replace(data, quat_wxyz=None).rows(slice(0, 1)), Terms())
    assert few.refusal == Refusal(Unfit.FEW_READINGS, rows=1, lost=0, readings=3)
    assert str(few.refusal) == "only 3 readings can be used"


def test_the_exit_status_hangs_on_what_happened_and_on_no_word() -> None:
    """Solutions are wanting in these alone; what people read of the others may say anything."""
    wanting = {unfit for unfit in Unfit if Refusal(unfit, readings=3).unsolved}
    assert wanting == {Unfit.NO_EQUILIBRIUM, Unfit.UNSOLVED_MODEL}
    assert Refusal(Unfit.FEW_READINGS, rows=1, lost=1, readings=0).unsolved


def test_every_reason_is_a_sentence_with_its_numbers() -> None:
    for why in Why:
        text = str(Reason(why, parameters=24, rows=10, p=0.25, by=("creep",)))
        assert text and "{" not in text
        assert text.startswith("not a candidate: ") == Reason(why).lacking
    # "probable (1) but not certain" was said of what is all but certain
    assert str(Reason(Why.NOT_SURE, p=0.9999)) == "probable (> 99 %) but not certain"
    assert str(Reason(Why.NOT_SURE, p=0.986)) == "probable (99 %) but not certain"
    two = Reason(Why.NOT_NEEDED_BESIDE, p=0.1, by=("creep", "stiffness"))
    assert str(two) == "not needed once creep, stiffness are in the model (probability 10 %)"
    for unfit in Unfit:
        assert "{" not in str(Refusal(unfit, 10, 3, 5))


def test_what_the_data_lack_is_said_of_each_effect(robot: Robot, data: Measurements) -> None:
    def lacks(some: Measurements) -> dict[str, Reason | None]:
        problem = Problem(robot, some, some.sigma, np.ones(some.n_rows, dtype=bool))
        return {layout.name: why for layout, why in candidates(problem)}

    full = lacks(data)
    assert full["stiffness"] is None and full["creep"] is None
    assert full["thermal_expansion"] == Reason(Why.NEEDS_TEMPERATURE)
    assert full["tension_scale"] == Reason(Why.NEEDS_TENSIONS)
    constant = lacks(replace(data, temperature_C=np.full(data.n_rows, 20.0)))
    assert constant["thermal_expansion"] == Reason(Why.CONSTANT_TEMPERATURE)
    assert lacks(replace(data, t_s=None))["creep"] == Reason(Why.NEEDS_TIME)
    few = lacks(data.rows(slice(0, 10)))["exit_point_error"]
    assert few == Reason(Why.TOO_MANY_PARAMETERS, parameters=24, rows=10)
    lengths = robot.commanded_lengths(data.command_pose)
    told = lacks(replace(data, command_pose=None, command_lengths=lengths))
    assert told["initial_pose_error"] == Reason(Why.NEEDS_POSES)


def test_a_model_at_values_that_cannot_be_solved_is_not_valid(
    robot: Robot, data: Measurements
) -> None:
    problem = Problem(loose(robot), data, data.sigma, np.ones(data.n_rows, dtype=bool))
    every = Data.of(problem, Terms())
    for terms in (Terms(), Terms([term(robot, "stiffness")])):
        found = unfitted(every, terms)
        assert not found.valid and not found.settled
        assert found.jacobian.shape == (problem.n_readings, len(terms))


def test_a_row_that_sticks_out_alone_is_an_outlier_and_two_together_are_not(
    robot: Robot, data: Measurements
) -> None:
    def outlying(rows: list[int]) -> list[int]:
        position = data.position.copy()
        position[rows, 0] += 0.01
        problem = Problem(
            robot, replace(data, position=position), data.sigma, np.ones(data.n_rows, dtype=bool)
        )
        state = evaluate(problem, Terms(), problem.noise(problem.experiment.predict()))
        return np.flatnonzero(outlying_rows(problem, state)).tolist()

    assert outlying([7]) == [7]
    assert outlying([7, 8]) == []
    assert outlying([]) == []


def test_what_no_joint_changes_and_the_file_says_of_every_row_is_no_reading() -> None:
    """Rows of x, z and a tilt, filled up to whole poses, say as much as without the filling."""
    planar = load_robot(model_path("planar_vertical"))
    read = replace(measured(planar, points=12), sigma=Sigma())
    tilt = rxyz_from_quat(read.quat_wxyz)[:, 1]
    about = np.zeros((read.n_rows, 3))
    about[:, 1] = tilt
    place = read.position.copy()
    place[:, 1] = planar.reference_pose[1]
    filled = replace(read, position=place, quat_wxyz=quat_from_rxyz(about))
    bare = replace(read, position=place * [1, np.nan, 1], quat_wxyz=None,
                   angles_rad=about * [np.nan, 1, np.nan])  # fmt: skip
    ready, alike = (prepare(planar, one, Terms()) for one in (filled, bare))
    sigma = ready.problem.sigma
    assert sigma.orientation_rad == pytest.approx(3.5e-4, rel=0.4)
    assert sigma.orientation_rad == pytest.approx(alike.problem.sigma.orientation_rad, rel=1e-3)
    assert sigma.position_m == pytest.approx(alike.problem.sigma.position_m)
    assert ready.problem.n_readings == alike.problem.n_readings
    assert ready.notes[0].startswith("y, rotation about x, rotation about z: not counted as ")
    # what an instrument read there differs from row to row; a free platform may turn anywhere
    assert not prepare(planar, read, Terms()).problem.filled_in.any()
    assert not Problem(replace(planar, joints=()), filled, sigma, filled.read).filled_in.any()


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
