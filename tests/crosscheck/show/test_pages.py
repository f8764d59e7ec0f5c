"""Pages of comparisons and plans, how each came about, figures to keep, and the glossary."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest
from called import run
from made_data import case, term
from written_pages import figures_of, text_of

import crosscheck
from crosscheck.planning.visibility import NAMED
from crosscheck.show.glossary import Linker, entries
from crosscheck.show.pictures import render
from seecr.files import Made

pytestmark = pytest.mark.slow

ONLY = {"pulley_radius": {"radius_m": 0.01}}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return case(tmp_path_factory.mktemp("case"), ONLY, points=4)


@pytest.fixture(scope="module")
def comparison(files):
    return crosscheck.compare(*files)


@pytest.fixture(scope="module")
def plan(files):
    return crosscheck.make_plan(*files)


@pytest.fixture(scope="module")
def pages(comparison, plan):
    return {"comparison": render(comparison), "plan": render(plan)}


def needs_nothing_else(page):
    text = re.sub(r'"data:[^"]*"', '"data:"', page)
    return not re.search(r"http|<script\s|<link|@import", text)


def test_a_comparison_has_its_page(comparison, pages):
    page = pages["comparison"]
    seen = text_of(page)
    assert comparison.sentence in seen and "The model is off" in seen
    assert "Where the errors are" in seen and "The worst rows" in seen
    assert len(figures_of(page)) == 2 and needs_nothing_else(page)
    assert all(note in seen for note in comparison.notes)
    row = comparison.coordinates[0]
    assert f"{row.name} " in seen
    problem = comparison.problem
    true = term(problem.robot, "pulley_radius", radius_m=0.01)
    good = render(crosscheck.compare(problem.robot, problem.data, [true]))
    assert "Model and data agree" in text_of(good) and "with SEECR + pulley_radius" in text_of(good)


def test_a_plan_has_its_page(plan, pages):
    page = pages["plan"]
    seen = text_of(page)
    assert plan.sentence in seen and len(figures_of(page)) == 2 and needs_nothing_else(page)
    assert f"; from {NAMED:g} times the smallest visible size on" in seen
    for found in plan.effects:
        assert found.name in seen
    for item in plan.suggestions:
        assert not item.reached or item.words in seen


def test_version_command_day_and_hashes_are_on_page_and_in_json(files, tmp_path):
    out, kept = tmp_path / "out", tmp_path / "figures"
    run("compare", *files, "--out", out, "--figures", kept, "--no-recording", status=0)
    made = json.loads((out / "comparison.json").read_text())["made"]
    assert f"compare {files[0]} {files[1]} --out {out}" in made["command"]
    xml, data = files
    assert made["sha256"][xml.name] == hashlib.sha256(xml.read_bytes()).hexdigest()[:16]
    assert set(made["sha256"]) == {xml.name, data.name, data.with_suffix(".toml").name}
    page = text_of((out / "comparison.html").read_text())
    assert made["date"] in page and made["sha256"][data.name] in page
    names = {file.suffix for file in kept.iterdir()}
    assert names == {".svg", ".png", ".json"} and len(list(kept.iterdir())) == 4 + 1  # the list
    assert all(file.stat().st_size > 1000 for file in kept.glob("*.[ps]*g"))


def test_the_same_data_have_the_same_hash_wherever_they_lie(files, tmp_path):
    xml, _data = files
    other = tmp_path / xml.name
    other.write_bytes(xml.read_bytes())
    made = [Made.now("c", [file, None, tmp_path / "nowhere.csv"]) for file in (xml, other)]
    assert made[0] == made[1] and list(made[0].files) == [xml.name]
    other.write_text("<mujoco/>")
    assert Made.now("c", [other]) != made[0]


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
