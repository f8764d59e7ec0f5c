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
from click.testing import CliRunner, Result

from crosscheck.cli import main as crosscheck_main
from seecr.cli import main as seecr_main
from seecr.cli.following import following as next_line
from seecr.description.mjcf import load_robot, model_path

QUIET = ("--figure", "none", "--no-recording")
COGIRO = model_path("demobot_cogiro")


def run(program: str, *args: object) -> Result:
    main = {"seecr": seecr_main, "crosscheck": crosscheck_main}[program]
    return CliRunner().invoke(main, [str(a) for a in args], prog_name=program)


def following(result: Result) -> list[str]:
    assert result.exit_code == 0, result.output
    line = result.stdout.splitlines()[-1]
    assert line.startswith("next: "), result.stdout
    return shlex.split(line, comments=True)[1:]


def test_programs_of_an_environment_that_is_not_active_are_named_by_their_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the command that runs was: `.venv/bin/crosscheck`."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("crosscheck", "rerun"):
        (programs / name).touch(mode=0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["bin/crosscheck", "run"])
    beside = str(Path("bin", "rerun"))
    assert next_line("rerun", "a file.rrd") == f"next: {shlex.join([beside, 'a file.rrd'])}"
    assert next_line("seecr", "map") == "next: seecr map"  # there is none
    monkeypatch.setenv("PATH", str(programs))
    assert next_line("rerun", "a.rrd") == "next: rerun a.rrd"
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["bin/pytest"])
    assert next_line("rerun", "a.rrd") == "next: rerun a.rrd"


def test_from_a_pose_to_a_workspace_to_a_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    place = ("0.3", "0.2", "0.15")
    told = following(run("seecr", "pose", "demobot_cogiro", *place, "--alone", "--cable", "3000"))
    line = ["--line", "0.4", "0.25", "0.15", *place]
    assert told == ["seecr", "sweep", "demobot_cogiro", *line, "--cable", "3000"]
    told = following(run(*told, "--count", 2, *QUIET))
    assert told == ["seecr", "map", "demobot_cogiro", "--cable", "3000"]
    grid = ("--grid", "0.4", "0.25", "0.1:0.15:2", "--no-elastic", "--highest", "40")
    told = following(run(*told, *grid, *QUIET))
    assert told == ["crosscheck", "plan", "demobot_cogiro", "--rows", "40", "--highest", "40"]


PLAY = """format = 1
[[effect]]
name = "backlash"
[effect.parameters]
gap_m = 0.002
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "place", "told"),
    [
        ("demobot_cogiro", ("0.4", "0.25", "0.15"), ["--model", "m.toml", "--no-elastic"]),
        ("planar_two_cable", ("0.5", "0", "0.5"), []),  # without the model
    ],
)
def test_a_model_with_history_is_mapped_as_far_as_a_map_knows_it(
    robot: str, place: tuple[str, ...], told: list[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A map refuses to solve its poses, which are in no order; it was proposed all the same."""
    monkeypatch.chdir(tmp_path)
    Path("m.toml").write_text(PLAY)
    at, model = load_robot(robot).reference_pose[:3].tolist(), ("--model", "m.toml")
    for words in (("pose", robot, *at), ("sweep", robot, "--line", *at, *at, *QUIET)):
        said = following(run("seecr", *words, *model))
        assert said == ["seecr", "map", robot, *told]
    grid = ("--grid", *place)
    assert run(*said, *grid, *QUIET).exit_code == 0


def test_from_wanted_poses_to_what_is_told_and_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.1\n0.42,0.25,0.1\n")
    Path("m.toml").write_text("format = 1\n")
    model = ["--model", "m.toml"]
    told = following(run("seecr", "sweep", "demobot_cogiro", "my poses.csv", *model, *QUIET))
    assert told == ["seecr", "correct", "demobot_cogiro", "my poses.csv", *model]
    told = following(run(*told))
    corrected = "seecr-correction/corrected.csv"
    assert told == ["seecr", "sweep", "demobot_cogiro", corrected, *model]
    told = following(run(*told, *QUIET))
    assert told == ["crosscheck", "plan", "demobot_cogiro", corrected]
    told = following(run("seecr", "export", "demobot_cogiro", "out.xml"))
    assert told == ["seecr", "pose", "out.xml", "0.4", "0.25", "0.15"]
    assert following(run(*told, "--alone"))[:3] == ["seecr", "map", "out.xml"]
    for name in ("seecr-correction/correction.json", "seecr-sweep/sweep.json"):
        made = json.loads(Path(name).read_text())["made"]
        assert made["command"].startswith("seecr ") and "--model m.toml" in made["command"]
        assert made["sha256"]["m.toml"] == hashlib.sha256(b"format = 1\n").hexdigest()[:16]
        assert COGIRO.name in made["sha256"] and len(made["sha256"]) >= 3


@pytest.mark.parametrize(
    "args",
    [
        ("pose", "demobot_cogiro", "0.4", "0.25", "0.1", "--alone"),
        ("map", "demobot_cogiro", "--grid", "0.4", "0.25", "0.1:0.15:2", "--no-elastic", *QUIET),
        ("export", "demobot_cogiro", "out.xml"),
    ],
    ids=lambda args: args[0],
)
def test_each_json_says_how_it_was_made(
    args: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made = json.loads(run("seecr", *args, "--json").stdout)["made"]
    assert made["command"] == shlex.join(["seecr", *args, "--json"])
    assert list(made["sha256"]) == [COGIRO.name] and made["version"] and made["date"]


@pytest.mark.slow
def test_where_no_pose_can_be_corrected_the_workspace_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file of what to tell the winches is empty then: nothing can be swept."""
    monkeypatch.chdir(tmp_path)
    Path("p.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.1\n")
    lost = run("seecr", "correct", "demobot_cogiro", "p.csv", "--lowest", "1e9")
    assert lost.exit_code == 3
    assert lost.stdout.splitlines()[-1] == "next: seecr map demobot_cogiro"


@pytest.mark.parametrize("given", ["/dev/stdin", "/dev/fd/63", "pipe"])
def test_what_came_through_a_pipe_is_not_named_again(given: str, tmp_path: Path) -> None:
    """Standard input was to be read twice."""
    os.mkfifo(tmp_path / "pipe")
    saved = "  # INPUT: what came through the pipe, saved as a file"
    line = next_line("seecr", "map", tmp_path / given, "--turned", 1)
    assert line.split(" ", 1)[1].partition("map")[2] == f" INPUT --turned 1{saved}"
    assert next_line("seecr", "map", Path("a.csv")).endswith("map a.csv")


@pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="no standard input with a path here")
def test_a_dash_is_standard_input(tmp_path: Path) -> None:
    """It was no such file."""
    text = "cmd_x_m,cmd_y_m,cmd_z_m\n0.3,0.25,0.15\n0.35,0.25,0.15\n"
    args = ["-m", "seecr", "sweep", "demobot_cogiro", "-", *QUIET, "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, *args], input=text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "demobot_cogiro: 2 of 2 poses at rest" in done.stdout
    assert " correct demobot_cogiro INPUT  # INPUT: what came" in done.stdout
