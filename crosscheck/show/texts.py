"""Blocks as text: on the terminal, and in Markdown for recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from typing import ParamSpec

from rich.console import Console, JustifyMethod
from rich.table import Table as RichTable
from rich.text import Text

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
    text_of,
)
from seecr.units import short

# --- terminal -------------------------------------------------------------------------------------

# Where nobody's screen is the limit.
_WIDE = 160


P = ParamSpec("P")


def printed(blocks_of: Callable[P, Iterable[Block]]) -> Callable[P, None]:
    """A function that prints the blocks that ``blocks_of`` makes."""

    @wraps(blocks_of)
    def show(*given: P.args, **named: P.kwargs) -> None:
        print_blocks(blocks_of(*given, **named))

    return show


def print_blocks(blocks: Iterable[Block]) -> None:
    """Print blocks on the standard output."""
    console = terminal()
    for block in blocks:
        if isinstance(block, TextTable):
            console.print(_rich_table(block))
        else:
            for line, style in _lines(block):
                # never broken: people search and pipe them
                console.print(Text(line, style=style), soft_wrap=True)


def terminal() -> Console:
    """The standard output; wide where nobody's screen is the limit."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, _WIDE)
    return console


def _lines(block: Block) -> Iterator[tuple[str, str]]:
    """Lines and their styles."""
    if isinstance(block, Line):
        yield text_of(block.words), block.style
    elif isinstance(block, Items):
        for line in block.lines:
            yield f"{block.lead}{text_of(line)}", block.style
    else:
        raise TypeError(f"{type(block).__name__} is not for terminals")


def _rich_table(block: TextTable) -> RichTable:
    """A plain table, numbers on the right; units stand below what they are of.

    Heads are texts as they stand: a bare "[mm]" would be taken for a style and vanish.
    """
    table = RichTable(box=None, header_style="bold", pad_edge=False)
    for head in block.heads:
        name = Text(head.removeprefix("#").replace(" [", "\n["))
        side: JustifyMethod = "right" if head.startswith("#") else "left"
        table.add_column(name, justify=side, no_wrap=block.kind == "whole")
    for k, row in enumerate(block.rows):
        style = block.styles[k] if k < len(block.styles) else ""
        table.add_row(*(_rich_cell(cell) for cell in row), style=style)
    return table


def _rich_cell(cell: Cell) -> Text:
    if cell is None:
        return Text("-")
    if isinstance(cell, Styled):
        return Text(cell.words, style=cell.style)
    return Text(cell.words if isinstance(cell, Bar) else text_of(cell))


# --- Markdown -------------------------------------------------------------------------------------


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
    heads, *rows = [block.heads, *block.rows] if block.heads else block.rows
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
        [f"{kind.name} [{kind.unit}]", *(short(v if v is None else kind.factor * v) for v in row)]
        for kind, row in zip(kinds, values, strict=True)
    ]
    return TextTable([corner, *names], rows)
