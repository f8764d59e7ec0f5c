"""Additional plans that a user can carry out: payloads off centre, poses reached from beyond."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crosscheck.measurements.data import Measurements
from crosscheck.planning.adding import Adding, Extension, like
from crosscheck.planning.extensions import PAYLOAD, named_again
from crosscheck.planning.planned import Planned
from seecr.commands import Loads
from seecr.pose import Array
from seecr.units import short
from seecr.workspace.zones import feasible

# Distance of an off-centre payload from the centre of mass, relative to the widest horizontal
# extent of the anchor points; distance of a way point beyond a pose, relative to the way to it.
_ASIDE, _BEYOND_POSE = 0.25, 0.5


def detours(plan: Planned) -> Iterator[Extension]:
    """An off-centre payload, and each pose reached again from beyond it."""
    data = plan.problem.data.rows(plan.problem.use)
    yield from _aside(plan, data)
    yield from _way_points(plan, data)


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
        like(plan, replace(data, loads=there, run=named_again(data))),
    )


def _way_points(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """Each pose again from beyond it, by a way point before each row that has readings."""
    beyond = _beyond(plan, data)
    if beyond is None or data.command_pose is None:
        return
    n = data.n_rows
    both = data.rows(np.repeat(np.arange(n), 2))
    stops = np.tile([False, True], n)
    gone_through = replace(
        both,
        run=named_again(both),
        t_s=None if data.t_s is None else _halfway(data.t_s),
        command_pose=np.stack([beyond, data.command_pose], axis=1).reshape(2 * n, 7),
        # any number marks a stop as read; the readings themselves come from the model
        position=np.where(stops[:, None], np.zeros(3), np.nan),
        quat_wxyz=None,
        angles_rad=np.full((2 * n, 3), np.nan),
        tensions=np.full((2 * n, data.n_cables), np.nan),
    )
    words = "repeat each pose, now approached from a way point beyond it"
    yield Extension(Adding.WAY_POINTS, words, like(plan, gone_through))


def _halfway(t_s: Array) -> Array:
    """Times (2n,) [s] of each row and of a way point halfway between the row before and it."""
    before = np.concatenate([[t_s[0] - np.diff(t_s[:2], append=t_s[0])[0]], t_s[:-1]])
    return np.stack([np.minimum(0.5 * (before + t_s), t_s), t_s], axis=1).ravel()


def _beyond(plan: Planned, data: Measurements) -> Array | None:
    """Poses (n, 7) beyond each pose in the direction of travel, where these can be held."""
    robot = plan.problem.robot
    if data.command_pose is None or robot.joints:
        return None
    pose = data.command_pose
    before = data.as_commands(robot).before(pose, robot.reference_pose)
    beyond = pose.copy()
    beyond[:, :3] += _BEYOND_POSE * (pose - before)[:, :3]
    beyond = np.where(feasible(robot, beyond)[:, None], beyond, pose)
    return None if np.array_equal(beyond, pose) else beyond
