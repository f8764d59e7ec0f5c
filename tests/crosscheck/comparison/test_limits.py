"""Limits: which field is on what, and that each one can be exceeded alone."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_data import measured, soft_cogiro

import crosscheck
import seecr
from crosscheck.comparison.limits import (
    RULES,
    Limits,
    exceeded,
    load_limits,
    option,
    parse_limit,
)
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import KINDS
from seecr.errors import InputFileError
from seecr.prediction.experiment import Experiment


@pytest.fixture(scope="module")
def found() -> Comparison:
    robot = soft_cogiro()
    return compare(robot, measured(robot))


def test_each_field_of_the_limits_has_its_rule() -> None:
    assert tuple(RULES) == tuple(field.name for field in fields(Limits))
    assert list(RULES.values()) == [(k, worst) for worst in (False, True) for k in KINDS]
    assert option("max_position_worst") == "--max-position-worst"


def test_a_limit_just_below_is_exceeded_and_one_just_above_holds(found: Comparison) -> None:
    rms, sizes = found.rms["position_rms_m"], found.errors_of("position")
    assert rms is not None
    (item,) = exceeded(Limits(max_position=0.9 * rms), found)
    assert (item.name, item.value, item.limit) == ("max_position", rms, 0.9 * rms)
    assert f"exceeds {900 * rms:.4g} mm by {1e3 * (rms - 0.9 * rms):.4g} mm" in item.words
    line = found.problem.data.line[int(np.argmax(sizes))]
    assert f"worst at line {line}, run " in item.words and "commanded (" in item.words
    assert exceeded(Limits(max_position=1.01 * rms), found) == []
    assert exceeded(Limits(max_position_worst=1.01 * sizes.max()), found) == []
    (item,) = exceeded(Limits(max_position_worst=0.99 * sizes.max()), found)
    assert item.words.startswith("worst position error")


@pytest.mark.parametrize(
    ("name", "limit", "words"),
    [
        ("max_position", 500.0, "the robot's frame, across; got 5e+05 mm, which nothing exceeds"),
        ("max_orientation_worst", 50.0, "expected less than 180 deg, half a turn; got 2865 deg"),
    ],
)
def test_a_limit_that_nothing_exceeds_is_a_typing_error(
    found: Comparison, name: str, limit: float, words: str
) -> None:
    """0.5 and 500 mm look alike; the gate was off for ever, and nobody was told."""
    with pytest.raises(CrosscheckError, match=re.escape(words)):
        exceeded(Limits(**{name: limit}), found)


def test_a_limit_on_what_was_not_read_is_refused(found: Comparison) -> None:
    with pytest.raises(CrosscheckError, match=r"--max-tension-worst: .* has no tension readings"):
        exceeded(Limits(max_tension_worst=1.0), found)


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("max_position", "0.5mm", 5e-4),
        ("max_position_worst", "300um", 3e-4),
        ("max_orientation", "0.2deg", np.radians(0.2)),
        ("max_tension_worst", ".5kN", 500.0),
    ],
)
def test_limits_are_read_with_their_unit(name: str, text: str, value: float) -> None:
    assert parse_limit(name, text) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("max_position", "0.5", r"--max-position: .*\(m, cm, mm, um, µm\).*, got no unit"),
        ("max_position", "0.5deg", "got unit 'deg' in '0.5deg'"),
        ("max_orientation", "1mm", "such as 0.2deg, got unit 'mm'"),
        ("max_tension_worst", "1kg", "--max-tension-worst: .*got unit 'kg'"),
        ("max_position", "mm", "got 'mm'"),
        ("max_position", "1.2.3mm", "got unit '.3mm'"),
        ("max_position", "nan mm", "got 'nan mm'"),
        ("max_position", "0mm", "expected more than zero, got '0mm'"),
        ("max_position", "-1mm", "expected more than zero"),
    ],
)
def test_limits_without_a_right_unit_are_refused(name: str, text: str, words: str) -> None:
    with pytest.raises(CrosscheckError, match=words):
        parse_limit(name, text)


def test_limits_from_a_file_and_the_command_line(tmp_path: Path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text('max_position = "0.5mm"\nmax-orientation = "0.2deg"\n')
    limits = load_limits(file).but({"max_position": "1mm", "max_tension": None})
    assert limits == Limits(max_position=1e-3, max_orientation=np.radians(0.2))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            'max_postion = "1mm"',
            "max_postion is not a limit; expected one of, nearest first: max_position,",
        ),
        ("max_position = 0.5", 'max_position: expected a text such as "0.5mm", got 0.5'),
        ('max_position = "1deg"', "limits.toml: line 1: --max-position: .*got unit 'deg'"),
        ("max_position = ", "is not TOML"),
    ],
)
def test_bad_limit_files(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "limits.toml"
    file.write_text(text)
    with pytest.raises(InputFileError, match=words):
        load_limits(file)


# What is no limits, no comparison, no terms: told in one sentence with its name

ROBOT = seecr.load_robot("planar_vertical")

COMMANDS = seecr.Commands(np.tile(ROBOT.reference_pose, (2, 1)))

EXPERIMENT = Experiment(ROBOT, COMMANDS)

MASS = seecr.Terms([seecr.Term(seecr.layout_of("platform_mass", ROBOT), [0.1])])

ODD = [None, 1, "x", [], {}, np.ones(3), object()]


@pytest.mark.parametrize("odd", ODD, ids=lambda one: type(one).__name__)
def test_arguments_of_other_kinds_are_told(odd: Any) -> None:
    with pytest.raises(seecr.InputError, match=r"^limits: expected a crosscheck.Limits, .* got "):
        crosscheck.exceeded(odd, odd)
    with pytest.raises(
        seecr.InputError, match=r"^found: expected a crosscheck.Comparison, .* got "
    ):
        crosscheck.exceeded(Limits(max_position=1.0), odd)
    at = EXPERIMENT.predict(MASS.effects)
    for arguments, name in (
        ((odd, MASS, at), "experiment: expected a seecr.Experiment"),
        ((EXPERIMENT, odd, at), "terms: expected a seecr.Terms"),
        ((EXPERIMENT, MASS, odd), "at: expected a seecr.Prediction"),
    ):
        with pytest.raises(seecr.InputError, match=f"^{name}, .* got {type(odd).__name__}"):
            seecr.sensitivities(*arguments)


@pytest.mark.parametrize("columns", [[1], [-1], [0.5], ["a"], 0, [[0]], None])
def test_columns_are_indices_of_parameters(columns: Any) -> None:
    at = EXPERIMENT.predict(MASS.effects)
    with pytest.raises(seecr.InputError, match=r"^columns: expected "):
        seecr.sensitivities(EXPERIMENT, MASS, at, columns)
    assert seecr.sensitivities(EXPERIMENT, MASS, at, [0]).shape[2] == 1


def test_a_prediction_for_other_commands_is_told() -> None:
    at = Experiment(ROBOT, COMMANDS.rows(np.arange(1))).predict(MASS.effects)
    with pytest.raises(seecr.InputError, match="at: expected a prediction for 2 commands, got 1"):
        seecr.sensitivities(EXPERIMENT, MASS, at)
