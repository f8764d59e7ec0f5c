"""The nearest poses that tensions within limits can hold, where wanted ones cannot be held."""

from __future__ import annotations

from seecr.nearest.in_place import poses_in_place
from seecr.nearest.problem import Reaching
from seecr.nearest.search import Nearest, nearest

__all__ = ["Nearest", "Reaching", "nearest", "poses_in_place"]
