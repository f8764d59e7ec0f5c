"""The page on schemes of control prints what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest
from shown import Page

PAGE = Path(__file__).resolve().parents[3] / "docs" / "control.md"


@pytest.mark.slow
def test_the_page_works_as_written(tmp_path: Path) -> None:
    page = Page(tmp_path)
    page.run(PAGE.read_text(encoding="utf-8"))
    used = [tuple(command.split()[:2]) for command in page.commands]
    assert used == [("seecr", "control"), ("seecr", "control"), *2 * [("crosscheck", "control")]]
