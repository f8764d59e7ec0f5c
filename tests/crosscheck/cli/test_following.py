"""Each command ends by naming the next one, with its arguments: the story has no dead ends."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest
from made_data import case, run

from crosscheck.cli.following import Given, after_comparison, after_diagnosis, after_fit
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.words import measured
from crosscheck.show.effects import parameter_lines

ONLY = ("--only", "pulley_radius")


def last(result):
    assert result.exit_code == 0, result.output
    line = result.stdout.splitlines()[-1]
    assert line.startswith("next: "), result.stdout
    return shlex.split(line, comments=True)[1:]


@pytest.mark.slow
def test_from_a_plan_to_a_model_by_the_commands_that_each_names(tmp_path, monkeypatch, unpaged):
    """What a command says next is run as it is said, until nothing is missing."""
    monkeypatch.chdir(tmp_path)
    xml, data = case(Path(), {"pulley_radius": {"radius_m": 0.01}}, points=4)
    planned = last(run("plan", xml, data))
    assert planned == ["crosscheck", "diagnose", str(xml), str(data)]
    told = last(run("compare", xml, data))
    assert told == planned
    told = last(run(*told[1:], *ONLY, "--no-recording"))
    assert told[1:4] == ["add", "--all-from", "crosscheck-diagnosis/diagnosis.json"]
    told = last(run(*told[1:]))
    assert told == ["crosscheck", "compare", str(xml), str(data), "--model", "model.toml"]
    told = last(run(*told[1:], "--no-recording"))
    assert told == ["seecr", "correct", str(xml), str(data), "--model", "model.toml"]


def test_the_catalogue_and_an_opened_twin_name_a_next_command():
    assert last(run("effects"))[:2] == ["crosscheck", "effects"]
    told = last(run("effects", "backlash"))
    assert told == [
        *["crosscheck", "add", "backlash", "ROBOT.xml", "DATA.csv", "--model", "model.toml"]
    ]


@pytest.mark.parametrize(
    ("verdict", "missing", "model", "kept", "expected"),
    [
        ("effects_found", True, None, None, "add --all-from out/diagnosis.json R D"),
        ("effects_found", True, "M", None, "add --all-from out/diagnosis.json R D --model M"),
        ("effects_found", True, None, "N", "compare R D --model N"),
        ("many_effects", True, None, None, "calibrate R D --model model.toml"),
        ("no_effect_missing", False, None, None, "plan R D"),
        ("no_effect_missing", False, "M", None, "correct R D --model M"),
        ("unknown_effect", False, None, None, "plan R D"),
        ("no_verdict", False, None, None, "plan R --rows 40"),
    ],
)
def test_after_each_verdict(verdict, missing, model, kept, expected):
    found = SimpleNamespace(
        verdict=DiagnosisVerdict(verdict), missing=("one",) * missing, refitted=()
    )
    paths = [None if name is None else Path(name) for name in (model, kept)]
    line = after_diagnosis(found, Given(Path("R"), [Path("D")], paths[0]), paths[1], Path("out"))
    assert expected in line


def test_names_with_blanks_are_quoted_and_all_files_named():
    found = SimpleNamespace(is_noise=False, refusal=None)
    given = Given(Path("my robot.xml"), [Path("a.csv"), Path("b.csv")])
    line = after_comparison(found, given)
    assert line == "next: crosscheck diagnose 'my robot.xml' a.csv b.csv"
    noise = SimpleNamespace(is_noise=True, refusal=None)
    assert after_comparison(noise, given) == "next: crosscheck plan 'my robot.xml' a.csv"
    given = Given(Path("r.xml"), [Path("a.csv")], Path("none.toml"))
    assert after_fit(False, False, given) == "next: crosscheck diagnose r.xml a.csv"


def test_noise_that_was_stated_is_stated_again():
    """Without it the next command would estimate it, and judge the same data otherwise."""
    given = Given(Path("r.xml"), [Path("a.csv")], Path("m.toml"), ["position=0.1mm"])
    end = " --model m.toml --sigma position=0.1mm"
    off = SimpleNamespace(is_noise=False, refusal=None)
    assert after_comparison(off, given) == f"next: crosscheck diagnose r.xml a.csv{end}"
    assert after_fit(True, True, given) == f"next: crosscheck compare r.xml a.csv{end}"
    found = SimpleNamespace(verdict=DiagnosisVerdict.EFFECTS_FOUND, missing=("one",))
    assert after_diagnosis(found, given, None, Path("out")).endswith(f"r.xml a.csv{end}")


def test_data_that_are_fit_for_no_verdict_are_not_diagnosed_next():
    """A diagnosis would refuse them, too."""
    few = SimpleNamespace(is_noise=False, refusal="only 2 readings left")
    line = after_comparison(few, Given(Path("r.xml"), [Path("a.csv")]))
    assert line == "next: crosscheck plan r.xml --rows 40"


def test_a_model_that_agrees_is_used_on_poses_or_mapped_where_none_are_known():
    noise = SimpleNamespace(is_noise=True, refusal=None)
    files = Path("r.xml"), [Path("a.csv"), Path("b.csv")], Path("m.toml")
    line = after_comparison(noise, Given(*files))
    assert line.startswith(
        "next: seecr correct r.xml a.csv --model m.toml  # corrects the poses commanded"
    )
    assert "any CSV of wanted poses will do" in line
    line = after_comparison(noise, Given(*files, lengths=True))
    assert line == "next: seecr map r.xml --model m.toml"
    line = after_comparison(noise, Given(*files, lengths=True, history=True))
    assert line == "next: seecr sweep r.xml a.csv --model m.toml"  # a map would refuse it


@pytest.mark.parametrize(
    ("value", "error", "unit", "words"),
    [
        (0.0083692, 1.31e-5, "m", "8.369 ± 0.013 mm"),
        (-0.0029612, 5.1e-6, "m", "-2.9612 ± 0.0051 mm"),
        (0.00894, 8.5e-5, "rad", "0.5122 ± 0.0049 deg"),
        (1.4, 0.0234, "", "1.400 ± 0.023"),
        (0.01, 0.0, "m", "10 mm (fixed)"),
        (0.01, float("inf"), "m", "not determined by these data"),
        (1.5e-13, 0.0, "N", "0 N (fixed)"),
    ],
)
def test_digits_are_those_of_the_error(value, error, unit, words):
    assert measured(value, error, unit) == words


def test_what_a_twin_hid_is_in_the_units_of_a_diagnosis():
    values = {"shift_x_m": 0.00836, "shift_y_m": -0.002}
    lines = parameter_lines("centre_of_mass", values)
    assert lines == ["shift_x = 8.36 mm", "shift_y = -2 mm"]
    assert parameter_lines("gravity_tilt", {"tilt_x_rad": 0.00894}) == ["tilt_x = 0.5122 deg"]
    assert parameter_lines("drum_gain", {"gain_3": 0.002}) == ["gain_3 = 0.002"]
