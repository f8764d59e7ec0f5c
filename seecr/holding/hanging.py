"""Cables with weight: their least tensions, and approximate lengths for given tensions.

The lengths are those of inextensible catenaries, then stretched as their law and history say:
starting values for Newton's method.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.columns import FRICTION, GAP, REST, UP, WEIGHT
from seecr.parallel import in_parts
from seecr.pose import Array
from seecr.statics.tables import Tables, ways

# Least mean tension [weight of the cable], and the largest bend of a catenary, that are considered.
_LEAST, _MOST_BENT = 0.8, 1.0
# Newton steps to a bend.
_ROUNDS = 5


def bridged_lengths(tables: Tables) -> Array:
    """(n, m) [m] lengths of straight, unstrained cables at the poses of tables."""
    return np.asarray(tables.cables[..., REST] + tables.cables[..., GAP])


def least_of_heavy(tables: Tables) -> Array:
    """(n, m) [N] tensions that cables with weight are not asked to go below; zero for others.

    The tension in the middle is then the cable's weight, as of a catenary that sags by about a
    seventh of its span. At the exit point it is larger by half the weight if that is straight above
    the anchor point, and smaller by half if it is straight below. No catenary has less than about
    three quarters of that in the middle.
    """
    weight = _weights(tables)
    if not weight.any():
        return weight
    return np.asarray(weight * (1.0 + 0.5 * _rises(tables)))


def _weights(tables: Tables) -> Array:
    """(n, m) [N]."""
    return np.asarray(tables.cables[..., WEIGHT] * bridged_lengths(tables))


def rest_for(tables: Tables, tensions: Array) -> Array:
    """(n, m) [m] rest lengths with which cables have these tensions (n, m) [N].

    They are exact for cables without weight, and approximate for others.
    """
    bridged, weight = bridged_lengths(tables), _weights(tables)
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
    there until the cable slips.

    Args:
        tables: with the cables' history at the rest lengths there.
        rest: (n, m) [m] rest lengths with which cables would have these tensions if those behind
            exit points stayed as they are.
        tensions: (n, m) [N].
    """
    if not tables.cables[..., FRICTION].any():
        return rest
    from seecr.compiled.rates import stretched_lengths  # takes a while to import

    spans, there = np.empty_like(rest), tables.cables.copy()
    there[..., REST] = rest
    pulls = np.array(tensions, order="C")

    def run(part: slice) -> None:
        stretched_lengths(there[part], pulls[part], spans[part])

    in_parts(run, len(spans))
    return _straight_rest(tables, spans, tensions, follows=True)


def _straight_rest(tables: Tables, spans: Array, tensions: Array, follows: bool = False) -> Array:
    """(n, m) [m] rest lengths with which straight cables over these spans have these tensions."""
    from seecr.compiled.rates import rest_lengths_for  # takes a while to import

    out, pulls = np.empty_like(spans), np.array(tensions, order="C")

    def run(part: slice) -> None:
        rest_lengths_for(tables.cables[part], spans[part], pulls[part], follows, out[part])

    in_parts(run, len(spans))
    return out


def _arcs(light: Array, rise: Array) -> Array:
    """Lengths of catenaries over the straight distances that they span.

    With the bend g = w x/(2 H), for spans x and rises z, l^2 = z^2 + (x sinh(g)/g)^2, and the mean
    of the tensions at both ends is w l coth(g)/2 (Irvine 1981, section 1.2): one equation for g.

    Args:
        light: half of the weight over the mean tension.
        rise: over the straight distance.
    """
    flat = 1.0 - rise**2
    bend = np.clip(light, 1e-6, _MOST_BENT)
    for _ in range(_ROUNDS):
        arc, by_arc, over, by_over = _bent(bend, rise, flat)
        slope = 1.0 - light * (over * by_arc + by_over * arc)
        bend = np.clip(
            bend - (bend - light * over * arc) / np.maximum(slope, 0.1), 1e-6, _MOST_BENT
        )
    return np.where(light > 0.0, _bent(bend, rise, flat)[0], 1.0)


def _bent(bend: Array, rise: Array, flat: Array) -> tuple[Array, Array, Array, Array]:
    """Arc over distance, g coth(g), and the derivatives of both by g."""
    sinh = np.sinh(bend)
    longer, over = sinh / bend, bend * np.cosh(bend) / sinh
    arc = np.sqrt(rise**2 + flat * longer**2)
    by_arc = flat * longer * (np.cosh(bend) - longer) / (bend * arc)
    return arc, by_arc, over, over / bend - bend / sinh**2


def _rises(tables: Tables) -> Array:
    """(n, m) height of exit points above anchor points, over the distance between them."""
    way = ways(tables)
    up = tables.load[:, None, UP : UP + 3]
    spans = np.linalg.norm(way, axis=2)
    # a cable without a span, its anchor point at its exit point, has no direction: it hangs level
    return np.asarray(-(way * up).sum(axis=2) / np.where(spans > 0.0, spans, 1.0))
