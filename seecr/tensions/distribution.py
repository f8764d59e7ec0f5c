"""Tensions within limits that balance a load, as near to wanted ones as possible."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import numbers
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.parallel import in_parts
from seecr.pose import LARGEST, Array, all_finite

# Part of the load that may stay unbalanced, by rounding of the tensions.
_BALANCED = 1e-9
# Part of that by which a search for any tensions may itself be off.
_PART = 1e-2
AIMS = ("minimum", "middle")
"""Names of wanted tensions: as small as possible, or the middle of the limits."""


def by_row(compiled: Callable[..., None], *arrays: NDArray[Any]) -> None:
    """Call a compiled function with arrays (n, ...), in as many parts as there are threads."""
    in_parts(lambda part: compiled(*(each[part] for each in arrays)), len(arrays[0]))


def tension_limits(robot: Robot, lowest: ArrayLike, highest: ArrayLike) -> tuple[Array, Array]:
    """Limits of each cable's tension, (m,) [N] each.

    Raises:
        InputError: a wrong shape, or limits that contradict each other.
    """
    m = robot.n_cables
    bounds = []
    for name, value in (("lowest", lowest), ("highest", highest)):
        array = numbers(value, name)
        if array.shape not in ((), (m,)):
            raise InputError(f"{name} must be one number or ({m},) [N], got {array.shape}")
        bounds.append(np.array(np.broadcast_to(array, (m,))))
    low, high = bounds
    high[high > LARGEST] = np.inf
    if not (all_finite(low) and np.all(low >= 0.0) and np.all(high >= low)):
        got = [f"{bound.min():g}" for bound in bounds]
        raise InputError(
            "tension bounds must be 0 <= lowest <= highest [N], lowest "
            f"at most {LARGEST:g}, got "
            f"lowest {got[0]} and highest {got[1]}"
        )
    return low, high


def wanted_tensions(aim: str | ArrayLike, low: Array, high: Array) -> Array:
    """The tensions (m,) or (n, m) [N] of an aim.

    Raises:
        InputError: an unknown name, a wrong shape, the middle of limits that are not finite, or
            tensions outside the limits.
    """
    if isinstance(aim, str):
        if aim not in AIMS:
            raise InputError(f"aim must be one of {', '.join(AIMS)} or tensions [N], got {aim!r}")
        if aim == "minimum":
            return np.zeros_like(low)
        if not np.all(np.isfinite(high)):
            raise InputError("aim 'middle' needs a highest tension; expected a finite one [N]")
        return 0.5 * (low + high)
    wanted = np.asarray(aim, float)
    if wanted.ndim not in (0, 1, 2) or wanted.shape[-1:] not in ((), low.shape):
        raise InputError(f"aim must be (m,) or (n, m) with m = {len(low)}, got {wanted.shape}")
    if not all_finite(wanted):
        raise InputError("aim holds tensions that are not finite; expected finite ones [N]")
    wanted = np.array(np.broadcast_to(wanted, np.broadcast_shapes(wanted.shape, low.shape)))
    outside = np.argwhere((wanted < low) | (wanted > high))
    if len(outside):
        at, k = tuple(outside[0]), outside[0][-1]
        raise InputError(
            f"aim must lie between lowest and highest tension, for cable number {k + 1} "
            f"{low[k]:g} to {high[k]:g} N, got {wanted[at]:g} N"
        )
    return wanted


def distribute(
    matrices: Array, loads: Array, aim: Array, low: Array, high: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Tensions nearest to wanted ones, by least squares, that balance loads.

    Where no limit is reached these are f + A^+ (load - A f) with f the wanted ones. With the middle
    of the limits that is the closed form of Pott, Bruckmann and Mikelsons (Closed-form force
    distribution for parallel wire robots, Computational Kinematics, 2009).

    Args:
        matrices: (n, d, m). loads: (n, d), to be balanced: A tau = load.
        aim, low, high: (m,) or (n, m) [N].

    Returns:
        (n, m) [N], and (n,) whether they balance; otherwise they come near to balance.
    """
    from seecr.compiled.tensions import FOUND, UNDECIDED, project_batch  # slow to import

    n, _, m = matrices.shape
    rows = [np.array(np.broadcast_to(one, (n, m)), order="C") for one in (aim, low, high)]
    whole, load = np.array(matrices, order="C"), np.array(loads, order="C")
    tensions, outcome = np.zeros((n, m)), np.zeros(n, dtype=np.int64)
    by_row(project_batch, whole, load, *rows, tensions, outcome)
    undecided = (outcome == UNDECIDED) & np.isfinite(rows[1]).all(axis=1)
    for r in np.flatnonzero(undecided):
        tensions[r], left = balanced(whole[r], load[r], rows[1][r], rows[2][r])
        outcome[r] = FOUND if left < _BALANCED else UNDECIDED
    return tensions, outcome == FOUND


def nearly_balanced(matrices: Array, loads: Array, low: Array, high: Array) -> Array:
    """Tensions (n, m) within limits (n, m) [N] that come nearest to balance: of few cables.

    They are exact but for rounding where the pulls of cables are far from parallel.

    Args:
        matrices: (n, d, m) with m < d. loads: (n, d).
    """
    from seecr.compiled.tensions import nearest_batch  # slow to import

    tensions = np.empty((len(matrices), matrices.shape[2]))
    by_row(nearest_batch, *map(np.ascontiguousarray, (matrices, loads, low, high)), tensions)
    return tensions


def balanced(matrix: Array, load: Array, low: Array, high: Array) -> tuple[Array, float]:
    """Tensions (m,) within limits that come nearest to balance, and |A tau - load| / |load|.

    They are found by non-negative least squares. An upper bound is one more equation,
    tau_i + spare_i = high_i with spare_i >= 0.

    Args:
        matrix: (d, m). load: (d,). low, high: (m,) [N].
    """
    from scipy.optimize import nnls  # takes a while to import

    scale = float(np.linalg.norm(load)) or 1.0
    bounded = np.flatnonzero(np.isfinite(high))
    d, m, k = len(load), len(low), len(bounded)
    table = np.zeros((d + k, m + k))
    table[:d, :m] = matrix
    table[d + np.arange(k), bounded] = 1.0
    table[d + np.arange(k), m + np.arange(k)] = 1.0
    aim = np.concatenate([load - matrix @ low, (high - low)[bounded]]) / scale
    found, left = nnls(table, aim, maxiter=100 * (m + k))
    return low + scale * found[:m], float(left)


def can_balance(
    matrices: Array, loads: Array, low: Array, high: Array, scale: Array
) -> NDArray[np.bool_]:
    """(n,) whether tensions within limits balance A tau = load; see :func:`innermost`."""
    found = _decided(matrices, loads, low, high, scale)
    out, odd = found > 0.0, np.flatnonzero(np.isnan(found))
    if len(odd):
        out[odd] = distribute(matrices[odd], loads[odd], low[odd], low[odd], high[odd])[1]
    return np.asarray(out)


def _decided(matrices: Array, loads: Array, low: Array, high: Array, scale: Array) -> Array:
    """(n,) positive where tensions balance, to rounding; NaN where W is singular or too narrow."""
    from seecr.compiled.tensions import MOST, feasible_of  # takes a while to import

    room, spare = _BALANCED * scale, matrices.shape[2] - matrices.shape[1]
    if not 0 <= spare <= MOST:
        return _innermost(matrices, loads, low, high, scale)[0] + room
    given, out = map(np.ascontiguousarray, (matrices, loads, low, high)), np.empty(len(matrices))
    by_row(feasible_of, *given, room, _PART * room, out)
    return out


def innermost(
    matrices: Array, loads: Array, low: Array, high: Array, scale: Array
) -> tuple[Array, Array]:
    """The largest margins (n,) of tensions from their limits, and these tensions (n, m) [N].

    Margins are negative if limits are exceeded, infinite if cables can be tightened without limit,
    minus infinity if nothing balances the load; then tensions are NaN.

    Args:
        matrices: (n, d, m), loads: (n, d) [N]. low, high: (n, m) [N]. scale: (n,) [N].
    """
    margins, tensions = _innermost(matrices, loads, low, high, scale)
    for r in np.flatnonzero(np.isnan(margins)):
        margins[r], tensions[r] = _by_search(matrices[r], loads[r], low[r], high[r])
    return margins, tensions


def _innermost(
    matrices: Array, loads: Array, low: Array, high: Array, scale: Array
) -> tuple[Array, Array]:
    """The same; NaN where W is singular or there are too few cables."""
    from seecr.compiled.tensions import innermost_of  # takes a while to import

    margins, tensions = np.full(len(matrices), np.nan), np.full(low.shape, np.nan)
    if matrices.shape[2] >= matrices.shape[1]:
        given = map(np.ascontiguousarray, (matrices, loads, low, high))
        by_row(innermost_of, *given, scale, margins, tensions)
    return margins, tensions


def _by_search(matrix: Array, load: Array, low: Array, high: Array) -> tuple[float, Array]:
    """The same for one pose with a singular W: margin zero if a search finds tensions."""
    if np.all(high >= low) and np.isfinite(matrix).all() and np.isfinite(load).all():
        tensions, left = balanced(matrix, load, low, high)
        if left < _BALANCED:
            return 0.0, tensions
    return -np.inf, np.full(len(low), np.nan)
