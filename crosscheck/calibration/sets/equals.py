"""Equivalent effects: the data cannot tell which of them is missing."""

from __future__ import annotations

from seecr.effects.base import Layout

# Two effects are equivalent if exchanging them costs less ln evidence than this.
EQUAL = 3.0
# An effect of up to SMALL parameters may cost so much more ln evidence for each additional
# parameter: a frame that yields equally in all directions acts like cable behind the exit point,
# but has two parameters.
SMALL, _ONE_MORE = 3, 3.0
# A difference in ln evidence below this, half of 25 in chi2, may be chance: a set that is worse by
# no more explains as much.
BY_CHANCE = 12.5


def are_equals(loss: float, own: int, other: int) -> bool:
    """Whether an effect of ``other`` parameters explains as well in place of one of ``own``.

    Args:
        loss: ln evidence that the exchange costs.
        own, other: numbers of parameters.
    """
    more = max(0, other - own) if other <= SMALL else 0
    return loss < EQUAL + _ONE_MORE * more


def parameters_counted(layout: Layout) -> int:
    """The number of parameters for :func:`are_equals`: 1 for a small effect that contains another.

    Friction at the exit point includes cable behind that point. Its second parameter is no excuse
    for explaining less than that cable alone.
    """
    inner = layout.effect.parent
    return 1 if inner and len(layout) <= SMALL else len(layout)
