"""A field in the place of effects: its odds by covariances, and a picture that widens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term
from scipy import special, stats

from crosscheck.calibration.colour import WHITE, chain_of
from crosscheck.calibration.field import FIELD_WIDTHS, UNKNOWN, field_of
from crosscheck.calibration.gram import gram_of
from crosscheck.calibration.instead import NOT_ASKED, field_instead
from crosscheck.calibration.joint import JointFit, Setting, settle
from crosscheck.calibration.priors import widths_of
from crosscheck.calibration.probability import Classes
from crosscheck.calibration.search import seek
from crosscheck.calibration.sets import Scores
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.evidence import WIDTHS
from crosscheck.fit.prepare import prepare
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Measurements
from seecr.effects import Term, Terms
from seecr.mjcf import load_robot
from seecr.pose import Array

ROBOT = load_robot(COGIRO)


def fitted(*terms: Term) -> tuple[Setting, JointFit]:
    problem = prepare(ROBOT, measured(ROBOT, terms, points=4), Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), weight=np.ones(len(problem.row_of)))
    state = evaluate(problem, Terms(terms), factor)
    return setting, settle(setting, state, widths_of(Terms(terms)), WHITE)


def averaged_density(y: Array, columns: Array, widths: tuple[float, ...]) -> float:
    """ln of the density of readings, all that moves them integrated out by covariances."""
    densities = [
        stats.multivariate_normal.logpdf(y, cov=np.eye(len(y)) + w**2 * columns @ columns.T)
        for w in widths
    ]
    return float(special.logsumexp(densities) - np.log(len(widths)))


def test_the_odds_are_those_of_the_covariances() -> None:
    setting, joint = fitted(term(ROBOT, "tracker_scale", factor=1.003))
    scores = Scores(gram_of(joint.jacobian, joint.state.white, {}), 26)
    found = field_instead(setting, joint, {"tracker_scale": 0.3}, scores)
    y = joint.state.white + joint.jacobian @ joint.z
    field = field_of(setting.problem, joint.state.prediction.pose[:, :3])
    kind = setting.chain.kind[np.argmax(field != 0.0, axis=0)]
    parts = [field[:, kind == 0], field[:, kind == 1], field]
    fields = [averaged_density(y, columns, FIELD_WIDTHS) for columns in parts]
    without = averaged_density(y, joint.jacobian, WIDTHS)
    prior = scores.log_prior(frozenset()) - scores.log_prior(frozenset({"tracker_scale"}))
    expected = float(special.logsumexp(fields)) - np.log(3) - without + prior
    assert found.odds == pytest.approx(expected, abs=1e-3)
    assert found.replaced == {"tracker_scale"} and found.seen == "the position alone"
    assert found.odds < UNKNOWN and found.chance == 0.0 and not found.worth


def test_of_a_model_nothing_is_replaced() -> None:
    setting, joint = fitted(term(ROBOT, "tracker_scale", factor=1.003))
    scores = Scores(
        gram_of(joint.jacobian, joint.state.white, {}), 26, frozenset(joint.terms.names)
    )
    assert field_instead(setting, joint, {}, scores) == NOT_ASKED
    setting, joint = fitted()
    assert field_instead(setting, joint, {}, scores) == NOT_ASKED


def widening(terms: list[Term], times: float) -> Measurements:
    """Read by a tracker whose picture widens to its edges, by so many times its noise."""
    data = measured(ROBOT, terms, points=10)
    off = data.position - data.position.mean(axis=0)
    off /= np.linalg.norm(off, axis=1).max()
    assert SIGMA.position_m is not None
    far = 2.0 * times * SIGMA.position_m * off * (off**2).sum(axis=1, keepdims=True)
    return replace(data, position=data.position + far)


@pytest.mark.slow
def test_a_picture_that_widens_is_unknown_and_what_is_hidden_beside_it_named() -> None:
    data = widening([term(ROBOT, "pulley_radius", radius_m=0.006)], 8.0)
    found = diagnose(ROBOT, data)
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert [missing.effect for missing in found.missing] == ["pulley_radius"]
    assert found.missing[0].values[0] == pytest.approx(0.006, rel=0.05)
    assert "is an effect that is not among them: smooth over" in found.sentence
    assert "the position alone" in found.sentence and found.where
    assert found.chances is not None and found.chances.field is not None
    assert found.chances.field > UNKNOWN and found.chances.shown is None
    assert found.chances.words == "" and found.chances.imitated > 0.9
    assert found.chances.of("pulley_radius") > 0.95 > 0.05 > found.chances.of("length_scale")


@pytest.mark.slow
def test_what_steps_find_is_asked_too() -> None:
    """They end with noise, and all that they found would have been sure."""
    ready = prepare(ROBOT, widening([], 8.0), Terms())
    assert ready.refusal is None
    sought = seek(ready.problem, SIGMA)
    assert sought.judgement.imitated is not None and sought.judgement.sure == ()
    assert diagnose(ROBOT, widening([], 8.0)).verdict is DiagnosisVerdict.UNKNOWN_EFFECT


def test_equals_of_what_imitates_are_doubted_as_well() -> None:
    classes = Classes(
        {"a": 0.99, "b": 0.6, "c": 0.4, "d": 0.1}, [("a",), ("b", "c"), ("d",)],
        [0.99, 0.98, 0.1], {"c": 0.5},
    )  # fmt: skip
    less = classes.without(frozenset({"b"}), 0.75)
    assert less.probability == pytest.approx([0.99, 0.245, 0.1])
    assert less.effect == pytest.approx({"a": 0.99, "b": 0.15, "c": 0.1, "d": 0.1})
    assert less.further == pytest.approx({"c": 0.125}) and less.members == classes.members
    assert classes.without(frozenset(), 0.75).probability == classes.probability
