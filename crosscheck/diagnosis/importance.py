"""Decides whether the remainder matters: structure far below the noise is no unknown effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.diagnosis.advice import measure_next
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.search import Search
from crosscheck.fit.least_squares.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.noise.tolerance import Tolerance, doubt_of, remainder_of
from crosscheck.fit.reasons import DiagnosisVerdict


def weighed(found: Diagnosis, problem: Problem, tolerance: Tolerance) -> Diagnosis:
    """The diagnosis with the size of the remainder, and without an unknown effect too small.

    Args:
        found: the diagnosis of these data.
        problem: the data.
        tolerance: from which size on the remainder matters.
    """
    if found.search is None:
        return found
    rho = 0.0 if found.whiteness is None else max(found.whiteness.lag, found.whiteness.neighbour)
    rms, noise = _left_and_noise(found, found.search, problem)
    left = remainder_of(rms, noise, tolerance, problem.data.sigma, doubt_of(problem, rho))
    found = replace(found, left=left)
    if found.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or left.important or left.undecided:
        return found
    some, none = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING
    verdict = some if found.missing else none
    assert found.search is not None
    names = " and ".join(effect.effect for effect in found.missing)
    start = f"Missing: {names}. The structure" if names else "The structure"
    like = "" if found.chances is None else found.chances.looks_like
    return replace(
        found,
        verdict=verdict,
        sentence=f"{start} that remains is too small to matter: {left.words}.{like}",
        measure_next=tuple(measure_next(found.search, found.missing, verdict, found.where)),
    )


def _left_and_noise(found: Diagnosis, search: Search, problem: Problem) -> tuple[Rms, Rms]:
    """The rms errors of the model, and those of noise alone, by kind.

    Errors of commanded lengths move all readings of a row together, by much more than the noise of
    each. If lengths are noisy, whitened residuals are therefore used, in units of the readings' own
    noise.
    """
    if not problem.sigma.length_m:
        return found.after, found.floor
    shape = problem.measured.shape
    sigma = np.broadcast_to(problem.reading_sigma, shape)
    left = np.nan_to_num(search.last.fit.state.table) * sigma
    return rms_by_kind(problem, left), rms_by_kind(problem, sigma)
