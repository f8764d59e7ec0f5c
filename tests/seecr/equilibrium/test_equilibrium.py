"""Where the platform rests: certificates recomputed, closed forms, invariances, statuses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import robot_of
from plain_steps import exact_residual
from random_robots import KINDS, random_poses, random_robot

import seecr
from seecr.effects.setup import plain_setup
from seecr.equilibrium.search import first_guess
from seecr.equilibrium.solving import METHODS
from seecr.pose import pose_add, pose_difference, quat_from_rotvec, quat_rotate
from seecr.statics import batch
from seecr.statics.solution import certify

COGIRO, PARALLEL = (seecr.load_robot(f"demobot_{name}") for name in ("cogiro", "parallel"))

UP = np.array([0.0, 0.0, 1.0])
HERE = [0.0, 0, 0, 1, 0, 0, 0]
SEEDS = range(8)


def hung(**changes: Any) -> seecr.Robot:
    """2 kg on one cable of 1 m and E S = 100 N, straight above its origin."""
    points = np.array([[0.0, 0, 1]]), np.zeros((1, 3))
    return replace(seecr.Robot("bob", *points, np.array([100.0]), np.ones(1), 2.0), **changes)


def slide(axis: np.ndarray = UP) -> tuple[seecr.Joint, ...]:
    return (seecr.Joint("slide", "lift", axis, np.zeros(3)),)


def hinge(axis: list[float]) -> tuple[seecr.Joint, ...]:
    return (seecr.Joint("hinge", "turn", np.array(axis), np.zeros(3)),)


# --- certificates ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", SEEDS)
def test_residual_and_fall_of_energy_recomputed_from_the_answer(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, kind)
    answer = seecr.solve(robot, random_poses(rng, robot, 8))
    assert np.all(answer.converged)
    start = batch.Evaluation.at_commands(answer.tables)
    assert np.all(answer.energy < batch.evaluate(answer.tables, start).energy)
    for i in range(8):
        assert exact_residual(answer, i) < 1e-9 and answer.residual[i] < 1e-9


def test_a_claim_of_rest_is_checked_and_not_believed() -> None:
    """A descent that says it converged where it did not gets no certificate."""
    answer = seecr.solve(COGIRO, [0.3, 0.25, 0.1, 1, 0, 0, 0])
    claim = batch.descend(answer.tables)
    assert certify(COGIRO, answer.tables, claim).converged[0]
    claim.deviation[0, 2] -= 1e-6
    refused = certify(COGIRO, answer.tables, claim)
    assert refused.status[0] is seecr.Status.STALLED and refused.residual[0] > 1e-3


@pytest.mark.parametrize("exponent", range(2, 8))
@pytest.mark.parametrize("name", ["demobot_cogiro", "demobot_parallel"])
def test_stiffness_from_1e2_to_1e7_newton(name: str, exponent: int) -> None:
    """At rest, or truly free to turn about the line of the only two cables that are left."""
    robot = replace(seecr.load_robot(name), ea=np.full(8, 10.0**exponent))
    rng = np.random.default_rng(exponent)
    places = rng.uniform([0.12, 0.1, 0.05], [0.68, 0.4, 0.35], (60, 3))
    poses = np.column_stack([places, np.tile([1.0, 0, 0, 0], (60, 1))])
    answer = seecr.solve(robot, poses)
    allowed = {seecr.Status.CONVERGED, *([seecr.Status.SINGULAR] if "parallel" in name else [])}
    assert set(answer.status) <= allowed
    taut = np.sum(~answer.slack, axis=1)
    assert np.all(taut[~answer.converged] == 2)
    for i in range(0, 60, 5):
        assert exact_residual(answer, i) < 1e-9


@pytest.mark.parametrize("exponent", range(2, 8))
@pytest.mark.parametrize("kind", KINDS)
def test_any_robot_at_any_stiffness_rests_or_says_so(kind: str, exponent: int) -> None:
    rng = np.random.default_rng(100 + exponent)
    for _ in range(5):
        robot = random_robot(rng, kind)
        stiff = np.full(robot.n_cables, robot.weight * 10.0 ** (exponent - 0.6))  # as on 0.4 kg
        answer = seecr.solve(replace(robot, ea=stiff), random_poses(rng, robot, 10))
        assert answer.converged.all(), [answer.sentence(i) for i in range(10)]
        for i in range(0, 10, 3):
            assert exact_residual(answer, i) < 1e-9


def test_energy_never_rises_from_step_to_step() -> None:
    """Seen through the limit of iterations, on robots soft enough to be solved in one stage."""
    falls = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        robot = random_robot(rng)
        robot = replace(robot, ea=np.full(robot.n_cables, 1000.0 * robot.weight))
        poses = random_poses(rng, robot, 10)
        energy = np.array(
            [seecr.solve(robot, poses, max_iterations=k).energy for k in range(1, 30)]
        )
        size = np.abs(energy).max(axis=0)
        assert np.all(np.diff(energy, axis=0) <= 1e-14 * size)
        falls += int(np.sum(np.diff(energy, axis=0) < -1e-6 * size))
    assert falls > 100  # there was something to see


def test_stiffness_under_a_constant_moment() -> None:
    """A moment that does not turn with the platform leaves a stiffness without symmetry."""
    pose, moment = [0.4, 0.25, 0.1, 1, 0, 0, 0], np.array([0.0, 0, 0, 0.01, 0.02, 0.05])
    soft = replace(COGIRO, ea=np.full(8, 300.0))
    rest = seecr.solve(soft, pose, wrench=moment)
    assert rest.converged[0]
    for k, size in enumerate([1e-6] * 3 + [1e-8] * 3):
        push = size * np.eye(6)[k]
        there, back = (seecr.solve(soft, pose, wrench=moment + s * push) for s in (1, -1))
        moved = pose_difference(there.pose[0], back.pose[0]) / 2
        assert rest.stiffness[0] @ moved == pytest.approx(push, rel=1e-4, abs=1e-4 * size)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_papers_methods_find_the_same_rest(method: str, kind: str) -> None:
    rng = np.random.default_rng(13)
    robot = random_robot(rng, kind)
    robot = replace(robot, ea=np.full(robot.n_cables, 50.0 * robot.weight))
    poses = random_poses(rng, robot, 6)
    newton, other = seecr.solve(robot, poses), seecr.solve(robot, poses, method=method)
    both = other.converged
    assert np.mean(both) > 0.5
    close = np.abs(newton.deviation - other.deviation)[both]
    assert close[:, :3].max() < 1e-7 * robot.length and close[:, 3:].max() < 1e-7


# --- closed forms ------------------------------------------------------------------------------


def test_one_mass_on_one_cable_stretches_it_by_m_g_l0_over_ea() -> None:
    robot = hung(joints=slide())
    for load in (0.0, -5.0, 10.0):
        answer = seecr.solve(robot, HERE, wrench=[0, 0, load, 0, 0, 0])
        weight = 2.0 * 9.81 - load
        assert answer.tensions[0, 0] == pytest.approx(weight, rel=1e-12)
        assert answer.deviation[0, 2] == pytest.approx(-weight * 1.0 / 100.0, rel=1e-12)
        assert answer.stiffness[0, 0, 0] == pytest.approx(100.0, rel=1e-12)
        assert answer.smallest_eigenvalue[0] == pytest.approx(100.0, rel=1e-12)
        fall = answer.deviation[0, 2]
        energy = 0.5 * 100.0 * fall**2 + weight * fall
        assert answer.energy[0] == pytest.approx(energy, rel=1e-12)


def test_a_rest_length_is_taken_as_such() -> None:
    robot = hung(joints=slide())
    answer = seecr.solve(robot, rest_lengths=[[1.5], [0.4]])
    stretch = 2.0 * 9.81 / 100.0
    assert answer.pose[:, 2] == pytest.approx(1.0 - np.array([1.5, 0.4]) * (1 + stretch), rel=1e-12)
    assert np.array_equal(answer.rest_lengths, [[1.5], [0.4]])


def test_an_external_moment_is_an_offset_centre_of_mass() -> None:
    offset = np.array([0.01, -0.005, 0.002])
    pose = [0.3, 0.2, 0.1, 1, 0, 0, 0]
    by_centre = seecr.solve(replace(PARALLEL, centre_of_mass=offset), pose)
    arm = quat_rotate(by_centre.pose[0, 3:], offset)
    moment = np.cross(arm, PARALLEL.mass * PARALLEL.gravity)
    by_moment = seecr.solve(PARALLEL, pose, wrench=[0, 0, 0, *moment])
    assert by_centre.converged[0] and by_moment.converged[0]
    assert np.linalg.norm(by_centre.deviation[0, 3:]) > np.deg2rad(1)
    assert by_moment.deviation == pytest.approx(by_centre.deviation, abs=1e-10)


# --- invariances -------------------------------------------------------------------------------


def test_gravity_given_is_gravity_of_the_robot() -> None:
    tilted = np.array([0.5, -0.3, -9.7])
    pose = [0.4, 0.2, 0.15, 1, 0, 0, 0]
    given, own = (
        seecr.solve(COGIRO, pose, gravity=tilted),
        seecr.solve(replace(COGIRO, gravity=tilted), pose),
    )
    assert np.array_equal(given.deviation, own.deviation)
    assert not np.array_equal(given.deviation, seecr.solve(COGIRO, pose).deviation)


def test_a_batch_is_its_rows() -> None:
    """To rounding: many rows descend in lanes, which add in another order."""
    poses = np.array([[x, 0.25, 0.1, 1, 0, 0, 0] for x in np.linspace(0.17, 0.63, 120)])
    whole = seecr.solve(PARALLEL, poses)
    for i in (0, 50, 119):
        one = seecr.solve(PARALLEL, poses[i])
        assert np.abs(one.deviation[0] - whole.deviation[i]).max() < 1e-14
    assert len(whole) == 120 and whole.pose.shape == (120, 7)


@pytest.mark.parametrize("method", METHODS)
def test_start_is_honoured_on_joints(method: str) -> None:
    """A mass on one cable and a hinge rests below; started above, fsolve stays where it is."""
    robot = hung(joints=hinge([0.0, 1, 0]), anchor_points=[[0.0, 0, -1]],
                 centre_of_mass=[0.0, 0, -1], rest_lengths=[2.0])  # fmt: skip
    above = [0.0, 0, 0, 0, 0, 1, 0]
    below = seecr.solve(robot, HERE, method=method)
    turned = seecr.solve(robot, HERE, start=[above], method=method)
    assert below.deviation[0, 4] == pytest.approx(0.0, abs=1e-9) and below.converged[0]
    if method == "newton":
        assert turned.iterations[0] > below.iterations[0] and turned.converged[0]
    else:
        assert turned.status[0] is seecr.Status.UNSTABLE
        assert abs(turned.deviation[0, 4]) == pytest.approx(np.pi, abs=1e-9)


# --- statuses ----------------------------------------------------------------------------------


def test_a_pendulum_is_free_to_turn_about_the_vertical() -> None:
    answer = seecr.solve(hung(centre_of_mass=np.array([0.1, 0, -0.2])), HERE)
    assert answer.status[0] is seecr.Status.SINGULAR and not answer.converged[0]
    assert answer.sentence(0).startswith(seecr.Status.SINGULAR.value)
    assert answer.sentence(0).endswith("(direction +1.00 rz)")
    assert answer.residual[0] < 1e-9  # and yet it balances, and hangs as a pendulum does:
    assert answer.deviation[0, 4] == pytest.approx(np.arctan2(0.1, 0.2), rel=1e-9)
    assert answer.softest_direction[0, 5] == pytest.approx(1.0 / answer.robot.length)


def test_two_cables_in_line_with_the_centre_of_mass_leave_one_turn_free() -> None:
    robot = seecr.Robot(
        "line", np.array([[-1.0, 0, 1], [1, 0, 1]]), np.array([[-0.1, 0, 0], [0.1, 0, 0]]),
        np.full(2, 1000.0), np.full(2, np.hypot(0.9, 1.0)), 2.0,
    )  # fmt: skip
    answer = seecr.solve(robot, HERE)
    assert answer.status[0] is seecr.Status.SINGULAR
    assert answer.sentence(0).endswith("(direction +1.00 rx)")
    below = seecr.solve(replace(robot, centre_of_mass=np.array([0.0, 0, -0.01])), HERE)
    assert below.converged[0]


@pytest.mark.parametrize("method", METHODS)
def test_a_balanced_but_unstable_pose_is_said_to_be_so_or_left(method: str) -> None:
    """A centre of mass above the only hinge: upright balances, and does not rest."""
    robot = hung(joints=hinge([0.0, 1, 0]), anchor_points=[[0.0, 0, 0.1]],
                 centre_of_mass=[0.0, 0, 0.2], rest_lengths=[0.9])  # fmt: skip
    answer = seecr.solve(robot, HERE, method=method)
    if method == "newton":
        assert answer.converged[0] and abs(answer.deviation[0, 4]) > np.deg2rad(90)
        return
    assert answer.status[0] is seecr.Status.UNSTABLE and not answer.converged[0]
    assert answer.sentence(0).endswith("(direction +1.00 ry)")
    assert answer.smallest_eigenvalue[0] < 0


def test_newton_passes_an_unstable_line_it_starts_on() -> None:
    """A centre of mass above the one anchor point: the fall goes straight down, then over."""
    answer = seecr.solve(hung(centre_of_mass=[0.0, 0, 0.2]), HERE)
    assert answer.status[0] is seecr.Status.SINGULAR  # about the vertical, as any pendulum
    assert abs(np.linalg.norm(answer.deviation[0, 3:])) == pytest.approx(np.pi, abs=1e-6)
    assert answer.tensions[0, 0] == pytest.approx(2 * 9.81, rel=1e-9)


def test_a_platform_whose_cables_cannot_hold_it_falls() -> None:
    robot = hung(joints=slide(), ea=np.array([5.0]))  # stretches to five times its length
    answer = seecr.solve(robot, HERE)
    assert answer.status[0] is seecr.Status.FALLING and not answer.converged[0]
    assert np.all(np.isnan(answer.pose)) and np.all(np.isnan(answer.tensions))
    assert np.isinf(answer.residual[0])


@pytest.mark.parametrize("lengths", [5.0, 30.0])
@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_vertical"])
def test_a_start_far_away_is_no_fall(name: str, lengths: float) -> None:
    """It ended at once as "the platform fell", although its cables pull it back."""
    robot = seecr.load_robot(name)
    starts = np.tile(robot.reference_pose, (64, 1))  # enough for lanes of sixteen
    turns = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
    longest = robot.reference_lengths.max()
    starts[:, [0, 2]] += lengths * longest * np.array([np.cos(turns), np.sin(turns)]).T
    here = seecr.solve(robot, robot.reference_pose)
    found = seecr.solve(robot, np.tile(robot.reference_pose, (64, 1)), start=starts)
    assert np.all(found.converged)
    moved = np.linalg.norm(found.deviation[:, :3] - here.deviation[:, :3], axis=1)
    assert moved.max() < longest and np.mean(moved < 1e-8) > 0.5  # some are twisted: other rests


def test_a_platform_that_cannot_be_held_falls_from_far_away_too() -> None:
    robot, start = hung(joints=slide(), ea=np.array([5e-3])), np.array(HERE)
    start[2] -= 50.0
    assert seecr.solve(robot, HERE, start=start).status[0] is seecr.Status.FALLING


def test_no_equilibrium_under_a_moment_that_no_cable_resists() -> None:
    """A constant moment about the vertical turns a pendulum for ever."""
    answer = seecr.solve(hung(centre_of_mass=[0.0, 0, -0.2]), HERE, wrench=[0, 0, 0, 0, 0, 0.5])
    assert answer.status[0] is seecr.Status.SPINNING and not answer.converged[0]
    assert np.all(np.isnan(answer.pose)) and np.isinf(answer.residual[0])


def test_a_moment_beyond_what_the_cables_can_hold_is_no_answer() -> None:
    pose = [0.4, 0.25, 0.1, 1, 0, 0, 0]
    held = seecr.solve(COGIRO, pose, wrench=[0, 0, 0, 0, 0, 0.1])
    assert held.converged[0]
    spun = seecr.solve(COGIRO, pose, wrench=[0, 0, 0, 0, 0, 3.0])
    assert spun.status[0] is seecr.Status.SPINNING and spun.residual[0] > 1e-3


@pytest.mark.parametrize("seed", range(20))
def test_what_large_moments_leave_in_balance_is_found(seed: int) -> None:
    """Up to a third of weight times length: at rest, or really turned without end."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    poses = random_poses(rng, robot, 10)
    moments = 0.3 * robot.weight * robot.length * rng.normal(size=(10, 3))
    answer = seecr.solve(robot, poses, wrench=np.hstack([np.zeros((10, 3)), moments]))
    if seed in (2, 17):  # one pose of each was missed without the skew part of the stiffness
        assert np.all(answer.converged)
    for i in np.flatnonzero(answer.converged):
        assert exact_residual(answer, i, moments[i]) < 1e-9
    # where there is no answer, starting elsewhere finds none within reach either
    for i in np.flatnonzero(answer.status == seecr.Status.SPINNING)[:2]:
        away = np.hstack([robot.length * rng.normal(size=(8, 3)), 0.5 * rng.normal(size=(8, 3))])
        starts = pose_add(np.tile(poses[i], (8, 1)), away)
        wrench = np.tile(np.concatenate([np.zeros(3), moments[i]]), (8, 1))
        elsewhere = seecr.solve(robot, np.tile(poses[i], (8, 1)), wrench=wrench, start=starts)
        assert not np.any(elsewhere.converged)


def test_a_singular_pose_names_its_direction_without_cables_that_just_touch() -> None:
    """A third cable as long as its rest length resists one way only: not the way it names."""
    robot = seecr.Robot(
        "line", np.array([[-1.0, 0, 1], [1, 0, 1], [0, 1.0, 1]]),
        np.array([[-0.1, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]),
        np.full(3, 1000.0), np.array([1.3, 1.3, 1.3]), 2.0,
    )  # fmt: skip
    hanging = seecr.solve(replace(robot, rest_lengths=np.array([1.3, 1.3, 9.0])), HERE)
    assert hanging.status[0] is seecr.Status.SINGULAR and hanging.slack[0].tolist() == [0, 0, 1]
    reach = robot.nominal_lengths(hanging.pose)[0, 2]
    touching = seecr.solve(robot, rest_lengths=[[1.3, 1.3, reach]], start=hanging.pose)
    assert touching.status[0] is seecr.Status.SINGULAR and touching.slack[0].tolist() == [0, 0, 1]
    assert touching.sentence(0) == hanging.sentence(0)
    assert touching.sentence(0).endswith("(direction +1.00 rx)")
    assert abs(touching.smallest_eigenvalue[0]) < 1e-9 * 1000.0


@pytest.mark.parametrize("method", METHODS)
def test_the_limit_of_iterations_is_said(method: str) -> None:
    answer = seecr.solve(PARALLEL, [0.17, 0.25, 0.1, 1, 0, 0, 0], method=method, max_iterations=1)
    assert answer.status[0] in (seecr.Status.ITERATIONS, seecr.Status.GAVE_UP)
    assert (answer.status[0] is seecr.Status.ITERATIONS) == (method == "newton")
    assert not answer.converged[0] and answer.residual[0] > 1e-9


def test_nothing_to_carry_and_nothing_pulls() -> None:
    """Without gravity every platform pose within slack cables is as good as the next."""
    robot = replace(COGIRO, rest_lengths=COGIRO.rest_lengths + 0.01)
    answer = seecr.solve(robot, [0.4, 0.25, 0.1, 1, 0, 0, 0], gravity=[0.0, 0, 0])
    assert answer.status[0] is seecr.Status.SINGULAR and np.all(answer.slack)
    tight = replace(COGIRO, exit_points=COGIRO.exit_points - [0, 0, 0.335])
    lengths = tight.nominal_lengths(tight.reference_pose[None])[0]
    tight = replace(tight, rest_lengths=0.99 * lengths)
    held = seecr.solve(tight, tight.reference_pose, gravity=[0.0, 0, 0])
    assert np.all(held.tensions > 0) and held.residual[0] < 1e-9


# --- inputs ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, r"needs commanded poses \(n, 7\) or rest_lengths \(n, m\); got none"),
        ({"poses": [[0.0] * 6]}, r"poses must be \(n, 7\), x y z qw qx qy qz, got \(1, 6\)"),
        ({"poses": np.zeros((2, 2, 7))}, r"poses must be \(n, 7\).* got \(2, 2, 7\)"),
        ({"poses": [0, 0, np.nan, 1, 0, 0, 0]}, "poses holds numbers that are not finite"),
        ({"poses": [[*HERE], [0, 0, 0, 2, 0, 0, 0]]}, "poses row 1 has a quaternion of norm 2;"),
        ({"poses": HERE, "method": "newtn"}, "method must be one of newton, .*, got 'newtn'"),
        ({"poses": HERE, "wrench": [0.0, 1]}, r"wrench must be \(6,\) or \(1, 6\), got \(2,\)"),
        ({"poses": HERE, "wrench": [np.inf] * 6}, "wrench holds numbers that are not finite"),
        ({"poses": HERE, "gravity": [0.0, 1]}, r"gravity must be \(3,\), got \(2,\)"),
        ({"poses": HERE, "gravity": [0.0, 1, np.nan]}, "gravity holds numbers that are not"),
        ({"poses": HERE, "start": [HERE, HERE]}, "start must have 1 pose, got 2"),
        ({"poses": HERE, "start": [[0.0, 1]]}, r"start must be \(n, 7\)"),
        ({"rest_lengths": [[1.0, 2.0]]}, r"rest_lengths must be \(n, 1\) for bob, got \(1, 2\)"),
        ({"rest_lengths": [[-1.0]]}, r"rest_lengths must be positive \[m\]"),
        ({"rest_lengths": [[np.nan]]}, "rest_lengths holds numbers that are not finite"),
        ({"poses": [HERE] * 2, "rest_lengths": [[1.0]] * 3}, "poses must be one or as many as t"),
        (
            {"poses": HERE, "max_iterations": 0},
            "max_iterations: expected a whole number from 1 on, got 0",
        ),
        ({"poses": HERE, "threads": -1}, "threads: expected a whole number from 1 on, got -1"),
    ],
)
def test_bad_input_is_one_sentence(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(seecr.InputError, match=text) as caught:
        seecr.solve(hung(), **arguments)
    assert "\n" not in str(caught.value)


def test_a_pose_off_the_joints_is_refused() -> None:
    with pytest.raises(seecr.InputError, match="its joints cannot reach the commanded pose, "):
        seecr.solve(hung(joints=slide()), [0.1, 0, 0, 1, 0, 0, 0])


def test_a_quaternion_is_normalised_only_where_it_needs_to_be() -> None:
    quat = quat_from_rotvec(np.array([0.1, 0.2, 0.3]))
    loose = seecr.solve(hung(), [0, 0, 0, *(1.0005 * quat)])
    assert loose.command[0, 3:] == pytest.approx(quat, abs=1e-15)
    exact = seecr.solve(hung(), [0, 0, 0, *quat])
    assert np.array_equal(exact.command[0, 3:], quat)


def test_effects_act_in_a_solve_as_in_a_prediction():
    pose = [[0.3, 0.2, 0.1, 1, 0, 0, 0], [0.5, 0.3, 0.2, 1, 0, 0, 0]]
    sag = seecr.Term.of(COGIRO, "cable_weight", weight_N_per_m=0.02)
    lag = seecr.Term.of(COGIRO, "hysteresis", amplitude_N=0.05)
    for effects in ([sag], [sag, lag]):
        solved = seecr.solve(COGIRO, pose, effects=effects)
        assert solved.converged.all()
        np.testing.assert_array_equal(solved.pose, seecr.predict(COGIRO, pose, effects).pose)
    plain = seecr.solve(COGIRO, pose).pose[:, :3]
    assert np.all(np.abs(solved.pose[:, :3] - plain).max(axis=1) > 1e-6)


def test_what_history_does_not_go_with_is_said():
    lag = seecr.Term.of(COGIRO, "hysteresis", amplitude_N=0.05)
    with pytest.raises(seecr.InputError, match=r"solved along the path; expected no other method"):
        seecr.solve(COGIRO, COGIRO.reference_pose, effects=[lag], method="fsolve")


@pytest.mark.parametrize(
    ("method", "history"),
    [("newton", False), ("newton", True), ("fsolve", False), ("least_squares", False)],
)
def test_a_cable_without_any_length_left_is_no_equilibrium(method: str, history: bool) -> None:
    """Formulas go on below a length of 0, with tensions of either sign."""
    robot = seecr.load_robot("demobot_parallel")
    shorter = seecr.Term.of(robot, "cable_length_offset", offset_1_m=-2.0 * robot.rest_lengths[0])
    effects = [shorter, *([seecr.Term.of(robot, "backlash", gap_m=1e-3)] if history else [])]
    found = seecr.solve(robot, robot.reference_pose[None], effects=effects, method=method)
    assert found.status[0] is seecr.Status.NO_LENGTH
    assert np.isnan(found.tensions).all() and found.residual[0] == np.inf
    assert not seecr.predict(robot, robot.reference_pose[None], effects).solved[0]


# --- The paper's own search on SciPy: its first guess, and where it gives up


def test_the_first_guess_falls_by_the_weight_on_the_mean_vertical_extent() -> None:
    """Step 4: m g l_vmean / k_c, written out for one pose."""
    robot = robot_of("demobot_cogiro")
    pose = np.array([[0.3, 0.2, 0.1, 1.0, 0, 0, 0]])
    below = robot.exit_points[:, 2] - (pose[0, 2] + robot.anchor_points[:, 2])
    fall = robot.mass * 9.81 * below.mean() / robot.ea.mean()
    found = first_guess(plain_setup(robot, seecr.Commands(pose)))
    assert found == pytest.approx([fall], rel=1e-3)


def test_what_balances_is_an_answer_though_scipy_gives_up() -> None:
    """fsolve says here that it makes no progress, at forces that balance to rounding."""
    robot = robot_of("demobot_parallel")
    pose = robot.reference_pose.copy()
    pose[[0, 2]] = 0.49, 0.1
    found = seecr.solve(robot, pose, method="fsolve")
    assert found.status[0] is seecr.Status.CONVERGED and found.residual[0] < 1e-12
    np.testing.assert_allclose(found.pose, seecr.solve(robot, pose).pose, atol=1e-9)
