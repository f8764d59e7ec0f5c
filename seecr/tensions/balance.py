"""The balance of platforms at given poses, linearised in the tensions about some rest lengths.

A tau = load is exact for tensions near those that the cables have with these lengths. Farther away
it is not, if the direction of a pull depends on its size (sag, yielding exit points).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import (
    ANCHOR,
    ARM,
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    EXIT,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE,
    FRICTION,
    GAP,
    LIFT,
    RADIUS,
    REST,
    TENSION,
    UP,
    WEIGHT,
    WINCH_SIDE,
)
from seecr.description.robot import Robot
from seecr.pose import Array, cross
from seecr.statics import batch
from seecr.statics.tables import ByRow, Tables, by_row, rest_lengths_of, take, told_apart, ways

# Newton steps to the tightness of a cable.
_TIGHTNESS = 60
# Newton steps to tensions, and their allowed error [load]: the balance is off by its square.
_TO_TENSIONS, _SAME = 8, 1e-8


@dataclass(eq=False)
class Rates(ByRow):
    """Derivatives of the cables' forces at n poses.

    Attributes:
        by_tension: (n, d, m) gradient by each cable's tension; zero for cables without tension.
        by_length, pull: (n, m) tension and (n, d, m) gradient by rest length [N/m].
    """

    by_tension: Array
    by_length: Array
    pull: Array

    def load(self, at: batch.Evaluation) -> Array:
        """The load (n, d) [N] to be balanced, at an evaluation with these derivatives."""
        made = np.einsum("ndm,nm->nd", self.by_tension, at.states[..., TENSION])
        return np.asarray(made - at.gradient)


def linearised(tables: Tables, start: batch.Evaluation) -> tuple[batch.Evaluation, Rates]:
    """The balance of tables at the deviations of ``start``, and its derivatives there."""
    at, pull, by_length = batch.pull_and_change(tables, start)
    pulls = np.broadcast_to(by_length[:, None, :] != 0.0, pull.shape)
    each = np.divide(pull, by_length[:, None, :], out=np.zeros_like(pull), where=pulls)
    return at, Rates(each, by_length, pull)


def linearised_at(tables: Tables, tensions: Array) -> tuple[batch.Evaluation, Rates]:
    """The balance where cables have tensions (n, m) [N], and its derivatives there.

    Rest lengths are mended until the tensions are those asked for: too few cables cannot make up
    for an error of second order. Where none lead there, those that come nearest are kept.
    """
    now = with_rest(tables, rest_for(tables, tensions))
    at, rates = linearised(now, here(now))
    off = _off(at, tensions)
    rows = np.flatnonzero(np.isfinite(off)) if bends(tables) else np.arange(0)
    for _ in range(_TO_TENSIONS):
        rows = rows[off[rows] > _SAME * tables.scale[rows]]
        if len(rows) == 0:
            break
        some, own = take(now, rows), at.states[rows, :, TENSION]
        rest, by_length = some.cables[..., REST], rates.by_length[rows]
        longer = with_rest(some, next_rest(some, rest, by_length, own, tensions[rows]))
        there, slopes = linearised(longer, at.only(rows))
        missed = _off(there, tensions[rows])
        nearer = missed < off[rows]
        rows = rows[nearer]
        now.cables[rows], off[rows] = longer.cables[nearer], missed[nearer]
        at.put(rows, there.only(np.flatnonzero(nearer)))
        rates.put(rows, slopes.only(nearer))
    return at, rates


def _off(at: batch.Evaluation, tensions: Array) -> Array:
    """(n,) [N] by how much some tension differs from (n, m) [N]; infinite without an answer."""
    most = np.abs(at.states[..., TENSION] - tensions).max(axis=1)
    return np.where(np.isfinite(at.residual), most, np.inf)


def with_rest(tables: Tables, rest: Array) -> Tables:
    """The same tables with other rest lengths (n, m) [m]."""
    cables = tables.cables.copy()
    cables[..., GAP] += cables[..., REST] - rest
    cables[..., REST] = rest
    return replace(tables, cables=cables)


def here(tables: Tables) -> batch.Evaluation:
    """The platform at the poses of the tables."""
    return batch.Evaluation.at_commands(tables)


def first_tensions(tables: Tables, low: Array) -> Array:
    """Tensions (n, m) [N] to start with: each cable's share of the load, or ``low`` if larger."""
    return np.asarray(np.maximum(low, tables.scale[:, None] / tables.cables.shape[1]))


def next_rest(tables: Tables, rest: Array, by_length: Array, now: Array, wanted: Array) -> Array:
    """Rest lengths (n, m) [m], at most doubled or halved, that bring tensions near to ``wanted``.

    They are not finite if a tension does not depend on the length.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        # the tension of a plain cable is linear in 1/l0
        slope = -by_length * rest**2
        inverse = 1.0 / rest + (wanted - now) / slope * _hanging(tables, now, wanted)
        return np.asarray(rest / np.clip(inverse * rest, 0.5, 2.0))


def _hanging(tables: Tables, now: Array, wanted: Array) -> Array:
    """Factors (n, m) on Newton's steps for cables with weight; one for cables without.

    The strain of a parabola is T/EA - (w l)^2/(24 T^2) (Irvine 1981, section 1.2): the factor is
    its difference between two tensions over that of its tangent at the first.
    """
    law, heavy = tables.cables, weights(tables) ** 2
    some = (heavy > 0.0) & (now > 0.0) & (wanted > 0.0)
    old, new = np.where(some, now, 1.0), np.where(some, wanted, 1.0)
    between = 1.0 / law[..., EA] + heavy * (new + old) / (24.0 * (old * new) ** 2)
    slope = 1.0 / law[..., EA] + heavy / (12.0 * old**3)
    return np.where(some, between / slope, 1.0)


def loose_rest(tables: Tables, size: Array) -> tuple[Array, Array]:
    """Rest lengths (n, m) [m] of cables with weight by tightness (n, m) [N], and the slope [m/N].

    Tightness is the tension at which a shallow parabola would have that length. Unlike the tension,
    which increases again when a cable hangs far down, it always falls as the cable gets longer.
    """
    law, way = tables.cables, bridged_lengths(tables)
    sag = weights(tables) ** 2 / (24.0 * size**2)
    grown = 1.0 + size / law[..., EA]
    rest = way * (1.0 + sag) / grown
    return np.asarray(rest), np.asarray(
        -2.0 * way * sag / (size * grown) - rest / law[..., EA] / grown
    )


def tightness(tables: Tables, rest: Array) -> Array:
    """The tightness (n, m) [N], see :func:`loose_rest`, if that is about the weight or more."""
    weight = weights(tables)
    size = np.where(weight > 0.0, weight, 1.0)
    for _ in range(_TIGHTNESS):
        found, slope = loose_rest(tables, size)
        # the slope of a cable without a span is zero
        step = np.divide(found - rest, slope, out=np.zeros_like(size), where=slope != 0.0)
        size = np.maximum(size - step, 0.5 * size)
    return size


def bends(tables: Tables) -> bool:
    """Whether the balance is nonlinear in the tensions: cables have weight or exit points lift."""
    return bool(np.any(tables.cables[..., WEIGHT]) or np.any(tables.cables[..., LIFT]))


def balance_of(tables: Tables, low: Array, about: Array | None = None) -> tuple[Array, Array]:
    """Balance A tau = load at the poses of tables: (n, d, m) and (n, d) [N], torques over length.

    It is linearised at the tensions ``about``, (n, m) [N], by default near :func:`first_tensions`.
    """
    if about is None:  # somewhere near will do
        now = with_rest(tables, rest_for(tables, first_tensions(tables, low)))
        at, rates = linearised(now, here(now))
    else:
        at, rates = linearised_at(tables, about)
    return rates.by_tension, rates.load(at)


def is_straight(tables: Tables, others: Tables) -> bool:
    """Whether cables are straight, and ends and loads the same, in tables of two poses."""
    ends = [*range(EXIT, EXIT + 3), *range(ANCHOR, ANCHOR + 3)]
    same = np.array_equal(tables.cables[..., ends], others.cables[..., ends])
    same &= np.array_equal(tables.load, others.load)
    return bool(same and not np.any(tables.cables[..., [RADIUS, WEIGHT, LIFT]]))


def straight_balance(tables: Tables, rows: NDArray[np.intp], away: Array) -> tuple[Array, Array]:
    """:func:`balance_of` at displacements (k, d) [m] of rows (k,) of tables that are straight.

    Rotations are times the robot's length. It needs no rest lengths, and takes a tenth of the time.
    """
    from seecr.compiled.orientation import straight_balance_batch  # takes a while to import

    (m, d), k = (rest_lengths_of(tables).shape[1], tables.n_dof), len(rows)
    matrices, loads = np.empty((k, d, m)), np.empty((k, d))
    # Numba would compile everything once more for views
    rows, moves = np.ascontiguousarray(rows), np.ascontiguousarray(away)
    cables, _paid, load = told_apart(tables)
    given = cables, load, tables.poses, tables.screws
    by_row(
        lambda of, by, *out: straight_balance_batch(*given, of, by, tables.length, *out),
        rows, moves, matrices, loads,
    )  # fmt: skip
    return matrices, loads


# Least mean tension [weight of the cable], and the largest bend of a catenary, that are considered.
_LEAST, _MOST_BENT = 0.8, 1.0
# Rounds to a bend; each takes away four fifths of its error or more.
_ROUNDS = 8


def bridged_lengths(tables: Tables) -> Array:
    """(n, m) [m] lengths of straight, unstrained cables at the poses of tables."""
    return np.asarray(told_apart(tables)[1].sum(axis=2))


def is_plain(tables: Tables) -> bool:
    """Whether cables are straight, with linear laws: all that lanes know."""
    from seecr.compiled.lanes import OUT_OF_SCOPE  # takes a while to import

    return not told_apart(tables)[0][..., list(OUT_OF_SCOPE)].any()


def plain_rest(tables: Tables, tensions: Array) -> Array:
    """Rest lengths (n, m) [m] with which cables that are plain have tensions (n, m) [N]."""
    law = told_apart(tables)[0]
    soft = law[..., COMPLIANCE] + law[..., WINCH_SIDE] / law[..., EA]
    grown = 1.0 + law[..., CREEP] + (1.0 / law[..., EA] + law[..., CREEP_RATE]) * tensions
    return np.asarray((bridged_lengths(tables) - soft * tensions) / grown)


def least_of_heavy(tables: Tables) -> Array:
    """(n, m) [N] tensions that cables with weight are not asked to go below; zero for others.

    In the middle that is the cable's weight, as of a catenary that sags by a seventh of its span;
    at the exit point up to half the weight more or less. No catenary has less than three quarters.
    """
    weight = weights(tables)
    if not weight.any():
        return weight
    return np.asarray(weight * (1.0 + 0.5 * _rises(tables)))


def weights(tables: Tables) -> Array:
    """(n, m) [N] of the cables, as long as their spans."""
    return np.asarray(tables.cables[..., WEIGHT] * bridged_lengths(tables))


def rest_for(tables: Tables, tensions: Array) -> Array:
    """Rest lengths (n, m) [m] for tensions (n, m) [N]: exact without weight, approximate with."""
    bridged, weight = bridged_lengths(tables), weights(tables)
    if not weight.any():
        return _straight_rest(tables, bridged, tensions)
    rise = _rises(tables)
    # the tension at the exit point includes the weight that hangs below it
    mean = tensions - 0.5 * weight * rise
    arcs = _arcs(0.5 * weight / np.maximum(mean, np.maximum(_LEAST * weight, 1e-300)), rise)
    return _straight_rest(tables, bridged * arcs, np.maximum(mean, 0.0))


def rest_after(tables: Tables, rest: Array, tensions: Array) -> Array:
    """(n, m) [m] rest lengths with tensions (n, m) [N] where cables stick at their exit points.

    What is paid out to a cable that sticks stays behind the exit point, and lowers the tension
    there until the cable slips. ``rest`` (n, m) are the lengths if the tensions behind stayed as
    they are.
    """
    if not tables.cables[..., FRICTION].any():
        return rest
    from seecr.compiled.rates import stretched_lengths  # takes a while to import

    spans, there = np.empty_like(rest), tables.cables.copy()
    there[..., REST] = rest
    by_row(stretched_lengths, there, np.array(tensions, order="C"), spans)
    return _straight_rest(tables, spans, tensions, follows=True)


def _straight_rest(tables: Tables, spans: Array, tensions: Array, follows: bool = False) -> Array:
    """(n, m) [m] rest lengths with which straight cables over these spans have these tensions."""
    from seecr.compiled.rates import rest_lengths_for  # takes a while to import

    cables, pulls, out = tables.cables, np.array(tensions, order="C"), np.empty_like(spans)
    by_row(rest_lengths_for, cables, spans, pulls, follows, out)
    return out


def _arcs(light: Array, rise: Array) -> Array:
    """Lengths of catenaries over the straight distances that they span.

    With the bend g = w x/(2 H), for spans x and rises z, l^2 = z^2 + (x sinh(g)/g)^2, and the mean
    of the tensions at both ends is w l coth(g)/2 (Irvine 1981, section 1.2): one equation for g.
    ``light`` is half of the weight over the mean tension, ``rise`` is over the straight distance.
    """
    arc = np.ones_like(light)
    for _ in range(_ROUNDS):
        bend = np.arctanh(np.clip(light * arc, 1e-6, np.tanh(_MOST_BENT)))
        arc = np.sqrt(rise**2 + (1.0 - rise**2) * (np.sinh(bend) / bend) ** 2)
    return np.where(light > 0.0, arc, 1.0)


def _rises(tables: Tables) -> Array:
    """(n, m) height of exit points above anchor points, over the distance between them."""
    way = ways(tables)
    up = tables.load[:, None, UP : UP + 3]
    spans = np.linalg.norm(way, axis=2)
    # a cable without a span, its anchor point at its exit point, has no direction: it hangs level
    return np.asarray(-(way * up).sum(axis=2) / np.where(spans > 0.0, spans, 1.0))


# The balance of the driven cables alone: what passive lines pull is part of the load.
#
# At a given pose their wrench is known, since their rest lengths are. Winches balance what is left.


def driven_tables(tables: Tables, robot: Robot) -> Tables:
    """The tables of the k driven cables, with the passive lines' wrench among the external ones.

    They hold at the poses of the tables alone, (n, k) cables. A robot without passive lines has
    the same tables.
    """
    if robot.all_driven:
        return tables
    others = replace(tables, cables=np.ascontiguousarray(tables.cables[:, ~robot.driven]))
    each = batch.rates_of_cables(others, batch.Evaluation.at_commands(others))
    force, arm = each[..., FORCE : FORCE + 3], each[..., ARM : ARM + 3]
    load = tables.load.copy()
    load[:, EXTERNAL_FORCE : EXTERNAL_FORCE + 3] += force.sum(axis=1)
    load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] += cross(arm, force).sum(axis=1)
    return replace(tables, cables=np.ascontiguousarray(tables.cables[:, robot.driven]), load=load)


def with_passive(robot: Robot, lengths: Array) -> Array:
    """Lengths (n, m) [m] of all lines, from those (n, k) of the driven ones."""
    if robot.all_driven:
        return lengths
    out = np.tile(robot.rest_lengths, (len(lengths), 1))
    out[:, robot.driven] = lengths
    return out
