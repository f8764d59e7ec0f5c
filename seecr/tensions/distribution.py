"""Tensions within limits that balance a load, near to wanted ones; or why none do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import numbers
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import LARGEST, Array, all_finite
from seecr.statics.tables import by_row
from seecr.units import newtons

# Part of the load that may stay unbalanced, by rounding of the tensions.
_BALANCED = 1e-9
AIMS = ("minimum", "middle")
"""Names of wanted tensions: as small as possible, or the middle of the limits."""
SAFE = "safe"
"""The smallest ones that an uncertain model keeps within limits."""


def tension_limits(robot: Robot, lowest: ArrayLike, highest: ArrayLike) -> tuple[Array, Array]:
    """Limits of each driven cable's tension, (k,) [N] each; given as one, (k,) or (m,) numbers.

    They are given for the line that is reeved, and returned for the cable with all its falls.

    Raises:
        InputError: a wrong shape, limits that contradict each other, or a robot without winches.
    """
    k = robot.n_driven
    if k == 0:
        raise InputError(
            f"{robot.name}: no winch drives any of its lines, so there are no tensions to choose"
        )
    bounds = []
    for name, value in (("lowest", lowest), ("highest", highest)):
        array = numbers(value, name)
        if array.shape not in ((), (k,), (robot.n_cables,)):
            raise InputError(f"{name} must be one number or ({k},) [N], got {array.shape}")
        bounds.append(np.array(np.broadcast_to(of_driven(robot, array), (k,))))
    low, high = bounds
    high[high > LARGEST] = np.inf
    if not (all_finite(low) and np.all(low >= 0.0) and np.all(high >= low)):
        got = [f"{bound.min():g}" for bound in bounds]
        raise InputError(
            "tension bounds must be 0 <= lowest <= highest [N], lowest "
            f"at most {LARGEST:g}, got "
            f"lowest {got[0]} and highest {got[1]}"
        )
    falls = robot.falls[robot.driven]
    return low * falls, high * falls


def of_driven(robot: Robot, values: Array) -> Array:
    """Of numbers (..., m) of all lines those of the driven ones (..., k); others as they are."""
    of_all = values.ndim > 0 and values.shape[-1] == robot.n_cables
    return values[..., robot.driven] if of_all and not robot.all_driven else values


def wanted_tensions(
    aim: str | ArrayLike, low: Array, high: Array, also: tuple[str, ...] = ()
) -> Array:
    """The tensions (m,) or (n, m) [N] of an aim.

    Other names of aims, ``also``, begin with the smallest ones.

    Raises:
        InputError: an unknown name, a wrong shape, the middle of limits that are not finite, or
            tensions outside the limits.
    """
    if isinstance(aim, str):
        if aim not in (*also, *AIMS):
            names = ", ".join((*also, *AIMS))
            raise InputError(f"aim must be one of {names} or tensions [N], got {aim!r}")
        if aim != "middle":
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
    """Tensions (n, m) [N] nearest to wanted ones, by least squares, that balance A tau = load.

    Where no limit is reached these are f + A^+ (load - A f) with f the wanted ones. With the middle
    of the limits that is the closed form of Pott, Bruckmann and Mikelsons (Closed-form force
    distribution for parallel wire robots, Computational Kinematics, 2009).

    Args:
        matrices: (n, d, m). loads: (n, d). aim, low, high: (m,) or (n, m) [N].

    Returns:
        the tensions, and (n,) whether they balance; otherwise they come near to balance.
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
    """Tensions (n, m) within limits (n, m) [N] that come nearest to balance: of few cables, m < d.

    They are exact but for rounding where the pulls of cables are far from parallel.
    """
    from seecr.compiled.tensions import nearest_batch  # slow to import

    tensions = np.empty((len(matrices), matrices.shape[2]))
    by_row(nearest_batch, *map(np.ascontiguousarray, (matrices, loads, low, high)), tensions)
    return tensions


def balanced(matrix: Array, load: Array, low: Array, high: Array) -> tuple[Array, float]:
    """Tensions (m,) within limits that come nearest to balance, and |A tau - load| / |load|.

    By non-negative least squares of matrix (d, m) and load (d,): an upper bound is one more
    equation, tau_i + spare_i = high_i with spare_i >= 0.
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
    from seecr.compiled.tensions import margins_of  # takes a while to import

    out = np.full(len(matrices), np.nan)
    if matrices.shape[2] >= matrices.shape[1]:
        given = map(np.ascontiguousarray, (matrices, loads[:, None], low, high))
        by_row(margins_of, *given, scale, out)
    return out + _BALANCED * scale


def innermost(
    matrices: Array, loads: Array, low: Array, high: Array, scale: Array
) -> tuple[Array, Array]:
    """The largest margins (n,) of tensions from limits (n, m), and these tensions (n, m) [N].

    Margins are negative if limits are exceeded, infinite if cables can be tightened without limit,
    minus infinity if nothing balances the load; then tensions are NaN.
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


# Why a pose cannot be held: which tensions would have to be beyond their limits.
#
# The limits in A tau = load are exceeded by as little as possible, in newtons summed over the
# cables: a linear program. If larger pulls alone would do, no cable is said to push. With up to two
# more cables than degrees of freedom all its corners are tried; else HiGHS solves it.

# A limit exceeded by less than this part of the load, or of the largest lower limit, is rounding; a
# load below this part of that limit is none.
_ROUNDING = 1e-7
# Most cables beyond the degrees of freedom for which all corners are tried.
_SPARE = 2
# Most cables named in a sentence.
_MOST = 3
# How SciPy's linear program ends.
_FOUND, _INFEASIBLE = 0, 2
_SLACK = "without a load all cables could be slack, but not with the lower limit"


def why_not_held(
    matrix: Array, load: Array, low: Array, high: Array, names: Sequence[str],
    weighs: Array | float = 0.0,
) -> str:  # fmt: skip
    """A sentence about one pose with balance (d, m), load (d,) and limits (m,) [N].

    ``weighs`` (m,) [N] is the least tension due to each cable's weight, where that is the limit.
    """
    if np.any(low > high):
        k = int(np.argmax(low - high))
        least, most = newtons(low[k]), newtons(high[k])
        return f"{_who(names[k])} weighs {least}, more than the {most} it may pull"
    scale = _scale(load, low)
    outcome, beyond = _without_pushing(matrix, load, low, high, scale)
    if outcome == _INFEASIBLE:
        return "no pulls of the cables, however large, balance the load there"
    if outcome != _FOUND:
        return "no tensions within the limits balance the load there"
    rounding = _ROUNDING * scale
    beyond = np.where(np.abs(low + beyond) <= rounding, -low, beyond)
    order = [k for k in np.argsort(-np.abs(beyond), kind="stable") if abs(beyond[k]) > rounding]
    if not order:
        return (
            "tensions at their limits would balance the load there, but no lengths were found that "
            "keep them"
        )
    of_weight = (low > 0.0) & (low <= weighs)
    said = [_of_cable(names[k], beyond[k], low[k], high[k], of_weight[k]) for k in order[:_MOST]]
    more = len(order) - _MOST
    if more > 0:
        said[-1] += (
            f", and {counted(more, 'more cable')} {'is' if more == 1 else 'are'} beyond the limits"
        )
    unloaded = float(np.abs(load).max()) <= rounding
    return f"{_SLACK}: {'; '.join(said)}" if unloaded else "; ".join(said)


def without_span(gone: NDArray[np.bool_], pulleys: NDArray[np.bool_], names: Sequence[str]) -> str:
    """A sentence about a pose at which some cables (m,) have no length; some are over pulleys."""
    k, more = int(np.argmax(gone)), int(gone.sum()) - 1
    where = "within its pulley" if pulleys[k] else "at its exit point"
    others = f", nor would {counted(more, 'more cable')}" if more else ""
    return f"{_who(names[k])} would have no length, its anchor point {where}{others}"


def _scale(load: Array, low: Array) -> float:
    """The load or the largest lower limit [N]: without a load, the limits alone have a size."""
    return max(float(np.abs(load).max()), float(low.max())) or 1.0


def _who(name: str) -> str:
    return name if "cable" in name.lower() else f"cable {name}"


def _of_cable(name: str, beyond: float, low: float, high: float, of_weight: bool) -> str:
    who = _who(name)
    if beyond > 0.0:
        return f"{who} would have to pull {newtons(high + beyond)}, more than {newtons(high)}"
    pull = low + beyond
    if pull >= 0.0:
        least = f"the {newtons(low)} that it weighs" if of_weight else f"{newtons(low)}"
        return f"{who} would have to pull {newtons(pull)}, less than {least}"
    if low > 0.0 and not of_weight:
        push, least = newtons(-pull), newtons(low)
        return f"{who} would have to push with {push} to keep the others at {least} or more"
    return f"{who} would have to push with {newtons(-pull)}"


def _without_pushing(
    matrix: Array, load: Array, low: Array, high: Array, scale: float
) -> tuple[int, Array]:
    """See :func:`_least_beyond`; where only upper limits are in the way, they alone are exceeded.

    If they do not suffice, lower limits are, but down to zero only, as far as that is possible.
    """
    outcome, beyond = _least_beyond(matrix, load, low, high, scale)
    pushes = outcome == _FOUND and np.any(low + beyond < -_ROUNDING * scale)
    if pushes and np.isfinite(high).any():
        for floor in (low, np.minimum(low, 0.0)):
            other, less = _by_program(matrix, load, low, high, scale, floor)
            if other == _FOUND:
                return other, less
    return outcome, beyond


def _least_beyond(
    matrix: Array, load: Array, low: Array, high: Array, scale: float
) -> tuple[int, Array]:
    """How the search ended; (m,) [N] tensions above the upper or below the lower limits, or NaN."""
    d, m = matrix.shape
    if 0 <= m - d <= _SPARE:
        from seecr.compiled.tensions import least_beyond  # takes a while to import

        pulls, rows = np.empty(m), [np.array(one, order="C") for one in (matrix, load, low, high)]
        if least_beyond(*rows, pulls):
            return _FOUND, np.minimum(pulls - low, 0.0) + np.maximum(pulls - high, 0.0)
    return _by_program(matrix, load, low, high, scale)


def _by_program(
    matrix: Array, load: Array, low: Array, high: Array, scale: float, floor: Array | None = None
) -> tuple[int, Array]:
    """The same by HiGHS, for any number of cables; no tension is below ``floor`` (m,) [N]."""
    from scipy.optimize import linprog

    m = matrix.shape[1]
    eye, zero = np.eye(m), np.zeros((m, m))
    bounded = np.isfinite(high)
    # unknowns: tensions, and how far they are below and above the limits
    above = np.concatenate([eye, zero, -eye], axis=1)[bounded]
    below = np.concatenate([-eye, -eye, zero], axis=1)
    ends = [(None, None)] * m if floor is None else [(one, None) for one in floor / scale]
    found = linprog(
        np.concatenate([np.zeros(m), np.ones(2 * m)]), A_ub=np.concatenate([below, above]),
        b_ub=np.concatenate([-low, high[bounded]]) / scale,
        A_eq=np.concatenate([matrix, np.zeros((len(matrix), 2 * m))], axis=1), b_eq=load / scale,
        bounds=[*ends, *[(0.0, None)] * (2 * m)], method="highs",
    )  # fmt: skip
    if found.status != _FOUND:
        return int(found.status), np.full(m, np.nan)
    return _FOUND, np.asarray(scale * (found.x[2 * m :] - found.x[m : 2 * m]))
