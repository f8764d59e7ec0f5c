"""Probabilities over the hypotheses of a search, and classes of effects that look alike.

    P(A) = sum of exp(score) over the fitted hypotheses in A / sum over all

Two effects belong to one class if exchanging them costs less than EQUAL of ln evidence: these data
cannot tell them apart. The likeliest other exchanges join it until it holds SURE, and if a few more
do that all but FALSE_ALARM. The probability of a class is that of at least one of its members.
Something unknown is there in hypotheses with a field, and in those whose noise is louder than
stated and slow, or goes by the place (:meth:`crosscheck.inference.noise.NoisePrior.is_unknown`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from crosscheck.inference import priors
from crosscheck.inference.catalogue import Key, bare, is_field, name_of
from crosscheck.inference.fields import over_place
from crosscheck.inference.fit import fit
from crosscheck.inference.hypothesis import scored
from crosscheck.inference.noise import Noise, NoisePrior
from crosscheck.inference.search import Search
from seecr.effects.base import Layout

# An effect of at most so many parameters is small, see EQUAL.
_SMALL = 3
# The key of a function of the place that stands for noise. It is forgotten after a part of half the
# range of an axis: after 1, a cubic follows it; 0.15 is the distance of a dozen places on an axis.
_PLACE, _SMOOTH, _ROUGH = "~place", 1.0, 0.15

Scored = Mapping[Key, float]


@dataclass(frozen=True)
class Classes:
    """Probabilities of members, and of classes of members that these data cannot tell apart.

    Attributes:
        best: the best hypothesis, without its field.
        member: probability of each member of the catalogue.
        classes: members of each class, those of ``best`` first, with the probability that one of
            them is missing; the most probable class first.
        further: for members of ``best`` that share a class with more needed ones, the probability
            that as many of the class are missing.
    """

    best: Key
    member: Mapping[str, float]
    classes: Sequence[tuple[tuple[str, ...], float]]
    further: Mapping[str, float]

    def of(self, key: str) -> float:
        """The probability that a member is missing, or one that does the same."""
        if key in self.further:
            return self.further[key]
        return next((p for members, p in self.classes if key in members), 0.0)

    def alike(self, key: str) -> tuple[str, ...]:
        """The class of a member."""
        return next((members for members, _p in self.classes if key in members), (key,))

    def sure(self, stood: Key) -> list[str]:
        """Members of the best set whose class is sure, the most probable first."""
        own = [k for k in self.best - stood if self.of(k) >= priors.SURE]
        return sorted(own, key=lambda k: (-self.of(k), k))

    @property
    def open(self) -> float:
        """Expected number of classes that are left open."""
        every = [*(p for _members, p in self.classes), *self.further.values()]
        return float(sum(min(p, 1.0 - p) for p in every if 1.0 - priors.SURE < p < priors.SURE))


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the search says.

    Attributes:
        search: the search.
        unknown: probability of something unknown. none: that nothing is missing.
        known: classes, whatever is unknown. beside: classes given that something unknown is there.
        fields: probability of each field, the likeliest first.
    """

    search: Search
    unknown: float
    none: float
    known: Classes
    beside: Classes | None
    fields: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, search: Search) -> Posterior:
        """The posterior over a search's cache."""
        prior = NoisePrior.of(search.data.problem)
        scores = {k: h.score for k, h in search.fitted.items()}
        scores |= _unfitted(search)
        total = float(np.logaddexp.reduce(list(scores.values())))
        share = {k: float(np.exp(s - total)) for k, s in scores.items()}
        fitted = search.fitted
        place = odds_of_place(search)
        loud = {
            k: 1.0
            if any(map(is_field, k))
            else prior.is_unknown(fitted.get(k, search.best).fit.noise, place)
            for k in scores
        }
        unknown = sum(share[k] * p for k, p in loud.items())
        none = share[search.stood] * (1.0 - loud[search.stood])
        with_unknown = {k: scores[k] + np.log(p) for k, p in loud.items() if p > 0.0}
        fields = dict[str, float]()
        for k in scores:
            for f in filter(is_field, k):
                fields[f] = fields.get(f, 0.0) + share[k]
        return cls(
            search,
            min(unknown, 1.0),
            none,
            _classes(search, _merged(scores)),
            _classes(search, _merged(with_unknown)) if with_unknown else None,
            dict(sorted(fields.items(), key=lambda one: -one[1])),
        )


def odds_of_place(search: Search) -> float:
    """Odds that what the best hypothesis takes for noise goes by the place and not by row.

    A noise larger than stated may be the sensor's, or an error over the workspace, which nobody
    calls noise. They differ in what they foretell of near places in other runs. If it goes
    along from row to row, a smooth error is as probable beforehand. A rough one, of which even
    neighbours hardly know, is as rare as anything unknown.
    """
    best, prior = search.best, NoisePrior.of(search.data.problem)
    rare, odds = float(np.exp(priors.UNKNOWN)) / priors.MISJUDGED, 0.0
    for kind, p in zip(prior.kinds, prior.misjudged(best.fit.noise), strict=True):
        if best.field is None and p >= priors.MAY_BE_UNKNOWN:
            odds = max(odds, rare * _odds_of(search, _ROUGH, prior, int(kind)))
            if best.fit.noise.rho[kind] > 0.0:
                odds = max(odds, _odds_of(search, _SMOOTH, prior, int(kind)))
    return odds


def _odds_of(search: Search, length: float, prior: NoisePrior, kind: int) -> float:
    """Odds of a function of the place beside noise as stated, of the same prior probability.

    Args:
        search: the search. length: after which part of half the range it is forgotten.
        prior: of the noise. kind: number of the kind of reading.
    """
    best = search.best
    widths = {name_of(k): w for k, w in best.widths.items() if not is_field(k)}
    columns = over_place(best.fit, kind, length)
    scale, rho = best.fit.noise.scale.copy(), best.fit.noise.rho.copy()
    size, scale[kind], rho[kind] = float(scale[kind]), 1.0, 0.0
    every = replace(search.every, fields={_PLACE: columns})
    found = fit(search.data, best.fit.state, widths, size * columns, noise=Noise(scale, rho))
    other = scored(every, best.key | {_PLACE}, found, {**best.widths, _PLACE: size})
    # what the sensor adds to it is as large as stated
    as_stated = 1.0 - prior.misjudged(found.noise)[prior.kinds == kind][0]
    share = np.log(max(as_stated, 1e-300)) + prior.log_misjudged(size)
    return float(np.exp(min(other.score + share - best.score, 50.0)))


def _unfitted(search: Search) -> dict[Key, float]:
    """Linear scores of sets that were not fitted: with more than the best one, or in its place.

    None is better than the best.
    """
    best = search.best
    if best.key != search.last.centre.key:
        return {}
    base = search.last.score(best.key)
    return {
        k: best.score + min(s - base, 0.0)
        for k, s in search.near.items()
        if k not in search.cache and (k > best.key or len(k) <= len(best.key))
    }


def _merged(scores: Scored) -> dict[Key, float]:
    """Scores of sets, whatever their field."""
    out = dict[Key, float]()
    for key, score in scores.items():
        out[bare(key)] = float(np.logaddexp(out.get(bare(key), -np.inf), score))
    return out


def _classes(search: Search, scores: Scored) -> Classes:
    """Probabilities of members and classes over some sets."""
    stood, members = search.stood, search.every.members
    best = _plainest(scores, stood)
    layouts = {k: m.layout for k, m in members.items()}
    together = _alike(scores, best, [k for k in members if k not in stood], layouts)
    total = float(np.logaddexp.reduce(list(scores.values())))
    share = {k: float(np.exp(s - total)) for k, s in scores.items()}

    def chance(some: Iterable[str], least: int = 1) -> float:
        wanted = frozenset(some)
        return min(sum(p for k, p in share.items() if len(wanted & k) >= least), 1.0)

    together = _credible(scores, best, together, chance)
    classes = sorted(((c, chance(c)) for c in together), key=lambda one: (-one[1], one[0]))
    further = dict[str, float]()
    for some, _p in classes:
        # the most needed member first: the set without it explains least
        needed = sorted(best & set(some), key=lambda k: (scores.get(best - {k}, -np.inf), k))
        further |= {k: chance(some, n) for n, k in enumerate(needed[1:], start=2)}
    return Classes(best, {k: chance([k]) for k in members}, classes, further)


def _plainest(scores: Scored, stood: Key) -> Key:
    """The best set without members that are worth nothing: what replaces those says nothing.

    Nothing at all is left only where it is not excluded that nothing is missing.
    """
    best = max(scores, key=lambda k: (scores[k], sorted(k)))
    least, total = scores[best] - priors.EQUAL, float(np.logaddexp.reduce(list(scores.values())))
    excluded = scores.get(stood, -np.inf) - total < np.log(1.0 - priors.SURE)
    while True:
        fewer = [best - {k} for k in best - stood if scores.get(best - {k}, -np.inf) > least]
        fewer = [key for key in fewer if not (key == stood and excluded)]
        if not fewer:
            return best
        best = max(fewer, key=lambda k: (scores[k], sorted(k)))


def _alike(
    scores: Scored, best: Key, members: Sequence[str], layouts: Mapping[str, Layout]
) -> list[tuple[str, ...]]:
    """Classes of members by exchanges that cost the best set little; others alone."""
    together = {k: {k} for k in members}

    def join(a: str, b: str) -> None:
        joined = together[a] | together[b]
        for k in joined:
            together[k] = joined

    beside = list[tuple[float, Key, Key]]()
    for key, score in scores.items():
        gone, come, loss = best - key, key - best, scores[best] - score
        if not gone | come <= together.keys():
            continue  # another form of an effect of the model as it stands
        if len(gone) == len(come) == 1:
            (a,), (b,) = gone, come
            if loss < _cost(layouts[a], layouts[b]):
                join(a, b)
        elif len(gone) == len(come) and loss < priors.EQUAL:
            beside.append((loss, gone, come))
    for _loss, gone, come in sorted(beside, key=lambda one: (one[0], sorted(one[2]))):
        # two sets differ in known equivalents and one more pair: that pair is equivalent too
        for one in sorted(gone):
            equal = sorted(come & together[one])
            if equal and len(gone) > 1:
                gone, come = gone - {one}, come - {equal[0]}
        if len(gone) == 1:
            join(next(iter(gone)), next(iter(come)))
    place = {k: n for n, k in enumerate(members)}
    classes = {tuple(sorted(c, key=lambda k: (k not in best, place[k]))) for c in together.values()}
    return sorted(classes)


def _credible(
    scores: Scored, best: Key, classes: Sequence[tuple[str, ...]],
    chance: Callable[[Iterable[str]], float],
) -> list[tuple[str, ...]]:  # fmt: skip
    """The classes, those of the best set's members grown to credible sets where that takes few.

    An effect may be 0.7 probable and another in its place 0.28. Then it is sure that one of the two
    is missing: the likeliest that exchange for a member join its class until that is sure. Those
    that are equal anyway count as one. Of names that are just sure, one in twenty would be false.
    So more join if these few leave no more than FALSE_ALARM outside.
    """
    out = {members: set(members) for members in classes}
    for members in classes:
        for own in sorted(best & set(members))[:1]:
            others = {
                next(iter(key - best)): score for key, score in scores.items()
                if best - key == {own} and len(key - best) == 1
            }  # fmt: skip
            # sure enough for a name, and then, if few more do it, for one that is not a false alarm
            grown, joined = set(members), 1
            for enough in (priors.SURE, 1.0 - priors.FALSE_ALARM):
                for other in sorted(others, key=lambda k: (-others[k], k)):
                    if chance(grown) >= enough or joined >= priors.FEW:
                        break
                    alone = next((m for m in classes if other in m), (other,))
                    if other not in grown and not set(alone) & best:
                        grown, joined = grown | set(alone), joined + 1
                if chance(grown) >= enough:
                    out[members] = set(grown)
    taken = [grown for members, grown in out.items() if len(grown) > len(members)]
    done = list[tuple[str, ...]]()
    for members, grown in out.items():
        if any(set(members) <= other and grown is not other for other in taken):
            continue
        first = [k for k in members if k in grown]
        done.append((*first, *sorted(grown - set(first), key=lambda k: -chance([k]))))
    return done


def _cost(own: Layout, other: Layout) -> float:
    """ln evidence that an exchange may cost if the two cannot be told apart.

    A frame that yields equally in all directions acts like cable behind the exit point, but has two
    parameters. What only extends another effect (friction on such cable) has no such excuse.
    """
    count = [1 if one.effect.parent and len(one) <= _SMALL else len(one) for one in (own, other)]
    more = max(0, count[1] - count[0]) if count[1] <= _SMALL else 0
    return priors.EQUAL * (1 + more)
