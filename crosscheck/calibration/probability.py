"""How probable each effect is, and which of them the data cannot tell apart."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from crosscheck.calibration.equals import EQUAL, are_equals
from crosscheck.calibration.exact import HOLLOW, Refit
from crosscheck.calibration.refits import Found
from crosscheck.calibration.sets import Names, Scores

# Sets worse than the best by more than this in ln evidence count for nothing.
_COUNTED = 8.0
# Beside an effect that does the same another gains less than this part of what it does alone.
_SAME = 0.5
# As many effects beyond what is listed are looked at for being alike.
_HINTS = 10


@dataclass(frozen=True, eq=False)
class Classes:
    """Probabilities from sets and their scores.

    Attributes:
        effect: of each effect, that it is missing.
        members: classes of equals, the most probable first; every effect in one.
        probability: of each class, that some member is missing.
        further: of members of the best set that share a class with one that is needed more, that
            as many of the class are missing as it takes: of three equals, two may be.
    """

    effect: dict[str, float]
    members: list[tuple[str, ...]]
    probability: list[float]
    further: dict[str, float]

    @property
    def undecided(self) -> float:
        """Sum of min(P, 1 - P) over classes, and further members: how many of them are open."""
        return float(sum(min(p, 1.0 - p) for p in (*self.probability, *self.further.values())))

    def without(self, imitating: Names, chance: float) -> Classes:
        """The same where, with some chance, what these explain is something unknown.

        Their equals explain the same.
        """
        touched = [not imitating.isdisjoint(members) for members in self.members]
        less = {m for some, yes in zip(self.members, touched, strict=True) if yes for m in some}

        def of(probabilities: Mapping[str, float]) -> dict[str, float]:
            return {n: p * (1.0 - chance * (n in less)) for n, p in probabilities.items()}

        pairs = zip(self.probability, touched, strict=True)
        probability = [p * (1.0 - chance * yes) for p, yes in pairs]
        return Classes(of(self.effect), self.members, probability, of(self.further))

    def of(self, name: str) -> float:
        """Probability that an effect or one of its class is missing, beside those needed more."""
        pairs = zip(self.members, self.probability, strict=True)
        return self.further.get(name, next(p for members, p in pairs if name in members))


def all_scores(found: Found) -> dict[Names, float]:
    """Exact scores, and about those of sets with one effect more than a fitted one.

    Each set that counts has as many larger ones about it: were only those of the best set
    counted, its members would be surer than they are. Others that gain a member of the best set,
    or contain it, are near it: those of them that matter are fitted.
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


def _larger(found: Found, refit: Refit) -> dict[Names, float]:
    """Sets with one effect more than a fitted one, with about their scores.

    None is better than that set: it would have been fitted, or no robot can have it. Where the
    linear model does not know what the set explains, others explain it there: they are taken to
    gain beside it what they gain beside the best set.
    """
    scores, best = found.scores, found.best
    off = (refit.score - scores.score(refit.names)) - (best.score - scores.score(best.names))
    about = refit.names if off < HOLLOW else best.names
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
    """Probabilities of effects and classes: sums over sets.

    Args:
        scores: ln evidence and prior of each set.
        best: the best of them.
        effects: all that may be missing.
        sizes: how many parameters each has; one where not given.
        fitted: sets whose scores are exact, all by default: only they say what stands in the
            place of what.
        hints: effects beyond the best set that do the same, from :func:`alike_beyond`.
    """
    effects = list(effects)
    exact = scores if fitted is None else {n: scores[n] for n in fitted}
    members = with_hints(_classes(exact, best, effects, sizes or {}), hints)
    return of_classes(scores, best, effects, members)


def with_hints(
    members: Iterable[tuple[str, ...]], hints: Iterable[tuple[str, ...]]
) -> list[tuple[str, ...]]:
    """Classes, with those put together that are of one effect each and hint at the same."""
    members = list(members)
    alone = {names[0] for names in members if len(names) == 1}
    groups = [tuple(name for name in names if name in alone) for names in hints]
    taken = {name for names in groups for name in names}
    return [*filter(None, groups), *(names for names in members if taken.isdisjoint(names))]


def alike_beyond(scores: Scores, listed: Names, sizes: Mapping[str, int]) -> list[tuple[str, ...]]:
    """Effects that are not listed and hint at the same, in the linear model about what is.

    Each explains something beside what is listed (prior odds left out), about as well as the best
    of them does, and beside that one not half as much.
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
    """Probabilities of effects and of given classes of them; ``best`` is the best set."""
    names = list(scores)
    logs = np.array([scores[n] for n in names])
    share = np.exp(logs - special.logsumexp(logs))

    def chance(some: Iterable[str], least: int = 1) -> float:
        wanted = set(some)
        total = sum(p for n, p in zip(names, share, strict=True) if len(wanted & n) >= least)
        return min(float(total), 1.0)  # a sum of shares is 1 but for rounding

    order = sorted(members, key=lambda c: -chance(c))
    effect = {e: chance([e]) for e in effects}
    further: dict[str, float] = {}
    for members_of in order:
        # the most needed first: without it the set explains least
        needed = sorted(
            best.intersection(members_of), key=lambda e: scores.get(best - {e}, -np.inf)
        )
        further.update({e: chance(members_of, k) for k, e in enumerate(needed[1:], start=2)})
    return Classes(effect, order, [chance(c) for c in order], further)


def _classes(
    scores: Mapping[Names, float], best: Names, effects: list[str], sizes: Mapping[str, int]
) -> list[tuple[str, ...]]:
    """Members of the best set with what could stand in their place; the others by themselves."""
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
        # sets that differ in equals and one effect more say that these are equals too
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
    """The two that are exchanged beside equals; None where there are more."""
    for one in sorted(gone):
        equal = sorted(come & together[one])
        if equal and len(gone) > 1:
            gone, come = gone - {one}, come - {equal[0]}
    return (next(iter(gone)), next(iter(come))) if len(gone) == 1 else None
