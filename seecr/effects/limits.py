"""How large the values of an effect may be, in a model's file or by name.

Most parameters have physical bounds in their effect; these limits are for the others. They are far
beyond anything that a robot can have, so they only stop typing errors, units and damaged files,
whose squares the solver could not even compute.
"""

from __future__ import annotations

import numpy as np

from seecr.effects.base import Layout

# A value may differ from null by so many plausible sizes, an angle by one full turn. What a tracker
# reads may be in the coordinates of its hall.
_SIZES, _SIZES_READ, _TURN = 1e4, 1e5, 2.0 * np.pi


def range_of(layout: Layout, i: int) -> tuple[float, float]:
    """The lowest and the highest value that parameter i may have."""
    lower, upper = float(layout.lower[i]), float(layout.upper[i])
    if layout.shape[i]:  # its bounds are its search range
        return lower, upper
    sizes = _SIZES_READ if layout.effect.place == "sensing" else _SIZES
    most = _TURN if layout.units[i] == "rad" else sizes * float(layout.scale[i])
    null = float(layout.null[i])
    return max(lower, null - most), min(upper, null + most)


def beyond(layout: Layout, i: int, value: float) -> str:
    """What is wrong with a value that parameter i cannot have; "" if nothing is."""
    low, high = range_of(layout, i)
    if low <= value <= high:
        return ""
    return f"{value:g} is out of bounds; expected {low:g} to {high:g}"
