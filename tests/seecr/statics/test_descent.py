"""The compiled loop: small rotations, joints, gradient and stiffness against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from random_robots import KINDS, random_poses, random_robot

from seecr import Commands, Experiment, Robot, load_robot
from seecr.compiled.algebra import rotated_less
from seecr.compiled.columns import (
    CONVERGED,
    EXTERNAL_MOMENT,
    GAP,
    ITERATIONS,
    N_LOAD,
    REST,
    STRAIN,
    TENSION,
)
from seecr.compiled.joint_kinematics import N_CURRENT, place_joints
from seecr.compiled.platform import work_of_moment
from seecr.description.joints import pose_of_values
from seecr.effects.setup import plain_setup
from seecr.parallel import undivided
from seecr.pose import pose_difference, quat_from_rotvec, quat_multiply
from seecr.statics import batch
from seecr.statics.batch import Evaluation
from seecr.statics.tables import Tables, assemble


def tables_of(robot: Robot, poses: np.ndarray, **changes: object) -> Tables:
    setup = plain_setup(robot, Commands(poses))
    for name, value in changes.items():
        setattr(setup, name, value)
    return assemble(setup)


def at(tables: Tables, steps: np.ndarray) -> Evaluation:
    """The loop's numbers a step (n, d) [m] away from the commanded poses."""
    point = Evaluation.empty(len(tables), tables.cables.shape[1], tables.n_dof)
    if tables.screws.shape[1]:
        point.values[:] = steps
    else:
        point.deviation[:, :3] = steps[:, :3]
        point.deviation[:, 3:] = quat_from_rotvec(steps[:, 3:] / tables.length)
    return batch.evaluate(tables, point)


def after(tables: Tables, first: np.ndarray, then: np.ndarray) -> np.ndarray:
    """The step that equals ``first`` and then ``then``, rotations from the left."""
    if tables.screws.shape[1]:
        return np.asarray(first + then)
    turn = quat_multiply(
        quat_from_rotvec(then[:, 3:] / tables.length),
        quat_from_rotvec(first[:, 3:] / tables.length),
    )
    pose = np.column_stack([first[:, :3] + then[:, :3], turn])
    rest = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(pose), 1))
    change = pose_difference(pose, rest)
    change[:, 3:] *= tables.length
    return change


# --- rotations ---------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [1e-300, 1e-17, 1e-9, 1e-3, 1.0, 3.0])
def test_a_small_rotation_keeps_all_its_digits(angle: float) -> None:
    out = rotated_less(*quat_from_rotvec(np.array([0, 0, angle])), 3.0, -2.0, 5.0)
    less, sine = -2.0 * np.sin(angle / 2) ** 2, np.sin(angle)
    expected = [3 * less + 2 * sine, 3 * sine - 2 * less, 0.0]
    assert out == pytest.approx(expected, rel=1e-14, abs=0)


@pytest.mark.parametrize("seed", range(5))
def test_joints_move_the_platform_as_the_product_of_exponentials(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "jointed")
    first, step = rng.uniform(-0.4, 0.4, (2, robot.n_dof))
    pose, screws = pose_of_values(robot, first)
    expected, now = pose_of_values(robot, first + step)
    unit = np.array([robot.length if j.kind == "hinge" else 1.0 for j in robot.joints])
    deviation, current = np.empty(7), np.empty((len(screws[0]), N_CURRENT))
    place_joints(screws[0], step * unit, robot.length, pose[0, :3], deviation, current)
    moved = np.concatenate([pose[0, :3] + deviation[:3],
                            quat_multiply(deviation[3:], pose[0, 3:])])  # fmt: skip
    assert pose_difference(moved, expected[0]) == pytest.approx(np.zeros(6), abs=1e-13)
    assert current[:, :4] == pytest.approx(now[0, :, :4], abs=1e-13)


# --- linear algebra ----------------------------------------------------------------------------


def test_residual_is_the_larger_of_force_and_torque() -> None:
    gradient = np.array([[3.0, 4, 0, 0, 0, 12]])
    assert batch.residual_size(gradient) == batch.residual_size(gradient[:, ::-1]) == [12.0]
    assert batch.residual_size(gradient[:, :3]) == [5.0]


# --- gradient and stiffness --------------------------------------------------------------------


def near_slack(rng: np.random.Generator, tables: Tables, steps: np.ndarray) -> Tables:
    """The same, with the cables' stretch at ``steps`` a few hundred thousandths of nothing."""
    stretch = at(tables, steps).states[..., STRAIN] * tables.cables[..., REST]
    aim = 1e-5 * tables.length * rng.uniform(0.5, 1, stretch.shape)
    aim *= rng.choice([-1, 1], stretch.shape)
    cables = tables.cables.copy()
    cables[..., GAP] += aim - stretch
    return replace(tables, cables=cables)


@pytest.mark.parametrize("slack", [False, True], ids=["anywhere", "near-slack"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_gradient_and_stiffness_against_differences(kind: str, seed: int, slack: bool) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, kind)
    tables = tables_of(
        robot, random_poses(rng, robot, 6), wrench=robot.weight * 0.3 * rng.normal(size=(6, 6))
        * np.array([1, 1, 1, 0, 0, 0])
    )  # fmt: skip
    steps = 0.3 * tables.length * rng.uniform(-1, 1, (6, tables.n_dof))
    if slack:
        tables = near_slack(rng, tables, steps)
    here = at(tables, steps)
    if slack:
        taut = here.states[..., TENSION] > 0
        assert np.any(taut) and np.any(~taut)
    gradient, hessian = np.empty_like(here.gradient), np.empty_like(here.hessian)
    slopes = np.empty_like(here.slopes)
    size = 1e-6 * tables.length
    for k in range(tables.n_dof):
        step = np.zeros_like(steps)
        step[:, k] = size
        ahead, behind = (at(tables, after(tables, steps, s)) for s in (step, -step))
        gradient[:, k] = (ahead.energy - behind.energy) / (2 * size)
        hessian[:, :, k] = (ahead.gradient - behind.gradient) / (2 * size)
        slopes[..., k] = (ahead.states - behind.states)[..., TENSION] / (2 * size)
    if not robot.joints:
        # a step from the left turns the frame in which torques are counted: half of it is not
        # the symmetric stiffness but the torque that is there
        hessian = 0.5 * (hessian + np.swapaxes(hessian, 1, 2))
    force = np.abs(robot.ea).max() * 1e-6 + np.abs(here.gradient).max()
    assert gradient == pytest.approx(here.gradient, rel=1e-6, abs=1e-7 * force)
    top = np.abs(here.hessian).max()
    assert hessian == pytest.approx(here.hessian, rel=1e-6, abs=1e-7 * top)
    assert slopes == pytest.approx(here.slopes, rel=1e-6, abs=1e-7 * np.abs(here.slopes).max())


def test_a_constant_moment_has_no_energy_but_a_gradient() -> None:
    rng = np.random.default_rng(4)
    robot = random_robot(rng)
    poses = random_poses(rng, robot, 3)
    plain = at(tables_of(robot, poses), np.zeros((3, 6)))
    moment = np.tile([0, 0, 0, 1.0, -2.0, 3.0], (3, 1))
    turned = at(tables_of(robot, poses, wrench=moment), np.zeros((3, 6)))
    assert np.all(np.isnan(turned.energy)) and np.all(np.isfinite(plain.energy))
    change = turned.gradient - plain.gradient
    assert change == pytest.approx(-moment / np.array([1, 1, 1] + 3 * [robot.length]), rel=1e-9)


def test_a_moment_has_an_energy_where_its_work_does_not_depend_on_the_way() -> None:
    """On hinges that are all parallel, or whose outer ones turn about the moment's own axis."""
    turns = {"x": [1.0, 0, 0], "y": [0, 1.0, 0], "z": [0, 0, 1.0]}
    moment, length, rng = 3.0, 0.5, np.random.default_rng(8)

    @njit  # type: ignore[untyped-decorator]
    def work(load: np.ndarray, current: np.ndarray, length: float) -> float:
        return float(work_of_moment(load, current, length))

    for axes, about, has_energy in [
        ("y", "x", True), ("y", "y", True), ("yy", "z", True), ("xy", "x", True),
        ("xxyy", "x", True), ("xy", "y", False), ("xy", "z", False), ("xyx", "x", False),
        ("xyz", "x", False), ("", "x", False),
    ]:  # fmt: skip
        screws = np.array([[1.0, *turns[axis], *rng.normal(size=3)] for axis in axes])
        load = np.zeros(N_LOAD)
        load[EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] = moment * np.array(turns[about])
        current, place = np.zeros((len(axes), N_CURRENT)), np.zeros(7)
        for values in (np.zeros(len(axes)), rng.normal(size=len(axes))):
            torque, h = np.zeros(len(axes)), 1e-6
            for k, step in enumerate(np.eye(len(axes))):
                works = []
                for s in (h, -h):
                    place_joints(screws, values + s * step, length, np.zeros(7), place, current)
                    works.append(work(load, current, length))
                torque[k] = (works[0] - works[1]) / (2.0 * h)
            if not has_energy:
                place_joints(screws, values, length, np.zeros(7), place, current) if axes else None
                assert np.isnan(work(load, current, length)), (axes, about)
                continue
            place_joints(screws, values, length, np.zeros(7), place, current)
            along = current[:, 1:4] @ load[EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] / length
            assert torque == pytest.approx(along, abs=1e-8), (axes, about)


# --- Which robots are solved again with a stiffness that is raised in stages, and which rows never


SOFT = load_robot("demobot_parallel")
STIFF = replace(SOFT, ea=SOFT.ea * 1e4)
LIMIT = 30  # evaluations; most of these poses of the stiff robot need more


def tables_about_home(robot) -> Tables:
    poses = np.tile(robot.reference_pose, (40, 1))
    poses[:, :3] += np.random.default_rng(1).uniform(-0.15, 0.15, (40, 3))
    return assemble(Experiment(robot, Commands(poses)).setup(()))


def test_rows_of_a_stiff_robot_that_do_not_settle_are_solved_again_in_stages():
    tables = tables_about_home(STIFF)
    plain, found = (
        batch.descend(tables, limit=LIMIT, staged=False),
        batch.descend(tables, limit=LIMIT),
    )
    late = plain.outcome == ITERATIONS
    assert 0 < late.sum() < len(late) and np.all(plain.outcome[~late] == CONVERGED)
    assert np.all(found.outcome == CONVERGED) and np.all(found.residual < 1e-9)
    # what was found at once is not touched, and the others' first attempt counts
    assert np.array_equal(found.count[~late], plain.count[~late])
    assert np.array_equal(found.deviation[~late], plain.deviation[~late])
    assert np.all(found.count[late] > LIMIT)


def test_a_soft_robot_is_never_solved_in_stages():
    """It may come to another equilibrium by them."""
    found = batch.descend(tables_about_home(SOFT), limit=LIMIT // 3)
    assert np.any(found.outcome == ITERATIONS) and found.count.max() <= LIMIT // 3


def test_threads_compute_what_one_does() -> None:
    """Each has scratch of its own: when they had it in common, rows were wrong at random."""
    robot = load_robot("demobot_parallel")
    rng = np.random.default_rng(3)
    poses = np.tile(robot.reference_pose, (600, 1))
    poses[:, :3] += rng.uniform(-0.05, 0.05, (len(poses), 3))
    setups = [plain_setup(robot, Commands(poses)) for _ in range(2)]
    setups[0].cable_weight = np.full(robot.n_cables, 1e-3)  # catenaries use most of it
    setups[1].cable_weight = np.full(robot.n_cables, 2e-3)
    plus, minus = map(assemble, setups)
    rest = batch.descend(plus)

    def everything() -> list[np.ndarray]:
        out = [*batch.change(plus, minus, rest), *batch.change_by_cable(plus, minus, rest)]
        evaluated, *rates = batch.pull_and_change(plus, rest)
        return [*out, batch.rates_of_cables(plus, rest), evaluated.gradient, *rates]

    with undivided():
        wanted = everything()
    for _ in range(3):
        assert all(map(np.array_equal, everything(), wanted))
