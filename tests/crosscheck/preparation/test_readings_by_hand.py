"""What data say before anything is fitted: of another robot, the same command twice, by file."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term

from crosscheck.fit.problem import Problem
from crosscheck.fit.state import known_left, known_readings
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.preparation.fitness import commands_table
from crosscheck.preparation.parts import groups_of, laid_out, names_in
from crosscheck.preparation.suspect import suspicions
from seecr.commands import Loads
from seecr.effects import ApartLayout, Own, Terms, Values
from seecr.effects.base import Readings

ROBOT = soft_cogiro()
SIGMA = Sigma(3e-5, 3.5e-4, 0.05)


@cache
def data() -> Measurements:
    """Poses and tensions of the plain robot."""
    return measured(ROBOT, points=2, sigma=SIGMA, tensions=True)


def problem(of: Measurements | None = None) -> Problem:
    of = data() if of is None else of
    return Problem(ROBOT, of, SIGMA, np.ones(of.n_rows, dtype=bool))


def predicted(off_m: float = 0.0, pull: float = 1.0) -> Readings:
    """The readings themselves, moved sideways and with tensions multiplied."""
    of = data()
    assert of.quat_wxyz is not None
    moved = of.position + np.array([off_m, 0.0, 0.0])
    return Readings(moved, of.quat_wxyz.copy(), pull * of.tensions)


def doubts(of: Problem, readings: Readings) -> list[str]:
    """What is asked about the data where a model predicts these readings."""
    return suspicions(of, replace(of.experiment.predict(()), readings=readings))[0]


def test_a_model_that_explains_the_readings_raises_no_doubts() -> None:
    assert doubts(problem(), predicted()) == []


def test_a_model_farther_off_than_the_commands_is_doubted_with_both_distances() -> None:
    """A metre along one of three axes: 577.4 mm rms over all."""
    (said,) = doubts(problem(), predicted(off_m=1.0))
    assert said.startswith("The model is 577 mm from the measured positions, the commands")
    few = Problem(ROBOT, data(), SIGMA, np.arange(data().n_rows) < 3)
    assert doubts(few, predicted(off_m=1.0)) == []


@pytest.mark.parametrize(("pull", "doubted"), [(19.0, 0), (21.0, 1), (1 / 19.0, 0), (1 / 21.0, 1)])
def test_tensions_twenty_times_as_large_are_of_another_unit(pull: float, doubted: int) -> None:
    said = doubts(problem(), predicted(pull=pull))
    assert len(said) == doubted and all("is it another unit" in one for one in said)


def test_of_several_files_the_doubted_one_is_named() -> None:
    n = data().n_rows
    number = (np.arange(n) >= n // 2).astype(np.int64)
    two = replace(
        data(), files=("one.csv", "two.csv"), origins=("a/one.csv", "a/two.csv"), file=number
    )
    readings = predicted()
    readings.position[number == 1] += [1.0, 0.0, 0.0]
    (said,) = doubts(problem(two), readings)
    assert said.startswith("two.csv: The model is 577 mm from the measured positions")


def test_the_same_pose_under_another_load_is_another_command() -> None:
    n = data().n_rows
    loads = Loads.of(n, mass=np.where(np.arange(n) % 2, 0.1, 0.0))
    table = commands_table(problem(replace(data(), loads=loads)))
    assert table.shape == (n, 8)
    assert len(np.unique(table[:, 7])) == 2 and np.array_equal(
        table[::2, 7], np.repeat(table[0, 7], (n + 1) // 2)
    )
    assert commands_table(problem()).shape == (n, 7)


def test_what_was_measured_is_a_reading_in_standard_errors() -> None:
    """A pulley of 12 +- 2 mm, 7 mm in the model: 2.5 standard errors are left."""
    wheel = term(ROBOT, "pulley_radius").measured(radius_m=(0.012, 0.002))
    wheel = wheel.with_vector(np.array([0.007]))
    stiff = term(ROBOT, "stiffness", factor=1.1)
    terms = Terms([wheel, stiff])
    columns, readings = known_readings(terms)
    scale = wheel.layout.scale[0]
    assert columns == pytest.approx(np.array([[scale / 0.002, 0.0]]))
    assert readings == pytest.approx([6.0]) and known_left(terms) == pytest.approx([2.5])
    assert known_readings(Terms([stiff]))[0].shape == (0, 1)


def days(kind: str = "file") -> Measurements:
    n = data().n_rows
    number = (np.arange(n) >= n // 2).astype(np.int64)
    origins = ("case/monday.csv", "case/tuesday.csv")
    return replace(data(), files=("monday.csv", "tuesday.csv"), origins=origins, file=number)


def test_values_of_a_file_are_found_by_its_name_and_new_files_start_at_the_common_ones() -> None:
    plain = term(ROBOT, "tracker_frame", shift_x_m=0.5)
    there = Values(plain.layout.null + 0.25, np.zeros(6), plain.knowledge)
    own = Own("file", {"monday.csv": there})
    found = laid_out(days(), Terms([replace(plain, own=own), term(ROBOT, "stiffness", factor=1.1)]))
    frame = found.terms["tracker_frame"]
    assert names_in(days(), "file") == ("case/monday.csv", "case/tuesday.csv")
    assert isinstance(frame.layout, ApartLayout) and found.fresh == (
        ("tracker_frame", "case/tuesday.csv"),
    )
    assert frame.vector == pytest.approx(np.concatenate([there.vector, plain.vector]))
    assert found.notes == (
        "tracker_frame has separate values for each file: case/monday.csv as in the model; "
        "case/tuesday.csv not in the model, so fitted to these data first",
    )
    assert found.terms["stiffness"].vector.tolist() == [1.1]


def test_rows_are_grouped_where_an_effect_has_values_apart() -> None:
    plain = term(ROBOT, "tracker_frame")
    apart = laid_out(days(), Terms([replace(plain, own=Own("file", {}))])).terms
    groups = groups_of(days(), apart)
    assert groups is not None and groups.tolist() == days().file.tolist()
    assert groups_of(days(), Terms([plain])) is None
