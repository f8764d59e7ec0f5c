"""Measured angles in columns of radians that follow the commands only if they are degrees."""

from __future__ import annotations

import numpy as np

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.dwells import mean_rotation
from seecr.columns.known import ANGLES, Columns
from seecr.description.robot import Robot
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_from_rxyz,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)

# Platforms that cables hold do not turn about their commands by so much (rms) [rad], and these are
# not off by so little.
_SCATTERED, _FOLLOWED = 0.5, 0.1
_LEAST_ROWS = 4


def refuse_followed_in_degrees(columns: Columns, robot: Robot, data: Measurements) -> None:
    """Refuse radians that scatter about the commands, and as degrees follow them.

    How the body is turned on the platform does not matter, and commanded lengths say nothing.
    Robots that hang on fewer cables than their degrees of freedom may tilt by so much.

    Raises:
        InputFileError: with the column that scatters most.
    """
    column = {k: columns.known.get(f"meas_{angle}") for k, angle in enumerate(ANGLES)}
    mine = [k for k, one in column.items() if one is not None and one.unit.suffix == "rad"]
    # lengths do not say how the platform is to turn: as degrees any angles are small
    if not mine or robot.n_cables < robot.n_dof or data.command_pose is None:
        return
    told = data.command_pose[:, 3:]
    read = rxyz_from_quat(told)
    for k, one in column.items():
        if one is not None:
            read[:, k] = columns.numbers(f"meas_{ANGLES[k]}", blank_is_nan=True)
    seen = np.isfinite(read).all(axis=1)
    if seen.sum() < _LEAST_ROWS:
        return
    back, small = quat_conjugate(told[seen]), read[seen]
    small[:, mine] = np.radians(small[:, mine])
    inside = quat_multiply(back, quat_from_rxyz(read[seen]))
    scatter = _rms(quat_multiply(inside, quat_conjugate(mean_rotation(inside))))
    off = _rms(quat_multiply(back, quat_from_rxyz(small)))
    if scatter < _SCATTERED or off > _FOLLOWED:
        return
    worst = max(mine, key=lambda k: float(np.std(read[seen, k])))
    name = f"meas_{ANGLES[worst]}"
    raise columns.table.error(
        f"expected radians, got angles that scatter by {scatter:.2g} rad (rms) about the commanded "
        f"ones and follow them to {np.degrees(off):.2g} deg if they are degrees; name the column "
        f"{name}_deg",
        column=f"{name}_rad",
    )


def _rms(quat: Array) -> float:
    """Root mean square of the angles [rad] of rotations (n, 4)."""
    return float(np.sqrt(np.mean(np.sum(rotvec_from_quat(quat) ** 2, axis=1))))
