"""Puts what a search found into a diagnosis: what is listed, what is not and why, what is left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from crosscheck.add.weigh import MATTERS, spread_by_others
from crosscheck.calibration import JointErrors
from crosscheck.comparison.associations import Association, associations
from crosscheck.comparison.quantities import travel
from crosscheck.diagnosis.advice import check_of, measure_next
from crosscheck.diagnosis.path import ModelPath, path_to
from crosscheck.diagnosis.result import (
    PROBABLE,
    Chances,
    Diagnosis,
    LeftOver,
    MissingEffect,
    NotListed,
    Tolerance,
    doubt_of,
    remainder_of,
)
from crosscheck.diagnosis.words import noise_notes, sentence_of, size_notes
from crosscheck.fit.problem import KINDS, Problem, Rms, rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from crosscheck.fit.residual_noise import overestimated, whiteness
from crosscheck.fit.state import can_be, contradictions, largest_size
from crosscheck.inference.about import About
from crosscheck.inference.catalogue import name_of
from crosscheck.inference.fields import detectable_size
from crosscheck.inference.fit import Fit, fit
from crosscheck.inference.hypothesis import Hypothesis, scored
from crosscheck.inference.priors import EQUAL, WIDTHS
from crosscheck.inference.search import Search
from crosscheck.inference.verdict import Judgement
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import provenance_of, renewed, with_fit
from crosscheck.planning.result import Sight
from crosscheck.preparation.prepare import noise_floor
from seecr.description.robot import Robot
from seecr.effects import Knowledge, Term, effect_named
from seecr.pose import Array
from seecr.prediction.model import Model
from seecr.units import parameter_name, shown

# Most quantities that the unexplained part is said to be associated with, and fields named.
_MOST_WHERE, _MOST_FIELDS = 5, 3


def diagnosis_of(
    search: Search, said: Judgement, notes: Sequence[str], sight: Sight, tolerance: Tolerance,
    basis: Model,
) -> Diagnosis:  # fmt: skip
    """The diagnosis that follows from a judgement of a search."""
    problem = search.data.problem
    far = search.best.fit.outlying
    alone = said.verdict is DiagnosisVerdict.EFFECTS_FOUND
    path = path_to(search, said.sure, alone)
    chances, floor = _chances(search, said), _floor(search, said)
    missing = _missing(search, said, path, sight)
    unknown = said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    last = path.last
    white = whiteness(problem, last.state.white, int(last.fit.seen.sum()))
    where: tuple[Association, ...] = ()
    if unknown:
        way = travel(problem, last.state.prediction)
        where = tuple(associations(problem, last.state, last.fit.white, way)[:_MOST_WHERE])
    left = _left(path, search.best, floor, tolerance, white.lag)
    verdict = said.verdict
    if unknown and not left.important and not left.undecided:
        some, none = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING
        verdict = some if missing else none
    large = [search.best.fit.terms[name_of(k)] for k in said.implausible]
    doubts = _contradicted(search, missing, verdict)
    more = (
        *contradictions(t for t in last.fit.terms if t.name not in doubts),
        *doubts.values(),
        *notes,
        *([] if unknown else noise_notes(search.best.fit, far)),
        *size_notes(large),
        *overestimated(problem, last.rms),
    )
    out = Diagnosis(
        verdict=verdict,
        sentence=sentence_of(
            said, missing, path, chances, left if verdict is not said.verdict else None
        ),
        missing=tuple(missing),
        before=path.first.rms,
        after=last.rms,
        held_out=last.held_out.rms,
        floor=floor,
        candidates=tuple(_not_listed(search, said, missing)),
        measure_next=tuple(
            measure_next(path, missing, verdict, where, chances.seen if unknown else ())
        ),
        notes=tuple(dict.fromkeys(more)),
        path=path,
        whiteness=white,
        where=where,
        left=left,
        chances=chances,
        sight=replace(sight, found=tuple(effect.effect for effect in missing)),
    )
    return replace(
        out, model=with_found(out, basis), refitted=refitted_names(out, basis),
    )  # fmt: skip


def _contradicted(
    search: Search, missing: Sequence[MissingEffect], verdict: DiagnosisVerdict
) -> dict[str, str]:
    """Notes, by effect of the model, where known values explain less than others would."""
    out = dict[str, str]()
    if verdict is DiagnosisVerdict.NO_EFFECT_MISSING:
        return out
    what = " + ".join(effect.effect for effect in missing) or "what was tried"
    for term in search.every.stood:
        new = _freely_fitted(search, term) if term.knowledge.any else None
        if new is not None:
            held = term.knowledge.fixed | term.knowledge.measured
            rows = zip(new.layout.names, new.layout.units, new.vector, held, strict=True)
            free = ", ".join(
                f"{parameter_name(n, unit)} = {shown(v, unit)}" for n, unit, v, own in rows if own
            )
            out[term.name] = (
                f"what the model takes for known of {term.name} contradicts these data: fitted to "
                f"them it would be {free}, which explains far more than {what}. Check it first"
            )
    return out


def _freely_fitted(search: Search, term: Term) -> Term | None:
    """A known effect of the model as it would be fitted if nothing were known of it.

    None unless that explains far more than the best hypothesis: then it contradicts the data.
    """
    free = replace(term, knowledge=Knowledge.nothing(len(term.layout)))
    terms = search.every.stood.with_term(free)
    every = replace(search.every, stood=terms)
    state = search.data.state(terms, search.plain)
    if not state.valid:
        return None
    found = scored(every, search.stood, fit(search.data, state), {})
    own, known = term.knowledge.measured, term.knowledge
    # the density that independent readings have by themselves, which evidence leaves out
    readings = float(np.sum(np.log(term.layout.scale[own] / known.stderr[own])))
    possible = can_be(search.data.problem.robot, found.fit.terms, search.every.stood)
    better = found.score > search.best.score + readings + EQUAL
    return found.fit.terms[term.name] if possible and better else None


# --- what is listed -------------------------------------------------------------------------------


def _missing(search: Search, said: Judgement, path: ModelPath, sight: Sight) -> list[MissingEffect]:
    """The listed effects in the order of adding.

    Their values are those of the listed effects alone where these are all that is missing, else
    those of the best hypothesis, which are nearer to the truth.
    """
    alone = said.verdict is DiagnosisVerdict.EFFECTS_FOUND
    fit = path.last.fit if alone else search.best.fit
    spread = _spread_by_others(search, said, fit)
    keys = search.every.keys_of(fit.terms)
    out = []
    for index, stage in enumerate(path.stages[1:], start=1):
        name = stage.added
        if name not in fit.terms or keys[name] not in said.sure:
            continue
        term, part = fit.terms[name], fit.terms.part(name)
        stderr = np.hypot(fit.stderr[part], spread[part])
        likely = map(name_of, said.classes.alike(keys[name]))
        alike = dict.fromkeys([*likely, *_twins(sight, term, search.data.problem.robot)])
        rivals = [
            search.every.members[other].layout for other in alike
            if other != name and other not in fit.terms and other in search.every.members
        ]  # fmt: skip
        out.append(
            MissingEffect(
                term=term,
                stderr=stderr,
                at_bound=fit.at_bound[part],
                rivals=tuple(rivals),
                check=check_of(term, search.data.problem.robot, stderr),
                rms=stage.rms,
                held_out_rms=stage.held_out.rms,
                share=path.removed_by(index),
                probability=min(said.classes.of(keys[name]), 1.0),
            )
        )
    return out


def _twins(sight: Sight, term: Term, robot: Robot) -> Iterator[str]:
    """Effects that do exactly the same to all readings as one that is larger than the widest prior.

    They take more numbers, which have to go together. That makes them improbable where errors are
    those of tolerances. What is larger no tolerance did, and then only the data could tell: masts
    that were all raised alike are a tracker that stands lower.
    """
    seen = {one.name: one for one in sight.effects}
    if term.name not in seen or largest_size(term) <= WIDTHS[-1]:
        return
    own = seen[term.name].signal.columns
    parts = term.sizes.reshape(-1, own.shape[1])  # of each file or run, or of all
    for other in seen[term.name].twins:
        signal = seen[other].signal
        alike = np.linalg.lstsq(signal.columns, own @ parts.T)[0].T * signal.layout.scale
        terms = [Term(signal.layout, signal.layout.null + values) for values in alike]
        if all(one.is_possible(robot) for one in terms):
            yield other


def _spread_by_others(search: Search, said: Judgement, fit: Fit) -> Array:
    """How far values (p,) are, rms, from those of models with a further effect."""
    had = set(search.every.keys_of(fit.terms).values())
    likely = {members[0]: p for members, p in said.classes.classes if not had & set(members)}
    if max(likely.values(), default=0.0) <= MATTERS:
        return np.zeros(len(fit.terms))
    return np.sqrt(np.diag(spread_by_others(About(search.every, fit), likely)))


# --- what is not listed ---------------------------------------------------------------------------


def _not_listed(
    search: Search, said: Judgement, missing: Sequence[MissingEffect]
) -> list[NotListed]:
    """All effects that are not listed, the most probable first."""
    listed = {one.effect: one for one in missing}
    alike = {name: one.effect for one in missing for name in one.indistinguishable}
    chances, rows = _by_effect(search, said), list[NotListed]()
    layouts = {m.layout.name: m.layout for k, m in search.every.members.items() if "@" not in k}
    for name, layout in layouts.items():
        if name in listed or name in search.every.stood:
            continue
        alone = search.cache.get(search.stood | {name})
        score = 0.0 if alone is None else alone.score - search.none.score
        why = _why_not(search, said, name, chances.get(name, 0.0), alike, tuple(listed))
        rows.append(NotListed(name, layout.effect.title, score, why))
    for name, why in search.every.reasons.items():
        rows.append(NotListed(name, effect_named(name).title, 0.0, why))
    return sorted(rows, key=lambda row: (-chances.get(row.effect, 0.0), -row.score))


def _why_not(
    search: Search, said: Judgement, name: str, p: float, alike: dict[str, str],
    listed: tuple[str, ...],
) -> Reason:  # fmt: skip
    if name in alike:
        return Reason(Why.ALIKE, by=(alike[name],))
    if name not in search.none_about.columns:
        return Reason(Why.UNSEEN)
    if said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and p > PROBABLE:
        return Reason(Why.MAY_IMITATE)
    if said.verdict is DiagnosisVerdict.MANY_EFFECTS and p > PROBABLE:
        return Reason(Why.NOT_SURE, p=p)
    if listed and said.verdict is not DiagnosisVerdict.MANY_EFFECTS:
        return Reason(Why.CARRIES_LITTLE if p > PROBABLE else Why.NOT_NEEDED_BESIDE, p=p, by=listed)
    return Reason(Why.NOT_SURE if p > PROBABLE else Why.IMPROBABLE, p=p)


def _by_effect(search: Search, said: Judgement) -> dict[str, float]:
    """Probability of each effect, in any form."""
    out = dict.fromkeys(search.every.effects, 0.0)
    for key, p in said.classes.member.items():
        if name_of(key) in out:
            out[name_of(key)] = min(out[name_of(key)] + p, 1.0)
    return out


def _chances(search: Search, said: Judgement) -> Chances:
    """The probabilities, by names of effects."""
    classes = list[tuple[tuple[str, ...], float]]()
    seen = set[str]()
    for members, p in said.classes.classes:
        names = tuple(n for n in dict.fromkeys(map(name_of, members)) if n not in seen)
        names = tuple(n for n in names if n in search.every.effects)
        seen |= set(names)
        if names:
            classes.append((names, p))
    posterior = said.posterior
    unknown = said.verdict in (DiagnosisVerdict.UNKNOWN_EFFECT, DiagnosisVerdict.MANY_EFFECTS)
    kinds = [search.every.kinds[k] for k, p in posterior.fields.items() if p > MATTERS / 2.0]
    is_seen = unknown and posterior.unknown > PROBABLE
    seen_in = tuple(dict.fromkeys(kinds))[:_MOST_FIELDS] if is_seen else ()
    together = None
    if said.verdict is DiagnosisVerdict.MANY_EFFECTS:
        before = rms_by_kind(search.data.problem, search.plain.raw)
        together = JointErrors.of(before, search.calibrated.fit)
    shown = None if seen_in else detectable_size(search.best.fit)
    return Chances(
        _by_effect(search, said), tuple(classes), posterior.unknown, seen_in, shown, together
    )


# --- what is left ---------------------------------------------------------------------------------


def _floor(search: Search, said: Judgement) -> Rms:
    """The rms errors of the noise at its estimated size.

    Beside something unknown it is no larger than stated: the estimate may take a part of what is
    unknown for noise, which would then never be large enough to matter.
    """
    floor = noise_floor(search.data.problem, search.best.fit.state)
    scale = search.best.fit.noise.scale
    if said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT:
        scale = np.minimum(scale, 1.0)
    return {
        kind.key: None if floor[kind.key] is None else float(scale[k]) * (floor[kind.key] or 0.0)
        for k, kind in enumerate(KINDS)
    }


def _left(
    path: ModelPath, best: Hypothesis, floor: Rms, tolerance: Tolerance, lag: float
) -> LeftOver:
    """How far the last model's errors exceed the noise, and whether that matters.

    Errors of commanded lengths move all readings of a row together, by much more than the noise of
    each. If lengths are noisy, whitened residuals are therefore used, in units of the readings' own
    noise.
    """
    problem: Problem = path.problem
    rms, noise = path.last.rms, floor
    if problem.sigma.length_m:
        sigma = np.broadcast_to(problem.reading_sigma, problem.measured.shape)
        rms = rms_by_kind(problem, np.nan_to_num(path.last.state.table) * sigma)
        noise = rms_by_kind(problem, sigma.copy())
    rho = max(lag, float(np.max(best.fit.noise.rho)), 0.0)
    return remainder_of(rms, noise, tolerance, problem.data.sigma, doubt_of(problem, rho))


# --- the model with what was found ----------------------------------------------------------------


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

    Where more is missing than is listed, these make a model by themselves. The listed values, which
    are nearer to the truth, do not.
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
    at = np.flatnonzero(seen)
    whole[at, at] = np.maximum(whole[at, at], listed[at])
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
