"""Effects with other values in each file: found, named so, kept, and taken up again."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, robot

from crosscheck.add.fit import add_effects
from crosscheck.comparison.residuals import compare
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import together
from crosscheck.model.fitted import load_diagnosed
from crosscheck.model.write import save_model
from seecr.errors import InputFileError
from seecr.prediction.model import load_model

SOME = ["tracker_frame", "pulley_radius", "stiffness"]


@cache
def days() -> Measurements:
    """Two days between which the tracker was set up anew, 2 mm off; pulleys on both."""
    wheels = term(robot(), "pulley_radius", radius_m=0.01)
    moved = term(robot(), "tracker_frame", shift_x_m=0.002)
    first = measured(robot(), [wheels], points=4, sigma=SIGMA, seed=0)
    second = measured(robot(), [wheels, moved], points=4, sigma=SIGMA, seed=1)
    return together([
        replace(one, path=one.path.with_name(name))
        for one, name in ((first, "monday.csv"), (second, "tuesday.csv"))
    ])  # fmt: skip


@cache
def found() -> Diagnosis:
    return diagnose(robot(), days(), only=SOME)


def test_a_tracker_set_up_anew_is_named_so() -> None:
    assert {one.effect for one in found().missing} == {"pulley_radius", "tracker_frame"}
    frame = next(one for one in found().missing if one.effect == "tracker_frame")
    assert frame.per == "file" and frame.title.endswith("another in each file")
    assert "tracker_frame with other values in each file" in found().sentence
    assert frame.as_json()["per"] == "file"
    assert found().as_json()["verdict"] == "effects_found"


def test_its_model_has_values_for_each_file_and_leaves_noise(tmp_path: Path) -> None:
    model = found().model
    assert model is not None
    save_model(tmp_path / "m.toml", model)
    kept = load_model(tmp_path / "m.toml", robot())
    assert "per_file = true" in (tmp_path / "m.toml").read_text(encoding="utf-8")
    assert compare(robot(), days(), kept).is_noise


def test_a_diagnosis_that_was_kept_is_fitted_again(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(found().as_json(), default=str), encoding="utf-8")
    terms, _notes = load_diagnosed(path, robot())
    listed = {one.effect: one for one in found().missing}
    for one in terms:
        assert one.vector == pytest.approx(listed[one.name].values)
        assert type(one.layout) is type(listed[one.name].layout)
    added = add_effects(robot(), days(), terms)
    assert compare(robot(), days(), added.model).is_noise


def test_other_parts_than_files_and_runs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    document = json.loads(json.dumps(found().as_json(), default=str))
    frame = next(one for one in document["missing"] if "per" in one)
    frame["per"] = "week"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputFileError, match='per must be "file" or "run", got \'week\''):
        load_diagnosed(path, robot())


def test_exit_points_that_were_all_moved_are_named_beside_the_tracker(shared_data: Path) -> None:
    """Masts were raised by 300 mm: only their coincidence spoke against them, beyond tolerances."""
    folder = shared_data / "public" / "25-moving-anchors"
    found = diagnose(folder / "robot.xml", folder / "lengths.csv")
    tracker, mass = found.missing
    assert tracker.effect == "tracker_frame" and "exit_point_error" in tracker.indistinguishable
    # of a usual size: only what is probable by itself stands for it
    assert mass.effect == "platform_mass" and found.chances is not None
    alike = next(set(some) for some, _p in found.chances.classes if mass.effect in some)
    assert set(mass.indistinguishable) <= alike
