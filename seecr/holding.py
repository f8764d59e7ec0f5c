"""Rest lengths that hold platforms at given poses: the elastic statics, the other way round.

At a given pose the tensions follow from balance, W tau = -w (paper, eq 3), as near to wanted ones
as limits allow, and rest lengths from each cable's law, l0 = l/(1 + tau/(E S)) for a plain one.
Where a pull's direction depends on its size (sag, yielding exit points), Newton's method brings
both together, with the law's own derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr import statics
from seecr.compiled.columns import EA, GAP, REST, STRAIN, TENSION, WEIGHT
from seecr.distribution import distribute
from seecr.hanging import bridged_lengths, least_of_heavy, rest_for
from seecr.pose import Array
from seecr.tables import Tables, take

# Rounds of Newton's method; balance to this part of the load ends them.
_ROUNDS, _BALANCED = 40, 1e-12
# Where no tensions balance, as linearised, what lacks at least is to fall by this factor.
_NEARS = 0.5
# Rounds for whether a pose is firm, asked of many.
_FEW = 14
# Step of a rest length for its derivative, relative to the robot's length.
_STEP = 1e-5
# A slack cable is this much longer than the way it bridges: it needs a margin, not a value.
_MARGIN = 2e-3
# A stiffness below this part of the largest is none.
_FIRM = 1e-12
# Below this part of the load a tension is none.
_NONE = 1e-9


@dataclass(eq=False)
class Held:
    """Rest lengths that hold n poses.

    Attributes:
        rest: (n, m) [m].
        tensions: (n, m) [N].
        strains: (n, m).
        fine: (n,) bool, the pose can be held within the limits.
    """

    rest: Array
    tensions: Array
    strains: Array
    fine: NDArray[np.bool_]


def hold(tables: Tables, aim: Array, low: Array, high: Array, rounds: int = _ROUNDS) -> Held:
    """Find rest lengths with which the poses of ``tables`` are in balance.

    Args:
        tables: of n poses, whose own rest lengths do not matter.
        aim: (n, m) tensions wanted [N].
        low, high: (m,) limits [N].
        rounds: at most, of Newton's method.
    """
    least = raised(tables, low, high)
    out = _hold(tables, aim, least, high, rounds)
    # some are in balance with less than what is asked of hanging cables
    again = np.flatnonzero(~out.fine & np.any(least > low, axis=1))
    if len(again):
        other = _hold(take(tables, again), aim[again], low, high, rounds)
        rows = again[other.fine]
        out.rest[rows], out.tensions[rows] = other.rest[other.fine], other.tensions[other.fine]
        out.strains[rows], out.fine[rows] = other.strains[other.fine], True
    return out


def raised(tables: Tables, low: Array, high: Array) -> Array:
    """(n, m) [N] lower limits: no length takes a hanging cable's tension to nothing."""
    floor = least_of_heavy(tables)
    return np.where(floor < high, np.maximum(low, floor), low)


def _hold(tables: Tables, aim: Array, low: Array, high: Array, rounds: int) -> Held:
    """See :func:`hold`; the limits may be (n, m), each row's own."""
    n, m = tables.cables.shape[:2]
    bridged = bridged_lengths(tables)
    least, most = np.broadcast_to(low, (n, m)), np.broadcast_to(high, (n, m))
    first = np.maximum(low, tables.scale[:, None] / m)
    out = Held(rest_for(tables, first), np.zeros((n, m)), np.zeros((n, m)), np.zeros(n, dtype=bool))
    rows, known, wanted = np.arange(n), None, out.tensions
    here, short = _here(tables), np.full(n, np.inf)
    for _ in range(rounds):
        now = with_rest(take(tables, rows), out.rest[rows])
        at = statics.evaluate(now, statics.take_evaluation(here, rows), threads=None)
        statics.put_evaluation(here, rows, at)
        missed = np.abs(at.states[..., TENSION] - wanted).max(axis=1)
        fine = (at.residual <= _BALANCED) & (missed <= _NONE * now.scale)
        out.fine[rows] = fine
        rows, now, at = rows[~fine], take(now, ~fine), statics.take_evaluation(at, ~fine)
        if len(rows) == 0:
            break
        by_tension, own = _rates(now, at)
        if known is not None:
            # a cable that is just slack has no rates: those of when it pulled are near
            idle = own >= 0.0
            by_tension = np.where(idle[:, None, :], known[0][rows], by_tension)
            own = np.where(idle, known[1][rows], own)
        else:
            known = by_tension.copy(), own.copy()
        known[0][rows], known[1][rows] = by_tension, own
        tensions = at.states[..., TENSION]
        load = np.einsum("ndm,nm->nd", by_tension, tensions) - at.gradient
        wanted, possible = distribute(by_tension, load, aim[rows], least[rows], most[rows])
        step = wanted - tensions
        # a plain cable's tension is linear in 1/l0: the slope over the step is exact
        slope = -own * out.rest[rows] * (out.rest[rows] - _STEP * now.length)
        inverse = 1.0 / out.rest[rows] + step / slope * _hanging(now, tensions, wanted)
        inverse = np.clip(inverse * out.rest[rows], 0.5, 2.0) / out.rest[rows]
        # tensions that come near may balance where pulls are as those make them
        before, lack = short[rows], np.einsum("ndm,nm->nd", by_tension, wanted) - load
        short[rows] = np.abs(lack).max(axis=1)
        nears = possible | (short[rows] < _NEARS * before)
        going = nears & np.isfinite(inverse).all(axis=1)
        out.rest[rows[going]] = 1.0 / inverse[going]
        rows, wanted = rows[going], wanted[going]
    out.tensions, out.strains = here.states[..., TENSION], here.states[..., STRAIN]
    # rounding may keep a row that is in balance to nine digits from the last ones
    out.fine |= (here.residual < 1e-10) & _within(out.tensions, low, high, tables.scale)
    slack = (out.tensions <= _NONE * tables.scale[:, None]) & (low <= 0.0)
    out.rest = np.where(slack & out.fine[:, None], (1.0 + _MARGIN) * bridged, out.rest)
    return out


def holds_firmly(tables: Tables, aim: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """(n,) whether poses can be held, as :func:`hold` does, and are stable with those lengths.

    All eigenvalues of the stiffness are above rounding of the largest.
    """
    found = hold(tables, aim, low, high, _FEW)
    now = with_rest(tables, found.rest)
    at = statics.evaluate(now, _here(now), threads=None)
    stiffness = np.where(found.fine[:, None, None], at.hessian, 0.0)
    each = np.linalg.eigvalsh(0.5 * (stiffness + np.swapaxes(stiffness, 1, 2)))
    return np.asarray(found.fine & (each[:, 0] > _FIRM * each[:, -1]))


def with_rest(tables: Tables, rest: Array) -> Tables:
    """The same tables with other rest lengths (n, m) [m]."""
    cables = tables.cables.copy()
    cables[..., GAP] += cables[..., REST] - rest
    cables[..., REST] = rest
    return replace(tables, cables=cables)


def _here(tables: Tables) -> statics.Evaluation:
    """The platform at the poses of the tables."""
    n, m = tables.cables.shape[:2]
    return statics.Evaluation.empty(n, m, tables.n_dof)


def _rates(tables: Tables, at: statics.Evaluation) -> tuple[Array, Array]:
    """Gradient (n, d, m) by each cable's tension, and tension (n, m) by its rest length [N/m]."""
    step = _STEP * tables.length
    force, tension = statics.change_by_cable(tables, tables.lengthened(-step), at)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            tension[:, None, :] != 0.0, force / tension[:, None, :], 0.0
        ), tension / step


def _hanging(tables: Tables, now: Array, wanted: Array) -> Array:
    """(n, m) by what Newton's steps change for cables that hang; one for those without weight.

    A parabola's strain is T/EA - (w l)^2/(24 T^2) (Irvine 1981, section 1.2): how much more or
    less of it lies between two tensions than its slope at the first says.
    """
    law = tables.cables
    heavy = (law[..., WEIGHT] * (law[..., REST] + law[..., GAP])) ** 2
    some = (heavy > 0.0) & (now > 0.0) & (wanted > 0.0)
    old, new = np.where(some, now, 1.0), np.where(some, wanted, 1.0)
    between = 1.0 / law[..., EA] + heavy * (new + old) / (24.0 * (old * new) ** 2)
    slope = 1.0 / law[..., EA] + heavy / (12.0 * old**3)
    return np.where(some, between / slope, 1.0)


def _within(tensions: Array, low: Array, high: Array, scale: Array) -> NDArray[np.bool_]:
    room = 1e-9 * scale[:, None]
    inside = (tensions >= low - room) & (tensions <= high + room)
    return np.asarray(inside.all(axis=1))


def balance_of(tables: Tables, low: Array, about: Array | None = None) -> tuple[Array, Array]:
    """Balance A tau = load at the poses of tables: (n, d, m) and (n, d) [N], torques over length.

    Linear in the tensions from those given, (n, m) [N], or from where the cables just pull. That
    matters where a pull's direction depends on its size only.
    """
    first = np.maximum(low, tables.scale[:, None] / tables.cables.shape[1])
    now = with_rest(tables, rest_for(tables, first if about is None else about))
    at = statics.evaluate(now, _here(now), threads=None)
    by_tension, _ = _rates(now, at)
    load = np.einsum("ndm,nm->nd", by_tension, at.states[..., TENSION]) - at.gradient
    return by_tension, load


def counted_balance(
    tables: Tables, low: Array, high: Array, about: Array | None = None
) -> tuple[Array, Array]:
    """:func:`balance_of` for tensions counted so that hanging cables have the limits, too.

    Counted tensions go from ``low`` to ``high`` where those go from what such a cable needs, which
    changes with the pose, to ``high``; those of others are as they are.

    Args:
        tables: of n poses.
        low, high: (m,) limits [N].
        about: (n, m) counted, or None for tensions that come nearest to balance.
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
