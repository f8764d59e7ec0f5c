"""Which effects a model is missing."""

from __future__ import annotations

from crosscheck.diagnosis.found import found_effects

__all__ = ["found_effects"]
