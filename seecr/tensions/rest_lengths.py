"""Rest lengths that hold platforms at given poses: the elastic statics, inverted.

At a given pose the tensions follow from the balance, W tau = -w (paper, eq 3), as near to wanted
ones as the limits allow, and rest lengths follow from each cable's law, l0 = l/(1 + tau/(E S)) for
a plain one. If the direction of a pull depends on its size (sag, yielding exit points), Newton's
method solves both together, with the derivatives of the cable's law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import TENSION, TOLERANCE
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.tables import ByRow, Tables, take
from seecr.tensions.balance import (
    Rates,
    bends,
    bridged_lengths,
    first_tensions,
    here,
    is_plain,
    linearised,
    next_rest,
    plain_rest,
    rest_after,
    rest_for,
    straight_balance,
    with_rest,
)
from seecr.tensions.distribution import distribute
from seecr.tensions.max_margin import HOPELESS, limits_of, max_margin_tensions

# Most rounds of Newton's method, and the residual that ends them [load].
_ROUNDS, _BALANCED = 40, 1e-12
# If no tensions balance the linearised system, its residual must fall by this factor to go on,
# unless it is this small [load]: what is left then may be the linearisation's.
_NEARS, _NEAR = 0.5, 1e-6
# Rounds for whether a pose is stable, which is asked for many poses.
_FEW = 14
# A slack cable is longer than its span by this part, to keep it slack.
_MARGIN = 2e-3
# A stiffness below this part of the largest counts as zero.
_UNSTABLE = 1e-12
# A tension below this part of the load counts as zero.
_NONE = 1e-9
# Fractions from the aim to the tensions farthest inside, with which a pose is tried again.
_PARTS = (0.0, 0.5, 0.75, 0.9, 1.0)


@dataclass(eq=False)
class Held(ByRow):
    """Rest lengths [m] and tensions [N], (n, m), and (n,) whether they hold within limits."""

    rest: Array
    tensions: Array
    fine: NDArray[np.bool_]


def hold(tables: Tables, aim: Array, low: Array, high: Array, rounds: int = _ROUNDS) -> Held:
    """Find rest lengths with which the poses of ``tables`` are in balance.

    Tensions are near ``aim`` (n, m) within limits (m,) or (n, m) [N]. Cables with weight pull at
    least about what they weigh, unless the pose can only be held with less.
    """
    if is_plain(tables):
        return _hold_plain(tables, aim, *(np.broadcast_to(one, aim.shape) for one in (low, high)))
    limits = limits_of(tables, low, high)
    out = _hold(tables, aim, *limits, rounds, rest_for(tables, first_tensions(tables, limits[0])))
    if bends(tables) and tables.cables.shape[1] >= tables.n_dof:
        lost = np.flatnonzero(~out.fine)
        if len(lost):
            _from_inside(out, lost, tables, aim, rounds, low, limits)
    return out


def hold_again(
    tables: Tables, held: Held, aim: Array, low: Array, high: Array, follows: bool = True
) -> Held:
    """Rest lengths that hold poses again, after nothing but the cables' history has changed.

    On straight cables the tensions stay as they are. ``follows``: the tension behind a cable that
    sticks changes with what is paid out, :func:`seecr.tensions.balance.rest_after`.
    """
    if bends(tables):
        out = _hold(tables, aim, *limits_of(tables, low, high), _ROUNDS, held.rest)
        lost = np.flatnonzero(~out.fine)
        if len(lost):
            least, most = (one[lost] if one.ndim == 2 else one for one in (low, high))
            out.put(lost, hold(take(tables, lost), aim[lost], least, most))
    else:
        out = Held(rest_for(tables, held.tensions), held.tensions, held.fine)
    if follows:
        out = Held(rest_after(tables, out.rest, out.tensions), out.tensions, out.fine)
    return _loosened(tables, out, limits_of(tables, low, high)[0])


def _from_inside(
    out: Held, rows: NDArray[np.intp], tables: Tables, aim: Array, rounds: int,
    low: Array, limits: tuple[Array, Array],
) -> None:  # fmt: skip
    """Hold rows from the tensions farthest inside the limits, if the balance is nonlinear.

    The aim is moved towards those tensions, which hold the pose, as far as necessary.
    """
    least, most = limits
    lowest = low if low.ndim == 1 else low[rows]
    start = max_margin_tensions(take(tables, rows), lowest, most[rows], HOPELESS)
    loose = np.flatnonzero(start.loose)
    out.put(rows[loose], Held(start.rest[loose], start.tensions[loose], start.loose[loose]))
    held = ~start.loose & (start.margins >= -_NONE * tables.scale[rows])
    some, inside, rest = rows[held], start.tensions[held], start.rest[held]
    for part in _PARTS:
        if len(some) == 0:
            return
        wanted = (1.0 - part) * np.clip(aim[some], least[some], most[some]) + part * inside
        found = _hold(take(tables, some), wanted, least[some], most[some], rounds, rest)
        out.put(some[found.fine], found.only(found.fine))
        some, inside, rest = some[~found.fine], inside[~found.fine], rest[~found.fine]


def _hold(tables: Tables, aim: Array, least: Array, most: Array, rounds: int, rest: Array) -> Held:
    """See :func:`hold`; with limits (n, m), and rest lengths (n, m) [m] to start from.

    The directions of straight cables' pulls do not depend on the lengths: their tensions are found
    at once, and the lengths for them from each cable's own law.
    """
    n, m = tables.cables.shape[:2]
    out = Held(rest.copy(), np.zeros((n, m)), np.zeros(n, dtype=bool))
    rows, wanted, straight = np.arange(n), np.full((n, m), np.inf), not bends(tables)
    known = Rates(*(np.zeros((n, *each, m)) for each in ((tables.n_dof,), (), (tables.n_dof,))))
    start, short = here(tables), np.full(n, 0.0 if straight else np.inf)
    for k in range(rounds):
        now = with_rest(take(tables, rows), out.rest[rows])
        at, rates = linearised(now, start.only(rows))
        start.put(rows, at)
        missed = np.abs(at.states[..., TENSION] - wanted).max(axis=1)
        fine = (at.residual <= _BALANCED) & (missed <= _NONE * now.scale)
        out.fine[rows] = fine
        if fine.all():
            break
        if fine.any():
            rows, now, at = rows[~fine], take(now, ~fine), at.only(~fine)
            rates = rates.only(~fine)
        # a cable that has just gone slack has no derivatives: those of when it pulled are near
        idle = rates.by_length >= 0.0
        rates.by_tension = np.where(idle[:, None, :], known.by_tension[rows], rates.by_tension)
        rates.by_length = np.where(idle, known.by_length[rows], rates.by_length)
        known.by_tension[rows], known.by_length[rows] = rates.by_tension, rates.by_length
        load = rates.load(at)
        wanted, possible = distribute(rates.by_tension, load, aim[rows], least[rows], most[rows])
        tensions = at.states[..., TENSION]
        if straight and k == 0:
            longer = rest_for(now, wanted)
        else:
            longer = next_rest(now, out.rest[rows], rates.by_length, tensions, wanted)
        # even tensions that only come near may balance, once the directions of pulls follow them
        before, lack = short[rows], np.einsum("ndm,nm->nd", rates.by_tension, wanted) - load
        short[rows] = np.abs(lack).max(axis=1)
        nears = possible | (short[rows] < np.maximum(_NEARS * before, _NEAR * now.scale))
        going = nears & np.isfinite(longer).all(axis=1)
        out.rest[rows[going]] = longer[going]
        rows, wanted = rows[going], wanted[going]
    out.tensions = start.states[..., TENSION]
    # rounding may keep a row that balances to nine digits from balancing to the last
    room = _NONE * tables.scale[:, None]
    inside = (out.tensions >= least - room) & (out.tensions <= most + room)
    out.fine |= (start.residual < TOLERANCE) & inside.all(axis=1)
    return _loosened(tables, out, least)


def _hold_plain(tables: Tables, aim: Array, least: Array, most: Array) -> Held:
    """The same for straight cables with linear laws: neither needs rounds."""
    n = len(tables)
    matrix, load = straight_balance(tables, np.arange(n), np.zeros((n, tables.n_dof)))
    tensions, _possible = distribute(matrix, load, aim, least, most)
    lack = np.einsum("ndm,nm->nd", matrix, tensions) - load
    fine = batch.residual_size(lack) < TOLERANCE * tables.scale
    return _loosened(tables, Held(plain_rest(tables, tensions), tensions, fine), least)


def _loosened(tables: Tables, held: Held, least: Array) -> Held:
    """The same with a margin in cables that pull nothing and may, which keeps them slack."""
    slack = (held.tensions <= _NONE * tables.scale[:, None]) & (least <= 0.0) & held.fine[:, None]
    longer = (1.0 + _MARGIN) * bridged_lengths(tables)
    return Held(np.where(slack, longer, held.rest), held.tensions, held.fine)


def holds_stably(
    tables: Tables, aim: Array, low: Array, high: Array, held: Callable[[Array], Tables]
) -> NDArray[np.bool_]:
    """(n,) whether poses can be held, as by :func:`hold`, and are stable with those lengths.

    Stable means that all eigenvalues of the stiffness exceed the rounding of the largest. ``held``
    gives the tables of all lines, the passive ones too, by the driven cables' rest lengths.
    """
    found = hold(tables, aim, low, high, _FEW)
    now = held(found.rest)
    at = batch.evaluate(now, here(now), threads=None)
    stiffness = np.where(found.fine[:, None, None], at.hessian, 0.0)
    each = np.linalg.eigvalsh(0.5 * (stiffness + np.swapaxes(stiffness, 1, 2)))
    return np.asarray(found.fine & (each[:, 0] > _UNSTABLE * each[:, -1]))
