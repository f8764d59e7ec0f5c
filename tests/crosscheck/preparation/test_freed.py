"""A tracker that was aligned to the commands stays free in every fit of its data."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term
from made_diagnoses import SLOW

import crosscheck
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.prepare import prepare
from seecr.effects import Terms
from seecr.errors import InputFileError
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
        notes = " ".join(prepare(ROBOT, far_away(*effects), Terms()).all_notes)
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


@pytest.mark.parametrize("said", ['["stiffness"]', '"tracker_frame"', "[1]"])
def test_only_sensors_can_be_free(tmp_path, said):
    write_measurements(tmp_path / "a.csv", measured(ROBOT, points=2))
    (tmp_path / "a.toml").write_text(f"free = {said}\n")
    expected = "a.toml: line 1: free must be a list of some of tracker_frame"
    with pytest.raises(InputFileError, match=expected):
        crosscheck.load_measurements(tmp_path / "a.csv", ROBOT)


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
