"""How this package compiles: kept on disk, without Python's lock."""

from __future__ import annotations

from numba import njit

jit = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does."""

jit_inner = njit(  # type: ignore[call-overload]
    cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True
)
"""The same for those that only compiled functions call: a fifth of the time of compiling went
into ways for Python to call them."""
