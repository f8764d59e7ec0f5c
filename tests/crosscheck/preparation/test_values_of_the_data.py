"""What the data leave free is fitted first: a scale of the tracker, by least squares in a line."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Measurements
from crosscheck.preparation.freed import Freed, freed
from crosscheck.preparation.parts import LaidOut
from seecr.description.mjcf import load_robot
from seecr.effects import ApartLayout, Term, Terms, apart, effect_named, layout_of
from seecr.pose import Array

ROBOT = load_robot(COGIRO)
SCALE = layout_of(effect_named("tracker_scale"), ROBOT)
FRAME = {"shift_x_m": 1.5, "shift_z_m": -0.4, "rotation_x_rad": 0.3, "rotation_z_rad": 2.0}


@lru_cache
def data_of(factor: float = 1.004) -> Measurements:
    return measured(ROBOT, [term(ROBOT, "tracker_scale", factor=factor)], points=2)


def problem_of(data: Measurements) -> Problem:
    return Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))


def found_in(data: Measurements, *terms: Term, fresh: tuple[tuple[str, str], ...] = ()) -> Freed:
    return freed(problem_of(data), LaidOut(Terms(terms), fresh, ()))


def positions(data: Measurements) -> Array:
    """(n, 3) as the plain robot has them."""
    return problem_of(data).experiment.predict(()).readings.position


def slope(told: Array, read: Array) -> float:
    """Of the line through the origin with the least squares."""
    return float(np.sum(told * read) / np.sum(told**2))


def near(told: Array) -> float:
    """A tenth of the slope's standard error: a fit ends where it gains no more than that."""
    return 0.1 * SIGMA.position_m / float(np.linalg.norm(told))


def test_nothing_is_fitted_if_nothing_is_free() -> None:
    held = term(ROBOT, "tracker_scale", factor=1.002)
    found = found_in(data_of(), held)
    assert found.terms["tracker_scale"].vector.tolist() == [1.002]
    assert found.free.tolist() == [False] and found.notes == ()


def test_without_readings_nothing_is_fitted() -> None:
    data = replace(data_of(), free=("tracker_scale",))
    nothing = Problem(ROBOT, data, SIGMA, np.zeros(data.n_rows, dtype=bool))
    found = freed(nothing, LaidOut(Terms(), (), ()))
    assert found.terms.names == () and found.free.tolist() == []


def test_a_free_effect_that_the_model_lacks_is_fitted_by_least_squares() -> None:
    data = replace(data_of(), free=("tracker_scale",))
    found = found_in(data, term(ROBOT, "pulley_radius"))
    assert found.terms.names == ("pulley_radius", "tracker_scale")
    assert found.free.tolist() == [False, True]
    assert found.terms["pulley_radius"].vector.tolist() == [0.0]
    told = positions(data)
    expected = slope(told, data.position)
    assert expected == pytest.approx(1.004, abs=50.0 * near(told))
    assert found.terms["tracker_scale"].vector == pytest.approx(expected, abs=near(told))


def test_a_free_effect_of_the_model_is_fitted_from_where_it_stands_and_a_fixed_one_stays() -> None:
    data = replace(data_of(), free=("tracker_scale",))
    told = positions(data)
    expected = slope(told, data.position)
    start = term(ROBOT, "tracker_scale", factor=0.99)
    found = found_in(data, start)
    assert found.terms["tracker_scale"].vector == pytest.approx(expected, abs=near(told))
    fixed = found_in(data, start.fixed())
    assert fixed.terms["tracker_scale"].vector.tolist() == [0.99]
    assert fixed.free.tolist() == [False]
    assert fixed.notes == (
        "tracker_scale is free, as stated in the TOML beside measured.csv, and was fitted to these "
        "data first: factor 0.99 (fixed)",
    )


def test_errors_that_are_told_are_those_of_what_the_model_leaves() -> None:
    """They go with the rms of the positions' residuals: of noise, and of what is no noise."""
    data = replace(data_of(), free=("tracker_scale",))
    told = positions(data)
    off = np.zeros_like(told)
    off[:, 0] = np.where(np.arange(len(told)) % 2, 1e-2, -1e-2)
    off -= slope(told, off) * told  # so that it changes no slope

    def error(data: Measurements) -> float:
        (note,) = found_in(data).notes
        return float(note.rpartition("± ")[2])

    def expected(data: Measurements) -> float:
        left = data.position - slope(told, data.position) * told
        return float(np.linalg.norm(left) / np.sqrt(left.size - 1) / np.linalg.norm(told))

    assert error(data) == pytest.approx(expected(data), rel=0.05)  # two digits are told
    assert expected(data) == pytest.approx(SIGMA.position_m / np.linalg.norm(told), rel=0.2)
    far = replace(data, position=data.position + off)
    assert expected(far) > 100.0 * expected(data)
    assert error(far) == pytest.approx(expected(far), rel=0.05)


def test_only_runs_that_the_model_has_not_seen_are_fitted() -> None:
    data = data_of()
    half = data.n_rows // 2
    data = replace(data, run=np.repeat(["seen", "new"], [half, data.n_rows - half]))
    seen, new = (str(data.parts["run"][k]) for k in (0, -1))
    layout = apart(SCALE, "run", (seen, new), SCALE.null)
    model = Terms([Term(layout, np.array([1.0, 1.0]))])
    found = freed(problem_of(data), LaidOut(model, (("tracker_scale", new),), ()))
    assert found.free.tolist() == [False, True]
    told = positions(data)[half:]
    seen_before, fresh = found.terms["tracker_scale"].vector
    assert seen_before == 1.0
    assert fresh == pytest.approx(slope(told, data.position[half:]), abs=near(told))
    (note,) = found.notes
    assert note.startswith("tracker_scale was fitted to these data first: ")
    assert "seen" not in note


def test_of_several_files_each_that_says_so_has_its_own() -> None:
    data = replace(
        data_of(), free=("tracker_scale",), free_in={"tracker_scale": (1, 2)},
        files=("a.csv", "b.csv", "c.csv"), origins=("x/a.csv", "x/b.csv", "x/c.csv"),
        file=np.arange(data_of().n_rows) % 3,
    )  # fmt: skip
    problem = problem_of(data).with_groups(np.asarray(data.file))
    found = freed(problem, LaidOut(Terms(), (), ()))
    layout = found.terms["tracker_scale"].layout
    assert isinstance(layout, ApartLayout) and layout.parts == ("x/b.csv", "x/c.csv")
    told = positions(data)
    for k, value in zip((1, 2), found.terms["tracker_scale"].vector, strict=True):
        own = data.file == k
        expected = slope(told[own], data.position[own])
        assert value == pytest.approx(expected, abs=near(told[own]))


def test_a_frame_that_is_far_away_is_registered_first() -> None:
    """Gauss-Newton alone would not come there: it is turned by more than a right angle."""
    frame = term(ROBOT, "tracker_frame", **FRAME)
    data = replace(measured(ROBOT, [frame], points=2), free=("tracker_frame",))
    found = found_in(data)
    assert found.free.tolist() == [True] * 6
    assert found.terms["tracker_frame"].vector == pytest.approx(frame.vector, abs=2e-3)
