"""Why a pose cannot be held: which tensions would have to be beyond their limits.

The limits in the balance A tau = load are exceeded by as little as possible, in newtons summed over
the cables: a linear program, whose solution exceeds few limits. If larger pulls alone would do, no
cable is said to push. With up to two more cables than
degrees of freedom all its corners are tried; else HiGHS solves it, by SciPy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.pose import Array

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
    matrix: Array,
    load: Array,
    low: Array,
    high: Array,
    names: Sequence[str],
    weighs: Array | float = 0.0,
) -> str:
    """A sentence about one pose.

    Args:
        matrix: (d, m) balance, load: (d,) [N], torques over a length.
        low, high: (m,) limits of the tensions [N].
        names: of the m cables.
        weighs: (m,) [N] least tension due to each cable's weight, where that is the lower limit.
    """
    if np.any(low > high):
        k = int(np.argmax(low - high))
        least, most = _newtons(low[k]), _newtons(high[k])
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
    """A sentence about a pose at which cables ``gone`` (m,) have no length.

    Args:
        gone: (m,) cables whose anchor point is at the exit point or within its pulley.
        pulleys: (m,) cables that run over one.
        names: of the m cables.
    """
    k, more = int(np.argmax(gone)), int(gone.sum()) - 1
    where = "within its pulley" if pulleys[k] else "at its exit point"
    others = f", nor would {counted(more, 'more cable')}" if more else ""
    return f"{_who(names[k])} would have no length, its anchor point {where}{others}"


def _scale(load: Array, low: Array) -> float:
    """The load or the largest lower limit [N]: without a load, the limits alone have a size."""
    return max(float(np.abs(load).max()), float(low.max())) or 1.0


def _newtons(force: float) -> str:
    """A force as it is typed: 6000 N, not 6e+03 N."""
    return f"{force:.3g} N" if abs(force) < 1e3 else f"{force:.0f} N"


def _who(name: str) -> str:
    return name if "cable" in name.lower() else f"cable {name}"


def _of_cable(name: str, beyond: float, low: float, high: float, of_weight: bool) -> str:
    who = _who(name)
    if beyond > 0.0:
        return f"{who} would have to pull {_newtons(high + beyond)}, more than {_newtons(high)}"
    pull = low + beyond
    if pull >= 0.0:
        least = f"the {_newtons(low)} that it weighs" if of_weight else f"{_newtons(low)}"
        return f"{who} would have to pull {_newtons(pull)}, less than {least}"
    if low > 0.0 and not of_weight:
        push, least = _newtons(-pull), _newtons(low)
        return f"{who} would have to push with {push} to keep the others at {least} or more"
    return f"{who} would have to push with {_newtons(-pull)}"


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
        np.concatenate([np.zeros(m), np.ones(2 * m)]),
        A_ub=np.concatenate([below, above]),
        b_ub=np.concatenate([-low, high[bounded]]) / scale,
        A_eq=np.concatenate([matrix, np.zeros((len(matrix), 2 * m))], axis=1),
        b_eq=load / scale,
        bounds=[*ends, *[(0.0, None)] * (2 * m)],
        method="highs",
    )
    if found.status != _FOUND:
        return int(found.status), np.full(m, np.nan)
    return _FOUND, np.asarray(scale * (found.x[2 * m :] - found.x[m : 2 * m]))
