"""What is shown of a result: lines, lists, tables and figures, for any medium.

A result makes its blocks once, in the units that people read. A terminal
(:mod:`crosscheck.show.texts`), a page (:mod:`crosscheck.show.pictures`) and a recording
(:mod:`crosscheck.show.texts`) each show them in their own way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from crosscheck.fit.problem import KINDS, Kind, Rms
from seecr.units import in_unit, without_rounding

# --- words ----------------------------------------------------------------------------------------


class Code(str):
    """A name that programs know it by, such as an effect's."""


class Bold(str):
    """Words that stand out."""


class Small(str):
    """Words that stand back."""


class Whole(str):
    """Words that are not broken into lines."""


class Dot(str):
    """A dot of this colour, before what a figure shows in it."""


class Below(str):
    """Words that stand back, on a line of their own where there is room for one."""


Words: TypeAlias = str | Sequence[str]
"""A text, or pieces of one of the kinds above."""


@dataclass(frozen=True)
class Bar:
    """A number as a bar.

    Attributes:
        part: of the bar's length, 0 to 1, or -1 to 1 from its middle.
        words: the number. middle: whether the bar begins in the middle.
    """

    part: float
    words: str = ""
    middle: bool = False


@dataclass(frozen=True)
class Styled:
    """Words of their own style, as the terminal or the page knows it."""

    words: str
    style: str


Cell: TypeAlias = Words | Bar | Styled | None
"""What stands in a table: None where there is no number."""

# --- blocks ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """A sentence, or a few; ``style`` as the terminal knows it: "dim", "green", "bold red"."""

    words: Words
    style: str = ""


@dataclass(frozen=True)
class Items:
    """Sentences that stand one below the other; on a terminal each after ``lead``."""

    lines: Sequence[Words]
    lead: str = ""
    style: str = ""


@dataclass(frozen=True)
class TextTable:
    """A table.

    Attributes:
        heads: of its columns; "#" before the head of a column of numbers.
        rows: each with a cell for each column; the last of fewer takes the rest of the row.
        styles: of rows, as the terminal knows them; none by default.
        kind: "two" for two columns of rows on a page, "bins" for bars without heads, "whole" for
            cells that no terminal breaks.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    styles: Sequence[str] = ()
    kind: str = ""

    @property
    def wide(self) -> bool:
        """Whether a narrow page has no room for it: each row is then a few lines there."""
        words = sum(not head.startswith("#") for head in self.heads)
        return words > 3 or len(self.heads) > 5


@dataclass(frozen=True)
class Figure:
    """A figure as an element of the page; ``wide`` if it scales with that."""

    image: str
    wide: bool = True


@dataclass(frozen=True)
class Facts:
    """Names with their values, in a few lines."""

    pairs: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Check:
    """One thing that was tested: ``good`` is None where it says nothing by itself."""

    name: str
    good: bool | None
    words: str

    @property
    def mark(self) -> str:
        """A sign that reads without its colour."""
        return {True: "✓", False: "✗", None: "·"}[self.good]


@dataclass(frozen=True)
class Checks:
    """What was tested."""

    checks: Sequence[Check]


@dataclass(frozen=True)
class Panel:
    """Blocks that belong together.

    Attributes:
        title: above them. blocks: what belongs together.
        kind: "section", "card" in a frame, "beside" each other, or "part" of what is.
    """

    title: Words
    blocks: Sequence[Block]
    kind: str = "section"


Block: TypeAlias = Line | Items | TextTable | Figure | Facts | Checks | Panel


@dataclass(frozen=True)
class Page:
    """A page: its verdict, and what follows.

    Attributes:
        title: in the browser's tab. heading: at the top.
        verdict: as programs know it, which sets its colour. name, meaning: in words.
        sentence: the verdict in full. lead: what it means for the robot, in a few lines, which
            come first. then: what to do about it, after the sentence. picture: beside them.
            blocks: what follows. notes: at the end.
        footer: how to read it.
    """

    title: str
    heading: str
    verdict: str
    name: str
    sentence: str
    blocks: Sequence[Block]
    notes: Sequence[str]
    footer: str
    meaning: str = ""
    lead: Sequence[Words] = ()
    then: Sequence[Words] = ()
    picture: Figure | None = None


def section(title: str, *blocks: Block | None) -> Panel | None:
    """A section of those blocks that are there; None if there are none."""
    return Panel(title, some) if (some := present(*blocks)) else None


def present(*blocks: Block | None) -> list[Block]:
    """Those blocks that are there."""
    return [block for block in blocks if block is not None]


def pieces(words: Words) -> Iterator[str]:
    """The pieces of a text; one of a single kind is its own only piece."""
    yield from [words] if isinstance(words, str) else words


def text_of(words: Words) -> str:
    """A text without its kinds."""
    return "".join(f" ({one})" if isinstance(one, Below) else str(one) for one in pieces(words))


def codes(names: Iterable[str]) -> list[str]:
    """Names of effects with commas between."""
    out: list[str] = []
    for name in names:
        out += [", ", Code(name)] if out else [Code(name)]
    return out


# --- numbers --------------------------------------------------------------------------------------


def four_digits(value: float) -> str:
    """A number in a unit of people; what rounding leaves of 0 is 0."""
    return f"{without_rounding(value):.4g}"


def in_units(values: Iterable[float], si: str) -> list[str]:
    """Numbers in the unit that people read instead of an SI unit, and that unit."""
    factor, unit = in_unit(si)
    return [*(four_digits(factor * value) for value in values), unit]


def kinds_with(every: Iterable[Rms]) -> list[Kind]:
    """The kinds of reading of which some errors are known."""
    known = {key for rms in every for key, value in rms.items() if value is not None}
    return [kind for kind in KINDS if kind.key in known]


def heads_of(kinds: Iterable[Kind]) -> list[str]:
    """Heads of columns of their errors."""
    return [f"#{kind.name} [{kind.unit}]" for kind in kinds]


def rms_cells(kinds: Sequence[Kind], rms: Rms) -> list[str | None]:
    """Errors in the units of the heads."""
    return size_cells(kinds, [rms.get(kind.key) for kind in kinds])


def size_cells(kinds: Iterable[Kind], sizes: Iterable[float | None]) -> list[str | None]:
    """Sizes of errors (SI), one per kind, in the units of the heads."""
    return [
        None if size is None or not np.isfinite(size) else four_digits(kind.factor * size)
        for kind, size in zip(kinds, sizes, strict=True)
    ]


def rms_table(rows: Sequence[tuple[str, Rms, str]]) -> TextTable:
    """A table of rms errors: name, errors by kind and style of each row.

    Kinds that were not read have no column.
    """
    kinds = kinds_with(rms for _name, rms, _style in rows)
    return TextTable(
        ["rms error", *heads_of(kinds)],
        [[name, *rms_cells(kinds, rms)] for name, rms, _style in rows],
        [style for _name, _rms, style in rows],
    )


def cut(lines: Sequence[str], most: int, file: str) -> list[str]:
    """The first lines, and how many more a file has."""
    return [*lines[:most], *[f"and {len(lines) - most} more in {file}"] * (len(lines) > most)]
