"""Words of the glossary on pages: linked once in each section, explained at the foot."""

from __future__ import annotations

import re
from pathlib import Path

from crosscheck.show.glossary import Linker, entries

SOURCE = Path(__file__).resolve().parents[3] / "docs" / "glossary.md"


def test_each_word_of_the_file_is_an_entry_with_an_anchor_of_its_own() -> None:
    heads = re.findall(r"^\*\*(.+?)\.\*\*", SOURCE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(entries()) == len(heads) > 30
    assert len({entry.anchor for entry in entries()}) == len(heads)
    assert not any(re.search(r"[`*]|\]\(", entry.text) for entry in entries())


def test_a_word_is_linked_where_it_first_stands_in_each_section() -> None:
    page = Linker()
    first = page.linked("Noise, noise and a <residual>")
    assert first.startswith('<a href="#glossary-noise">Noise</a>, noise and a &lt;<a href=')
    assert page.linked("noise again") == "noise again"
    page.begin_section()
    assert page.linked("noise").startswith("<a ")
    assert [entry.name for entry in page.used()] == ["Noise", "Residual"], "the glossary's order"


def test_words_are_known_in_the_plural_with_numbers_and_by_their_other_names() -> None:
    page = Linker().linked("9 standard errors from zero; two expected sizes; on test runs; p 0.1")
    said = re.findall(r"<a [^>]*>(.*?)</a>", page)
    assert said == ["9 standard errors from zero", "expected sizes", "test runs"]
    assert "<a" not in Linker().linked("unslackened, noise-free & phase")


def test_other_names_of_one_word_are_one() -> None:
    page = Linker()
    links = re.findall(r'href="#([^"]*)"', page.linked("null value and held out row; a rival"))
    assert len(set(links)) == len(links) == len(page.used()) >= 3
