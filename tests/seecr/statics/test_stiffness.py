"""Forces and their stiffness under any load, beside those that plain NumPy finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot

import seecr
from seecr import Commands, Experiment, Joint
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.effects.load import ExternalWrench
from seecr.pose import Array, pose_add, pose_difference, quat_rotate
from seecr.statics import batch
from seecr.statics.tables import assemble, rest_lengths_of

STEP = 1e-5


def wrench_at(robot: seecr.Robot, rest: Array, outer: Array, pose: Array) -> Array:
    """Force and moment (6,) about the platform's origin: straight cables, weight and load."""
    arms, centre = (
        quat_rotate(pose[3:], one) for one in (robot.anchor_points, robot.centre_of_mass)
    )
    way = robot.exit_points - (pose[:3] + arms)
    length = np.linalg.norm(way, axis=1)
    pulls = (robot.ea * np.maximum(length / rest - 1.0, 0.0) / length)[:, None] * way
    weight = robot.mass * robot.gravity
    torque = np.cross(arms, pulls).sum(axis=0) + np.cross(centre, weight)
    return outer + np.concatenate([pulls.sum(axis=0) + weight, torque])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_minus_the_derivative_of_forces_also_under_a_moment(kind: str, seed: int) -> None:
    """A moment that does not turn with the platform leaves it without symmetry."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, kind, cables=8)
    robot = replace(robot, ea=np.full(8, 100.0 * robot.weight))
    outer = robot.weight * rng.uniform(-0.1, 0.1, 6) * np.repeat([1.0, 0.5 * robot.length], 3)
    found = seecr.solve(robot, random_poses(rng, robot, 3), wrench=outer)
    assert found.converged.any()
    for k in np.flatnonzero(found.converged):
        home = found.pose[k]
        values = values_of_pose(robot, home[None])[0][0] if robot.joints else np.zeros(6)

        def pose_at(q: Array, home: Array = home) -> Array:
            return pose_of_values(robot, q[None])[0][0] if robot.joints else pose_add(home, q)

        def forces(q: Array, rest: Array = found.rest_lengths[k]) -> Array:
            wrench = wrench_at(robot, rest, outer, pose_at(q))
            if not robot.joints:
                return wrench
            steps = STEP * np.eye(len(q))
            moved = [pose_difference(pose_at(q + s), pose_at(q - s)) / (2.0 * STEP) for s in steps]
            return np.array(moved) @ wrench

        steps = STEP * np.eye(len(values))
        slope = [(forces(values + s) - forces(values - s)) / (2.0 * STEP) for s in steps]
        near = 1e-6 * np.abs(found.stiffness[k]).max()
        np.testing.assert_allclose(found.stiffness[k], -np.array(slope).T, rtol=1e-5, atol=near)


@pytest.mark.parametrize("rows", [3, 70])  # 70 have tables made for lanes
@pytest.mark.parametrize("pushed", [0.0, 0.2])
@pytest.mark.parametrize("gravity", [1.0, 0.0])
def test_what_is_unbalanced_is_told_relative_to_the_load(
    rows: int, pushed: float, gravity: float
) -> None:
    """That is weight, force, and moment over the robot's length; or cables at a strain of 1e-3."""
    rng = np.random.default_rng(1)
    robot = random_robot(rng, cables=8)
    weight = gravity * robot.weight
    outer = pushed * robot.weight * rng.uniform(-1, 1, 6) * np.repeat([1.0, robot.length], 3)
    robot = replace(robot, gravity=gravity * robot.gravity)
    poses = random_poses(rng, robot, rows)
    effects = [ExternalWrench(outer[:3], outer[3:])] if pushed else []
    tables = assemble(Experiment(robot, Commands(poses)).setup(effects))
    at = batch.evaluate(tables, batch.Evaluation.at_commands(tables))
    metre = np.repeat([1.0, robot.length], 3)
    each = zip(rest_lengths_of(tables), poses, strict=True)
    every = np.array([wrench_at(robot, rest, outer, pose) / metre for rest, pose in each])
    off = np.linalg.norm(every.reshape(-1, 2, 3), axis=2).max(axis=1)
    load = weight + np.linalg.norm((outer / metre).reshape(2, 3), axis=1).sum()
    expected = off / (load or 1e-3 * robot.ea.max())
    assert at.residual == pytest.approx(expected, rel=1e-9)
    assert batch.pull_and_change(tables, at)[0].residual == pytest.approx(expected, rel=1e-9)


def test_a_platform_far_from_its_command_has_not_fallen() -> None:
    """It is told to be five lengths of its cables away, where these are as long as they are."""
    robot = seecr.load_robot("demobot_cogiro")
    home = seecr.solve(robot, robot.reference_pose)
    far = robot.reference_pose[None].copy()
    far[0, 2] -= 5.0 * home.rest_lengths.max()
    found = seecr.solve(robot, Commands(far, lengths=home.rest_lengths, told=False))
    assert found.converged[0]
    assert found.pose == pytest.approx(home.pose, abs=1e-9 * robot.length)


@pytest.mark.parametrize("axis", [[-1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0], [-0.48, -0.6, 0.64]])
def test_a_moment_works_along_the_sum_of_parallel_hinges_alone(axis: list[float]) -> None:
    """The torque along one would depend on the other, were they not parallel."""
    rng = np.random.default_rng(0)
    robot, moment = random_robot(rng, cables=8), rng.normal(size=3)
    inner, outer = (Joint("hinge", n, np.array(axis), rng.normal(size=3)) for n in "ab")
    turns = np.array([[0.0, 0.0], [0.2, 0.1], [0.3, -0.2]])

    def energies(joints: tuple[Joint, ...], effects: list[ExternalWrench]) -> Array:
        on_hinges = replace(robot, joints=joints)
        home = Commands(np.tile(robot.reference_pose, (3, 1)))
        tables = assemble(Experiment(on_hinges, home).setup(effects))
        at = batch.Evaluation.at_commands(tables)
        at.values[:] = robot.length * turns
        return batch.evaluate(tables, at).energy

    push = [ExternalWrench(np.zeros(3), moment)]
    work = energies((inner, outer), []) - energies((inner, outer), push)
    assert work == pytest.approx(moment @ axis * turns.sum(axis=1), rel=1e-9)
    aside = replace(inner, axis=np.roll(axis, 1))
    assert np.isnan(energies((aside, outer), push)).all()
