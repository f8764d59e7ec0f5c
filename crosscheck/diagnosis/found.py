"""The model that a diagnosis ends with: what it had and what it misses, fitted together."""

from __future__ import annotations

import numpy as np

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.steps import shown_stages
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.model.fitted import Fitted
from seecr.pose import Array

__all__ = ["found_covariance", "found_effects"]


def found_effects(found: Diagnosis) -> tuple[Fitted, ...]:
    """All effects of the model with those that are listed, as fitted with them.

    None where there is no verdict.
    """
    if found.search is None:
        return ()
    listed = [Fitted(one.term, one.stderr, one.at_bound) for one in found.missing]
    names = {one.term.name for one in listed}
    best = shown_stages(found)[1].step.fit
    own = [(term, best.terms.part(term.name)) for term in best.terms if term.name not in names]
    had = [Fitted(term, best.stderr[part], best.at_bound[part]) for term, part in own]
    return (*had, *listed)


def found_covariance(found: Diagnosis) -> Array | None:
    """(p, p) of the values of :func:`found_effects`, in their order; inf where unseen.

    None where there is no verdict, and where many more effects are missing than are listed: what
    those would move is not known.
    """
    if found.search is None or found.verdict is DiagnosisVerdict.MANY_EFFECTS:
        return None
    best, effects = shown_stages(found)[1].step.fit, found_effects(found)
    if not effects:
        return np.zeros((0, 0))
    every = np.arange(len(best.terms))
    order = np.concatenate([every[best.terms.part(one.term.name)] for one in effects])
    stderr = np.concatenate([one.stderr for one in effects])
    known = np.where(np.isfinite(stderr), stderr, 0.0)
    out = best.correlation[np.ix_(order, order)] * np.outer(known, known)
    np.fill_diagonal(out, stderr**2)
    return np.asarray(out)
