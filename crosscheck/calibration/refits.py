"""Sets of effects fitted in earnest, and the search that goes between linear and exact.

Linear evidence alone can be confidently wrong: cables go slack, products of parameters bend. So
the best sets by linear evidence are refitted exactly, the empty one always among them, and the
catalogue is made linear about the best of them again, until that stays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from crosscheck.calibration.catalogue import Catalogue, gram_about, widths_for
from crosscheck.calibration.gram import Gram, averaged, best_widths, gram_of
from crosscheck.calibration.joint import JointFit, Setting, settle
from crosscheck.calibration.later import inside, promising_beside
from crosscheck.calibration.linearised import groups_of, linearised
from crosscheck.calibration.priors import SHAPES
from crosscheck.calibration.sets import Names, Scores, explore
from crosscheck.fit.possible import can_be
from crosscheck.fit.state import State, evaluate
from seecr.effects import Term, Terms
from seecr.pose import Array

# Sets refitted about one linear model, and how much worse than the best they may be.
_REFITTED, _WITHIN = 20, 12.0
# Rounds of making the catalogue linear about the best set.
ROUNDS = 4
_STEPS = 12
# A refit this much worse than its linear evidence may have ended in a hollow: it starts again.
_HOLLOW = 8.0
# Sets up to this size are tried from more starts, and without each of their members.
_FEW = 5


@dataclass(frozen=True, eq=False)
class Refit:
    """A set of effects, fitted exactly.

    Attributes:
        names: the set. joint: its fit.
        widths: prior width of each member.
        score: ln evidence and ln prior.
    """

    names: Names
    joint: JointFit
    widths: dict[str, float]
    score: float


@dataclass(frozen=True, eq=False)
class Found:
    """Sets that were compared.

    Attributes:
        refits: exact ones, by set. best: the best of them.
        scores: linear ones about the best.
        refit: fits any set exactly, also one that was not compared; None where that has no
            solution.
        always: effects that the model has, in every set: the smallest set there is.
    """

    refits: dict[Names, Refit]
    best: Refit
    scores: Scores
    refit: Callable[[Names], Refit | None]
    always: Names = frozenset()

    @property
    def none(self) -> Refit:
        """Nothing added."""
        return self.refits[self.always]


def compare_sets(
    setting: Setting,
    joint: JointFit,
    catalogue: Catalogue,
    plain: State,
    told: Callable[[str], None] = lambda _text: None,
    most: int = _REFITTED,
    rounds: int = ROUNDS,
    given: Iterable[Terms] = (),
) -> Found:
    """Search the sets of effects, linear and exact in turn.

    Args:
        setting: the data; noise and weights of the joint fit stay for all sets.
        joint: everything fitted together, about which the first linear model is.
        catalogue: effects that may be in a set.
        plain: the model as it stands; its effects are in every set.
        told: called with what is going on.
        most: sets to refit about one linear model.
        rounds: of making the catalogue linear about the best set, at most.
        given: sets that were found elsewhere, with the values that they have there.
    """
    always = frozenset(plain.terms.names)
    of = len(set(catalogue.names) - always)
    fixed = replace(setting, frozen=True, weight=joint.weight)
    known = {frozenset(terms.names): terms for terms in given}
    exact = _Exact(fixed, joint, catalogue, plain, told, known)
    scores = Scores(gram_about(fixed, joint, catalogue), of, always)
    begin, best = frozenset(scores.gram.names) | always, exact.best_of(scores, [always, *known])
    for k in range(rounds):
        before, best = best.names, exact.searched(scores, begin, most)
        if k and before == best.names:
            break
        begin = best.names
        scores = Scores(gram_about(fixed, best.joint, catalogue), of, always)
    other = exact.swapped(scores, best)
    if other.names != best.names:
        scores = Scores(gram_about(fixed, other.joint, catalogue), of, always)
        best = exact.searched(scores, other.names, most)
    return Found(exact.possible, best, scores, lambda names: exact.fit(scores, names), always)


@dataclass(eq=False)
class _Exact:
    """Sets fitted exactly, each once.

    Attributes:
        setting, joint, catalogue, plain, told: as for :func:`compare_sets`.
        given: values that sets have elsewhere.
        fitted: by set; None where it could not be solved.
    """

    setting: Setting
    joint: JointFit
    catalogue: Catalogue
    plain: State
    told: Callable[[str], None]
    given: Mapping[Names, Terms] = field(default_factory=dict)
    fitted: dict[Names, Refit | None] = field(default_factory=dict)

    @property
    def possible(self) -> dict[Names, Refit]:
        """Those with values that a robot can have (no negative mass); the model as it stands."""
        always = frozenset(self.plain.terms.names)
        return {
            names: found
            for names, found in self.fitted.items()
            if found is not None and (names == always or self.can_be(found))
        }

    def can_be(self, found: Refit) -> bool:
        """Whether a robot can have all these values."""
        return can_be(self.setting.problem.robot, found.joint.terms, self.plain.terms)

    def searched(self, scores: Scores, begin: Names, most: int) -> Refit:
        """The best that linear evidence leads to, from no effect and from these."""
        explore(scores, [scores.always, begin])
        best = self.best_of(scores, [scores.always, *scores.best(most, _WITHIN)])
        return self.thinned(scores, best)

    def best_of(self, scores: Scores, some: Iterable[Names]) -> Refit:
        """The best of all that are fitted, these among them."""
        for names in some:
            self.fit(scores, names)
        return max(self.possible.values(), key=lambda r: r.score)

    def thinned(self, scores: Scores, best: Refit) -> Refit:
        """The best set, each of its members dropped in earnest, until none is one too many."""
        while len(own := best.names - scores.always) <= _FEW:
            better = self.best_of(scores, [best.names - {name} for name in sorted(own)])
            if better.names == best.names:
                break
            best = better
        return best

    def swapped(self, scores: Scores, best: Refit) -> Refit:
        """The best set, members exchanged for effects with a shape that promise about as much.

        The linear model has them at one shape (a reference temperature, a time), which need not
        be the one that explains what such a member does.
        """
        own = best.names - scores.always
        shaped = [t.layout for t in self.catalogue.later if t.layout.shape.any()]
        for name in sorted(own) if len(own) <= _FEW else ():
            rest = self.fit(scores, best.names - {name})
            if rest is None:
                continue
            least = best.score - rest.score - _HOLLOW
            absent = [layout for layout in shaped if layout.name not in best.names]
            for term, gain in promising_beside(self.setting, rest.joint, absent):
                if gain > max(least, 0.0):
                    self.told(" + ".join(sorted(rest.names | {term.name})))
                    self.take(scores, Terms([*rest.joint.terms, inside(term)]))
        return self.best_of(scores, [])

    def take(self, scores: Scores, start: Terms) -> None:
        """Fit a set from these values, and keep that if it is better than what there is.

        What no robot can have is not, whatever it explains: the set would not be compared.
        """
        names = frozenset(start.names)
        # the linear model may hold at nothing what means something from here on only
        wide = {name: max(width, 1.0) for name, width in scores.widths(names).items()}
        found = [self.fitted.get(names), self._from(scores, names, start, wide)]
        fitted = [refit for refit in found if refit is not None]
        self.fitted[names] = max(
            fitted, key=lambda refit: (self.can_be(refit), refit.score), default=None
        )

    def fit(self, scores: Scores, names: Names) -> Refit | None:
        """A set fitted exactly; None where that has no solution."""
        if names not in self.fitted:
            self.told(" + ".join(sorted(names)) or "none")
            self._fit(scores, names)
        return self.fitted[names]

    def _fit(self, scores: Scores, names: Names) -> None:
        """From its linear values, those given, and from null where that ends badly."""
        linear, widths = scores.score(names), scores.widths(names)
        best = self._from(scores, names, _linear_terms(self.catalogue, scores, names), widths)
        self.fitted[names] = best
        if names in self.given:
            self.take(scores, self.given[names])
        few = 0 < len(names - scores.always) <= _FEW
        if few and (best is None or best.score < linear - _HOLLOW):
            self.take(scores, Terms(_inside(self.catalogue.start(name)) for name in names))

    def _from(
        self, scores: Scores, names: Names, start: Terms, widths: dict[str, float]
    ) -> Refit | None:
        state = evaluate(self.setting.problem, start, self.setting.factor, self.plain)
        if not state.valid:
            return None
        found = settle(self.setting, state, _width(start, widths), self.joint.colour, _STEPS)
        return _scored(self.setting, found, names, widths, scores)


def _linear_terms(catalogue: Catalogue, scores: Scores, names: Names) -> Terms:
    """The set at the values of the linear model."""
    solved = scores.gram.solved(scores.widths(names))
    out, first = [], 0
    for name in solved.chosen:
        term = catalogue.start(name)
        layout, start = term.layout, term.vector
        count = len(scores.gram.groups[name].columns)
        own = np.flatnonzero(~layout.shape & ~term.knowledge.fixed)
        if count < len(own):  # the others start where they are
            own = own[start[own] == layout.null[own]]
        vector = start.copy()
        vector[own] = layout.null[own] + solved.values[first : first + count] * layout.scale[own]
        out.append(_inside(term.with_vector(np.clip(vector, layout.lower, layout.upper))))
        first += count
    return Terms([*out, *(catalogue.start(name) for name in names if name not in solved.chosen)])


def _inside(term: Term) -> Term:
    """Off a bound at null, where a law with history has a derivative on both sides."""
    layout = term.layout
    pressed = (term.vector <= layout.lower) & ~layout.shape & ~term.knowledge.fixed
    return term.with_vector(np.where(pressed, term.vector + 0.03 * layout.scale, term.vector))


def _width(terms: Terms, widths: dict[str, float]) -> Array:
    parts = [np.where(t.layout.shape, SHAPES, widths.get(t.name, 1.0)) for t in terms]
    return np.where(terms.knowledge.fixed, 0.0, np.concatenate([np.zeros(0), *parts]))


def _scored(
    setting: Setting, joint: JointFit, names: Names, widths: dict[str, float], scores: Scores
) -> Refit:
    """A fit with its evidence about its own optimum, averaged over widths."""
    gram = own_gram(setting, joint)
    inside = {n: widths[n] for n in gram.names}
    better = best_widths(gram, inside)
    score = averaged(gram, better) + scores.log_prior(names)
    return Refit(names, joint, widths | better, score - 0.5 * joint.state.log_det)


def own_gram(setting: Setting, joint: JointFit) -> Gram:
    """Normal equations of a fit's own effects about its optimum; those on a bound are absent."""
    groups = groups_of(joint, widths_for)
    linear = linearised(setting, joint)
    z = np.zeros(len(joint.z))
    for group in groups.values():
        z[group.columns] = joint.z[group.columns]
    # shapes stay as they are: only amplitudes are explained
    y = linear.y - linear.x @ (joint.z - z)
    return gram_of(linear.x, y, groups)
