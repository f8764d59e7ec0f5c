"""The tests' own guard against functions that were compiled from older sources."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from stale import forget_stale


@pytest.mark.parametrize("edited", [None, "law", "descent"])
def test_an_edit_of_any_compiled_file_forgets_all(tmp_path: Path, edited: str | None) -> None:
    """Sources are of time 1000 [s], what was compiled of 2000, an edit of 3000."""
    compiled = [
        tmp_path / "__pycache__" / f"kernel.solve-1.py311.{kind}" for kind in ("nbi", "1.nbc")
    ]
    times = {tmp_path / "compiled" / f"{name}.py": 1000.0 for name in ("law", "descent")}
    times |= dict.fromkeys(compiled, 2000.0)
    if edited:
        times[tmp_path / "compiled" / f"{edited}.py"] = 3000.0
    for path, time in times.items():
        path.parent.mkdir(exist_ok=True)
        path.touch()
        os.utime(path, (time, time))
    assert sorted(forget_stale(tmp_path)) == (sorted(compiled) if edited else [])
    assert (
        not any(path.exists() for path in compiled) if edited else all(map(Path.exists, compiled))
    )
