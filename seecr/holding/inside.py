"""Tensions farthest inside their limits that hold platforms, for a nonlinear balance.

If the balance is linear in the tensions, a linear program finds them. If not, each round linearises
it at the tensions of the last round and solves again (sequential linear programming); at the end
the balance is exact at the tensions found.

A cable with weight always has some tension. The less it is to pull, the longer it hangs, and below
about its own weight the tension does not determine the length any more. There its tightness takes
the place of the tension: it falls whenever the length grows. Such cables are called loose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import REST, TENSION, WEIGHT
from seecr.holding.balance import (
    Rates,
    balance_of,
    bends,
    first_tensions,
    here,
    linearised,
    loose_rest,
    next_rest,
    tightness,
    with_rest,
)
from seecr.holding.distribution import balanced, distribute
from seecr.holding.hanging import bridged_lengths, least_of_heavy, rest_for
from seecr.parallel import in_parts
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.tables import Tables, take

# Most rounds, the round from which steps are halved, and the change that ends them [load].
_ROUNDS, _HALVED, _ENOUGH = 14, 7, 1e-10
# A search has ended where it would still change tensions by less than this [load].
_SETTLED = 1e-6
# Tensions that seem unlimited, or whose search has not ended, are sought up to so many loads.
_TIGHT = (30.0, 1000.0)
# The balance is linearised where each cable pulls at least this part of its share of the load.
_PULLS = 1e-3
# Part of the load that may stay unbalanced if the matrix is singular.
_BALANCED = 1e-9
# Part of that by which a search for any tensions may itself be off.
_PART = 1e-2
# Least tightness [weight]: the cable is then half as long again as its span.
_LOOSEST = 12.0**-0.5
# Letting cables hang loosely gains less than this many of their weights.
_GAINED = 2.0
# Rounds with loose cables, residual at their end [load], and allowed error of tensions [load].
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
class Inside:
    """Tensions farthest inside their limits, for n poses.

    Attributes:
        margins: (n,) [N] how far; negative if limits are exceeded; infinite if cables can be
            tightened without limit; minus infinity if nothing balances the load. Zero if a pose
            can only be held with loose cables.
        tensions: (n, m) [N], NaN if they are unlimited or nothing balances the load.
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

    def put(self, rows: NDArray[np.intp], other: Inside) -> None:
        """Overwrite rows with what another search found, but for the limits asked for."""
        self.margins[rows], self.tensions[rows] = other.margins, other.tensions
        self.rest[rows], self.loose[rows] = other.rest, other.loose
        self.matrices[rows], self.loads[rows] = other.matrices, other.loads


def limits_of(tables: Tables, low: Array, high: Array) -> tuple[Array, Array]:
    """Limits (n, m) [N] of tensions from the given (m,) or (n, m), raised to what a cable weighs.

    They contradict each other if a cable may not pull as much as it weighs.
    """
    shape = tables.cables.shape[:2]
    least = np.maximum(np.broadcast_to(low, shape), least_of_heavy(tables))
    return least, np.array(np.broadcast_to(high, shape), float)


def farthest_inside(tables: Tables, low: Array, high: Array, hopeless: float = np.inf) -> Inside:
    """The tensions that stay farthest inside limits; exact even if the balance is nonlinear.

    Args:
        tables: of n poses, whose own rest lengths do not matter; at least as many cables as degrees
            of freedom.
        low, high: (m,) or (n, m) [N].
        hopeless: give up on rows whose margin is below minus this part of the load, if loose
            cables could not help, from the second round on.
    """
    out = _tightened(tables, *limits_of(tables, low, high), hopeless)
    weighs = least_of_heavy(tables)
    could = (weighs > low) & (weighs <= high)
    lost = (out.margins < 0.0) & (out.margins > -_GAINED * weighs.max(axis=1)) & could.any(axis=1)
    rows = np.flatnonzero(lost)
    if len(rows):
        _loosen(out, rows, take(tables, rows), could[rows], low, high, out.rest[rows])
        for share in _STARTS:
            rows = rows[~out.loose[rows]]
            some = take(tables, rows)
            first = rest_for(some, share * first_tensions(some, weighs[rows]))
            _loosen(out, rows, some, could[rows], low, high, first)
    return out


def margins_inside(tables: Tables, low: Array, high: Array) -> Array:
    """Margins (n,) [N] of tensions from limits (m,) asked for, which what cables weigh may exceed.

    The largest t with low + t <= tensions <= high - t that leaves no cable below its own least
    tension. :func:`farthest_inside` counts t from that where it is the larger one, a lower bound
    that is exact at zero. It is counted from lower limits the farther inside tensions turn out to
    be, in rounds that only increase t.
    """
    found, weighs = farthest_inside(tables, low, high), least_of_heavy(tables)
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
    """For each pose, the balance that its tensions come nearest to, to explain why it is not held.

    Args:
        tables: of n poses.
        low, high: (m,) limits asked for [N].

    Yields:
        matrix (d, m), load (d,) [N], and limits (m,) [N] of cables that are not loose.
    """
    if tables.cables.shape[1] >= tables.n_dof and bends(tables):
        found = farthest_inside(tables, low, high)
        yield from zip(found.matrices, found.loads, found.low, found.high, strict=True)
    else:
        rows = balance_of(tables, low), limits_of(tables, low, high)
        yield from zip(*rows[0], *rows[1], strict=True)


def _tightened(tables: Tables, least: Array, most: Array, hopeless: float) -> Inside:
    """See :func:`farthest_inside`; with limits (n, m), and without loose cables.

    Where pulls bend, a linearised balance may promise tensions that its cables do not have, and
    unlimited ones where none hold: those are sought again within limits, and only what is found
    there counts.
    """
    out, ended = _linearised_again(tables, least, most, hopeless)
    promised = out.margins.copy()
    for tight in _TIGHT:
        rows = np.flatnonzero((out.margins >= 0.0) & ~ended)
        if len(rows) == 0:
            return out
        end = np.minimum(most[rows], least[rows] + tight * tables.scale[rows, None])
        found, ended[rows] = _linearised_again(take(tables, rows), least[rows], end, np.inf)
        out.put(rows, found)
        endless = rows[np.isposinf(promised[rows]) & (found.margins >= 0.0) & ended[rows]]
        out.margins[endless] = np.inf
    rows = np.flatnonzero((out.margins >= 0.0) & ~ended)
    if len(rows):
        _nearest_to(out, rows, take(tables, rows), least[rows], most[rows])
    return out


def _nearest_to(
    out: Inside, rows: NDArray[np.intp], tables: Tables, least: Array, most: Array
) -> None:
    """Balanced tensions near those at which searches stopped; their margin is a lower bound."""
    tight = np.zeros(least.shape, dtype=bool)
    rest, tension, held = _hang(tables, tight, least, most, out.rest[rows])
    room = np.minimum(tension - least, most - tension).min(axis=1)
    held &= room >= -_OFF * tables.scale
    out.margins[rows] = np.where(held, np.maximum(room, 0.0), -np.inf)
    out.rest[rows[held]], out.tensions[rows[held]] = rest[held], tension[held]


def _linearised_again(
    tables: Tables, least: Array, most: Array, hopeless: float
) -> tuple[Inside, NDArray[np.bool_]]:
    """Sequential linear programming, and (n,) whether tensions have settled."""
    n, m = tables.cables.shape[:2]
    pulls = np.maximum(least, _PULLS * tables.scale[:, None] / m)
    first = rest_for(tables, first_tensions(tables, least))
    out = Inside(
        np.full(n, np.nan), np.full((n, m), np.nan), first,
        np.zeros((n, tables.n_dof, m)), np.zeros((n, tables.n_dof)), least, most,
        np.zeros(n, dtype=bool),
    )  # fmt: skip
    rows, bent, start = np.arange(n), bends(tables), here(tables)
    ended = np.full(n, not bent)
    beyond = hopeless * tables.scale + _GAINED * least_of_heavy(tables).max(axis=1)
    for k in range(_ROUNDS if bent else 1):
        now = with_rest(take(tables, rows), out.rest[rows])
        at, rates = linearised(now, batch.take_evaluation(start, rows))
        batch.put_evaluation(start, rows, at)
        own = at.states[..., TENSION]
        out.matrices[rows], out.loads[rows] = rates.by_tension, rates.load(at)
        out.margins[rows], out.tensions[rows] = innermost(
            rates.by_tension, out.loads[rows], least[rows], most[rows], now.scale
        )
        if not bent:
            break
        found = out.tensions[rows]
        wanted = np.where(np.isnan(found), own, np.fmax(found, pulls[rows]))
        wanted = wanted if k < _HALVED else 0.5 * (wanted + own)
        rest = next_rest(now, out.rest[rows], rates.by_length, own, wanted)
        change = np.abs(wanted - own).max(axis=1)
        ended[rows] = (change <= _SETTLED * now.scale) & ~np.isnan(found).any(axis=1)
        go = change > _ENOUGH * now.scale
        go &= np.isfinite(rest).all(axis=1)
        if k > 0:
            go &= ~(out.margins[rows] < -beyond[rows])
        rows = rows[go]
        if len(rows) == 0:
            break
        out.rest[rows] = rest[go]
    return out, ended


@dataclass(eq=False)
class _Line:
    """The balance of n poses, linear in each cable's tension, or tightness if it is loose.

    Attributes:
        tables: with the rest lengths at which it is linearised.
        value: (n, m) [N] there. loose: (n, m) bool, the value is the tightness.
        tension: (n, m) [N]; by_length: (n, m) [N/m] its derivative by the rest length.
        matrix, load: (n, d, m), (n, d) [N]: matrix value = load.
    """

    tables: Tables
    value: Array
    loose: NDArray[np.bool_]
    tension: Array
    by_length: Array
    matrix: Array
    load: Array

    def rest_for(self, wanted: Array) -> Array:
        """Rest lengths (n, m) [m] for other values."""
        law = self.tables
        rest = law.cables[..., REST]
        tight = next_rest(
            law, rest, self.by_length, self.tension, np.where(self.loose, self.tension, wanted)
        )
        return np.where(self.loose, loose_rest(law, np.where(self.loose, wanted, 1.0))[0], tight)


def _line_about(tables: Tables, at: batch.Evaluation, rates: Rates, size: Array) -> _Line:
    """The balance linearised at an evaluation.

    Args:
        tables: of n poses.
        at, rates: an evaluation of them, and its derivatives.
        size: (n, m) [N] tightness of cables that may be loose, NaN for all others.
    """
    loose, tension = ~np.isnan(size), at.states[..., TENSION]
    value = np.where(loose, size, tension)
    longer = loose_rest(tables, np.where(loose, size, 1.0))[1]
    matrix = np.where(loose[:, None], rates.pull * longer[:, None], rates.by_tension)
    load = np.einsum("ndm,nm->nd", matrix, value) - at.gradient
    return _Line(tables, value, loose, tension, rates.by_length, matrix, load)


def _loosen(
    out: Inside, rows: NDArray[np.intp], tables: Tables, loose: NDArray[np.bool_], low: Array,
    high: Array, first: Array,
) -> None:  # fmt: skip
    """Hold rows with loose cables, if that is possible.

    Newton's method with the least change of all cables.

    Args:
        out: the results to be filled in.
        rows: (k,) of it; tables: of these.
        loose: (k, m) cables that may be loose.
        low, high: (m,) or (n, m) [N] limits asked for, of all rows of ``out``.
        first: (k, m) [m] rest lengths to start from.
    """
    weight = tables.cables[..., WEIGHT] * bridged_lengths(tables)
    low, high = (np.array(np.broadcast_to(one, out.low.shape)[rows]) for one in (low, high))
    least = np.where(loose, _LOOSEST * weight, out.low[rows])
    room, left = _OFF * tables.scale[:, None], np.arange(len(rows))
    for _ in range(_AGAIN):
        part = take(tables, left)
        rest, tension, held = _hang(part, loose[left], least[left], high[left], first[left])
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
        loose[left] &= ~under
        least[left] = np.where(under, low[left], least[left])


def _hang(
    tables: Tables, loose: NDArray[np.bool_], least: Array, high: Array, first: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Newton's method for :func:`_loosen`, from rest lengths (n, m) [m].

    Returns:
        rest lengths, tensions (n, m) [N], and (n,) whether they are in balance.
    """
    size, rest = np.where(loose, tightness(tables, first), np.nan), first.copy()
    left, start = np.arange(len(rest)), here(tables)
    for _ in range(_NEWTON):
        now = with_rest(take(tables, left), rest[left])
        at, rates = linearised(now, batch.take_evaluation(start, left))
        batch.put_evaluation(start, left, at)
        line = _line_about(now, at, rates, size[left])
        upper = np.where(line.loose, line.value + high[left] - line.tension, high[left])
        upper = np.maximum(upper, least[left])
        value, possible = distribute(line.matrix, line.load, line.value, least[left], upper)
        longer = line.rest_for(value)
        go = possible & np.isfinite(longer).all(axis=1) & (at.residual > _EXACT)
        left = left[go]
        if len(left) == 0:
            break
        rest[left], size[left] = longer[go], np.where(line.loose, value, np.nan)[go]
    held = (start.residual <= _EXACT) & np.all(~(size < least), axis=1)
    return rest, start.states[..., TENSION], held


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
    whole, load, least, most = map(np.ascontiguousarray, (matrices, loads, low, high))
    out = np.empty(len(whole))

    def run(part: slice) -> None:
        feasible_of(
            whole[part], load[part], least[part], most[part], room[part], _PART * room[part],
            out[part],
        )  # fmt: skip

    in_parts(run, len(whole))
    return out


def innermost(
    matrices: Array, loads: Array, low: Array, high: Array, scale: Array
) -> tuple[Array, Array]:
    """Margins (n,) and tensions (n, m) [N] of the balance A tau = load, as in :class:`Inside`.

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

    n = len(matrices)
    margins, tensions = np.full(n, np.nan), np.full(low.shape, np.nan)
    whole, load = np.ascontiguousarray(matrices), np.ascontiguousarray(loads)
    low, high = np.ascontiguousarray(low), np.ascontiguousarray(high)
    if matrices.shape[2] >= matrices.shape[1]:
        in_parts(
            lambda part: innermost_of(
                whole[part], load[part], low[part], high[part], scale[part], margins[part],
                tensions[part],
            ),
            n,
        )  # fmt: skip
    return margins, tensions


def _by_search(matrix: Array, load: Array, low: Array, high: Array) -> tuple[float, Array]:
    """The same for one pose with a singular W: margin zero if a search finds tensions."""
    if np.all(high >= low) and np.isfinite(matrix).all() and np.isfinite(load).all():
        tensions, left = balanced(matrix, load, low, high)
        if left < _BALANCED:
            return 0.0, tensions
    return -np.inf, np.full(len(low), np.nan)


def raised(tables: Tables, low: Array, high: Array) -> Array:
    """(n, m) [N] lower limits, raised to the least tension of cables with weight."""
    floor = least_of_heavy(tables)
    return np.where(floor < high, np.maximum(low, floor), low)


def counted_balance(
    tables: Tables, low: Array, high: Array, about: Array | None = None
) -> tuple[Array, Array]:
    """Like :func:`balance_of`, for tensions scaled so that limits are the same at all poses.

    The scaled tension goes from ``low`` to ``high`` as the tension of a cable with weight goes from
    its least value, which changes with the pose, to ``high``. Other tensions are not scaled.

    Args:
        tables: of n poses.
        low, high: (m,) limits [N].
        about: (n, m) scaled, or None for tensions that come nearest to balance.
    """
    least = raised(tables, low, high)
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
