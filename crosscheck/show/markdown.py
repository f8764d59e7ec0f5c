"""Blocks as the texts of a recording, in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from crosscheck.fit.problem import Kind
from crosscheck.measurements.data import Measurements
from crosscheck.show.blocks import (
    Bar,
    Block,
    Bold,
    Cell,
    Code,
    Items,
    Line,
    Panel,
    Styled,
    TextTable,
    Words,
    pieces,
)
from seecr.units import short


def markdown(blocks: Iterable[Block], title: str = "") -> str:
    """Blocks one below the other, under a title if there is one."""
    head = f"# {escaped(title)}\n" if title else ""
    return head + "\n\n".join(part for block in blocks if (part := _shown(block)))


def _shown(block: Block) -> str:
    if isinstance(block, Line):
        return _words(block.words)
    if isinstance(block, Items):
        return "\n".join(f"- {_words(line)}" for line in block.lines)
    if isinstance(block, TextTable):
        return _table(block)
    if isinstance(block, Panel):
        return f"## {_words(block.title)}\n{markdown(block.blocks)}"
    raise TypeError(f"{type(block).__name__} is not for recordings")


def escaped(text: str) -> str:
    """A text, with the characters escaped that Markdown would interpret."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>#|" else c for c in text)


def _words(words: Words) -> str:
    out = []
    for one in pieces(words):
        mark = {Bold: "**", Code: "`"}.get(type(one), "")
        out.append(f"{mark}{one if mark == '`' else escaped(one)}{mark}")
    return "".join(out)


def _table(block: TextTable) -> str:
    """A table; without heads its first row is the head, as Markdown needs one."""
    every: list[Sequence[Cell]] = [*([block.heads] if block.heads else []), *block.rows]
    heads, *rows = every
    names = [_cell(head).removeprefix("\\#") for head in heads]
    lines = [_row(names), "|" + " --- |" * len(names), *(_row(map(_cell, row)) for row in rows)]
    return "\n".join(lines)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(cell: Cell) -> str:
    if cell is None:
        return "–"
    return _words(cell.words if isinstance(cell, Bar | Styled) else cell)


# --- poses ----------------------------------------------------------------------------------------


def pose_heading(k: int, count: int) -> str:
    """The heading for one of so many poses, counted from 0."""
    return f"## Pose {k}" + (f" (of 0 to {count - 1})" if count > 1 else "")


def row_heading(data: Measurements, k: int) -> str:
    """The heading for one row of measurements: which pose it is, and where it was read."""
    where = f"line {int(data.line[k])}, run {escaped(data.run[k])}"
    return f"{pose_heading(k, data.n_rows)}\n{where}\n\n"


def unused(data: Measurements, k: int) -> Line:
    """Why nothing is shown for a row that does not count."""
    if data.read[k]:
        return Line("Left out: see the notes.")
    return Line("A way point: passed without a reading, not compared.")


def kinds_table(
    kinds: Iterable[Kind], values: Iterable[Sequence[float | None]], names: Iterable[str],
    corner: str = "rms error",
) -> TextTable:  # fmt: skip
    """Errors (SI, None where there is none) with a row for each kind and a named column for each
    value.
    """
    rows = [
        [
            f"{kind.name} [{kind.unit}]",
            *(short(None if value is None else kind.factor * value) for value in row),
        ]
        for kind, row in zip(kinds, values, strict=True)
    ]
    return TextTable([corner, *names], rows)
