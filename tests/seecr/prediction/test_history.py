"""Rows that remember: the path between rows, hysteresis, friction, backlash and creep."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from effect_cases import experiment_of, robot_of

import seecr
from seecr.commands import play, waypoints_of
from seecr.compiled.columns import TENSION, WINCH_TENSION
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.mjcf import CABLES
from seecr.pose import pose_add, pose_difference

WEIGHT = 2 * 9.81


def effect(name: str, **values: object) -> seecr.Effect:
    return seecr.effect_named(name)(**values)


def lift() -> seecr.Robot:
    """2 kg on a slide, pulled up by one cable of 1 m and down by another, both E S = 1000 N."""
    return seecr.Robot(
        "lift", np.array([[0.0, 0, 1], [0, 0, -1]]), np.zeros((2, 3)), np.full(2, 1000.0),
        np.array([1.0, 0.95]), 2.0,
        joints=(seecr.Joint("slide", "z", np.array([0.0, 0, 1]), np.zeros(3)),),
    )  # fmt: skip


def lifted(heights: np.ndarray, *effects: seecr.Effect, **more: object) -> seecr.Prediction:
    poses = np.zeros((len(heights), 7))
    poses[:, 2], poses[:, 3] = heights, 1.0
    found = seecr.Experiment(lift(), seecr.Commands(poses, **more)).predict(effects)
    assert np.all(found.solved)
    return found


# --- the path ------------------------------------------------------------------------------------


def test_each_run_starts_at_the_reference_pose_and_goes_straight_from_row_to_row() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot, commands = experiment.robot, experiment.commands
    path = waypoints_of(robot, commands)
    assert np.array_equal(path.commands.pose[path.rows], commands.pose)
    assert path.fresh.sum() == 2
    assert np.array_equal(path.commands.pose[path.fresh], np.tile(robot.reference_pose, (2, 1)))
    first, second = path.rows[0], path.rows[1]
    whole = pose_difference(commands.pose[1], commands.pose[0])
    for k in range(first, second + 1):
        part = pose_difference(path.commands.pose[k], commands.pose[0])
        share = (k - first) / (second - first)
        assert part == pytest.approx(share * whole, abs=1e-12)


def test_the_clock_runs_once_through_the_path() -> None:
    experiment = experiment_of("demobot_cogiro")
    time = experiment.commands.time
    path = waypoints_of(experiment.robot, experiment.commands)
    assert time is not None
    assert np.cumsum(path.elapsed)[path.rows] == pytest.approx(time - time[0], abs=1e-12)
    assert path.elapsed[path.fresh][1] == pytest.approx(time[3] - time[2])  # waits at home


@pytest.mark.parametrize("seed", range(4))
def test_a_platform_on_joints_never_leaves_them_on_its_way(seed: int) -> None:
    experiment = experiment_of("jointed", seed=seed)
    path = waypoints_of(experiment.robot, experiment.commands)
    values_of_pose(experiment.robot, path.commands.pose)  # raises where it does
    found = experiment.predict([effect("backlash", gap=1e-4)])
    assert np.all(found.solved)


def test_lengths_move_evenly_too() -> None:
    experiment = experiment_of("lengths")
    path = waypoints_of(experiment.robot, experiment.commands)
    lengths, told = path.commands.lengths, experiment.commands.lengths
    assert lengths is not None and told is not None
    assert lengths[path.fresh][0] == pytest.approx(experiment.robot.rest_lengths)
    middle = (path.rows[0] + path.rows[1]) // 2
    assert lengths[middle] == pytest.approx(0.5 * (told[0] + told[1]), abs=1e-12)


@pytest.mark.parametrize("name, values", [
    ("hysteresis", {"amplitude": 0.2, "stretch": 2e-4}),
    ("exit_friction", {"friction": 0.3, "length": 0.4}),
])  # fmt: skip
def test_poses_asked_for_on_the_way_hardly_change_the_rows(
    name: str, values: dict[str, float]
) -> None:
    """With two steps to each row, what turned round in between was missed."""
    apart = []
    for seed in range(8):
        experiment = experiment_of("demobot_parallel", seed=seed, reach=0.6)
        robot, acts = experiment.robot, [effect(name, **values)]
        way = waypoints_of(robot, experiment.commands, waypoints=0.005)
        run, there = way.commands.run, ~way.fresh
        assert run is not None
        closely = seecr.Commands(way.commands.pose[there], run=run[there])
        rows = (np.cumsum(there) - 1)[way.rows]
        fine = seecr.Experiment(robot, closely).predict(acts)
        found, plain = experiment.predict(acts), experiment.predict()
        assert found.solved.all() and fine.solved.all()
        largest = np.abs(pose_difference(found.pose, plain.pose)).max()
        apart.append(np.abs(pose_difference(found.pose, fine.pose[rows])).max() / largest)
    assert np.median(apart) < 0.04


# --- backlash ------------------------------------------------------------------------------------


def test_the_play_operator_is_the_one_that_goes_row_by_row() -> None:
    rng = np.random.default_rng(0)
    told, starts = np.cumsum(rng.normal(size=(300, 3)), axis=0), np.arange(300) % 100 == 0
    half = np.array([0.0, 0.7, 20.0])
    expected = told.copy()
    for k in range(1, 300):
        if not starts[k]:
            near = np.maximum(expected[k - 1], told[k] - half)
            expected[k] = np.minimum(near, told[k] + half)
    assert np.array_equal(play(told, starts, half), expected)
    # every other row as what is passed between the others
    passed = np.stack([np.roll(told[1::2], 1, axis=0), told[::2]])
    passed[0, ::50] = told[::100]
    assert np.array_equal(play(told[1::2], starts[::2], half, passed), expected[1::2])


def paid_out(robot: seecr.Robot, commands: seecr.Commands, gap: float) -> np.ndarray:
    """Rest lengths (n, m) [m] of the rows, the same with waypoints as without."""
    experiment = seecr.Experiment(robot, commands)
    loose = [effect("backlash", gap=gap)]
    rows = experiment.setup(loose).rest_lengths()
    walked = experiment.setup(loose, experiment.path.commands).rest_lengths()
    assert rows == pytest.approx(walked[experiment.path.rows], abs=1e-12)
    return rows


@pytest.mark.parametrize("start", [[0.0], []])
def test_a_cable_that_turns_round_between_two_rows_takes_up_its_play_there(
    start: list[float],
) -> None:
    """Past an exit point 1 m above the way: 1.25 m, 1 m at x = 0.75 m, and longer again."""
    robot = seecr.Robot(
        "rail", np.array([[0.75, 0.0, 1.0]]), np.zeros((1, 3)), np.array([1000.0]),
        np.array([1.25]), 2.0,
        joints=(seecr.Joint("slide", "x", np.array([1.0, 0, 0]), np.zeros(3)),),
    )  # fmt: skip
    x = np.array([*start, 1.0, 1.5])
    poses = np.zeros((len(x), 7))
    poses[:, 0], poses[:, 3] = x, 1.0
    # shortest, it is half a gap behind: 1.02 m; at x = 1 m, where it should have
    # sqrt(17)/4 = 1.031 m, it still is; at x = 1.5 m it is behind the other way
    found = paid_out(robot, seecr.Commands(poses), 0.04)[len(start) :, 0]
    assert found == pytest.approx([1.02, 1.25 - 0.02], abs=1e-14)


@pytest.mark.parametrize(
    "joints", [(seecr.Joint("hinge", "c", np.array([0.0, 0, 1]), np.zeros(3)),), ()]
)
def test_a_cable_on_a_crank_turns_round_at_both_dead_centres(
    joints: tuple[seecr.Joint, ...],
) -> None:
    """2 m from the axis of a crank of 1 m: 1 m of cable at 0 rad, 3 m at pi."""
    crank = np.array([[np.cos(1.0), np.sin(1.0), 0.0]])
    robot = seecr.Robot(
        "crank", np.array([[2.0, 0.0, 0.0]]), crank, np.array([1000.0]),
        np.sqrt([5 - 4 * np.cos(1.0)]), 2.0, joints=joints,
    )  # fmt: skip
    # a free platform takes the shorter way round: one row more
    angles = np.array([-1.5, 3.5] if joints else [-1.5, 1.3, 3.5])
    half = 0.5 * (angles - 1.0)
    poses = np.zeros((len(angles), 7))
    poses[:, 3], poses[:, 6] = np.cos(half), np.sin(half)
    found = paid_out(robot, seecr.Commands(poses), 1.0)[:, 0]
    told = np.sqrt(5 - 4 * np.cos(angles))
    assert found[0] == pytest.approx(told[0] - 0.5, abs=1e-13)
    assert found[-1] == pytest.approx(3.0 - 0.5, abs=1e-13) and told[-1] < 2.96


def finer(
    robot: seecr.Robot, commands: seecr.Commands, by: int
) -> tuple[seecr.Commands, np.ndarray]:
    """More rows on the same straight ways, and where the first ones are among them."""
    n, run = len(commands), commands.run
    assert run is not None
    whole: list[np.ndarray] = []
    for k in range(n):
        starts = k == 0 or run[k] != run[k - 1]
        before = robot.reference_pose if starts else commands.pose[k - 1]
        ends = np.stack([before, commands.pose[k]])
        parts = np.arange(1, by)[:, None] / by
        if robot.joints:
            values = values_of_pose(robot, ends)[0]
            way = pose_of_values(robot, values[0] + parts * (values[1] - values[0]))[0]
        else:
            way = pose_add(np.tile(before, (by - 1, 1)), parts * pose_difference(ends[1], ends[0]))
        whole += [*way, commands.pose[k]]
    rows = by * np.arange(1, n + 1) - 1
    return seecr.Commands(np.array(whole), run=np.repeat(run, by)), rows


@pytest.mark.parametrize("gap", [2e-4, 2e-3, 2e-2])
@pytest.mark.parametrize("kind, seed", [
    ("demobot_parallel", 0), ("demobot_cogiro", 0), ("jointed", 1), ("jointed", 2),
])  # fmt: skip
def test_more_rows_on_the_same_way_leave_backlash_as_it_is(
    kind: str, seed: int, gap: float
) -> None:
    experiment = experiment_of(kind, seed=seed, rows=10)
    robot, commands = experiment.robot, experiment.commands
    fine, rows = finer(robot, commands, 9)
    coarse = paid_out(robot, commands, gap)
    assert coarse == pytest.approx(paid_out(robot, fine, gap)[rows], abs=1e-12)
    told = experiment.setup([]).rest_lengths()
    assert np.abs(coarse - told).max() > 0.49 * gap  # it is there


def test_backlash_parts_the_way_up_from_the_way_down_by_its_gap() -> None:
    heights = np.array([0.05, 0.1, 0.15, 0.2, 0.15, 0.1, 0.05])
    z = lifted(heights, effect("backlash", gap=2e-3)).readings.position[:, 2]
    plain = lifted(heights).readings.position[:, 2]
    # rising, the upper cable lags long and the lower one short: both hold the platform down
    assert z[2] < plain[2] - 9e-4 and z[4] > plain[4] + 9e-4
    assert z[4] - z[2] == pytest.approx(2e-3, rel=0.05)


# --- hysteresis ----------------------------------------------------------------------------------


def test_hysteresis_parts_the_sweeps_by_twice_its_amplitude_at_most() -> None:
    steps = np.linspace(0, 0.1, 6)[1:]
    # lowering and raising the platform a lot: the stretch changes through the cables' own lengths
    heights = np.concatenate([steps, steps[::-1][1:], [0.0], -steps, -steps[::-1][1:]])
    turned = lifted(heights, effect("hysteresis", amplitude=0.5, stretch=1e-4))
    plain = lifted(heights)
    parted = (turned.readings.position - plain.readings.position)[:, 2]
    assert np.ptp(parted) > 1e-5  # it does something
    # z of either cable within the amplitude: the platform feels at most both against 2 k
    soft = float(plain.found.hessian.min())
    assert np.abs(parted).max() <= 2 * 0.5 / soft * 1.05


def lift_by_small_steps(lengths: np.ndarray, amplitude: float, turning: float) -> list[float]:
    """Heights of the lift: Dahl's law along the lengths in small steps, frozen while slack.

    Where a cable would push, it pulls no more, and keeps stretch and friction until it would pull
    again.
    """
    ea, weight, substeps = 1000.0, WEIGHT, 1600
    stretch, friction, heights = [0.0, 0.0], [0.0, 0.0], []

    # numbers and not arrays: of two cables they take a quarter of the time
    def tried(height: float, rest: list[float], start: bool) -> list[tuple[float, float, float]]:
        """Tension, stretch and friction of both cables."""
        out = []
        for k, span in enumerate((1.0 - height, 1.0 + height)):
            e = span - rest[k]
            moved = e - stretch[k]
            limit = math.copysign(amplitude, moved) if moved else 0.0
            z = 0.0 if start else limit + (friction[k] - limit) * math.exp(-abs(moved) / turning)
            out.append((max(ea * e / rest[k] + z, 0.0), e, z))
        return out

    def rests(rest: list[float], start: bool) -> float:
        low, high = -0.5, 0.5
        for _ in range(60):
            middle = 0.5 * (low + high)
            upper, lower = tried(middle, rest, start)
            low, high = (middle, high) if upper[0] - lower[0] > weight else (low, middle)
        return low

    before = lengths[0]
    for row, target in enumerate(lengths):
        for part in np.linspace(0.0, 1.0, substeps + 1)[1:] if row else [1.0]:
            rest = (before + part * (target - before)).tolist()
            height = rests(rest, row == 0)
            for k, (tension, e, z) in enumerate(tried(height, rest, row == 0)):
                if tension > 0.0:
                    stretch[k], friction[k] = e, z
        before = target
        heights.append(height)
    return heights


@pytest.mark.slow
def test_a_slack_cable_keeps_its_stretch_and_its_friction_and_pulls_again_from_there() -> None:
    robot = lift()
    lower = robot.rest_lengths[1] + np.array([0.0, 0.02, 0.08, 0.05, 0.09, 0.02, -0.01, 0.06, 0.0])
    lengths = np.column_stack([np.full(len(lower), robot.rest_lengths[0]), lower])
    pose = np.tile(robot.reference_pose, (len(lower), 1))
    turned = effect("hysteresis", amplitude=2.0, stretch=5e-3)
    found = seecr.Experiment(robot, seecr.Commands(pose, lengths)).predict([turned])
    assert found.solved.all() and 0 < found.slack[:, 1].sum() < len(lower)
    heights = lift_by_small_steps(lengths, 2.0, 5e-3)
    plain = seecr.Experiment(robot, seecr.Commands(pose, lengths)).predict()
    assert np.ptp(found.pose[:, 2] - plain.pose[:, 2]) > 5e-4  # or there is nothing to see
    assert found.pose[:, 2] == pytest.approx(heights, abs=2e-6)


@pytest.mark.slow
def test_the_error_of_walking_in_steps_is_stated() -> None:
    """The last row's lower cable goes slack, turns, and pulls again between waypoints."""
    robot = lift()
    lower = robot.rest_lengths[1] + np.array([0.0, 0.004, 0.03, 0.001, 0.025, -0.003, 0.04, 0.0])
    lengths = np.column_stack([np.full(len(lower), robot.rest_lengths[0]), lower])
    pose = np.tile(robot.reference_pose, (len(lower), 1))
    turned = effect("hysteresis", amplitude=2.0, stretch=5e-3)
    experiment = seecr.Experiment(robot, seecr.Commands(pose, lengths))
    found = experiment.predict([turned]).solution()
    stated = experiment.error_of_steps([turned], found)
    true = np.abs(found.pose[:, 2] - lift_by_small_steps(lengths, 2.0, 5e-3))
    assert 0.5 * stated[-1, 0] < true[-1] < stated[-1, 0]
    assert true[-1] > 5e-8 and np.all(stated[:-1] < 1e-11)


@pytest.mark.parametrize("name, values", [
    ("hysteresis", {"amplitude": 0.2, "stretch": 2e-4}),
    ("exit_friction", {"friction": 0.2, "length": 0.4}),
    ("backlash", {"gap": 1e-3}),
])  # fmt: skip
@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel"])
def test_forward_and_back_part_and_each_run_starts_anew(
    kind: str, name: str, values: dict[str, float]
) -> None:
    robot = replace(robot_of(kind), ea=np.full(8, CABLES["fishing"]))
    x = np.concatenate([np.linspace(0.3, 0.5, 9), np.linspace(0.5, 0.3, 9)[1:]])
    one = np.tile([0.0, 0.25, 0.15, 1, 0, 0, 0], (17, 1))
    one[:, 0] = x
    there = [effect(name, **values)]
    both = seecr.Commands(np.tile(one, (2, 1)), run=np.repeat([0, 1], 17))
    found = seecr.Experiment(robot, both).predict(there)
    assert np.all(found.solved) and found.has_history
    apart = np.abs(found.readings.position[:8] - found.readings.position[9:17][::-1]).max()
    plain = seecr.Experiment(robot, both).predict().readings.position
    assert apart > 1e-6 and np.abs(plain[:8] - plain[9:17][::-1]).max() < 1e-11
    assert np.array_equal(found.readings.position[:17], found.readings.position[17:])
    alone = seecr.Experiment(robot, seecr.Commands(one)).predict(there)
    assert found.readings.position[17:] == pytest.approx(alone.readings.position, abs=1e-12)


# --- friction ------------------------------------------------------------------------------------


def test_the_tensions_about_an_exit_point_differ_by_the_capstans_factor_at_most() -> None:

    robot = robot_of("demobot_parallel")
    # far away, then to and fro by less and less: first all cables slip, in the end none
    x = np.array([0.1, 0.1 + 1e-4, 0.1, 0.1 + 3e-5, 0.1, 0.1 + 1e-6, 0.1])
    poses = np.tile(robot.reference_pose, (len(x), 1))
    poses[:, 0] += x
    found = seecr.Experiment(robot, seecr.Commands(poses)).predict(
        [effect("exit_friction", friction=0.15, length=0.4)]
    )
    assert np.all(found.solved)
    front = found.found.states[..., TENSION]
    behind = found.found.states[..., WINCH_TENSION]
    taut = (front > 1e-3).all(axis=0)
    assert taut.sum() >= 4
    every = np.abs(np.log(behind[:, taut] / front[:, taut]))
    ratio = every.ravel()
    assert ratio.max() <= 0.15 + 1e-12
    slips = ratio > 0.15 - 1e-12
    assert slips.any() and not slips.all()
    assert np.all(every[0] > 0.15 - 1e-12) and np.any(every[-1] < 0.15 - 1e-6)


# --- creep ---------------------------------------------------------------------------------------


def hold(
    times: np.ndarray, amount: float, constant: float, run: np.ndarray | None = None
) -> np.ndarray:
    """Fall [m] below the command of 2 kg hung on one cable of 1 m and E S = 1000 N at times [s]."""
    robot = replace(
        lift(), exit_points=np.array([[0.0, 0, 1]]), anchor_points=np.zeros((1, 3)),
        ea=np.array([1000.0]), rest_lengths=np.ones(1), cable_names=(),
    )  # fmt: skip
    poses = np.tile(robot.reference_pose, (len(times), 1))
    found = seecr.Experiment(robot, seecr.Commands(poses, time=times, run=run)).predict(
        [effect("creep", amount=amount, time=constant)]
    )
    assert np.all(found.solved)
    return -found.readings.position[:, 2]


@pytest.mark.parametrize("step", [0.5, 7.0, 300.0])
def test_creep_under_constant_load_ends_at_its_amount_of_the_elastic_strain(step: float) -> None:
    times = np.arange(20) * step
    elastic = WEIGHT / 1000
    expected = elastic * (1 + 0.3 * (1 - np.exp(-times / 50)))
    assert hold(times, 0.3, 50.0) == pytest.approx(expected, rel=1e-9)


def test_creep_goes_by_the_clock_through_runs() -> None:
    times = np.array([0.0, 10, 20, 100, 110, 400])
    one = hold(times, 0.3, 50.0)
    assert hold(times, 0.3, 50.0, run=np.array([0, 0, 0, 1, 1, 2])) == pytest.approx(one, rel=1e-9)


def test_creep_long_after_a_change_of_load_has_forgotten_what_was_before() -> None:
    """The strain follows the load of now: after many time constants that of the row itself."""
    robot = robot_of("demobot_parallel")
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] += [0.0, 0.15, 0.15]
    times = np.array([0.0, 1e3, 2e3])
    found = seecr.Experiment(robot, seecr.Commands(poses, time=times)).predict(
        [effect("creep", amount=0.5, time=1.0)]
    )
    assert np.all(found.solved)
    assert found.readings.position[1] == pytest.approx(found.readings.position[2], abs=1e-6)


# --- Waypoints solved in order: what a lost one means for the others


LASTING = {"hysteresis": {"amplitude_N": 0.1}, "creep": {"amount": 0.1, "time_s": 50.0}}


@pytest.mark.parametrize("name", LASTING)
def test_a_row_without_rest_ends_its_run_and_no_other(name: str) -> None:
    """A pull of a giganewton in the second row of six; the third could rest by itself."""
    robot = seecr.load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (6, 1))
    poses[:, 0] += [0.01, 0.02, 0.03, -0.01, 0.04, 0.0]
    wrench = np.zeros((6, 6))
    wrench[1, 0] = 1e9
    commands = seecr.Commands(
        poses, run=np.repeat([0, 1], 3), time=10.0 * np.arange(6),
        loads=seecr.Loads.of(6, wrench=wrench),
    )  # fmt: skip
    lasts = [seecr.Term.of(robot, name, **LASTING[name]).effect()]
    found = seecr.Experiment(robot, commands).predict(lasts)
    assert found.solved.tolist() == [True, False, False, True, True, True]
    assert seecr.Experiment(robot, commands).predict().solved[2]
    # nor is anything looked for behind the first waypoint that is lost
    assert found.walk is not None
    lost = np.flatnonzero(~found.walk.solved)
    assert found.walk.count[lost[0]] > 0 and not found.walk.count[lost[1:]].any()
    if name == "hysteresis":  # creep goes on through runs
        alone = seecr.Experiment(robot, commands.rows(np.arange(3, 6))).predict(lasts)
        np.testing.assert_array_equal(found.pose[3:], alone.pose)
