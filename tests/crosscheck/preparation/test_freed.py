"""What data leave free is fitted first: trackers aligned to the commands, values for new files."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, soft_cogiro, term
from made_diagnoses import SLOW
from numpy.typing import NDArray

import crosscheck
from crosscheck.fit.problem import Problem
from crosscheck.fit.state import known_left, known_readings
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.freed import freed, laid_out
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.effects import ApartLayout, Own, Term, Terms, Values, apart, effect_named, layout_of
from seecr.pose import Array
from seecr.prediction.experiment import Experiment

ROBOT = soft_cogiro()
FAR = {"shift_x_m": 0.4, "shift_z_m": -0.2, "rotation_z_rad": 0.7, "rotation_x_rad": 0.1}
TARGET = {"shift_z_m": 0.02, "rotation_y_rad": 0.05}


def far_away(*effects, free=("tracker_frame",)):
    frame = term(ROBOT, "tracker_frame", **FAR)
    return replace(measured(ROBOT, [frame, *effects], points=6), free=free)


@pytest.mark.slow
def test_what_is_left_does_not_depend_on_where_the_tracker_stands():
    mass = term(ROBOT, "platform_mass", added_kg=0.6)
    here = replace(measured(ROBOT, [mass], points=6), free=("tracker_frame",))
    there, at_home = (crosscheck.compare(ROBOT, data) for data in (far_away(mass), here))
    assert there.rms["position_rms_m"] == pytest.approx(at_home.rms["position_rms_m"], rel=0.02)
    assert not there.is_noise
    assert crosscheck.compare(ROBOT, far_away(mass), [mass]).is_noise
    assert any("tracker_frame is free, as stated in the TOML" in note for note in there.notes)


def test_free_values_are_told_with_errors_that_what_is_missing_widens():
    errors = []
    for effects in ((), (term(ROBOT, "platform_mass", added_kg=0.6),)):
        notes = " ".join(prepare(ROBOT, far_away(*effects), Terms()).notes)
        value, error = re.search(r"shift_x (\S+) ± (\S+) mm", notes).groups()
        assert float(value) == pytest.approx(400.0, abs=4.0 * float(error))
        errors.append(float(error))
    assert errors[0] < 0.03 < 5.0 * errors[0] < errors[1]


def test_a_reading_metres_off_does_not_turn_the_frame():
    """One of 17 dwells, 1.8 m off, had moved it by 0.6 m."""
    data = far_away()
    data.position[7] += [1.0, -0.5, 0.3]
    frame = prepare(ROBOT, data, Terms()).terms["tracker_frame"]
    assert frame.vector[:3] == pytest.approx([0.4, 0.0, -0.2], abs=1e-4)


def test_a_row_that_alone_shows_where_the_target_is_counts():
    """It sticks out as long as the target is where it is not."""
    target = term(ROBOT, "tracker_target", shift_x_m=0.1, shift_z_m=0.15)
    data = measured(ROBOT, [target, term(ROBOT, "tracker_frame", **FAR)], points=5)
    level = data.command_pose[:, 3] > 1.0 - 1e-9
    level[np.flatnonzero(~level)[3]] = True
    some = replace(data.rows(np.flatnonzero(level)), free=("tracker_frame", "tracker_target"))
    found = prepare(ROBOT, some, Terms()).terms["tracker_target"].vector
    assert found[2] == pytest.approx(0.15, abs=1e-3), "0.143 without it"


@pytest.mark.slow
def test_a_diagnosis_finds_what_is_missing_beside_the_frame_and_not_the_frame():
    gain = term(ROBOT, "pulley_radius", radius_m=0.01)
    target = term(ROBOT, "tracker_target", **TARGET)
    free = ("tracker_frame", "tracker_target")
    found = crosscheck.diagnose(ROBOT, far_away(gain, target, free=free), exclude=SLOW)
    assert [effect.effect for effect in found.missing] == ["pulley_radius"]
    assert found.missing[0].values[0] == pytest.approx(0.01, abs=4 * found.missing[0].stderr[0])
    assert found.verdict is crosscheck.DiagnosisVerdict.EFFECTS_FOUND


@pytest.mark.slow
def test_adding_fits_the_frame_too_and_a_fixed_one_stays():
    found = crosscheck.add_effect(
        ROBOT, far_away(term(ROBOT, "pulley_radius", radius_m=0.01)), "pulley_radius"
    )
    assert found.pays and found.terms.names == ("pulley_radius", "tracker_frame")
    fixed = term(ROBOT, "tracker_frame", shift_x_m=0.39).fixed()
    left = crosscheck.compare(ROBOT, far_away(), Terms([fixed]))
    assert left.state.terms["tracker_frame"].vector == pytest.approx(fixed.vector)


def test_files_say_it_and_of_several_only_those_that_do(tmp_path):
    data = far_away()
    write_measurements(tmp_path / "a.csv", data)
    assert 'free = ["tracker_frame"]' in (tmp_path / "a.toml").read_text()
    again = crosscheck.load_measurements(tmp_path / "a.csv", ROBOT)
    assert again.free == ("tracker_frame",)
    both = together([again, replace(data, path=tmp_path / "b.csv", free=())])
    assert both.free == ("tracker_frame",)
    assert both.free_in == {"tracker_frame": (0,)}


def test_noise_of_lengths_is_read_through_the_tracker():
    """Where the tracker stands turned, so does what noisy lengths do to the pose."""
    sigma = Sigma(position_m=2e-5, orientation_rad=3e-4, length_m=2e-4)
    frame = term(ROBOT, "tracker_frame", rotation_z_rad=1.6)
    plain = measured(ROBOT, [frame], points=6, sigma=sigma)
    random = np.random.default_rng(3)
    errors = sigma.length_m * random.standard_normal((plain.n_rows, 8))
    experiment = Experiment(ROBOT, plain.as_commands(ROBOT), errors)
    read = experiment.predict([frame.effect()]).readings
    data = replace(
        plain,
        position=read.position + sigma.position_m * random.standard_normal((plain.n_rows, 3)),
        quat_wxyz=read.quat_wxyz,
    )
    state = crosscheck.compare(ROBOT, data, [frame]).state
    assert state.chi2 / len(state.white) == pytest.approx(0.9, abs=0.25)  # 2.2 unturned


STIFF = load_robot(COGIRO)
SCALE = layout_of(effect_named("tracker_scale"), STIFF)
FAR_FRAME = {"shift_x_m": 1.5, "shift_z_m": -0.4, "rotation_x_rad": 0.3, "rotation_z_rad": 2.0}


@lru_cache
def data_of(factor: float = 1.004) -> Measurements:
    return measured(STIFF, [term(STIFF, "tracker_scale", factor=factor)], points=2)


def problem_of(data: Measurements) -> Problem:
    return Problem(STIFF, data, SIGMA, np.ones(data.n_rows, dtype=bool))


class Freed(NamedTuple):
    """A model after what its data leave free was fitted."""

    terms: Terms
    free: NDArray[np.bool_]
    notes: list[str]


def found_in(data: Measurements, *terms: Term) -> Freed:
    return Freed(*freed(problem_of(data), Terms(terms)))


def positions(data: Measurements) -> Array:
    """(n, 3) as the plain robot has them."""
    return problem_of(data).experiment.predict(()).readings.position


def slope(told: Array, read: Array) -> float:
    """Of the line through the origin with the least squares."""
    return float(np.sum(told * read) / np.sum(told**2))


def near(told: Array) -> float:
    """A tenth of the slope's standard error: a fit ends where it gains no more than that."""
    return 0.1 * SIGMA.position_m / float(np.linalg.norm(told))


def test_without_readings_nothing_is_fitted() -> None:
    data = replace(data_of(), free=("tracker_scale",))
    nothing = Problem(STIFF, data, SIGMA, np.zeros(data.n_rows, dtype=bool))
    found = Freed(*freed(nothing, Terms()))
    assert found.terms.names == () and found.free.tolist() == []


def test_a_free_effect_that_the_model_lacks_is_fitted_by_least_squares() -> None:
    data = replace(data_of(), free=("tracker_scale",))
    found = found_in(data, term(STIFF, "pulley_radius"))
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
    start = term(STIFF, "tracker_scale", factor=0.99)
    found = found_in(data, start)
    assert found.terms["tracker_scale"].vector == pytest.approx(expected, abs=near(told))
    fixed = found_in(data, start.fixed())
    assert fixed.terms["tracker_scale"].vector.tolist() == [0.99]
    assert fixed.free.tolist() == [False]
    assert fixed.notes == [
        "tracker_scale is free, as stated in the TOML beside measured.csv, and was fitted to these "
        "data first: factor 0.99 (fixed)"
    ]


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
    found = Freed(*freed(problem_of(data), model, [("tracker_scale", new)]))
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
    found = Freed(*freed(problem, Terms()))
    layout = found.terms["tracker_scale"].layout
    assert isinstance(layout, ApartLayout) and layout.parts == ("x/b.csv", "x/c.csv")
    told = positions(data)
    for k, value in zip((1, 2), found.terms["tracker_scale"].vector, strict=True):
        own = data.file == k
        expected = slope(told[own], data.position[own])
        assert value == pytest.approx(expected, abs=near(told[own]))


def test_a_frame_that_is_far_away_is_registered_first() -> None:
    """Gauss-Newton alone would not come there: it is turned by more than a right angle."""
    frame = term(STIFF, "tracker_frame", **FAR_FRAME)
    data = replace(measured(STIFF, [frame], points=2), free=("tracker_frame",))
    found = found_in(data)
    assert found.free.tolist() == [True] * 6
    assert found.terms["tracker_frame"].vector == pytest.approx(frame.vector, abs=2e-3)


def test_what_was_measured_is_a_reading_in_standard_errors() -> None:
    """A pulley of 12 +- 2 mm, 7 mm in the model: 2.5 standard errors are left."""
    wheel = term(STIFF, "pulley_radius").measured(radius_m=(0.012, 0.002))
    wheel = wheel.with_vector(np.array([0.007]))
    stiff = term(STIFF, "stiffness", factor=1.1)
    terms = Terms([wheel, stiff])
    columns, readings = known_readings(terms)
    scale = wheel.layout.scale[0]
    assert columns == pytest.approx(np.array([[scale / 0.002, 0.0]]))
    assert readings == pytest.approx([6.0]) and known_left(terms) == pytest.approx([2.5])
    assert known_readings(Terms([stiff]))[0].shape == (0, 1)


def days() -> Measurements:
    n = data_of().n_rows
    number = (np.arange(n) >= n // 2).astype(np.int64)
    origins = ("case/monday.csv", "case/tuesday.csv")
    return replace(data_of(), files=("monday.csv", "tuesday.csv"), origins=origins, file=number)


def test_values_of_a_file_are_found_by_its_name_and_new_files_start_at_the_common_ones() -> None:
    plain = term(STIFF, "tracker_frame", shift_x_m=0.5)
    there = Values(plain.layout.null + 0.25, np.zeros(6), plain.knowledge)
    own = Own("file", {"monday.csv": there})
    model = Terms([replace(plain, own=own), term(STIFF, "stiffness", factor=1.1)])
    terms, fresh, notes = laid_out(days(), model)
    frame = terms["tracker_frame"]
    assert isinstance(frame.layout, ApartLayout)
    assert fresh == [("tracker_frame", "case/tuesday.csv")]
    assert frame.vector == pytest.approx(np.concatenate([there.vector, plain.vector]))
    assert notes == [
        "tracker_frame has separate values for each file: case/monday.csv as in the model; "
        "case/tuesday.csv not in the model, so fitted to these data first"
    ]
    assert terms["stiffness"].vector.tolist() == [1.1]
