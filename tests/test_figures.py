"""Pages quote docs/figures.json, which `make score` and `make bench` write."""

from __future__ import annotations

import json
import re
from pathlib import Path

import bench
import pytest
import score

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_page_quotes_the_figures() -> None:
    found = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))["diagnosis"]
    page = (DOCS / "diagnosis.md").read_text(encoding="utf-8")
    quoted = page.partition(f"{score.BEGIN}\n")[2].partition(f"\n{score.END}")[0]
    assert quoted == score.page_of(found), "run: make score"


def test_the_page_of_speed_is_that_of_the_figures() -> None:
    found = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))["speed"]
    page = (DOCS / "performance.md").read_text(encoding="utf-8")
    assert page == bench.page_of(found), "run: make bench"


@pytest.mark.parametrize(
    ("hidden", "named", "false"),
    [
        ("stiffness", [["platform_mass", "stiffness"]], 0),
        ("stiffness", [["platform_mass"]], 1),
        ("exit_friction", [["winch_side_length"]], 0),  # friction is on a cable behind the exit
        ("winch_side_length", [["exit_friction"]], 1),
    ],
)
def test_a_name_is_false_where_nothing_it_stands_for_is_hidden(
    hidden: str, named: list[list[str]], false: int
) -> None:
    row = {"hidden": {hidden: 8.0}, "named": named}
    assert len(score.false_names(row)) == false


def test_every_number_that_steers_says_where_it_comes_from() -> None:
    text = Path(score.priors.__file__).read_text(encoding="utf-8")
    names = re.findall(r"^([A-Z_, ]+) = ", text, re.MULTILINE)
    assert len([n for line in names for n in line.split(", ")]) <= 25
    assert len(re.findall(r'^"""', text, re.MULTILINE)) >= len(names)
