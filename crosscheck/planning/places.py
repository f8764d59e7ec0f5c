"""Poses that could be measured: a grid with tilts, as far as the robot can hold still there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.measurements.data import Measurements
from crosscheck.planning.adding import MORE_POSES, NO_LIMITS, Adding, Extension, Limits, like
from crosscheck.planning.planned import Planned, near_slack, slack_at
from crosscheck.planning.upright import box_around, upright
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.workspace.zones import feasible

# Candidate poses along x, y, z, and how far they extend beyond the planned region.
_GRID, _BEYOND = (4, 3, 3), 0.25
_TILT_RAD = np.radians(10.0)
_TILTS = np.array(
    [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [0, 0, -1], [-1, 1, 0]]
)
_JOINT_POSES = 60
# A pose is nearly free to move if its smallest stiffness is below this part of the usual one.
_SOFT = 0.05


def more_poses(
    plan: Planned, limits: Limits = NO_LIMITS, box: Array | None = None
) -> Extension | None:
    """Poses in and around the planned region, some tilted, at which the robot can hold still.

    Tensions that balance the load are not those that commanded lengths bring about. Where a lowest
    tension is asked for, poses at which these leave a cable slack are left out, if enough others
    are left; elsewhere they may be what tells effects apart.

    Args:
        plan: what is planned. limits: lowest and highest tension [N].
        box: (2, 3) [m] lowest and highest position; by default anywhere near what is planned.
    """
    robot = plan.problem.robot
    poses = _jointed(plan) if robot.joints else _grid(plan, box)
    if box is not None:
        poses = within_box(poses, box)
    poses = held_within(robot, poses, limits)
    if len(poses) == 0:
        return None
    tried = like(plan, commands_at(plan.problem, poses))
    poses = poses[taut_first(tried, trustworthy(tried, plan), MORE_POSES, limits)]
    if len(poses) == 0:
        return None
    found = like(plan, commands_at(plan.problem, poses))
    return Extension(Adding.POSES, "add poses", found, poses)


def within_box(poses: Array, box: Array) -> Array:
    """The poses (n, 7) whose positions are within a box (2, 3) [m]: lowest and highest."""
    return poses[np.all((poses[:, :3] >= box[0]) & (poses[:, :3] <= box[1]), axis=1)]


def held_within(robot: Robot, poses: Array, limits: Limits = NO_LIMITS) -> Array:
    """The poses (n, 7) at which tensions within the limits balance the load."""
    return poses[feasible(robot, poses, lowest=limits[0], highest=limits[1])]


def trustworthy(candidates: Planned, plan: Planned) -> np.ndarray:
    """(n,) poses with reliable sensitivities: solved, stiff, with no cable about to go slack."""
    usual = plan.base.prediction.solution().smallest_eigenvalue[plan.problem.use]
    own = candidates.base.prediction.solution().smallest_eigenvalue
    good = candidates.problem.use & (own > _SOFT * float(np.median(usual)))
    for row, _cable in near_slack(candidates):
        good[row] = False
    return np.asarray(good)


def taut_first(
    candidates: Planned, good: NDArray[np.bool_], enough: int, limits: Limits
) -> NDArray[np.bool_]:
    """(n,) the good ones; if cables are to pull, those without a slack one, if they are enough."""
    if limits[0] <= 0.0:
        return good
    taut = good & ~slack_at(candidates).any(axis=1)
    return taut if taut.sum() >= enough else good


def commands_at(problem: Problem, poses: Array) -> Measurements:
    """Poses as rows, each a run of its own."""
    data, n = problem.data, len(poses)
    in_lengths = data.command_lengths is not None
    return Measurements(
        path=data.path,
        n_cables=data.n_cables,
        run=np.array([f"added {k + 1}" for k in range(n)]),
        command_pose=None if in_lengths else poses,
        command_lengths=problem.robot.commanded_lengths(poses) if in_lengths else None,
        told=data.told,
        t_s=None if data.t_s is None else data.t_s.max() + 60.0 * np.arange(1.0, n + 1.0),
        temperature_C=None
        if data.temperature_C is None
        else np.full(n, float(np.mean(data.temperature_C))),
    )


def _planned_poses(plan: Planned) -> Array:
    problem = plan.problem
    pose = problem.data.command_pose
    pose = plan.base.prediction.pose if pose is None else pose
    return pose[problem.use]


def _grid(plan: Planned, box: Array | None) -> Array:
    """Positions on a grid, in the box if there is one, each level and with two tilts."""
    robot, pose = plan.problem.robot, _planned_poses(plan)
    frame = upright(robot)
    low, high = _box(robot, pose[:, :3] @ frame, frame)
    if box is not None:
        own = box_around(box[0], box[1], frame)
        # where the box is beside what is planned, all of it
        apart = (high < own[0]) | (low > own[1])
        low = np.where(apart, own[0], np.maximum(low, own[0]))
        high = np.where(apart, own[1], np.minimum(high, own[1]))
    return tilted_grid(robot, low, high, _GRID, frame)


def tilted_grid(
    robot: Robot, low: Array, high: Array, steps: tuple[int, int, int], frame: Array
) -> Array:
    """Positions on a grid of so many steps [m], each level and with two tilts, as poses (n, 7).

    The grid and the axes of the tilts are along the columns of ``frame`` (3, 3).
    """
    axes = [np.linspace(low[k], high[k], steps[k]) for k in range(3)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) @ frame.T
    n = len(place)
    level = np.tile(robot.reference_pose[3:], (n, 1))
    out = [np.concatenate([place, level], axis=1)]
    for shift in (0, 3):
        tilt = _TILT_RAD * _TILTS[(np.arange(n) + shift) % len(_TILTS)] @ frame.T
        out.append(np.concatenate([place, quat_multiply(quat_from_rotvec(tilt), level)], axis=1))
    return np.concatenate(out)


def _box(robot: Robot, place: Array, frame: Array) -> tuple[Array, Array]:
    """The planned region with a margin, inside the exit points, along the axes of a frame."""
    exits = robot.exit_points @ frame
    exits_low, exits_high = exits.min(axis=0), exits.max(axis=0)
    low, high = place.min(axis=0), place.max(axis=0)
    room = np.maximum(exits_high - exits_low, 0.2 * float(np.max(exits_high - exits_low)))
    margin = _BEYOND * np.maximum(high - low, 0.2 * room)
    inside = 0.1 * (exits_high - exits_low)
    new_low, new_high = low - margin, high + margin
    # at the sides no further than the exit points; upwards not up to them
    new_low[:2] = np.maximum(new_low[:2], np.minimum(exits_low[:2] + inside[:2], low[:2]))
    new_high[:2] = np.minimum(new_high[:2], np.maximum(exits_high[:2] - inside[:2], high[:2]))
    new_high[2] = min(new_high[2], max(exits_high[2] - 0.1 * room[2], high[2]))
    return new_low, new_high


def _jointed(plan: Planned) -> Array:
    """Random joint values in and around the planned ones."""
    robot = plan.problem.robot
    values = values_of_pose(robot, _planned_poses(plan))[0]
    low, high = values.min(axis=0), values.max(axis=0)
    margin = _BEYOND * np.maximum(high - low, 0.2 * float(np.max(high - low)))
    random = np.random.default_rng(0)
    chosen = random.uniform(low - margin, high + margin, (_JOINT_POSES, len(low)))
    return np.asarray(pose_of_values(robot, chosen)[0])
