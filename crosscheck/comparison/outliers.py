"""Rows that are far off whatever effects would explain: outliers of a model that lacks some.

What a model lacks moves readings by many times the noise, and farther where the platform is soft,
so that a row far off zero need not be an outlier, and two outliers may hide the rest. All effects
are therefore fitted together with weights against outliers, as a diagnosis does; the fit serves for
nothing else. Weights of a fit that leaves more than noise follow what it misses, so a row also has
to be far off all others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.joining import layouts
from crosscheck.calibration.joint_fit.joint import Setting, tempered
from crosscheck.calibration.joint_fit.stages import start_of, with_noise
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import chain_of
from crosscheck.calibration.noise.robust import outliers
from crosscheck.calibration.unknown.not_noise import outliers_cluster
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.noise.outliers import outlying_rows
from seecr.effects import Term, Terms

# A fit of more rows takes too long for a comparison; fewer readings do not carry one.
_MOST_ROWS, _LEAST_READINGS = 400, 60


def rows_far_off(problem: Problem, terms: Terms) -> NDArray[np.bool_]:
    """(n,) outliers; none if too many are, or neighbours of each other: they are structure then.

    Of more than 400 rows, and of too few readings, those that are far off the others as they are.

    Args:
        problem: the data with their noise. terms: the model as it stands.
    """
    every = problem.data.n_rows
    if not problem.n_readings:
        return np.zeros(every, dtype=bool)
    factor = problem.noise(problem.experiment.predict(terms.effects))
    state = evaluate(problem, terms, factor)
    if not state.valid or not outlying_rows(problem, state, 1.0, every).any():
        return np.zeros(every, dtype=bool)
    if every > _MOST_ROWS or problem.n_readings < _LEAST_READINGS:
        return outlying_rows(problem, state)
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    absent = Terms(Term(layout, layout.null) for layout in layouts(problem)[0])
    start = start_of(setting, terms, absent)
    if not start.valid:
        return outlying_rows(problem, state)
    joint = with_noise(setting, tempered(setting, start, widths_of(start.terms, setting.free)))
    if outliers_cluster(setting, joint):
        return outlying_rows(problem, joint.state)
    far = outlying_rows(problem, joint.state, 1.0, every)
    return far & outliers(setting.chain, joint.weight, every)
