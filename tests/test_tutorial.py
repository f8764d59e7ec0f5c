"""The tutorial's files and commands, in its order, print what it shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from remembered_twins import remember_twins
from shown import Page, assert_shown

import crosscheck.show.pictures

TUTORIAL = Path(__file__).resolve().parents[1] / "docs" / "tutorial.md"


@pytest.fixture
def pages_of_diagnoses(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Of seven pages the two richest alone are drawn; the list has their names."""
    drawn, write = list[str](), crosscheck.show.pictures.write_page

    def only_diagnoses(found: Any, path: Path, made: Any) -> None:
        if path.name == "diagnosis.html":
            write(found, path, made)
            drawn.append(path.name)

    monkeypatch.setattr(crosscheck.show.pictures, "write_page", only_diagnoses)
    return drawn


@pytest.mark.slow
def test_the_tutorial_works_as_written(
    tmp_path: Path, pages_of_diagnoses: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    remember_twins(monkeypatch)
    page = Page(tmp_path)
    page.run(TUTORIAL.read_text(encoding="utf-8"))
    used = {tuple(command.split()[:2]) for command in page.commands}
    assert used >= {("crosscheck", c) for c in ("plan", "compare", "diagnose", "add", "twin")}
    assert ("seecr", "correct") in used
    assert pages_of_diagnoses == 2 * ["diagnosis.html"]


def test_what_was_not_printed_is_seen() -> None:
    assert_shown("a\n...\nc\n", "a  \nb\nc\n")
    for other in ("c\n...\na\n", "a\nc\n", "a\n...\nca\n", "A\n"):
        with pytest.raises(AssertionError, match="was not printed"):
            assert_shown(other, "a\nb\nc\n")


def test_a_command_that_ends_otherwise_is_seen(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="nothing"):
        Page(tmp_path).run("look:\n\n```sh\nseecr pose nothing 0 0 0\n```\n")
    with pytest.raises(AssertionError, match="not a command of ours"):
        Page(tmp_path).run("look:\n\n```sh\nrm nothing\n```\n")
    Page(tmp_path).run("look:\n\n```sh\nseecr pose nothing 0 0 0  # ends 2\n```\n")
