"""The glossary on a page: words are linked where they first stand, and explained at the foot."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from markupsafe import Markup, escape

# In a checkout, and where a wheel puts it: docs/glossary.md is the only source.
_PLACES = (
    Path(__file__).parents[2] / "docs" / "glossary.md",
    Path(__file__).with_name("glossary.md"),
)
_ENTRY = re.compile(r"^\*\*(.+?)\.\*\* (.+?)(?=\n\n|\Z)", re.DOTALL | re.MULTILINE)
_LINK = Markup('<a href="#{}">{}</a>')


@dataclass(frozen=True)
class Entry:
    """A word of the glossary.

    Attributes:
        name: the first of its words. anchor: where it is explained. words: patterns of all of
            them. text: the explanation as HTML.
    """

    name: str
    anchor: str
    words: tuple[str, ...]
    text: Markup


@cache
def entries() -> tuple[Entry, ...]:
    """All words, in the order of the glossary."""
    source = next(place for place in _PLACES if place.is_file()).read_text(encoding="utf-8")
    return tuple(_entry(head, text) for head, text in _ENTRY.findall(source))


def _entry(head: str, text: str) -> Entry:
    names = [
        name for name in re.split(r", | \((?!of )|\)", re.sub(r" \(of .*?\)", "", head)) if name
    ]
    anchor = "glossary-" + re.sub(r"\W+", "-", names[0].lower()).strip("-")
    return Entry(
        names[0], anchor, tuple(_pattern(name) for name in names if len(name) > 1), _html(text)
    )


def _pattern(name: str) -> str:
    """Of a word as it may stand in a text: in the plural, with a number where it says so many."""
    word = re.escape(name.lower()).replace(r"so\ many", r"\S+")
    return word.removeprefix(r"on\ ") + ("" if word.endswith("s") else "s?")


def _html(text: str) -> Markup:
    """Of the little Markdown that the glossary has."""
    text = html.escape(" ".join(text.split()), quote=False)
    text = re.sub(r"\[(.+?)\]\(.+?\)", r"\1", text)
    text = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", text)
    text = re.sub(r"\*(.+?)\*", r"<i>\1</i>", text)
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", text))


class Linker:
    """Links words in the running text of one page, once in each section."""

    def __init__(self) -> None:
        self._used: set[Entry] = set()
        self._seen: set[Entry] = set()
        self._of = {word: entry for entry in entries() for word in entry.words}
        longest_first = sorted(self._of, key=len, reverse=True)
        self._any = re.compile(
            rf"(?<![\w-])(?:{'|'.join(f'({w})' for w in longest_first)})(?![\w-])", re.IGNORECASE
        )
        self._entries = [self._of[word] for word in longest_first]

    def begin_section(self) -> str:
        """From here on words are linked once more."""
        self._seen = set()
        return ""

    def linked(self, text: str) -> Markup:
        """A text with its words linked, where they were not yet in this section."""
        out, end = Markup(), 0
        for found in self._any.finditer(text):
            entry = self._entries[int(found.lastindex or 1) - 1]
            if entry not in self._seen:
                self._seen.add(entry)
                out += escape(text[end : found.start()]) + _LINK.format(entry.anchor, found[0])
                end = found.end()
        self._used |= self._seen
        return out + escape(text[end:])

    def used(self) -> list[Entry]:
        """What was linked, in the order of the glossary."""
        return [entry for entry in entries() if entry in self._used]
