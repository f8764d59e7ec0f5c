"""Compares a model with measurements: its errors by coordinate, run, pose, region and cause."""

from __future__ import annotations

from crosscheck.comparison.limits import Exceeded, Limits, exceeded, load_limits
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison

__all__ = [
    "Comparison",
    "Exceeded",
    "Limits",
    "compare",
    "exceeded",
    "load_limits",
]
