"""Effects that a real robot has and the paper's model does not; see :mod:`seecr.effects.base`."""

from __future__ import annotations

from seecr.effects.base import PLACES, Effect, Layout, Readings, parameter
from seecr.effects.knowledge import Knowledge
from seecr.effects.own_values import Apart, ApartLayout, Own, Values, apart
from seecr.effects.registry import BUILT_IN, catalogue, effect_named, layout_of
from seecr.effects.terms import Term, Terms

__all__ = [
    "BUILT_IN",
    "PLACES",
    "Apart",
    "ApartLayout",
    "Effect",
    "Knowledge",
    "Layout",
    "Own",
    "Readings",
    "Term",
    "Terms",
    "Values",
    "apart",
    "catalogue",
    "effect_named",
    "layout_of",
    "parameter",
]
