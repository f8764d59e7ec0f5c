"""Tensions within limits that balance a load, as near to wanted ones as possible."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import numbers
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.parallel import in_parts
from seecr.pose import LARGEST, Array, all_finite

# Part of the load that may stay unbalanced, by rounding of the tensions.
_BALANCED = 1e-9
AIMS = ("minimum", "middle")
"""Names of wanted tensions: as small as possible, or the middle of the limits."""


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

    def run(part: slice) -> None:
        project_batch(
            whole[part], load[part], rows[0][part], rows[1][part], rows[2][part],
            tensions[part], outcome[part],
        )  # fmt: skip

    in_parts(run, n)
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

    n, _, m = matrices.shape
    tensions = np.empty((n, m))
    whole, load, least, most = map(np.ascontiguousarray, (matrices, loads, low, high))

    def run(part: slice) -> None:
        nearest_batch(whole[part], load[part], least[part], most[part], tensions[part])

    in_parts(run, n)
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
