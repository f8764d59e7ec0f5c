"""A hanging cable as a chain of springs with point masses, in equilibrium where the catenary is.

A chain of n springs with equal masses deviates from its catenary by an error of order 1/n^2. Most
of that vanishes if the masses between carry a little more of the weight and the ends a little less.
The rest is removed at the pose of the file: the chain is built up from the anchor point, with the
catenary's pull there, and the exit point is moved to where the chain ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seecr.pose import Array

# Most Newton steps to a strain; four suffice.
_ROUNDS = 20


@dataclass(frozen=True)
class HangingCable:
    """The cable that a chain replaces, in its vertical plane: (across, up) from the exit point.

    Attributes:
        span: (2,) [m] position of its anchor point.
        pull: (2,) [N] of the cable on its anchor point.
        weight: [N] of its free part.
        length: [m] unstretched, of its free part.
        ea: [N].
        law: (3,) coefficients of the strain, its square and its cube:
            T = ea (law . (e, e^2, e^3)).
        radius: [m] of the sheave, whose centre is at (radius, 0); 0 without one.
    """

    span: Array
    pull: Array
    weight: float
    length: float
    ea: float
    law: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class HangingChain:
    """A chain of n springs in equilibrium, in its vertical plane.

    Attributes:
        places: (n - 1, 2) [m] of the masses, from the exit point on.
        between, end: [N] weight of each mass, and of those at either end.
        tension: (n,) [N] of the springs, from the exit point on.
        strain: (n,) at which the cable's law has these tensions.
        length: (n,) [m] of the springs, the uppermost from where it leaves its sheave.
        leaning: [rad] angle from straight down at which it leaves.
        beside: (2,) [m] from the exit point to that of the chain.
    """

    places: Array
    between: float
    end: float
    tension: Array
    strain: Array
    length: Array
    leaning: float
    beside: Array


def hanging(cable: HangingCable, n: int) -> HangingChain:
    """The chain of n springs that hangs like a catenary.

    Each mass between carries 1/sqrt(1 - 1/n^2) of an equal share. Then the mean square of the
    springs' pull across a taut cable is that of the catenary, and so is the loss of span by sag
    (our own derivation). Springs have the catenary's length for a linear law; nonlinear parts are
    in series.
    """
    between = cable.weight / np.sqrt(n**2 - 1.0)
    force = np.tile(cable.pull, (n, 1))
    # whatever the masses between carry, the middle of the cable carries half the weight
    force[:, 1] += 0.5 * cable.weight + between * (np.arange(n) - 0.5 * (n - 1))
    tension = np.hypot(force[:, 0], force[:, 1])
    along = force / tension[:, None]
    length = cable.length / n * (1.0 + tension / cable.ea)
    places = cable.span + np.cumsum(length[:-1, None] * along[:-1], axis=0)
    # the line of the uppermost spring touches the sheave, or passes through the exit point
    last, way = along[-1], np.array([cable.radius, 0.0]) - places[-1]
    off = way[0] * last[1] - way[1] * last[0] + cable.radius
    length[-1] = way @ last
    return HangingChain(
        places[::-1], between, 0.5 * (cable.weight - (n - 1) * between), tension[::-1],
        _strain(cable, tension[::-1]), length[::-1], float(np.arctan2(-last[0], last[1])),
        off * np.array([-last[1], last[0]]),
    )  # fmt: skip


def _strain(cable: HangingCable, tension: Array) -> Array:
    """Strains (n,) at which the law gives tensions (n,) [N], by Newton's method."""
    by, square, cube = cable.law
    strain = tension / cable.ea
    if square or cube:
        for _ in range(_ROUNDS):
            over = strain * (by + strain * (square + strain * cube)) - tension / cable.ea
            strain = strain - over / (by + strain * (2.0 * square + strain * 3.0 * cube))
    return np.asarray(strain)
