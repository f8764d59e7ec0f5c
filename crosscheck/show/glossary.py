"""The glossary on a page: words are linked where they first stand, and explained at the foot."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

# In a checkout, and where a wheel puts it: docs/glossary.md is the only source.
_PLACES = (
    Path(__file__).parents[2] / "docs" / "glossary.md",
    Path(__file__).with_name("glossary.md"),
)
_ENTRY = re.compile(r"^\*\*(.+?)\.\*\* (.+?)(?=\n\n|\Z)", re.DOTALL | re.MULTILINE)
_TAG = re.compile(r"(<[^>]+>)")
# Words are linked in running text, and not where something else stands for itself.
_RUNNING, _NOT = {"p", "li"}, {"a", "b", "code", "small"}


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
    text: str


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


def _html(text: str) -> str:
    """Of the little Markdown that the glossary has."""
    text = html.escape(" ".join(text.split()), quote=False)
    text = re.sub(r"\[(.+?)\]\(.+?\)", r"\1", text)
    text = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", text)
    text = re.sub(r"\*(.+?)\*", r"<i>\1</i>", text)
    return re.sub(r"`(.+?)`", r"<code>\1</code>", text)


def with_glossary(page: str) -> str:
    """A page with words linked, once in each section, and explained at ``<!-- glossary -->``."""
    main = re.search(r"<main>.*<!-- glossary -->", page, re.DOTALL)
    assert main is not None
    linker = _Linker()
    text = "".join(linker.section(part) for part in re.split(r"(?=<section)", main[0]))
    foot = _foot(entry for entry in entries() if entry in linker.used)
    return page.replace(main[0], text.replace("<!-- glossary -->", foot))


def _foot(used: Iterable[Entry]) -> str:
    used = list(used)
    if not used:
        return ""
    lines = [f'<p id="{e.anchor}"><b>{html.escape(e.name)}.</b> {e.text}</p>' for e in used]
    return "\n".join(
        ['<details id="glossary">', "<summary>Words used here</summary>", *lines, "</details>"]
    )


class _Linker:
    """Links words in the running text of sections; remembers which."""

    def __init__(self) -> None:
        self.used: set[Entry] = set()
        self._of = {word: entry for entry in entries() for word in entry.words}
        longest_first = sorted(self._of, key=len, reverse=True)
        self._any = re.compile(
            rf"(?<![\w-])(?:{'|'.join(f'({w})' for w in longest_first)})(?![\w-])", re.IGNORECASE
        )
        self._entries = [self._of[word] for word in longest_first]

    def section(self, text: str) -> str:
        """One section's text, in which each word is linked once."""
        seen: set[Entry] = set()
        depth = dict.fromkeys(_RUNNING | _NOT, 0)
        out = []
        for part in _TAG.split(text):
            tag = re.match(r"</?(\w+)", part) if part.startswith("<") else None
            if tag is not None and tag[1] in depth:
                depth[tag[1]] += -1 if part[1] == "/" else 1
            running = any(depth[name] for name in _RUNNING) and not any(
                depth[name] for name in _NOT
            )
            out.append(self._linked(part, seen) if tag is None and running else part)
        return "".join(out)

    def _linked(self, text: str, seen: set[Entry]) -> str:
        def link(found: re.Match[str]) -> str:
            entry = self._entries[int(found.lastindex or 1) - 1]
            if entry in seen:
                return found[0]
            seen.add(entry)
            self.used.add(entry)
            return f'<a href="#{entry.anchor}">{found[0]}</a>'

        return self._any.sub(link, text)
