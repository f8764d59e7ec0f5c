"""Numbers in sentences: with nouns, as ranges, and long lists cut short."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# An end of a range that is smaller than this part of the other one is what rounding leaves of 0.
_ROUNDING = 1e-12


def counted(number: int, noun: str, form: str = "d") -> str:
    """A number with its noun: 1 row, 2 rows.

    Args:
        number: how many. noun: in the singular, with a plural in s. form: format of the number.
    """
    return f"{number:{form}} {plural(number, noun)}"


def plural(number: int, noun: str) -> str:
    """A noun with a plural in s, for so many."""
    return noun if number == 1 else f"{noun}s"


def between(low: float, high: float, form: str = ".4g", lead: str = "") -> str:
    """A range such as "0 to 3", after ``lead``; if both ends read the same, only that number."""
    least = _ROUNDING * max(abs(low), abs(high))
    first, last = (figures(0 if abs(end) < least else end, form) for end in (low, high))
    return first if first == last else f"{lead}{first} to {last}"


def figures(number: float, form: str) -> str:
    """A number in a format, where nothing of it is left without its minus: 0.000, never -0.000."""
    text = f"{number:{form}}"
    return text if float(text) else f"{0:{form}}"


def some(words: Sequence[str], most: int = 4, mark: str = ", ") -> str:
    """The first few words, and how many more: a, b and 3 more, or a; b; and 3 more."""
    more = len(words) - most
    if more <= 0:
        return mark.join(words)
    lead = " " if mark == ", " else mark
    return f"{mark.join(words[:most])}{lead}and {more} more"


def rows_words(rows: Iterable[int], line: NDArray[np.int64] | None) -> str:
    """The names of rows: their lines in a file; without a file pose 3, counted from 0.

    Args:
        rows: counted from 0. line: (n,) line of each row in the file.
    """
    numbers = [str(row if line is None else line[row]) for row in rows]
    return f"{plural(len(numbers), 'pose' if line is None else 'line')} {some(numbers, 8)}"
