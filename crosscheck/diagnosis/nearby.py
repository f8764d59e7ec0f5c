"""Probabilities about a model that the steps ended with, by linear algebra and its rivals.

Sets of effects one or a few moves away are compared in the linear model about the final fit;
which effects are equals is known from refits (:mod:`crosscheck.diagnosis.rivals`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from crosscheck.calibration.catalogue import Catalogue, gram_about
from crosscheck.calibration.colour import WHITE, chain_of
from crosscheck.calibration.joint import JointFit, Setting, settle
from crosscheck.calibration.later import at_null, layouts, promising_beside
from crosscheck.calibration.priors import widths_of
from crosscheck.calibration.probability import Classes, probabilities
from crosscheck.calibration.sets import Scores, explore
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.search import Search
from crosscheck.fit.state import evaluate
from seecr.effects import Term, Terms

# Steps to settle the final model with plausible sizes as priors.
_STEPS = 4


def chances_near(found: Search, alike: Mapping[str, Sequence[str]]) -> Chances:
    """Probabilities of every effect about the last model of a search.

    Args:
        found: a search that ended with noise.
        alike: of each effect that was found, those that cannot be told from it.
    """
    problem, fit = found.problem, found.last.fit
    colour = replace(WHITE, scale=WHITE.scale * found.noise_scale)
    setting = Setting(problem, found.factor, chain_of(problem), frozen=True)
    state = evaluate(problem, fit.terms, found.factor, fit.state)
    joint = settle(setting, state, widths_of(fit.terms), colour, _STEPS)
    catalogue = _catalogue(setting, joint)
    always, names = frozenset(found.base), frozenset(fit.terms.names)
    effects = [n for n in catalogue.names if n not in always]
    scores = Scores(gram_about(setting, joint, catalogue), len(effects), always)
    explore(scores, [always, names])
    every = scores.near | {n: s for n, (s, _w) in scores.solved.items()}
    return _with_equals(probabilities(every, names, effects), alike)


def _catalogue(setting: Setting, joint: JointFit) -> Catalogue:
    at_once, later = layouts(setting.problem)
    inside = joint.terms
    own = {a.name for a in later}
    nulls = (Term(a, a.null) for a in at_once if a.name not in inside)
    absent = [a for a in later if a.name not in inside]
    promising = [term for term, _gain in promising_beside(setting, joint, absent)]
    there = [at_null(t) for t in inside if t.name in own]
    return Catalogue(
        Terms([*nulls, *(t for t in inside if t.name not in own)]), Terms([*there, *promising])
    )


def _with_equals(classes: Classes, alike: Mapping[str, Sequence[str]]) -> Chances:
    """The classes as refits know them: equals share the probability that one of them is missing."""
    effect = dict(classes.effect)
    out = []
    for name, others in alike.items():
        members = (name, *others)
        probability = min(1.0, sum(effect.get(m, 0.0) for m in members))
        out.append((members, probability))
        effect.update({m: probability / len(members) for m in members if m in effect})
    known = {m for members, _p in out for m in members}
    out += [((name,), p) for name, p in effect.items() if name not in known]
    return Chances(effect, tuple(sorted(out, key=lambda c: -c[1])), None, None)
