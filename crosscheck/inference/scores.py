"""Scores of hypotheses in the linear model about a fit, and the way from one to a better one.

The linear model of the whole catalogue gives the evidence of any hypothesis by linear algebra.
Adding, dropping and exchanging members climbs to sets that only an exact fit can judge.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crosscheck.inference.about import About
from crosscheck.inference.catalogue import Key, bare, is_field, name_of, part_of
from crosscheck.inference.evidence import Solved, best_widths, log_evidence
from crosscheck.inference.hypothesis import Hypothesis
from crosscheck.inference.priors import WITHIN

# Most moves of a climb. Larger sets are thinned member by member first; nothing is exchanged there.
_MOVES, LARGE, _KEPT = 60, 8, 3.0
# Sets whose neighbours are looked at where a search ends.
_WIDENED = 30


class Scores:
    """Scores of hypotheses in the linear model about a fit: ln evidence plus ln prior."""

    def __init__(self, about: About, centre: Hypothesis) -> None:
        self.about, self.every, self.centre = about, about.every, centre
        self.stood = about.every.stood_keys
        self.solved: dict[Key, tuple[float, Solved]] = {}
        self.near: dict[Key, float] = {}

    def score(self, key: Key, start: Mapping[str, float] | None = None) -> float:
        """The score of a hypothesis with its best widths."""
        if key not in self.solved:
            groups = self.about.linear.groups
            widths = {k: (start or {}).get(k, groups[k].middle) for k in sorted(key & set(groups))}
            best = best_widths(self.about.linear, widths)
            self.solved[key] = (log_evidence(best) + self.prior(key), best)
        return self.solved[key][0]

    def promised(self, key: Key) -> float:
        """What the linear model promises of a hypothesis, on the scale of exact scores."""
        return self.score(key) - self.score(self.centre.key) + self.centre.score

    def prior(self, key: Key) -> float:
        """ln prior, less what the choice of shapes gains too much."""
        return self.every.log_prior(key) - sum(self.about.prices.get(k, 0.0) for k in key)

    def widths(self, key: Key) -> dict[str, float]:
        """The best prior widths of its members."""
        self.score(key)
        return self.solved[key][1].chosen

    def gain(self, key: Key, more: str) -> float:
        """Approximate ln evidence that a member gains beside others; 0 where it moves nothing."""
        if more not in self.about.linear.groups:
            return 0.0
        self.score(key)
        return self.solved[key][1].gain(more)

    @property
    def seen(self) -> dict[Key, float]:
        """Scores of all hypotheses met so far; those that were not solved are approximate."""
        return self.near | {key: score for key, (score, _solved) in self.solved.items()}

    def meet(self, scores: Mapping[Key, float]) -> None:
        """Keep approximate scores of hypotheses that were not solved."""
        self.near |= {k: s for k, s in scores.items() if k not in self.solved}

    def neighbours(self, key: Key) -> dict[Key, float]:
        """Approximate scores with one effect more, one less or, of small sets, one exchanged."""
        base, out = self.score(key), self.larger(key)
        standing = {name_of(k) for k in self.stood}
        for member in sorted(k for k in bare(key) if name_of(k) not in standing):
            rest = key - {member}
            out[rest] = base - self.gain(key, member) - self.prior(key) + self.prior(rest)
            if len(bare(key) - self.stood) <= LARGE:
                widths = {k: w for k, w in self.widths(key).items() if k != member}
                solved = self.about.linear.solved(widths)
                out |= self._with_one(rest, solved, out[rest], but=member)
        return out

    def larger(self, key: Key) -> dict[Key, float]:
        """Approximate scores with one effect more."""
        base = self.score(key)
        return self._with_one(key, self.solved[key][1], base)

    def _with_one(self, key: Key, solved: Solved, base: float, but: str = "") -> dict[Key, float]:
        had, prior = {name_of(k) for k in key}, self.prior(key)
        others = [
            k for k in self.about.linear.groups
            if not is_field(k) and not part_of(k) and k not in had and k != but
        ]  # fmt: skip
        return {key | {k}: base + solved.gain(k) + self.prior(key | {k}) - prior for k in others}

    def with_fields(self, key: Key) -> dict[Key, float]:
        """Approximate scores of a set, without its field, with each of the fields."""
        key = bare(key)
        base = self.score(key)
        return {
            key | {k}: base + self.gain(key, k) + self.every.log_shares[k]
            for k in self.about.linear.groups if is_field(k)
        }  # fmt: skip

    def with_forms(self, key: Key) -> dict[Key, float]:
        """Scores with an effect's form of other values in each file or run, added or exchanged."""
        out = {}
        for k in self.about.linear.groups:
            if part_of(k) and k not in key:
                rest = frozenset(other for other in key if name_of(other) != name_of(k))
                gain = self.gain(rest, k) - self.prior(rest) + self.prior(rest | {k})
                out[rest | {k}] = self.score(rest) + gain
        return out

    def climb(self, start: Key, moves: int = _MOVES, without: Key = frozenset()) -> Key:
        """The best set reached by moves to better neighbours, none of which has some members."""
        at = self._thinned(start)
        for _ in range(moves):
            around = {k: s for k, s in self.neighbours(at).items() if without.isdisjoint(k)}
            self.meet(around)
            for key in ranked(around)[:2]:
                if self.score(key, self.widths(at)) > self.score(at) + 1e-6:
                    at = key
                    break
            else:
                return at
        return at

    def widen(self, start: Key) -> None:
        """Meet sets that are no larger and differ by more than one exchange, the best first.

        Two effects may do what two others do, and each exchange alone explains a little less.
        """
        done = set[Key]()
        for _ in range(_WIDENED):
            small = {k: s for k, s in self.seen.items() if len(k) <= len(start) and k == bare(k)}
            seen = {k: s for k, s in small.items() if k not in done}
            key = max(seen, key=lambda k: (seen[k], sorted(k)), default=None)
            if key is None or seen[key] < self.score(start) - WITHIN:
                return
            done.add(key)
            self.meet({k: s for k, s in self.neighbours(key).items() if len(k) <= len(start)})

    def _thinned(self, start: Key) -> Key:
        """A set without its least valuable members, while it is large and they are worth little."""
        linear = self.about.linear
        widths = {k: linear.groups[k].middle for k in sorted(start & set(linear.groups))}
        fixed = {k for k in widths if k in self.stood or is_field(k)}
        while len(widths) > LARGE + len(fixed):
            solved = linear.solved(widths)
            gains = {k: solved.gains(k) for k in widths}
            least = min(sorted(widths.keys() - fixed), key=lambda k: float(np.max(gains[k])))
            if float(np.max(gains[least])) > _KEPT:
                break
            widths = {k: float(linear.groups[k].widths[np.argmax(g)]) for k, g in gains.items()}
            del widths[least]
        return frozenset(widths) | (start & self.stood)

    def best(self, count: int) -> list[Key]:
        """The best hypotheses met so far, at most WITHIN worse than the best of all."""
        scores = self.seen
        order = ranked(scores)
        return [k for k in order if scores[k] >= scores[order[0]] - WITHIN][:count]


def ranked(scores: Mapping[Key, float]) -> list[Key]:
    """Hypotheses, the best first."""
    return sorted(scores, key=lambda k: (-scores[k], sorted(k)))
