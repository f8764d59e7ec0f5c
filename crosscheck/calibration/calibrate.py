"""All effects that the data can see, fitted at once: a model that is worth what it predicts.

The tracker's frame is registered first; all effects without history follow together, with
plausible sizes as priors; those with history, with shapes and with weight join where what is left
asks for them. Size and correlation of the noise come from the fit's own marginal evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.colour import WHITE, Colour, chain_of
from crosscheck.calibration.gram import best_widths, gram_of
from crosscheck.calibration.joint import JointFit, Setting, settle, tempered
from crosscheck.calibration.later import layouts, worth_adding
from crosscheck.calibration.leave_out import LeftOut, leave_out
from crosscheck.calibration.linearised import groups_of, linearised, unwhitened
from crosscheck.calibration.registration import NAME as TRACKER
from crosscheck.calibration.registration import registered
from crosscheck.calibration.restricted import estimate, log_evidence
from crosscheck.calibration.robust import outliers
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.state import State, evaluate
from seecr.effects import Term, Terms
from seecr.pose import Array

Progress = Callable[[str, float], None]
PLAIN = Terms()
# Prior standard deviations, in plausible sizes, of what has no plausible size: where the tracker
# stands, and shapes.
FLAT, SHAPES = 300.0, 30.0
# Rounds of estimating the noise and fitting with it; it has settled within this part.
_ROUNDS, _SETTLED, _STEPS = 4, 0.03, 8
# Prior widths of effects, in plausible sizes: more than 1 only where that is surely better.
WIDER = (1.0, 3.0, 10.0)
_SURE = 3.0
# A joint fit that leaves this much is no place to start effects with history from alone.
_POOR = 1.5


@dataclass(frozen=True, eq=False)
class Calibration:
    """All effects fitted to data together.

    Attributes:
        setting: the data. joint: the fit.
        before: rms errors of the model as it stood. after: of this one.
        held_out: on runs left out.
        outliers: (n,) bool rows that hardly count.
    """

    setting: Setting
    joint: JointFit
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
        """The noise: its size beside the stated one, its correlation along runs."""
        return self.joint.colour

    @property
    def covariance(self) -> Array:
        """(p, p) of the values in their units, the prior's part in it."""
        return covariance(self.setting, self.joint)


def calibrate(
    problem: Problem, terms: Terms = PLAIN, progress: Progress = lambda _text, _part: None
) -> Calibration:
    """Fit every effect that the data can see.

    Args:
        problem: readings, from :func:`crosscheck.fit.prepare.prepare`.
        terms: effects of the model as it stands; their values are the start.
        progress: called with what is being done and the part of it that is done.
    """
    factor = problem.noise(problem.experiment.predict(terms.effects))
    setting = Setting(problem, factor, chain_of(problem))
    stood = evaluate(problem, terms, factor)
    joint = fit_everything(setting, terms, progress)
    progress("predicting runs left out", 0.95)
    return Calibration(
        setting,
        joint,
        before=rms_by_kind(problem, stood.raw),
        after=rms_by_kind(problem, joint.state.raw),
        held_out=leave_out(setting, joint),
        outliers=outliers(setting.chain, joint.weight, problem.data.n_rows),
    )


def fit_everything(setting: Setting, terms: Terms, progress: Progress) -> JointFit:
    """The joint fit, effects that join later among them."""
    at_once, later = layouts(setting.problem)
    progress("fitting all effects", 0.05)
    start = start_of(setting, terms, Terms(Term(a, a.null) for a in at_once))
    joint = with_noise(setting, tempered(setting, start, widths_of(start.terms), WHITE))
    progress("looking at effects with history", 0.5)
    wanted = [a for a in later if a.name not in terms]
    added = worth_adding(setting, joint, wanted)
    if added:
        progress(f"fitting {', '.join(t.name for t in added)} too", 0.6)
        setting = replace(setting, frozen=True)
        joint = _joined(setting, joint, start.terms, added)
    return widened(setting, joint)


def start_of(setting: Setting, terms: Terms, others: Terms) -> State:
    """The model as it stands, the others at null, the tracker registered if it was not yet."""
    problem = setting.problem
    every = Terms([*terms, *(t for t in others if t.name not in terms)])
    state = evaluate(problem, every, setting.factor)
    frame = registered(problem, state.prediction)
    if TRACKER in terms or TRACKER not in every or frame is None:
        return state
    turned = evaluate(problem, every.with_term(frame), setting.factor, state)
    return turned if turned.valid and turned.chi2 < state.chi2 else state


def widths_of(terms: Terms) -> Array:
    """(p,) prior standard deviations in plausible sizes; 0 for values that are fixed."""
    parts = [
        np.where(t.layout.shape, SHAPES, FLAT if t.name == TRACKER else 1.0) for t in terms
    ]  # fmt: skip
    return np.where(terms.knowledge.fixed, 0.0, np.concatenate([np.zeros(0), *parts]))


def with_noise(setting: Setting, joint: JointFit) -> JointFit:
    """Estimate the noise and fit with it, until it stays."""
    for _ in range(_ROUNDS):
        before = joint.colour
        colour = noise_of(setting, joint)
        change = np.abs(np.log(colour.scale / before.scale)) + np.abs(colour.rho - before.rho)
        joint = settle(setting, joint.state, joint.width, colour, _STEPS)
        if float(np.max(change)) < _SETTLED:
            break
    return joint


def noise_of(setting: Setting, joint: JointFit) -> Colour:
    """The noise by the joint fit's marginal evidence."""
    about = unwhitened(joint)
    return estimate(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)


def widened(setting: Setting, joint: JointFit) -> JointFit:
    """The fit with wider priors for effects that are surely larger than plausible."""
    linear = linearised(setting, joint)
    groups = groups_of(joint, lambda layout: np.array([FLAT] if layout.name == TRACKER else WIDER))
    gram = gram_of(linear.x, linear.y, groups)
    start = {name: float(group.widths[0]) for name, group in groups.items()}
    width = joint.width.copy()
    for name, wide in best_widths(gram, start, price=_SURE).items():
        width[groups[name].columns] = wide
    if np.array_equal(width, joint.width):
        return joint
    return with_noise(setting, settle(setting, joint.state, width, joint.colour))


def _joined(setting: Setting, joint: JointFit, first: Terms, added: list[Term]) -> JointFit:
    """The fit with more effects: from where the others ended and, if that was poor, from afar."""
    starts = [Terms([*joint.terms, *added])]
    if float(np.max(joint.colour.scale)) > _POOR:
        starts.append(Terms([*first, *added]))
    found = [joint]
    for k, terms in enumerate(starts):
        state = evaluate(setting.problem, terms, setting.factor, joint.state)
        if not state.valid:
            continue
        width = widths_of(terms)
        if k == 0:
            fitted = settle(setting, state, width, joint.colour)
        else:
            fitted = tempered(setting, state, width, WHITE)
        found.append(with_noise(setting, fitted))
    return max(found, key=lambda j: worth(setting, j))


def worth(setting: Setting, joint: JointFit) -> float:
    """ln evidence of a joint fit, by Laplace, with its own noise."""
    about = unwhitened(joint)
    return log_evidence(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)


def covariance(setting: Setting, joint: JointFit) -> Array:
    """(p, p) of the values in their units: the data's and the prior's knowledge together.

    0 for parameters that stayed where they were, held or on a bound.
    """
    linear = linearised(setting, joint)
    free = np.flatnonzero(linear.width > 0.0)
    x = linear.x[:, free]
    out = np.zeros((len(linear.width), len(linear.width)))
    out[np.ix_(free, free)] = np.linalg.inv(x.T @ x + np.diag(linear.width[free] ** -2.0))
    return np.asarray(out * np.outer(joint.terms.scale, joint.terms.scale))
