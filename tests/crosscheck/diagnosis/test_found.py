"""The model of a diagnosis: how well its values are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import POINTS, SIGMA, diagnose_with, none, nothing, pulleys, readings, robot

from crosscheck.comparison.residuals import compare
from crosscheck.diagnosis.found import found_covariance, found_effects
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.model.write import save_model
from seecr.prediction.experiment import predict
from seecr.prediction.model import load_model
from seecr.prediction.uncertainty import covariance_of


def test_the_covariance_is_that_of_the_errors_as_listed() -> None:
    found = pulleys()
    (listed,) = found.missing
    wider = replace(found, missing=(replace(listed, stderr=3.0 * listed.stderr),))
    for one, factor in ((found, 1.0), (wider, 3.0)):
        covariance = found_covariance(one)
        assert covariance is not None
        own = np.concatenate([effect.stderr for effect in found_effects(one)])
        assert np.sqrt(np.diag(covariance)) == pytest.approx(own)
        assert own[-1] == pytest.approx(factor * listed.stderr[-1])


def test_the_covariance_goes_in_the_order_of_the_effects() -> None:
    """Which is that of their worth, not of the fit."""
    hidden = [term(robot(), "pulley_radius", radius_m=0.01)]
    hidden.append(term(robot(), "stiffness", factor=0.8))
    data = measured(robot(), hidden, points=POINTS, sigma=SIGMA, tensions=True)
    found = diagnose_with(robot(), data, only=[one.name for one in hidden])
    assert len(found.missing) == 2
    for missing in (found.missing, found.missing[::-1]):
        one = replace(found, missing=missing)
        covariance = found_covariance(one)
        assert covariance is not None
        own = np.concatenate([effect.stderr for effect in found_effects(one)])
        assert own[0] != pytest.approx(own[1])
        assert np.sqrt(np.diag(covariance)) == pytest.approx(own)


@pytest.mark.parametrize(
    "verdict", [DiagnosisVerdict.MANY_EFFECTS, DiagnosisVerdict.UNKNOWN_EFFECT]
)
def test_where_more_is_missing_than_is_listed_there_is_none(verdict: DiagnosisVerdict) -> None:
    assert found_covariance(replace(pulleys(), verdict=verdict)) is None


def test_a_diagnosis_has_a_model_that_is_kept_compared_and_predicts(tmp_path: Path) -> None:
    found, data = pulleys(), readings(radius_m=0.01)
    assert found.model is not None and found.model is found.model
    save_model(tmp_path / "m.toml", found.model)
    kept = load_model(tmp_path / "m.toml", robot())
    assert kept.document["effect"][0]["provenance"]["by"] == "crosscheck diagnose"
    assert covariance_of(kept) == pytest.approx(covariance_of(found.model))
    assert kept.stderr["pulley_radius"] == pytest.approx(found.missing[0].stderr, rel=1e-2)
    assert compare(robot(), data, found.model).is_noise
    poses = data.command_pose
    assert predict(robot(), poses, found.model).pose == pytest.approx(
        predict(robot(), poses, kept).pose
    )


def test_the_model_of_a_diagnosis_has_what_was_given_too(tmp_path: Path) -> None:
    data, few = readings(radius_m=0.01), ["pulley_radius"]
    given = [term(robot(), "stiffness", factor=1.0001)]
    found = diagnose_with(robot(), data, given, only=few)
    assert found.model is not None and found.model.names == ("stiffness", "pulley_radius")
    save_model(tmp_path / "m.toml", found.model)
    # with its own model nothing is missing, and that stays as it is, with its covariance
    again = diagnose_with(robot(), data, tmp_path / "m.toml", only=few)
    assert again.model is not None and again.refitted == () and not again.missing
    save_model(tmp_path / "again.toml", again.model)
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "m.toml").read_text()


def test_without_a_verdict_there_is_no_model_and_of_nothing_missing_the_plain_one() -> None:
    plain = nothing().model
    assert none().model is None and plain is not None and plain.names == ()


def test_the_model_has_the_values_that_explain_most_by_themselves() -> None:
    """What is listed beside many effects is nearer to the truth, and no model without the rest."""
    found = pulleys()
    (listed,) = found.missing
    beside = replace(listed, term=listed.term.with_vector(3.0 * listed.term.vector),
                     stderr=5.0 * listed.stderr)  # fmt: skip
    (kept,) = found_effects(replace(
        found, missing=(beside,), verdict=DiagnosisVerdict.MANY_EFFECTS
    ))  # fmt: skip
    assert kept.term.vector == pytest.approx(listed.term.vector)
    assert kept.stderr == pytest.approx(5.0 * listed.stderr)
