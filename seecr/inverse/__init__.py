"""Corrected commands: lengths to command so that the platform comes to rest at wanted poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr.lazy import lazily

if TYPE_CHECKING:
    from seecr.inverse.correction import correct
    from seecr.inverse.result import Correction

__all__ = ["Correction", "correct"]

__getattr__ = lazily(__name__, {"Correction": "result", "correct": "correction"})
