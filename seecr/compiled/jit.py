"""The one way in which this package compiles: kept on disk, without Python's lock."""

from __future__ import annotations

from numba import njit

jit = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does."""
