"""How this package compiles: kept on disk, without Python's lock."""

from __future__ import annotations

from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

jit = njit(**_OPTIONS)
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does."""

jit_inner = njit(**_OPTIONS, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""The same for those that only compiled functions call: a quarter of the time of compiling all
went into ways for Python to call them."""
