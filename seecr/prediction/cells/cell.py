"""One parameter in a model's file, and the position of mistakes in the file.

radius_m = 0.0099                                        # the value alone
radius_m = { value = 0.0099, stderr = 0.0001, unit = "m", at_bound = false }
radius_m = { value = 0.03, fixed = true }                # never fitted
radius_m = { known = { value = 0.03, stderr = 0.0005 } } # measured: a reading in every fit
"""

from __future__ import annotations

import difflib
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from seecr.effects.base import Layout, beyond
from seecr.errors import InputFileError
from seecr.pose import LARGEST

UNSEEN = "unseen"
"""Stands for an infinite standard error."""

_WORDS = ("value", "stderr", "unit", "at_bound", "fixed", "known")
_KNOWN = ("value", "stderr")


@dataclass(frozen=True)
class Where:
    """The file, for errors that name the line."""

    path: Path
    text: str

    def error(self, words: str, effect: int | None = None, key: str = "") -> InputFileError:
        """An error at the line of a key, within the k-th effect if one is given."""
        return InputFileError.at(self.path, words, line=self.line(effect, key))

    def line(self, effect: int | None, key: str) -> int | None:
        """The line of a key, or the line where its effect begins if the key is missing."""
        seen, found = -1, None
        for number, line in enumerate(self.text.splitlines(), start=1):
            bare = line.split("#")[0].strip().replace(" ", "")
            if bare == "[[effect]]":
                seen += 1
                if seen == effect:
                    found = number
            inside = effect is None or seen == effect
            if inside and key and (_is_key(bare, key) or bare.strip("[]").split(".")[-1] == key):
                return number
        return found


def _is_key(bare: str, key: str) -> bool:
    return bare.split("=")[0].strip("\"'").split(".")[-1].strip("\"'") == key and "=" in bare


@dataclass(frozen=True)
class Cell:
    """One parameter.

    Attributes:
        value, stderr: the standard error is inf if the data do not see the parameter, NaN if the
            file states none.
        fixed: whether it is never fitted.
        known: the value measured independently, else NaN; known_stderr: its standard error, else
            inf.
    """

    value: float
    stderr: float
    fixed: bool
    known: float = math.nan
    known_stderr: float = math.inf


def cell_of(where: Where, k: int, layout: Layout, i: int, content: Any, fixed: bool) -> Cell:
    """Read parameter i of effect k; ``fixed`` is what the effect states for all its parameters.

    Raises:
        InputFileError: not a number, out of bounds, another unit, an unknown key, or ``known``
            without its standard error.
    """
    return _Reader(where, k, layout, i).read(content, fixed)


@dataclass(frozen=True)
class _Reader:
    """Reads one parameter; every error names effect, parameter and line."""

    where: Where
    k: int
    layout: Layout
    i: int

    def read(self, content: Any, fixed: bool) -> Cell:
        table = content if isinstance(content, Mapping) else {"value": content}
        self._check_words(table, _WORDS, "")
        unit = table.get("unit", self.layout.units[self.i])
        if unit != self.layout.units[self.i]:
            raise self.error(f"expected unit {self.layout.units[self.i]!r}, got {unit!r}")
        fixed = fixed or self._fixed(table)
        known, spread = self._known(table, fixed)
        value = self._within(table.get("value", known if "known" in table else None), "")
        return Cell(value, self._stderr(table), fixed, known, spread)

    def error(self, words: str) -> InputFileError:
        key = self.layout.names[self.i]
        return self.where.error(f"effect {self.layout.name}: {key}: {words}", self.k, key)

    def _check_words(self, table: Mapping[str, Any], words: Sequence[str], of: str) -> None:
        for word in table:
            if word not in words:
                raise self.error(
                    f"unknown {word}{of}; expected {nearest_first(word, words)} (nearest first)"
                )

    def _within(self, given: Any, what: str) -> float:
        """A number within the parameter's bounds."""
        value = number_of(given)
        if value is None:
            got = "none" if given is None else f"{given!r:.60}"
            raise self.error(f"{what}expected a number, got {got}")
        if wrong := beyond(self.layout, self.i, value):
            raise self.error(f"{what}{wrong}")
        return value

    def _fixed(self, table: Mapping[str, Any]) -> bool:
        fixed = table.get("fixed", False)
        if not isinstance(fixed, bool):
            raise self.error(f"fixed must be true or false, got {fixed!r}")
        return fixed

    def _known(self, table: Mapping[str, Any], fixed: bool) -> tuple[float, float]:
        """The independently measured value, with its standard error."""
        if "known" not in table:
            return math.nan, math.inf
        known = table["known"]
        if not isinstance(known, Mapping) or set(_KNOWN) - set(known):
            raise self.error(
                "expected known = { value = ..., stderr = ... }: what was measured and its "
                f"standard error, got {_shown(known)}"
            )
        self._check_words(known, _KNOWN, " in known")
        if fixed:
            raise self.error("is both fixed and known; leave one of them out")
        error = number_of(known["stderr"])
        if error is None or not 0.0 < error <= LARGEST:
            raise self.error(
                f"known: stderr must be a number above 0 and at most {LARGEST:g}, got "
                f"{known['stderr']!r:.60}; a value that is exact is fixed = true"
            )
        return self._within(known["value"], "known: "), error

    def _stderr(self, table: Mapping[str, Any]) -> float:
        error = table.get("stderr", math.nan)
        if error == UNSEEN:
            return math.inf
        number = math.nan if error is math.nan else number_of(error)
        if number is None or number < 0 or number > LARGEST:
            raise self.error(
                f'stderr must be a number from 0 to {LARGEST:g} or "{UNSEEN}", got {error!r:.60}'
            )
        return number


def _shown(known: Any) -> str:
    if not isinstance(known, Mapping):
        return repr(known)
    return "{ " + ", ".join(f"{key} = {value}" for key, value in known.items()) + " }"


def nearest_first(word: str, words: Sequence[str]) -> str:
    """Words in one line, the most similar first."""
    likeness = {w: difflib.SequenceMatcher(None, word.lower(), w).ratio() for w in words}
    return ", ".join(sorted(words, key=lambda w: -likeness[w]))


def number_of(value: Any) -> float | None:
    """A finite number, or None if the value is not one."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    # a whole number may have any number of digits
    return float(value) if abs(value) <= sys.float_info.max else None
