"""The command ``diagnose``: data made ready, hypotheses searched, what follows put into words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.calibration import made_ready
from crosscheck.diagnosis.found import diagnosis_of
from crosscheck.diagnosis.result import HALF_THE_NOISE, Diagnosis, Tolerance
from crosscheck.fit.problem import Problem, Rms, kinds_stated, rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict, Refusal, Unfit
from crosscheck.fit.state import State
from crosscheck.fit.words import rms_words
from crosscheck.given import GivenModel, GivenNames, GivenRobot, considered
from crosscheck.inference.catalogue import Catalogue, candidates
from crosscheck.inference.fit import Data
from crosscheck.inference.held_out import blocks_note
from crosscheck.inference.priors import LIMITED, MOST_OF_IT, WIDTHS
from crosscheck.inference.search import Search
from crosscheck.inference.verdict import judged
from crosscheck.measurements.data import GivenSigma
from crosscheck.measurements.read import GivenData
from crosscheck.planning.result import Sight, sight_of
from crosscheck.preparation.prepare import Prepared, Progress, noise_floor
from seecr.arguments import silent
from seecr.effects import catalogue
from seecr.errors import InputError
from seecr.prediction.model import Model

# Number of hypotheses that a search usually fits, for the progress bar.
_USUAL = 40


def diagnose(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    only: GivenNames = (),
    exclude: GivenNames = (),
    tolerance: Tolerance | str = HALF_THE_NOISE,
    sigma: GivenSigma = None,
) -> Diagnosis:
    """Find the effects that a model misses.

    Args:
        robot: a robot, or its MJCF file.
        data: its measurements, or their file.
        model: effects that the model has already, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.
        only: the effects that may be missing, by their names or classes, or one; by default the
            whole catalogue. Effects of one's own are among them.
        exclude: effects that are not considered.
        tolerance: from which size on a remainder beyond noise counts as missing; also a text such
            as ``"0.1mm"``, whose unit tells the kind of reading.
        sigma: noise of the readings, in place of what the files state: metres, ``"0.1mm"`` or a
            :class:`crosscheck.Sigma`.

    Returns:
        the verdict, the missing effects, and what to measure next. It takes about 5 s for 144 rows
        on one core, and several times that if much is missing.

    Raises:
        InputFileError, RobotError: a file cannot be read, or is of another robot.
        InputError: there is no effect of a name, or ``tolerance`` is something else.
        CrosscheckError: ``only`` and ``exclude`` leave no effect to consider.

    Example:
        ``crosscheck.diagnose("robot.xml", "measured.csv").missing``
    """
    if isinstance(tolerance, str):
        tolerance = Tolerance.parsed([tolerance])
    if not isinstance(tolerance, Tolerance):
        raise InputError(f"tolerance: expected a crosscheck.Tolerance, got {tolerance!r}")
    # BLAS on several threads takes longer for matrices as narrow as these
    with threadpool_limits(limits=1, user_api="blas"):
        names = considered(only, exclude)
        ready, basis, said, on_others = made_ready(robot, data, model, names, sigma)
        notes = (*said, *ready.notes, *blocks_note(ready.problem))
        found = _diagnosed(ready, notes, progress, tolerance, basis)
        if found.path is None:
            return found
        if _may_be_noise(found, ready.problem):
            rows = Refusal(Unfit.STRUCTURE_OR_NOISE, int(ready.problem.use.sum()))
            none = no_verdict(ready.problem, found.path.first.state, found.notes, rows)
            return replace(none, sight=found.sight)
        others = on_others(found.path.last.fit.terms, ready.problem.sigma)
        return replace(found, notes=(*found.notes, *others))


def _diagnosed(
    ready: Prepared, notes: Sequence[str], progress: Progress, tolerance: Tolerance, basis: Model
) -> Diagnosis:
    problem, terms = ready.problem, ready.terms
    data = Data.of(problem, terms)
    stood = data.state(terms)
    refusal = ready.refusal or _nothing_to_try(problem)
    if refusal is None and not stood.valid:
        refusal = Refusal(Unfit.UNSOLVED_MODEL, problem.data.n_rows)
    if refusal is not None:
        return no_verdict(problem, stood, notes, refusal)
    sight = sight_of(problem, stood, data.factor)
    if _is_blind(problem, stood, sight):
        blind = Refusal(Unfit.BLIND, problem.data.n_rows, noise=rms_words(noise_floor(problem)))
        return replace(no_verdict(problem, stood, notes, blind), sight=sight)
    fits = 0

    def report(text: str) -> None:
        nonlocal fits
        fits += 1
        progress(f"trying {text}", 1.0 - 0.5 ** (2.0 * fits / _USUAL))

    search = Search(data, Catalogue.of(data, terms), report)
    search.run()
    said = judged(search)
    progress("predicting test runs", 0.95)
    return diagnosis_of(search, said, notes, sight, tolerance, basis)


def _may_be_noise(found: Diagnosis, problem: Problem) -> bool:
    """Whether the structure that was found may be autocorrelated noise whose size was not stated.

    With few rows no statistic separates the two, and effects of many parameters absorb a part of
    such noise. Effects that remove most of the error are no noise, nor is an error most of which
    all effects together foretell in runs that they have not seen.
    """
    if kinds_stated(problem) or problem.n_readings >= LIMITED:
        return False
    if found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING:
        return False
    together = None if found.chances is None else found.chances.together
    left = [found.after] if together is None else [found.after, together.held_out]
    return all(_most_is_left(found.before, now) for now in left)


def _most_is_left(before: Rms, now: Rms) -> bool:
    """Whether errors of every kind have not fallen much."""
    pairs = [(was, now[key]) for key, was in before.items()]
    return all(
        was < MOST_OF_IT * left for was, left in pairs if was is not None and left is not None
    )


def _nothing_to_try(problem: Problem) -> Refusal | None:
    """A refusal if the data lack what each considered effect needs; None otherwise."""
    effects = candidates(problem)
    if any(why is None for _layout, why in effects):
        return None
    asked = [(layout.name, why) for layout, why in effects if layout.name in problem.considered]
    lacking = "; ".join(f"{name} ({why.words})" for name, why in asked if why is not None)
    return Refusal(Unfit.NOTHING_TO_TRY, problem.data.n_rows, lacking=lacking)


def _is_blind(problem: Problem, stood: State, sight: Sight) -> bool:
    """Whether noise would hide every effect of the catalogue, and the residuals are no larger.

    This is only asked of the plain model: effects that a model has hide others whatever the noise.
    """
    if stood.terms or not problem.considered.issuperset(catalogue()):
        return False
    factors = [one.factor for one in sight.effects if np.isfinite(one.factor)]
    is_quiet = stood.chi2 <= problem.n_readings
    return is_quiet and len(factors) > 0 and min(factors) > WIDTHS[-1]


def no_verdict(problem: Problem, stood: State, notes: Sequence[str], refusal: Refusal) -> Diagnosis:
    """The diagnosis if nothing can be said, with the reason."""
    before = rms_by_kind(problem, stood.raw)
    nothing: Rms = dict.fromkeys(before)
    return Diagnosis(
        verdict=DiagnosisVerdict.NO_VERDICT,
        sentence=f"No verdict: {refusal}.",
        missing=(),
        before=before,
        after=nothing,
        held_out=nothing,
        floor=noise_floor(problem),
        measure_next=(refusal.remedy,),
        notes=tuple(notes),
        refusal=refusal,
    )
