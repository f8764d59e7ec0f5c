"""The nearest poses that tensions within limits can hold, for wanted poses that cannot be held."""

from __future__ import annotations

from seecr.inverse.nearest.in_place import poses_in_place
from seecr.inverse.nearest.problem import Reaching
from seecr.inverse.nearest.search import Nearest, nearest

__all__ = ["Nearest", "Reaching", "nearest", "poses_in_place"]
