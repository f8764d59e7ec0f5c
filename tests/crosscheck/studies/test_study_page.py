"""docs/study.md does what it says, and docs/formats.md has every column."""

from __future__ import annotations

from pathlib import Path

import pytest
from shown import Page

import crosscheck
from crosscheck.studies import cases

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.mark.slow
def test_the_page_works_as_written(tmp_path: Path) -> None:
    page = Page(tmp_path)
    page.run((DOCS / "study.md").read_text(encoding="utf-8"))
    assert [command.split()[1] for command in page.commands] == ["study", "study"]


def test_every_column_is_in_the_formats() -> None:
    text = (DOCS / "formats.md").read_text(encoding="utf-8").partition("## Cases: CSV")[2]
    assert [name for name in (*cases._HEAD, *cases._OPTIONS) if f"`{name}`" not in text] == []
    changes = ("mass_kg", "ea_N", "ea_3_N", "exit_2_x_mm", "anchor_2_x_mm")
    row = {"robot": "demobot_cogiro", "do": "map", "grid": 1, **dict.fromkeys(changes, 400)}
    row |= {"mass_kg": 1, "anchor_2_x_mm": 50, "pulley_radius.radius_m": 0.01}
    assert all(f"`{name}`" in text for name in (*changes, "pulley_radius.radius_m"))
    assert crosscheck.study([row]).rows[0]["poses"] == 1
