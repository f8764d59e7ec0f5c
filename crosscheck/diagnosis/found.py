"""The model that a diagnosis ends with: what it had and what it misses, fitted together."""

from __future__ import annotations

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.steps import shown_stages
from crosscheck.model.fitted import Fitted

__all__ = ["found_effects"]


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
