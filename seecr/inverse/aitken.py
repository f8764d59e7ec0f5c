"""Sequences that converge slowly, or swing: where they end (Aitken 1926), and how to calm them."""

from __future__ import annotations

import numpy as np

from seecr.pose import Array

# Changes in a ratio nearer to one than this do not tell where they end; and none is prolonged
# further than by this ratio.
_RATIO = 0.99
# Changes that swing and grow by more than this ratio are cut to a third, and no further.
_SWING = -2.0
# Parts of changes are halved where these do not fall by this factor, but not below the least part,
# and grow by a factor where they do. They are whole where changes fall by what was made of them, to
# this part: then all of it would have been right.
_FALLS, _LEAST, _GROWS, _NEARLY = 0.95, 0.1, 1.1, 0.09


def to_their_limit(change: Array, before: Array) -> Array:
    """The sum of the last change and all to come, if they go on in the ratio of the last two.

    Args:
        change: (...) the last change. before: (...) the one before.
    """
    some = (np.abs(change) < _RATIO * np.abs(before)) | (change * before < 0.0)
    ratio = np.divide(change, before, out=np.zeros_like(change), where=some)
    return np.asarray(change / (1.0 - np.clip(ratio, _SWING, _RATIO)))


def damped(part: Array, size: Array, before: Array) -> Array:
    """The parts (n,) of changes to make, smaller where changes do not become smaller.

    Args:
        part: (n,) the parts made last. size: (n,) of the changes now. before: (n,) of those before;
            infinite where the changes before were of another kind.
    """
    halved, grown = np.maximum(0.5 * part, _LEAST), np.minimum(_GROWS * part, 1.0)
    some = np.where(size > _FALLS * before, halved, grown)
    whole = np.isfinite(before) & (size <= (1.0 + _NEARLY - part) * before)
    return np.asarray(np.where(whole, 1.0, some))
