"""Feedback: loops settle as their spectral radius says, and where no model is wrong at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from passive_files import FOLDER, LINE
from random_robots import random_poses, random_robot
from scipy.linalg import null_space

import seecr
from seecr.controlled.belief import Belief, TensionLimits
from seecr.controlled.loop import largest_delay, largest_gain, loop_eigenvalues, spectral_radius
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_rotate

COGIRO = seecr.load_robot("demobot_cogiro")
POSES = np.array([[x, 0.22, 0.15, 1, 0, 0, 0] for x in (0.25, 0.4, 0.55)])
LOOP = "elastic+pose_feedback"


def softer(robot: seecr.Robot, factor: float = 0.7) -> list[Any]:
    return [seecr.Term.of(robot, "stiffness", factor=factor)]


def of(scheme: str, robot: seecr.Robot = COGIRO, poses: Array = POSES, **more: Any) -> Any:
    return seecr.control(robot, poses, scheme=scheme, **more)[scheme]


def after(values: Sequence[complex], gain: float, delay: int, steps: int) -> float:
    """How much is left of an error of one after many steps, by stepping through them."""
    rate = 0.0
    for value in values:
        x = [1.0 + 0.0j] * (delay + 1)
        for _ in range(steps):
            x.append(x[-1] - gain * value * x[-1 - delay])
        rate = max(rate, float(np.max(np.abs(x[-20:])) ** (1.0 / steps)))
    return rate


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_radius_and_limits_are_those_of_stepping(delay: int) -> None:
    values = np.array([1.0, 0.6 + 0.3j, 0.6 - 0.3j])
    gain = largest_gain(values, delay)
    assert spectral_radius(values, gain, delay) == pytest.approx(1.0, abs=1e-9)
    for part, holds in ((0.95, True), (1.05, False)):
        radius = spectral_radius(values, part * gain, delay)
        assert radius == pytest.approx(after(values, part * gain, delay, 2000), rel=2e-3)
        assert (radius < 1.0) == holds
    assert largest_gain(np.array([1.0]), delay) == pytest.approx(
        2.0 * np.sin(np.pi / (4 * delay + 2))
    )
    most = largest_delay(values, 0.9 * gain)
    assert most >= delay
    assert (
        spectral_radius(values, 0.9 * gain, most)
        < 1
        < spectral_radius(values, 0.9 * gain, most + 1)
    )


def test_loops_that_cannot_hold_say_so() -> None:
    assert largest_gain(np.array([1.0, -0.1]), 0) == 0.0  # feedback of the wrong sign
    assert largest_gain(np.array([1.0, 0.0]), 0) == 0.0
    assert largest_delay(np.array([1.0]), 2.5) == -1
    # states that a controller never has are no part of its loop
    states = np.diag([1.0, 0.0])
    assert loop_eigenvalues(np.array([[0.5, 3.0], [0.0, 0.0]]), states) == pytest.approx([0.5])


def test_the_jacobian_is_that_of_the_pulls() -> None:
    """J = -(u, R b x u) of the paper's eq 4, not its transpose or its negative."""
    turn = quat_from_rotvec(np.array([0.1, -0.05, 0.2]))
    pose = np.array([[0.35, 0.22, 0.15, *turn]])
    belief = Belief(COGIRO, [], seecr.Commands(pose), TensionLimits())
    arm = quat_rotate(turn, COGIRO.anchor_points)
    pull = COGIRO.exit_points - pose[0, :3] - arm
    pull /= np.linalg.norm(pull, axis=1, keepdims=True)
    rows = -np.hstack([pull, np.cross(arm, pull)])
    assert belief.jacobian[0] == pytest.approx(rows, abs=1e-9)
    # a line that no winch drives is told nothing
    banded = replace(COGIRO, driven=np.arange(8) != 2)
    belief = Belief(banded, [], seecr.Commands(pose), TensionLimits())
    rows[2] = 0.0
    assert belief.jacobian[0] == pytest.approx(rows, abs=1e-9)


def test_drums_that_pay_out_more_are_told_less() -> None:
    gains = {f"gain_{k}": 0.1 for k in range(1, 9)}
    effects = [seecr.Term.of(COGIRO, "drum_gain", **gains).effect()]
    plain, known = (
        Belief(COGIRO, e, seecr.Commands(POSES), TensionLimits()) for e in ([], effects)
    )
    assert known.jacobian == pytest.approx(plain.jacobian / 1.1)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_loop_does_what_its_recurrence_says(delay: int) -> None:
    """The error e(k+1) = e(k) - g M e(k-d), where M is nearly one: no step early, none late."""
    gain = 0.3
    found = of(LOOP, true=softer(COGIRO), gain=gain, delay=0.1 * delay, rate=10.0, steps=12)
    errors = found.history[:, 1, 2]
    errors = errors[np.isfinite(errors)]
    want = [errors[0]] * (delay + 1)
    for _ in range(12 - delay):
        want.append(want[-1] - gain * want[-1 - delay])
    k = min(len(want), len(errors))
    assert k > 8 and errors[:k] == pytest.approx(np.array(want[:k]), rel=0.02, abs=2e-7)


def turned_tracker(robot: seecr.Robot, place: Array, angle: float) -> Any:
    """A tracker whose frame is turned about a place: errors come back along another direction."""
    shift = place - quat_rotate(quat_from_rotvec(np.array([0.0, 0.0, angle])), place)
    frame = {"shift_x_m": shift[0], "shift_y_m": shift[1], "rotation_z_rad": angle}
    return seecr.Term.of(robot, "tracker_frame", **frame)


WEIGHED = seecr.load_robot(FOLDER / "counterweight.xml")
CASES = {
    "cogiro": (COGIRO, POSES[:1], [turned_tracker(COGIRO, POSES[0, :3], 0.15)]),
    "counterweight": (WEIGHED, WEIGHED.reference_pose[None], []),
    **{
        kind: (robot := random_robot(np.random.default_rng(seed), kind, cables),
               random_poses(np.random.default_rng(seed), robot, 1), [])
        for kind, seed, cables in (("free", 3, 9), ("planar", 4, 5), ("jointed", 5, 6))
    },
}  # fmt: skip


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("name", CASES)
def test_the_limit_by_radius_is_that_of_the_simulated_loop(name: str, delay: int) -> None:
    """Within 2 %: a loop with a gain below the limit calms down, one above it grows."""
    robot, poses, more = CASES[name]
    push = dict.fromkeys(("force_x_N", "force_y_N"), 0.1 * robot.weight)
    true = [*softer(robot, 0.8), *more, seecr.Term.of(robot, "external_wrench", **push)]
    given = {"true": true, "delay": 0.1 * delay, "unstable": True,
             "steps": 450 if delay else 120}  # fmt: skip
    most = float(of(LOOP, robot, poses, gain=0.1, **given).gain[0])
    for part in (0.98, 1.02):
        found = of(LOOP, robot, poses, gain=part * most, **given)
        errors = np.linalg.norm(found.history[:, 0, :3], axis=1)
        errors = errors[np.isfinite(errors) & (errors > 1e-12)]
        k = len(errors) // 3  # what calms down anyhow is gone after the first third
        rate = (errors[2 * k :].max() / errors[k : 2 * k].max()) ** (1.0 / k)
        assert (rate < 1.0) == (part < 1.0) == (found.radius[0] < 1.0)
        assert found.settled[0] <= (part < 1.0)


def test_the_sign_of_a_feedback_matters() -> None:
    """With the error taken away from itself it grows, at every gain."""

    class Wrong(type(seecr.Scheme.named("pose_feedback").feedbacks[0])):  # type: ignore[misc]
        name = "wrong"

        def gains(self, belief: Any, seen: Any) -> Array:
            return -super().gains(belief, seen)

    scheme = seecr.Scheme("wrong", seecr.Scheme.named("elastic").forward, (Wrong(),))
    with pytest.raises(seecr.InputError, match="holds at none of these poses"):
        seecr.control(COGIRO, POSES, scheme=scheme)
    found = seecr.control(
        COGIRO, POSES, scheme=scheme, true=softer(COGIRO), unstable=True, steps=5
    )["wrong"]
    assert np.all(found.radius > 1.4)
    assert found.history[5, 0, 2] == pytest.approx(found.history[0, 0, 2] * 1.5**5, rel=0.05)


def test_a_pose_is_reached_whatever_the_model_lacks() -> None:
    true = [*softer(COGIRO), seecr.Term.of(COGIRO, "platform_mass", added_kg=0.1)]
    open_loop, alone, both = (of(name, true=true) for name in ("elastic", "pose_feedback", LOOP))
    assert open_loop.position_rms > 1e-4
    for found in (alone, both):
        assert found.settled.all() and found.position_rms < 3e-6
        # where the sensitivities say that it is: by solving with these lengths alone
        told = seecr.Commands(POSES, lengths=found.told, told=True)
        again = seecr.solve(COGIRO, told, effects=true)
        assert again.pose == pytest.approx(found.solution.pose, abs=1e-9)
    assert np.all(alone.steps > both.steps)  # from home all the way
    assert np.all(alone.travel.sum(axis=1)[1:] > both.travel.sum(axis=1)[1:])


def test_a_known_tracker_is_reckoned_with() -> None:
    """A shifted and turned tracker does no harm if it is believed, and shifts the platform else."""
    tracker = seecr.Term.of(
        COGIRO, "tracker_frame", shift_x_m=0.01, rotation_z_rad=0.02, rotation_x_rad=-0.01
    )
    known = of(LOOP, true=[*softer(COGIRO), tracker], believes=[tracker])
    assert known.position_rms < 3e-6
    unknown = of(LOOP, true=[*softer(COGIRO), tracker])
    assert unknown.position_rms > 5e-3
    assert pose_difference(unknown.read, POSES) == pytest.approx(np.zeros((3, 6)), abs=5e-6)


def test_positions_alone_are_enough_for_positions() -> None:
    found = of(LOOP, true=softer(COGIRO), reads=["position"])
    assert found.settled.all() and found.position_rms < 3e-6 and found.orientation_rms > 1e-5


def test_history_counts_from_row_to_row() -> None:
    rubs = seecr.Term.of(COGIRO, "hysteresis", amplitude_N=0.05, stretch_m=1e-3)
    true = [*softer(COGIRO, 0.5), rubs]
    commands = seecr.Commands(POSES)
    both = seecr.control(COGIRO, commands, scheme=["geometric", LOOP], true=true, gain=1.6)
    swept = seecr.solve(COGIRO, commands, effects=true)
    assert both["geometric"].solution.pose == pytest.approx(swept.pose, abs=1e-9)
    assert both[LOOP].settled.all() and both[LOOP].position_rms < 3e-6
    # the same lengths told in the order of the rows alone lead elsewhere: steps are history
    last = seecr.Commands(POSES, lengths=both[LOOP].told, told=True)
    away = seecr.solve(COGIRO, last, effects=true).pose - both[LOOP].solution.pose
    assert np.abs(away).max() > 5e-9


def test_noise_is_read_and_the_same_for_a_seed() -> None:
    given = {"true": softer(COGIRO), "steps": 60}
    noisy = [
        of(LOOP, noise=seecr.SensorNoise(1e-4, 1e-4, 0.0, seed), **given) for seed in (1, 1, 2)
    ]
    assert np.array_equal(noisy[0].told, noisy[1].told)
    assert not np.array_equal(noisy[0].told, noisy[2].told)
    # white noise through e(k+1) = (1 - g) e(k) - g v(k): variance g / (2 - g)
    off = np.concatenate([one.history[20:, :, :3].ravel() for one in noisy[1:]])
    assert np.nanstd(off) == pytest.approx(1e-4 * np.sqrt(0.5 / 1.5), rel=0.25)


def test_winches_hold_tensions() -> None:
    robot = seecr.load_robot("ipanema")
    poses = seecr.Commands(robot.reference_pose[None].copy())
    given = {"lowest": 100.0, "highest": 2000.0, "true": softer(robot, 0.8)}
    names = [robot.cable_names[k] for k in (0, 6)]
    held = of("tension_feedback", robot, poses, holding=names, **given)
    want = seecr.correct(robot, poses, lowest=100.0, highest=2000.0).solution.tensions
    assert held.settled.all() and held.radius[0] < 1.0
    assert held.solution.tensions[:, [0, 6]] == pytest.approx(want[:, [0, 6]], abs=0.05)
    # the others hold their lengths
    told = seecr.correct(robot, poses, lowest=100.0, highest=2000.0).lengths
    kept = np.delete(held.told, [0, 6], axis=1)
    assert np.array_equal(kept, np.delete(told, [0, 6], axis=1))


@pytest.mark.parametrize("passive", [(), ("cable3",)])
def test_cables_pull_against_each_other_as_they_should(passive: tuple[str, ...]) -> None:
    """Where all winches hold tensions, the spare ones do, and the platform has hardly moved.

    A taut line without a winch has no part in it: its pull is a load.
    """
    robot = seecr.load_robot(seecr.model_path("ipanema"), passive)
    driven = robot.driven
    robot = replace(robot, rest_lengths=robot.rest_lengths / np.where(driven, 1.0, 1.001))
    poses = seecr.Commands(robot.reference_pose[None].copy())
    given = {"lowest": 100.0, "highest": 2000.0, "true": softer(robot, 0.8)}
    want = seecr.correct(robot, poses, lowest=100.0, highest=2000.0).solution.tensions
    spread, before = (of(name, robot, poses, **given) for name in ("tension_feedback", "elastic"))
    assert spread.settled.all()
    left, was = (one.solution.tensions - want for one in (spread, before))
    arm, there = robot.anchor_points, robot.reference_pose[:3]
    pull = robot.exit_points - there - arm
    pull /= np.linalg.norm(pull, axis=1, keepdims=True)
    spare = null_space(np.vstack([pull.T, np.cross(arm, pull).T])[:, driven])
    left, was = (np.abs(off[:, driven] @ spare).max() for off in (left, was))
    assert left < 0.1 < 10.0 < was
    assert np.abs(spread.solution.pose - before.solution.pose).max() < 1e-4


@pytest.mark.parametrize("kind", ["spring", "counterweight"])
def test_passive_lines_follow_where_the_winches_of_the_others_lead(kind: str) -> None:
    """Poses are reached, tensions come back to those of `correct`, and what pulls is no winch's."""
    robot = seecr.load_robot(FOLDER / f"{kind}.xml")
    poses = np.tile(robot.reference_pose, (2, 1))
    poses[1, :3] += [0.1, 0.0, 0.05]
    passive, true = robot.cable_names.index(LINE[kind]), softer(robot, 0.8)
    for name in ("pose_feedback", LOOP):
        found = of(name, robot, poses, true=true)
        assert found.settled.all() and found.position_rms < 3e-6
        told = seecr.Commands(poses, lengths=found.told, told=True)
        assert seecr.solve(robot, told, effects=true).pose == pytest.approx(poses, abs=1e-5)
        assert np.all(found.told[:, passive] == robot.rest_lengths[passive])
        assert not found.travel[:, passive].any()
    if kind == "counterweight":  # with a cable to spare
        limits = {"lowest": 3.0, "highest": 100.0}
        want = seecr.correct(robot, poses, **limits).solution.tensions
        before, after = (
            of(name, robot, poses, true=true, **limits).solution.tensions
            for name in ("elastic", "tension_feedback")
        )
        assert np.abs(after - want).max() < 0.2 * np.abs(before - want).max()
