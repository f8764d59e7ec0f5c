"""One step of a search for the nearest pose that can be held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.problem import Curved, Reaching, Spots
from seecr.pose import Array

# Regularisation of the multipliers where they are not unique, relative to the squared matrix.
_OPEN = 1e-13


def goal(
    problem: Reaching, at: Curved, here: Spots, damping: Array
) -> tuple[Spots, Array, NDArray[np.bool_]]:
    """The point to step to, the multipliers (k, d) [m^2/N] of the balance, whether there is one.

    Args:
        at: the balance about ``here``.
        damping: (k,) of steps, relative to the distance to the wanted pose, which has weight one.
    """
    part, rows = (damping / (1.0 + damping))[:, None], here.rows
    near = (part * at.along.slope - at.along.slope, here.tensions)
    rates = (at.matrix, at.load, at.turn)
    first, taut, possible = problem.project(*rates, near, rows)
    idle = (taut > problem.least[rows]) & (taut < problem.most[rows])
    price = _price(problem, at, (1.0 + damping)[:, None] * (first - near[0]), idle, here)
    step, change = _newton(problem, at, here, taut - here.tensions, price, idle, damping)
    aim = (step, here.tensions + change)
    sound = np.asarray(np.isfinite(np.concatenate(aim, axis=1)).all(axis=1))
    aim = (np.where(sound[:, None], aim[0], first), np.where(sound[:, None], aim[1], taut))
    second, pull, fine = problem.project(*rates, aim, rows)
    keep = (fine & sound)[:, None]
    away = problem.motion.stepped(here.away, rows, at.along.basis, np.where(keep, second, first))
    to = Spots(away, rows, np.where(keep, pull, taut), here.left)
    return to, price, possible | keep[:, 0]


def _price(
    problem: Reaching, at: Curved, pull: Array, idle: NDArray[np.bool_], here: Spots
) -> Array:
    """(k, d) Lagrange multipliers: turn^T price = -pull, no force on tensions within limits."""
    unit = (problem.scale[here.rows] / problem.robot.length)[:, None, None]
    taut, turn = at.matrix * idle[:, None] * unit, at.turn * (problem.motion.free > 0.0)
    square = turn @ np.swapaxes(turn, 1, 2) + taut @ np.swapaxes(taut, 1, 2)
    trace = np.trace(square, axis1=1, axis2=2)[:, None, None]
    right = -np.einsum("nkd,nd->nk", turn, pull)
    return _solved(square + _OPEN * trace * np.eye(square.shape[1]), right)


def _newton(
    problem: Reaching,
    at: Curved,
    here: Spots,
    change: Array,
    price: Array,
    idle: NDArray[np.bool_],
    damping: Array,
) -> tuple[Array, Array]:
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
