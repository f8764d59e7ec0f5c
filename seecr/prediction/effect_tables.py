"""How a model's file states an effect and its parameters; positions of mistakes in the file.

radius_m = 0.0099                                        # the value alone
radius_m = { value = 0.0099, stderr = 0.0001, unit = "m", at_bound = false }
radius_m = { value = 0.03, fixed = true }                # never fitted
radius_m = { known = { value = 0.03, stderr = 0.0005 } } # measured: a reading in every fit
"""

from __future__ import annotations

import copy
import difflib
import math
import sys
from collections.abc import Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit

from seecr.counted import plural, some
from seecr.effects import Knowledge, Own, Term, Values, layout_of
from seecr.effects.base import Layout, beyond
from seecr.effects.terms import KINDS
from seecr.errors import InputError, InputFileError
from seecr.pose import LARGEST, Array

if TYPE_CHECKING:
    from seecr.description.robot import Robot


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
    """One parameter; its error is inf if the data do not see it, NaN if none is stated.

    ``known`` is the value measured independently, else NaN, ``known_stderr`` its error, else inf.
    """

    value: float
    stderr: float
    fixed: bool
    known: float = math.nan
    known_stderr: float = math.inf


@dataclass(frozen=True)
class Reader:
    """Reads parameter i of effect k; every error names effect, parameter and line."""

    where: Where
    k: int
    layout: Layout
    i: int

    def read(self, content: Any, fixed: bool) -> Cell:
        """The parameter; ``fixed`` is what the effect states for all its parameters.

        Raises:
            InputFileError: not a number, out of bounds, another unit, an unknown key, or ``known``
                without its standard error.
        """
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


# One effect in a model's file.

_MOST_NAMED = 8
_OF_EFFECT = (
    "name", "fixed", "per_file", "per_run", "parameters", "of", "provenance", "refitted", "before",
    "after", "held_out",
)  # fmt: skip


def term_of(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> tuple[Term, Array]:
    """Effect k of the file with its values, and their standard errors (p,).

    Raises:
        InputFileError: an effect or parameter is unknown, missing, not a number or out of bounds.
    """
    layout = _layout(where, k, table, robot)
    kind = _kind(where, k, table, layout)
    given = table.get("parameters", {} if kind else None)
    if not isinstance(given, Mapping):
        raise where.error(
            f"effect {layout.name}: expected a table [effect.parameters] with "
            f"{some(layout.names, _MOST_NAMED)}", k,
        )  # fmt: skip
    fixed = _flag(where, k, table, layout, "fixed")
    if kind and not given:
        given = dict(zip(layout.names, layout.null.tolist(), strict=True))
    rest = _values(where, k, layout, given, fixed)
    own = _own(where, k, layout, table, kind, fixed)
    return Term(layout, rest.vector, rest.knowledge, own), rest.stderr


def _flag(where: Where, k: int, table: Mapping[str, Any], layout: Layout, key: str) -> bool:
    value = table.get(key, False)
    if not isinstance(value, bool):
        text = f"effect {layout.name}: {key} must be true or false, got {value!r}"
        raise where.error(text, k, key)
    return value


def _kind(where: Where, k: int, table: Mapping[str, Any], layout: Layout) -> str:
    """Whether the effect has values of its own for each "file" or "run", else ""."""
    said = [kind for kind in KINDS if _flag(where, k, table, layout, f"per_{kind}")]
    if len(said) > 1:
        text = "is both per_file and per_run; leave per_file out: each run has its own then"
        raise where.error(f"effect {layout.name}: {text}", k, "per_file")
    if "of" in table and not said:
        text = "has values of files or runs, but neither per_file = true nor per_run = true; add it"
        raise where.error(f"effect {layout.name}: {text}", k, "of")
    return said[0] if said else ""


def _own(
    where: Where, k: int, layout: Layout, table: Mapping[str, Any], kind: str, fixed: bool
) -> Own | None:
    """The values for each file or run that the model knows."""
    if not kind:
        return None
    tables = table.get("of", {})
    fine = isinstance(tables, Mapping) and all(isinstance(t, Mapping) for t in tables.values())
    if not fine:
        text = f'of: expected a table for each {kind}, such as [effect.of."monday/measured.csv"]'
        raise where.error(f"effect {layout.name}: {text}", k, "of")
    return Own(kind, {str(n): _values(where, k, layout, t, fixed) for n, t in tables.items()})


def _values(where: Where, k: int, layout: Layout, given: Mapping[str, Any], fixed: bool) -> Values:
    """The values, standard errors and knowledge in a table of all parameters."""
    given = _spread(layout, given)
    _check_names(where, k, layout, given)
    names = enumerate(layout.names)
    cells = [Reader(where, k, layout, i).read(given[key], fixed) for i, key in names]
    knowledge = Knowledge(
        np.array([cell.fixed for cell in cells]),
        np.array([cell.known for cell in cells]),
        np.array([cell.known_stderr for cell in cells]),
    )
    value, stderr = (np.array([getattr(c, name) for c in cells]) for name in ("value", "stderr"))
    return Values(value, stderr, knowledge)


def _layout(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> Layout:
    """The layout of a table's effect; other keys are the user's own, unless misspelt."""
    name = table.get("name")
    if not isinstance(name, str):
        raise where.error(f'expected name = "..." of an effect, got {name!r}', k, "name")
    for key in table:
        near = difflib.get_close_matches(key.lower(), _OF_EFFECT, cutoff=0.7)
        if key not in _OF_EFFECT and near:
            raise where.error(f"effect {name}: unknown {key}; expected {near[0]}", k, key)
    try:
        return layout_of(str(name), robot)
    except InputError as error:
        raise where.error(str(error), k, "name") from None


def _spread(layout: Layout, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Copy what is stated for a whole group of components to each of them.

    If the mapping is the file's own tree it is edited in place, so that each component has a place
    to be written to.
    """
    for whole, parts in layout.groups.items():
        if whole in given and isinstance(given, MutableMapping):
            said = given.pop(whole)
            for key in parts:
                given[key] = _both(given.get(key), said)
    return given


def _both(own: Any, said: Any) -> Any:
    """What is stated for a component and for its whole group together; the component's own wins."""
    if own is None:
        return copy.deepcopy(said)
    cells = [cell if isinstance(cell, Mapping) else {"value": cell} for cell in (said, own)]
    whole = tomlkit.inline_table()
    whole.update({**cells[0], **cells[1]})
    return whole


def _check_names(where: Where, k: int, layout: Layout, given: Mapping[str, Any]) -> None:
    for key in given:
        if key not in layout.names:
            near = difflib.get_close_matches(key, layout.names, n=len(layout), cutoff=0.0)
            raise where.error(
                f"effect {layout.name}: unknown parameter {key}; known, nearest first: "
                f"{some(near, _MOST_NAMED)}", k, key,
            )  # fmt: skip
    missing = [key for key in layout.names if key not in given]
    if missing:
        raise where.error(
            f"effect {layout.name}: {plural(len(missing), 'parameter')} "
            f"{some(missing, _MOST_NAMED)} {'is' if len(missing) == 1 else 'are'} missing; "
            f"expected a line such as {missing[0]} = {{ value = {layout.null[0]:g} }}",
            k, "parameters",
        )  # fmt: skip
