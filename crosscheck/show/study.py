"""A study on the terminal, and its figure."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from crosscheck.show.blocks import Block, Cell, Items, TextTable
from crosscheck.show.texts import printed
from crosscheck.studies.study import Study
from seecr.counted import counted
from seecr.show.colours import AFTER, GREY
from seecr.show.figures import figure
from seecr.units import in_unit, short

# Rows on the terminal; study.csv has all.
_MOST = 40
# Columns that the figure compares, by what cases have them: its two axes.
_PAIRS = (
    ("deviation_max_m", "rotation_max_rad", "largest deviation", "largest rotation"),
    ("before_position_rms_m", "after_position_rms_m", "error before", "error with what was found"),
)
# More names than these would lie on each other.
_NAMED = 12
# A limit farther out than so many times what there is would leave that no room.
_ROOM = 2.0


@printed
def print_study(found: Study) -> Iterator[Block]:
    """Print the table of a study, as far as cases differ, and what it says.

    What was changed is shown where cases have no names of their own.
    """
    rows, named = found.records(), all("case" in case.given for case in found.cases)
    cells = {key for case in found.cases for key in case.given} if named else set()
    keys = [
        key
        for key in rows[0]
        if key == "case"
        or (key not in (*cells, "failed") and len({str(row[key]) for row in rows}) > 1)
    ]
    table = [[_cell(key, row[key]) for key in keys] for row in rows[:_MOST]]
    heads = [_head(key, rows) for key in keys]
    if len(rows) == 1:  # there is none that it could differ from
        told = {key: _cell(key, value) for key, value in rows[0].items() if value is not None}
        yield Items([f"{_head(key, rows)}: {cell}".lstrip("#") for key, cell in told.items()])
    else:
        yield TextTable(heads, table, kind="whole")
    if len(rows) > _MOST:
        yield Items([f"and {counted(len(rows) - _MOST, 'more row')}, in study.csv"])
    yield Items(found.lines())


def _unit(key: str) -> tuple[float, str]:
    """Factor and name of the unit that people read, of a number that was found."""
    si = key.rpartition("_")[2]
    return in_unit(si) if si in ("m", "rad", "N") else (1.0, "")


def _head(key: str, rows: list[dict[str, Any]]) -> str:
    numbers = any(isinstance(row[key], int | float) for row in rows)
    unit = _unit(key)[1] if numbers else ""
    name = key.removesuffix(f"_{key.rpartition('_')[2]}") if unit else key
    return f"{'#' if numbers else ''}{name.replace('_', ' ')}{f' [{unit}]' if unit else ''}"


def _cell(key: str, value: Any) -> Cell:
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    return short(_unit(key)[0] * value) if isinstance(value, float) else str(value)


def study_figure(found: Study, path: Path | None) -> Any:
    """A dot for each case: those within the limits blue, or all if there are none."""
    rows = found.records()
    pairs = [pair for pair in _PAIRS if any(isinstance(row.get(pair[0]), float) for row in rows)]
    with figure(path, 1, max(len(pairs), 1), figsize=(6.4 * max(len(pairs), 1), 4.2)) as axes:
        for k, pair in enumerate(pairs):
            _dots(axes[0, k], found, rows, pair)
        if not pairs:
            axes[0, 0].set_title("no case has a number to draw")
    return axes[0, 0].figure


def _dots(
    axes: Axes, found: Study, rows: list[dict[str, Any]], pair: tuple[str, str, str, str]
) -> None:
    some = [row for row in rows if all(isinstance(row.get(key), float) for key in pair[:2])]
    scales, names = zip(*(_unit(key) for key in pair[:2]), strict=True)
    at = np.array([[row[key] for key in pair[:2]] for row in some]).reshape(-1, 2) * scales
    axes.scatter(
        at[:, 0], at[:, 1], s=18, c=[GREY if row.get("within") is False else AFTER for row in some]
    )
    for row, place in zip(some if len(some) <= _NAMED else [], at, strict=False):
        axes.annotate(row["case"], place, (3, 3), textcoords="offset points", fontsize=7)
    limits = (found.limits.position_m, found.limits.orientation_rad) if found.limits else ()
    lines = zip((axes.axvline, axes.axhline), limits, scales, at.T, strict=False)
    for line, limit, scale, sizes in lines if pair is _PAIRS[0] and len(at) else ():
        if limit is not None and scale * limit <= _ROOM * sizes.max():
            line(scale * limit, color=GREY, linestyle="--", linewidth=0.8)
    good = f", blue: {sum(row.get('within') is True for row in some)} within the limits"
    axes.set_title(f"{counted(len(some), 'case')}{good if found.limits else ''}")
    axes.set_xlabel(f"{pair[2]} [{names[0]}]")
    axes.set_ylabel(f"{pair[3]} [{names[1]}]")
