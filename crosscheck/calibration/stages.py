"""The stages of a joint fit: all at once, effects alone where that was poor, late ones beside."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.alone import fitted_alone
from crosscheck.calibration.colour import WHITE, Colour
from crosscheck.calibration.gram import best_widths, gram_of
from crosscheck.calibration.joint import JointFit, Setting, cost, settle, tempered
from crosscheck.calibration.later import PAYS, at_null, inside, layouts, promising_beside
from crosscheck.calibration.linearised import groups_of, linearised, unwhitened
from crosscheck.calibration.priors import wider, widths_of
from crosscheck.calibration.restricted import estimate, log_evidence
from crosscheck.calibration.robust import LARGER, outliers
from crosscheck.fit.registration import NAME as TRACKER
from crosscheck.fit.registration import registered
from crosscheck.fit.state import State, evaluate
from seecr.effects import Term, Terms
from seecr.effects.base import Layout

Progress = Callable[[str, float], None]
# Rounds of estimating the noise and fitting with it; it has settled within this part.
_ROUNDS, _SETTLED, _STEPS = 4, 0.03, 8
_SURE = 3.0
# A joint fit that leaves noise so large beside the stated one, or going together like this along
# runs, is no place to start effects with history from alone.
_POOR, _ALIKE = 1.5, 0.5

# All rows count alike as noise of so many times the size that outliers have, one after the other.
_HEATS = (0.3, 1.0, 3.0, 10.0)
# A few effects whose cost is so many times that of everything, or less, are begun with too.
_COMPARABLE = 2.0


@dataclass(frozen=True, eq=False)
class Everything:
    """All effects that the data see fitted together.

    Attributes:
        setting: with rows' history taken as given, where effects with history are in.
        joint: the fit.
        later: all effects that join later, at their most promising shapes, amplitudes at null.
        prices: of those that did not, what they gain more there than on average over shapes.
    """

    setting: Setting
    joint: JointFit
    later: Terms
    prices: Mapping[str, float]


def fit_everything(
    setting: Setting, terms: Terms, progress: Progress, given: Terms | None = None
) -> Everything:
    """The joint fit, effects that join later among them.

    Args:
        setting: the data. terms: effects of the model as it stands.
        progress: called with what is being done and the part of it that is done.
        given: a few effects that were found elsewhere, with the values that they have there.
    """
    at_once, later = layouts(setting.problem)
    progress("fitting all effects", 0.05)
    start = start_of(setting, terms, Terms(Term(a, a.null) for a in at_once))
    joint = with_noise(setting, tempered(setting, start, widths_of(start.terms), WHITE))
    wanted = [a for a in later if a.name not in terms]
    frozen = replace(setting, frozen=True)
    if given is not None:
        joint = from_given(frozen, joint, start, given)
    before, joint = joint, with_rows_back(frozen, joint)
    back = joint
    if poor(joint):
        progress("trying effects alone", 0.4)
        firm = [a for a in at_once if a.name not in terms and a.name != TRACKER]
        joint = _from_alone(frozen, joint, start, terms, (wanted, firm))
    progress("looking at effects with history", 0.6)
    wanted = [a for a in wanted if a.name not in joint.terms]
    looked = promising_beside(frozen, joint, wanted)
    added = [inside(one.term) for one in looked if one.gain > PAYS]
    if added:
        progress(f"fitting {', '.join(t.name for t in added)} too", 0.7)
        joint = _joined(frozen, joint, start.terms, added)
    if any(a.name in joint.terms for a in later):
        setting = frozen
    best = to_its_end(setting, widened(setting, joint))
    if back is not before or joint is not back:
        # rows had been written off that could be explained, or more can be explained now
        best = with_rows_back(setting, best)
    there = [at_null(best.terms[a.name]) for a in later if a.name in best.terms]
    others = [one for one in looked if one.term.name not in best.terms]
    prices = {one.term.name: one.price for one in others}
    return Everything(setting, best, Terms([*there, *(one.term for one in others)]), prices)


def poor(joint: JointFit) -> bool:
    """Whether a joint fit leaves much more than the noise."""
    return float(np.max(joint.colour.scale)) > _POOR or float(np.max(joint.colour.rho)) > _ALIKE


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


def with_noise(setting: Setting, joint: JointFit) -> JointFit:
    """Estimate the noise and fit with it, until it stays."""
    for _ in range(_ROUNDS):
        before = joint.colour
        colour = noise_of(setting, joint)
        change = np.abs(np.log(colour.scale / before.scale)) + np.abs(colour.rho - before.rho)
        joint = settle(setting, joint.state, joint.width, colour, _STEPS, joint.jacobian)
        if float(np.max(change)) < _SETTLED:
            break
    return joint


def to_its_end(setting: Setting, joint: JointFit) -> JointFit:
    """The fit, or where it goes on to from derivatives of its own.

    A fit begins with derivatives from nearby. Where a cable goes slack in between they are others
    here, and what looked like the least may be none.
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
    """The fit, or a better one that did not write off rows it can explain.

    A fit that has cables slack where they are taut is far off in a few rows, and once these hardly
    count nothing pulls it back. So all rows count alike for a while, as noise of about the size
    that outliers have; true outliers are no better explained after it.
    """
    alike = replace(setting, weight=np.ones(len(joint.state.white)))
    for heat in _HEATS:
        if not np.any(outliers(setting.chain, joint.weight, setting.problem.data.n_rows)):
            break
        wide = settle(alike, joint.state, joint.width, WHITE.hotter(heat * LARGER), _STEPS)
        other = with_noise(setting, settle(setting, wide.state, joint.width, joint.colour))
        if worth(setting, other) > worth(setting, joint) + _SURE:
            joint = other
    return joint


def noise_of(setting: Setting, joint: JointFit) -> Colour:
    """The noise by the joint fit's marginal evidence."""
    about = unwhitened(joint)
    return estimate(setting.chain, joint.colour, joint.weight, about.x, about.y, about.width)


def widened(setting: Setting, joint: JointFit) -> JointFit:
    """The fit with wider priors for effects that are surely larger than plausible."""
    linear = linearised(setting, joint)
    groups = groups_of(joint, wider)
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
    """The joint fit, or a better one that begins with an effect, late or not, by itself."""
    few = start.terms.only([*terms.names, TRACKER])
    plain = settle(
        setting, evaluate(setting.problem, few, setting.factor, start), widths_of(few), WHITE
    )  # fmt: skip
    found = [joint]
    for alone in fitted_alone(setting, plain, *may_be):
        others = (t for t in start.terms if t.name not in alone.terms)
        state = evaluate(
            setting.problem, Terms([*alone.terms, *others]), setting.factor, alone.state
        )
        if state.valid:
            fitted = tempered(setting, state, widths_of(state.terms), WHITE)
            found.append(with_noise(setting, fitted))
            if not poor(found[-1]):
                break
    return max(found, key=lambda j: worth(setting, j))


def from_given(setting: Setting, joint: JointFit, start: State, given: Terms) -> JointFit:
    """The joint fit, or a better one that begins with a few effects that were found elsewhere.

    Everything together explains at least as much as a part of it, unless the fit ended in a hollow.
    So where the few explain about as much by themselves, everything is fitted from their values
    too.
    """
    every = Terms([*given, *(at_null(t) for t in start.terms if t.name not in given)])
    state = evaluate(setting.problem, every, setting.factor, start)
    if not state.valid:
        return joint
    width = widths_of(every)
    here = cost(setting, joint.colour, joint.weight, joint.state, joint.width)
    if cost(setting, joint.colour, joint.weight, state, width) > _COMPARABLE * here:
        return joint
    other = with_noise(setting, settle(setting, state, width, joint.colour))
    return max(joint, other, key=lambda j: worth(setting, j))


def _joined(setting: Setting, joint: JointFit, first: Terms, added: list[Term]) -> JointFit:
    """The fit with more effects: from where the others ended and, if that was poor, from afar.

    Those that joined before the others did stay, from null.
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
