"""Whether what is left matters: structure that is small beside the noise is told, not a verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.diagnosis.advice import measure_next
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.search import Search
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
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
    rms, noise = _left_and_noise(found, found.search, problem)
    left = left_over(rms, noise, tolerance, problem.data.sigma, doubt_of(problem, rho))
    found = replace(found, left=left)
    if found.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or left.important or left.undecided:
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


def _left_and_noise(found: Diagnosis, search: Search, problem: Problem) -> tuple[Rms, Rms]:
    """What the model leaves and what noise alone would, by kind.

    Errors of commanded lengths move all readings of a row together, by much more than each is
    read to: then what is left is counted where they do not, in units of the readings' own noise.
    """
    if not problem.sigma.length_m:
        return found.after, found.floor
    shape = problem.measured.shape
    sigma = np.broadcast_to(problem.reading_sigma, shape)
    left = np.nan_to_num(search.last.fit.state.table) * sigma
    return rms_by_kind(problem, left), rms_by_kind(problem, sigma)
