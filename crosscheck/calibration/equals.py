"""When two effects are equals: the data cannot tell which of them is missing."""

from __future__ import annotations

from seecr.effects.base import Layout

# Effects whose exchange costs less evidence than this are equals.
EQUAL = 3.0
# A small effect (of up to so many parameters) with one more costs about so much evidence though it
# explains the same: a frame that yields alike in all directions is a cable behind the exit point,
# and has two numbers.
SMALL, _ONE_MORE = 3, 3.0


def are_equals(loss: float, own: int, other: int) -> bool:
    """Whether an effect of ``other`` parameters in place of one of ``own`` explains as well.

    Args:
        loss: evidence lost by the exchange.
        own, other: numbers of parameters.
    """
    more = max(0, other - own) if other <= SMALL else 0
    return loss < EQUAL + _ONE_MORE * more


def parameters_told(layout: Layout) -> int:
    """Parameters of an effect that say what others do not: of a small one that contains another.

    Friction comes with cable behind the exit point; that it has two numbers is no excuse for it
    to explain less than the cable alone.
    """
    inner = layout.effect.parent
    return 1 if inner and len(layout) <= SMALL else len(layout)
