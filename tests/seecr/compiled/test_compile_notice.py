"""Compiling that takes long is told, once, and only what is not in the cache is compiled."""

from __future__ import annotations

import subprocess
import sys
from threading import Event

import numba
import pytest

from seecr.compiled import compile_notice, jit
from seecr.compiled.compile_notice import Watch

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
    monkeypatch.setattr(compile_notice, "begins", lambda: seen.append("begins"))
    monkeypatch.setattr(compile_notice, "ends", lambda: seen.append("ends"))
    assert jit.compile_notice is compile_notice

    @numba.njit  # type: ignore[misc]
    def twice(x: float) -> float:
        return 2.0 * x

    assert seen == []
    assert twice(1.0) == 2.0 and seen == ["begins", "ends"]
    assert twice(3.0) == 6.0 and seen == ["begins", "ends"]


@pytest.mark.slow
def test_a_program_tells_it_on_standard_error_and_python_is_left_in_peace() -> None:
    code = """
import sys, time
from seecr.compiled import compile_notice
from seecr.cli import main
from click.testing import CliRunner
CliRunner().invoke(main, ["--help"])
assert compile_notice._watch is None
sys.argv = ["seecr", "--version"]
try:
    main()
except SystemExit:
    pass
compile_notice._watch._patience = 0.0
compile_notice.begins()
time.sleep(0.5)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (
        run.stderr == "seecr: compiling the solver, only this first time; it takes up to a minute\n"
    )
    assert run.stdout.startswith("seecr, version")
