"""Whether what is left matters: structure that is small beside the noise is told, not a verdict."""

from __future__ import annotations

from dataclasses import replace

from crosscheck.diagnosis.advice import measure_next
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.tolerance import Tolerance, doubt_of, left_over


def weighed(found: Diagnosis, problem: Problem, tolerance: Tolerance) -> Diagnosis:
    """The diagnosis with what is left and how large that is; no unknown effect that is too small.

    Args:
        found: of these data.
        problem: the data.
        tolerance: from where on what is left matters.
    """
    if found.search is None:
        return found
    rho = 0.0 if found.whiteness is None else max(found.whiteness.lag, found.whiteness.neighbour)
    left = left_over(found.after, found.floor, tolerance, doubt_of(problem, rho))
    found = replace(found, left=left)
    if found.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or left.important:
        return found
    some, none = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING
    verdict = some if found.missing else none
    assert found.search is not None
    names = " and ".join(effect.effect for effect in found.missing)
    start = f"Missing is {names}; structure" if names else "Structure"
    return replace(
        found,
        verdict=verdict,
        sentence=f"{start} that remains is too small to matter: {left.words}.",
        measure_next=tuple(measure_next(found.search, found.missing, verdict, found.where)),
    )
