"""What callers give: a robot that stands alone in its case, names of effects, noise, data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import made_diagnoses
import numpy as np
import pytest
from called import refused, run
from made_data import case
from made_diagnoses import readings, robot

import crosscheck
from crosscheck import given
from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.errors import CrosscheckError
from crosscheck.fit.reasons import Why
from crosscheck.given import considered
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Term, Terms, catalogue
from seecr.errors import InputError


def test_a_robot_that_needs_files_beside_it_is_refused(tmp_path: Path) -> None:
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    (tmp_path / "beside.xml").write_text("<mujoco/>", encoding="utf-8")
    robot = tmp_path / "robot.xml"
    robot.write_text(text.replace("<worldbody>", '<include file="beside.xml"/><worldbody>', 1))
    folder = tmp_path / "case"
    folder.mkdir()
    with pytest.raises(CrosscheckError, match=r"robot\.xml: needs other files"):
        given.copy_robot(robot, folder / "robot.xml")


def test_another_failure_is_not_called_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_path: Path) -> None:
        raise MemoryError("none is left")

    monkeypatch.setattr(given, "load_robot", fail)
    with pytest.raises(MemoryError, match="none is left"):
        given.copy_robot(model_path("planar_vertical"), tmp_path / "robot.xml")


ROBOT = load_robot(model_path("demobot_parallel"))
DATA = Measurements(Path("m.csv"), 8, np.array(["a"]), command_pose=ROBOT.reference_pose[None])
BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "no data": (lambda: crosscheck.compare(ROBOT, []), "expected measurements or their files, got"),
    "tolerance": (
        lambda: crosscheck.diagnose(ROBOT, DATA, tolerance=cast(Any, 0.1)),
        "tolerance: expected a crosscheck.Tolerance, got 0.1",
    ),
    "names": (
        lambda: crosscheck.add_effects(ROBOT, DATA, ["creep", cast(Any, 3)]),
        "expected names of effects, effects with their values, or a result .* got int",
    ),
    "a number": (lambda: crosscheck.add_effects(ROBOT, DATA, cast(Any, 3)), "effects .* got int"),
    "noise": (
        lambda: crosscheck.load_measurements("m.csv", ROBOT, sigma=cast(Any, {"position": 1.0})),
        "sigma: expected a crosscheck.Sigma, such as .* got dict",
    ),
    "a name for a model": (
        lambda: crosscheck.compare(ROBOT, DATA, model=cast(Any, ["stiffness"])),
        r"Term\.of\(robot, name.*, got 'stiffness'$",
    ),
    "no robot": (
        lambda: crosscheck.diagnose(cast(Any, None), DATA), r"expected a robot, .* got NoneType$",
    ),
    "a diagnosis": (
        lambda: crosscheck.compare(ROBOT, DATA, cast(Any, made_diagnoses.none())),
        "expected a model, .*, got Diagnosis; its .model is one",
    ),
    "a diagnosis to save": (
        lambda: crosscheck.save_model("m.toml", cast(Any, made_diagnoses.none())),
        "expected a model, .*, got Diagnosis; its .model is one",
    ),
    "effects to save": (
        lambda: crosscheck.save_model("m.toml", cast(Any, Terms())),
        "expected a model, such as the .model of a diagnosis, got Terms$",
    ),
    "seed": (lambda: crosscheck.make_twin(ROBOT, -1), "seed: expected a whole number from 0 on"),
    "count": (
        lambda: crosscheck.make_twin(ROBOT, 1, n_effects=-2), "n_effects: expected a whole number",
    ),
    "points": (
        lambda: crosscheck.make_twin(ROBOT, 1, points=0), "points: expected a whole number from 1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_other_arguments_are_one_sentence(what: str) -> None:
    call, words = BAD[what]
    with pytest.raises(InputError, match=words):
        call()


def test_effects_are_considered_by_name() -> None:
    assert considered() == frozenset(catalogue())
    assert considered(["creep", "backlash"], ["creep"]) == {"backlash"}
    assert considered(exclude=["creep"]) == frozenset(catalogue()) - {"creep"}
    with pytest.raises(InputError, match="no effect 'crep'; known, nearest first: creep, "):
        considered(exclude=["crep"])
    with pytest.raises(CrosscheckError, match="no effect is left to consider: only creep and not"):
        considered(["creep"], ["creep"])


@pytest.mark.slow
def test_a_diagnosis_considers_what_it_is_told_to() -> None:
    data = readings(radius_m=0.01)
    found = diagnose(robot(), data, only=["pulley_radius", "stiffness"])
    assert [effect.effect for effect in found.missing] == ["pulley_radius"]
    left_out = {c.effect for c in found.candidates if c.why_not.why is Why.EXCLUDED}
    assert left_out == frozenset(catalogue()) - {"pulley_radius", "stiffness"}
    other = diagnose(robot(), data, only=["pulley_radius", "stiffness"], exclude=["pulley_radius"])
    assert "pulley_radius" not in [effect.effect for effect in other.missing]


def test_a_calibration_fits_what_it_is_told_to_and_what_the_model_has() -> None:
    model = [Term.of(robot(), "stiffness", factor=1.01)]
    found = calibrate(robot(), readings(radius_m=0.01), model, only=["pulley_radius"])
    assert set(found.terms.names) == {"stiffness", "pulley_radius"}
    assert found.terms["pulley_radius"].vector == pytest.approx([0.01], abs=1e-4)


def test_noise_is_stated_with_its_unit() -> None:
    told = Sigma.parsed(["position=0.1mm", "orientation=0.1 deg"])
    assert told.position_m == pytest.approx(1e-4) and told.tension_N is None
    assert told.orientation_rad == pytest.approx(1.7453e-3, rel=1e-4)
    assert Sigma.parsed(["length=0.2mm"]) == Sigma(length_m=2e-4)
    assert told.stated.keys() == {"position_m", "orientation_rad"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("position=0.1deg", r"--sigma position: expected a number .* got unit 'deg' in '0.1deg'"),
        ("position=0.1", r"got no unit in '0.1'"),
        ("position", r"expected KIND=QUANTITY such as position=0.1mm, KIND one of position, "),
        ("tensions=1N", r"--sigma tensions=1N: .* KIND one of tension, "),
        ("tension=-1N", r"expected more than zero"),
    ],
)
def test_noise_that_is_none_is_refused(text: str, words: str) -> None:
    with pytest.raises(CrosscheckError, match=words):
        Sigma.parsed([text])


def test_choices_of_the_command_line(tmp_path: Path) -> None:
    xml, data = case(tmp_path, {"pulley_radius": {"radius_m": 0.01}}, points=4)
    (tmp_path / "measured.toml").unlink(missing_ok=True)
    model = tmp_path / "model.toml"
    told = ("--sigma", "position=0.03mm", "--sigma", "orientation=0.02deg")
    done = run(
        "calibrate", xml, data, "--model", model, *told, "--only", "pulley_radius,stiffness",
        "--exclude", "stiffness",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert 'name = "pulley_radius"' in model.read_text()
    assert "stiffness" not in model.read_text() and "is not stated" not in done.output
    words = refused("diagnose", xml, data, "--tolerance", "0.1kg")
    assert "got unit 'kg' in '0.1kg'" in words and "0.5mm or 0.2deg or 1N" in words
    for command in (("compare",), ("diagnose",), ("calibrate",), ("add", "stiffness")):
        words = refused(*command, xml, data, "--sigma", "position=1N", "--model", model)
        assert "got unit 'N' in '1N'" in words
