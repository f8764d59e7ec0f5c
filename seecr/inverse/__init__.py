"""Commands that correct: what to tell the winches so that the platform comes to wanted poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr.lazy import lazily

if TYPE_CHECKING:
    from seecr.inverse.correction import Correction, correct

__all__ = ["Correction", "correct"]

__getattr__ = lazily(__name__, dict.fromkeys(__all__, "correction"))
