"""From a setup to the tables of the compiled loop, and what that loop says at given poses."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seecr.compiled import descent as kernel
from seecr.compiled import law as cable_law
from seecr.joints import values_of_pose
from seecr.pose import Array, quat_conjugate, quat_multiply
from seecr.robot import Robot
from seecr.setup import Setup

# Fewer poses than this are not worth a second thread.
_CHUNK = 128


@dataclass(eq=False)
class Tables:
    """The problem of n poses as the compiled loop reads it."""

    cables: Array  # (n, m, N_COLUMNS)
    load: Array  # (n, N_LOAD)
    poses: Array  # (n, 7) commanded
    screws: Array  # (n, d, 7) joints at the commanded pose; (n, 0, 7) for a free platform
    length: float
    scale: Array  # (n,) [N] that residuals are measured against
    reach: Array  # (n,) [m] deviations beyond this are a fall
    n_dof: int

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(eq=False)
class Evaluation:
    """What the loop fills: one row a pose."""

    outcome: NDArray[np.int64]
    count: NDArray[np.int64]
    residual: Array
    gradient: Array  # (n, d) [N], torques over the robot's length
    hessian: Array  # (n, d, d) [N/m] in scaled coordinates
    states: Array  # (n, m, N_STATE)
    slopes: Array  # (n, m, d)
    deviation: Array  # (n, 7)
    values: Array  # (n, d) joint values less the commanded ones, hinges times length
    guess: Array  # (n, m, 3) catenaries
    energy: Array

    @classmethod
    def empty(cls, n: int, m: int, d: int) -> Evaluation:
        deviation = np.zeros((n, 7))
        deviation[:, 3] = 1.0
        return cls(
            outcome=np.zeros(n, dtype=np.int64),
            count=np.zeros(n, dtype=np.int64),
            residual=np.zeros(n),
            gradient=np.zeros((n, d)),
            hessian=np.zeros((n, d, d)),
            states=np.zeros((n, m, cable_law.N_STATE)),
            slopes=np.zeros((n, m, d)),
            deviation=deviation,
            values=np.zeros((n, d)),
            guess=np.zeros((n, m, 3)),
            energy=np.zeros(n),
        )


@lru_cache(maxsize=8)
def _screws_of(robot: Robot, poses_bytes: bytes, n: int) -> Array:
    if not robot.joints:
        return np.zeros((n, 0, 7))
    poses = np.frombuffer(poses_bytes).reshape(n, 7)
    return values_of_pose(robot, poses)[1]


def assemble(setup: Setup, strains: Array | None = None) -> Tables:
    """The tables of a setup. History columns are left at their null.

    Args:
        setup: n rows.
        strains: (n, m) about which users' laws are linearised; zero by default.
    """
    robot, commands = setup.robot, setup.commands
    poses = np.ascontiguousarray(commands.pose)
    n, m = len(poses), robot.n_cables
    rest = setup.rest_lengths()
    gap = setup.geometric_lengths(poses) - rest
    cables = np.empty((n, m, cable_law.N_COLUMNS))
    cables[:] = _same_in_all_rows(setup)
    cables[..., cable_law.REST] = rest
    cables[..., cable_law.GAP] = gap
    if setup.laws:
        _linearise(setup, np.zeros((n, m)) if strains is None else strains, cables)
    load = np.zeros((n, kernel.N_LOAD))
    load[:, kernel.FORCE_OF_WEIGHT : kernel.FORCE_OF_WEIGHT + 3] = setup.mass * setup.gravity
    load[:, kernel.CENTRE_OF_MASS : kernel.CENTRE_OF_MASS + 3] = setup.centre_of_mass
    load[:, kernel.EXTERNAL_FORCE : kernel.EXTERNAL_FORCE + 6] = setup.wrench
    load[:, kernel.UP : kernel.UP + 3] = _hanging(setup)
    return Tables(
        cables=cables,
        load=load,
        poses=poses,
        screws=_screws_of(robot, poses.tobytes(), n),
        length=robot.length,
        scale=_load_scale(setup),
        reach=3.0 * (rest.max(axis=1) + np.abs(gap).max(axis=1)),
        n_dof=robot.n_dof,
    )


def _same_in_all_rows(setup: Setup) -> Array:
    """The cables' columns that no row changes, (m, N_COLUMNS)."""
    cables = np.zeros((setup.robot.n_cables, cable_law.N_COLUMNS))
    cables[:, cable_law.EXIT : cable_law.EXIT + 3] = setup.exit_points
    cables[:, cable_law.ANCHOR : cable_law.ANCHOR + 3] = setup.anchor_points
    for column, values in (
        (cable_law.EA, setup.ea),
        (cable_law.QUADRATIC, setup.quadratic),
        (cable_law.CUBIC, setup.cubic),
        (cable_law.RADIUS, setup.pulley_radius),
        (cable_law.COMPLIANCE, setup.compliance),
        (cable_law.WINCH_SIDE, setup.winch_side),
        (cable_law.WEIGHT, setup.cable_weight),
        (cable_law.HYSTERESIS, setup.hysteresis),
        (cable_law.HYSTERESIS_STRETCH, setup.hysteresis_stretch),
        (cable_law.FRICTION, setup.friction),
    ):
        cables[:, column] = values
    return cables


def _linearise(setup: Setup, strains: Array, cables: Array) -> None:
    """Tangents of the users' laws at the given strains (Newton's method does the rest)."""
    step = 1e-6 * (1e-3 + np.abs(strains))
    for law in setup.laws:
        slope = (law(strains + step) - law(strains - step)) / (2.0 * step)
        cables[..., cable_law.EXTRA] += law(strains) - slope * strains
        cables[..., cable_law.EXTRA_SLOPE] += slope


def _hanging(setup: Setup) -> Array:
    """Vertical of the planes in which cables hang: gravity's, or the pulleys' own."""
    g = np.linalg.norm(setup.gravity)
    if g == 0.0 or np.any(setup.pulley_radius):
        return setup.robot.up
    return -setup.gravity / g


def _load_scale(setup: Setup) -> Array:
    """Load [N] of each pose: weight, external force and moment over the robot's length."""
    weight = setup.mass * np.linalg.norm(setup.gravity)
    force = np.linalg.norm(setup.wrench[:, :3], axis=1)
    moment = np.linalg.norm(setup.wrench[:, 3:], axis=1) / setup.robot.length
    scale = weight + force + moment
    # nothing loads the platform: measure against what a strain of 1e-3 would pull
    return np.where(scale > 0.0, scale, 1e-3 * float(np.max(setup.ea)))


def _chunks(n: int, threads: int) -> list[slice]:
    parts = max(1, min(threads, n // _CHUNK))
    edges = np.linspace(0, n, parts + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    import os

    return ThreadPoolExecutor(max_workers=os.cpu_count() or 1)


def default_threads() -> int:
    """As many threads as there are processors."""
    import os

    return os.cpu_count() or 1


def descend(
    tables: Tables,
    start: Array | None = None,
    limit: int = 400,
    threads: int | None = None,
    start_values: Array | None = None,
    staged: bool | None = None,
    guess: Array | None = None,
) -> Evaluation:
    """Bring every pose to rest; ``start`` (n, 7) are deviations, none by default.

    ``guess`` (n, m, 3) are the catenaries of the start, where there are any.

    Stiff robots that do not get there are made stiff in stages, from soft (``staged=True``
    starts with that, ``False`` never does it). A soft robot can leave for another equilibrium,
    so the stages are for those alone that need them.
    """
    if staged is None:
        out = descend(tables, start, limit, threads, start_values, False, guess)
        unsettled = (out.outcome == kernel.ITERATIONS) | (out.outcome == kernel.STALLED)
        stiff = tables.cables[..., cable_law.EA].max(axis=1) > kernel.STIFF * tables.scale
        again = np.flatnonzero(unsettled & stiff)
        if len(again):
            first, values = (None if s is None else s[again] for s in (start, start_values))
            better = descend(take(tables, again), first, limit, threads, values, staged=True)
            better.count += out.count[again]
            put_evaluation(out, again, better)
        return out
    n, m = tables.cables.shape[:2]
    out = Evaluation.empty(n, m, tables.n_dof)
    starts = out.deviation.copy() if start is None else np.ascontiguousarray(start)
    first = np.zeros((n, tables.n_dof)) if start_values is None else start_values
    if guess is not None:
        out.guess[:] = guess
    out.energy = np.full(n, np.nan)

    def run(part: slice) -> None:
        kernel.solve_batch(
            tables.cables[part], tables.load[part], tables.poses[part], tables.screws[part],
            starts[part], first[part], tables.length, tables.scale[part], 0.5 * tables.length,
            tables.reach[part], limit, out.outcome[part], out.count[part], out.residual[part],
            out.gradient[part], out.hessian[part], out.states[part], out.slopes[part],
            out.deviation[part], out.values[part], out.guess[part], staged,
        )  # fmt: skip

    in_parts(run, n, threads)
    return out


def evaluate(tables: Tables, at: Evaluation, threads: int | None = 1) -> Evaluation:
    """Wrench, stiffness and energy at the deviations of ``at``; nothing is solved."""
    n, m = tables.cables.shape[:2]
    out = Evaluation.empty(n, m, tables.n_dof)
    out.deviation[:] = at.deviation
    out.values[:] = at.values
    out.guess[:] = at.guess

    def run(part: slice) -> None:
        kernel.evaluate_batch(
            tables.cables[part], tables.load[part], tables.poses[part], tables.screws[part],
            out.deviation[part], out.values[part], tables.length, out.gradient[part],
            out.hessian[part], out.states[part], out.slopes[part], out.energy[part],
            out.guess[part],
        )  # fmt: skip

    in_parts(run, n, threads)
    out.outcome = np.where(np.isinf(out.energy), kernel.CABLE_LAW, kernel.CONVERGED)
    out.residual = residual_size(out.gradient) / tables.scale
    return out


def in_parts(run: Callable[[slice], None], n: int, threads: int | None = None) -> None:
    """Run a job on n rows, in as many parts as there are threads and rows enough for them."""
    run_parts(run, _chunks(n, default_threads() if threads is None else threads))


def run_parts(run: Callable[[slice], None], parts: list[slice]) -> None:
    """Run a job on every part of a batch, in threads: the compiled loop frees the lock."""
    others = [_pool().submit(run, part) for part in parts[1:]]
    run(parts[0])
    for other in others:
        other.result()


def without_idle(tables: Tables, at: Evaluation) -> Evaluation:
    """Evaluate again, without the taut cables whose tension is mere rounding."""
    tension = at.states[..., cable_law.TENSION]
    idle = (at.states[..., cable_law.SLACK] == 0.0) & (
        tension < kernel.IDLE * tables.scale[:, None]
    )
    rest = take(tables, np.arange(len(tables)))
    rest.cables[idle, cable_law.GAP] = -rest.cables[idle, cable_law.REST]
    rest.cables[idle, cable_law.RADIUS] = 0.0
    return evaluate(rest, at)


def is_slack(tables: Tables, at: Evaluation) -> NDArray[np.bool_]:
    """Slack cables, (n, m): those longer than the way they bridge, and those that pull nothing.

    A heavy cable that is longer than its way hangs through and pulls by its weight alone. A
    tension below what rounding leaves of the load is none.
    """
    nothing = at.states[..., cable_law.TENSION] < kernel.IDLE * tables.scale[:, None]
    return np.asarray((at.states[..., cable_law.SLACK] > 0.5) | nothing)


def joints_at_rest(tables: Tables, at: Evaluation) -> Array:
    """The joints (n, d, 7) as they stand at the joint values of ``at``."""
    out, place = np.empty_like(tables.screws), np.empty(7)
    if tables.screws.shape[1] == 0:
        return out
    for i in range(len(tables)):
        kernel.place_joints(
            tables.screws[i], at.values[i], tables.length, tables.poses[i], place, out[i]
        )
    return out


def stiffness(tables: Tables, at: Evaluation) -> Array:
    """Minus the derivative of the wrench, (n, d, d) [N/m] in scaled coordinates.

    A constant moment, which has no potential, skews it; ``at.hessian`` is its symmetric part.
    """
    first = kernel.EXTERNAL_MOMENT
    rows = np.flatnonzero(np.any(tables.load[:, first : first + 3], axis=1))
    if len(rows) == 0:
        return at.hessian
    joints, out = joints_at_rest(tables, at), at.hessian.copy()
    for i in rows:
        kernel.add_skew(tables.load[i], joints[i], tables.length, out[i])
    return out


def residual_size(gradient: Array) -> Array:
    """Largest of force and torque over length, (n,) [N], of gradients (n, d)."""
    if gradient.shape[1] == 6:
        halves = np.linalg.norm(gradient.reshape(-1, 2, 3), axis=2)
        return halves.max(axis=1)
    return np.linalg.norm(gradient, axis=1)


def take(tables: Tables, rows: NDArray[np.integer]) -> Tables:
    """Some rows of the tables."""
    return Tables(
        tables.cables[rows], tables.load[rows], tables.poses[rows], tables.screws[rows],
        tables.length, tables.scale[rows], tables.reach[rows], tables.n_dof,
    )  # fmt: skip


def take_evaluation(whole: Evaluation, rows: NDArray[np.integer]) -> Evaluation:
    """Some rows of an evaluation."""
    return Evaluation(**{f.name: getattr(whole, f.name)[rows] for f in fields(Evaluation)})


def put_evaluation(whole: Evaluation, rows: NDArray[np.integer], part: Evaluation) -> None:
    """Put rows into an evaluation."""
    for f in fields(Evaluation):
        getattr(whole, f.name)[rows] = getattr(part, f.name)


def platform_poses(tables: Tables, deviation: Array) -> Array:
    """Poses (n, 7) of deviations (n, 7) from the commanded ones."""
    quat = quat_multiply(deviation[:, 3:], tables.poses[:, 3:])
    quat = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    return np.concatenate([tables.poses[:, :3] + deviation[:, :3], quat], axis=1)


def deviations(tables: Tables, poses: Array) -> Array:
    """Deviations (n, 7) of poses (n, 7) from the commanded ones."""
    quat = quat_multiply(poses[:, 3:], quat_conjugate(tables.poses[:, 3:]))
    quat = np.where(quat[:, :1] < 0.0, -quat, quat)
    return np.concatenate([poses[:, :3] - tables.poses[:, :3], quat], axis=1)
