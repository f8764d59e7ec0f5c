"""Searches the sets of effects that explain linear data best, by adding, dropping and exchanging.

A set's score is its ln evidence, averaged over its members' widths, plus the ln of its prior: all
numbers of effects are equally probable, and so are all sets of one number (Scott and Berger, Annals
of Statistics 38, 2010). One solve of a set gives the scores of all sets one effect away.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from crosscheck.calibration.linear_evidence.gram import Gram, averaged, best_widths
from seecr.effects import Term

Names = frozenset[str]
_MOVES = 60
# Larger sets are thinned member by member before the search; in them nothing is exchanged.
_LARGE = 8
# When a large set is thinned, members that are worth more ln evidence than this stay.
_KEPT = 3.0


def log_prior(count: int, of: int) -> float:
    """ln prior of a set of ``count`` effects out of ``of``."""
    return float(
        -np.log(of + 1)
        - special.gammaln(of + 1) + special.gammaln(count + 1) + special.gammaln(of - count + 1)
    )  # fmt: skip


@dataclass(eq=False)
class Scores:
    """Scores of sets in one linear model.

    Attributes:
        gram: normal equations of all effects.
        of: how many effects the prior counts.
        always: effects that the model has already: in every set, and not counted in the prior.
        shapes: effects with a shape, at the shape of the fit that the model is linearised about,
            amplitudes at null.
        prices: ln evidence that effects gain too much because their shapes are the best ones.
        solved: sets whose widths were optimised, with score and widths.
        near: sets one effect away from those, with approximate scores.
    """

    gram: Gram
    of: int
    always: Names = frozenset()
    shapes: Mapping[str, Term] = field(default_factory=dict)
    prices: Mapping[str, float] = field(default_factory=dict)
    solved: dict[Names, tuple[float, dict[str, float]]] = field(default_factory=dict)
    near: dict[Names, float] = field(default_factory=dict)

    @property
    def every(self) -> dict[Names, float]:
        """Scores of all sets met so far; those that were not solved are approximate."""
        return self.near | {names: score for names, (score, _widths) in self.solved.items()}

    def score(self, names: Names, start: dict[str, float] | None = None) -> float:
        """ln evidence plus ln prior of a set."""
        if names not in self.solved:
            seen = sorted(names & self.gram.groups.keys())  # without effects that the model holds
            widths = {n: (start or {}).get(n, self.middle(n)) for n in seen}
            widths = best_widths(self.gram, widths)
            price = sum(self.price(name) for name in names)
            total = averaged(self.gram, widths) + self.log_prior(names) - price
            self.solved[names] = (total, widths)
        return self.solved[names][0]

    def log_prior(self, names: Names) -> float:
        """ln prior of a set."""
        return log_prior(len(names - self.always), self.of)

    def price(self, name: str) -> float:
        """ln evidence that the choice of an effect's shape costs."""
        return self.prices.get(name, 0.0)

    def widths(self, names: Names) -> dict[str, float]:
        """The prior widths of a set's members that maximise its evidence."""
        self.score(names)
        return self.solved[names][1]

    def neighbours(self, names: Names) -> dict[Names, float]:
        """Approximate scores of sets with one effect more, one less or, if small, one exchanged."""
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
        """Approximate scores of sets with one effect more."""
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
        """The width nearest to one plausible size."""
        widths = self.gram.groups[name].widths
        return float(widths[np.argmin(np.abs(np.log(widths)))])

    def best(self, count: int, within: float) -> list[Names]:
        """The best sets met so far, at most ``within`` worse in score than the best of all."""
        scores = self.every
        order = sorted(scores, key=lambda names: -scores[names])
        # at huge scores the difference is lost in rounding: the best is among them all the same
        return [n for n in order if scores[n] >= scores[order[0]] - within][:count]


def explore(scores: Scores, starts: Iterable[Names], moves: int = _MOVES) -> Names:
    """The best set that is reached from any of the starts by at most so many moves."""
    ends = [climb(scores, start, moves) for start in starts]
    return max(ends, key=scores.score)


def trimmed(scores: Scores, start: Names) -> Names:
    """A set without its least valuable members, while it is large and they are worth little."""
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
    """Move to a better neighbouring set as long as there is one, at most so often."""
    at = trimmed(scores, start)
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
