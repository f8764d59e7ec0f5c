"""How long work takes is said on a terminal before it takes it, and nowhere else."""

from __future__ import annotations

import sys

import pytest

from seecr.cli.durations import say_duration


def said(capsys: pytest.CaptureFixture[str], *given: object, **more: object) -> str:
    say_duration(*given, **more)  # type: ignore[arg-type]
    out, err = capsys.readouterr()
    assert out == ""
    return err


def test_a_terminal_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert said(capsys, "diagnose", 144, "rows") == ""  # no terminal
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    # 1.5 s + 144 x 0.027 s
    assert said(capsys, "diagnose", 144, "rows", more=", or longer") == (
        "about 5 s for 144 rows, or longer\n"
    )
    assert said(capsys, "diagnose", 10_000, "rows") == "about 5 min for 10000 rows\n"
    assert said(capsys, "run", 2868, "poses", at_once=2) == "about 20 s for 2868 poses\n"
    assert said(capsys, "diagnose", 144, "rows", True) == ""  # JSON alone
    assert said(capsys, "map", 1000, "poses") == ""  # done before it is read
