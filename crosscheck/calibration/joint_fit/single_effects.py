"""Fits of single effects by themselves, as other starting points of the joint fit.

The joint fit can end in a local minimum. If an effect that joins late is really present, many
others may imitate it badly before, and the remainder no longer looks like it. Or the platform rests
in the wrong equilibrium at a few poses, which then count as outliers. By itself, beside the plain
model, one effect may explain most, and from there the joint fit finds the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from crosscheck.calibration.joint_fit.joining import inside, promising_beside
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.fit.least_squares.state import evaluate
from seecr.effects import Term, Terms
from seecr.effects.base import Layout
from seecr.processes import Shared, shared_out

# Steps of each fit, and the largest part of chi2 that it may leave.
_STEPS, _LEFT = 8, 0.5
# How many fits of late effects are returned; how many other effects are tried, and returned.
_LATE, _TRIED, _TAKEN = 2, 3, 1


def fitted_alone(
    setting: Setting, plain: JointFit, later: Sequence[Layout], others: Sequence[Layout]
) -> list[JointFit]:
    """Fits of single effects that explain much by themselves, the best of each kind first.

    Args:
        setting: the data.
        plain: the model without them, with few effects or none (the tracker's frame).
        later: effects with history or a shape that may be added.
        others: all other effects that may be added.
    """
    late = [inside(one.term) for one in promising_beside(setting, plain, later)]
    promising = sorted(promising_beside(setting, plain, others), key=lambda one: -one.gain)
    tried = [one.term for one in promising[:_TRIED]]
    return [*_best(setting, plain, late)[:_LATE], *_best(setting, plain, tried)[:_TAKEN]]


def _best(setting: Setting, plain: JointFit, terms: Sequence[Term]) -> list[JointFit]:
    """The fits that explain much, the best first."""
    shared = partial(Shared, setting, plain, terms)
    fits = shared_out(partial(_with, setting, plain), terms, shared)
    most = _LEFT * plain.state.chi2
    good = [found for found in fits if found is not None and found.state.chi2 < most]
    return sorted(good, key=lambda j: j.state.chi2)


def _with(setting: Setting, plain: JointFit, term: Term) -> JointFit | None:
    terms = Terms([*plain.terms, term])
    state = evaluate(setting.problem, terms, setting.factor, plain.state)
    if not state.valid:
        return None
    return settle(setting, state, widths_of(terms, setting.free), plain.colour, _STEPS)
