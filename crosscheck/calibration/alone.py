"""Late effects fitted by themselves, where everything else together leaves more than noise.

A joint fit without the effect that is really there can end in a hollow, where many others imitate
it badly and what is left no longer looks like it. By itself, from the plain model, it may explain
nearly all; from there the joint fit finds the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.calibration.joint import JointFit, Setting, settle
from crosscheck.calibration.later import inside, promising_beside
from crosscheck.calibration.priors import widths_of
from crosscheck.fit.state import evaluate
from seecr.effects import Term, Terms
from seecr.effects.base import Layout

# Steps of each fit, how many of them are taken up, and what part of chi2 they may leave at most.
_STEPS, _TAKEN, _LEFT = 8, 2, 0.5


def fitted_alone(setting: Setting, plain: JointFit, later: Sequence[Layout]) -> list[JointFit]:
    """Fits of single late effects that explain much by themselves, the best first.

    Args:
        setting: the data.
        plain: the model without them, with few effects or none (the tracker's frame).
        later: effects that may be added.
    """
    found = []
    for term, _gain in promising_beside(setting, plain, later):
        fitted = _with(setting, plain, term)
        if fitted is not None and fitted.state.chi2 < _LEFT * plain.state.chi2:
            found.append(fitted)
    return sorted(found, key=lambda j: j.state.chi2)[:_TAKEN]


def _with(setting: Setting, plain: JointFit, term: Term) -> JointFit | None:
    terms = Terms([*plain.terms, inside(term)])
    state = evaluate(setting.problem, terms, setting.factor, plain.state)
    if not state.valid:
        return None
    return settle(setting, state, widths_of(terms), plain.colour, _STEPS)
