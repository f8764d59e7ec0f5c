"""Numbers in sentences: with their nouns, and from one to another."""

from __future__ import annotations

__all__ = ["between", "counted", "plural"]


def counted(number: int, noun: str, form: str = "d") -> str:
    """A number with its noun: 1 row, 2 rows.

    Args:
        number: how many. noun: in the singular, one that takes an s. form: of the number.
    """
    return f"{number:{form}} {plural(number, noun)}"


def plural(number: int, noun: str) -> str:
    """A noun that takes an s, for so many."""
    return noun if number == 1 else f"{noun}s"


def between(low: float, high: float, form: str = ".4g", lead: str = "") -> str:
    """From one number to another, "0 to 3"; one, without what leads, where both read alike."""
    first, last = f"{low:{form}}", f"{high:{form}}"
    return first if first == last else f"{lead}{first} to {last}"
