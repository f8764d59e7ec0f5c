"""The command ``diagnose``: steps first and, if these do not end with noise, sets of effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.calibration.joint_fit.beginning import Beginning
from crosscheck.calibration.judgement.verdict import SURE, too_large
from crosscheck.calibration.search import search_sets
from crosscheck.diagnosis.chances import PROBABLE
from crosscheck.diagnosis.contradicted import contradicted_values
from crosscheck.diagnosis.explained import explained
from crosscheck.diagnosis.importance import weighed
from crosscheck.diagnosis.kept import Diagnosed
from crosscheck.diagnosis.pairs import pairs_instead
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.settled import settled
from crosscheck.diagnosis.steps import shown_stages
from crosscheck.diagnosis.stepwise import by_steps
from crosscheck.diagnosis.unexplained import beside_imitated, unexplained
from crosscheck.diagnosis.words import size_notes
from crosscheck.fit.effects.candidates import candidates_for, null_fit
from crosscheck.fit.effects.contradictions import contradictions
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.possible import hardly_happens
from crosscheck.fit.least_squares.problem import Problem, Rms, kinds_read, kinds_stated, rms_by_kind
from crosscheck.fit.noise.tolerance import HALF_THE_NOISE, Tolerance
from crosscheck.fit.preparation.prepare import Prepared, Progress, noise_floor, prepare
from crosscheck.fit.preparation.thinned import thinned
from crosscheck.fit.reasons import DiagnosisVerdict, Refusal, Unfit, Why
from crosscheck.fit.words import rms_words
from crosscheck.given import GivenModel, GivenRobot, considered, model_of, opened, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.planning.sight import Sight, sight_of
from seecr.arguments import silent
from seecr.effects import catalogue
from seecr.errors import InputError
from seecr.pose import Array

# In fewer readings than this (60 whole poses), noise of unknown size that is correlated looks like
# structure, unless the error falls by this factor.
_FEW_READINGS, _MOST_OF_IT = 360, 3.0
# Data that would not even show effects of so many plausible sizes show nothing.
_BLIND = 10.0
# Statements from this probability on were nearly all true, see docs/diagnosis.md on how often
# probabilities are right; those between SURE and it not quite.
_VERY_SURE = 0.97


def diagnose(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    only: Iterable[str] = (),
    exclude: Iterable[str] = (),
    tolerance: Tolerance = HALF_THE_NOISE,
) -> Diagnosis:
    """Find the effects that a model misses.

    Args:
        robot: a robot, or its MJCF file.
        data: its measurements, or their file.
        model: effects that the model has already, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.
        only: names of the effects that may be missing, or one; by default the whole catalogue.
        exclude: names of effects that are not considered.
        tolerance: from which size on a remainder beyond noise counts as missing.

    Raises:
        InputFileError, RobotError: a file cannot be read, or is of another robot.
        InputError: there is no effect of a name, or ``tolerance`` is something else.
        CrosscheckError: ``only`` and ``exclude`` leave no effect to consider.
    """
    if not isinstance(tolerance, Tolerance):
        raise InputError(f"tolerance: expected a crosscheck.Tolerance, got {tolerance!r}")
    robot = robot_of(robot)
    measured = measurements_of(data, robot)
    thin = thinned(robot, measured)
    model = opened(model, robot)
    terms, said = model_of(model, robot)
    of = Diagnosed.of(robot, measured, model, terms)
    # BLAS on several threads takes longer for matrices as narrow as these, and takes the
    # processors from the compiled loop
    with threadpool_limits(limits=1, user_api="blas"):
        ready = prepare(robot, thin.data, terms, considered(only, exclude))
        found = weighed(_diagnosed(ready, said, progress), ready.problem, tolerance)
        found = replace(found, of=of)
        if found.search is None:
            return found
        if _may_be_noise(found, ready.problem):
            rows = Refusal(Unfit.STRUCTURE_OR_NOISE, int(ready.problem.use.sum()))
            base = found.search.steps[0].fit
            without = no_verdict(ready.problem, base, found.notes, rows)
            return replace(without, sight=found.sight, of=of)
        others = thin.note_on_others(found.search.last.fit.terms, found.search.problem.sigma)
        doubts = contradicted_values(found)
        shown = shown_stages(found)[1].step.fit.terms
        against = contradictions(term for term in shown if term.name not in doubts)
        return replace(found, notes=(*against, *doubts.values(), *found.notes, *others))


def _may_be_noise(found: Diagnosis, problem: Problem) -> bool:
    """Whether the structure that was found may be autocorrelated noise whose size was not stated.

    With few rows no statistic separates the two, and effects of many parameters absorb a part of
    such noise. Effects that remove most of the error are no noise, nor is an error most of which
    all effects together foretell in runs that they have not seen.
    """
    if kinds_stated(problem) or problem.n_readings >= _FEW_READINGS:
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
        was < _MOST_OF_IT * left for was, left in pairs if was is not None and left is not None
    )


Notes = tuple[str, ...]


def _diagnosed(ready: Prepared, said: Notes, progress: Progress) -> Diagnosis:
    problem, terms = ready.problem, ready.terms
    factor = problem.noise(problem.experiment.predict(terms.effects))
    base = null_fit(problem, terms, factor, refit=False)
    refusal = ready.refusal
    refusal = refusal or _nothing_to_try(problem)
    if refusal is None and not base.valid:
        refusal = Refusal(Unfit.UNSOLVED_MODEL, problem.data.n_rows)
    notes = (*said, *ready.all_notes)
    if refusal is not None:
        return no_verdict(problem, base, notes, refusal)
    sight = sight_of(problem, base, factor)
    if _is_blind(problem, base, sight):
        blind = Refusal(Unfit.BLIND, problem.data.n_rows, noise=rms_words(noise_floor(problem)))
        return replace(no_verdict(problem, base, notes, blind), sight=sight)
    found = _searched(ready, base, factor, notes, progress)
    return replace(found, sight=sight)


def _nothing_to_try(problem: Problem) -> Refusal | None:
    """A refusal if the data lack what each considered effect needs; None otherwise."""
    effects = candidates_for(problem)
    if any(one.why_not is None for one in effects):
        return None
    asked = [(one.name, one.why_not) for one in effects if one.name in problem.considered]
    lacking = "; ".join(f"{name} ({why.words})" for name, why in asked if why is not None)
    return Refusal(Unfit.NOTHING_TO_TRY, problem.data.n_rows, lacking=lacking)


def _is_blind(problem: Problem, base: Fit, sight: Sight) -> bool:
    """Whether noise would hide every effect of the catalogue, and the residuals are no larger.

    This is only asked of the plain model: effects that a model has hide others whatever the noise.
    """
    if base.terms or not problem.considered.issuperset(catalogue()):
        return False
    factors = [one.factor for one in sight.effects if np.isfinite(one.factor)]
    is_quiet = base.chi2 <= problem.n_readings
    return is_quiet and len(factors) > 0 and min(factors) > _BLIND


def _searched(
    ready: Prepared, base: Fit, factor: Array, notes: Notes, progress: Progress
) -> Diagnosis:
    """The diagnosis of data that are fit for one."""
    with Beginning(ready.problem, ready.terms) as beginning:
        return _by_steps_or_sets(ready, base, factor, notes, progress, beginning)


def _by_steps_or_sets(
    ready: Prepared, base: Fit, factor: Array, notes: Notes, progress: Progress,
    beginning: Beginning,
) -> Diagnosis:  # fmt: skip
    problem = ready.problem
    found, more = by_steps(problem, base, factor, _part(progress, 0.0, 0.5))
    pairs = pairs_instead(found)
    if not pairs and found.last.whiteness.is_noise and kinds_stated(problem) == kinds_read(problem):
        steps = settled(found, (*notes, *more), lambda text: progress(text, 0.5))
        if is_clear(steps):
            large = [e.term for e in steps.missing if hardly_happens(e.term)]
            return replace(steps, notes=(*steps.notes, *size_notes(large)))
    # The steps do not end with stated noise, or leave something open: an effect is not sure, two
    # others explain as much, or the noise is autocorrelated, larger than stated (perhaps by a few
    # outliers), or estimated from what may be an effect. So all effects are fitted at once, and
    # sets of them compared.
    given = [*pairs, *(step.fit.terms for step in found.steps[1:])]
    share = _part(progress, 0.5, 1.0)
    sought = search_sets(problem, problem.data.sigma, ready.terms, share, given, beginning)
    said = sought.judgement
    if said.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or said.imitated is not None:
        return explained(beside_imitated(found, sought), notes)
    by_step = unexplained(found, sought, (*notes, *more))
    # the steps take effects first that imitate what is unknown together with what is known
    return explained(sought, notes) if said.sure and not by_step.missing else by_step


def is_clear(steps: Diagnosis) -> bool:
    """Whether the steps settle it: their effects are sure, few enough and imitate nothing unknown.

    Nor may another effect be probable: what the steps took first may stand for others. Of several
    that hint at the same none may be worth its parameters; where all that is listed is very sure,
    they count if it is sure that one of them is there.
    And the data have to determine something of each effect: beside misplaced points of all cables,
    a platform off its start is only a part of these.
    """
    if any(is_undetermined(effect) for effect in steps.missing):
        return False
    if too_large(len(one.layout) for one in steps.missing):
        return False
    if steps.chances is not None and steps.chances.imitated is not None:
        return False
    listed = {effect.effect for effect in steps.missing}
    classes = () if steps.chances is None else steps.chances.classes
    sure = all(effect.probability > _VERY_SURE for effect in steps.missing)
    further = any(
        p > (SURE if sure and len(members) > 1 else PROBABLE) and listed.isdisjoint(members)
        for members, p in classes
    )
    unsure = any(c.why_not is not None and c.why_not.why is Why.NOT_SURE for c in steps.candidates)
    return all(e.probability > SURE for e in steps.missing) and not unsure and not further


def is_undetermined(effect: MissingEffect) -> bool:
    """Whether the data determine none of an effect's values."""
    return not np.any(np.isfinite(effect.stderr[~effect.layout.shape]))


def _part(progress: Progress, first: float, last: float) -> Progress:
    """Progress of one part of the whole."""
    return lambda text, part: progress(text, first + (last - first) * min(part, 1.0))


def no_verdict(problem: Problem, base: Fit, notes: Sequence[str], refusal: Refusal) -> Diagnosis:
    """The diagnosis if nothing can be said, with the reason."""
    before = rms_by_kind(problem, base.state.raw)
    nothing = dict.fromkeys(before)
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
