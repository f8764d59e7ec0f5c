"""The model that a diagnosis ends with: its previous effects and the missing ones, together."""

from __future__ import annotations

import numpy as np

from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.steps import shown_stages
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.systematic import moved_by_others
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.model.fitted import Fitted
from seecr.pose import Array
from seecr.prediction.model import Model

__all__ = ["found_covariance", "found_effects", "refitted"]


def found_effects(found: Diagnosis) -> tuple[Fitted, ...]:
    """All effects of the model and those that are listed, fitted together.

    Empty if there is no verdict. Where more is missing than is listed, the values are those with
    which the listed effects explain most by themselves, and not those listed, which are nearer to
    the truth beside the rest and make no model without it. Their standard errors then include by
    how much another missing effect may shift them, as those of ``crosscheck add`` do.
    """
    if found.search is None:
        return ()
    step = shown_stages(found)[1].step
    best, stderr = step.fit, _widened(found) * step.fit.stderr
    if found.verdict is DiagnosisVerdict.MANY_EFFECTS and not step.whiteness.is_noise:
        # a fit of its own knows nothing of what else is missing
        moved = moved_by_others(found.search.problem, best)
        stderr = np.hypot(step.whiteness.inflation * stderr, moved)
    listed = [_by_itself(one, best, stderr) for one in found.missing]
    names = {one.term.name for one in listed}
    own = [(term, best.terms.part(term.name)) for term in best.terms if term.name not in names]
    had = [Fitted(term, stderr[part], best.at_bound[part]) for term, part in own]
    return (*had, *listed)


def _by_itself(listed: MissingEffect, best: Fit, stderr: Array) -> Fitted:
    """A listed effect with its values and errors (p,) in the fit of just the listed effects."""
    if listed.effect not in best.terms:
        return Fitted(listed.term, listed.stderr, listed.at_bound)
    part = best.terms.part(listed.effect)
    error = np.maximum(stderr[part], listed.stderr)
    return Fitted(best.terms[listed.effect], error, best.at_bound[part])


def refitted(found: Diagnosis, own: Model) -> tuple[str, ...]:
    """Effects of a model that agree with the data only with other values than it has."""
    if found.verdict is not DiagnosisVerdict.NO_EFFECT_MISSING:
        return ()
    return tuple(
        one.term.name
        for one in found_effects(found)
        if one.term.name in own.names and _differs(one.term.vector, own.terms[one.term.name].vector)
    )


def _differs(new: Array, old: Array) -> bool:
    """Whether values differ; those of single files or runs, which differ in number, do not."""
    return new.shape == old.shape and bool((new != old).any())


def _widened(found: Diagnosis) -> float:
    """Factor by which standard errors of listed effects exceed those of the fit."""
    best = shown_stages(found)[1].step.fit
    for one in found.missing:
        own = best.stderr[best.terms.part(one.term.name)]
        seen = np.isfinite(own) & (own > 0.0) & np.isfinite(one.stderr)
        if found.verdict is not DiagnosisVerdict.MANY_EFFECTS and seen.any():
            return float(one.stderr[seen][0] / own[seen][0])
    return 1.0


def found_covariance(found: Diagnosis) -> Array | None:
    """(p, p) covariance of the values of :func:`found_effects`, in their order.

    None unless the listed effects are all that is missing, because it would be too small.
    """
    if found.search is None or found.verdict is not DiagnosisVerdict.EFFECTS_FOUND:
        return None
    best, effects = shown_stages(found)[1].step.fit, found_effects(found)
    every = np.arange(len(best.terms))
    order = np.concatenate([every[best.terms.part(one.term.name)] for one in effects])
    whole = best.with_idle(_widened(found) ** 2 * best.covariance)
    return np.asarray(whole[np.ix_(order, order)])
