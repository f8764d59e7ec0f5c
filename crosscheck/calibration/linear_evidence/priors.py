"""Prior widths of effects, in plausible sizes."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import pairwise

import numpy as np

from crosscheck.fit.effects.evidence import WIDTHS
from crosscheck.fit.effects.registration import NAME as TRACKER
from seecr.effects import Terms
from seecr.effects.base import Layout
from seecr.pose import Array

# For what has no plausible size: the position of the tracker, and shapes.
FLAT, SHAPES = 300.0, 30.0
# For effects: more than 1 only if that raises the evidence clearly.
WIDER = (1.0, 3.0, 10.0)
# The position of the tracker has no plausible size, so its prior may be wider.
_TRACKER_WIDTHS = (*WIDTHS, 30.0, 100.0, 300.0)
# Values of size s lose ln(w/s) + (s/w)^2/2 - 1/2 of ln evidence each to a width w: between two of
# these widths up to 0.31, between closer ones 0.08. Of many values that is so much that a second
# group that acts the same was taken in to make up for it.
_FEW_VALUES = 12
_CLOSER_WIDTHS = tuple(sorted([*WIDTHS, *(math.sqrt(a * b) for a, b in pairwise(WIDTHS))]))


def widths_of(terms: Terms, free: Collection[str] = ()) -> Array:
    """(p,) prior standard deviations in plausible sizes; 0 for values that are fixed.

    Args:
        terms: effects. free: those whose values belong to the data, which no size is expected of.
    """
    return width_of(terms, dict.fromkeys((TRACKER, *free), FLAT))


def width_of(terms: Terms, widths: Mapping[str, float]) -> Array:
    """The same with other widths than 1, by the effect's name."""
    parts = [np.where(t.layout.shape, SHAPES, widths.get(t.name, 1.0)) for t in terms]
    return np.where(terms.knowledge.fixed, 0.0, np.concatenate([np.zeros(0), *parts]))


def wider(layout: Layout, free: Collection[str] = ()) -> Array:
    """The prior widths that an effect may be given; ``free`` as for :func:`widths_of`."""
    return np.array([FLAT] if layout.name in {TRACKER, *free} else WIDER)


def widths_for(layout: Layout, free: Collection[str] = ()) -> Array:
    """Prior widths of an effect over which its evidence is averaged.

    If it is ``free``, as for :func:`widths_of`, it has one. Otherwise sets in which others do what
    its values did would be preferred: a narrower prior would suffice there.
    """
    if layout.name in free:
        return np.array([FLAT])
    if layout.name == TRACKER:
        return np.array(_TRACKER_WIDTHS)
    return np.array(_CLOSER_WIDTHS if len(layout) > _FEW_VALUES else WIDTHS)
