"""Effects that a real robot has and the paper's model does not; see :mod:`seecr.effects.base`."""

from __future__ import annotations

from seecr.effects.base import PLACES, Effect, Knowledge, Layout, Readings, parameter
from seecr.effects.registry import (
    BUILT_IN,
    GivenEffect,
    catalogue,
    class_of,
    considered_of,
    effect_named,
    introduce,
    known,
    layout_of,
)
from seecr.effects.terms import Apart, ApartLayout, Own, Term, Terms, Values, apart

__all__ = [
    "BUILT_IN", "PLACES", "Apart", "ApartLayout", "Effect", "GivenEffect", "Knowledge", "Layout",
    "Own", "Readings", "Term", "Terms", "Values", "apart", "catalogue", "class_of", "considered_of",
    "effect_named", "introduce", "known", "layout_of", "parameter",
]  # fmt: skip
