"""Functions that only compiled functions can call, for tests of them: they have no wrapper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def from_python(function: Any) -> Callable[..., Any]:
    """The same function, with a wrapper for calls from Python."""

    @njit  # type: ignore[misc]
    def call(*given):  # type: ignore[no-untyped-def]
        return function(*given)

    return call  # type: ignore[no-any-return]
