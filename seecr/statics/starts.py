"""Commands and poses given by callers, and poses at which a search starts."""

from __future__ import annotations

from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import finite, numbers
from seecr.commands import Commands
from seecr.counted import rows_words
from seecr.description.joints import motion_columns, pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import LARGEST, NORM_TOLERANCE, Array, cross, pose_add, quat_rotate
from seecr.statics import batch
from seecr.statics.tables import Tables


@runtime_checkable
class HasCommands(Protocol):
    """What holds commands among other things, such as ``crosscheck.Measurements``."""

    def as_commands(self, robot: Robot) -> Commands:
        """The commands to the robot."""


Commanded: TypeAlias = Commands | HasCommands | ArrayLike
"""Commands, what holds them, commanded poses (n, 7), or positions (n, 3) of level platforms."""


def commands_from(given: Commanded, robot: Robot) -> Commands:
    """Commands as the statics takes them.

    Raises:
        InputError: neither commands nor poses (n, 7) with unit quaternions.
    """
    if isinstance(given, Commands):
        return given
    if isinstance(given, HasCommands):
        return given.as_commands(robot)
    return Commands(commanded_poses(given, robot=robot))


def answered(commands: Commands) -> Commands:
    """The commands, if all lengths are numbers; a correction has NaN for poses without an answer.

    Raises:
        InputError: a row has none.
    """
    if commands.lengths is None:
        return commands
    lengths = numbers(commands.lengths, "lengths of the commands")
    odd = ~(np.abs(lengths) <= LARGEST)  # also of NaN
    lost = np.flatnonzero(np.atleast_2d(odd).any(axis=1))
    if len(lost):
        raise InputError(
            f"{rows_words(lost, commands.line)} of the commands: expected finite lengths, got "
            f"{lengths[odd][0]:g}; leave out rows for which a correction has none: "
            "commands.rows(np.flatnonzero(correction.found))"
        )
    return commands


def start_of(
    robot: Robot, tables: Tables, start: Array | None
) -> tuple[Array | None, Array | None]:
    """Deviations and joint values of start poses (n, 7)."""
    if start is None:
        return None, None
    if not robot.joints:
        return batch.deviations(tables, start), None
    values = values_of_pose(robot, np.concatenate([start, tables.poses]))[0]
    change = values[: len(start)] - values[len(start) :]
    return batch.deviations(tables, start), change * np.where(robot.hinges, robot.length, 1.0)


def commanded_poses(values: ArrayLike, name: str = "poses", robot: Robot | None = None) -> Array:
    """Checked poses (n, 7) with unit quaternions; ``name`` is for errors.

    With a robot positions (n, 3) are poses turned as its reference pose.
    """
    array = np.atleast_2d(finite(values, name))
    if robot is not None and array.ndim == 2 and array.shape[1] == 3:
        array = np.column_stack([array, np.tile(robot.reference_pose[3:], (len(array), 1))])
    if array.ndim != 2 or array.shape[1] != 7:
        raise InputError(f"{name} must be (n, 7), x y z qw qx qy qz, got {np.shape(values)}")
    norm = np.sqrt(np.einsum("ij,ij->i", array[:, 3:], array[:, 3:]))  # NumPy's takes longer
    if np.any(np.abs(norm - 1.0) > NORM_TOLERANCE):
        row = int(np.argmax(np.abs(norm - 1.0)))
        raise InputError(
            f"{name} row {row} has a quaternion of norm {norm[row]:.4g}; expected a unit "
            "quaternion, scalar first"
        )
    out = array.copy()
    exact = np.abs(norm - 1.0) > 1e-15
    out[exact, 3:] /= norm[exact, None]
    return out


# The poses of commanded lengths: where the search for their equilibria starts.
#
# Lengths alone do not state where the platform is. From the reference pose, metres away, the
# descent may end in another equilibrium than the robot's: a fully constrained platform comes to
# rest twisted by 90 degrees there. So the pose whose straight lengths fit the commanded ones best
# is found first (forward kinematics by least squares, with Levenberg and Marquardt's damped
# steps). It is searched from the reference pose and, if the fit is bad, from poses of rows with
# similar lengths.

# Most steps; the first damping, and the factors by which it is divided and multiplied.
_STEPS, _DAMPING, _LESS, _MORE = 60, 1e-3, 5.0, 4.0
# Least damping, relative to squares of order 1: with fewer cables than freedoms some are
# undetermined.
_LEAST = 1e-9
# An anchor point this close to its exit point [robot's length] has no direction.
_POINT = 1e-9
# A step that reduces the squares by less than this part is the last.
_END = 1e-9
# Rows with similar lengths that are tried, rounds, and the factor by which another fit must be
# better.
_NEAR, _ROUNDS, _BETTER = 8, 8, 0.5


def poses_from_lengths(robot: Robot, commands: Commands) -> Array | None:
    """Poses (n, 7) whose straight lengths fit the commanded ones best.

    None if poses are commanded, or if a search is to start from poses other than the reference.
    """
    if commands.lengths is None or np.any(commands.pose != robot.reference_pose):
        return None
    home, lengths = np.tile(robot.reference_pose, (len(commands), 1)), commands.lengths
    if not robot.all_driven:  # the others say nothing about where the platform is
        lengths = np.ascontiguousarray(lengths[:, robot.driven])
    if lengths.shape[1] == 0:
        return None
    pose, misfit = _fitted(robot, lengths, home)
    for _ in range(_ROUNDS):
        rows, start = _helped(lengths, pose, misfit)
        if len(rows) == 0:
            break
        there, other = _fitted(robot, lengths[rows], start)
        better = other < _BETTER * misfit[rows]
        if not better.any():
            break
        pose[rows[better]], misfit[rows[better]] = there[better], other[better]
    return pose


def _helped(lengths: Array, pose: Array, misfit: Array) -> tuple[NDArray[np.intp], Array]:
    """Rows with a neighbour that fits much better, and that neighbour's pose (k, 7)."""
    from scipy.spatial import cKDTree  # takes a while to import

    count = min(_NEAR + 1, len(lengths))
    if count < 2:
        return np.zeros(0, dtype=np.intp), pose[:0]
    near = cKDTree(lengths).query(lengths, count)[1]
    best = near[np.arange(len(near)), np.argmin(misfit[near], axis=1)]
    rows = np.flatnonzero(misfit[best] < _BETTER * misfit)
    return rows, pose[best[rows]]


def _fitted(robot: Robot, lengths: Array, start: Array) -> tuple[Array, Array]:
    """Poses (n, 7) that fit driven lengths (n, m) best, from others, and rms misfits (n,) [m]."""
    free = not robot.joints
    at = start if free else values_of_pose(robot, start)[0]
    scale = np.ones(at.shape[1] - 1 if free else at.shape[1])
    scale[slice(3, None) if free else robot.hinges] = 1.0 / robot.length
    damping = np.full(len(at), _DAMPING)
    off, rate = _misfits(robot, lengths, at, scale)
    squares = np.sum(off**2, axis=1)
    going = np.ones(len(at), dtype=bool)
    for _ in range(_STEPS):
        normal = np.swapaxes(rate[going], 1, 2) @ rate[going]
        index = np.arange(len(scale))
        normal[:, index, index] += damping[going, None]
        slope = np.einsum("nmd,nm->nd", rate[going], off[going])
        step = -scale * np.linalg.solve(normal, slope[..., None])[..., 0]
        new = at.copy()
        new[going] = pose_add(at[going], step) if free else at[going] + step
        new_off, new_rate = _misfits(robot, lengths[going], new[going], scale)
        new_squares = np.sum(new_off**2, axis=1)
        rows = np.flatnonzero(going)
        better = new_squares < squares[going]
        done = better & (squares[going] - new_squares < _END * squares[going])
        damping[rows] = np.maximum(damping[rows] * np.where(better, 1.0 / _LESS, _MORE), _LEAST)
        done |= damping[rows] > 1e6
        some = rows[better]
        at[some], off[some], rate[some] = new[some], new_off[better], new_rate[better]
        squares[some] = new_squares[better]
        going[rows[done]] = False
        if not going.any():
            break
    pose = at if free else pose_of_values(robot, at)[0]
    return pose, np.sqrt(squares / lengths.shape[1])


def _misfits(robot: Robot, lengths: Array, at: Array, scale: Array) -> tuple[Array, Array]:
    """Straight lengths minus the given ones (n, m) [m], and rates (n, m, d) by scaled steps."""
    free = not robot.joints
    pose, screws = (at, None) if free else pose_of_values(robot, at)
    arm = quat_rotate(pose[:, None, 3:], robot.anchor_points[robot.driven])
    span = pose[:, None, :3] + arm - robot.exit_points[robot.driven]
    straight = np.maximum(np.linalg.norm(span, axis=2), _POINT * robot.length)
    along = span / straight[..., None]
    by_pose = np.concatenate([along, cross(arm, along)], axis=2)
    rate = by_pose if screws is None else by_pose @ motion_columns(screws, pose[:, :3])
    return straight - lengths, rate * scale
