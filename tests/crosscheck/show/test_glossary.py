"""Words of the glossary on pages: linked once in each section, explained at the foot."""

from __future__ import annotations

import re
from pathlib import Path

from crosscheck.show.glossary import entries, with_glossary

SOURCE = Path(__file__).resolve().parents[3] / "docs" / "glossary.md"


def linked(*sections: str) -> str:
    body = "".join(f"<section>{section}</section>" for section in sections)
    return with_glossary(f"<title>noise</title><main>{body}<!-- glossary --></main>")


def test_each_word_of_the_file_is_an_entry_with_an_anchor_of_its_own() -> None:
    heads = re.findall(r"^\*\*(.+?)\.\*\*", SOURCE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(entries()) == len(heads) > 30
    assert len({entry.anchor for entry in entries()}) == len(heads)
    assert not any(re.search(r"[`*]|\]\(", entry.text) for entry in entries())


def test_a_word_is_linked_where_it_first_stands_in_each_section() -> None:
    page = linked("<p>Noise, noise and a residual</p>", "<p>noise <b>slack</b></p><td>slack</td>")
    assert page.count('href="#glossary-noise"') == 2
    assert '<a href="#glossary-noise">Noise</a>, noise' in page
    assert "<title>noise</title>" in page and "<b>slack</b></p><td>slack</td>" in page
    explained = re.findall(r'<p id="glossary-([^"]*)"', page)
    assert explained == ["noise", "residual"], "those that are linked, in the glossary's order"


def test_words_are_known_in_the_plural_with_numbers_and_by_their_other_names() -> None:
    page = linked("<p>9 standard errors from zero; two expected sizes; on test runs; p 0.1</p>")
    said = re.findall(r"<a [^>]*>(.*?)</a>", page)
    assert said == ["9 standard errors from zero", "expected sizes", "test runs"]
    assert linked("<p>unslackened, noise-free &amp; phase</p>").count("<a") == 0


def test_what_is_linked_is_explained_and_a_page_without_words_has_no_foot() -> None:
    page = linked("<p>every effect, null value and held out row; a rival imitates</p>")
    links = set(re.findall(r'href="#([^"]*)"', page))
    assert len(links) == 5 and links == set(re.findall(r'<p id="([^"]*)"', page))
    assert "<details" not in linked("<p>nothing here</p>")
