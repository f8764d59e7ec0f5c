"""How this package compiles: kept on disk, without Python's lock."""

from __future__ import annotations

from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_NO_ENTRY: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

jit = njit(**_OPTIONS)
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does."""

jit_inner = njit(**_OPTIONS, **_NO_ENTRY)
"""The same for those that only compiled functions call: a fifth of the time of compiling went
into ways for Python to call them."""
