"""Fits all effects that the data can see at once, for a model that predicts well.

The tracker's frame is registered first. All effects without history are then fitted together, with
their plausible sizes as priors. Effects with history, shapes or weight join if the remainder calls
for them. Size and autocorrelation of the noise maximise the marginal likelihood of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.beginning import Beginning
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.leave_out import LeftOut, leave_out
from crosscheck.calibration.joint_fit.linearised import linearised
from crosscheck.calibration.joint_fit.stages import Everything, Progress, fit_everything
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.noise.robust import outliers
from crosscheck.fit.least_squares.definite import inverse_of
from crosscheck.fit.least_squares.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.least_squares.state import evaluate
from seecr.effects import Terms
from seecr.pose import Array

PLAIN = Terms()


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors and noise of the joint fit of all effects.

    Attributes:
        before, after, held_out: rms errors by kind: of the model as it stood, of the joint fit, and
            of held-out runs, each predicted by a fit without it.
        scale, rho: by kind of reading, the estimated noise over the stated one, and its correlation
            between successive rows of a run.
    """

    before: Rms
    after: Rms
    held_out: Rms
    scale: dict[str, float]
    rho: dict[str, float]

    def as_json(self) -> dict[str, Any]:
        """The item ``calibrated`` of ``diagnosis.json``."""
        return {
            "before": self.before,
            "after": self.after,
            "held_out": self.held_out,
            "noise": {"scale": self.scale, "correlation": self.rho},
        }


@dataclass(frozen=True, eq=False)
class Calibration(Everything):
    """All effects, fitted to the data together, and how well they predict.

    Attributes:
        before: rms errors of the model as it stood. after: those of this model.
        held_out: errors on held-out runs.
        outliers: (n,) bool rows that hardly count.
    """

    before: Rms
    after: Rms
    held_out: LeftOut
    outliers: NDArray[np.bool_]

    @property
    def terms(self) -> Terms:
        """The effects with their values."""
        return self.joint.terms

    @property
    def colour(self) -> Colour:
        """The noise: its size relative to the stated one, and its autocorrelation along runs."""
        return self.joint.colour

    @property
    def surprise(self) -> float:
        """How many times as far off held-out runs are as the fit expects, in the worst block."""
        return float(np.max(self.held_out.surprise, initial=0.0))

    @property
    def together(self) -> JointErrors:
        """The errors and the noise of the fit."""
        noise = self.colour.by_kind(self.setting.problem)
        return JointErrors(self.before, self.after, self.held_out.rms, *noise)

    @property
    def covariance(self) -> Array:
        """(p, p) posterior covariance of the values in their units."""
        return covariance(self.setting, self.joint)


def fit_all_effects(
    problem: Problem,
    terms: Terms = PLAIN,
    progress: Progress = lambda _text, _part: None,
    given: Terms | None = None,
    beginning: Beginning | None = None,
) -> Calibration:
    """Fit every effect that the data can see.

    Args:
        problem: readings, from :func:`crosscheck.fit.preparation.prepare.prepare`.
        terms: effects of the model as it stands; their values are the starting point.
        progress: called with what is being done and the fraction that is done.
        given: a few effects that were found elsewhere, with their values there.
        beginning: that of this fit, which may have begun before.
    """
    beginning = beginning or Beginning(problem, terms)
    setting = beginning.setting
    stood = evaluate(problem, terms, setting.factor)
    progress("fitting all effects", 0.05)
    fitted = fit_everything(setting, terms, beginning.begun, progress, given)
    setting, joint = fitted.setting, fitted.joint
    far_off = outliers(setting.chain, joint.weight, problem.data.n_rows)
    problem = setting.problem.with_far_off(far_off)
    setting = replace(setting, problem=problem)
    progress("predicting held-out runs", 0.95)
    return Calibration(
        setting,
        joint,
        fitted.later,
        fitted.prices,
        before=rms_by_kind(problem, stood.raw),
        after=rms_by_kind(problem, joint.state.raw),
        held_out=leave_out(setting, joint),
        outliers=far_off,
    )


def covariance(setting: Setting, joint: JointFit) -> Array:
    """(p, p) posterior covariance of the values in their units, from data and prior together.

    It is 0 for parameters that are fixed or on a bound.
    """
    linear = linearised(setting, joint)
    free = np.flatnonzero(linear.width > 0.0)
    x = linear.x[:, free]
    out = np.zeros((len(linear.width), len(linear.width)))
    out[np.ix_(free, free)] = inverse_of(x.T @ x + np.diag(linear.width[free] ** -2.0))
    return np.asarray(out * np.outer(joint.terms.scale, joint.terms.scale))
