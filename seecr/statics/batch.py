"""Batch calls on the compiled loop: descents to equilibria, and evaluations at given poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from itertools import pairwise
from threading import Event
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Path
from seecr.compiled.columns import (
    CABLE_LAW,
    CONVERGED,
    CREEP_PART,
    EA,
    EXTERNAL_MOMENT,
    GAP,
    IDLE,
    ITERATIONS,
    N_RATES,
    N_STATE,
    NO_LENGTH,
    PUSHES,
    RADIUS,
    REST,
    SINGULAR,
    SLACK,
    STALLED,
    STRAIN,
    TENSION,
    TOLERANCE,
)
from seecr.compiled.history import change_on_the_way, solve_rows, space_of_way
from seecr.compiled.joint_kinematics import N_CURRENT, place_batch
from seecr.compiled.newton import FINE, STIFF
from seecr.compiled.platform import add_skew, evaluate_batch
from seecr.compiled.rates import change_at_rest, change_of_each_cable, change_space
from seecr.parallel import run_parts
from seecr.pose import SMALLEST, Array, deviated, products, quat_conjugate
from seecr.statics.abreast import (
    Rested,
    are_for_lanes,
    descend_in_lanes,
    stiffness_in_lanes,
)
from seecr.statics.tables import (
    PORTION,
    ByRow,
    Tables,
    by_row,
    portions,
    rest_lengths_of,
    shared_cables,
    take,
    told_apart,
)


@dataclass(eq=False)
class Evaluation(ByRow):
    """The results of the compiled loop, one row per pose."""

    outcome: NDArray[np.int64]
    count: NDArray[np.int64]
    residual: Array
    gradient: Array  # (n, d) [N], torques over the robot's length
    hessian: Array  # (n, d, d) [N/m] in scaled coordinates
    states: Array  # (n, m, N_STATE)
    slopes: Array  # (n, m, d)
    deviation: Array  # (n, 7)
    values: Array  # (n, d) joint values minus the commanded ones, hinges times the robot's length
    guess: Array  # (n, m, 3) catenaries
    energy: Array

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(n,) rows in a stable equilibrium."""
        return np.asarray((self.outcome == CONVERGED) & (self.residual < TOLERANCE))

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """(n,) rows in equilibrium, including those that are free to move along some direction."""
        return _are_at_rest(self.outcome)

    @classmethod
    def empty(cls, n: int, m: int, d: int) -> Evaluation:
        deviation = np.zeros((n, 7))
        deviation[:, 3] = 1.0
        outcome, count, zeros = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.zeros
        return cls(
            outcome, count, zeros(n), zeros((n, d)), zeros((n, d, d)), zeros((n, m, N_STATE)),
            zeros((n, m, d)), deviation, zeros((n, d)), zeros((n, m, 3)), zeros(n),
        )  # fmt: skip

    @classmethod
    def at_commands(cls, tables: Tables) -> Evaluation:
        """Nothing evaluated yet, with the platform at the poses of tables."""
        n, m = tables.cables.shape[:2]
        return cls.empty(n, m, tables.n_dof)

    @property
    def tension(self) -> Array:
        """(n, m) [N] tensions."""
        return np.asarray(self.states[..., TENSION])

    @property
    def strain(self) -> Array:
        """(n, m) strains of the cables."""
        return np.asarray(self.states[..., STRAIN])

    @property
    def loose(self) -> NDArray[np.bool_]:
        """(n, m) cables that are longer than their span."""
        return np.asarray(self.states[..., SLACK] > 0.5)

    def there(self) -> Evaluation:
        """Nothing evaluated yet, with the platform and its catenaries where they are here."""
        out = Evaluation.empty(*self.slopes.shape)
        out.deviation[:], out.values[:], out.guess[:] = self.deviation, self.values, self.guess
        return out


class Brief(Evaluation):
    """Where many platforms rest, and what their cables do: tensions, and which are loose.

    All else takes more memory, and longer to write than a rest takes to find in lanes: it is
    evaluated when it is asked for.
    """

    tables: Tables
    for_lanes: bool
    pulls: Array
    longer: NDArray[np.bool_]
    alone: NDArray[np.bool_]  # (n,) rows of the compiled loop, not of lanes

    @classmethod
    def of(cls, tables: Tables, found: Rested, for_lanes: bool, alone: NDArray[np.bool_]) -> Brief:
        out = cls.__new__(cls)
        vars(out).update(vars(found), tables=tables, for_lanes=for_lanes, alone=alone)
        return out

    def columns(self) -> dict[str, NDArray[Any]]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def only(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> Self:
        at = np.arange(len(self.outcome))[rows]
        return self._with(take(self.tables, at), lambda each: each[at])

    def copy(self) -> Self:
        return self._with(self.tables, lambda each: each.copy())

    def _with(self, tables: Tables, of: Callable[[NDArray[Any]], NDArray[Any]]) -> Self:
        """The same with other arrays: all that there are so far."""
        out = type(self).__new__(type(self))
        arrays = {k: of(each) for k, each in vars(self).items() if isinstance(each, np.ndarray)}
        vars(out).update(arrays, tables=tables, for_lanes=self.for_lanes)
        return out

    def put(self, rows: NDArray[np.integer] | NDArray[np.bool_], other: Evaluation) -> None:
        super().put(rows, other)  # type: ignore[arg-type]
        self.pulls[rows], self.longer[rows], self.alone[rows] = other.tension, other.loose, True

    @property
    def tension(self) -> Array:
        return self.pulls

    @property
    def loose(self) -> NDArray[np.bool_]:
        return self.longer

    @property
    def strain(self) -> Array:
        return self._evaluated(lambda at: at.strain)

    def there(self) -> Evaluation:
        out = Evaluation.at_commands(self.tables)
        out.deviation[:], out.values[:] = self.deviation, self.values
        return out

    def __getattr__(self, name: str) -> Array:
        if name not in {field.name for field in fields(Evaluation)} or "tables" not in vars(self):
            raise AttributeError(name)
        own = vars(self)
        if name == "hessian" and self.for_lanes and self.tables.screws.shape[1] == 0:
            own[name] = stiffness_in_lanes(self.tables, self.deviation)
        elif name == "guess" and self.for_lanes:  # straight cables have none
            own[name] = np.zeros((*self.pulls.shape, 3))
        elif len(self.outcome) > PORTION:
            own[name] = self._evaluated(lambda at: getattr(at, name))
        else:
            at = evaluate(self.tables, self, threads=None)
            for each in ("gradient", "hessian", "states", "slopes", "guess"):
                own.setdefault(each, getattr(at, each))
        return np.asarray(own[name])

    def _evaluated(self, of: Callable[[Evaluation], Array]) -> Array:
        """What is asked of evaluations of some rows at a time, of which nothing else stays."""
        every = np.arange(len(self.outcome))
        if len(every) <= PORTION:
            return of(evaluate(self.tables, self, threads=None))
        return np.concatenate([self.only(rows)._evaluated(of) for rows in portions(every)])


def _are_at_rest(outcome: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) whether rows are in equilibrium, free to move or not."""
    return np.asarray((outcome == CONVERGED) | (outcome == SINGULAR))


def descend(
    tables: Tables, start: Array | None = None, limit: int = 400, threads: int | None = None,
    start_values: Array | None = None, staged: bool | None = None, guess: Array | None = None,
) -> Evaluation:  # fmt: skip
    """Newton descent of all poses to equilibria; ``start`` (n, 7) are deviations, none by default.

    Stiff robots whose descent does not converge are solved again with a stiffness that is raised in
    stages. ``staged=True`` does so from the start, ``False`` never: a soft robot may change to
    another equilibrium by it. ``guess`` (n, m, 3) are the catenaries at the start, if known.

    Many poses with straight linear cables descend in lanes, the same way and sixteen abreast; those
    whose descent takes another way are left to the compiled loop. Very many go through that loop in
    portions, and little is kept of each.
    """
    for_lanes = not staged and are_for_lanes(tables)
    n, m = len(tables), rest_lengths_of(tables).shape[1]
    if not for_lanes and (staged or n <= PORTION or guess is not None):
        return _descend_alone(tables, start, limit, threads, start_values, staged, guess)
    found = Rested(n, m, tables.n_dof)
    if for_lanes:
        descend_in_lanes(tables, start, start_values, limit, threads, found)
    is_left = found.outcome < 0
    for rows in portions(np.flatnonzero(is_left)):
        first, values = (None if s is None else s[rows] for s in (start, start_values))
        some = take(tables, rows)
        alone = _descend_alone(some, first, limit, threads, values, staged, None)
        found.put(rows, alone, evaluate(some, alone, threads))
    out = Brief.of(tables, found, for_lanes, is_left)
    _refuse_no_length(tables, out)
    return out


def _descend_alone(
    tables: Tables, start: Array | None, limit: int, threads: int | None,
    start_values: Array | None, staged: bool | None, guess: Array | None,
) -> Evaluation:  # fmt: skip
    """The same, each pose by itself in the compiled loop."""
    if staged is None:
        out = _descend_alone(tables, start, limit, threads, start_values, False, guess)
        unsettled = (out.outcome == ITERATIONS) | (out.outcome == STALLED)
        stiff = tables.cables[..., EA].max(axis=1) > STIFF * tables.scale
        again = np.flatnonzero(unsettled & stiff)
        if len(again):
            first, values = (None if s is None else s[again] for s in (start, start_values))
            some = take(tables, again)
            better = _descend_alone(some, first, limit, threads, values, True, None)
            better.count += out.count[again]
            out.put(again, better)
        return out
    n, out = len(tables), Evaluation.at_commands(tables)
    starts = np.array(out.deviation if start is None else start, order="C")
    first = np.zeros((n, tables.n_dof)) if start_values is None else start_values
    if guess is not None:
        out.guess[:] = guess
    out.energy[:] = np.nan

    fresh = np.ones(n, dtype=bool)
    by_row(
        solve_rows, tables.cables, tables.load, tables.poses, tables.screws, starts, first,
        tables.length, tables.scale, 0.5 * tables.length, tables.reach, limit, staged, False,
        fresh, ~fresh, np.full(n, FINE), np.zeros(n), out.outcome, out.count, out.residual,
        out.gradient, out.hessian, out.states, out.slopes, out.deviation, out.values, out.guess,
        threads=threads,
    )  # fmt: skip
    _refuse_no_length(tables, out)
    return out


def _refuse_no_length(tables: Tables, found: Evaluation) -> None:
    """Rows in which an effect leaves a cable no length have no result, whatever was computed."""
    rest = rest_lengths_of(tables)
    if not rest.min(initial=np.inf) >= SMALLEST:
        found.outcome[(rest < SMALLEST).any(axis=1)] = NO_LENGTH


def motions(tables: Tables, at: Evaluation) -> Array:
    """The platform's motion (n or 1, d, 6) per step along each coordinate, where ``at`` is.

    Translation of its origin, and rotation vector times the robot's length, base axes.
    """
    n = len(tables)
    if tables.screws.shape[1] == 0:
        return np.eye(6)[None]
    from seecr.compiled.joint_kinematics import apart_batch  # takes a while to import

    out, given, length = (
        np.empty((n, tables.n_dof, 6)),
        (tables.screws, tables.poses),
        tables.length,
    )
    by_row(
        lambda rows, values, apart, to: apart_batch(*given, rows, values, length, apart, to),
        np.arange(n), at.values, np.empty((n, 6)), out,
    )  # fmt: skip
    return out


def evaluate(tables: Tables, at: Evaluation, threads: int | None = 1) -> Evaluation:
    """Wrench, stiffness and energy at the deviations of ``at``; nothing is solved."""
    out = at.there()
    by_row(
        evaluate_batch, tables.cables, tables.load, tables.poses, tables.screws, out.deviation,
        out.values, tables.length, out.gradient, out.hessian, out.states, out.slopes, out.energy,
        out.guess, threads=threads,
    )  # fmt: skip
    out.outcome = np.where(np.isinf(out.energy), CABLE_LAW, CONVERGED)
    out.residual = residual_size(out.gradient) / tables.scale
    return out


def walk(
    tables: Tables, path: Path, limit: int, needed: NDArray[np.bool_] | None = None
) -> Evaluation:
    """Solve the waypoints of a path in order, each from the one before; fills the history columns.

    Runs are independent, except with creep, which continues through all runs that share a clock.
    ``needed`` (n,) are rows without which all is useless: where one is lost, no other run is begun.
    """
    vital = np.zeros(len(tables), dtype=bool) if needed is None else path.on_the_way_to(needed)
    given_up = Event()
    out = Evaluation.at_commands(tables)
    out.energy[:] = np.nan
    enough = np.full(len(tables), TOLERANCE)  # on the way; to rows as many digits as possible
    enough[path.rows] = FINE
    starts, first = out.deviation.copy(), np.zeros((len(tables), tables.n_dof))

    def run(part: slice) -> None:
        if given_up.is_set():
            out.outcome[part] = STALLED
            return
        solve_rows(
            tables.cables[part], tables.load[part], tables.poses[part], tables.screws[part],
            starts[part], first[part], tables.length, tables.scale[part], 0.5 * tables.length,
            tables.reach[part], limit, True, True, path.fresh[part], path.onward[part],
            enough[part], path.elapsed[part], out.outcome[part], out.count[part],
            out.residual[part], out.gradient[part], out.hessian[part], out.states[part],
            out.slopes[part], out.deviation[part], out.values[part], out.guess[part],
        )  # fmt: skip
        if np.any(vital[part] & ~_are_at_rest(out.outcome[part])):
            given_up.set()

    run_parts(run, _apart(path, tables))
    _refuse_no_length(tables, out)
    return out


def _apart(path: Path, *tables: Tables) -> list[slice]:
    """Groups of waypoints that do not depend on the waypoints of other groups."""
    creeps = any(np.any(one.cables[..., CREEP_PART]) for one in tables)
    starts = np.flatnonzero(path.new_clock if creeps else path.fresh).tolist()
    return [slice(a, b) for a, b in pairwise([*starts, len(path.source)])]


def change_of_walk(
    plus: Tables, minus: Tables, path: Path, at: Evaluation, inverse: Array
) -> tuple[Array, Array]:
    """Steps (N, d) [m] and tensions (N, m) of a path under ``plus`` minus those under ``minus``.

    ``at`` are equilibria between the two, ``inverse`` (N, d, d) [m/N] that of the stiffness there.
    """
    n, m = plus.cables.shape[:2]
    step, tension = np.empty((n, plus.n_dof)), np.empty((n, m))
    solved = at.at_rest
    for part in _apart(path, plus, minus):
        change_on_the_way(
            plus.cables[part], minus.cables[part], plus.load[part], minus.load[part],
            plus.poses[part], plus.screws[part], at.deviation[part], at.values[part],
            at.slopes[part], plus.length, at.guess[part], inverse[part], path.fresh[part],
            path.elapsed[part], solved[part], step[part], tension[part],
            space_of_way(plus.screws, m, plus.n_dof),
        )  # fmt: skip
    return step, tension


def change(plus: Tables, minus: Tables, at: Evaluation) -> tuple[Array, Array]:
    """Gradient (n, d) and tensions (n, m) [N] of ``plus`` minus those of ``minus``."""
    n, m = plus.cables.shape[:2]
    gradient, tension = np.empty((n, plus.n_dof)), np.empty((n, m))
    by_row(
        change_at_rest, plus.cables, minus.cables, plus.load, minus.load, plus.poses, plus.screws,
        at.deviation, at.values, plus.length, at.guess, gradient, tension,
        scratch=partial(change_space, plus.screws),
    )  # fmt: skip
    return _solved(gradient, tension, gradient)


def change_by_cable(plus: Tables, minus: Tables, at: Evaluation) -> tuple[Array, Array]:
    """The same cable by cable: gradient (n, d, m) [N] and each cable's own tension (n, m).

    It is for tables in which every cable was changed, under the same load.
    """
    n, m = plus.cables.shape[:2]
    gradient, tension = np.empty((n, m, plus.n_dof)), np.empty((n, m))
    by_row(
        change_of_each_cable, plus.cables, minus.cables, plus.load, plus.poses, plus.screws,
        at.deviation, at.values, plus.length, at.guess, gradient, tension,
        scratch=partial(change_space, plus.screws),
    )  # fmt: skip
    return _solved(np.swapaxes(gradient, 1, 2), tension, gradient.reshape(n, m * plus.n_dof))


def rates_of_cables(tables: Tables, at: Evaluation) -> Array:
    """What each cable pulls with, and how that changes: (n, m, N_RATES).

    All is zero for rows in which a cable's equations could not be solved.
    """
    from seecr.compiled.rates import rates_of_each_cable  # takes a while to import

    out = np.empty((*tables.cables.shape[:2], N_RATES))
    by_row(
        rates_of_each_cable, tables.cables, tables.load, tables.poses, tables.screws, at.deviation,
        at.values, tables.length, at.guess, out, scratch=partial(change_space, tables.screws),
    )  # fmt: skip
    out[np.isnan(out).any(axis=(1, 2))] = 0.0
    return out


def pull_and_change(tables: Tables, at: Evaluation) -> tuple[Evaluation, Array, Array]:
    """Wrench and tensions where ``at`` is, without stiffness, and derivatives by rest length.

    These are (n, d, m) of the gradient and (n, m) of each cable's own tension [N/m].
    """
    from seecr.compiled import rates  # takes a while to import

    (n, m), d = tables.cables.shape[:2], tables.n_dof
    out, pulls = at.there(), np.empty((n, m))
    gradient, tension = np.empty((n, m, d)), np.empty((n, m))
    by_row(
        rates.pull_and_change, tables.cables, tables.load, tables.poses, tables.screws,
        out.deviation, out.values, tables.length, out.guess, out.gradient, pulls, gradient, tension,
        scratch=partial(change_space, tables.screws),
    )  # fmt: skip
    out.states[..., TENSION] = pulls
    lost = np.isnan(out.gradient).any(axis=1)
    out.residual = np.where(lost, np.inf, residual_size(out.gradient) / tables.scale)
    out.outcome = np.where(lost, CABLE_LAW, CONVERGED)
    out.gradient[lost] = 0.0
    return out, *_solved(np.swapaxes(gradient, 1, 2), tension, gradient.reshape(n, m * d))


def _solved(gradient: Array, tension: Array, failed: Array) -> tuple[Array, Array]:
    """Zero change for rows in which a cable's equations could not be solved beside the pose."""
    lost = np.isnan(failed).any(axis=1)
    gradient[lost], tension[lost] = 0.0, 0.0
    return gradient, tension


def without_idle(tables: Tables, at: Evaluation) -> Evaluation:
    """Evaluate again, without the taut cables whose tension is mere rounding."""
    tension = at.states[..., TENSION]
    idle = (at.states[..., SLACK] == 0.0) & (tension < IDLE * tables.scale[:, None])
    idle &= tables.cables[..., PUSHES] == 0.0
    rest = take(tables, np.arange(len(tables)))
    rest.cables[idle, GAP] = -rest.cables[idle, REST]
    rest.cables[idle, RADIUS] = 0.0
    return evaluate(rest, at)


def is_slack(tables: Tables, at: Evaluation) -> NDArray[np.bool_]:
    """Slack cables, (n, m): those longer than their span, which may sag, or without tension."""
    nothing = at.tension < IDLE * tables.scale[:, None]
    nothing &= shared_cables(tables)[..., PUSHES] == 0.0
    return np.asarray(at.loose | nothing)


def joints_at_rest(tables: Tables, at: Evaluation) -> Array:
    """Axes and points of the joints (n, d, N_CURRENT) at the joint values of ``at``."""
    out = np.empty((*tables.screws.shape[:2], N_CURRENT))
    if tables.screws.shape[1]:
        place = np.empty(7)
        place_batch(tables.screws, at.values, tables.length, tables.poses, place, out)
    return out


def stiffness(tables: Tables, at: Evaluation) -> Array:
    """Minus the derivative of the wrench, (n, d, d) [N/m] in scaled coordinates.

    A moment whose work depends on the way makes it asymmetric; ``at.hessian`` is its symmetric
    part.
    """
    rows = np.flatnonzero(under_moment(tables))
    if len(rows) == 0:
        return at.hessian
    joints, out = joints_at_rest(tables, at), at.hessian.copy()
    for i in rows:
        add_skew(tables.load[i], joints[i], tables.length, out[i])
    return out


def under_moment(tables: Tables) -> NDArray[np.bool_]:
    """Rows (n,) with an external moment."""
    load = told_apart(tables)[2]
    pushed = np.any(load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3], axis=1)
    return np.broadcast_to(pushed, len(tables))


def residual_size(gradient: Array) -> Array:
    """The larger of force and torque over length, (n,) [N]; on joints the norm of the gradient."""
    with np.errstate(over="ignore"):  # of forces without bounds: of cables that have no length
        if gradient.shape[1] == 6:
            halves = np.linalg.norm(gradient.reshape(-1, 2, 3), axis=2)
            return np.asarray(halves.max(axis=1))
        return np.asarray(np.linalg.norm(gradient, axis=1))


def platform_poses(tables: Tables, deviation: Array) -> Array:
    """Poses (n, 7) from deviations (n, 7) from the commanded ones.

    Two quaternions, q and -q, are the same orientation. Poses have the one nearer to the command's.
    """
    poses = deviated(tables.poses, deviation)
    around = deviation[:, 3] < 0.0
    if around.any():
        poses[around, 3:] *= -1.0
    return poses


def deviations(tables: Tables, poses: Array) -> Array:
    """Deviations (n, 7) of poses (n, 7) from the commanded ones."""
    quat = products(poses[:, 3:], quat_conjugate(tables.poses[:, 3:]))
    quat = np.where(quat[:, :1] < 0.0, -quat, quat)
    return np.concatenate([poses[:, :3] - tables.poses[:, :3], quat], axis=1)
