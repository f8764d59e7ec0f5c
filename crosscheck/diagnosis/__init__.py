"""Diagnoses which effects a model is missing."""

from __future__ import annotations

from crosscheck.diagnosis.found import found_covariance, found_effects, refitted

__all__ = ["found_covariance", "found_effects", "refitted"]
