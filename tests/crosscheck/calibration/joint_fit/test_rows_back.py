"""Joint fits that wrote off rows which they can explain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, measured

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, tempered
from crosscheck.calibration.joint_fit.stages import to_its_end, with_noise, with_rows_back, worth
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import chain_of
from crosscheck.calibration.noise.robust import outliers
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.given import considered
from crosscheck.measurements.data import Measurements
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, effect_named, layout_of

ROBOT = load_robot(COGIRO)
# Every tolerance a little off: which cables are slack where is another matter with each of them.
SOME = (
    "cable_length_offset", "anchor_point_error", "exit_point_error", "centre_of_mass",
    "cable_stiffness", "drum_gain", "platform_mass", "gravity_tilt", "tracker_target",
    "tracker_frame",
)  # fmt: skip
LAYOUTS = [layout_of(effect_named(name), ROBOT) for name in SOME]
SEED = 12


def fitted(data: Measurements) -> tuple[Setting, JointFit]:
    problem = prepare(ROBOT, data, Terms(), considered(SOME)).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    start = Terms(Term(layout, layout.null) for layout in LAYOUTS)
    state = evaluate(problem, start, factor)
    return setting, with_noise(setting, tempered(setting, state, widths_of(start)))


def written_off(setting: Setting, joint: JointFit) -> list[int]:
    """Numbers of the rows that hardly count."""
    off = outliers(setting.chain, joint.weight, setting.problem.data.n_rows)
    return np.flatnonzero(off).tolist()


@pytest.fixture(scope="module")
def data() -> Measurements:
    rng = np.random.default_rng(SEED)
    hidden = [Term(a, a.null + 0.8 * a.scale * rng.standard_normal(len(a))) for a in LAYOUTS]
    return measured(ROBOT, hidden, points=20, seed=SEED)


@pytest.mark.slow
def test_rows_that_can_be_explained_come_back(data: Measurements) -> None:
    setting, joint = fitted(data)
    assert written_off(setting, joint)  # in a hollow: nothing is far off in these data
    better = with_rows_back(setting, joint)
    assert written_off(setting, better) == []
    assert worth(setting, better) > worth(setting, joint) + 50.0
    assert np.max(better.colour.scale) < 1.1


@pytest.mark.slow
def test_what_is_far_off_stays_so(data: Measurements) -> None:
    far = [20, 77, 131]
    position = data.position.copy()
    position[far] += 30.0 * 3e-5
    setting, joint = fitted(replace(data, position=position))
    better = with_rows_back(setting, joint)
    assert written_off(setting, better) == far


@pytest.mark.slow
def test_a_fit_that_ended_by_derivatives_from_elsewhere_goes_on(data: Measurements) -> None:
    """Where cables go slack in between, it stands anywhere and says that it settled."""
    setting, joint = fitted(data)
    ended = to_its_end(setting, with_rows_back(setting, joint))
    assert to_its_end(setting, ended) is ended
    null, there = Terms(Term(a, a.null) for a in LAYOUTS).vector, ended.terms
    before = there.with_vector(null + 0.9 * (there.vector - null))
    stuck = replace(ended, state=evaluate(setting.problem, before, setting.factor, ended.state))
    assert stuck.settled and stuck.state.chi2 > 10.0 * ended.state.chi2
    assert to_its_end(setting, stuck).state.chi2 < 1.1 * ended.state.chi2
