"""Compiling that takes long is told, once, and only what is not in the cache is compiled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from threading import Event

import numba
import pytest

from seecr.compiled import jit
from seecr.compiled.compile_notice import Watch, watch

LONG = 10.0  # [s] a thread that does not say it by then never does


def test_long_compiling_is_told_once_and_short_is_not() -> None:
    told: list[int] = []
    heard = Event()

    def say() -> None:
        told.append(1)
        heard.set()

    quick = Watch(say, 0.05)
    quick.begins()
    quick.ends()
    assert not heard.wait(0.2)
    slow = Watch(say, 0.0)
    slow.begins()
    slow.begins()  # one inside another
    assert heard.wait(LONG)
    slow.ends()
    slow.ends()
    slow.begins()
    assert slow._timer is None and told == [1]


def test_numba_tells_of_what_it_compiles_and_not_of_what_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(watch, "begins", lambda: seen.append("begins"))
    monkeypatch.setattr(watch, "ends", lambda: seen.append("ends"))
    assert jit.watch is watch

    @numba.njit  # type: ignore[misc]
    def twice(x: float) -> float:
        return 2.0 * x

    assert seen == []
    assert twice(1.0) == 2.0 and seen == ["begins", "ends"]
    assert twice(3.0) == 6.0 and seen == ["begins", "ends"]


LINE = "seecr: compiling the solver, only this first time; it takes a minute or two\n"
WAITS = """
import time
from seecr.compiled.compile_notice import watch

def wait():
    watch.patience = 0.0
    watch.begins()
    time.sleep(0.5)
"""
STARTED = "import sys, multiprocessing; sys.path.append('.'); from waits import wait\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("wait()", LINE),
        ("child = multiprocessing.get_context('spawn').Process(target=wait)\n"
         "child.start(); child.join(); assert child.exitcode == 0", ""),
    ],
    ids=["a program", "a process of its"],
)  # fmt: skip
def test_it_is_told_on_standard_error_once(code: str, said: str, tmp_path: Path) -> None:
    """To whoever called, in Python too; not by each process that shares the work."""
    (tmp_path / "waits.py").write_text(WAITS)
    code = f"{STARTED}if __name__ == '__main__':\n" + "\n".join(
        f"    {line}" for line in code.splitlines()
    )
    (tmp_path / "run.py").write_text(code)
    run = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert (run.stderr, run.stdout) == (said, "")
