"""The tests' own guard against functions that were compiled from older sources."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from stale import forget_stale

COMPILED = ("law", "descent", "walk")


def package(folder: Path, compiled_at: float) -> list[Path]:
    """Sources of time 1000 [s], and two files of a function compiled at a time."""
    cache = folder / "__pycache__"
    cache.mkdir()
    kept = [cache / "kernel.solve-1.py311.nbi", cache / "kernel.solve-1.py311.1.nbc"]
    for path in kept:
        path.touch()
        os.utime(path, (compiled_at, compiled_at))
    (folder / "compiled").mkdir()
    for name in COMPILED:
        source = folder / "compiled" / f"{name}.py"
        source.touch()
        os.utime(source, (1000.0, 1000.0))
    return kept


def test_what_is_newer_than_its_sources_is_kept(tmp_path: Path) -> None:
    kept = package(tmp_path, 2000.0)
    assert forget_stale(tmp_path) == [] and all(path.exists() for path in kept)


@pytest.mark.parametrize("edited", COMPILED)
def test_an_edit_of_any_compiled_file_forgets_all(tmp_path: Path, edited: str) -> None:
    kept = package(tmp_path, 2000.0)
    os.utime(tmp_path / "compiled" / f"{edited}.py", (3000.0, 3000.0))
    assert sorted(forget_stale(tmp_path)) == sorted(kept)
    assert not any(path.exists() for path in kept)
