"""Each command ends by naming the next one, with its arguments: the story has no dead ends."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from called import following, ran
from made_data import case

from crosscheck.cli.following import Given, after_comparison, after_diagnosis, after_fit
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.show.effects import parameter_lines
from seecr.units import measured

FOUND = DiagnosisVerdict.EFFECTS_FOUND
OFF = SimpleNamespace(is_noise=False, refusal=None)
NOISE = SimpleNamespace(is_noise=True, refusal=None)


@pytest.mark.slow
@pytest.mark.usefixtures("unpaged")
def test_from_a_plan_to_a_model_by_the_commands_that_each_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a command says next is run as it is said, until nothing is missing."""
    monkeypatch.chdir(tmp_path)
    case(Path(), {"pulley_radius": {"radius_m": 0.01}}, points=4)
    files = "robot.xml measured.csv"
    planned = following(ran(f"crosscheck plan {files}"))
    assert planned == f"crosscheck diagnose {files}"
    assert following(ran(f"crosscheck compare {files}")) == planned
    told = following(ran(f"{planned} --only pulley_radius --no-recording"))
    listed = "--all-from crosscheck-diagnosis/diagnosis.json"
    assert told == f"crosscheck add {listed} {files} --model model.toml"
    told = following(ran(told))
    assert told == f"crosscheck compare {files} --model model.toml"
    told = following(ran(f"{told} --no-recording"))
    assert told == f"seecr correct {files} --model model.toml"


def test_the_catalogue_names_a_next_command() -> None:
    assert following(ran("crosscheck effects")).startswith("crosscheck effects ")
    told = following(ran("crosscheck effects backlash"))
    assert told == "crosscheck add backlash ROBOT.xml DATA.csv --model model.toml"


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
def test_after_each_verdict(
    verdict: str, missing: bool, model: str | None, kept: str | None, expected: str
) -> None:
    lacking = ("one",) * missing
    found = SimpleNamespace(verdict=DiagnosisVerdict(verdict), missing=lacking, refitted=())
    paths = [None if name is None else Path(name) for name in (model, kept)]
    line = after_diagnosis(found, Given(Path("R"), [Path("D")], paths[0]), paths[1], Path("out"))
    assert expected in line


def test_names_with_blanks_are_quoted_and_all_files_named() -> None:
    given = Given(Path("my robot.xml"), [Path("a.csv"), Path("b.csv")])
    line = after_comparison(OFF, given)
    assert line == "next: crosscheck diagnose 'my robot.xml' a.csv b.csv"
    assert after_comparison(NOISE, given) == "next: crosscheck plan 'my robot.xml' a.csv"
    given = Given(Path("r.xml"), [Path("a.csv")], Path("none.toml"))
    assert after_fit(False, False, given) == "next: crosscheck diagnose r.xml a.csv"


def test_noise_that_was_stated_is_stated_again() -> None:
    """Without it the next command would estimate it, and judge the same data otherwise."""
    given = Given(Path("r.xml"), [Path("a.csv")], Path("m.toml"), ["position=0.1mm"])
    end = "r.xml a.csv --model m.toml --sigma position=0.1mm"
    assert after_comparison(OFF, given) == f"next: crosscheck diagnose {end}"
    assert after_fit(True, True, given) == f"next: crosscheck compare {end}"
    found = SimpleNamespace(verdict=FOUND, missing=("one",))
    assert after_diagnosis(found, given, None, Path("out")).endswith(end)


def test_data_that_are_fit_for_no_verdict_are_not_diagnosed_next() -> None:
    """A diagnosis would refuse them, too."""
    few = SimpleNamespace(is_noise=False, refusal="only 2 readings left")
    line = after_comparison(few, Given(Path("r.xml"), [Path("a.csv")]))
    assert line == "next: crosscheck plan r.xml --rows 40"


def test_a_model_that_agrees_is_used_on_poses_or_mapped_where_none_are_known() -> None:
    files = Path("r.xml"), [Path("a.csv"), Path("b.csv")], Path("m.toml")
    correct, comment = after_comparison(NOISE, Given(*files)).split("  # ")
    assert correct == "next: seecr correct r.xml a.csv --model m.toml"
    assert comment.startswith("corrects the poses commanded")
    assert "any CSV of wanted poses will do" in comment
    line = after_comparison(NOISE, Given(*files, lengths=True))
    assert line == "next: seecr map r.xml --model m.toml"
    line = after_comparison(NOISE, Given(*files, lengths=True, history=True))
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
def test_digits_are_those_of_the_error(value: float, error: float, unit: str, words: str) -> None:
    assert measured(value, error, unit) == words


def test_what_a_twin_hid_is_in_the_units_of_a_diagnosis() -> None:
    values = {"shift_x_m": 0.00836, "shift_y_m": -0.002}
    lines = parameter_lines("centre_of_mass", values)
    assert lines == ["shift_x = 8.36 mm", "shift_y = -2 mm"]
    assert parameter_lines("gravity_tilt", {"tilt_x_rad": 0.00894}) == ["tilt_x = 0.5122 deg"]
    assert parameter_lines("drum_gain", {"gain_3": 0.002}) == ["gain_3 = 0.002"]
