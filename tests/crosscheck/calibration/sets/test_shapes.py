"""Nobody said which shape an effect has: what looking for it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term
from scipy import special

from crosscheck.calibration.joint_fit.joining import promising_beside
from crosscheck.calibration.joint_fit.joint import Setting, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.exact import Exact
from crosscheck.calibration.sets.linear_search import Scores
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import evaluate
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, effect_named, layout_of
from seecr.effects.base import mean_length

ROBOT = load_robot(COGIRO)
DRUMS = "drum_eccentricity"
LAYOUT = layout_of(effect_named(DRUMS), ROBOT)
RADIUS = 0.03


def problem_with(size: float, seed: int = 0) -> Problem:
    hidden = term(ROBOT, DRUMS, sine_2_m=size, cosine_5_m=size, drum_radius_m=RADIUS)
    data = measured(ROBOT, [hidden] if size else [], points=6, seed=seed)
    return Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))


def setting_of(problem: Problem) -> Setting:
    factor = problem.noise(problem.experiment.predict(()))
    return Setting(problem, factor, chain_of(problem), frozen=True)


def score_of(setting: Setting, drums: Term) -> float:
    """Exact, of drums out of round alone, from these values."""
    terms = Terms([drums])
    plain = evaluate(setting.problem, Terms(), setting.factor)
    state = evaluate(setting.problem, terms, setting.factor)
    joint = settle(setting, state, widths_of(terms), WHITE)
    fixed = replace(setting, weight=joint.weight)
    exact = Exact(fixed, joint, Catalogue(Terms(), terms), plain, lambda _text: None)
    found = exact.fit(exact.scores_about(joint), frozenset(terms.names))
    assert found is not None
    return float(found.score)


@pytest.mark.slow
def test_evidence_is_that_averaged_over_the_shapes() -> None:
    """Against sums over radii that are held, each as likely as the next start of the search."""
    problem = problem_with(2.5e-4)
    setting = setting_of(problem)
    plain = evaluate(problem, Terms(), setting.factor)
    starts = [s["drum_radius"] for s in LAYOUT.effect.shapes(plain.prediction.setup)]
    values = np.sort(starts)
    near = int(np.argmin(np.abs(values - RADIUS)))
    own = LAYOUT.names.index("drum_radius_m")
    places = np.arange(near - 2.0, near + 2.01, 0.1)

    def held(place: float) -> float:
        vector = LAYOUT.null.copy()
        vector[own] = np.interp(place, np.arange(len(values)), values)
        return score_of(setting, Term(LAYOUT, vector).fixed("drum_radius_m"))

    each = [held(place) for place in places]
    whole = special.logsumexp(each) + np.log(0.1 / len(values))
    start = Term(LAYOUT, LAYOUT.start({"drum_radius": values[near]}))
    assert score_of(setting, start) == pytest.approx(whole, abs=0.3)
    assert max(each) > whole + 3.0  # what the best radius would seem to be worth


def test_what_promises_most_of_many_shapes_is_worth_their_mean() -> None:
    setting = setting_of(problem_with(0.0))
    nothing = evaluate(setting.problem, Terms(), setting.factor)
    joint = settle(setting, nothing, np.zeros(0), WHITE)
    (found,) = promising_beside(setting, joint, [LAYOUT])
    best = found.gain + found.price
    assert 0.0 < found.price < np.log(len(LAYOUT.effect.shapes(nothing.prediction.setup)))
    (alone,) = promising_beside(setting, joint, [layout_of(effect_named("stiffness"), ROBOT)])
    assert alone.price == 0.0
    # the linear model has the effect at that shape: its score takes the price away again
    drums = Catalogue(Terms(), Terms([found.term]), {DRUMS: found.price})
    plain = evaluate(setting.problem, Terms(), setting.factor)
    scores = Exact(setting, joint, drums, plain, lambda _text: None).scores_about(joint)
    alone_in, none = frozenset([DRUMS]), frozenset[str]()
    step = scores.log_prior(alone_in) - scores.log_prior(none)
    assert scores.neighbours(none)[alone_in] - scores.score(none) == pytest.approx(
        best - found.price + step
    )
    free = Scores(scores.gram, scores.of)
    assert free.score(alone_in) - scores.score(alone_in) == pytest.approx(found.price)
    assert scores.neighbours(alone_in)[none] == pytest.approx(free.neighbours(alone_in)[none])


@pytest.mark.parametrize("part", [0.04, 0.11])
def test_drums_are_found_that_are_small_or_large_beside_the_cables(part: float) -> None:
    radius = part * mean_length(ROBOT)
    hidden = term(ROBOT, DRUMS, sine_2_m=2e-3, cosine_5_m=2e-3, drum_radius_m=radius)
    data = measured(ROBOT, [hidden], points=6)
    setting = setting_of(Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool)))
    plain = settle(setting, evaluate(setting.problem, Terms(), setting.factor), np.zeros(0), WHITE)
    (found,) = promising_beside(setting, plain, [LAYOUT])
    terms = Terms([found.term])
    joint = settle(
        setting, evaluate(setting.problem, terms, setting.factor), widths_of(terms), WHITE
    )
    fitted = joint.terms[DRUMS].vector[LAYOUT.names.index("drum_radius_m")]
    assert fitted == pytest.approx(radius, rel=0.05)
