"""What to do next: by what the error goes with, and never by a word of it."""

from __future__ import annotations

import pytest
from linear_toy import toy
from made_data import soft_cogiro, term

from crosscheck.comparison.associations import Association
from crosscheck.comparison.quantities import QuantityKind
from crosscheck.diagnosis.advice import check_of, measure_next, measured_directly
from crosscheck.diagnosis.search import Search, search
from crosscheck.fit.reasons import DiagnosisVerdict


@pytest.fixture(scope="module")
def found() -> Search:
    made = toy({}, ("tracker_scale",))
    return search(made.trials, made.base)


def advice(found: Search, *where: Association) -> str:
    line, other = measure_next(found, [], DiagnosisVerdict.UNKNOWN_EFFECT, where)
    assert "crosscheck calibrate fits all effects at once" in other
    return line


def goes_with(kind: QuantityKind, words: str) -> Association:
    return Association(kind, words, "readings", 0.6, 1e-9, "x", "m", ())


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (QuantityKind.PLACE, "measure more poses along it"),
        (QuantityKind.RUN, "zero the winches and check the tracker before each run"),
        (QuantityKind.TIME, "stay at one pose and read it"),
        (QuantityKind.TEMPERATURE, "stay at one pose and read it"),
        (QuantityKind.TENSION, "repeat the same poses forward, back and an hour later"),
        (QuantityKind.CABLE, "repeat the same poses forward, back and an hour later"),
    ],
)
def test_the_unknown_is_looked_for_where_it_goes(
    found: Search, kind: QuantityKind, expected: str
) -> None:
    for words in ("commanded z", "the run", "time", "anything"):
        line = advice(found, goes_with(kind, words))
        assert line.startswith(f"the unexplained error goes with {words}: {expected}")


def test_without_a_lead_the_same_poses_are_repeated(found: Search) -> None:
    assert advice(found) == (
        "repeat the same poses forward, back and an hour later, to see what the error follows"
    )


def test_where_nothing_is_missing_the_plan_is_named(found: Search) -> None:
    (line,) = measure_next(found, [], DiagnosisVerdict.NO_EFFECT_MISSING, ())
    assert "crosscheck plan" in line


def test_checks_say_what_to_expect_in_units_for_people() -> None:
    robot = soft_cogiro()
    assert "9.9 mm" in check_of(term(robot, "pulley_radius", radius_m=0.0099), robot)
    check = check_of(term(robot, "exit_point_error", error_3_y_m=0.004), robot)
    assert "error_3_y" in check and "4" in check
    assert measured_directly("platform_mass") == "weigh the platform"
