"""The TOML beside the measurements: noise, and what is wrong with it."""

from __future__ import annotations

import math

import pytest
from measured_csv import POSE

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import EXAMPLE, SI, Sigma, parse_quantity
from crosscheck.measurements.read import Beside, load_commands, load_measurements, read_beside
from seecr.errors import InputFileError


def test_sigma_beside_the_data_or_named(csv_file, robot, tmp_path):
    path = csv_file(POSE, "0,0,0,0")
    (tmp_path / "measured.toml").write_text("[sigma]\nposition_m = 3e-5\nlength_m = 1\n")
    (tmp_path / "other.toml").write_text("[sigma]\ntension_N = 2.5\n[mine]\nname = 'x'\n")
    assert load_measurements(path, robot).sigma == Sigma(position_m=3e-5, length_m=1.0)
    other = load_commands(path, robot, sigma_path=tmp_path / "other.toml")
    assert other.sigma == Sigma(tension_N=2.5)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[sigma]\nposition_m = \n", "measured.toml: is not TOML: .*line 2"),
        (
            "[sigma]\nposition_m = 0\n",
            r'line 2: position_m must be a positive number \[m\] or a text such as "0.5mm", got 0;',
        ),
        (
            "[sigma]\n\ntension_N = -1.5\n",
            r'line 3: tension_N must be a positive number \[N\] or a text such as "1N", got -1.5',
        ),
        (
            "[sigma]\nposition_m = '3 N'\n",
            "line 2: position_m: expected a number with its unit .m, cm, mm, .*got unit 'N'",
        ),
        ("lengths = 'tolled'\n", "line 1: lengths must be .absolute. or .told., got 'tolled'"),
        ("start = 3\n", "line 1: start must be .reference. or .first_row., got 3"),
        ("lenghts = 'told'\n", "line 1: unknown key lenghts; expected lengths$"),
        ("[sigma]\nposition_m = nan\n", "line 2: position_m must be .* got nan"),
        ("[sigma]\nlength_m = inf\n", "got inf"),
        ("[sigma]\nlength_m = true\n", "got True"),
        ("[sigma]\nlength_m = 1" + 400 * "0" + "\n", "must be a positive number .*got 10+;"),
        (
            "[sigma]\nposition_mm = 3\n",
            "line 2: unknown key position_mm in .sigma.; known are position_m, ",
        ),
        ("[sigma]\norient_rad = 3\n", "known are orientation_rad, .*position_m"),
        (
            "position_m = 3e-5\n",
            r"line 1: position_m is outside the table \[sigma\]; put it into that table",
        ),
        ("[Sigmas]\nposition_m = 3e-5\n", r"line 1: unknown table \[Sigmas\]; expected \[sigma\]"),
        ("sigma = 3\n", r"line 1: sigma must be a table, \[sigma\]"),
        (
            "[sigma]\nsource = 'guessed'\n",
            "line 2: source must be .stated. or .dwell_scatter. or .revisited., got 'guessed'",
        ),
    ],
)
def test_mistakes_in_sigma(csv_file, robot, tmp_path, text, expected):
    path = csv_file(POSE, "0,0,0,0")
    (tmp_path / "measured.toml").write_text(text)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    assert str(caught.value).startswith(f"{tmp_path / 'measured.toml'}: ")
    assert "\n" not in str(caught.value)


def test_named_sigma_must_exist_and_be_text(csv_file, robot, tmp_path):
    path = csv_file(POSE, "0,0,0,0")
    with pytest.raises(InputFileError, match=r"none\.toml: no such file; expected a TOML file"):
        load_measurements(path, robot, sigma_path=tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b"# \xe9\n")
    with pytest.raises(InputFileError, match=r"is not UTF-8 \(byte number 3\)"):
        load_measurements(path, robot, sigma_path=tmp_path / "latin.toml")


def test_what_is_free_is_there_once_and_senses(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('free = ["tracker_target", "tracker_frame", "tracker_target"]\n')
    assert read_beside(path).free == ("tracker_target", "tracker_frame")
    for wrong in ('"tracker_frame"', '["stiffness"]', "[1]"):
        path.write_text(f"\nfree = {wrong}\n")
        with pytest.raises(InputFileError, match="line 2: free must be a list of some of tracker_"):
            read_beside(path)


def test_a_name_of_the_users_own_is_left_alone(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('operator = "x"\n[hall]\nheight_m = 8\n')
    assert read_beside(path) == Beside()


# Quantities as people type them


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("position", "0.5mm", 0.0005),
        ("position", " 3 µm ", 3e-6),
        ("orientation", "180°", math.pi),
        ("orientation", "1e1 mrad", 0.01),
        ("tension", "2kN", 2000.0),
        ("length", "0.1 cm", 0.001),
    ],
)
def test_quantities_with_their_unit(kind: str, text: str, value: float) -> None:
    assert parse_quantity("--x", kind, text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("kind", list(SI))
def test_the_example_of_each_kind_is_one(kind: str) -> None:
    assert parse_quantity("--x", kind, EXAMPLE[kind]) > 0


def test_a_unit_of_another_kind_is_refused() -> None:
    with pytest.raises(CrosscheckError) as error:
        parse_quantity("--x", "tension", "1mm")
    expected = "--x: expected a number with its unit (N, mN, kN) such as 1N, got unit 'mm' in '1mm'"
    assert str(error.value) == expected
