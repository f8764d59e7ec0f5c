"""Posterior probabilities about the model that the steps ended with, by its linearisation.

Sets of effects one or a few moves away are compared in the model linearised about the final fit.
Which effects are equivalent is known from refits (:mod:`crosscheck.diagnosis.rivals`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from crosscheck.calibration.joint_fit.joining import at_null, layouts, promising_beside
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.judgement.probability import alike_beyond, of_classes, with_hints
from crosscheck.calibration.linear_evidence.priors import FLAT, widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.sets.catalogue import Catalogue, catalogue_columns, gram_with
from crosscheck.calibration.sets.challenge import excluding
from crosscheck.calibration.sets.equals import EQUAL, parameters_counted
from crosscheck.calibration.sets.linear_search import Names, Scores, explore
from crosscheck.calibration.sets.shapes import prices_about
from crosscheck.calibration.unknown.detectable import detectable_size
from crosscheck.calibration.unknown.imitated import Imitated, field_in_place
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.registration import NAME as TRACKER
from crosscheck.fit.least_squares.problem import Rms
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.reasons import Why
from seecr.effects import Term, Terms
from seecr.pose import Array

# Gauss-Newton steps that fit the final model with plausible sizes as priors.
_STEPS = 4
# Moves of a search for what could replace a member: as many effects may be needed for that.
_MOVES = 6


def chances_near(found: Search, alike: Mapping[str, Sequence[str]]) -> Chances:
    """Probabilities of every effect about the last model of a search.

    Args:
        found: a search that ended with noise.
        alike: for each effect that was found, those that cannot be told from it.
    """
    problem, fit = found.problem, found.last.fit
    setting = Setting(problem, found.factor, chain_of(problem), frozen=True)
    state = evaluate(problem, fit.terms, found.factor, fit.state)
    joint = settle(setting, state, widths_of(fit.terms, setting.free), WHITE, _STEPS)
    catalogue = _catalogue(setting, joint)
    always, names = frozenset(found.base), frozenset(fit.terms.names)
    effects = [n for n in catalogue.names if n not in always]
    columns, z = catalogue_columns(setting, joint, catalogue)
    gram = gram_with(setting, joint, catalogue, columns, z)
    prices = prices_about(setting, joint, catalogue)
    scores = Scores(gram, len(effects), always, prices=prices)
    explore(scores, [always, names])
    every = scores.every
    for name in sorted(names - always):
        every |= _better_without(scores, names, {name, *alike.get(name, ())})
    every |= _refitted(found, scores, names)
    none = _impossible(found)
    every = {some: score for some, score in every.items() if not some & none}
    shown = detectable_size(setting, joint, *_all_of(columns, len(joint.state.white)))
    sizes = {name: parameters_counted(catalogue.start(name).layout) for name in effects}
    hints = alike_beyond(scores, names, sizes)
    in_place = field_in_place(setting, joint, scores.widths(names), scores)
    return _with_equals(every, effects, alike, hints, shown, in_place)


def _better_without(scores: Scores, names: Names, barred: Iterable[str]) -> dict[Names, float]:
    """Scores of sets that do without a member and its equivalents, if one is clearly better.

    Two effects may do together what one does, such as a heavier platform off its centre for a force
    and moment; no exchange of a single effect leads there. The linear model is about the members,
    though: what is hardly better in it says little.
    """
    others = excluding(scores, frozenset(barred))
    best = explore(others, [names - frozenset(barred)], _MOVES)
    return others.every if others.score(best) > scores.score(names) + EQUAL else {}


def _impossible(found: Search) -> Names:
    """Effects that would need impossible values in every model that they were fitted in."""
    tried: dict[str, list[bool]] = {}
    for one in (c for step in found.steps for c in step.candidates):
        no = one.why_not is not None and one.why_not.why is Why.IMPOSSIBLE
        tried.setdefault(one.layout.name, []).append(no)
    return frozenset(name for name, no in tried.items() if all(no)) - set(
        found.last.fit.terms.names
    )


def _refitted(found: Search, scores: Scores, last: Names) -> dict[Names, float]:
    """Scores of the sets that the search fitted, relative to that of its last model.

    The linear model about one set says little of a set in which another effect replaces a member.
    """
    base = scores.score(last) - found.last.evidence.log - scores.log_prior(last)
    out: dict[Names, float] = {}
    for (names, name), fit in found.fits.items():
        every = names | {name}
        if fit.valid and every != last:
            score = base + found.trials.evidence(fit).log + scores.log_prior(every)
            out[every] = max(score, out.get(every, -np.inf))
    return out


def _all_of(columns: Mapping[str, Array], count: int) -> tuple[Array, Array]:
    """Columns (N, p) of all effects and their prior widths (p,), which are flat for the tracker.

    N is ``count``.
    """
    width = {name: FLAT if name == TRACKER else 1.0 for name in columns}
    return (
        np.concatenate([np.zeros((count, 0)), *columns.values()], axis=1),
        np.concatenate(
            [np.zeros(0), *(np.full(x.shape[1], width[name]) for name, x in columns.items())]
        ),
    )


def _catalogue(setting: Setting, joint: JointFit) -> Catalogue:
    at_once, later = layouts(setting.problem)
    inside = joint.terms
    own = {a.name for a in later}
    nulls = (Term(a, a.null) for a in at_once if a.name not in inside)
    absent = [a for a in later if a.name not in inside]
    promising = promising_beside(setting, joint, absent)
    there = [at_null(t) for t in inside if t.name in own]
    return Catalogue(
        Terms([*nulls, *(t for t in inside if t.name not in own)]),
        Terms([*there, *(one.term for one in promising)]),
        {one.term.name: one.price for one in promising},
    )


def _with_equals(
    scores: Mapping[Names, float],
    effects: Sequence[str],
    alike: Mapping[str, Sequence[str]],
    hints: Sequence[tuple[str, ...]],
    shown: Rms | None,
    in_place: Imitated,
) -> Chances:
    """Probabilities with the classes that refits found: members share that of their class."""
    classes = [(name, *others) for name, others in alike.items()]
    known = {member for members in classes for member in members}
    alone = [(name,) for name in effects if name not in known]
    beyond = with_hints(alone, hints)
    found = of_classes(scores, frozenset(alike), effects, [*classes, *beyond])
    found = found.without(in_place.replaced, in_place.chance)
    pairs = dict(zip(found.members, found.probability, strict=True))
    effect = dict(found.effect)
    for members in classes:
        effect.update({m: pairs[members] / len(members) for m in members if m in effect})
    return Chances(
        effect,
        tuple(pairs.items()),
        None,
        None,
        shown,
        imitated=in_place if in_place.chance else None,
        doubt=in_place if in_place.is_doubt else None,
    )
