"""The size of an unknown effect that data show: fields of that size earn the odds to be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.unknown.beside import unknown_beside
from crosscheck.calibration.unknown.detectable import detectable_size
from crosscheck.calibration.unknown.field import field_of
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, effect_named, layout_of

DRAWN = 12


def joint_fit() -> tuple[Setting, JointFit]:
    robot = load_robot(COGIRO)
    names = ("tracker_target", "stiffness", "exit_point_error")
    layouts = [layout_of(effect_named(name), robot) for name in names]
    terms = Terms(Term(layout, layout.null) for layout in layouts)
    problem = prepare(robot, measured(robot, points=8), Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    state = evaluate(problem, terms, factor)
    return setting, settle(setting, state, widths_of(terms), WHITE)


@pytest.mark.slow
def test_nine_in_ten_fields_of_that_size_are_seen_and_few_of_a_third() -> None:
    setting, joint = joint_fit()
    size = detectable_size(setting, joint, joint.jacobian, joint.width)
    assert size is not None
    shown = size["position_rms_m"]
    assert shown is not None and size["tension_rms_N"] is None
    assert size["orientation_rms_rad"] == pytest.approx(
        shown * SIGMA.orientation_rad / SIGMA.position_m, rel=0.2
    )
    field = field_of(setting.problem, joint.state.prediction.pose[:, :3])
    random = np.random.default_rng(1)

    def seen(part: float) -> float:
        out = 0
        for _ in range(DRAWN):
            drawn = field @ random.standard_normal(field.shape[1])
            drawn *= part * shown / SIGMA.position_m / np.sqrt(np.mean(drawn**2))
            white = random.standard_normal(len(drawn)) + drawn
            there = replace(joint, state=replace(joint.state, white=white))
            out += unknown_beside(setting, there).is_there
        return out / DRAWN

    assert seen(1.0) > 0.7
    assert seen(1.0 / 3.0) < 0.3


def test_what_the_catalogue_fits_whole_hides_at_any_size() -> None:
    setting, joint = joint_fit()
    field = field_of(setting.problem, joint.state.prediction.pose[:, :3])
    assert detectable_size(setting, joint, field, np.full(field.shape[1], 1e4)) is None
