"""Posterior probabilities of effects, and classes of effects that the data cannot tell apart."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.sets.equals import EQUAL, are_equals
from crosscheck.calibration.sets.exact import LOCAL_MINIMUM, Refit
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.calibration.sets.refits import ComparedSets

# Only the neighbours of sets that are worse than the best by less than this ln evidence count.
_COUNTED = 8.0
# Two effects do the same if one gains less beside the other than this part of what it gains alone.
_SAME = 0.5
# So many effects that are not listed are tested for doing the same.
_HINTS = 10


@dataclass(frozen=True, eq=False)
class Classes:
    """Posterior probabilities, as sums over sets.

    Attributes:
        effect: for each effect, the probability that it is missing.
        members: classes of equivalent effects, the most probable first; each effect is in one.
        probability: for each class, the probability that some member is missing.
        further: for the second member of the best set within a class (third, ...), the
            probability that at least two members of the class are missing (three, ...).
    """

    effect: dict[str, float]
    members: list[tuple[str, ...]]
    probability: list[float]
    further: dict[str, float]

    @property
    def undecided(self) -> float:
        """Expected number of open classes and further members: the sum of min(P, 1 - P)."""
        return float(sum(min(p, 1.0 - p) for p in (*self.probability, *self.further.values())))

    def alike(self, name: str) -> tuple[str, ...]:
        """The members of an effect's class, itself among them."""
        return next((members for members in self.members if name in members), (name,))

    def without(self, imitating: Names, chance: float) -> Classes:
        """The probabilities if, with some chance, something unknown explains what these explain.

        Their equivalents explain the same, and become less probable too.
        """
        touched = [not imitating.isdisjoint(members) for members in self.members]
        less = {m for some, yes in zip(self.members, touched, strict=True) if yes for m in some}

        def of(probabilities: Mapping[str, float]) -> dict[str, float]:
            return {n: p * (1.0 - chance * (n in less)) for n, p in probabilities.items()}

        pairs = zip(self.probability, touched, strict=True)
        probability = [p * (1.0 - chance * yes) for p, yes in pairs]
        return Classes(of(self.effect), self.members, probability, of(self.further))

    def at_most(self, best: Names, without: Mapping[Names, float]) -> Classes:
        """The probabilities if some members of the best set may be noise.

        Args:
            best: the best set.
            without: for each group of its members, the probability that just these are noise.
        """

        def limit(some: Iterable[str], least: int = 1) -> float:
            mine = best.intersection(some)
            if len(mine) < least:
                return 1.0
            return 1.0 - sum(p for out, p in without.items() if len(mine - out) < least)

        effect = {n: min(p, limit([n])) for n, p in self.effect.items()}
        pairs = [
            (members, min(p, limit(members)))
            for members, p in zip(self.members, self.probability, strict=True)
        ]
        pairs.sort(key=lambda pair: -pair[1])
        further = {}
        for members, _p in pairs:
            # the most needed member first; the others are further ones
            some = sorted(
                best.intersection(members), key=lambda n: (-limit([n]), n in self.further)
            )
            before = sorted((self.further[n] for n in some if n in self.further), reverse=True)
            for count, (name, p) in enumerate(zip(some[1:], before, strict=False), start=2):
                further[name] = min(p, limit(members, count))
        return Classes(effect, [m for m, _p in pairs], [p for _m, p in pairs], further)

    def of(self, name: str) -> float:
        """Probability that an effect or an equivalent is missing; see ``further`` for some."""
        pairs = zip(self.members, self.probability, strict=True)
        return self.further.get(name, next(p for members, p in pairs if name in members))


def all_scores(found: ComparedSets) -> dict[Names, float]:
    """Scores of all fitted sets, and approximate ones of sets with one effect more than these.

    Each fitted set that counts has its own larger sets. If only those of the best set counted, its
    members would seem surer than they are. Larger sets that gain a member of the best set, or
    contain it, are left out for other sets: those of them that matter are fitted.
    """
    best, out = found.best, dict[Names, float]()
    for names, refit in found.refits.items():
        if refit.score < best.score - _COUNTED:
            continue
        for larger, score in _larger(found, refit).items():
            near = larger - names <= best.names or larger > best.names
            if names == best.names or not near:
                out[larger] = max(score, out.get(larger, -np.inf))
    return out | {names: refit.score for names, refit in found.refits.items()}


def _larger(found: ComparedSets, refit: Refit) -> dict[Names, float]:
    """Sets with one effect more than a fitted one, with approximate scores.

    None may score higher than that set: if it were better, it would have been fitted, unless no
    robot can have its values. If the linear model does not know what the set explains, other
    effects explain it there; then they are taken to gain as much beside the set as beside the best
    one.
    """
    scores, best = found.scores, found.best
    off = (refit.score - scores.score(refit.names)) - (best.score - scores.score(best.names))
    about = refit.names if off < LOCAL_MINIMUM else best.names
    base, out = scores.score(about) - scores.log_prior(about), dict[Names, float]()
    for names, score in scores.larger(about).items():
        larger = refit.names | names - about
        if larger != refit.names:
            gain = score - scores.log_prior(names) - base
            step = scores.log_prior(larger) - scores.log_prior(refit.names)
            out[larger] = refit.score + min(gain + step, 0.0)
    return out


def probabilities(
    scores: Mapping[Names, float],
    best: Names,
    effects: Iterable[str],
    sizes: Mapping[str, int] | None = None,
    fitted: Collection[Names] | None = None,
    hints: Iterable[tuple[str, ...]] = (),
) -> Classes:
    """Posterior probabilities of effects and classes: sums over sets.

    Args:
        scores: ln evidence plus ln prior of each set.
        best: the best of them.
        effects: all effects that may be missing.
        sizes: number of parameters of each; 1 if not given.
        fitted: sets whose scores are exact, by default all: only these decide which effects are
            equivalent.
        hints: effects beyond the best set that do the same, from :func:`alike_beyond`.
    """
    effects = list(effects)
    exact = scores if fitted is None else {n: scores[n] for n in fitted}
    members = with_hints(_classes(exact, best, effects, sizes or {}), hints)
    return of_classes(scores, best, effects, members)


def with_hints(
    members: Iterable[tuple[str, ...]], hints: Iterable[tuple[str, ...]]
) -> list[tuple[str, ...]]:
    """Join classes of one effect each if these effects do the same, by ``hints``."""
    members = list(members)
    alone = {names[0] for names in members if len(names) == 1}
    groups = [tuple(name for name in names if name in alone) for names in hints]
    taken = {name for names in groups for name in names}
    return [*filter(None, groups), *(names for names in members if taken.isdisjoint(names))]


def alike_beyond(scores: Scores, listed: Names, sizes: Mapping[str, int]) -> list[tuple[str, ...]]:
    """Groups of effects that are not listed and do the same, by the linear model about the listed.

    Each of them explains something beside the listed ones (without prior odds), about as well as
    the best of its group, and beside that one less than half as much.
    """

    def gains(names: Names, some: Iterable[str]) -> dict[str, float]:
        def gain(more: Names) -> float:
            return scores.score(more, widths) - scores.log_prior(more)

        widths, base = scores.widths(names), scores.score(names) - scores.log_prior(names)
        return {e: gain(names | {e}) - base for e in some}

    near = scores.larger(listed)
    likely = sorted(near, key=lambda names: -near[names])[:_HINTS]
    alone = gains(listed, [next(iter(names - listed)) for names in likely])
    left = sorted((e for e in alone if alone[e] > EQUAL), key=lambda e: -alone[e])
    out = []
    while left:
        first, *others = left
        beside = gains(listed | {first}, others)
        group = [
            e for e in others
            if are_equals(alone[first] - alone[e], sizes.get(first, 1), sizes.get(e, 1))
            and beside[e] < _SAME * alone[e]
        ]  # fmt: skip
        left = [e for e in others if e not in group]
        if group:
            out.append((first, *group))
    return out


def of_classes(
    scores: Mapping[Names, float],
    best: Names,
    effects: Iterable[str],
    members: Iterable[tuple[str, ...]],
) -> Classes:
    """Posterior probabilities of effects and of given classes; ``best`` is the best set."""
    names = list(scores)
    logs = np.array([scores[n] for n in names])
    share = np.exp(logs - np.logaddexp.reduce(logs))

    def chance(some: Iterable[str], least: int = 1) -> float:
        wanted = set(some)
        total = sum(p for n, p in zip(names, share, strict=True) if len(wanted & n) >= least)
        return min(float(total), 1.0)  # rounding may take the sum above 1

    order = sorted(members, key=lambda c: -chance(c))
    effect = {e: chance([e]) for e in effects}
    further: dict[str, float] = {}
    for members_of in order:
        # the most needed member first: the set without it explains least
        needed = sorted(
            best.intersection(members_of), key=lambda e: scores.get(best - {e}, -np.inf)
        )
        further.update({e: chance(members_of, k) for k, e in enumerate(needed[1:], start=2)})
    return Classes(effect, order, [chance(c) for c in order], further)


def _classes(
    scores: Mapping[Names, float], best: Names, effects: list[str], sizes: Mapping[str, int]
) -> list[tuple[str, ...]]:
    """Classes of equivalent effects, by exchanges that cost the best set little; others alone."""
    together = {e: {e} for e in effects}

    def join(a: str, b: str) -> None:
        joined = together[a] | together[b]
        for e in joined:
            together[e] = joined

    beside = list[tuple[float, Names, Names]]()
    for names, score in scores.items():
        gone, come, loss = best - names, names - best, scores[best] - score
        if len(gone) == len(come) == 1:
            (a,), (b,) = gone, come
            if are_equals(loss, sizes.get(a, 1), sizes.get(b, 1)):
                join(a, b)
        elif len(gone) == len(come) and loss < EQUAL:
            beside.append((loss, gone, come))
    for _loss, gone, come in sorted(beside, key=lambda one: one[0]):
        # two sets differ in known equivalents and one more pair: that pair is equivalent too
        left = _left(gone, come, together)
        if left is not None:
            join(*left)
    out = []
    for e in effects:
        if together[e] and e == min(together[e], key=effects.index):
            first = sorted(together[e], key=lambda m: (m not in best, effects.index(m)))
            out.append(tuple(first))
    return out


def _left(gone: Names, come: Names, together: Mapping[str, set[str]]) -> tuple[str, str] | None:
    """The one pair that is exchanged beside known equivalents; None if there are several pairs."""
    for one in sorted(gone):
        equal = sorted(come & together[one])
        if equal and len(gone) > 1:
            gone, come = gone - {one}, come - {equal[0]}
    return (next(iter(gone)), next(iter(come))) if len(gone) == 1 else None
