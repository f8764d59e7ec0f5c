"""The nearest poses that tensions within limits can hold, where wanted ones cannot be held."""

from __future__ import annotations

from seecr.nearest.search import Nearest, nearest

__all__ = ["Nearest", "nearest"]
