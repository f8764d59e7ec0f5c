"""Names of columns as people spell them, and foreign names that stand for ours.

A unit may stand in brackets, ``cmd_x [mm]``, and letters may be capitals. What another program
calls its columns is said with ``--columns px=meas_x_m`` or a table ``[columns]`` in the TOML.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from seecr.errors import Faults, InputError, InputFileError

if TYPE_CHECKING:
    from seecr.columns.csv import Table

QUANTITY = re.compile(
    r"(t|temperature|run|(?:cmd|meas|want)_(?:q[wxyz]|r?[xyz])|(?:length|tension)_\d+"
    r"|payload(?:_[xyz])?|(?:force|moment)_[xyz])(?:_([^_]*))?"
)
"""The parts of a column's name: a quantity and, after the last underscore, its unit."""

# What no number and no time has.
_WORD = re.compile(r"[A-DF-Za-df-z]{2}")
_BRACKETS = re.compile(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]")
# Other signs for units, as they stand in brackets; a quaternion's part has none.
_SIGNS = {"°": "deg", "º": "deg", "µm": "um", "μm": "um", "°c": "C", "-": "", "1": "", "n m": "Nm",
          "n·m": "Nm", "n*m": "Nm", "sec": "s", "degc": "C"}  # fmt: skip
# Units and parts of names that have capitals.
_CAPITALS = {"n": "N", "kn": "kN", "nm": "Nm", "c": "C"}


def spelled(name: str) -> str:
    """A header in our spelling if that makes it a known one; as it is otherwise."""
    if QUANTITY.fullmatch(name):
        return name
    brackets = _BRACKETS.fullmatch(name)
    plain, unit = brackets.groups() if brackets else (name, "")
    plain, unit = "_".join(plain.split()), _SIGNS.get(unit.lower(), unit)
    for one in (plain, plain.lower()):
        whole = f"{one}_{unit}" if unit else one
        match = QUANTITY.fullmatch(whole)
        if match is None:
            continue
        quantity, suffix = match.groups()
        low = (suffix or "").lower()
        if one is not plain or low in _CAPITALS:
            suffix = _CAPITALS.get(low, low)
        return f"{quantity}_{suffix}" if suffix else str(quantity)
    # the cable of a length or tension may have a name, whose letters stay as they are
    return f"{plain}_{unit}" if brackets and unit else name


# What the user says of headers, for all files that are read meanwhile; and of which of them a file
# need not have, as others have them.
_said: ContextVar[Mapping[str, str] | None] = ContextVar("columns", default=None)
_elsewhere: ContextVar[Collection[str]] = ContextVar("elsewhere", default=())


@contextmanager
def renamed(
    columns: Mapping[str, str] | None, elsewhere: Collection[str] | None = None
) -> Iterator[None]:
    """Files that are read meanwhile may have these foreign headers: theirs by ours.

    Args:
        columns: theirs with ours; None for those that were said before.
        elsewhere: those of them that a file need not have; None for those that were said before.
    """
    said = _said.set(_said.get() if columns is None else columns)
    others = _elsewhere.set(_elsewhere.get() if elsewhere is None else elsewhere)
    try:
        yield
    finally:
        _said.reset(said)
        _elsewhere.reset(others)


def columns_said() -> Mapping[str, str]:
    """The foreign headers that the user has said, with ours."""
    return _said.get() or {}


def said_of(names: Iterable[str]) -> dict[str, str]:
    """Those of the foreign headers that the user has said that are among some names."""
    said, every = columns_said(), list(names)
    return {
        theirs: ours
        for theirs, ours in said.items()
        if any(_meant(theirs, ours, name, said) for name in every)
    }


def parse_columns(text: str) -> dict[str, str]:
    """Foreign headers with ours, as ``--columns`` takes them: ``px=meas_x_m,py=meas_y_m``.

    Raises:
        InputError: a part that is none, or a header given twice.
    """
    out: dict[str, str] = {}
    for part in text.split(","):
        theirs, equals, ours = (one.strip() for one in part.rpartition("="))
        if not (theirs and equals and ours):
            raise InputError(
                f"--columns: expected THEIRS=OURS, such as px=meas_x_m, got {part.strip()!r}"
            )
        if theirs in out:
            raise InputError(f"--columns: {theirs} is given twice; leave one out")
        out[theirs] = ours
    return out


def numbered_headers(first: list[str]) -> list[str]:
    """Headers of a file without any: 1, 2, 3 ..., where that is how the user calls them."""
    said = columns_said()
    alone = bool(said) and all(theirs.isdigit() for theirs in said)
    if not alone or any(_WORD.search(cell) for cell in first):
        return []
    return [str(k) for k in range(1, len(first) + 1)]


def foreign(table: Table) -> tuple[str, ...]:
    """The names of a table's columns in our terms, by what was said of them.

    Args:
        table: whose headers are meant. One ``*`` in both stands for the same text, in headers that
            are not said by themselves.

    Raises:
        InputFileError: a header that the file does not have, or a name that is none of ours.
    """
    names, faults = list(table.names), Faults()
    said, own = columns_said(), [name for name in table.names if _is_ours(name)]
    for theirs, ours in said.items():
        meant = [(k, _meant(theirs, ours, name, said)) for k, name in enumerate(table.names)]
        found = [(k, name) for k, name in meant if name and _is_ours(name)]
        if not found and any(name for _, name in meant):
            text = f"columns {theirs}={ours}: {next(n for _, n in meant if n)} is no column that "
            text += "is read; expected THEIRS=OURS with one of ours such as meas_x_m or length_1_m"
            faults.add(table.error(text))
        elif not (found or theirs in _elsewhere.get()) and not any(
            _meant(ours, ours, name, {}) for name in own
        ):
            faults.add(_missing(table, theirs, ours))
        for index, name in found:
            names[index] = str(name)
    faults.check()
    return tuple(names)


def _is_ours(name: str) -> bool:
    return bool(QUANTITY.fullmatch(spelled(name))) or name.startswith(("length_", "tension_"))


def _meant(theirs: str, ours: str, name: str, said: Mapping[str, str]) -> str | None:
    """What a header is in our terms by one thing that was said; None if it is not meant."""
    if name == theirs:
        return ours
    if "*" not in theirs or "*" not in ours or name in said:
        return None
    match = re.fullmatch(re.escape(theirs).replace(r"\*", "(.+)", 1), name)
    return ours.replace("*", match[1]) if match else None


def _missing(table: Table, theirs: str, ours: str) -> InputFileError:
    near = difflib.get_close_matches(theirs, table.names, n=3, cutoff=0.5)
    listed = ", ".join(near or table.names[:8])
    text = f"columns {theirs}={ours}: the file has no column {theirs}; expected one of {listed}"
    if ours in table.names:
        text += f"; theirs comes first: {ours}={theirs}"
    return table.error(text)
