"""Sensitivities to where cables begin and end, and to their rest lengths.

A cable's pull depends on its rest length and on where its anchor point B is as seen from its exit
point A. So the derivatives by A, by B and by l0 all follow from one evaluation of each cable
(:mod:`seecr.compiled.rates`): with F its force on the platform and K = -dF/dB,

    dF = -K (dB - dA) + dF/dl0 dl0,   dM = (B - p) x dF + (dB in the platform) x F,

where dA and dB move the points, and M is the moment about the platform's origin p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seecr.compiled.columns import (
    ARM,
    BY_REST,
    FORCE,
    RADIUS,
    SLOPE,
    STIFFNESS,
    TENSION_BY_REST,
    WEIGHT,
)
from seecr.pose import Array, cross
from seecr.statics.tables import Tables


@dataclass(frozen=True, eq=False)
class CableRates:
    """What cables pull with at n poses, and how that changes.

    Attributes:
        table: (n, m, N_RATES), see :func:`seecr.statics.batch.rates_of_cables`.
    """

    table: Array

    @property
    def force(self) -> Array:
        """(n, m, 3) [N] on the platform."""
        return self.table[..., FORCE : FORCE + 3]

    @property
    def stiffness(self) -> Array:
        """(n, m, 3, 3) [N/m] minus its derivative by the anchor point."""
        return self.table[..., STIFFNESS : STIFFNESS + 9].reshape(*self.table.shape[:2], 3, 3)

    @property
    def slope(self) -> Array:
        """(n, m, 3) [N/m] derivative of the tension by the anchor point."""
        return self.table[..., SLOPE : SLOPE + 3]

    @property
    def arm(self) -> Array:
        """(n, m, 3) [m] anchor point as seen from the platform's origin, base axes."""
        return self.table[..., ARM : ARM + 3]

    @property
    def force_by_rest(self) -> Array:
        """(n, m, 3) [N/m] derivative of the force by the rest length."""
        return self.table[..., BY_REST : BY_REST + 3]

    @property
    def tension_by_rest(self) -> Array:
        """(n, m) [N/m] derivative of the tension by the rest length."""
        return self.table[..., TENSION_BY_REST]


def are_by_point(tables: Tables) -> bool:
    """Whether the stiffness of all cables is minus the derivative of their force.

    Of heavy cables over pulleys it is the symmetric part of that.
    """
    heavy, over = tables.cables[..., WEIGHT] > 0.0, tables.cables[..., RADIUS] > 0.0
    return not bool(np.any(heavy & over))


def wrench_by_rest(rates: CableRates) -> Array:
    """(n, 6, m) derivative of the wrench [N, N m] by each cable's rest length."""
    force = rates.force_by_rest
    return _wrench(force, cross(rates.arm, force))


def wrench_by_ends(
    rates: CableRates, exit_moves: Array, anchor_moves: Array, longer: Array
) -> tuple[Array, Array]:
    """Change of the wrench (n, 6, m) by each cable, and of its own tension (n, m).

    Args:
        rates: of the cables.
        exit_moves: (m, 3) how the exit points move. anchor_moves: (n, m, 3) the anchor points on
            the platform; both in base axes.
        longer: (n, m) how much longer the cables become.
    """
    move = anchor_moves - exit_moves
    force = rates.force_by_rest * longer[..., None]
    force = force - (rates.stiffness @ move[..., None])[..., 0]
    moment = cross(rates.arm, force) + cross(anchor_moves, rates.force)
    tension = np.sum(rates.slope * move, axis=2) + rates.tension_by_rest * longer
    return _wrench(force, moment), tension


def _wrench(force: Array, moment: Array) -> Array:
    """Forces and moments (n, m, 3) as wrenches (n, 6, m)."""
    return np.swapaxes(np.concatenate([force, moment], axis=2), 1, 2)
