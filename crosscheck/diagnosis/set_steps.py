"""Turns compared sets into steps: effects one by one, each model with its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.calibration.joint_fit.all_effects import covariance
from crosscheck.calibration.joint_fit.joining import amplitudes
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.leave_out import leave_out
from crosscheck.calibration.joint_fit.linearised import free_of, linearised
from crosscheck.calibration.linear_evidence.gram import Gram
from crosscheck.calibration.search import SetSearch
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.diagnosis.order import Step
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.candidates import Candidate, Trials, candidates_for
from crosscheck.fit.effects.evidence import Evidence, p_value
from crosscheck.fit.effects.gauss_newton import Fit, FitStatus
from crosscheck.fit.noise.whiteness import whiteness
from crosscheck.fit.reasons import Reason, Why
from seecr.effects import Term
from seecr.pose import Array

# A parameter is not identifiable if its standard error exceeds this part of its prior width.
_UNSEEN = 0.98


def steps_of_set(sought: SetSearch, names: Names) -> Search:
    """Steps to a set of effects, each adding the effect that explains most.

    Args:
        sought: the compared sets.
        names: the effects to add to the model as it stands.
    """
    found, setting = sought.found, sought.calibration.setting
    problem, factor = setting.problem, setting.factor
    here, model = found.always, found.none
    steps = [_step(setting, "", model)]
    steps[0] = replace(steps[0], candidates=tuple(_tried(sought)))
    todo = set(names - here)
    while todo:
        added = max(sorted(todo), key=lambda n: _score(found, here | {n}))
        fitted = found.refit(here | {added})
        if fitted is None:
            break
        here, todo = here | {added}, todo - {added}
        steps.append(_step(setting, added, fitted))
    return Search(Trials(problem, factor), tuple(steps), {})


def _score(found: ComparedSets, names: Names) -> float:
    return found.refits[names].score if names in found.refits else found.scores.score(names)


def fit_of(setting: Setting, joint: JointFit) -> Fit:
    """A joint fit in the form that pages and recordings show; inf where unidentifiable."""
    known = covariance(setting, joint)
    error, scale = np.sqrt(np.diag(known)), joint.terms.scale
    unseen = error > _UNSEEN * joint.width * scale
    known[unseen, unseen] = np.inf
    return Fit(
        joint.state, lambda: joint.jacobian, lambda _jacobian: known, ~free_of(joint),
        FitStatus.SOLVED, 0, joint.settled,
    )  # fmt: skip


def _step(setting: Setting, added: str, model: Refit) -> Step:
    joint, problem = model.joint, setting.problem
    fit = fit_of(setting, joint)
    left = joint.whitened(setting.chain, joint.state.white)
    seen = directions(setting, joint)
    evidence = Evidence(model.score, joint.state.chi2, seen)
    held = leave_out(setting, joint)
    return Step(fit, evidence, whiteness(problem, left, seen), added=added, held_out=held)


def directions(setting: Setting, joint: JointFit) -> int:
    """How many directions of the parameters are determined by the data rather than the prior."""
    linear = linearised(setting, joint)
    x = linear.x * linear.width
    power = np.linalg.eigvalsh(x.T @ x) if x.shape[1] else np.zeros(0)
    return int(np.sum(power > 1.0))


def _tried(sought: SetSearch) -> list[Candidate]:
    """Every effect tried beside the model as it stands: its fit if there is one, or linearly."""
    found, setting = sought.found, sought.calibration.setting
    out = []
    for c in candidates_for(setting.problem):
        if c.name in found.always:
            continue
        if c.why_not is not None:
            out.append(c)
        elif c.name not in found.scores.gram.groups:
            out.append(c.refused(Reason(Why.UNSEEN)))
        else:
            out.append(_candidate(sought, c))
    return out


def _candidate(sought: SetSearch, c: Candidate) -> Candidate:
    found, setting = sought.found, sought.calibration.setting
    names = found.always | {c.name}
    if names in found.refits:
        score = found.refits[names].score - found.none.score
    else:
        score = found.scores.score(names) - found.scores.score(found.always)
    score -= found.scores.log_prior(names) - found.scores.log_prior(found.always)
    drop, seen = _drop(found.scores.gram, c.name)
    p = p_value(drop, seen, bool(found.scores.gram.groups[c.name].one_sided.all()))
    refit = found.refits.get(names)
    base = sought.found.none
    if refit is None:
        c = replace(c, alone=_needed(sought, c.name))
        evidence = Evidence(base.score + score, base.joint.state.chi2, seen)
        return replace(c, evidence=evidence, drop=drop, p=p)
    fit = fit_of(setting, refit.joint)
    return replace(
        c, fit=fit, evidence=Evidence(base.score + score, fit.chi2, seen), drop=drop, p=p
    )


def _needed(sought: SetSearch, name: str) -> Term:
    """The values that an effect would need by itself, in the linear model."""
    term, group = sought.catalogue.start(name), sought.found.scores.gram.groups[name]
    solved = sought.found.scores.gram.solved({name: float(group.widths[-1])})
    own = np.flatnonzero(amplitudes(term))[: len(group.columns)]
    values = term.vector.copy()
    values[own] = term.layout.null[own] + solved.values * term.layout.scale[own]
    return term.with_vector(np.clip(values, term.layout.lower, term.layout.upper))


def _drop(gram: Gram, name: str) -> tuple[float, int]:
    """Fall of chi2 with an effect alone in the linear model, and how many directions are seen."""
    own = gram.groups[name].columns
    power, axes = np.linalg.eigh(gram.normal[np.ix_(own, own)])
    seen = power > 1e-2
    along: Array = (axes.T @ gram.gradient[own])[seen] ** 2 / power[seen]
    return float(along.sum()), max(1, int(seen.sum()))
