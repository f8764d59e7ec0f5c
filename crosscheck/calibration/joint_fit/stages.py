"""The stages of a joint fit: all effects, single ones if that was poor, those that join later."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from crosscheck.calibration.joint_fit.joining import (
    PAYS,
    at_null,
    inside,
    layouts,
    promising_beside,
)
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, cost, settle, tempered
from crosscheck.calibration.joint_fit.linearised import column_groups, linearised, unwhitened
from crosscheck.calibration.joint_fit.single_effects import fitted_alone
from crosscheck.calibration.linear_evidence.gram import best_widths, gram_of
from crosscheck.calibration.linear_evidence.priors import wider, widths_of
from crosscheck.calibration.noise.colour import WHITE, Colour
from crosscheck.calibration.noise.restricted import estimate, log_evidence
from crosscheck.calibration.noise.robust import LARGER, outliers
from crosscheck.fit.effects.registration import NAME as TRACKER
from crosscheck.fit.effects.registration import registered
from crosscheck.fit.least_squares.state import State, evaluate
from seecr.effects import Term, Terms
from seecr.effects.base import Layout

Progress = Callable[[str, float], None]
# Most rounds of estimating the noise and fitting with it; the change at which the noise has
# converged; steps of each fit.
_ROUNDS, _SETTLED, _STEPS = 4, 0.03, 8
# A fit, or a wider prior, replaces another if it gains this much ln evidence.
_SURE = 3.0
# A joint fit is poor if its noise is so much larger than stated, or so strongly autocorrelated:
# then other starting points are tried.
_POOR, _ALIKE = 1.5, 0.5

# For a while, all rows count equally with noise of so many times the size of outliers, in turn.
_HEATS = (0.3, 1.0, 3.0, 10.0)
# The joint fit is also started from a few given effects if its objective there is at most so many
# times that of the fit so far.
_COMPARABLE = 2.0


@dataclass(frozen=True, eq=False)
class Everything:
    """All effects that the data see, fitted together.

    Attributes:
        setting: the data; the history of rows is constant in derivatives if effects with history
            are in the fit.
        joint: the fit.
        later: all effects that join later, at their most promising shapes, amplitudes at null.
        prices: for those of them that did not join, how much more ln evidence they gain at that
            shape than on average over shapes.
    """

    setting: Setting
    joint: JointFit
    later: Terms
    prices: Mapping[str, float]


def fit_everything(
    setting: Setting, terms: Terms, progress: Progress, given: Terms | None = None
) -> Everything:
    """The joint fit, including effects that join later.

    Args:
        setting: the data. terms: effects of the model as it stands.
        progress: called with what is being done and the fraction that is done.
        given: a few effects that were found elsewhere, with their values there.
    """
    at_once, later = layouts(setting.problem)
    progress("fitting all effects", 0.05)
    start = start_of(setting, terms, Terms(Term(a, a.null) for a in at_once))
    joint = with_noise(setting, tempered(setting, start, widths_of(start.terms, setting.free)))
    wanted = [a for a in later if a.name not in terms]
    frozen = replace(setting, frozen=True)
    if given is not None:
        joint = from_given(frozen, joint, start, given)
    before, joint = joint, with_rows_back(frozen, joint)
    back = joint
    if poor(joint):
        progress("trying effects one by one", 0.4)
        firm = [a for a in at_once if a.name not in terms and a.name != TRACKER]
        joint = _from_alone(frozen, joint, start, terms, (wanted, firm))
    progress("trying effects with history", 0.6)
    wanted = [a for a in wanted if a.name not in joint.terms]
    looked = promising_beside(frozen, joint, wanted)
    pays = sorted((one for one in looked if one.gain > PAYS), key=lambda one: -one.gain)
    added = [inside(one.term) for one in pays]
    if added:
        progress(f"also fitting {', '.join(t.name for t in added)}", 0.7)
        joint = _joined(frozen, joint, start.terms, added)
    if any(a.name in joint.terms for a in later):
        setting = frozen
    best = to_its_end(setting, widened(setting, joint))
    if back is not before or joint is not back:
        # some rows were no true outliers, or more rows can be explained now
        best = with_rows_back(setting, best)
    there = [at_null(best.terms[a.name]) for a in later if a.name in best.terms]
    others = [one for one in looked if one.term.name not in best.terms]
    prices = {one.term.name: one.price for one in others}
    return Everything(setting, best, Terms([*there, *(one.term for one in others)]), prices)


def poor(joint: JointFit) -> bool:
    """Whether a joint fit leaves much larger or more correlated residuals than the stated noise."""
    return float(np.max(joint.colour.scale)) > _POOR or float(np.max(joint.colour.rho)) > _ALIKE


def start_of(setting: Setting, terms: Terms, others: Terms) -> State:
    """The model as it stands with the others at null, the tracker registered if it is not yet."""
    problem = setting.problem
    every = Terms([*terms, *(t for t in others if t.name not in terms)])
    state = evaluate(problem, every, setting.factor)
    frame = registered(problem, state.prediction)
    if TRACKER in terms or TRACKER not in every or frame is None:
        return state
    turned = evaluate(problem, every.with_term(frame), setting.factor, state)
    return turned if turned.valid and turned.chi2 < state.chi2 else state


def with_noise(setting: Setting, joint: JointFit) -> JointFit:
    """Estimate the noise and fit with it, until both converge."""
    for _ in range(_ROUNDS):
        before = joint.colour
        colour = noise_of(setting, joint)
        change = np.abs(np.log(colour.scale / before.scale)) + np.abs(colour.rho - before.rho)
        joint = settle(setting, joint.state, joint.width, colour, _STEPS, joint.jacobian)
        if float(np.max(change)) < _SETTLED:
            break
    return joint


def to_its_end(setting: Setting, joint: JointFit) -> JointFit:
    """Continue a fit with new derivatives until nothing more is gained.

    A fit starts with derivatives from nearby. If a cable goes slack in between, they differ here,
    and what looked like a minimum may be none.
    """
    for _ in range(_ROUNDS):
        here = cost(setting, joint.colour, joint.weight, joint.state, joint.width)
        further = settle(setting, joint.state, joint.width, joint.colour, _STEPS)
        there = cost(setting, joint.colour, joint.weight, further.state, joint.width)
        if here - there < 2.0 * _SURE:
            break
        joint = with_noise(setting, further)
    return joint


def with_rows_back(setting: Setting, joint: JointFit) -> JointFit:
    """The fit, or a better one in which fewer rows count as outliers.

    A fit that has cables slack where they are taut is far off in a few rows, and once these count
    as outliers nothing pulls it back. So all rows get equal weight for a while, with noise of about
    the size of outliers. True outliers are explained no better after it.
    """
    alike = replace(setting, weight=np.ones(len(joint.state.white)))
    for heat in _HEATS:
        if not np.any(outliers(setting.chain, joint.weight, setting.problem.data.n_rows)):
            break
        hot = WHITE.hotter(heat * LARGER)
        wide = settle(alike, joint.state, joint.width, hot, _STEPS, joint.jacobian)
        back = settle(setting, wide.state, joint.width, joint.colour, jacobian=wide.jacobian)
        other = with_noise(setting, back)
        if worth(setting, other) > worth(setting, joint) + _SURE:
            joint = other
    return joint


def noise_of(setting: Setting, joint: JointFit) -> Colour:
    """The noise that maximises the marginal likelihood of the joint fit."""
    about = unwhitened(joint)
    return estimate(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)


def widened(setting: Setting, joint: JointFit) -> JointFit:
    """The fit with wider priors for effects that are clearly larger than plausible."""
    linear = linearised(setting, joint)
    groups = column_groups(joint, partial(wider, free=setting.free))
    gram = gram_of(linear.x, linear.y, groups)
    start = {name: float(group.widths[0]) for name, group in groups.items()}
    width = joint.width.copy()
    for name, wide in best_widths(gram, start, price=_SURE).items():
        width[groups[name].columns] = wide
    if np.array_equal(width, joint.width):
        return joint
    known = joint.jacobian
    return with_noise(setting, settle(setting, joint.state, width, joint.colour, jacobian=known))


def _from_alone(
    setting: Setting, joint: JointFit, start: State, terms: Terms,
    may_be: tuple[Sequence[Layout], Sequence[Layout]],
) -> JointFit:  # fmt: skip
    """The joint fit, or a better one that starts from a fit of a single effect."""
    few = start.terms.only([*terms.names, TRACKER])
    begun = evaluate(setting.problem, few, setting.factor, start)
    plain = settle(setting, begun, widths_of(few, setting.free), WHITE)
    found = [joint]
    for alone in fitted_alone(setting, plain, *may_be):
        others = (t for t in start.terms if t.name not in alone.terms)
        state = evaluate(
            setting.problem, Terms([*alone.terms, *others]), setting.factor, alone.state
        )
        if state.valid:
            fitted = tempered(setting, state, widths_of(state.terms, setting.free))
            found.append(with_noise(setting, fitted))
            if not poor(found[-1]):
                break
    return max(found, key=lambda j: worth(setting, j))


def from_given(setting: Setting, joint: JointFit, start: State, given: Terms) -> JointFit:
    """The joint fit, or a better one that starts from a few effects that were found elsewhere.

    All effects together explain at least as much as some of them, unless the fit ended in a local
    minimum. So if the few explain about as much by themselves, all effects are also fitted from
    there.
    """
    every = Terms([*given, *(at_null(t) for t in start.terms if t.name not in given)])
    state = evaluate(setting.problem, every, setting.factor, start)
    if not state.valid:
        return joint
    width = widths_of(every, setting.free)
    here = cost(setting, joint.colour, joint.weight, joint.state, joint.width)
    if cost(setting, joint.colour, joint.weight, state, width) > _COMPARABLE * here:
        return joint
    other = with_noise(setting, settle(setting, state, width, joint.colour))
    return max(joint, other, key=lambda j: worth(setting, j))


def _joined(setting: Setting, joint: JointFit, first: Terms, added: list[Term]) -> JointFit:
    """The fit with more effects; one by one, the most promising first, if all together cost more.

    Drums out of round with many numbers and no use had kept hysteresis out, which was there.
    """
    best = _with_more(setting, joint, first, added)
    if best is joint and len(added) > 1:
        for term in added:
            best = _with_more(setting, best, first, [term])
    return best


def _with_more(setting: Setting, joint: JointFit, first: Terms, added: list[Term]) -> JointFit:
    """The fit with more effects, from where the others ended and, if that was poor, from null.

    In the latter case, effects that joined before stay in the fit, from null as well. The fit as it
    was if that with more is worth less.
    """
    starts = [Terms([*joint.terms, *added])]
    if float(np.max(joint.colour.scale)) > _POOR:
        there = [inside(at_null(t)) for t in joint.terms if t.name not in first]
        starts.append(Terms([*first, *there, *added]))
    found = [joint]
    for k, terms in enumerate(starts):
        state = evaluate(setting.problem, terms, setting.factor, joint.state)
        if not state.valid:
            continue
        width = widths_of(terms, setting.free)
        if k == 0:
            fitted = settle(setting, state, width, joint.colour)
        else:
            fitted = tempered(setting, state, width)
        found.append(with_noise(setting, fitted))
    return max(found, key=lambda j: worth(setting, j))


def worth(setting: Setting, joint: JointFit) -> float:
    """ln evidence of a joint fit by Laplace's method, with its own noise."""
    about = unwhitened(joint)
    return log_evidence(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)
