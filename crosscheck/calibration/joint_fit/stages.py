"""The stages of a joint fit: all effects, single ones if that was poor, those that join later."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from crosscheck.calibration.joint_fit.joining import (
    PAYS,
    Promising,
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
from seecr.processes import Shared, shared_out

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
class Begun:
    """What a joint fit begins with, whatever was found elsewhere.

    Attributes:
        start: the model as it stands, with all effects that are fitted from the start at null.
        first: the fit from there. alone: fits from single effects; None if they were not asked for.
    """

    start: State
    first: JointFit
    alone: Sequence[JointFit] | None = None


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


def begin(setting: Setting, terms: Terms, ahead: bool = False) -> Begun:
    """Begin a joint fit.

    Args:
        setting: the data. terms: effects of the model as it stands.
        ahead: also fit from single effects if the fit is poor, as if nothing better were known.
    """
    at_once, _later = layouts(setting.problem)
    start = start_of(setting, terms, Terms(Term(a, a.null) for a in at_once))
    first = with_noise(setting, tempered(setting, start, widths_of(start.terms, setting.free)))
    alone = alone_fits(setting, start, terms) if ahead and poor(first) else None
    return Begun(start, first, alone)


def fit_everything(
    setting: Setting, terms: Terms, begun: Begun, progress: Progress, given: Terms | None = None
) -> Everything:
    """The joint fit, including effects that join later.

    Args:
        setting: the data. terms: effects of the model as it stands.
        begun: the beginning of the fit.
        progress: called with what is being done and the fraction that is done.
        given: a few effects that were found elsewhere, with their values there.
    """
    _at_once, later = layouts(setting.problem)
    start, first, frozen = begun.start, begun.first, replace(setting, frozen=True)
    if given is not None:
        first = from_given(frozen, first, start, given)
    back = with_rows_back(frozen, first)
    alone = back
    if poor(back):
        progress("trying effects one by one", 0.4)
        fits = alone_fits(setting, start, terms) if begun.alone is None else begun.alone
        alone = max([back, *fits], key=lambda j: worth(frozen, j))
    progress("trying effects with history", 0.6)
    wanted = [a for a in later if a.name not in terms and a.name not in alone.terms]
    looked = promising_beside(frozen, alone, wanted)
    joined = _with_promising(frozen, alone, start.terms, looked, progress)
    own = frozen if any(a.name in joined.terms for a in later) else setting
    best = to_its_end(own, widened(own, joined))
    if back is not first or joined is not back:
        # some rows were no true outliers, or more rows can be explained now
        best = with_rows_back(own, best)
    return _everything(own, best, later, looked)


def _everything(
    setting: Setting, joint: JointFit, later: Sequence[Layout], looked: Sequence[Promising]
) -> Everything:
    """The fit, with the effects that join later as they are in it or where they look promising."""
    there = [at_null(joint.terms[a.name]) for a in later if a.name in joint.terms]
    others = [one for one in looked if one.term.name not in joint.terms]
    prices = {one.term.name: one.price for one in others}
    return Everything(setting, joint, Terms([*there, *(one.term for one in others)]), prices)


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
    heats: Sequence[float] = _HEATS
    while heats and np.any(outliers(setting.chain, joint.weight, setting.problem.data.n_rows)):
        shared = partial(Shared, setting, joint)
        others = shared_out(partial(_with_rows_alike, setting, joint), heats, shared)
        enough = worth(setting, joint) + _SURE
        better = (k for k, other in enumerate(others) if worth(setting, other) > enough)
        first = next(better, None)
        if first is None:
            break
        joint, heats = others[first], heats[first + 1 :]
    return joint


def _with_rows_alike(setting: Setting, joint: JointFit, heat: float) -> JointFit:
    """The fit after a while in which all rows had equal weight, with noise so many times larger."""
    alike = replace(setting, weight=np.ones(len(joint.state.white)))
    hot = WHITE.hotter(heat * LARGER)
    wide = settle(alike, joint.state, joint.width, hot, _STEPS, joint.jacobian)
    back = settle(setting, wide.state, joint.width, joint.colour, jacobian=wide.jacobian)
    return with_noise(setting, back)


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


def alone_fits(setting: Setting, start: State, terms: Terms) -> list[JointFit]:
    """Joint fits that start from fits of single effects, up to the first that is not poor."""
    frozen = replace(setting, frozen=True)
    at_once, later = layouts(setting.problem)
    wanted = [a for a in later if a.name not in terms]
    firm = [a for a in at_once if a.name not in terms and a.name != TRACKER]
    few = start.terms.only([*terms.names, TRACKER])
    begun = evaluate(setting.problem, few, setting.factor, start)
    plain = settle(frozen, begun, widths_of(few, setting.free), WHITE)
    found = list[JointFit]()
    for alone in fitted_alone(frozen, plain, wanted, firm):
        others = (t for t in start.terms if t.name not in alone.terms)
        every = Terms([*alone.terms, *others])
        state = evaluate(setting.problem, every, setting.factor, alone.state)
        if state.valid:
            fitted = tempered(frozen, state, widths_of(state.terms, setting.free))
            found.append(with_noise(frozen, fitted))
            if not poor(found[-1]):
                break
    return found


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


def _with_promising(
    setting: Setting, joint: JointFit, first: Terms, looked: Sequence[Promising],
    progress: Progress,
) -> JointFit:  # fmt: skip
    """The fit with those effects that pay, if any do and are worth it."""
    pays = sorted((one for one in looked if one.gain > PAYS), key=lambda one: -one.gain)
    if not pays:
        return joint
    added = [inside(one.term) for one in pays]
    progress(f"also fitting {', '.join(t.name for t in added)}", 0.7)
    return _joined(setting, joint, first, added)


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

    def fitted(k: int) -> JointFit | None:
        state = evaluate(setting.problem, starts[k], setting.factor, joint.state)
        if not state.valid:
            return None
        width = widths_of(starts[k], setting.free)
        if k == 0:
            return with_noise(setting, settle(setting, state, width, joint.colour))
        return with_noise(setting, tempered(setting, state, width))

    fits = shared_out(fitted, range(len(starts)), lambda: Shared(setting, joint, starts))
    found = (one for one in (joint, *fits) if one is not None)
    return max(found, key=lambda j: worth(setting, j))


def worth(setting: Setting, joint: JointFit) -> float:
    """ln evidence of a joint fit by Laplace's method, with its own noise."""
    about = unwhitened(joint)
    return log_evidence(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)
