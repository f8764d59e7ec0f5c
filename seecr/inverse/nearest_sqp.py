"""From poses that are held to the nearest such poses: sequential quadratic programming.

Each step has two parts (Byrd, Gould, Nocedal and Waltz 2004). A projection onto the linearised
balance decides which tensions go to their limits. A Newton step on those, with the curvature of the
balance, decides how far to go. Far from the wanted pose the curvature dominates: the projections
alone oscillate. All searches go on at once, and those of one row compete.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest_problem import Curved, NearestProblem, Spots
from seecr.pose import Array

# Residual of the balance at a solution [load], and the step that ends a search [robot's length].
TIGHT, ENOUGH = 1e-9, 1e-7
# Residual that is mere rounding [load].
_EXACT = 1e-13
# Most steps, corrections back to balance after each, and the residual allowed after these [load].
_STEPS, _RESTORED, _LOOSE = 60, 3, 1e-3
# Damping: least first value, factor, value from which it rises, value taken as zero, largest.
_FIRST, _FACTOR, _RISE, _NONE, _MOST = 1.0, 5.0, 0.1, 1e-3, 1e8
# A search ends if so many steps gain less than this part.
_PATIENCE, _GAIN = 6, 1e-5
# After so many steps, searches farther away than this many times their row's best are dropped.
_RACE = {8: 1.3, 14: 1.05, 20: 1.02, 30: 1.005}
# Newton steps back to balance, and the longest of them [robot's length].
_BACK, _LONGEST = 12, 2.0
# Regularisation of the multipliers where they are not unique, relative to the squared matrix.
_OPEN = 1e-13


def solve_sqp(problem: NearestProblem, start: Spots) -> Spots:
    """Continue from poses that are held until they get no nearer; slow searches stop earlier."""
    now, held, length = start.copy(), start.copy(), problem.robot.length
    mark = problem.size(now)
    # the balance curves more over a longer distance
    damping = np.maximum(_FIRST, 0.5 * mark / length)
    rose, idle = np.zeros(len(mark), dtype=bool), np.zeros(len(mark), dtype=np.intp)
    still = np.arange(len(mark))
    for number in range(_STEPS):
        if len(still) == 0:
            break
        here = now.only(still)
        new, better, moved = _step(problem, here, damping[still])
        here.put(np.flatnonzero(better), new.only(better))
        now.put(still, here)
        # less damping after two accepted steps
        less = damping[still] / np.where(rose[still], 1.0, _FACTOR)
        change = np.where(better, less, np.maximum(_FACTOR * damping[still], _RISE))
        damping[still], rose[still] = np.where(change < _NONE, 0.0, change), ~better
        size = problem.size(here)
        tight = (here.left <= TIGHT) & (size < problem.size(held.only(still)))
        held.put(still[tight], here.only(tight))
        gained = size < (1.0 - _GAIN) * mark[still]
        mark[still] = np.where(gained, size, mark[still])
        idle[still] = np.where(gained, 0, idle[still] + 1)
        done = (moved <= ENOUGH * length) & (here.left <= TIGHT) | (size <= ENOUGH * length)
        done |= (damping[still] > _MOST) | ((idle[still] >= _PATIENCE) & (damping[still] > 0.0))
        still = still[~done]
        if number in _RACE:
            still = still[_near_their_best(problem, now, _RACE[number])[still]]
    return _in_balance(problem, held, now)


def _near_their_best(problem: NearestProblem, now: Spots, most: float) -> NDArray[np.bool_]:
    """(k,) whether searches are at most so many times as far away as the best of their row."""
    size, best = problem.size(now), np.full(len(problem.wanted), np.inf)
    np.minimum.at(best, now.rows, size)
    return np.asarray(size <= most * best[now.rows])


def _in_balance(problem: NearestProblem, held: Spots, ends: Spots) -> Spots:
    """The last points in balance, or the ends of searches if these can be balanced nearer."""
    loose = np.flatnonzero((ends.left > TIGHT) & (problem.size(ends) < problem.size(held)))
    back = restored(problem, ends.only(loose))
    better = (back.left <= TIGHT) & (problem.size(back) < problem.size(held.only(loose)))
    held.put(loose[better], back.only(better))
    return held


def _step(
    problem: NearestProblem, here: Spots, damping: Array
) -> tuple[Spots, NDArray[np.bool_], Array]:
    """Where one step leads, (k,) whether distance and residual together decrease, (k,) [m] how far.

    The residuals of ``here`` are filled in.
    """
    scale = problem.scale[here.rows]
    at = Curved.about(problem, here.away, here.tensions, here.rows)
    here.left[:] = np.abs(at.left).max(axis=1) / scale
    to, price, possible = goal(problem, at, here, damping)
    new, total = _back(problem, at, to, _RESTORED)
    price = 2.0 * np.abs(price).max(axis=1)
    before = 0.5 * problem.size(here) ** 2 + price * np.abs(at.left).sum(axis=1)
    after = 0.5 * problem.size(new) ** 2 + price * total
    better = possible & (after < before) & (new.left <= _LOOSE)
    return new, better, np.linalg.norm(new.away - here.away, axis=1)


def _back(problem: NearestProblem, at: Curved, start: Spots, times: int) -> tuple[Spots, Array]:
    """Points after steps to balance with the derivatives ``at``, and residuals (k,) [N]."""
    away, pulls, rows = start.away, start.tensions, start.rows
    none = np.zeros_like(away)
    for _ in range(times):
        matrix, load = problem.at(away, rows, pulls)
        step, taut, ok = problem.project(matrix, load, at.turn, (none, pulls), rows)
        step, taut = np.where(ok[:, None], step, 0.0), np.where(ok[:, None], taut, pulls)
        size = np.maximum(np.linalg.norm(step, axis=1), 1e-300)
        part = np.minimum(1.0, _LONGEST * problem.robot.length / size)[:, None]
        new = problem.motion.stepped(away, rows, at.along.basis, part * step)
        away, pulls = np.where(ok[:, None], new, away), pulls + part * (taut - pulls)
    matrix, load = problem.at(away, rows, pulls)
    left = np.abs(np.einsum("ndm,nm->nd", matrix, pulls) - load)
    return Spots(away, rows, pulls, left.max(axis=1) / problem.scale[rows]), left.sum(axis=1)


def restored(problem: NearestProblem, start: Spots, enough: float = 0.1 * TIGHT) -> Spots:
    """Points brought to balance by Newton's method, to a residual; this may fail for some."""
    out, still = start.copy(), np.arange(len(start.rows))
    for _ in range(_BACK):
        if len(still) == 0:
            break
        here = out.only(still)
        at = Curved.about(problem, here.away, here.tensions, here.rows)
        new, _ = _back(problem, at, here, 1)
        moved = (new.tensions != here.tensions).any(axis=1) | (new.away != here.away).any(axis=1)
        out.put(still, new)
        still = still[(new.left > enough) & moved]
    out.left[still] = np.inf
    return out


def to_rounding(problem: NearestProblem, ends: Spots) -> Spots:
    """Ends of searches, balanced to rounding if there are fewer cables than degrees of freedom.

    Tensions of such a robot cannot make up for an error of the pose.
    """
    if ends.tensions.shape[1] >= ends.away.shape[1]:
        return ends
    out, back = ends.copy(), restored(problem, ends, _EXACT)
    better = np.flatnonzero(back.left <= ends.left)
    out.put(better, back.only(better))
    return out


def tightened(problem: NearestProblem, start: Spots) -> Spots:
    """The points in balance, including those that can be brought to it."""
    loose = np.flatnonzero(start.left > TIGHT)
    if len(loose):
        start = start.copy()
        start.put(loose, restored(problem, start.only(loose)))
    return start.only(start.left <= TIGHT)


def goal(
    problem: NearestProblem, at: Curved, here: Spots, damping: Array
) -> tuple[Spots, Array, NDArray[np.bool_]]:
    """The point to step to, the multipliers (k, d) [m^2/N] of the balance, whether there is one.

    ``damping`` (k,) is relative to the distance to the wanted pose, which has weight one.
    """
    part, rows = (damping / (1.0 + damping))[:, None], here.rows
    near = (part * at.along.slope - at.along.slope, here.tensions)
    rates = (at.matrix, at.load, at.turn)
    first, taut, possible = problem.project(*rates, near, rows)
    idle = (taut > problem.least[rows]) & (taut < problem.most[rows])
    price = _price(problem, at, (1.0 + damping)[:, None] * (first - near[0]), idle, here)
    step, change = _newton(problem, at, here, taut - here.tensions, price, idle, damping)
    sound = np.isfinite(np.concatenate([step, change], axis=1)).all(axis=1, keepdims=True)
    aim = np.where(sound, step, first), np.where(sound, here.tensions + change, taut)
    second, pull, fine = problem.project(*rates, aim, rows)
    keep = fine[:, None] & sound
    step = np.where(keep, second, first)
    away = problem.motion.stepped(here.away, rows, at.along.basis, step)
    to = Spots(away, rows, np.where(keep, pull, taut), here.left)
    return to, price, possible | keep[:, 0]


def _price(
    problem: NearestProblem, at: Curved, pull: Array, idle: NDArray[np.bool_], here: Spots
) -> Array:
    """(k, d) Lagrange multipliers: turn^T price = -pull, no force on tensions within limits."""
    unit = (problem.scale[here.rows] / problem.robot.length)[:, None, None]
    taut, turn = at.matrix * idle[:, None] * unit, at.turn * (problem.motion.free > 0.0)
    square = turn @ np.swapaxes(turn, 1, 2) + taut @ np.swapaxes(taut, 1, 2)
    trace = np.trace(square, axis1=1, axis2=2)[:, None, None]
    right = -np.einsum("nkd,nd->nk", turn, pull)
    return _solved(square + _OPEN * trace * np.eye(square.shape[1]), right)


def _newton(
    problem: NearestProblem, at: Curved, here: Spots, change: Array, price: Array,
    idle: NDArray[np.bool_], damping: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Step along directions (k, d) and of tensions (k, m); those at limits change as given."""
    (k, d), m = here.away.shape, change.shape[1]
    unit, weight = problem.unit(here.rows), (1.0 + damping)[:, None, None]
    own, mixed = at.bends(price)
    free = np.concatenate([np.tile(problem.motion.free > 0.0, (k, 1)), idle], axis=1)
    table, right = np.zeros((k, 2 * d + m, 2 * d + m)), np.zeros((k, 2 * d + m))
    way, pulls, both = slice(0, d), slice(d, d + m), slice(0, d + m)
    table[:, way, way] = own + at.bend + weight * np.eye(d)
    table[:, way, pulls] = mixed / unit[:, None]
    table[:, pulls, way] = np.swapaxes(table[:, way, pulls], 1, 2)
    table[:, pulls, pulls] = weight * np.eye(m)
    rates = np.concatenate([at.turn, at.matrix / unit[:, None]], axis=2)
    table[:, d + m :, both], table[:, both, d + m :] = rates, np.swapaxes(rates, 1, 2)
    right[:, way], right[:, d + m :] = -at.along.slope, -at.left
    # tensions at a limit have an equation of their own
    given = np.concatenate([np.zeros((k, d)), change * unit], axis=1)
    right[:, both] = np.where(free, right[:, both], given)
    table[:, both] *= free[..., None]
    place = np.arange(d + m)
    table[:, place, place] += ~free
    answer = _solved(table, right)
    return answer[:, way], answer[:, pulls] / unit


def _solved(tables: Array, right: Array) -> Array:
    """Solutions (k, n) of k linear systems with scaled rows; NaN if a system is singular."""
    size = np.abs(tables).max(axis=2, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    try:
        return np.asarray(np.linalg.solve(tables / size, right[..., None] / size)[..., 0])
    except np.linalg.LinAlgError:
        if len(tables) == 1:
            return np.full(right.shape, np.nan)
        each = zip(tables, right, strict=True)
        return np.concatenate([_solved(one[None], its[None]) for one, its in each])
