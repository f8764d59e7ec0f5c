"""Compiled functions are kept on disk, and run where that cannot be."""

from __future__ import annotations

import errno
import os
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numba.core import caching
from sources import ROOT

from seecr.compiled import jit

SOURCE = """
import numpy as np
from seecr.compiled.jit import by_address, carray, jit, jit_allocating

@jit
def twice(number):
    return 2.0 * number

@jit_allocating
def thrice(number):
    found = np.empty(3)
    found[:] = number
    return found

def _first_of(numbers):
    return carray(numbers, 1)[0] > 0.0

by_address("seecr_test_of_the_cache", _first_of)
"""


def compiled(folder: Path) -> Callable[[float], float]:
    """A function of a module that was just imported, which knows of nothing compiled."""
    file = folder / "doubled.py"
    if not file.exists():
        file.write_text(SOURCE, encoding="utf-8")
    found: Callable[[float], float] = runpy.run_path(str(file))["twice"]
    return found


def test_a_full_disk_keeps_nothing_and_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    assert compiled(tmp_path)(2.0) == 4.0
    assert not list(tmp_path.rglob("*.nbi"))


def test_what_was_compiled_is_kept_and_damaged_files_are_replaced(tmp_path: Path) -> None:
    assert compiled(tmp_path)(2.0) == 4.0
    kept = sorted(tmp_path.rglob("*.nb?"))
    assert len(kept) == 4  # an index and a function of each
    again: Any = compiled(tmp_path)
    assert again(3.0) == 6.0
    assert again.stats.cache_hits
    for damage in (b"", b"\x80\x05K", bytes(range(200))):
        for file in kept:
            file.write_bytes(damage)
        assert compiled(tmp_path)(2.0) == 4.0
        assert all(file.read_bytes() != damage for file in kept)


def test_nothing_is_kept_for_other_sources_of_what_it_calls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A release in which only a function that it calls is another one must compile it anew."""
    assert compiled(tmp_path)(2.0) == 4.0
    with monkeypatch.context() as released:
        released.setattr(jit, "_SOURCES", "those of another release")
        other: Any = compiled(tmp_path)
        assert other(2.0) == 4.0
        assert other.stats.cache_misses and not other.stats.cache_hits
    again: Any = compiled(tmp_path)
    assert again(2.0) == 4.0
    assert again.stats.cache_hits


def test_what_was_compiled_is_loaded_without_what_compiles(tmp_path: Path) -> None:
    code = (
        "import sys; from doubled import thrice, twice; told = thrice(2.0);"
        "print(told.sum(), twice(told[0]), 'numba.np.arraymath' in sys.modules)"
    )
    compiled(tmp_path)  # writes the module
    runs = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        )
        for _ in range(2)
    ]  # fmt: skip
    assert [run.stdout for run in runs] == ["6.0 4.0 True\n", "6.0 4.0 False\n"]


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere(*_: Any) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(caching.FunctionCache, "__init__", nowhere)
    assert compiled(tmp_path)(2.0) == 4.0
    assert not list(tmp_path.rglob("*.nbi"))
