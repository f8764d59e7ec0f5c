"""Prior widths: of effects whose values belong to the data no size is expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration.joint_fit.joint import Setting, settle
from crosscheck.calibration.joint_fit.linearised import linearised
from crosscheck.calibration.linear_evidence.priors import FLAT, wider, widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.sets.catalogue import Catalogue, gram_about
from crosscheck.calibration.sets.exact import own_gram
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.evidence import evidence
from crosscheck.fit.effects.gauss_newton import fit
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import evaluate
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

ROBOT = load_robot(COGIRO)
TARGET = term(ROBOT, "tracker_target", rotation_y_rad=-0.03)
BOTH = Terms([TARGET, term(ROBOT, "platform_mass", added_kg=0.02)])


def setting_with(free: tuple[str, ...]) -> Setting:
    data = replace(measured(ROBOT, [*BOTH], points=3), free=free)
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(BOTH.effects))
    return Setting(problem, factor, chain_of(problem), frozen=True)


def widths_in(setting: Setting) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """The widths that each effect may have, about a fit and in the catalogue's linear model."""
    plain = evaluate(setting.problem, BOTH, setting.factor)
    joint = settle(setting, plain, widths_of(BOTH, setting.free), WHITE, 2)
    own = own_gram(linearised(setting, joint), joint, setting.free)
    every = gram_about(setting, joint, Catalogue(BOTH, Terms()))
    of_own, of_every = ({n: g.widths.tolist() for n, g in gram.groups.items()}
                        for gram in (own, every))  # fmt: skip
    return of_own, of_every


def test_values_that_belong_to_the_data_have_one_flat_prior() -> None:
    """Averaged over widths, sets in which anchor points turn instead of the target won by 9."""
    for widths in widths_in(setting_with(("tracker_target",))):
        assert widths["tracker_target"] == [FLAT] and len(widths["platform_mass"]) > 5
    for widths in widths_in(setting_with(())):
        assert len(widths["tracker_target"]) > 5


def test_they_are_never_wider_either() -> None:
    assert wider(TARGET.layout, ("tracker_target",)).tolist() == [FLAT]
    assert FLAT not in wider(TARGET.layout)


def test_the_steps_give_them_one_prior_too() -> None:
    setting = setting_with(("tracker_target",))
    trials = Trials(setting.problem, setting.factor)
    found = fit(setting.problem, BOTH, setting.factor)
    assert trials.evidence(found).log == evidence(found, ("tracker_target",)).log
    assert trials.evidence(found).log != evidence(found).log


def test_they_are_fitted_with_a_flat_prior_too() -> None:
    own = BOTH.own("tracker_target")
    assert np.all(widths_of(BOTH, ("tracker_target",)) == np.where(own, FLAT, 1.0))
    assert np.all(widths_of(BOTH) == 1.0)
