"""Commands as a person would measure: sweeps to and fro, and a tilted loop, scaled to a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.measurements.data import Names
from seecr.description.robot import Robot
from seecr.pose import Array, pose_add, pose_difference

# Parts of the distance from the reference pose to the outermost exit points, in each direction.
_ALONG, _ACROSS, _HEIGHT, _LOOP = 0.64, 0.56, 0.15, 0.5
# Tilt of the loop about the three directions [rad].
_TILT = np.deg2rad([4.0, 4.0, 6.0])
_BETWEEN_ROWS_S, _BETWEEN_RUNS_S = 2.0, 60.0


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Commanded poses (n, 7), names of runs (n,) and times (n,) [s]."""

    pose: Array
    run: Names
    t_s: Array


def trajectory(robot: Robot, points: int = 18, extent: float = 1.0) -> Trajectory:
    """Sweeps along the robot at two heights and across it, to and fro, and a tilted loop.

    Args:
        robot: any; platforms on joints go as near to the poses as their joints allow.
        points: of each sweep; the loop has twice as many.
        extent: 1 for the usual size.
    """
    frame, reach = _frame(robot)
    runs: dict[str, Array] = {}
    for name, height in (("low", -_HEIGHT), ("high", _HEIGHT)):
        line = _line(points, reach[0], _ALONG)
        _to_and_fro(runs, f"along_{name}", np.stack([line, 0 * line, height + 0 * line], 1))
    _to_and_fro(runs, "across", _across(points, reach))
    changes = {name: _base_change(frame, reach, part) for name, part in runs.items()}
    changes["loop"] = _loop(frame, reach, 2 * points)
    poses = np.concatenate([_reachable(robot, extent * change) for change in changes.values()])
    counts = [len(change) for change in changes.values()]
    return Trajectory(poses, np.repeat(np.array(list(changes)), counts), _clock(counts))


def _frame(robot: Robot) -> tuple[Array, Array]:
    """Directions along, across and up as rows (3, 3), and the reach (3, 2) [m] on either side."""
    up = robot.up
    exits = robot.exit_points - robot.reference_pose[:3]
    level = exits - np.outer(exits @ up, up)
    along = np.linalg.svd(level - level.mean(axis=0))[2][0]
    along = along - (along @ up) * up
    along *= np.sign(along[np.argmax(np.abs(along))]) / np.linalg.norm(along)
    frame = np.stack([along, np.cross(up, along), up])
    room = exits @ frame.T
    reach = np.stack([np.minimum(room.min(axis=0), 0.0), np.maximum(room.max(axis=0), 0.0)], 1)
    reach[2] = max(abs(reach[2, 0]), reach[2, 1])
    return frame, reach


def _line(points: int, reach: Array, part: float) -> Array:
    """Numbers (points,) [m] from one side to the other."""
    return np.linspace(part * reach[0], part * reach[1], points)


def _across(points: int, reach: Array) -> Array:
    """A sweep (points, 3) across the robot; up and down if it has no width."""
    line = _line(points, reach[1], _ACROSS)
    height = np.full(points, _HEIGHT)
    if np.ptp(line) < 0.05 * np.ptp(reach[0]):
        line, height = np.zeros(points), np.linspace(-_HEIGHT, 1.5 * _HEIGHT, points)
    return np.stack([0 * line, line, height], axis=1)


def _to_and_fro(runs: dict[str, Array], name: str, part: Array) -> None:
    runs[f"{name}_fwd"], runs[f"{name}_back"] = part, part[::-1]


def _base_change(frame: Array, reach: Array, part: Array) -> Array:
    """Change (n, 6) of the reference pose; heights are fractions of the reach upwards."""
    local = part * np.array([1.0, 1.0, reach[2, 1]])
    return np.concatenate([local @ frame, np.zeros_like(local)], axis=1)


def _loop(frame: Array, reach: Array, points: int) -> Array:
    """Change (points, 6) along a closed curve of position and tilt."""
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    size = _LOOP * np.min(np.abs(reach[:2]), axis=1)
    local = np.stack(
        [
            size[0] * np.sin(angle),
            0.75 * size[1] * np.cos(angle) + 0.25 * size[1] * np.sin(2.0 * angle),
            0.3 * _HEIGHT * reach[2, 1] * np.cos(2.0 * angle),
        ],
        axis=1,
    )
    tilt = _TILT * np.stack([np.sin(angle), np.sin(2.0 * angle + 0.5), np.cos(angle - 0.4)], axis=1)
    return np.concatenate([local @ frame, tilt @ frame], axis=1)


def _reachable(robot: Robot, change: Array) -> Array:
    """Poses (n, 7) changed from the reference; on joints, the part of the change along them."""
    start = np.tile(robot.reference_pose, (len(change), 1))
    if not robot.joints:
        return pose_add(start, change)
    from seecr.description.joints import motion_columns, pose_of_values

    at, screws = pose_of_values(robot, np.zeros((1, len(robot.joints))))
    columns = motion_columns(screws, at[:, :3])[0]
    wanted = pose_difference(pose_add(start, change), start)
    return pose_of_values(robot, wanted @ np.linalg.pinv(columns).T)[0]


def _clock(counts: list[int]) -> Array:
    times, now = [], 0.0
    for count in counts:
        times.append(now + _BETWEEN_ROWS_S * np.arange(count))
        now = times[-1][-1] + _BETWEEN_RUNS_S
    return np.concatenate(times)
