"""Small vibrations of a platform about its rest: mass matrix, frequencies and modes."""

from __future__ import annotations

import numpy as np

from seecr.compiled.columns import CENTRE_OF_MASS, FORCE_OF_WEIGHT
from seecr.description.joints import motion_columns, values_of_pose
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, quat_rotate, quat_to_matrix
from seecr.statics.tables import Tables, take

# A squared frequency below this part of the largest is rounding.
_NONE = 1e-12


def modes_of(robot: Robot, tables: Tables, pose: Array, stiffness: Array) -> tuple[Array, Array]:
    """Frequencies (n, d) [Hz] and shapes (n, d, d) at poses (n, 7) with stiffness (n, d, d).

    See :attr:`seecr.Solution.modes`; NaN where pose or stiffness is not known.
    """
    frequencies, shapes = np.full(stiffness.shape[:2], np.nan), np.full(stiffness.shape, np.nan)
    known = np.isfinite(stiffness).all(axis=(1, 2)) & np.isfinite(pose).all(axis=1)
    rows = np.flatnonzero(known)
    if len(rows) == 0:
        return frequencies, shapes
    mass = mass_matrices(robot, take(tables, rows), pose[rows])
    # K v = w^2 M v, made symmetric by the Cholesky factor of the mass matrix
    half = np.linalg.inv(np.linalg.cholesky(mass))
    even = 0.5 * (stiffness[rows] + stiffness[rows].swapaxes(1, 2))
    squares, vectors = np.linalg.eigh(half @ even @ half.swapaxes(1, 2))
    nothing = _NONE * np.abs(squares).max(axis=1, keepdims=True)
    squares = np.where(np.abs(squares) <= nothing, 0.0, squares)
    with np.errstate(invalid="ignore"):
        frequencies[rows] = np.sqrt(squares) / (2.0 * np.pi)
    shapes[rows] = half.swapaxes(1, 2) @ vectors
    return frequencies, shapes


def mass_matrices(robot: Robot, tables: Tables, poses: Array) -> Array:
    """Mass matrices (n, d, d) of the platform at poses (n, 7).

    For a free platform by translation of its origin and rotation, base frame [kg, kg m; kg m,
    kg m^2]; else by its joints. Mass and centre of mass are those of the rows, with effects and
    known payloads. A payload counts as a point mass, and cables have no mass.

    Raises:
        InputError: the platform's inertia is not known.
    """
    if not np.any(robot.inertia):
        raise InputError(f"robot {robot.name}: its inertia is not known; expected Robot.inertia")
    g = float(np.linalg.norm(robot.gravity))
    weight = np.linalg.norm(tables.load[:, FORCE_OF_WEIGHT : FORCE_OF_WEIGHT + 3], axis=1)
    mass = weight / g if g > 0.0 else np.full(len(poses), robot.mass)
    turn = quat_to_matrix(poses[:, 3:])
    lever = quat_rotate(poses[:, 3:], tables.load[:, CENTRE_OF_MASS : CENTRE_OF_MASS + 3])
    cross = np.cross(lever[:, None, :], np.eye(3)).swapaxes(1, 2)
    out = np.zeros((len(poses), 6, 6))
    out[:, :3, :3] = mass[:, None, None] * np.eye(3)
    out[:, 3:, :3] = mass[:, None, None] * cross
    out[:, :3, 3:] = out[:, 3:, :3].swapaxes(1, 2)
    about = turn @ robot.inertia @ turn.swapaxes(1, 2)
    out[:, 3:, 3:] = about - mass[:, None, None] * cross @ cross
    if not robot.joints:
        return out
    columns = motion_columns(values_of_pose(robot, poses)[1], poses[:, :3])
    return np.asarray(columns.swapaxes(1, 2) @ out @ columns)
