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


def signal_words(gain: Gain) -> str:
    """The signal now, after the measurement, and that which is needed, to two digits.

    The last is left out where the signal is as large now: prior sizes outweigh it.
    """
    # :g writes 2000, where :.2g alone writes 2e+03
    now, then = (f"{float(f'{value:.2g}'):g}" for value in (gain.now, gain.then))
    needed = f", {gain.needed:.2g} needed" if gain.now < gain.needed else ""
    return f"{now} now, {then} then{needed}"


def gain_words(gain: Gain) -> str:
    """What a measurement would gain, with numbers."""
    numbers = f"(signal {signal_words(gain)})"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"makes {gain.effect} visible {numbers}"
