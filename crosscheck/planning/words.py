"""The words of a plan that terminal and page share."""

from __future__ import annotations

from crosscheck.planning.proposer import Gain
from crosscheck.planning.result import Visible
from seecr.counted import some
from seecr.units import short


def alike(found: Visible) -> str:
    """Effects from which an effect cannot be told, exact twins first."""
    names = [f"{name} (exactly)" for name in found.twins]
    names += [name for name, _left in found.confused]
    if not found.visible and not found.twins:
        return "(not visible at a plausible size)"
    return some(names)


def gain_words(gain: Gain) -> str:
    """What a measurement would gain, with numbers."""
    now, then, needed = (short(value, 2) for value in (gain.now, gain.then, gain.needed))
    numbers = f"(signal {now} now, {then} then, {needed} needed)"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"makes {gain.effect} visible {numbers}"
