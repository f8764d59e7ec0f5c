"""Rows that depend on the rows before them: the path between rows, and its compiled walk.

Hysteresis, friction and backlash start anew with each run: the platform rests at its reference
pose, moves straight to the first row and from row to row. Creep alone goes by the clock through
everything; between runs the robot waits at its reference pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seecr import kernel, statics
from seecr.cable_law import (
    CREEP,
    CREEP_RATE,
    EA,
    FRICTION,
    HYSTERESIS,
    HYSTERESIS_BEFORE,
    HYSTERESIS_NOW,
    REST,
    SLACK,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.joints import pose_of_values, values_of_pose
from seecr.pose import Array, pose_add, pose_difference
from seecr.robot import Robot
from seecr.setup import Commands, Setup

# Waypoints on the way to the first row of a run, and from row to row.
_APPROACH, _BETWEEN = 6, 2


@dataclass(frozen=True, eq=False)
class Path:
    """Rows with the waypoints between them.

    Attributes:
        commands: of all N waypoints.
        rows: (n,) which waypoints are the rows asked for.
        source: (N,) which row a waypoint belongs to.
        fresh: (N,) bool, waypoints at which a run starts from the reference pose.
        elapsed: (N,) [s] since the waypoint before.
    """

    commands: Commands
    rows: NDArray[np.integer]
    source: NDArray[np.integer]
    fresh: NDArray[np.bool_]
    elapsed: Array


def path_of(robot: Robot, commands: Commands) -> Path:
    """The waypoints of commands: straight from the reference pose, straight between rows."""
    n = len(commands)
    run = commands.run if commands.run is not None else np.zeros(n, dtype=np.int64)
    clock = commands.time if commands.time is not None else np.zeros(n)
    home_length = robot.rest_lengths if commands.lengths is not None else None
    poses: list[Array] = []
    lengths: list[Array] = []
    source: list[int] = []
    fresh: list[bool] = []
    elapsed: list[float] = []
    rows: list[int] = []
    for k in range(n):
        starts = k == 0 or run[k] != run[k - 1]
        if starts:
            poses.append(robot.reference_pose)
            source.append(k)
            fresh.append(True)
            elapsed.append(max(clock[k] - clock[k - 1], 0.0) if k else 0.0)
            if home_length is not None:
                lengths.append(home_length)
        before = robot.reference_pose if starts else commands.pose[k - 1]
        steps = _APPROACH if starts else _BETWEEN
        way = _straight(robot, before, commands.pose[k], steps)
        for s in range(1, steps + 1):
            part = s / steps
            poses.append(way[s - 1])
            source.append(k)
            fresh.append(False)
            elapsed.append(0.0 if starts else max(clock[k] - clock[k - 1], 0.0) / steps)
            if home_length is not None and commands.lengths is not None:
                last = home_length if starts else commands.lengths[k - 1]
                lengths.append(last + part * (commands.lengths[k] - last))
        rows.append(len(poses) - 1)
    index = np.array(source)
    whole = Commands(
        pose=np.array(poses),
        lengths=np.array(lengths) if lengths else None,
        run=run[index],
        time=None if commands.time is None else commands.time[index],
        temperature=None if commands.temperature is None else commands.temperature[index],
    )
    return Path(whole, np.array(rows), index, np.array(fresh), np.array(elapsed))


def _straight(robot: Robot, before: Array, after: Array, steps: int) -> list[Array]:
    """Poses (7,) in even steps from one pose to another, straight in what the platform may do."""
    parts = np.arange(1, steps)[:, None] / steps
    if robot.joints:
        ends = values_of_pose(robot, np.stack([before, after]))[0]
        way = pose_of_values(robot, ends[0] + parts * (ends[1] - ends[0]))[0]
    else:
        start = np.broadcast_to(before, (steps - 1, 7))
        way = pose_add(start, parts * pose_difference(after, before))
    return [*way, after]


def walk(setup: Setup, tables: statics.Tables, path: Path, limit: int) -> statics.Evaluation:
    """Solve the waypoints in order, each from the one before, and carry the cables' state."""
    n, m = tables.cables.shape[:2]
    out = statics.Evaluation.empty(n, m, tables.n_dof)
    out.energy = np.full(n, np.nan)
    with_clock = bool(np.any(setup.creep))
    starts = np.flatnonzero(path.fresh)
    # runs are independent, but for creep, which goes through all of them
    edges = [0, n] if with_clock else [*starts.tolist(), n]
    parts = [slice(a, b) for a, b in pairwise(edges)]

    def run(part: slice) -> None:
        _walk(
            tables.cables[part], tables.load[part], tables.poses[part], tables.screws[part],
            tables.length, tables.scale[part], 0.5 * tables.length, tables.reach[part], limit,
            path.fresh[part], path.elapsed[part], setup.creep, setup.creep_time,
            out.outcome[part], out.count[part], out.residual[part], out.gradient[part],
            out.hessian[part], out.states[part], out.slopes[part], out.deviation[part],
            out.values[part], out.guess[part],
        )  # fmt: skip

    statics.run_parts(run, parts)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _shares(span):  # type: ignore[no-untyped-def]
    """What a load linear in time leaves of itself after ``span`` time constants.

    Of its value before and now: the convolution of a ramp with exp(-t); the rest, exp(-span),
    is left of the creep there was.
    """
    if span < 1e-3:
        before = span / 2 - span**2 / 3 + span**3 / 8
        return before, span / 2 - span**2 / 6 + span**3 / 24
    mean = -np.expm1(-span) / span
    return mean - np.exp(-span), 1.0 - mean


@njit(cache=True, nogil=True, error_model="numpy")
def _walk(  # type: ignore[no-untyped-def]
    cables, load, poses, screws, length, scale, radius, reach, limit, fresh, elapsed, creep,
    creep_time, outcome, count, residual, gradient, hessian, states, slopes, deviation, values,
    guess,
):  # fmt: skip
    n, m = cables.shape[0], cables.shape[1]
    softened = np.empty_like(cables[0])
    start, first = np.zeros(7), np.zeros(gradient.shape[1])
    crept, amplitude = np.zeros(m), np.empty(m)
    friction = np.empty(m)
    space = kernel.make_space(m, gradient.shape[1], screws.shape[1])
    for k in range(n):
        if fresh[k]:
            start[:] = 0.0
            start[3] = 1.0
            first[:] = 0.0
        else:
            # as far from its command as it was before
            start[:] = deviation[k - 1]
            first[:] = values[k - 1]
        for i in range(m):
            row = cables[k, i]
            amplitude[i], friction[i] = row[HYSTERESIS], row[FRICTION]
            before, now = _shares(elapsed[k] / creep_time[i])
            share = creep[i] / row[EA]
            row[CREEP] = crept[i] * (1.0 - before - now)
            if fresh[k]:
                # waits at the reference pose, history cleared
                row[CREEP_RATE] = share * (before + now)
                row[HYSTERESIS], row[FRICTION] = 0.0, 0.0
                continue
            row[CREEP] += share * before * states[k - 1, i, TENSION]
            row[CREEP_RATE] = share * now
            row[STRETCH_BEFORE] = max(states[k - 1, i, STRAIN], 0.0) * cables[k - 1, i, REST]
            row[HYSTERESIS_BEFORE] = states[k - 1, i, HYSTERESIS_NOW]
            if row[WINCH_SIDE] > 0.0:
                paid = row[REST] - cables[k - 1, i, REST]
                row[STUCK] = states[k - 1, i, WINCH_TENSION] - paid * row[EA] / row[WINCH_SIDE]
        outcome[k], count[k], residual[k] = kernel.solve_in_stages(
            cables[k], load[k], poses[k], screws[k], start, first, length, scale[k], radius,
            reach[k], limit, guess[k], gradient[k], hessian[k], states[k], slopes[k],
            deviation[k], values[k], softened, fresh[k], space,
        )  # fmt: skip
        for i in range(m):
            row = cables[k, i]
            crept[i] = row[CREEP] + row[CREEP_RATE] * states[k, i, TENSION]
            if fresh[k]:
                row[HYSTERESIS], row[FRICTION] = amplitude[i], friction[i]
                row[STRETCH_BEFORE] = max(states[k, i, STRAIN], 0.0) * row[REST]
                row[HYSTERESIS_BEFORE] = 0.0
                row[STUCK] = states[k, i, WINCH_TENSION]
                states[k, i, HYSTERESIS_NOW] = 0.0
            elif states[k, i, SLACK] == 1.0:
                states[k, i, HYSTERESIS_NOW] = 0.0
