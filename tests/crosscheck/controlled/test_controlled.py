"""Control in MuJoCo with time: rest, vibrations, damping, winches, feedback; what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from called import ran, refused_in_a_line
from passive_files import FOLDER, KINDS
from random_robots import random_robot

import crosscheck
import seecr
from crosscheck.controlled.control import Timing
from crosscheck.controlled.machine import Machine, Winches
from crosscheck.suite.effects import (
    CONTROL,
    EffectCase,
    EffectResult,
    effect_text,
    effects_line,
    run_effect,
)
from seecr.pose import Array, moved_by, pose_add, pose_difference

COGIRO = seecr.load_robot(seecr.model_path("demobot_cogiro"))
POSE = np.array([[0.45, 0.25, 0.15, 1, 0, 0, 0]])
CALM = Winches(bandwidth=5.0, damping=0.2)
LOOP = "elastic+pose_feedback"
ROBOTS = {
    **{name: seecr.load_robot(seecr.model_path(name))
       for name in ("demobot_cogiro", "demobot_parallel", "planar_vertical", "camera")},
    **{kind: seecr.load_robot(FOLDER / f"{kind}.xml") for kind in KINDS},
    "reeved": replace(COGIRO, falls=np.array([1.0, 2.0, 4.0, 1.0, 0.5, 2.0, 3.0, 1.0])),
    "free": random_robot(np.random.default_rng(3), "free", 9),
}  # fmt: skip


def with_inertia(robot: seecr.Robot) -> seecr.Robot:
    if np.any(robot.inertia):
        return robot
    return replace(robot, inertia=np.diag([1.0, 1.2, 1.5]) * robot.mass * robot.length**2)


def ring(machine: Machine, pose: Array, told: Array, shape: Array, size: float = 1e-5) -> float:
    """The frequency [Hz] at which the platform swings that is let go beside where it rests.

    It is that of passes through the middle, without damping, over ten periods.

    Args:
        machine: whose damping is none. pose: (7,) at rest with told lengths (m,) [m].
        shape: (6,) [m, rad] the motion of a vibration. size: of the motion, relative to it.
    """
    machine.place(moved_by(pose[None], size * shape[None])[0], told)
    weight = np.concatenate([np.ones(3), np.full(3, machine.true.robot.length**2)])
    times, last = [], None
    for k in range(1, 40 * 64 * 64):
        machine.go(told, machine.step_s)
        now = float((weight * shape) @ pose_difference(machine.pose, pose))
        if last is not None and last < 0.0 <= now:
            times.append(machine.step_s * (k - now / (now - last)))
        last = now
        if len(times) == 11:
            return float(10.0 / (times[-1] - times[0]))
    return float("nan")


@pytest.mark.parametrize("name", ROBOTS)
def test_mujoco_vibrates_as_seecr_says(name: str) -> None:
    """Every eigenfrequency: by MuJoCo's accelerations to many digits, by swinging to 1 %."""
    robot = with_inertia(ROBOTS[name])
    effects = [seecr.Term.of(robot, "stiffness", factor=0.9).effect()]
    found = seecr.solve(robot, robot.reference_pose, effects=effects)
    frequencies, shapes = found.modes
    machine = Machine(robot, effects, Winches())
    machine.place(found.pose[0], robot.rest_lengths)
    assert machine.rates() / (2.0 * np.pi) == pytest.approx(frequencies[0], rel=1e-5)
    assert machine.tensions == pytest.approx(found.tensions[0], abs=1e-8 * robot.usual_load)
    for k in (0, robot.n_dof - 1):
        machine.place(found.pose[0], robot.rest_lengths)
        machine.tune(0.0)
        motion = found.motion(0, shapes[0, :, k])
        size = 1e-5 * robot.length / np.abs(motion * np.repeat([1.0, robot.length], 3)).max()
        swing = ring(machine, found.pose[0], robot.rest_lengths, motion, size)
        assert swing == pytest.approx(frequencies[0, k], rel=0.01)


def test_damping_is_a_part_of_critical() -> None:
    """A swing of the slowest vibration falls by exp(-2 pi z/sqrt(1 - z^2)) in each period."""
    found = seecr.solve(COGIRO, COGIRO.reference_pose)
    frequency, shape = found.frequencies[0, 0], found.modes[1][0, :, 0]
    motion = found.motion(0, shape)
    for part in (0.02, 0.2):
        machine = Machine(COGIRO, [], Winches(damping=part))
        machine.place(found.pose[0], COGIRO.rest_lengths)
        machine.tune()
        started = 1e-6 * motion / np.abs(motion).max()
        machine.place(pose_add(found.pose[0], started), COGIRO.rest_lengths)
        period = 1.0 / (frequency * np.sqrt(1.0 - part**2))
        machine.go(COGIRO.rest_lengths, 3.0 * period)
        left = pose_difference(machine.pose, found.pose[0]) @ motion / (started @ motion)
        assert left == pytest.approx(np.exp(-6 * np.pi * part / np.sqrt(1 - part**2)), rel=0.05)


def test_cables_only_pull_and_winches_lag() -> None:
    machine = Machine(COGIRO, [], Winches(bandwidth=2.0, speed=0.1))
    machine.settle()
    machine.go(COGIRO.rest_lengths + 0.2, 0.1)
    # 0.1 s at 0.1 m/s: the lag alone would ask for more
    assert machine.told - COGIRO.rest_lengths == pytest.approx(np.full(8, 0.01), rel=0.02)
    machine.go(COGIRO.rest_lengths + 0.2, 0.4)
    assert np.all(machine.tensions >= 0.0) and np.any(machine.tensions == 0.0)
    slow = Machine(COGIRO, [], Winches(bandwidth=2.0))
    slow.settle()
    slow.go(COGIRO.rest_lengths + 1e-3, 0.1)
    share = (slow.told - COGIRO.rest_lengths) / 1e-3
    assert share == pytest.approx(np.full(8, 1.0 - np.exp(-2.0 * np.pi * 2.0 * 0.1)), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["demobot_cogiro", "demobot_parallel"])
def test_slow_commands_come_to_rest_where_seecr_says_under_every_scheme(name: str) -> None:
    """The case of the suite: to the thresholds after settling; an error in it is seen."""
    result = run_effect(EffectCase(seecr.model_path(name), CONTROL))
    assert result.outcome.exit_status == 0 and result.worst[0] < 1e-7, effect_text(result)
    assert result.moved_m > 1e-5  # schemes differ
    assert effects_line([result]).startswith(
        "schemes of control on 1 robot against MuJoCo's own means: all agree"
    )
    off = EffectResult(result.case, result.position_m + 2e-6, *_rest(result))
    assert off.outcome.exit_status == 1
    assert "allowed 1e-06 m, 1e-05 rad, 1e-02 N; schemes differ by" in effect_text(off)


def _rest(result: EffectResult) -> tuple[Any, ...]:
    return result.orientation_rad, result.tension_N, result.compared, result.moved_m


@pytest.mark.parametrize(("name", "hold"), [
    ("planar_vertical", 24.0), ("camera", 72.0), ("band", 200.0), ("spring", 12.0),
    ("counterweight", 12.0), ("reeved", 12.0),
])  # fmt: skip
def test_other_robots_come_to_rest_too(name: str, hold: float) -> None:
    """On joints, with passive lines, with blocks and tackles."""
    robot = with_inertia(ROBOTS[name])
    true = [seecr.Term.of(robot, "platform_mass", added_kg=0.05 * robot.mass)]
    few, wanted = robot.n_driven < robot.n_dof, robot.reference_pose.copy()
    wanted[2] += 0.1 * few  # the band lets its platform stay up there alone
    more = ["tension_feedback"] if name in ("counterweight", "reeved") else []
    found = crosscheck.control_in_time(
        robot, wanted, scheme=["geometric", LOOP, *more], true=true, winches=CALM,
        timing=Timing(0.05 * robot.length, hold, 24.0 / hold), gain=0.8, lowest=0.1,
        any_orientation=few,
    )  # fmt: skip
    for one in found.schemes.values():
        assert one.same.tolist() == [True], str(found)
        off = one.trace.tensions[one.trace.ends] - one.rest.solution.tensions
        assert np.abs(off).max() < 1e-4 * robot.usual_load
    assert np.linalg.norm(found[LOOP].error[0, :3]) < 1e-6 * max(1.0, robot.length)


def test_each_run_begins_anew() -> None:
    """As if it were alone: from the reference pose, or from its first row."""
    poses = np.repeat(POSE, 3, axis=0)
    poses[:, 0] = [0.3, 0.45, 0.5]
    given = {"scheme": ["geometric", LOOP], "winches": CALM, "timing": Timing(0.1, 2.0, 2.0)}
    stands = np.array([True, True, False])
    for here in (None, stands):
        run = np.array([0, 1, 1])
        both = crosscheck.control_in_time(
            COGIRO, seecr.Commands(poses, run=run, stands=here), **given
        )
        other = seecr.Commands(poses[1:], stands=None if here is None else here[1:])
        alone = crosscheck.control_in_time(COGIRO, other, **given)
        for name in given["scheme"]:
            trace, only = both[name].trace, alone[name].trace
            second = trace.row > 0
            for values in ("told", "paid", "pose", "tensions"):
                assert np.array_equal(getattr(trace, values)[second], getattr(only, values))
            away = np.abs(only.told[0] - COGIRO.rest_lengths).max()
            assert (away < 0.01) == (here is None)


def test_a_block_and_tackle_moves_as_much_slower() -> None:
    """The rope of two falls runs twice as far as its cable gets shorter, on a winch as fast."""
    twice = replace(COGIRO, falls=np.full(8, 2.0))
    plain, reeved = (Machine(robot, [], Winches(speed=0.05)) for robot in (COGIRO, twice))
    for machine in (plain, reeved):
        machine.settle()
        machine.go(COGIRO.rest_lengths + 0.1, 0.2)
    turned, half = (one.told - COGIRO.rest_lengths for one in (plain, reeved))
    assert half == pytest.approx(0.5 * turned) and turned == pytest.approx(
        np.full(8, 0.01), rel=0.02
    )


def test_fast_commands_overshoot_and_vibrate_at_a_frequency_of_seecrs() -> None:
    fast, slow = (
        crosscheck.control_in_time(
            COGIRO, POSE, winches=Winches(20.0, np.inf, 0.005), timing=Timing(speed, 10.0, 10.0),
            scheme="geometric",
        )["geometric"]
        for speed in (0.3, 0.002)
    )  # fmt: skip
    assert fast.overshoot[0] > 1e-4 > 5.0 * slow.overshoot[0]
    assert fast.vibration is not None
    rate = fast.vibration[1]
    known = seecr.solve(COGIRO, POSE).frequencies[0]
    assert np.abs(known / rate - 1.0).min() < 0.01
    assert "Hz; seecr says" in str(fast)


@pytest.mark.parametrize(("gain", "delay", "grows"), [
    (0.8, 0, False), (2.1, 0, True), (0.5, 2, False), (0.68, 2, True), (0.9, 1, False),
    (1.1, 1, True),
])  # fmt: skip
def test_a_loop_diverges_if_its_spectral_radius_says_so(
    gain: float, delay: int, grows: bool
) -> None:
    """At a rate slow enough for vibrations to die out, and as fast as the radius says."""
    true = [seecr.Term.of(COGIRO, "stiffness", factor=0.8)]
    one = crosscheck.control_in_time(
        COGIRO, POSE, scheme=LOOP, true=true, gain=gain, unstable=True, delay=0.5 * delay,
        winches=CALM, timing=Timing(0.2, 16.0, 2.0),
    )[LOOP]  # fmt: skip
    radius = one.rest.radius
    assert radius is not None and (radius[0] > 1.0) == grows == bool(one.diverges[0])
    if grows:
        assert one.growth[0] == pytest.approx(radius[0], rel=0.03)
        assert "the feedback diverges at 1 of 1" in str(one)
    else:
        assert one.same.all() or one.growth[0] < 1.0


def test_the_tracker_of_the_truth_is_read() -> None:
    shifted = seecr.Term.of(COGIRO, "tracker_frame", shift_x_m=0.01)
    given = {"winches": CALM, "timing": Timing(0.1, 12.0, 2.0), "gain": 0.8}
    one = crosscheck.control_in_time(COGIRO, POSE, scheme=LOOP, true=[shifted], **given)[LOOP]
    assert one.trace.read[-1, 0] == pytest.approx(POSE[0, 0], abs=1e-6)
    assert one.trace.pose[-1, 0] == pytest.approx(POSE[0, 0] - 0.01, abs=1e-6)
    assert one.same.all()
    known = crosscheck.control_in_time(
        COGIRO, POSE, scheme=LOOP, true=[shifted], believes=[shifted], **given
    )[LOOP]
    assert known.trace.pose[-1, 0] == pytest.approx(POSE[0, 0], abs=1e-6)


@pytest.mark.parametrize("name", ["demobot_cogiro", "spring"])
def test_winches_of_the_truth_turn(name: str) -> None:
    """Those of the driven lines: a spring stays as long, however the robot was zeroed."""
    robot = ROBOTS[name]
    wanted = robot.reference_pose + 0.05 * np.eye(7)[0]
    gains = {f"gain_{k}": 0.01 * k for k in range(1, robot.n_driven + 1)}
    shift = {f"offset_{k}_m": 1e-4 * k for k in range(1, robot.n_driven + 1)}
    true = [
        seecr.Term.of(robot, "drum_gain", **gains),
        seecr.Term.of(robot, "cable_length_offset", **shift),
        seecr.Term.of(robot, "initial_pose_error", position_x_m=0.002, position_z_m=0.003),
        seecr.Term.of(robot, "drum_eccentricity", sine_1_m=1e-3, drum_radius_m=0.02),
        seecr.Term.of(robot, "external_wrench", force_x_N=0.1),
    ]
    given = {"winches": CALM, "timing": Timing(0.1, 6.0, 2.0)}
    found = crosscheck.control_in_time(robot, wanted, scheme="geometric", true=true, **given)
    assert found["geometric"].same.all(), str(found)


def test_the_command_writes_and_says_how_it_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.45,0.25,0.15\n")
    Path("true.toml").write_text('[[effect]]\nname = "stiffness"\nparameters = { factor = 0.8 }\n')
    line = "crosscheck control demobot_cogiro poses.csv --is true.toml --scheme geometric"
    said = ran(f"{line},{LOOP} --damping 0.2 --rate 2 --hold 8 --out out", 0).stdout
    assert "comes to rest where seecr says, at all 1 pose" in said
    names = {f"{name}.{kind}" for name in ("geometric", LOOP) for kind in ("csv", "rrd")}
    assert {file.name for file in Path("out").glob("[!.]*")} == {
        *names, "control.json", "control.png"
    }  # fmt: skip
    document = json.loads(Path("out/control.json").read_text())
    one = document["schemes"]["geometric"]
    assert one["timed"][0]["from_rest_m"] < 1e-6 and one["rows"][0]["status"] == "converged"
    lines = Path("out/geometric.csv").read_text().splitlines()
    assert lines[0].startswith("t_s,pose,held,want_x_m,") and len(lines) > 100
    still = ran(f"{line} --damping 0.001 --hold 1 --speed 1 --figure none --no-recording", 1).stdout
    assert "it still moves in the end: hold longer, or damp more at 1 of 1: line 2" in still


@pytest.mark.parametrize(("effect", "value"), [("pulley_radius", "radius_m = 0.01"),
                                               ("backlash", "gap_m = 0.001")])  # fmt: skip
def test_effects_at_rest_alone_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, effect: str, value: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.45,0.25,0.15\n")
    Path("true.toml").write_text(f'[[effect]]\nname = "{effect}"\nparameters = {{ {value} }}\n')
    line = refused_in_a_line("crosscheck control demobot_cogiro poses.csv --is true.toml")
    assert f"{effect}: crosscheck control moves straight cables without mass or memory" in line
    for words in ("--hold 0", "--damping 0", "--bandwidth 0", "--speed 0", "--winch-speed -1"):
        name, _, value = words.removeprefix("--").replace("h-s", "h s").partition(" ")
        if name == "winch":
            name, value = "winch speed", "-1"
        said = refused_in_a_line(f"crosscheck control demobot_cogiro poses.csv {words}")
        assert f"{name}: expected a number above 0, got {value}" in said
    assert not Path("control").exists()
    Path("loaded.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m,payload_kg\n0.45,0.25,0.15,0.1\n")
    line = refused_in_a_line("crosscheck control demobot_cogiro loaded.csv")
    assert "moves robots without known loads" in line
