"""Poses that could be measured, and what else could be measured in addition."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Measurements
from crosscheck.planning.planned import (
    MORE_POSES,
    READ,
    Adding,
    Extension,
    Planned,
    Reads,
    expected_sigma,
    like,
    near_slack,
    usual_cell,
)
from crosscheck.planning.room import Room, usual_tension
from seecr.commands import Loads
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.units import short
from seecr.workspace.margins import feasible

# Axes in which the last one is against gravity, whichever way that is in the base frame.

# About x, by half a turn.
_OVER = np.diag([1.0, -1.0, -1.0])


def upright(robot: Robot) -> Array:
    """(3, 3) axes as columns, base frame: right-handed, the last one against gravity.

    They are the axes of the base frame if gravity is along -z, or if there is none. Where it is
    along another of these they are without rounding, so that poses on a box's edge stay there.
    """
    return _turned(robot.up) if robot.up[2] >= 0.0 else _turned(-robot.up) @ _OVER


def _turned(up: Array) -> Array:
    """The rotation of z onto a direction not below the horizon (Rodrigues' formula)."""
    x, y = up[:2]
    about = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + about + about @ about / (1.0 + up[2]))


# Candidate poses along x, y, z, and how far they extend beyond the planned region.
_GRID, _BEYOND = (4, 3, 3), 0.25
_TILTS = np.array(
    [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [0, 0, -1], [-1, 1, 0]]
)
_TILTS = _TILTS / np.linalg.norm(_TILTS, axis=1, keepdims=True)
_JOINT_POSES = 100
# A pose is nearly free to move if its smallest stiffness is below this part of the usual one.
_SOFT = 0.05


def more_poses(plan: Planned, room: Room | None = None) -> Extension | None:
    """Poses in and around the planned region at which a laboratory may run the robot.

    Tensions that balance the load are not those that commanded lengths bring about: of poses that
    can be held those are left at which the robot rests in the room, which is also that of the
    planned poses, with tensions near the usual ones of these.
    """
    robot, told = plan.problem.robot, plan.problem.data.command_pose
    room = (room or Room.of(robot)).around(_planned_poses(plan), turning=told is not None)
    poses = _jointed(plan, room.tilt) if robot.joints else _grid(plan, room)
    poses = held_within(robot, in_room(room, poses), room.bounds)
    if len(poses) == 0:
        return None
    tried = like(plan, commands_at(plan.problem, poses))
    usual = usual_tension(plan)
    poses = poses[room.may_run(tried, trustworthy(tried, plan), usual, MORE_POSES)]
    if len(poses) == 0:
        return None
    found = like(plan, commands_at(plan.problem, poses))
    return Extension(Adding.POSES, "add poses", found, poses)


def in_room(room: Room, poses: Array) -> Array:
    """The poses (n, 7) in a room, and in its box."""
    poses = poses[room.holds(poses)]
    if room.box is None:
        return poses
    low, high = room.box
    return poses[np.all((poses[:, :3] >= low) & (poses[:, :3] <= high), axis=1)]


def held_within(robot: Robot, poses: Array, limits: tuple[float, float]) -> Array:
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


def commands_at(problem: Problem, poses: Array) -> Measurements:
    """Poses as rows, each a run of its own."""
    data, n = problem.data, len(poses)
    in_lengths = data.command_lengths is not None
    return Measurements(
        path=data.path,
        n_cables=data.n_cables,
        driven=data.driven,
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


def _grid(plan: Planned, room: Room) -> Array:
    """Positions on a grid, in the box if there is one."""
    robot, pose, box = plan.problem.robot, _planned_poses(plan), room.box
    frame = upright(robot)
    low, high = _around(robot, pose[:, :3] @ frame, frame)
    if box is not None:
        ends = box[:, :, None] * frame  # along the axes of the frame, around the box
        own = ends.min(axis=0).sum(axis=0), ends.max(axis=0).sum(axis=0)
        # where the box is beside what is planned, all of it
        apart = (high < own[0]) | (low > own[1])
        low = np.where(apart, own[0], np.maximum(low, own[0]))
        high = np.where(apart, own[1], np.minimum(high, own[1]))
    return tilted_grid(robot, *room.extent(frame, low, high), _GRID, frame, room.tilt)


def tilted_grid(
    robot: Robot, low: Array, high: Array, steps: tuple[int, int, int], frame: Array,
    tilt_rad: float,
) -> Array:  # fmt: skip
    """Positions on a grid of so many steps [m], each level and with two tilts, as poses (n, 7).

    The grid and the axes of the tilts are along the columns of ``frame`` (3, 3). Without a tilt
    there are about as many poses, on a finer grid.
    """
    finer = 1.0 if tilt_rad > 0.0 else np.cbrt(3.0)
    axes = [np.linspace(low[k], high[k], round(finer * steps[k])) for k in range(3)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) @ frame.T
    n = len(place)
    level = np.tile(robot.reference_pose[3:], (n, 1))
    out = [np.concatenate([place, level], axis=1)]
    for shift in (0, 3) if tilt_rad > 0.0 else ():
        tilt = tilt_rad * _TILTS[(np.arange(n) + shift) % len(_TILTS)] @ frame.T
        out.append(np.concatenate([place, quat_multiply(quat_from_rotvec(tilt), level)], axis=1))
    return np.concatenate(out)


def _around(robot: Robot, place: Array, frame: Array) -> tuple[Array, Array]:
    """The planned region with a margin, along the axes of a frame."""
    low, high = place.min(axis=0), place.max(axis=0)
    room = np.ptp(robot.exit_points @ frame, axis=0)
    margin = _BEYOND * np.maximum(high - low, 0.2 * np.maximum(room, 0.2 * room.max()))
    return low - margin, high + margin


def _jointed(plan: Planned, tilt_rad: float) -> Array:
    """Random joint values in and around the planned ones; hinges turn no further than asked."""
    robot = plan.problem.robot
    values = values_of_pose(robot, _planned_poses(plan))[0]
    low, high = values.min(axis=0), values.max(axis=0)
    margin = _BEYOND * np.maximum(high - low, 0.2 * float(np.max(high - low)))
    if not robot.hinges.all():
        margin = np.where(robot.hinges, tilt_rad, margin)
    random = np.random.default_rng(0)
    chosen = random.uniform(low - margin, high + margin, (_JOINT_POSES, len(low)))
    return np.asarray(pose_of_values(robot, chosen)[0])


# What could be measured in addition: sensors, a payload, the way back, more poses.

# A known payload, relative to the platform's mass.
PAYLOAD = 0.25

_AN_HOUR = 3600.0


def extensions(plan: Planned, room: Room | None = None) -> Iterator[Extension]:
    """All that can be added to measurements that were made or planned, one after the other.

    A room says where poses may be added, and what tensions may be.
    """
    ways = ~plan.problem.data.read & ~plan.unsolved
    data = plan.problem.data.rows(plan.problem.use | ways)
    for make in (_sensors, _payload, _way_back, _later):
        yield from make(plan, data)
    found = more_poses(plan, room)
    if found is not None:
        yield found


def _sensors(plan: Planned, data: Measurements) -> Iterator[Extension]:
    problem, m = plan.problem, plan.problem.robot.n_cables
    if not plan.reads.tensions.any():
        mean = float(np.mean(plan.base.prediction.tensions[problem.use]))
        noise = problem.sigma.tension_N or usual_cell(mean)
        yield Extension(
            Adding.TENSIONS,
            f"record the cable tensions (to {noise:g} N)",
            like(
                plan, data, reads=Reads.of_kinds(m, READ[2:]),
                sigma=replace(problem.sigma, tension_N=noise),
            ),
        )  # fmt: skip
    if not plan.reads.whole_pose:
        sigma, _assumed = expected_sigma(problem.robot, problem.sigma)
        yield Extension(
            Adding.POSE,
            "record the whole pose of the platform",
            like(plan, data, reads=Reads.of_kinds(m), sigma=sigma),
        )


def _payload(plan: Planned, data: Measurements) -> Iterator[Extension]:
    robot = plan.problem.robot
    if robot.mass > 0:
        yield Extension(
            Adding.PAYLOAD,
            f"repeat the poses with a known extra {short(PAYLOAD * robot.mass, 2)} kg at the "
            "centre of mass (payload_kg)",
            like(plan, replace(data, loads=_heavier(data, robot, PAYLOAD * robot.mass))),
        )


def _heavier(data: Measurements, robot: Robot, mass: float) -> Loads:
    """The rows' loads plus a payload [kg] at the platform's centre of mass."""
    here = data.loads or Loads.of(data.n_rows)
    total, centre = here.mass + mass, here.centre
    share = np.divide(here.mass, total, out=np.zeros_like(total), where=total != 0.0)[:, None]
    both = robot.centre_of_mass + share * (centre - robot.centre_of_mass)
    return Loads(total, np.where(here.mass[:, None] == 0.0, np.nan, both), here.wrench)


def _way_back(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """Each run from its last row to its first, with the same times."""
    order = np.concatenate([np.flatnonzero(data.run == name)[::-1] for name in data.runs])
    turned = data.rows(order)
    yield Extension(
        Adding.WAY_BACK,
        "repeat each run in the opposite order, so that poses are reached from the other side",
        like(plan, replace(turned, run=_again(turned), t_s=data.t_s)),
    )


def _later(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """All rows again an hour later, on the clock of each file, as creep depends on the time."""
    if data.t_s is None:
        return
    n = data.n_rows
    order = np.argsort(np.tile(data.file, 2), kind="stable")
    later, both = order >= n, data.rows(order % n)
    shift = float(np.ptp(data.t_s)) + _AN_HOUR
    names = np.where(later, _again(both), both.run)
    both = replace(both, run=names, t_s=data.t_s[order % n] + later * shift)
    whole = like(plan, both)
    rest = whole.problem.only(later)
    base = evaluate(rest, plan.base.terms, whole.factor)
    again = replace(whole, problem=rest, base=base)
    yield Extension(Adding.LATER, "repeat the poses an hour later", again)


def _again(data: Measurements) -> np.ndarray:
    return np.array([f"{name} again" for name in data.run.tolist()], dtype=np.str_)


# Additional plans that a user can carry out: payloads off centre, poses reached from beyond.

# Distance of an off-centre payload from the centre of mass, relative to the widest horizontal
# extent of the anchor points; distance of a way point beyond a pose, relative to the way to it.
_ASIDE, _BEYOND_POSE = 0.25, 0.5


def detours(plan: Planned, room: Room | None = None) -> Iterator[Extension]:
    """An off-centre payload, and each pose reached again from beyond it."""
    data = plan.problem.data.rows(plan.problem.use)
    room = (room or Room.of(plan.problem.robot)).around(_planned_poses(plan))
    yield from _aside(plan, data)
    yield from _way_points(plan, data, room)


def _aside(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """A known payload off the centre of mass."""
    robot = plan.problem.robot
    if robot.mass <= 0.0 or data.loads is not None or robot.joints:
        return
    span, n = np.ptp(robot.anchor_points[:, :2], axis=0), data.n_rows
    place = robot.centre_of_mass + _ASIDE * float(span.max()) * np.eye(3)[int(span.argmax())]
    mass, where = PAYLOAD * robot.mass, ", ".join(f"{v:.3g}" for v in place)
    there = Loads(np.full(n, mass), np.tile(place, (n, 1)), np.zeros((n, 6)))
    yield Extension(
        Adding.PAYLOAD_ASIDE,
        f"repeat the poses with a known extra {short(mass, 2)} kg off the centre, at ({where}) m "
        "in the platform's frame (payload_kg, payload_x_m, payload_y_m, payload_z_m)",
        like(plan, replace(data, loads=there, run=_again(data))),
    )


def _way_points(plan: Planned, data: Measurements, room: Room) -> Iterator[Extension]:
    """Each pose again from beyond it, by a way point before each row that has readings."""
    beyond = _beyond(plan, data, room)
    if beyond is None or data.command_pose is None:
        return
    n = data.n_rows
    both = data.rows(np.repeat(np.arange(n), 2)).without_readings()
    stops = np.tile([False, True], n)
    gone_through = replace(
        both,
        run=_again(both),
        t_s=None if data.t_s is None else _halfway(data.t_s),
        command_pose=np.stack([beyond, data.command_pose], axis=1).reshape(2 * n, 7),
        # any number marks a stop as read; the readings themselves come from the model
        position=np.where(stops[:, None], np.zeros(3), np.nan),
    )
    words = "repeat each pose, now approached from a way point beyond it"
    yield Extension(Adding.WAY_POINTS, words, like(plan, gone_through))


def _halfway(t_s: Array) -> Array:
    """Times (2n,) [s] of each row and of a way point halfway between the row before and it."""
    before = np.concatenate([[t_s[0] - np.diff(t_s[:2], append=t_s[0])[0]], t_s[:-1]])
    return np.stack([np.minimum(0.5 * (before + t_s), t_s), t_s], axis=1).ravel()


def _beyond(plan: Planned, data: Measurements, room: Room) -> Array | None:
    """Poses (n, 7) beyond each pose in the direction of travel, where the robot may go there."""
    robot = plan.problem.robot
    if data.command_pose is None or robot.joints:
        return None
    pose = data.command_pose
    before = data.as_commands(robot).before(pose, robot.reference_pose)
    beyond = pose.copy()
    beyond[:, :3] += _BEYOND_POSE * (pose - before)[:, :3]
    tried = like(plan, replace(data.without_readings(), command_pose=beyond))
    held = feasible(robot, beyond) & room.holds(beyond)
    fine = room.may_run(tried, held, usual_tension(plan), data.n_rows)
    beyond = np.where(fine[:, None], beyond, pose)
    return None if np.array_equal(beyond, pose) else beyond
