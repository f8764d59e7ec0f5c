"""Balance of platforms at given poses, linear in the cables' tensions about some rest lengths.

A tau = load holds exactly for tensions near those that the cables have with these lengths; a pull
whose direction depends on its size (sag, yielding exit points) bends it further off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from seecr.compiled.columns import EA, GAP, LIFT, REST, TENSION, WEIGHT
from seecr.holding.hanging import bridged_lengths, rest_for
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.tables import Tables

# Step of a rest length for its derivative, relative to the robot's length.
_STEP = 1e-5
# Rounds to how tight a cable hangs.
_TIGHTNESS = 60


@dataclass(eq=False)
class Rates:
    """How cables answer at n poses.

    Attributes:
        by_tension: (n, d, m) gradient by each cable's tension, torques over a length; zero of
            cables that do not pull.
        by_length: (n, m) [N/m] tension by rest length.
        pull: (n, d, m) [N/m] gradient by rest length.
    """

    by_tension: Array
    by_length: Array
    pull: Array

    def load(self, at: batch.Evaluation) -> Array:
        """What tensions have to make, (n, d) [N], by an evaluation with these rates."""
        made = np.einsum("ndm,nm->nd", self.by_tension, at.states[..., TENSION])
        return np.asarray(made - at.gradient)


def rates_of(tables: Tables, at: batch.Evaluation) -> Rates:
    """The rates of tables at an evaluation of them."""
    step = _STEP * tables.length
    force, tension = batch.change_by_cable(tables, tables.lengthened(-step), at)
    pulls = np.broadcast_to(tension[:, None, :] != 0.0, force.shape)
    each = np.divide(force, tension[:, None, :], out=np.zeros_like(force), where=pulls)
    return Rates(each, tension / step, force / step)


def with_rest(tables: Tables, rest: Array) -> Tables:
    """The same tables with other rest lengths (n, m) [m]."""
    cables = tables.cables.copy()
    cables[..., GAP] += cables[..., REST] - rest
    cables[..., REST] = rest
    return replace(tables, cables=cables)


def here(tables: Tables) -> batch.Evaluation:
    """The platform at the poses of the tables."""
    n, m = tables.cables.shape[:2]
    return batch.Evaluation.empty(n, m, tables.n_dof)


def first_tensions(tables: Tables, low: Array) -> Array:
    """Tensions (n, m) [N] to begin with: each cable's part of the load, or ``low``."""
    return np.asarray(np.maximum(low, tables.scale[:, None] / tables.cables.shape[1]))


def next_rest(tables: Tables, rest: Array, by_length: Array, now: Array, wanted: Array) -> Array:
    """Rest lengths (n, m) [m] that bring tensions from ``now`` near to ``wanted``, (n, m) [N].

    Not finite where a cable has no slope. At most by half and twice a length.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        # a plain cable's tension is linear in 1/l0: the slope over the step is exact
        slope = -by_length * rest * (rest - _STEP * tables.length)
        inverse = 1.0 / rest + (wanted - now) / slope * _hanging(tables, now, wanted)
        return np.asarray(rest / np.clip(inverse * rest, 0.5, 2.0))


def _hanging(tables: Tables, now: Array, wanted: Array) -> Array:
    """(n, m) by what Newton's steps change for cables that hang; one for those without weight.

    A parabola's strain is T/EA - (w l)^2/(24 T^2) (Irvine 1981, section 1.2): how much more or
    less of it lies between two tensions than its slope at the first says.
    """
    law, heavy = tables.cables, (tables.cables[..., WEIGHT] * bridged_lengths(tables)) ** 2
    some = (heavy > 0.0) & (now > 0.0) & (wanted > 0.0)
    old, new = np.where(some, now, 1.0), np.where(some, wanted, 1.0)
    between = 1.0 / law[..., EA] + heavy * (new + old) / (24.0 * (old * new) ** 2)
    slope = 1.0 / law[..., EA] + heavy / (12.0 * old**3)
    return np.where(some, between / slope, 1.0)


def loose_rest(tables: Tables, size: Array) -> tuple[Array, Array]:
    """Rest lengths (n, m) [m] of cables with weight by how tight they hang, ``size`` (n, m) [N].

    The measure is the pull with which a shallow parabola has that length. Other than the tension,
    which grows again where cables hang far through, it goes on falling as they get longer.

    Returns:
        the lengths and their derivatives [m/N].
    """
    law, way = tables.cables, bridged_lengths(tables)
    sag = (law[..., WEIGHT] * way) ** 2 / (24.0 * size**2)
    grown = 1.0 + size / law[..., EA]
    rest = way * (1.0 + sag) / grown
    return np.asarray(rest), np.asarray(
        -2.0 * way * sag / (size * grown) - rest / law[..., EA] / grown
    )


def tightness(tables: Tables, rest: Array) -> Array:
    """The measure (n, m) [N] of :func:`loose_rest` that rest lengths (n, m) [m] have.

    For cables about as tight as their weight, or tighter: by Newton's method from there.
    """
    weight = tables.cables[..., WEIGHT] * bridged_lengths(tables)
    size = np.where(weight > 0.0, weight, 1.0)
    for _ in range(_TIGHTNESS):
        found, slope = loose_rest(tables, size)
        size = np.maximum(size - (found - rest) / slope, 0.5 * size)
    return size


def bends(tables: Tables) -> bool:
    """Whether balance is not linear in tensions: some pull's direction depends on its size."""
    return bool(np.any(tables.cables[..., WEIGHT]) or np.any(tables.cables[..., LIFT]))


def balance_of(tables: Tables, low: Array, about: Array | None = None) -> tuple[Array, Array]:
    """Balance A tau = load at the poses of tables: (n, d, m) and (n, d) [N], torques over length.

    Linear in the tensions from those given, (n, m) [N], or from where the cables just pull. That
    matters where a pull's direction depends on its size only.
    """
    now = with_rest(
        tables, rest_for(tables, first_tensions(tables, low) if about is None else about)
    )
    at = batch.evaluate(now, here(now), threads=None)
    rates = rates_of(now, at)
    return rates.by_tension, rates.load(at)
