"""Which effects are considered, and noise stated by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_data import case, refused, run
from made_diagnoses import readings, robot

from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.errors import CrosscheckError
from crosscheck.fit.reasons import Why
from crosscheck.given import considered
from crosscheck.measurements.data import Sigma
from seecr.effects import Term, catalogue
from seecr.errors import InputError


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


def test_from_the_command_line(tmp_path: Path) -> None:
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
    for command in ("diagnose", "calibrate"):
        words = refused(command, xml, data, "--only", "puley_radius", "--model", model)
        assert "no effect 'puley_radius'; known, nearest first: pulley_radius" in words
    words = refused("diagnose", xml, data, "--tolerance", "0.1kg")
    assert "got unit 'kg' in '0.1kg'" in words and "0.5mm or 0.2deg or 1N" in words
    for command in (("compare",), ("diagnose",), ("calibrate",), ("add", "stiffness")):
        words = refused(*command, xml, data, "--sigma", "position=1N", "--model", model)
        assert "got unit 'N' in '1N'" in words
