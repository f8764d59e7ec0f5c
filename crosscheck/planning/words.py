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
        return "(a plausible size does not show)"
    return some(names)


def gain_words(gain: Gain) -> str:
    """What a measurement would gain, with numbers."""
    numbers = f"(signal now {gain.now:.2g}, then {gain.then:.2g}, needs {gain.needed:.2g})"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"shows {gain.effect} {numbers}"
