"""What could be measured besides: sensors, a payload, the way back, more poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from crosscheck.fit.candidates import null_fit
from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.planning.planned import (
    LOAD_CELL,
    Planned,
    Reads,
    expected_sigma,
    near_slack,
    planned,
)
from seecr.joints import pose_of_values, values_of_pose
from seecr.loads import Loads
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.robot import Robot
from seecr.workspace import feasible

# A known load, over the platform's mass.
PAYLOAD = 0.25
# No load cell is better than this [N].
_LEAST_CELL = 1e-9
# Candidate poses: steps along x, y, z, and how far out of the planned region they go.
_GRID, _BEYOND = (4, 3, 3), 0.25
_TILT_RAD = np.radians(10.0)
_TILTS = np.array(
    [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [0, 0, -1], [-1, 1, 0]]
)
_JOINT_POSES = 60
# A pose with less than this part of the usual smallest stiffness is nearly free to move.
_SOFT = 0.05
_AN_HOUR = 3600.0


class Adding(StrEnum):
    """What can be added to measurements, in the words of ``plan.json``."""

    TENSIONS = "tensions"
    POSE = "pose"
    PAYLOAD = "payload"
    WAY_BACK = "way_back"
    LATER = "later"
    POSES = "poses"


@dataclass(frozen=True, eq=False)
class Extension:
    """Readings that could be added.

    Attributes:
        kind: what is added. words: what to do. plan: the added readings.
        poses: (k, 7) commanded, for added poses.
    """

    kind: Adding
    words: str
    plan: Planned
    poses: Array | None = None


def extensions(plan: Planned) -> Iterator[Extension]:
    """All that can be added to measurements made or planned, one after the other.

    Args:
        plan: what is read so far, about the model that predicts it.
    """
    ways = ~plan.problem.data.read & ~plan.unsolved
    data = plan.problem.data.rows(plan.problem.use | ways)
    for make in (_sensors, _payload, _way_back, _later, _more_poses):
        yield from make(plan, data)


def _like(
    plan: Planned, data: Measurements, reads: Reads | None = None, sigma: Sigma | None = None
) -> Planned:
    """Other rows, other sensors; all else as in the plan."""
    return planned(
        plan.problem.robot, data, sigma or plan.problem.sigma, reads or plan.reads,
        plan.base.terms,
    )  # fmt: skip


def _sensors(plan: Planned, data: Measurements) -> Iterator[Extension]:
    problem, m = plan.problem, plan.problem.robot.n_cables
    if not plan.reads.tensions.any():
        mean = float(np.mean(plan.base.state.prediction.tensions[problem.use]))
        noise = problem.sigma.tension_N or float(f"{max(LOAD_CELL * mean, _LEAST_CELL):.1g}")
        yield Extension(
            Adding.TENSIONS,
            f"record the cable tensions (to {noise:g} N)",
            _like(
                plan, data, reads=Reads.whole(m, pose=False, tensions=True),
                sigma=replace(problem.sigma, tension_N=noise),
            ),
        )  # fmt: skip
    if not plan.reads.whole_pose:
        sigma, _assumed = expected_sigma(problem.robot, problem.sigma)
        yield Extension(
            Adding.POSE,
            "record the whole pose of the platform",
            _like(plan, data, reads=Reads.whole(m), sigma=sigma),
        )


def _payload(plan: Planned, data: Measurements) -> Iterator[Extension]:
    robot = plan.problem.robot
    if robot.mass > 0:
        yield Extension(
            Adding.PAYLOAD,
            f"repeat the poses with a known {PAYLOAD * robot.mass:.2g} kg more at the centre of "
            "mass (payload_kg)",
            _like(plan, replace(data, loads=_heavier(data, robot, PAYLOAD * robot.mass))),
        )


def _heavier(data: Measurements, robot: Robot, mass: float) -> Loads:
    """The rows' loads and a payload [kg] at the platform's centre of mass besides."""
    here = data.loads or Loads.of(data.n_rows)
    total, centre = here.mass + mass, here.centre
    share = np.divide(here.mass, total, out=np.zeros_like(total), where=total != 0.0)[:, None]
    both = robot.centre_of_mass + share * (centre - robot.centre_of_mass)
    return Loads(total, np.where(here.mass[:, None] == 0.0, np.nan, both), here.wrench)


def _way_back(plan: Planned, data: Measurements) -> Iterator[Extension]:
    yield Extension(
        Adding.WAY_BACK,
        "repeat each run in the opposite order, so that poses are reached from the other side",
        _like(plan, _backwards(data)),
    )


def _later(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """All again after an hour, on the clock of each file; what creeps goes by that."""
    if data.t_s is None:
        return
    n = data.n_rows
    order = np.argsort(np.tile(data.file, 2), kind="stable")
    later, both = order >= n, data.rows(order % n)
    shift = float(np.ptp(data.t_s)) + _AN_HOUR
    both = replace(
        both, run=np.where(later, _named(both), both.run), t_s=data.t_s[order % n] + later * shift
    )
    whole = _like(plan, both)
    rest = whole.problem.only(later)
    base = null_fit(rest, plan.base.terms, whole.factor, refit=False)
    again = replace(whole, problem=rest, base=base)
    yield Extension(Adding.LATER, "repeat the poses an hour later", again)


def _named(data: Measurements) -> np.ndarray:
    return np.array([f"{name} again" for name in data.run.tolist()], dtype=np.str_)


def _backwards(data: Measurements) -> Measurements:
    """Each run from its last row to its first, at the same pace."""
    order = np.concatenate([np.flatnonzero(data.run == name)[::-1] for name in data.runs])
    turned = data.rows(order)
    return replace(turned, run=_named(turned), t_s=data.t_s)


def _more_poses(plan: Planned, _data: Measurements) -> Iterator[Extension]:
    found = more_poses(plan)
    if found is not None:
        yield found


def more_poses(plan: Planned) -> Extension | None:
    """Poses in and around the planned region, some tilted, at which the robot can hold still."""
    robot = plan.problem.robot
    poses = _jointed(plan) if robot.joints else _grid(plan)
    poses = poses[feasible(robot, poses)]
    if len(poses) == 0:
        return None
    poses = poses[_trustworthy(_like(plan, _commands(plan.problem, poses)), plan)]
    if len(poses) == 0:
        return None
    found = _like(plan, _commands(plan.problem, poses))
    return Extension(Adding.POSES, "add poses", found, poses)


def _trustworthy(candidates: Planned, plan: Planned) -> np.ndarray:
    """(n,) poses whose sensitivities can be relied on: solved, stiff, no cable about to switch."""
    usual = plan.base.state.prediction.solution().smallest_eigenvalue[plan.problem.use]
    own = candidates.base.state.prediction.solution().smallest_eigenvalue
    good = candidates.problem.use & (own > _SOFT * float(np.median(usual)))
    for row, _cable in near_slack(candidates):
        good[row] = False
    return np.asarray(good)


def _commands(problem: Problem, poses: Array) -> Measurements:
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
    pose = plan.base.state.prediction.pose if pose is None else pose
    return pose[problem.use]


def _grid(plan: Planned) -> Array:
    """Positions on a grid, each level and with two tilts."""
    robot, pose = plan.problem.robot, _planned_poses(plan)
    low, high = _box(robot, pose[:, :3])
    axes = [np.linspace(low[k], high[k], _GRID[k]) for k in range(3)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(place)
    level = np.tile(robot.reference_pose[3:], (n, 1))
    out = [np.concatenate([place, level], axis=1)]
    for shift in (0, 3):
        tilt = _TILT_RAD * _TILTS[(np.arange(n) + shift) % len(_TILTS)]
        out.append(np.concatenate([place, quat_multiply(quat_from_rotvec(tilt), level)], axis=1))
    return np.concatenate(out)


def _box(robot: Robot, place: Array) -> tuple[Array, Array]:
    """The planned region and somewhat more, inside the exit points."""
    exits_low, exits_high = robot.exit_points.min(axis=0), robot.exit_points.max(axis=0)
    low, high = place.min(axis=0), place.max(axis=0)
    room = np.maximum(exits_high - exits_low, 0.2 * float(np.max(exits_high - exits_low)))
    margin = _BEYOND * np.maximum(high - low, 0.2 * room)
    inside = 0.1 * (exits_high - exits_low)
    new_low, new_high = low - margin, high + margin
    # sideways not beyond the exit points; upwards not into them
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
