"""Statuses: what nobody foresaw has one of its own, and is neither a failed gate nor bad input."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from crosscheck.cli import main as crosscheck
from seecr import load_robot, model_path
from seecr.cli import main as seecr
from seecr.errors import RobotError


@pytest.mark.parametrize("error", [ZeroDivisionError("by \x1b[31mnothing"), MemoryError()])
def test_a_defect_is_a_sentence_and_status_70(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fails(*_arguments: object) -> None:
        raise error

    monkeypatch.setattr("seecr.cli.arguments.robot_at", fails)
    words = ["pose", "demobot_parallel", "0.4", "0.25", "0.1"]
    done = CliRunner().invoke(seecr, words)
    assert done.exit_code == 70 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("seecr: a defect of seecr 0.") and type(error).__name__ in line
    assert "please report it" in line and "Traceback" not in line and "\x1b" not in line
    shown = CliRunner().invoke(seecr, [*words, "--debug"])
    assert shown.exit_code == 70 and "Traceback" in shown.stderr and "robot_at" in shown.stderr


def test_debug_changes_nothing_of_what_works() -> None:
    words = ["pose", "planar_vertical", "0.4", "0", "0.2"]
    plain, debug = (CliRunner().invoke(seecr, [*words, *more]) for more in ([], ["--debug"]))
    assert plain.exit_code == debug.exit_code == 0
    assert plain.stdout == debug.stdout


@pytest.mark.slow
def test_a_setting_that_numba_refuses_is_no_failed_gate(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_NUM_THREADS": "0"}
    words = [sys.executable, "-m", "seecr", "pose", "planar_vertical", "0.4", "0", "0.2"]
    done = subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 70
    assert b"NUMBA_NUM_THREADS" in done.stderr or b"threads" in done.stderr


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a device of Unix")
@pytest.mark.parametrize("command", ["robot", "data"])
def test_a_device_is_no_file(command: str, tmp_path: Path) -> None:
    robot = model_path("planar_vertical") if command == "data" else "/dev/zero"
    words = ["compare", str(robot), "/dev/zero", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(crosscheck, words)
    assert done.exit_code == 2 and "/dev/zero: is a device; expected" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["&#27;[31mred", "a&#7;b", "n" * 100_000])
def test_a_name_that_cannot_be_shown_is_refused_and_not_echoed(name: str, tmp_path: Path) -> None:
    robot = tmp_path / "robot.xml"
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    robot.write_text(text.replace('model="planar_vertical"', f'model="{name}"'))
    with pytest.raises(RobotError, match="cannot be shown; expected at most 100 char") as refused:
        load_robot(robot)
    said = str(refused.value)
    assert said.isprintable() and len(said) < 300 + len(str(robot))
