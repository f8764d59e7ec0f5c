"""What an unknown effect may change in time: over the session, from run to run, after each step.

A tracker that moves shows over the session, wherever the platform is; so do exit points that move
and cables that grow, but their platform moves as they make it. Between runs a tracker may be set up
anew, or the robot homed. And readings that are taken too early lag behind the last step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.unknown.varying.columns import (
    SMOOTH,
    in_units_of_noise,
    products,
    rates_by,
)
from crosscheck.calibration.unknown.varying.kinds import Varying
from crosscheck.fit.least_squares.problem import POSITION
from crosscheck.fit.noise.smooth import field_columns, monomials
from seecr.pose import Array

# Runs have no offsets of their own if they have fewer rows than this on average, or are so many
# that these would be hundreds of numbers.
_SHORT, _MANY = 5, 20


def varying_in_time(setting: Setting, joint: JointFit) -> list[tuple[Varying, Array]]:
    """Candidates that depend on when a row was read, on its run or on the row before.

    They are columns (N, k) in units of the noise; candidates that move no reading are left out.
    """
    parts = (_of_tracker, _of_steps, _of_drifts, _of_runs)
    every = (one for part in parts for one in part(setting, joint))
    return [(what, columns) for what, columns in every if np.any(columns)]


def _of_tracker(setting: Setting, _joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """A cubic in the time for each channel of the position."""
    columns = field_columns(setting.problem, _session(setting)[:, None], POSITION.stop)
    yield Varying.SESSION, columns


def _session(setting: Setting) -> Array:
    """(n,) when each row was read: by the clock if it never goes back, else by row number."""
    data = setting.problem.data
    clock = data.t_s
    if clock is not None and np.all(np.diff(clock) >= 0.0) and np.ptp(clock) > 0.0:
        return clock
    return np.arange(data.n_rows, dtype=float)


def _of_steps(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """The pose of each row on its way from that of the row before in its run."""
    problem, state = setting.problem, joint.state
    run, here = problem.data.run_index, state.prediction.readings
    before = np.maximum(np.arange(len(run)) - 1, 0)
    before[run[before] != run] += 1
    there = replace(here, position=here.position[before], quat_wxyz=here.quat_wxyz[before])
    step = problem.residuals(there) - problem.residuals(here)
    yield Varying.LAG, in_units_of_noise(problem.whiten(state.factor, step)[:, None])


def _of_drifts(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """Changes of the robot that are quadratic in the time."""
    time = monomials(_session(setting)[:, None], 2, SMOOTH)[setting.problem.row_of, 1:]
    for what, name in (
        (Varying.EXIT_POINTS_MOVE, "exit_point_error"),
        (Varying.LENGTHS_DRIFT, "cable_length_offset"),
        (Varying.FORCE_DRIFTS, "external_wrench"),
    ):
        yield what, in_units_of_noise(products(rates_by(setting, joint, name), time))


def _of_runs(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """An offset of each run's own, of the position and of cable lengths."""
    problem, run = setting.problem, setting.problem.data.run_index
    runs = np.unique(run)
    if not 1 < len(runs) <= min(_MANY, len(run) // _SHORT):
        return
    own = (run[:, None] == runs).astype(float)[problem.row_of]
    read = [problem.column_of == c for c in np.unique(problem.column_of) if c < POSITION.stop]
    if read:
        yield Varying.POSITION_BY_RUN, np.hstack([own * channel[:, None] for channel in read])
    lengths = rates_by(setting, joint, "cable_length_offset")
    yield Varying.LENGTHS_BY_RUN, in_units_of_noise(products(lengths, own))
