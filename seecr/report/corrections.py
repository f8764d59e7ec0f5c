"""The files of a correction: commands that are read again, and what they lead to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from seecr.columns.command_file import CommandFile
from seecr.inverse.correction import Correction
from seecr.pose import Array
from seecr.report.commanded import load_columns, toml_beside
from seecr.result import COORDINATES

__all__ = ["chance_lines", "corrected_csv", "corrected_toml"]

_WANT = [f"want_{name}" for name in COORDINATES]
# Below this a reader should look.
_LIKELY = 0.95


def corrected_csv(found: Correction, wanted: CommandFile) -> str:
    """The poses wanted and the lengths to tell, one row per pose that has an answer.

    Numbers have all their digits: a length rounded to a micrometre misses by as much.

    Args:
        found: the correction.
        wanted: the list that it is of: its runs, times, temperatures and loads go along.
    """
    given, n = wanted.commands, len(wanted.commands)
    columns: dict[str, Any] = {}
    if len(set(wanted.run)) > 1:
        columns["run"] = wanted.run
    if given.time is not None:
        columns["t_s"] = given.time
    if given.temperature is not None:
        columns["temperature_C"] = given.temperature
    columns |= dict(zip(_WANT, found.wanted.T, strict=True))
    columns |= {f"length_{k + 1}_m": one for k, one in enumerate(found.lengths.T)}
    columns |= load_columns(given.loads)
    rows = [",".join(_cell(one[i]) for one in columns.values()) for i in range(n) if found.found[i]]
    return "\n".join([",".join(columns), *rows]) + "\n"


def corrected_toml(wanted: CommandFile) -> str:
    """What says how the lengths are meant."""
    return toml_beside(True, wanted.commands)


def chance_lines(found: Correction, kept: Array | None, minimum: bool = False) -> Iterator[str]:
    """How likely tensions stay within their limits, where the model says so.

    Args:
        found: the correction.
        kept: (n,) probability of each row.
        minimum: whether tensions were to be as small as possible.
    """
    if kept is None or not np.isfinite(kept).any():
        return
    worst = int(np.nanargmin(kept))
    many = int(np.sum(kept[np.isfinite(kept)] < _LIKELY))
    yield (
        f"tensions stay within the limits with probability {np.nanmin(kept):.2f} at "
        f"{found.place(worst)}, the least; below {_LIKELY:g} at {many} of {len(found.wanted)}"
    )
    if minimum and many:
        yield (
            "  --aim minimum puts a cable at its lowest tension, where it stays within the limits "
            "with about 0.5; --aim middle keeps away from them"
        )


def _cell(value: Any) -> str:
    if isinstance(value, str):
        quoted = '"' + value.replace('"', '""') + '"'
        return quoted if any(mark in value for mark in ',"#') else value
    return repr(float(value) + 0.0)
