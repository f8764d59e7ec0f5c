"""``crosscheck run`` and its group from outside: exit statuses, what is printed and written."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial
from pathlib import Path

import called
import click
import pytest
from called import ran

from crosscheck.cli import COMMANDS
from crosscheck.suite import effects as effect_suite
from crosscheck.suite import run as suite
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr import model_path
from seecr.cli.group import LazyGroup
from seecr.folders import MANIFEST, staged
from seecr.version import full_version

SMALL = ("--case", "planar-two-cable", "--no-recordings", "--jobs", "1")
PLANAR = model_path("planar_vertical")
EFFECT = "effect-demobot_parallel-platform_mass"

run, refused = partial(called.run, "run"), partial(called.refused, "run")


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def results(out):
    return json.loads((out / "results.json").read_text())


def suites(out):
    return ET.parse(out / "junit.xml").getroot().findall("testsuite")


def changed(path: Path, folder: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert text.count(old) >= 1
    copy = folder / f"changed_{path.name}"
    copy.write_text(text.replace(old, new, 1))
    return copy


@pytest.mark.slow
def test_agreement_ends_0_and_writes_what_it_promises(out):
    result = run(*SMALL, "--out", out)
    assert result.exit_code == 0 and result.stderr == ""
    assert "SEECR and MuJoCo agree at 24 poses of 1 case; worst difference" in result.stdout
    names = {"results.json", "junit.xml", "summary.md", "worst_pose.xml", "thresholds.toml"}
    assert {file.name for file in out.iterdir()} == {*names, MANIFEST}
    assert results(out)["cases"][0]["name"] == "planar-two-cable"
    assert suites(out)[0].get("failures") == "0"


@pytest.mark.slow
def test_recordings_lie_beside_the_results_which_json_prints_alone(out):
    result = run("--case", "planar-two-cable", "--jobs", "1", "--json", "--out", out)
    assert result.exit_code == 0
    assert result.stdout == (out / "results.json").read_text()
    assert results(out)["verdict"] == "agree"
    assert results(out)["cases"][0]["recording"] == "planar-two-cable.rrd"
    assert (out / "planar-two-cable.rrd").stat().st_size > 10_000


@pytest.mark.slow
def test_one_stiffness_changed_by_a_thousandth_ends_1_and_names_the_case(tmp_path, out):
    stiffness = PLANAR.read_text().split('stiffness="')[1].split('"')[0]
    new = repr(float(stiffness) * 1.001)
    other = changed(PLANAR, tmp_path, f'stiffness="{stiffness}"', f'stiffness="{new}"')
    arguments = ("--no-recordings", "--jobs", "1", "--out", out, "--case", "*-sweep")
    result = run("--robot", PLANAR, "--mujoco-robot", other, *arguments)
    assert result.exit_code == 1
    assert "SEECR and MuJoCo differ in planar_vertical-sweep" in result.stdout
    case = suites(out)[0].find("testcase")
    assert case.get("name") == "planar_vertical-sweep" and case.find("failure") is not None
    assert "planar_vertical-sweep" in (out / "summary.md").read_text()
    # the same file on both sides agrees
    assert run("--robot", other, *arguments).exit_code == 0


@pytest.mark.slow
def test_what_of_the_users_mjcf_plays_no_part_is_told_once(tmp_path, out):
    rough = changed(PLANAR, tmp_path, '<joint name="x"', '<joint name="x" damping="2"')
    arguments = ("--no-recordings", "--jobs", "1", "--out", out, "--json")
    result = run("--robot", rough, *arguments)
    assert result.exit_code == 0
    note = f"{rough}: switched off here: damping; only springs and gravity act on the platform"
    assert result.stderr.count("note: ") == 1 and note in result.stderr
    (told,) = json.loads(result.stdout)["notes"]
    assert told.startswith(note)
    assert "Note: " + note in (out / "summary.md").read_text()
    plain = run("--robot", PLANAR, *arguments)
    assert plain.stderr == "" and json.loads(plain.stdout)["notes"] == []


@pytest.mark.slow
def test_thresholds_of_the_users_hold(tmp_path, out):
    strict = tmp_path / "strict.toml"
    strict.write_text("[polished]\ntension_N = 1e-18\n")
    result = run(*SMALL, "--thresholds", strict, "--out", out)
    assert result.exit_code == 1 and "planar-two-cable" in result.stdout
    assert "tension_N = 1e-18" in (out / "thresholds.toml").read_text()


@pytest.mark.slow
def test_a_solve_that_does_not_converge_ends_3(out, monkeypatch):
    monkeypatch.setattr(suite, "seecr_solve", partial(suite.seecr_solve, max_iterations=2))
    result = run(*SMALL, "--out", out)
    assert result.exit_code == 3
    assert "not every solve converged: see planar-two-cable" in result.stdout


@pytest.mark.slow
def test_an_effect_is_a_case_like_any_other(out):
    result = run(*SMALL, "--case", EFFECT, "--out", out)
    assert result.exit_code == 0
    assert "1 effect on 1 robot against MuJoCo's own means (1): all agree; worst " in result.stdout
    assert "SEECR and MuJoCo agree at 24 poses of 1 case" in result.stdout
    (effect,) = results(out)["effects"]
    assert (effect["name"], effect["robot"]) == (EFFECT, "demobot_parallel")
    assert (effect["effect"], effect["agrees"]) == ("platform_mass", True)
    # the agreement means something: the effect moves the platform by far more
    assert effect["position_m"] < 1e-8 < 1e-6 < effect["moved_m"]
    assert effect["orientation_rad"] < 1e-7 and effect["tension_N"] < 1e-6
    poses, effects = suites(out)
    assert [poses.get("name"), effects.get("name")] == ["crosscheck run", "effects"]
    assert [case.get("name") for case in effects] == [EFFECT]
    assert effects.get("failures") == "0"
    assert "| platform_mass | demobot_parallel |" in (out / "summary.md").read_text()


@pytest.mark.slow
def test_effects_alone_run_in_several_processes(tmp_path):
    with staged(tmp_path) as older:
        (older / "worst_pose.xml").write_text("of an older run")
    result = run("--case", "effect-*-platform_mass", "--jobs", "2", "--out", tmp_path)
    assert result.exit_code == 0
    said = "1 effect on 2 robots against MuJoCo's own means (1): all agree; worst "
    assert result.stdout.startswith(said)
    robots = [effect["robot"] for effect in results(tmp_path)["effects"]]
    assert robots == ["demobot_cogiro", "demobot_parallel"]
    assert results(tmp_path)["cases"] == []
    assert not (tmp_path / "worst_pose.xml").exists()


@pytest.mark.slow
def test_an_effect_that_differs_ends_1_and_is_named(out, monkeypatch):
    honest = effect_suite.measure

    def heavier(robot, commands, effects, **options):
        (effect,) = effects
        return honest(robot, commands, [replace(effect, added=1.01 * effect.added)], **options)

    monkeypatch.setattr(effect_suite, "measure", heavier)
    result = run(*SMALL, "--case", EFFECT, "--out", out)
    assert result.exit_code == 1
    assert f"1 of 1 case does not agree: {EFFECT}; worst" in result.stdout
    assert f"SEECR and MuJoCo differ in {EFFECT}; " in result.stdout
    assert results(out)["verdict"] == "differ"
    poses, effects = suites(out)
    assert (poses.get("failures"), effects.get("failures")) == ("0", "1")
    assert EFFECT in effects.find("testcase/failure").get("message")
    assert f"- {EFFECT}: position " in (out / "summary.md").read_text()


@pytest.mark.slow
def test_an_effect_without_rest_ends_3(out, monkeypatch):
    honest = effect_suite.measure

    def restless(*arguments, **options):
        truth = honest(*arguments, **options)
        return replace(truth, at_rest=truth.at_rest & ([True, True, False] + 13 * [True]))

    monkeypatch.setattr(effect_suite, "measure", restless)
    result = run("--case", EFFECT, "--jobs", "1", "--out", out)
    assert result.exit_code == 3
    assert "no equilibrium at 1 of 16 poses" in result.stdout


def test_cases_are_listed_and_nothing_is_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    every = run("--list")
    assert every.exit_code == 0 and list(tmp_path.iterdir()) == []
    assert "parallel-fishing-z0.20" in every.stdout and EFFECT in every.stdout
    lines = run("--list", "--case", "effects").stdout.splitlines()
    demobots = [line for line in lines if line.startswith("effect-demobot_")]
    assert len(demobots) == 2 * (len(TRUE_EFFECTS) + 1)  # and known loads
    others = [line.split()[0] for line in lines if line not in demobots]
    assert others == ["effect-cogiro_large-cable_weight"]  # 15 m: its cables sag
    assert "effect-" not in run("--list", "--robot", PLANAR).stdout
    assert "--case effects: no such case" in refused("--robot", PLANAR, "--case", "effects")


OTHER = ("--robot", PLANAR, "--mujoco-robot", model_path("demobot_cogiro"), "--jobs", "1")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--case", "paralel-vectran-z0.1"), "the nearest are parallel-vectran-z0.10"),
        (("--robot", "no.xml"), "no.xml: no such file"),
        (("--robot", "broken.xml"), "broken.xml"),
        (("--robot", "empty.xml"), "empty.xml"),
        (("--robot", "changed_planar_vertical.xml"), "changed_planar_vertical.xml"),
        (OTHER, "demobot_cogiro.xml: 8 cables; expected 4 as in"),
        (("--mujoco-robot", "x.xml"), "--mujoco-robot needs --robot"),
        (("--thresholds", "no.toml"), "no.toml: no such file; expected thresholds"),
        (("--jobs", "0"), "expected a whole number of at least 1, got '0'"),
        (("--jobs", "two"), "expected a whole number of at least 1, got 'two'"),
        (("--seed", "-1"), "expected a whole number of at least 0, got '-1'"),
        (("--sed", "1"), "No such option"),
        (("extra",), "unexpected extra argument"),
        ((*SMALL, "--out", "empty.xml"), "cannot write there"),
        ((*SMALL, "--out", "empty.xml/below"), "cannot write there"),
    ],
)
def test_bad_usage_is_one_line_and_2(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    Path("broken.xml").write_text("<mujoco><worldbody>")
    Path("empty.xml").write_text("<mujoco/>")
    changed(PLANAR, tmp_path, 'springlength="0 ', 'springlength="0.1 ')
    before = {path: path.read_text() for path in tmp_path.iterdir()}
    assert message in refused(*arguments)
    assert {path: path.read_text() for path in tmp_path.iterdir()} == before


@pytest.mark.slow
def test_an_error_half_way_leaves_nothing(out, monkeypatch):
    def full(*_arguments):
        raise OSError(28, "No space left on device", "results.json")

    monkeypatch.setattr("crosscheck.suite.write.write_worst_pose", full)
    assert "results.json: No space left on device" in refused(*SMALL, "--out", out)
    assert not out.exists()


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


def test_version_no_command_and_unknown_command():
    assert ran("crosscheck --version").output == f"crosscheck, version {full_version()}\n"
    assert ran("crosscheck", 0).output.startswith("Usage: ")
    assert called.refused("rum").startswith("crosscheck: No such command 'rum'")


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
    assert ran("crosscheck probe", 130).stderr.strip() == "crosscheck: interrupted"


@pytest.mark.slow
def test_a_run_that_is_ended_leaves_nothing_unfinished(tmp_path):
    """As a scheduler ends it, with SIGTERM."""
    out = tmp_path / "results"
    words = ["crosscheck", "run", "--case", "parallel-vectran-z0.10", "--jobs", "1"]
    called = f"import sys; sys.argv = {[*words, '--out', str(out)]!r}"
    code = f"{called}; from crosscheck.cli import main; main()"
    # it was aborted once, in a thousand: where, it is to say itself
    told = [sys.executable, "-X", "faulthandler", "-c", code]
    with subprocess.Popen(told, stderr=subprocess.PIPE, text=True) as process:
        while not list(tmp_path.glob("results/.unfinished-*")):
            assert process.poll() is None
            time.sleep(0.01)
        process.terminate()
        _out, said = process.communicate()
    assert process.returncode == 143 and said == "crosscheck: ended by SIGTERM\n", said
    assert not list(tmp_path.rglob("*.unfinished*")) and not list(tmp_path.rglob(".*"))
