"""Compares a model with measurements: its errors by coordinate, run, pose, region and cause."""

from __future__ import annotations

from crosscheck.comparison.limits import Exceeded, Limits, check, load_limits, with_options
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison

__all__ = [
    "Comparison",
    "Exceeded",
    "Limits",
    "check",
    "compare",
    "load_limits",
    "with_options",
]
