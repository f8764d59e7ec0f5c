"""Figures kept as they are about to be written, for tests of what they show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure


def keep_figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that would be written, the last one last; their files are empty.

    To lay a figure out and to write it takes most of its time, and a test that looks at its lines
    and words needs neither.
    """
    kept: list[Any] = []

    def keep(figure: Figure, path: str | Path, **_options: Any) -> None:
        kept.append(figure)
        Path(path).touch()

    monkeypatch.setattr(Figure, "savefig", keep)
    return kept
