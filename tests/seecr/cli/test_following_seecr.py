"""Each command of seecr names the next one, which runs as it is said; each JSON says its making."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from called import BARE, as_json, following, ran

from seecr import load_robot, model_path
from seecr.cli.following import following as next_line

COGIRO = "demobot_cogiro"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands write into a folder of the test."""
    monkeypatch.chdir(tmp_path)


def test_programs_of_an_environment_that_is_not_active_are_named_by_their_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the command that runs was: `.venv/bin/crosscheck`."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("crosscheck", "rerun"):
        (programs / name).touch(mode=0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["bin/crosscheck", "run"])
    assert next_line("rerun", "a file.rrd") == "next: bin/rerun 'a file.rrd'"
    assert next_line("seecr", "map") == "next: seecr map"  # there is none
    monkeypatch.setenv("PATH", str(programs))
    assert next_line("rerun", "a.rrd") == "next: rerun a.rrd"
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["bin/pytest"])
    assert next_line("rerun", "a.rrd") == "next: rerun a.rrd"


def test_from_a_pose_to_a_workspace_to_a_plan() -> None:
    told = following(ran(f"seecr pose {COGIRO} 0.3 0.2 0.15 --alone --cable 3000"))
    assert told == f"seecr sweep {COGIRO} --line 0.4 0.25 0.15 0.3 0.2 0.15 --cable 3000"
    told = following(ran(f"{told} --count 2 {BARE}"))
    assert told == f"seecr map {COGIRO} --cable 3000"
    told = following(ran(f"{told} --grid 0.4 0.25 0.1:0.15:2 --no-elastic --highest 40 {BARE}"))
    assert told == f"crosscheck plan {COGIRO} --rows 40 --highest 40"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "place", "told"),
    [
        (COGIRO, "0.4 0.25 0.15", " --model m.toml --no-elastic"),
        ("planar_two_cable", "0.5 0 0.5", ""),  # without the model
    ],
)
def test_a_model_with_history_is_mapped_as_far_as_a_map_knows_it(
    robot: str, place: str, told: str
) -> None:
    """A map refuses to solve its poses, which are in no order; it was proposed all the same."""
    Path("m.toml").write_text('[[effect]]\nname = "backlash"\nparameters.gap_m = 0.002\n')
    at = " ".join(map(str, load_robot(robot).reference_pose[:3].tolist()))
    for words in (f"pose {robot} {at}", f"sweep {robot} --line {at} {at} {BARE}"):
        said = following(ran(f"seecr {words} --model m.toml"))
        assert said == f"seecr map {robot}{told}"
    ran(f"{said} --grid {place} {BARE}", 0)


def test_from_wanted_poses_to_what_is_told_and_back() -> None:
    Path("my poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.1\n0.42,0.25,0.1\n")
    Path("m.toml").write_text("format = 1\n")
    told = following(ran(f"seecr sweep {COGIRO} 'my poses.csv' --model m.toml {BARE}"))
    assert told == f"seecr correct {COGIRO} 'my poses.csv' --model m.toml"
    told = following(ran(told))
    corrected = "seecr-correction/corrected.csv"
    assert told == f"seecr sweep {COGIRO} {corrected} --model m.toml"
    assert following(ran(f"{told} {BARE}")) == f"crosscheck plan {COGIRO} {corrected}"
    told = following(ran(f"seecr export {COGIRO} out.xml"))
    assert told == "seecr pose out.xml 0.4 0.25 0.15"
    assert following(ran(f"{told} --alone")).startswith("seecr map out.xml")
    for name in ("seecr-correction/correction.json", "seecr-sweep/sweep.json"):
        made = json.loads(Path(name).read_text())["made"]
        assert made["command"].startswith("seecr ") and "--model m.toml" in made["command"]
        assert made["sha256"]["m.toml"] == hashlib.sha256(b"format = 1\n").hexdigest()[:16]
        assert model_path(COGIRO).name in made["sha256"] and len(made["sha256"]) >= 3


@pytest.mark.parametrize(
    "words",
    [
        f"seecr pose {COGIRO} 0.4 0.25 0.1 --alone",
        f"seecr map {COGIRO} --grid 0.4 0.25 0.1:0.15:2 --no-elastic {BARE}",
        f"seecr export {COGIRO} 'my out.xml'",
    ],
)
def test_each_json_says_how_it_was_made(words: str) -> None:
    made = as_json(words)["made"]
    assert made["command"] == f"{words} --json"
    assert list(made["sha256"]) == [model_path(COGIRO).name] and made["version"] and made["date"]


@pytest.mark.parametrize("given", ["/dev/stdin", "/dev/fd/63", "pipe"])
def test_what_came_through_a_pipe_is_not_named_again(given: str, tmp_path: Path) -> None:
    """Standard input was to be read twice."""
    os.mkfifo(tmp_path / "pipe")
    saved = "  # INPUT: what came through the pipe, saved as a file"
    line = next_line("seecr", "map", tmp_path / given, "--turned", 1)
    assert line.partition("map")[2] == f" INPUT --turned 1{saved}"
    assert next_line("seecr", "map", Path("a.csv")).endswith("map a.csv")


@pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="no standard input with a path here")
def test_a_dash_is_standard_input() -> None:
    """It was no such file."""
    text = "cmd_x_m,cmd_y_m,cmd_z_m\n0.3,0.25,0.15\n0.35,0.25,0.15\n"
    args = [sys.executable, "-m", "seecr", "sweep", COGIRO, "-", *shlex.split(BARE)]
    done = subprocess.run(args, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{COGIRO}: 2 of 2 poses at rest" in done.stdout
    assert f" correct {COGIRO} INPUT  # INPUT: what came" in done.stdout
