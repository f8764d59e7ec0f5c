"""The words of a plan that terminal and page share."""

from __future__ import annotations

from crosscheck.planning.proposer import Gain
from crosscheck.planning.result import Visible
from seecr.counted import some


def alike(found: Visible) -> str:
    """Effects from which an effect cannot be told, exact twins first."""
    names = [f"{name} (exactly)" for name in found.twins]
    names += [name for name, _left in found.confused]
    if not found.visible and not found.twins:
        return "(not visible at a plausible size)"
    return some(names)


def gain_words(gain: Gain) -> str:
    """What a measurement would gain, with numbers."""
    numbers = f"(signal {gain.now:.2g} now, {gain.then:.2g} then, {gain.needed:.2g} needed)"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"makes {gain.effect} visible {numbers}"
