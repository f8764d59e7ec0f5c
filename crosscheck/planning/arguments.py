"""Arguments of planning from callers: limits of tensions, boxes, kinds of readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.planning.adding import Limits
from seecr.arguments import finite, numbers
from seecr.errors import InputError
from seecr.pose import Array

__all__ = ["box_given", "limits_given"]


def box_given(box: ArrayLike | None) -> Array | None:
    """A box (2, 3) [m], the lowest position first, or None.

    Raises:
        InputError: something else.
    """
    if box is None:
        return None
    array = finite(box, "box")
    if array.shape != (2, 3):
        raise InputError(
            f"box must be (2, 3) [m], the lowest and the highest x y z, got {array.shape}"
        )
    if np.any(array[0] > array[1]):
        k = int(np.argmax(array[0] > array[1]))
        raise InputError(
            f"box: expected the lowest position first, got {'xyz'[k]} from {array[0, k]:g} to "
            f"{array[1, k]:g} m"
        )
    return array


def limits_given(limits: ArrayLike) -> Limits:
    """The lowest and the highest tension [N].

    Raises:
        InputError: something else, or limits that contradict each other.
    """
    array = numbers(limits, "limits")
    if array.shape != (2,):
        raise InputError(
            f"limits must be two numbers, the lowest and the highest tension [N], got {limits!r}"
        )
    low, high = array.tolist()
    if not 0.0 <= low <= high or low == np.inf:
        raise InputError(
            f"limits must be 0 <= lowest <= highest [N], lowest finite, got {low:g} and {high:g}"
        )
    return low, high
