"""Sequences that converge slowly, or swing: where they end (Aitken 1926)."""

from __future__ import annotations

import numpy as np

from seecr.pose import Array

# Changes in a ratio nearer to one than this do not tell where they end; and none is prolonged
# further than by this ratio.
_RATIO = 0.99
# Changes that swing and grow by more than this ratio are cut to a third, and no further.
_SWING = -2.0


def to_their_limit(change: Array, before: Array) -> Array:
    """The sum of the last change and all to come, if they go on in the ratio of the last two.

    Args:
        change: (...) the last change. before: (...) the one before.
    """
    some = (np.abs(change) < _RATIO * np.abs(before)) | (change * before < 0.0)
    ratio = np.divide(change, before, out=np.zeros_like(change), where=some)
    return np.asarray(change / (1.0 - np.clip(ratio, _SWING, _RATIO)))
