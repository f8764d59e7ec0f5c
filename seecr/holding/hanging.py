"""Cables that hang: the tension each needs at least, and how long they are about for a tension.

Lengths are those of catenaries that do not stretch, stretched: Newton's method begins here.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.columns import ANCHOR, EA, EXIT, GAP, REST, UP, WEIGHT
from seecr.pose import Array, quat_to_matrix
from seecr.statics.tables import Tables

# Least of the mean tension, in weights of the cable, and the most bend that are looked at.
_LEAST, _MOST_BENT = 0.8, 1.0
# Newton's steps to a bend.
_ROUNDS = 5


def bridged_lengths(tables: Tables) -> Array:
    """(n, m) [m] lengths of straight cables without strain at the poses of tables."""
    return np.asarray(tables.cables[..., REST] + tables.cables[..., GAP])


def least_of_heavy(tables: Tables) -> Array:
    """(n, m) [N] tensions that cables with weight are not asked to go below. Zero of others.

    In the middle it is what the cable weighs: a catenary that sags by about a seventh of its span.
    At the exit point half of what it weighs is more where that lies straight above the anchor
    point, half of it less where it lies below. There are no catenaries with less than some three
    quarters of that in the middle.
    """
    weight = _weights(tables)
    if not weight.any():
        return weight
    return np.asarray(weight * (1.0 + 0.5 * _rises(tables)))


def _weights(tables: Tables) -> Array:
    """(n, m) [N]."""
    return np.asarray(tables.cables[..., WEIGHT] * bridged_lengths(tables))


def rest_for(tables: Tables, tensions: Array) -> Array:
    """(n, m) [m] rest lengths with which cables have about these tensions (n, m) [N]."""
    bridged, weight = bridged_lengths(tables), _weights(tables)
    if not weight.any():
        return np.asarray(bridged / (1.0 + tensions / tables.cables[..., EA]))
    rise = _rises(tables)
    # the tension at the exit point carries what hangs below it
    mean = tensions - 0.5 * weight * rise
    arcs = _arcs(0.5 * weight / np.maximum(mean, np.maximum(_LEAST * weight, 1e-300)), rise)
    return np.asarray(bridged * arcs / (1.0 + np.maximum(mean, 0.0) / tables.cables[..., EA]))


def _arcs(light: Array, rise: Array) -> Array:
    """Lengths of catenaries over the ways that they bridge.

    With the bend g = w x/(2 H), over spans x and rises z, l^2 = z^2 + (x sinh(g)/g)^2, and the mean
    of the tensions at both ends is w l coth(g)/2 (Irvine 1981, section 1.2): one equation for g.

    Args:
        light: half of the weight over the mean tension.
        rise: over the way bridged.
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
    """Arcs over ways, g coth(g), and the rates of both by g."""
    sinh = np.sinh(bend)
    longer, over = sinh / bend, bend * np.cosh(bend) / sinh
    arc = np.sqrt(rise**2 + flat * longer**2)
    by_arc = flat * longer * (np.cosh(bend) - longer) / (bend * arc)
    return arc, by_arc, over, over / bend - bend / sinh**2


def _rises(tables: Tables) -> Array:
    """(n, m) how far exit points lie above anchor points, over the way between them."""
    turn = quat_to_matrix(tables.poses[:, 3:])
    anchors = tables.cables[..., ANCHOR : ANCHOR + 3] @ np.swapaxes(turn, 1, 2)
    ways = tables.cables[..., EXIT : EXIT + 3] - tables.poses[:, None, :3] - anchors
    up = tables.load[:, None, UP : UP + 3]
    return np.asarray((ways * up).sum(axis=2) / np.linalg.norm(ways, axis=2))
