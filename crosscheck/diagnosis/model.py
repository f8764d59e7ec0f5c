"""The model that a diagnosis ends with: what was given, with the missing effects added."""

from __future__ import annotations

import numpy as np

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import provenance_of, renewed, with_fit
from seecr.effects import Term
from seecr.pose import Array
from seecr.prediction.model import Model


def with_found(found: Diagnosis, basis: Model) -> Model | None:
    """The model with what was found, all values fitted together; None without a verdict.

    With nothing added or fitted again it is the model as it was given.
    """
    if found.path is None:
        return None
    if not found.missing and not refitted_names(found, basis):
        return basis
    names = [effect.effect for effect in found.missing]
    errors = {"before": found.before, "after": found.after, "held_out": found.held_out}
    data = found.path.problem.data
    source = provenance_of(data.name, "crosscheck diagnose")
    new = with_fit(basis, found_effects(found), names, source, errors, found_covariance(found))
    return renewed(new, found.path.problem.robot, data)


def found_effects(found: Diagnosis) -> tuple[Fitted, ...]:
    """All effects of the last model, fitted together.

    Where more is missing than is listed, these values are those with which the listed effects
    explain most by themselves, and not those listed, which are nearer to the truth beside the rest
    and make no model without it.
    """
    assert found.path is not None
    fit, listed = found.path.last.fit, {one.effect: one for one in found.missing}
    out = []
    for term in fit.terms:
        part = fit.terms.part(term.name)
        stderr = fit.stderr[part]
        if term.name in listed:
            stderr = np.maximum(stderr, listed[term.name].stderr)
        out.append(Fitted(term, stderr, fit.at_bound[part]))
    return tuple(out)


def found_covariance(found: Diagnosis) -> Array | None:
    """(p, p) covariance of the values of :func:`found_effects`, in their order.

    None unless the listed effects are all that is missing, because it would be too small.
    """
    if found.path is None or found.verdict is not DiagnosisVerdict.EFFECTS_FOUND:
        return None
    fit = found.path.last.fit
    whole = fit.with_idle(fit.covariance)
    # some are wider still, by what a further effect would do to them
    listed = np.concatenate([one.stderr for one in found_effects(found)]) ** 2
    seen = np.isfinite(listed) & np.isfinite(np.diag(whole))
    whole[np.diag_indices_from(whole)] += np.where(seen, listed - np.diag(whole), 0.0).clip(0.0)
    return np.asarray(whole)


def refitted_names(found: Diagnosis, own: Model) -> tuple[str, ...]:
    """Effects of a model that agree with the data only with other values than it has."""
    if found.path is None or found.verdict is not DiagnosisVerdict.NO_EFFECT_MISSING:
        return ()
    return tuple(
        term.name for term in found.path.last.fit.terms
        if term.name in own.names and _differs(term, own.terms[term.name])
    )  # fmt: skip


def _differs(new: Term, old: Term) -> bool:
    """Whether values differ; those of single files or runs, which differ in number, do not."""
    same = new.vector.shape == old.vector.shape
    return same and bool((new.vector != old.vector).any())
