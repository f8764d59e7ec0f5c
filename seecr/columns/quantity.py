"""The parts of a column's name: a quantity and, after the last underscore, its unit."""

from __future__ import annotations

import re

__all__ = ["QUANTITY", "is_number"]

QUANTITY = re.compile(
    r"(t|temperature|run|(?:cmd|meas|want)_(?:q[wxyz]|r?[xyz])|(?:length|tension)_\d+"
    r"|payload(?:_[xyz])?|(?:force|moment)_[xyz])(?:_([^_]*))?"
)


def is_number(name: str) -> bool:
    """Whether a column of that name holds numbers that are read; runs have names."""
    found = QUANTITY.fullmatch(name.strip())
    return found is not None and found[1] != "run"
