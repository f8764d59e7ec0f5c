"""Blocks on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Console, JustifyMethod
from rich.table import Table as RichTable
from rich.text import Text

from crosscheck.show.blocks import Bar, Block, Cell, Items, Line, Styled, TextTable, text_of

# Where nobody's screen is the limit.
_WIDE = 160


def show(blocks: Iterable[Block], console: Console | None = None) -> None:
    """Print blocks, by default on the standard output."""
    console = console_for(console)
    for block in blocks:
        if isinstance(block, TextTable):
            console.print(_table(block))
        else:
            for line, style in _lines(block):
                # never broken: people search and pipe them
                console.print(Text(line, style=style), soft_wrap=True)


def console_for(console: Console | None = None) -> Console:
    """The console to print on; wide where nobody's screen is the limit."""
    console = console or Console(highlight=False)
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


def _table(block: TextTable) -> RichTable:
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
        table.add_row(*(_cell(cell) for cell in row), style=style)
    return table


def _cell(cell: Cell) -> Text:
    if cell is None:
        return Text("-")
    if isinstance(cell, Styled):
        return Text(cell.words, style=cell.style)
    return Text(cell.words if isinstance(cell, Bar) else text_of(cell))
