"""Figures, whatever is drawn in them."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from seecr.report.drawing import figure


def drawn(path: Path) -> bytes:
    with figure(path, 1, 2, figsize=(2.0, 1.0)) as axes:
        axes[0, 1].plot([0.0, 1.0], [0.0, 1.0], label="a tension")
        axes[0, 1].set_title("a title")
        assert not path.exists()
    return path.read_bytes()


def test_the_same_is_drawn_into_the_same_file(tmp_path: Path) -> None:
    """Which tells that a picture in the repository is up to date."""
    first = drawn(tmp_path / "a.svg")
    assert drawn(tmp_path / "b.svg") == first
    assert b"<dc:date" not in first and b"a title</text>" in first


def test_a_figure_is_as_large_as_asked_for(tmp_path: Path) -> None:
    drawn(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (300, 150)


def test_what_fails_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), figure(tmp_path / "a.png"):
        raise RuntimeError
    assert not list(tmp_path.iterdir())
