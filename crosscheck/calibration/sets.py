"""Which sets of effects explain linear data best: adding, dropping and swapping.

A set's score is its evidence, averaged over its members' widths, times what was thought of it
before: all numbers of effects alike likely, all sets of one number alike (Scott and Berger,
Annals of Statistics 38, 2010). One solve of a set gives the score of every set one effect away.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from crosscheck.calibration.gram import Gram, averaged, best_widths
from seecr.effects import Term

Names = frozenset[str]
_MOVES = 60
# Larger sets are only thinned, member by member: exchanging comes when they are smaller.
_LARGE = 8
# Members worth this much ln evidence stay when a large set is thinned.
_KEPT = 3.0


def log_prior(count: int, of: int) -> float:
    """ln chance of a set of ``count`` effects out of ``of``, before the data."""
    return float(
        -np.log(of + 1)
        - special.gammaln(of + 1) + special.gammaln(count + 1) + special.gammaln(of - count + 1)
    )  # fmt: skip


@dataclass(eq=False)
class Scores:
    """Scores of sets in one linear model.

    Attributes:
        gram: of all effects.
        of: how many effects the prior counts.
        always: effects that the model has: in every set, and not counted.
        shapes: effects with a shape as the fit has it about which this is, amplitudes at null.
        prices: ln evidence that effects have too much, as their shapes are the best ones.
        solved: sets whose widths were looked for: score and widths.
        near: sets one effect away from those: score with the neighbour's widths.
    """

    gram: Gram
    of: int
    always: Names = frozenset()
    shapes: Mapping[str, Term] = field(default_factory=dict)
    prices: Mapping[str, float] = field(default_factory=dict)
    solved: dict[Names, tuple[float, dict[str, float]]] = field(default_factory=dict)
    near: dict[Names, float] = field(default_factory=dict)

    def score(self, names: Names, start: dict[str, float] | None = None) -> float:
        """ln evidence of a set and ln prior."""
        if names not in self.solved:
            seen = sorted(names & self.gram.groups.keys())  # all but effects held by the model
            widths = {n: (start or {}).get(n, self.middle(n)) for n in seen}
            widths = best_widths(self.gram, widths)
            price = sum(self.price(name) for name in names)
            total = averaged(self.gram, widths) + self.log_prior(names) - price
            self.solved[names] = (total, widths)
        return self.solved[names][0]

    def log_prior(self, names: Names) -> float:
        """ln chance of a set before the data."""
        return log_prior(len(names - self.always), self.of)

    def price(self, name: str) -> float:
        """What the shape of an effect costs."""
        return self.prices.get(name, 0.0)

    def widths(self, names: Names) -> dict[str, float]:
        """The best widths of a set's members."""
        self.score(names)
        return self.solved[names][1]

    def neighbours(self, names: Names) -> dict[Names, float]:
        """About the scores of sets with one effect more, one less or one other."""
        widths, base = self.widths(names), self.score(names)
        out = self._more(names, widths, base)
        for name in names - self.always:
            rest = names - {name}
            fewer = {n: w for n, w in widths.items() if n != name}
            gain = self.gram.solved(widths).gain(name)
            score = base - gain - self.log_prior(names) + self.log_prior(rest) + self.price(name)
            out[rest] = score
            if len(names - self.always) <= _LARGE:
                out |= self._more(rest, fewer, score, but=name)
        return out

    def larger(self, names: Names) -> dict[Names, float]:
        """About the scores of sets with one effect more."""
        return self._more(names, self.widths(names), self.score(names))

    def _more(
        self, names: Names, widths: dict[str, float], base: float, but: str = ""
    ) -> dict[Names, float]:
        solved = self.gram.solved(widths)
        own = len(names - self.always)
        step = log_prior(own + 1, self.of) - log_prior(own, self.of)
        others = [n for n in self.gram.names if n not in names and n != but]
        return {names | {n}: base + step + solved.gain(n) - self.price(n) for n in others}

    def middle(self, name: str) -> float:
        """The width nearest to a plausible size."""
        widths = self.gram.groups[name].widths
        return float(widths[np.argmin(np.abs(np.log(widths)))])

    def best(self, count: int, within: float) -> list[Names]:
        """The best sets met so far, solved or near, no worse than the best by ``within``."""
        scores = self.near | {names: s for names, (s, _w) in self.solved.items()}
        order = sorted(scores, key=lambda names: -scores[names])
        return [n for n in order if scores[n] > scores[order[0]] - within][:count]


def explore(scores: Scores, starts: Iterable[Names], moves: int = _MOVES) -> Names:
    """The best set that so many moves from any of the starts lead to."""
    ends = [climb(scores, start, moves) for start in starts]
    return max(ends, key=scores.score)


def thinned(scores: Scores, start: Names) -> Names:
    """A large set without the members that are worth least, down to a size to search from."""
    gram = scores.gram
    widths = {n: scores.middle(n) for n in sorted(start & gram.groups.keys())}
    while len(widths) > _LARGE + len(scores.always):
        solved = gram.solved(widths)
        gains = {n: solved.gains(n) for n in widths}
        name = min(widths.keys() - scores.always, key=lambda n: float(np.max(gains[n])))
        if float(np.max(gains[name])) > _KEPT:
            break
        widths = {n: float(gram.groups[n].widths[np.argmax(g)]) for n, g in gains.items()}
        del widths[name]
    return frozenset(widths) | (start & scores.always)


def climb(scores: Scores, start: Names, moves: int = _MOVES) -> Names:
    """Move to the best neighbour while that is better, at most so often."""
    at = thinned(scores, start)
    for _ in range(moves):
        around = scores.neighbours(at)
        scores.near |= {n: s for n, s in around.items() if n not in scores.solved}
        for names in sorted(around, key=lambda n: -around[n])[:2]:
            if scores.score(names, scores.widths(at)) > scores.score(at) + 1e-6:
                at = names
                break
        else:
            return at
    return at
