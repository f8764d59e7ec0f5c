"""Fits effects to measurements, and judges whether they are worth adding to a model."""

from __future__ import annotations

from crosscheck.add.fit import add_effect, add_effects
from crosscheck.add.weigh import Addition

__all__ = ["Addition", "add_effect", "add_effects"]
