"""A hanging cable as springs with point masses between, at rest where the catenary is.

A chain of n springs with equal masses differs from its catenary by one over n squared. With a
little more of the weight on the masses between, and less at the ends, most of that is gone. What
is left is taken away at the pose that the file is of: the chain is built from the anchor point up,
where it pulls as the catenary does, and the exit point moved to where it comes out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seecr.pose import Array

# Of Newton's method for a strain; four do.
_ROUNDS = 20


@dataclass(frozen=True)
class HangingCable:
    """The cable that a chain stands for, in its vertical plane: (across, up) from the exit point.

    Attributes:
        span: (2,) [m] where its anchor point is.
        pull: (2,) [N] of the cable on its anchor point.
        weight: [N] of its free part.
        length: [m] unstretched, of its free part.
        ea: [N].
        law: (3,) of its strain, and of the strain's square and cube: T = ea (law . (e, e^2, e^3)).
        radius: [m] of the sheave, whose centre is so far across; 0 without one.
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
    """A cable of n springs at rest, in its vertical plane.

    Attributes:
        places: (n - 1, 2) [m] of the masses, from the exit point on.
        between, end: [N] weight of each of them, and of what hangs at either end.
        tension: (n,) [N] of the springs, from the exit point on.
        strain: (n,) by which the cable's law stretches them.
        length: (n,) [m] of the springs, the uppermost from where it leaves its sheave.
        leaning: [rad] how far from straight down it leaves.
        beside: (2,) [m] from the exit point to where that of the chain is.
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
    """The chain of n springs that hangs as a catenary does.

    Masses between carry 1/sqrt(1 - 1/n^2) of their equal share: so the mean square of the springs'
    pull across a taut cable is that of the catenary, and with it what sag takes off its span (our
    own). HangingChain are as long as the catenary's law has them, linear but for what is in series.
    """
    between = cable.weight / np.sqrt(n**2 - 1.0)
    force = np.tile(cable.pull, (n, 1))
    # whatever the masses between carry, the middle of the cable carries half
    force[:, 1] += 0.5 * cable.weight + between * (np.arange(n) - 0.5 * (n - 1))
    tension = np.hypot(force[:, 0], force[:, 1])
    along = force / tension[:, None]
    length = cable.length / n * (1.0 + tension / cable.ea)
    places = cable.span + np.cumsum(length[:-1, None] * along[:-1], axis=0)
    # the line of the uppermost spring touches the sheave, or goes through the exit point
    last, way = along[-1], np.array([cable.radius, 0.0]) - places[-1]
    off = way[0] * last[1] - way[1] * last[0] + cable.radius
    length[-1] = way @ last
    return HangingChain(
        places[::-1], between, 0.5 * (cable.weight - (n - 1) * between), tension[::-1],
        _strain(cable, tension[::-1]), length[::-1], float(np.arctan2(-last[0], last[1])),
        off * np.array([-last[1], last[0]]),
    )  # fmt: skip


def _strain(cable: HangingCable, tension: Array) -> Array:
    """Strains (n,) at which the law gives tensions (n,) [N]: Newton's method from the straight."""
    by, square, cube = cable.law
    strain = tension / cable.ea
    if square or cube:
        for _ in range(_ROUNDS):
            over = strain * (by + strain * (square + strain * cube)) - tension / cable.ea
            strain = strain - over / (by + strain * (2.0 * square + strain * 3.0 * cube))
    return np.asarray(strain)
