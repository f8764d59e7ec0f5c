"""Tensions with the largest margin from their limits that hold platforms, for any cables.

If the balance is linear in the tensions, one linear program finds them. If not, each round
linearises it at the tensions of the last round and solves again (sequential linear programming).
Below about its own weight a cable's tension does not determine its length any more: there its
tightness, which falls whenever the length grows, takes its place. Such cables are called loose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import TENSION
from seecr.pose import Array
from seecr.statics.tables import Tables, take
from seecr.tensions.balance import (
    balance_of,
    bends,
    first_tensions,
    here,
    least_of_heavy,
    linearised,
    loose_rest,
    next_rest,
    rest_for,
    tightness,
    weights,
    with_rest,
)
from seecr.tensions.distribution import distribute, innermost

# Most rounds; the round from which steps are halved and tensions limited to so many loads, as they
# are at once where they seem unlimited; and the change that ends the rounds [load].
_ROUNDS, _LATE, _TIGHT, _ENOUGH = 20, 7, 1e3, 1e-10
# Rounds have come to an end if they would change tensions by less than this [load].
_SETTLED = 1e-6
# The balance is linearised where each cable pulls at least this part of its share of the load.
_PULLS = 1e-3
# Least tightness [weight]: the cable is then half as long again as its span.
_LOOSEST = 12.0**-0.5
# Letting cables hang loosely gains less than this many of their weights.
_GAINED = 2.0
# Newton steps to balance, residual at their end [load], and allowed error of tensions [load].
_NEWTON, _EXACT, _OFF = 30, 1e-12, 1e-9
# Most rounds in which margins are counted from lower limits.
_EASED = 20
# Attempts, each with fewer loose cables.
_AGAIN = 4
# Loose cables are also sought from these multiples of a cable's weight, or share of the load.
_STARTS = (1.0, 3.0)
HOPELESS = 0.1
"""For a mere yes or no, rows this part of the load outside their limits are given up."""


@dataclass(eq=False)
class MaxMargin:
    """Tensions with the largest margin, for n poses.

    Attributes:
        margins: (n,) [N] how far they are inside their limits; negative if limits are exceeded;
            infinite if cables can be tightened without limit; minus infinity if nothing balances
            the load. Zero if a pose can only be held with loose cables.
        tensions: (n, m) [N], NaN if nothing balances the load.
        rest: (n, m) [m] lengths at which the balance was linearised: those of the tensions, if
            these are within the limits.
        matrices, loads: (n, d, m), (n, d) [N] balance there, torques over the robot's length.
        low, high: (n, m) [N] the limits; a cable that is not loose pulls at least its weight.
        loose: (n,) bool, the pose is held by ``rest``, with cables that pull less than they weigh.
    """

    margins: Array
    tensions: Array
    rest: Array
    matrices: Array
    loads: Array
    low: Array
    high: Array
    loose: NDArray[np.bool_]


def limits_of(tables: Tables, low: Array, high: Array) -> tuple[Array, Array]:
    """Limits (n, m) [N] raised to what a cable weighs: contradictory if it may not pull that."""
    shape = tables.cables.shape[:2]
    least = np.maximum(np.broadcast_to(low, shape), least_of_heavy(tables))
    return least, np.array(np.broadcast_to(high, shape), float)


def max_margin_tensions(
    tables: Tables, low: Array, high: Array, hopeless: float = np.inf
) -> MaxMargin:
    """The tensions with the largest margin from limits (m,) or (n, m) [N], also of heavy cables.

    Tables are of n poses, with at least as many cables as degrees of freedom. From the second round
    on, rows are given up whose margin is below minus ``hopeless`` loads, if loose cables could not
    help.
    """
    out = _tightened(tables, *limits_of(tables, low, high), hopeless)
    weighs = least_of_heavy(tables)
    could = (weighs > low) & (weighs <= high)
    lost = (out.margins < 0.0) & (out.margins > -_GAINED * weighs.max(axis=1)) & could.any(axis=1)
    for share in (None, *_STARTS):
        rows = np.flatnonzero(lost & ~out.loose)
        if len(rows) == 0:
            break
        some = take(tables, rows)
        first = out.rest[rows]
        if share is not None:
            first = rest_for(some, share * first_tensions(some, weighs[rows]))
        _loosen(out, rows, some, could[rows], low, high, first)
    return out


def margins_inside(tables: Tables, low: Array, high: Array) -> Array:
    """Margins (n,) [N] of tensions from limits (m,) asked for, which what cables weigh may exceed.

    The largest t with low + t <= tensions <= high - t that leaves no cable below its own least
    tension. :func:`max_margin_tensions` counts t from that where it is the larger one: a lower
    bound, exact at zero, that rounds increase by counting from lower limits.
    """
    found, weighs = max_margin_tensions(tables, low, high), least_of_heavy(tables)
    margins = found.margins
    counts = (margins > 0.0) & np.isfinite(margins)
    rows = np.flatnonzero(counts & (weighs > low).any(axis=1))
    for _ in range(_EASED):
        if len(rows) == 0:
            break
        least = np.maximum(low, weighs[rows] - margins[rows, None])
        again = _tightened(take(tables, rows), least, found.high[rows], np.inf).margins
        gain = np.where(np.isfinite(again), again - margins[rows], 0.0)
        margins[rows] += np.maximum(gain, 0.0)
        rows = rows[(gain > _ENOUGH * tables.scale[rows]) & (least > low).any(axis=1)]
    return margins


def holds_tightly(tables: Tables, low: Array, high: Array) -> NDArray[np.bool_]:
    """(n,) whether tensions within limits (m,) hold poses, without loose cables."""
    found = _tightened(tables, *limits_of(tables, low, high), HOPELESS)
    return np.asarray(found.margins >= -_OFF * tables.scale)


def balances(
    tables: Tables, low: Array, high: Array
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """For each pose the balance (d, m), (d,) that tensions come nearest to, and its limits (m,)."""
    if tables.cables.shape[1] >= tables.n_dof and bends(tables):
        found = max_margin_tensions(tables, low, high)
        yield from zip(found.matrices, found.loads, found.low, found.high, strict=True)
    else:
        rows = balance_of(tables, low), limits_of(tables, low, high)
        yield from zip(*rows[0], *rows[1], strict=True)


def _tightened(tables: Tables, least: Array, most: Array, hopeless: float) -> MaxMargin:
    """Sequential linear programming, with limits (n, m), and without loose cables.

    Where a linear program is unbounded, tensions are limited to some loads; where rounds take turns
    between two vertices, tensions in balance near the last ones count: a lower bound.
    """
    n, m = tables.cables.shape[:2]
    pulls = np.maximum(least, _PULLS * tables.scale[:, None] / m)
    first = rest_for(tables, first_tensions(tables, least))
    out = MaxMargin(
        np.full(n, np.nan), np.full((n, m), np.nan), first,
        np.zeros((n, tables.n_dof, m)), np.zeros((n, tables.n_dof)), least, most,
        np.zeros(n, dtype=bool),
    )  # fmt: skip
    rows, bent, start = np.arange(n), bends(tables), here(tables)
    ended, endless, end = np.full(n, not bent), np.zeros(n, dtype=bool), most.copy()
    tight = np.minimum(most, least + _TIGHT * tables.scale[:, None])
    beyond = hopeless * tables.scale + _GAINED * least_of_heavy(tables).max(axis=1)
    for k in range(_ROUNDS if bent else 1):
        now = with_rest(take(tables, rows), out.rest[rows])
        at, rates = linearised(now, start.only(rows))
        start.put(rows, at)
        own, matrix, load = at.states[..., TENSION], rates.by_tension, rates.load(at)
        out.matrices[rows], out.loads[rows] = matrix, load
        if k == _LATE:
            end[rows] = tight[rows]
        margins, found = innermost(matrix, load, least[rows], end[rows], now.scale)
        out.margins[rows], out.tensions[rows] = margins, found
        if not bent:
            break
        if len(free := np.flatnonzero(np.isposinf(margins))):
            some = rows[free]
            endless[some], end[some] = True, tight[some]
            ends = least[some], tight[some], now.scale[free]
            margins[free], found[free] = innermost(matrix[free], load[free], *ends)
            out.margins[some], out.tensions[some] = margins[free], found[free]
        wanted = np.where(np.isnan(found), own, np.fmax(found, pulls[rows]))
        wanted = wanted if k < _LATE else 0.5 * (wanted + own)
        rest = next_rest(now, out.rest[rows], rates.by_length, own, wanted)
        change = np.abs(wanted - own).max(axis=1)
        ended[rows] = (change <= _SETTLED * now.scale) & ~np.isnan(found).any(axis=1)
        go = (change > _ENOUGH * now.scale) & np.isfinite(rest).all(axis=1)
        if k > 0:
            go &= ~(margins < -beyond[rows])
        rows = rows[go]
        if len(rows) == 0:
            break
        out.rest[rows] = rest[go]
    out.margins[endless & ended & (out.margins >= 0.0)] = np.inf
    _settle(out, np.flatnonzero((out.margins >= 0.0) & ~ended), tables)
    return out


def _settle(out: MaxMargin, rows: NDArray[np.intp], tables: Tables) -> None:
    """Give rows balanced tensions near those of the last round; none if these leave the limits."""
    if len(rows) == 0:
        return
    some, least, most = take(tables, rows), out.low[rows], out.high[rows]
    rest, tension, held = _newton(some, np.zeros(least.shape, bool), least, most, out.rest[rows])
    room = np.minimum(tension - least, most - tension).min(axis=1)
    held &= room >= -_OFF * some.scale
    out.margins[rows] = np.where(held, np.maximum(room, 0.0), -np.inf)
    out.rest[rows[held]], out.tensions[rows[held]] = rest[held], tension[held]


def _loosen(
    out: MaxMargin, rows: NDArray[np.intp], tables: Tables, loose: NDArray[np.bool_], low: Array,
    high: Array, first: Array,
) -> None:  # fmt: skip
    """Hold rows (k,) of ``out`` with cables (k, m) that may be loose, if possible.

    Limits are those asked for, of all rows of ``out``. Searches start from rest lengths ``first``
    (k, m) [m].
    """
    low, high = (np.array(np.broadcast_to(one, out.low.shape)[rows]) for one in (low, high))
    least = np.where(loose, _LOOSEST * weights(tables), out.low[rows])
    room, left = _OFF * tables.scale[:, None], np.arange(len(rows))
    for _ in range(_AGAIN):
        part = take(tables, left)
        rest, tension, held = _newton(part, loose[left], least[left], high[left], first[left])
        under = tension < low[left] - room[left]
        fine = held & ~(under | (tension > high[left] + room[left])).any(axis=1)
        to = rows[left[fine]]
        out.margins[to], out.loose[to] = 0.0, True
        out.rest[to], out.tensions[to] = rest[fine], tension[fine]
        # try again: cables that pulled too little get the tightness of their lower limit
        under &= loose[left] & ~fine[:, None]
        again = under.any(axis=1)
        left, under = left[again], under[again]
        if len(left) == 0:
            return
        loose = loose.copy()
        loose[left] &= ~under
        least[left] = np.where(under, low[left], least[left])


def _newton(
    tables: Tables, loose: NDArray[np.bool_], least: Array, high: Array, first: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Balance by Newton's method with the least change of all tensions, of loose cables tightness.

    ``least`` (n, m) [N] limits tension or tightness, ``high`` tension. Returns rest lengths and
    tensions (n, m), and (n,) whether they are in balance.
    """
    size, rest = np.where(loose, tightness(tables, first), np.inf), first.copy()
    left, start = np.arange(len(rest)), here(tables)
    for _ in range(_NEWTON):
        now, slack, before = with_rest(take(tables, left), rest[left]), loose[left], rest[left]
        at, rates = linearised(now, start.only(left))
        start.put(left, at)
        tension = at.states[..., TENSION]
        value = np.where(slack, size[left], tension)
        slope = loose_rest(now, np.where(slack, value, 1.0))[1]
        matrix = np.where(slack[:, None], rates.pull * slope[:, None], rates.by_tension)
        load = np.einsum("ndm,nm->nd", matrix, value) - at.gradient
        upper = high[left] + np.where(slack, value - tension, 0.0)
        ends = least[left], np.maximum(upper, least[left])
        value, possible = distribute(matrix, load, value, *ends)
        tight = next_rest(now, before, rates.by_length, tension, np.where(slack, tension, value))
        longer = np.where(slack, loose_rest(now, np.where(slack, value, 1.0))[0], tight)
        go = possible & np.isfinite(longer).all(axis=1) & (at.residual > _EXACT)
        left = left[go]
        if len(left) == 0:
            break
        rest[left], size[left] = longer[go], np.where(slack, value, np.inf)[go]
    held = (start.residual <= _EXACT) & np.all(size >= least, axis=1)
    return rest, start.states[..., TENSION], held


def counted_balance(
    tables: Tables, low: Array, high: Array, about: Array | None = None
) -> tuple[Array, Array]:
    """Like :func:`balance_of`, for tensions scaled so that limits (m,) are the same at all poses.

    The scaled tension goes from ``low`` to ``high`` as that of a cable with weight goes from its
    least value, which changes with the pose, to ``high``; ``about`` (n, m) is scaled too.
    """
    floor = least_of_heavy(tables)
    least = np.where(floor < high, np.maximum(low, floor), low)
    if not np.any(least > low):
        return balance_of(tables, low, about)
    room = np.ones_like(least)
    np.divide(high - least, high - low, out=room, where=np.isfinite(high) & (least > low))
    if about is None:
        matrix, load = balance_of(tables, least)
        tensions = distribute(matrix, load, least, least, high)[0]
    else:
        tensions = least + room * (about - low)
    matrix, load = balance_of(tables, low, tensions)
    return matrix * room[:, None], load - np.einsum("ndm,nm->nd", matrix, least - room * low)
