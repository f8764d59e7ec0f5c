"""Errors in words."""

from __future__ import annotations

from crosscheck.fit.problem import KINDS, Rms
from seecr.units import short


def rms_words(rms: Rms) -> str:
    """The rms errors in a few words, such as "0.0309 mm, 0.0202 deg"."""
    parts = [
        f"{short(value * kind.factor)} {kind.unit}"
        for kind in KINDS
        if (value := rms.get(kind.key)) is not None
    ]
    return ", ".join(parts)


def belongs(key: str, name: str, unit: str) -> bool:
    """Whether a parameter, such as ``gain_3``, belongs to an effect's field with that unit."""
    stem = key.removesuffix(f"_{unit}") if unit else key
    return stem == name or (stem.startswith(f"{name}_") and len(stem) > len(name) + 1)
