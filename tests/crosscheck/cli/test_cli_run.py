"""``crosscheck run`` from outside: exit statuses, what is printed, what is written."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from crosscheck.cli import COMMANDS, main
from crosscheck.suite import effects as effect_suite
from crosscheck.suite import run as suite
from crosscheck.suite.cases import shipped_cases
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.cli.group import LazyGroup
from seecr.description.mjcf import model_path

SMALL = ("--case", "planar-two-cable", "--no-recordings", "--jobs", "1")
PLANAR = model_path("planar_vertical")


def run(*arguments: str | Path) -> Result:
    result = CliRunner().invoke(main, ["run", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


def refused(*arguments: str | Path) -> str:
    """The one line of an exit 2."""
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("crosscheck: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def changed(path: Path, folder: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert text.count(old) >= 1
    copy = folder / f"changed_{path.name}"
    copy.write_text(text.replace(old, new, 1))
    return copy


@pytest.mark.slow
def test_agreement_ends_0_and_writes_what_it_promises(tmp_path):
    out = tmp_path / "out"
    result = run(*SMALL, "--out", out)
    assert result.exit_code == 0
    assert "SEECR and MuJoCo agree at 24 poses of 1 case; worst difference" in result.stdout
    assert result.stderr == ""
    names = {"results.json", "junit.xml", "summary.md", "worst_pose.xml", "thresholds.toml"}
    assert {file.name for file in out.iterdir()} == names
    document = json.loads((out / "results.json").read_text())
    assert document["cases"][0]["name"] == "planar-two-cable"
    assert ET.parse(out / "junit.xml").getroot().find("testsuite").get("failures") == "0"


@pytest.mark.slow
def test_recordings_lie_beside_the_results(tmp_path):
    result = run("--case", "planar-two-cable", "--jobs", "1", "--out", tmp_path)
    assert result.exit_code == 0
    document = json.loads((tmp_path / "results.json").read_text())
    assert document["cases"][0]["recording"] == "planar-two-cable.rrd"
    assert (tmp_path / "planar-two-cable.rrd").stat().st_size > 10_000


@pytest.mark.slow
def test_json_goes_to_standard_output_and_nothing_else(tmp_path):
    result = run(*SMALL, "--json", "--out", tmp_path)
    assert result.exit_code == 0
    assert result.stdout == (tmp_path / "results.json").read_text()
    assert json.loads(result.stdout)["verdict"] == "agree"


@pytest.mark.slow
def test_one_stiffness_changed_by_a_thousandth_ends_1_and_names_the_case(tmp_path):
    stiffness = PLANAR.read_text().split('stiffness="')[1].split('"')[0]
    new = repr(float(stiffness) * 1.001)
    other = changed(PLANAR, tmp_path, f'stiffness="{stiffness}"', f'stiffness="{new}"')
    out = tmp_path / "out"
    arguments = ("--no-recordings", "--jobs", "1", "--out", out, "--case", "*-sweep")
    result = run("--robot", PLANAR, "--mujoco-robot", other, *arguments)
    assert result.exit_code == 1
    assert "SEECR and MuJoCo differ in planar_vertical-sweep" in result.stdout
    case = ET.parse(out / "junit.xml").getroot().find("testsuite/testcase")
    assert case.get("name") == "planar_vertical-sweep"
    assert case.find("failure") is not None
    assert "planar_vertical-sweep" in (out / "summary.md").read_text()
    # the same file on both sides agrees
    assert run("--robot", other, *arguments).exit_code == 0


@pytest.mark.slow
def test_what_of_the_users_mjcf_plays_no_part_is_told_once(tmp_path):
    rough = changed(PLANAR, tmp_path, '<joint name="x"', '<joint name="x" damping="2"')
    arguments = ("--no-recordings", "--jobs", "1", "--out", tmp_path / "out")
    result = run("--robot", rough, *arguments, "--json")
    assert result.exit_code == 0
    note = f"{rough}: switched off here: damping; only springs and gravity act on the platform"
    assert result.stderr.count("note: ") == 1 and note in result.stderr
    document = json.loads(result.stdout)
    assert len(document["notes"]) == 1 and document["notes"][0].startswith(note)
    assert "Note: " + note in (tmp_path / "out" / "summary.md").read_text()
    plain = run("--robot", PLANAR, *arguments, "--json")
    assert plain.stderr == "" and json.loads(plain.stdout)["notes"] == []


@pytest.mark.slow
def test_thresholds_of_the_users_hold(tmp_path):
    strict = tmp_path / "strict.toml"
    strict.write_text("[polished]\ntension_N = 1e-18\n")
    out = tmp_path / "out"
    result = run(*SMALL, "--thresholds", strict, "--out", out)
    assert result.exit_code == 1
    assert "planar-two-cable" in result.stdout
    assert "tension_N = 1e-18" in (out / "thresholds.toml").read_text()


@pytest.mark.slow
def test_a_solve_that_does_not_converge_ends_3(tmp_path, monkeypatch):
    import seecr

    def hurried(robot, poses, **options):
        return seecr.solve(robot, poses, **{**options, "max_iterations": 2})

    monkeypatch.setattr(suite, "seecr_solve", hurried)
    result = run(*SMALL, "--out", tmp_path)
    assert result.exit_code == 3
    assert "not every solve converged: see planar-two-cable" in result.stdout


EFFECT = "effect-demobot_parallel-platform_mass"


@pytest.mark.slow
def test_an_effect_is_a_case_like_any_other(tmp_path):
    result = run(*SMALL, "--case", EFFECT, "--out", tmp_path)
    assert result.exit_code == 0
    assert "1 effect on 1 robot against MuJoCo's own means (1): all agree; worst " in result.stdout
    assert "SEECR and MuJoCo agree at 24 poses of 1 case" in result.stdout
    document = json.loads((tmp_path / "results.json").read_text())
    (effect,) = document["effects"]
    assert (effect["name"], effect["robot"]) == (EFFECT, "demobot_parallel")
    assert (effect["effect"], effect["agrees"]) == ("platform_mass", True)
    # the agreement means something: the effect moves the platform by far more
    assert effect["position_m"] < 1e-8 < 1e-6 < effect["moved_m"]
    assert effect["orientation_rad"] < 1e-7 and effect["tension_N"] < 1e-6
    suites = ET.parse(tmp_path / "junit.xml").getroot().findall("testsuite")
    assert [suite.get("name") for suite in suites] == ["crosscheck run", "effects"]
    assert [case.get("name") for case in suites[1]] == [EFFECT]
    assert suites[1].get("failures") == "0"
    assert "| platform_mass | demobot_parallel |" in (tmp_path / "summary.md").read_text()


@pytest.mark.slow
def test_effects_alone_run_in_several_processes(tmp_path):
    (tmp_path / "worst_pose.xml").write_text("of an older run")
    result = run("--case", "effect-*-platform_mass", "--jobs", "2", "--out", tmp_path)
    assert result.exit_code == 0
    assert result.stdout.startswith(
        "1 effect on 2 robots against MuJoCo's own means (1): all agree; worst "
    )
    document = json.loads((tmp_path / "results.json").read_text())
    assert [effect["robot"] for effect in document["effects"]] == [
        "demobot_cogiro",
        "demobot_parallel",
    ]
    assert document["cases"] == []
    assert not (tmp_path / "worst_pose.xml").exists()


@pytest.mark.slow
def test_an_effect_that_differs_ends_1_and_is_named(tmp_path, monkeypatch):
    honest = effect_suite.measure

    def heavier(robot, commands, effects, **options):
        (effect,) = effects
        return honest(robot, commands, [replace(effect, added=1.01 * effect.added)], **options)

    monkeypatch.setattr(effect_suite, "measure", heavier)
    result = run(*SMALL, "--case", EFFECT, "--out", tmp_path)
    assert result.exit_code == 1
    assert f"1 of 1 case does not agree: {EFFECT}; worst" in result.stdout
    assert f"SEECR and MuJoCo differ in {EFFECT}; " in result.stdout
    assert json.loads((tmp_path / "results.json").read_text())["verdict"] == "differ"
    poses, effects = ET.parse(tmp_path / "junit.xml").getroot().findall("testsuite")
    assert (poses.get("failures"), effects.get("failures")) == ("0", "1")
    assert EFFECT in effects.find("testcase/failure").get("message")
    assert f"- {EFFECT}: position " in (tmp_path / "summary.md").read_text()


@pytest.mark.slow
def test_an_effect_without_rest_ends_3(tmp_path, monkeypatch):
    honest = effect_suite.measure

    def restless(*arguments, **options):
        truth = honest(*arguments, **options)
        at_rest = truth.at_rest.copy()
        at_rest[2] = False
        return replace(truth, at_rest=at_rest)

    monkeypatch.setattr(effect_suite, "measure", restless)
    result = run("--case", EFFECT, "--jobs", "1", "--out", tmp_path)
    assert result.exit_code == 3
    assert "no equilibrium at 1 of 16 poses" in result.stdout


def test_effects_are_a_group_of_the_shipped_robots(tmp_path):
    lines = run("--list", "--case", "effects").stdout.splitlines()
    demobots = [line for line in lines if line.startswith("effect-demobot_")]
    assert len(demobots) == 2 * (len(TRUE_EFFECTS) + 1)  # and known loads
    others = [line.split()[0] for line in lines if line not in demobots]
    assert others == ["effect-cogiro_large-cable_weight"]  # 15 m: its cables sag
    assert EFFECT in run("--list").stdout
    assert "effect-" not in run("--list", "--robot", PLANAR).stdout
    assert "--case effects: no such case" in refused("--robot", PLANAR, "--case", "effects")


def test_list_names_cases_and_runs_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("--list")
    assert result.exit_code == 0
    assert "parallel-fishing-z0.20" in result.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--case", "paralel-vectran-z0.1"), "the nearest are parallel-vectran-z0.10"),
        (("--robot", "no.xml"), "no.xml: no such file"),
        (("--mujoco-robot", "x.xml"), "--mujoco-robot needs --robot"),
        (("--thresholds", "no.toml"), "no.toml: no such file; expected thresholds"),
        (("--jobs", "0"), "expected a whole number of at least 1, got '0'"),
        (("--jobs", "two"), "expected a whole number of at least 1, got 'two'"),
        (("--seed", "-1"), "expected a whole number of at least 0, got '-1'"),
        (("--sed", "1"), "No such option '--sed'"),
        (("extra",), "unexpected extra argument"),
    ],
)
def test_bad_usage_is_one_line_and_2(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(*arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_robot_that_is_none(tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody>")
    assert "broken.xml" in refused("--robot", broken, "--out", tmp_path / "out")
    empty = tmp_path / "empty.xml"
    empty.write_text("<mujoco/>")
    assert "empty.xml" in refused("--robot", empty, "--out", tmp_path / "out")
    cut = changed(PLANAR, tmp_path, 'springlength="0 ', 'springlength="')
    assert cut.name in refused("--robot", cut, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_mjcf_of_another_robot_for_mujoco(tmp_path):
    other = model_path("demobot_cogiro")
    arguments = ("--robot", PLANAR, "--mujoco-robot", other, "--jobs", "1")
    text = refused(*arguments, "--out", tmp_path / "out")
    assert "demobot_cogiro.xml: 8 cables; expected 4 as in" in text
    assert not (tmp_path / "out").exists()


def test_an_output_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("kept")
    assert "cannot write there" in refused(*SMALL, "--out", tmp_path / "file")
    assert "cannot write there" in refused(*SMALL, "--out", tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.slow
def test_an_error_half_way_leaves_nothing(tmp_path, monkeypatch):
    from crosscheck.suite import write

    def full(*arguments):
        raise OSError(28, "No space left on device", "results.json")

    monkeypatch.setattr(write, "write_worst_pose", full)
    assert "results.json: No space left on device" in refused(*SMALL, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


# --- the group -----------------------------------------------------------------------------


def test_help_is_quick_and_imports_nothing_heavy():
    code = (
        "import sys, time; start = time.process_time()\n"
        "from crosscheck.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as done: assert done.code == 0\n"
        "print(time.process_time() - start, file=sys.stderr)\n"
        "heavy = {'numpy', 'mujoco', 'numba', 'rerun', 'scipy', 'rich', 'matplotlib'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stderr) < 0.3
    for name, (_, line) in COMMANDS.items():
        assert name in done.stdout
        assert line.split(",")[0].split(":")[0][:20] in done.stdout


def test_run_help_names_the_robots_of_all_shipped_cases():
    words = " ".join(run("--help").stdout.split()).replace("- ", "-").lower()
    names = {case.model.stem.removeprefix("demobot_") for case in shipped_cases()}
    told = {"off_centre": "centre of mass off"} | {
        name: "planar" for name in names if name.startswith("planar")
    }
    assert len(names) == 10
    assert [n for n in names if told.get(n, n.replace("_", "-")) not in words] == []


def test_run_help_shows_examples_without_running(monkeypatch):
    start = time.perf_counter()
    result = CliRunner().invoke(main, ["run", "--help"])
    assert time.perf_counter() - start < 1.0
    assert result.exit_code == 0
    assert "crosscheck run --case 'parallel-*' --out results" in result.stdout
    assert "Exit status: 0 all agree, 1 a threshold exceeded" in result.stdout


def test_version_no_command_and_unknown_command():
    from seecr import __version__

    result = CliRunner().invoke(main, ["--version"])
    assert result.output == f"crosscheck, version {__version__}\n"
    bare = CliRunner().invoke(main, [])
    assert bare.exit_code == 0
    assert bare.output.startswith("Usage: ")
    unknown = CliRunner().invoke(main, ["rum"])
    assert unknown.exit_code == 2
    assert unknown.stderr.startswith("crosscheck: No such command 'rum'")
    assert unknown.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_reader_who_leaves_is_no_error():
    code = "from crosscheck.cli import main; main(['run', '--list'])"
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.wait(timeout=60) == 141
    assert process.stderr.read() == b""
    process.stderr.close()


def test_interrupts_end_as_in_a_shell(monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setitem(COMMANDS, "probe", ("probe", ""))
    probe = click.command()(interrupted)
    monkeypatch.setattr(LazyGroup, "get_command", lambda self, ctx, name: probe)
    result = CliRunner().invoke(main, ["probe"])
    assert result.exit_code == 130
    assert result.stderr.strip() == "crosscheck: interrupted"


@pytest.mark.slow
def test_a_run_that_is_ended_leaves_nothing_unfinished(tmp_path: Path) -> None:
    """As a scheduler ends it, with SIGTERM."""
    out = tmp_path / "results"
    words = ["crosscheck", "run", "--case", "parallel-vectran-z0.10", "--jobs", "1"]
    called = f"import sys; sys.argv = {[*words, '--out', str(out)]!r}"
    code = f"{called}; from crosscheck.cli import main; main()"
    # it was aborted once, in a thousand: where, it is to say itself
    told = [sys.executable, "-X", "faulthandler", "-c", code]
    with subprocess.Popen(told, stderr=subprocess.PIPE, text=True) as run:
        while not list(tmp_path.glob("results/.unfinished-*")):
            assert run.poll() is None
            time.sleep(0.01)
        run.terminate()
        _out, said = run.communicate()
    assert run.returncode == 143, said
    assert not list(tmp_path.rglob("*.unfinished*")) and not list(tmp_path.rglob(".*"))
