"""The search for missing effects, by evidence, with a few models in parallel.

Effects are added one at a time to a few models in parallel. If two effects are missing, the single
effect that explains most is often a large group that blurs both, and the way to the right pair
leads through a smaller effect that explains less. Every candidate is fitted in full. The search
ends with a model that leaves noise, after ``MOST_EFFECTS``, or when the next effect removes little
of the remainder. Then effects that became unnecessary are dropped, and the others are sorted by how
much they gain.

The code consists of functions of immutable nodes: exploring a node gives a new node, and the models
that were met are a mapping from the names of their effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.sets.equals import SMALL
from crosscheck.diagnosis.node import (
    LEAST_GAIN,
    LEAST_PART,
    Fits,
    Names,
    Node,
    children_of,
    explored,
    node_of,
)
from crosscheck.diagnosis.order import Step, fitted_to_the_end, in_order, without_needless
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.preparation.prepare import Progress
from seecr.effects import catalogue
from seecr.pose import Array

MOST_EFFECTS = 4
# Models that go on in parallel after the first round, and least number of them.
_ABREAST, _LARGE = 4, 2
# How many of the best models are fitted again, how often, and how far from their values, in
# plausible sizes.
_AGAIN, _TIMES, _AWAY = 2, 4, 0.2
_AGAIN_ITERATIONS = 12
# Largest number of parameters of a medium model, of which one goes on.
_MEDIUM = 8

Seen = Mapping[Names, Node]


@dataclass(frozen=True, eq=False)
class Search:
    """The steps of a search.

    Attributes:
        trials: the problem, its noise, and how effects were tried.
        steps: from the model as it stood to the last one.
        fits: fits of all candidates.
    """

    trials: Trials
    steps: tuple[Step, ...]
    fits: Fits

    @property
    def problem(self) -> Problem:
        """The data."""
        return self.trials.problem

    @property
    def factor(self) -> Array:
        """Noise factors of all fits."""
        return self.trials.factor

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects that the model had before."""
        return self.steps[0].fit.terms.names

    @property
    def tried(self) -> int:
        """How many effects were tried beside the model as it stood."""
        return self.steps[0].tried

    @property
    def last(self) -> Step:
        """The step that the search ended with."""
        return self.steps[-1]

    @property
    def found(self) -> tuple[str, ...]:
        """Effects that were added, in their order."""
        return tuple(step.added for step in self.steps[1:])


def search(trials: Trials, base: Fit, progress: Progress = lambda _text, _part: None) -> Search:
    """Add effects to the base model until the residuals are noise or nothing helps.

    Args:
        trials: the problem, its noise, and how effects are tried.
        base: the model as it stands.
        progress: called with what is being done and the fraction that is done.
    """
    root = node_of(trials, base)
    best, seen = _climbed(trials, root, progress)
    last = best if best is root else fitted_to_the_end(trials, best)
    last = without_needless(trials, last, base.terms.names)
    steps = in_order(trials, seen[root.names], last, seen)
    fits = {key: fit for node in seen.values() for key, fit in node.fits.items()}
    return Search(trials, steps, fits)


def _climbed(trials: Trials, root: Node, progress: Progress) -> tuple[Node, Seen]:
    """The best model, and all models that were met, by their effects."""
    best, abreast = root, [root]
    seen: Seen = {root.names: root}
    for depth in range(MOST_EFFECTS):
        children, seen = _grown(trials, abreast, seen, depth, progress)
        better = [c for c in children if c.evidence.log > best.evidence.log + LEAST_GAIN]
        if depth == 0 and not any(c.whiteness.is_noise for c in better):
            better = _from_nearby(trials, better, progress)
            seen = {**seen, **{node.names: node for node in better}}
        top = _next_best(better, best)
        if top is None:
            break
        best = top
        wide = [] if top.whiteness.is_noise else _diverse(better, root)
        abreast = (wide or [top])[: _ABREAST if depth == 0 else 1]
    return best, seen


def _next_best(better: Sequence[Node], best: Node) -> Node | None:
    """The model to go on from; None if the best one removes too little to be the cause."""
    noise = [c for c in better if c.whiteness.is_noise]
    if not better:
        return None
    top = max(noise or better, key=_standing)
    return top if noise or top.excess <= (1.0 - LEAST_PART) * best.excess else None


def _grown(
    trials: Trials, abreast: Sequence[Node], seen: Seen, depth: int, progress: Progress
) -> tuple[list[Node], Seen]:
    """New models with one more effect, and all models met so far, these included."""
    children = []
    for k, node in enumerate(abreast):

        def tell(text: str, part: float, before: int = k) -> None:
            # the number of rounds is not known: each takes half of what is left of the bar
            share = 1.0 - 0.5**depth * (1.0 - 0.5 * (before + part) / len(abreast))
            progress(f"round {depth + 1}: {text}", share)

        node = explored(trials, node, depth == 0, tell)
        seen = {**seen, node.names: node}
        for child in children_of(trials, node):
            other = seen.get(child.names)
            if other is None or child.evidence.log > other.evidence.log:
                seen = {**seen, child.names: child}
                children.append(child)
    return children, seen


def _from_nearby(trials: Trials, nodes: Sequence[Node], progress: Progress) -> list[Node]:
    """Refit the best few models from nearby values, because slack cables make local minima."""
    ranked = sorted(nodes, key=lambda c: -c.evidence.log)
    rng = np.random.default_rng(0)
    again = []
    for node in ranked[:_AGAIN]:
        best = node.fit
        for _ in range(_TIMES):
            terms = best.terms
            away = np.where(terms.knowledge.fixed, 0.0, rng.normal(size=len(terms)))
            values = terms.vector + _AWAY * terms.scale * away
            near = terms.with_vector(np.clip(values, terms.lower, terms.upper))
            progress("fitting again from nearby values", 0.5)
            found = trials.refit(near, best.state, iterations=_AGAIN_ITERATIONS, quick=True)
            if found.valid and found.chi2 < best.chi2:
                best = found
        again.append(node if best is node.fit else node_of(trials, best))
    return [*ranked[_AGAIN:], *again]


def _standing(node: Node) -> tuple[float, int]:
    """Sort key of models: evidence, minus 0.1 for each parameter so that the smaller wins a tie.

    Of models that are exactly equivalent (exit and anchor points of a platform that cannot turn),
    the one that comes first in the catalogue wins, and not the one that rounding prefers.
    """
    place = {name: i for i, name in enumerate(catalogue())}
    log = node.evidence.log - 0.1 * len(node.fit.at_bound)
    return round(log, 1), -sum(place.get(name, len(place)) for name in node.names)


def _diverse(nodes: Sequence[Node], root: Node) -> list[Node]:
    """A few models to go on from: the best one, and the best small ones that explain much."""
    ranked = sorted(nodes, key=lambda c: -c.evidence.log)
    enough = (1.0 - LEAST_PART) * root.excess
    out = ranked[:1]
    for most, count in ((SMALL, 2), (_MEDIUM, 1)):
        small = [c for c in ranked if len(c.fit.terms) <= most and c.excess < enough]
        out += [c for c in small if c not in out][:count]
    others = [c for c in ranked if c not in out and c.excess < enough]
    return out + others[: max(0, _LARGE - len(out))]
