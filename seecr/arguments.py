"""Arguments from callers: numbers and counts, or a one-sentence error."""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import ArrayLike

from seecr.errors import InputError
from seecr.pose import LARGEST, Array, all_finite


class _Silent:
    """What functions tell their progress where nobody asked."""

    def __call__(self, *told: object) -> None:
        """Do nothing."""

    def __repr__(self) -> str:
        return "silent"


silent = _Silent()
"""The default of ``progress``: nothing is told. ``help`` shows it by this name."""


def numbers(values: ArrayLike, name: str) -> Array:
    """An array of real numbers; ``name`` is for errors.

    Raises:
        InputError: it is something else.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind == "c":  # NumPy would drop the imaginary part
            raise TypeError
        if isinstance(values, np.ma.MaskedArray):  # what is masked is no number
            return np.asarray(np.ma.filled(values.astype(float), np.nan))
        return np.asarray(array, dtype=float)
    except (OverflowError, TypeError, ValueError):
        got = repr(values) if isinstance(values, str) else f"a {type(values).__name__}"
        raise InputError(f"{name}: expected numbers, got {got}") from None


def finite(values: ArrayLike, name: str) -> Array:
    """An array of finite numbers; ``name`` is for errors.

    Raises:
        InputError: a number is not finite, or it is something else.
    """
    array = numbers(values, name)
    if not all_finite(array):
        raise InputError(
            f"{name} holds numbers that are not finite, or beyond {LARGEST:g}; expected finite ones"
        )
    return array


def whole(value: object, name: str, least: int = 0) -> int:
    """A whole number; ``name`` is for errors.

    Raises:
        InputError: less than the least, or not a whole number.
    """
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if number < least:
        raise InputError(f"{name}: expected a whole number from {least} on, got {value!r}")
    return number


def check_kind(value: object, kind: type, name: str, hint: str) -> None:
    """Check that an argument is of a class; ``hint`` says where one comes from.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(value, kind):
        package = kind.__module__.partition(".")[0]
        raise InputError(
            f"{name}: expected a {package}.{kind.__name__}, {hint}, got {type(value).__name__}"
        )
