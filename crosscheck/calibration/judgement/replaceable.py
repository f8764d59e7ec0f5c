"""In a large set, whether other effects explain as much without one that seems sure.

The prior of a set charges every effect that it has. Three effects that do together what one does
are improbable by that if few effects are missing, but not in a robot all of whose tolerances are a
little off: a heavier platform, off its centre and tilted, is no force from outside. So an effect
that is sure by its probability is excluded, with its equivalents, and the best sets without it are
fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from crosscheck.calibration.judgement.probability import Classes
from crosscheck.calibration.sets.challenge import excluding
from crosscheck.calibration.sets.equals import BY_CHANCE, are_equals
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names, explore
from crosscheck.calibration.sets.refits import ComparedSets

# Moves of the search without an effect, the sets that are fitted then, and how many times.
_MOVES, _EACH, _ROUNDS = 6, 2, 3


@dataclass(eq=False)
class Replaced:
    """What was found without effects that seem sure.

    Attributes:
        found: the sets compared before. size: number of parameters of an effect.
        can_be: whether a robot can have the values of a fit.
        scores: of the sets that were fitted.
        replaceable: the effects without which others explain as much.
    """

    found: ComparedSets
    size: Callable[[str], int]
    can_be: Callable[[Refit], bool]
    scores: dict[Names, float] = field(default_factory=dict)
    replaceable: set[str] = field(default_factory=set)

    def try_without(self, sure: Iterable[str], classes: Classes) -> None:
        """Exclude each of these members of the best set in turn."""
        best = self.found.best.names
        for name in sure:
            members = classes.alike(name)
            barred = frozenset(members) - (best - {name})
            for _ in range(_ROUNDS):
                equals = self._fitted_without(name, barred)
                if not equals:
                    break
                barred |= equals
            if any(not names & barred and self._as_much(s) for names, s in self._all()):
                self.replaceable.add(name)

    def _fitted_without(self, name: str, barred: Names) -> Names:
        """Fit the best sets without some effects, and return those that equal the excluded one."""
        own, best = self.found.best, self.found.best.names
        scores = excluding(self.found.scores, barred)
        explore(scores, [best - barred], _MOVES)
        least = self.found.scores.score(best) - BY_CHANCE
        some = [names for names in scores.best(_EACH, BY_CHANCE) if scores.score(names) > least]
        equals = set[str]()
        for names in some:
            self._fit(names)
            for other in sorted(names - best):
                loss = own.score - self._fit((best - {name}) | {other})
                if are_equals(loss, self.size(name), self.size(other)):
                    equals.add(other)
        return frozenset(equals)

    def _fit(self, names: Names) -> float:
        """Score of a set; -inf if it has no solution that a robot can have."""
        if names not in self.scores:
            refit = self.found.refit(names)
            if refit is None or not self.can_be(refit):
                return -float("inf")
            self.scores[names] = refit.score
        return self.scores[names]

    def _as_much(self, score: float) -> bool:
        return score > self.found.best.score - BY_CHANCE

    def _all(self) -> list[tuple[Names, float]]:
        before = {names: refit.score for names, refit in self.found.refits.items()}
        return list((before | self.scores).items())
