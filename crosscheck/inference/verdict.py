"""One of five words, and the names of effects, from the posterior of a search.

The word is

1. P(unknown) >= SURE: ``unknown_effect``. Named are effects that are sure beside every field that
   explains a comparable part, if they are few.
2. else nothing is sure and P(none) > 1 - SURE: ``no_effect_missing``; it is not excluded.
3. else P(unknown) >= MAY_BE_UNKNOWN: ``many_effects`` without names.
4. else 1 to FEW sure effects and fewer than OPEN expected to be open: ``effects_found``.
5. else ``many_effects``, with what is sure whatever the rest is.

An effect is sure if the posterior says so and if it is not larger than any is. The best set without
it and without all that does the same is searched for and fitted, so that its probability is not
that of lack of competitors. Of many effects a search meets few of the sets that explain as much:
there an effect is sure if its best competitor is worse by WITHIN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import largest_size
from crosscheck.inference import priors
from crosscheck.inference.catalogue import Key, bare, is_field
from crosscheck.inference.posterior import Classes, Posterior
from crosscheck.inference.search import Search

# Prior width of a field whose coefficients are flat.
_FLAT = 1e4
_ANYWHERE = ("tracker_frame", "tracker_target")


@dataclass(frozen=True, eq=False)
class Judgement:
    """What may be said.

    Attributes:
        verdict: the word. posterior: what it is of.
        classes: the probabilities that names are taken from.
        sure: keys of the members that may be named, the most probable first.
        implausible: members that would be sure but are larger than any effect is.
    """

    verdict: DiagnosisVerdict
    posterior: Posterior
    classes: Classes
    sure: tuple[str, ...]
    implausible: tuple[str, ...] = ()


def judged(search: Search) -> Judgement:
    """Judge a finished search; alternatives to what would be named are searched and fitted."""
    for _ in range(3):
        before, posterior = len(search.cache), Posterior.of(search)
        if posterior.unknown < priors.MAY_BE_UNKNOWN:
            for key in posterior.known.sure(search.stood):
                search.challenge(posterior.known.alike(key))
        if len(search.cache) == before:
            break
    return _judged(search, Posterior.of(search))


def _judged(search: Search, posterior: Posterior) -> Judgement:
    is_unknown = posterior.unknown >= priors.SURE and posterior.beside is not None
    classes = posterior.beside if is_unknown else posterior.known
    assert classes is not None
    large = _implausible(search, classes.best)
    sure = [k for k in classes.sure(search.stood) if k not in large]

    def is_unrivalled(key: str) -> bool:
        """Whether any set without a member and its like is far worse, and that of all others."""
        some = classes.alike(key)
        return search.challenge(some) > priors.WITHIN and search.needed(some) > priors.WITHIN

    def said(word: DiagnosisVerdict, names: list[str]) -> Judgement:
        return Judgement(word, posterior, classes, tuple(names), tuple(sorted(large)))

    if is_unknown:
        few = len(classes.best - search.stood) <= priors.FEW
        return said(
            DiagnosisVerdict.UNKNOWN_EFFECT,
            [k for k in sure if few and is_beyond_fields(search, classes.best, k)],
        )
    if not sure and posterior.none > 1.0 - priors.SURE:
        return said(DiagnosisVerdict.NO_EFFECT_MISSING, [])
    if posterior.unknown >= priors.MAY_BE_UNKNOWN:
        return said(DiagnosisVerdict.MANY_EFFECTS, [])
    if 1 <= len(sure) <= priors.FEW and classes.open < priors.OPEN and not large:
        return said(DiagnosisVerdict.EFFECTS_FOUND, sure)
    return said(DiagnosisVerdict.MANY_EFFECTS, [k for k in sure if is_unrivalled(k)])


def _implausible(search: Search, best: Key) -> set[str]:
    """Members of the best set that are larger than any effect is; a tracker may be anywhere."""
    terms = search.best.fit.terms
    keys = search.every.keys_of(terms)
    sized = [t for t in terms if t.name not in _ANYWHERE]
    large = {keys[t.name] for t in sized if largest_size(t) > priors.LARGEST}
    return large & (best - search.stood)


def is_beyond_fields(search: Search, best: Key, key: str) -> bool:
    """Whether a member is needed beside each field that explains a comparable part of what is left.

    What is unknown follows no field exactly: a part LEFTOVER of it remains, which a known effect
    may imitate. So a member is named only if, with the coefficients of the field flat, it is worth
    more than that part of what the field explains in its place.
    """
    scores, core = search.last, bare(best)
    groups = scores.about.linear.groups
    if key not in groups or len(groups[key].columns) > priors.NUMBERS:
        return False
    rest = core - {key}
    gains = {k: scores.gain(core, k) for k in groups if is_field(k)}
    most = max(gains.values(), default=0.0)
    needed = np.log(priors.SURE / (1.0 - priors.SURE)) + scores.prior(rest) - scores.prior(core)
    for kind in (k for k, gain in gains.items() if gain >= priors.COMPARABLE * most):
        solved = scores.about.linear.solved({**scores.widths(rest | {kind}), kind: _FLAT})
        if solved.gain(key) < max(needed, priors.LEFTOVER * scores.gain(rest, kind)):
            return False
    return True
