"""Pages of comparisons and plans; how each came about; dark, narrow, and figures to keep."""

from __future__ import annotations

import hashlib
import json
import re

import pytest
from made_data import case, run, term
from written_pages import figures_of, text_of

import crosscheck
from crosscheck.planning.visibility import NAMED
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


def test_printed_tables_have_their_heads_on_every_page(pages):
    style = pages["plan"].split("<style>")[1].split("</style>")[0]
    printed = style[style.index("@media print") :]
    assert "thead { display: table-header-group; break-inside: avoid; }" in printed
    # heads that hold buttons are not repeated by browsers
    assert "th button { display: contents;" in printed
    assert "tr { break-inside: avoid; }" in style


def test_version_command_day_and_hashes_are_on_page_and_in_json(files, tmp_path):
    out, kept = tmp_path / "out", tmp_path / "figures"
    done = run("compare", *files, "--out", out, "--figures", kept, "--no-recording")
    assert done.exit_code == 0, done.output
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
