"""Common parts of results: a few lines in print, a table in a notebook, a data frame."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from html import escape
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.errors import InputError, MissingPackageError
from seecr.files import json_text, path_of
from seecr.lazy import pictures_of

# Rows of the table in a notebook; the data frame has all of them.
_MOST_ROWS = 20

Record = dict[str, Any]
"""One row of a data frame: numbers in SI units, with names that end in their unit."""


COORDINATES = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
"""Columns of a pose in a data frame."""


MOTION = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
"""Columns of a motion, or of its errors, in a data frame."""


def named(pattern: str, names: Sequence[str], values: NDArray[Any]) -> Record:
    """Part of a record (k,) or columns (n, k), with keys from the pattern and each name."""
    parts = zip(names, values.T.tolist(), strict=True)
    return {pattern.format(name): value for name, value in parts}


def rows_of(columns: Mapping[str, Sequence[Any] | NDArray[Any]]) -> list[Record]:
    """Columns of n values each as n records."""
    lists = [one.tolist() if isinstance(one, np.ndarray) else one for one in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True)]


class Result(ABC):
    """A result that can be printed and tabulated; subclasses define the lines and rows."""

    @abstractmethod
    def lines(self) -> Sequence[str]:
        """The result in a few lines for people."""

    @abstractmethod
    def records(self) -> Sequence[Record]:
        """The result's rows, all with the same keys."""

    def as_json(self) -> Record:
        """The result as a dictionary: its rows, unless a file of its own says more."""
        return {"rows": list(self.records())}

    def to_json(self) -> str:
        """The content of ``as_json`` as text: SI, null where a number does not exist."""
        return json_text(self.as_json())

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        """The lines, and the first rows as a table, for a notebook."""
        words = "".join(f"<div>{escape(line)}</div>" for line in self.lines())
        return words + _table(self.records())

    def plot(self, name: str = "") -> Any:
        """The figure that the command draws of it, a ``matplotlib.figure.Figure``.

        Args:
            name: of a further figure of its page, as ``--figures`` names their files.

        Raises:
            InputError: it has no figure, or none of that name.
        """
        return _picture(self, "plot")(self, name)

    def save_html(self, path: str | Path) -> None:
        """Write it as one self-contained page, as the command does.

        Raises:
            InputError: it has no page, or the file's name does not end in .html.
            InputFileError: the file cannot be written.
        """
        self._save("page", path, ".html")

    def save_recording(self, path: str | Path) -> None:
        """Write its recording for the Rerun viewer, as the command does.

        Raises:
            InputError: it has no recording, or the file's name does not end in .rrd.
            InputFileError: the file cannot be written.
        """
        self._save("recording", path, ".rrd")

    def _save(self, what: str, path: str | Path, suffix: str) -> None:
        draw, named = _picture(self, what), path_of(path, f"the {suffix} file to write")
        if named.suffix.lower() != suffix:
            raise InputError(f"{named}: expected a name that ends in {suffix}")
        draw(self, named)

    def to_frame(self) -> Any:
        """All rows as a ``pyarrow.Table``; without pyarrow as a ``pandas.DataFrame``.

        Raises:
            MissingPackageError: neither is installed.
        """
        records = list(self.records())
        try:
            from pyarrow import Table

            return Table.from_pylist(records)
        except ModuleNotFoundError as error:
            if error.name != "pyarrow":  # installed, but one of its own imports is missing
                raise
        try:
            from pandas import DataFrame

            return DataFrame.from_records(records)
        except ModuleNotFoundError as error:
            if error.name != "pandas":
                raise
            raise MissingPackageError(
                "a data frame needs pyarrow or pandas, and neither is installed; "
                "install one: pip install pyarrow"
            ) from None


_PICTURES = {"plot": "figure", "page": "page", "recording": "recording"}


def _picture(result: Result, what: str) -> Any:
    """What draws a picture of a result."""
    pictures = pictures_of(type(result))
    has = [word for key, word in _PICTURES.items() if getattr(pictures, key, None) is not None]
    if _PICTURES[what] not in has:
        others = f"; it has a {' and a '.join(has)}" if has else ""
        raise InputError(f"{type(result).__name__} has no {_PICTURES[what]}{others}")
    return getattr(pictures, what)


def _table(records: Sequence[Record]) -> str:
    if not records:
        return ""
    heads = "".join(f"<th>{escape(name)}</th>" for name in records[0])
    rows = "".join(f"<tr>{_cells(record)}</tr>" for record in islice(records, _MOST_ROWS))
    more = len(records) - _MOST_ROWS
    rest = (
        f"<div>and {counted(more, 'more row')}: to_frame() has them all</div>" if more > 0 else ""
    )
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>{rest}"


def _cells(record: Mapping[str, Any]) -> str:
    return "".join(f"<td>{escape(_shown(value))}</td>" for value in record.values())


def _shown(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
