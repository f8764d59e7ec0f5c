"""A model of the search, and the trials of every further effect beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.sets.equals import SMALL
from crosscheck.fit.effects.candidates import Candidate, Trials, fit_candidate, screen
from crosscheck.fit.effects.evidence import FALSE_ALARM, Evidence
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.noise.whiteness import Whiteness
from crosscheck.fit.preparation.prepare import Progress
from crosscheck.fit.reasons import Reason, Why
from seecr.processes import Shared, shared_out

# Least gain in ln evidence for one more effect (odds of 20:1).
LEAST_GAIN = 3.0
# An effect that removes less than this part of what noise does not explain is not the cause.
LEAST_PART = 0.25
# After the first round, how many candidates are fitted beside a model, and how many of them small.
_FITTED, _FITTED_SMALL = 7, 2
# Largest p-value of the fall of chi2 that the derivatives promise for an effect to be fitted:
# beside a model that leaves noise, and beside one that leaves more.
_PRUNE_NOISE, _PRUNE_OTHER = 0.02, 0.3

Names = frozenset[str]
# Fits of candidates, by the effects that they were tried beside and their own name.
Fits = Mapping[tuple[Names, str], Fit]


@dataclass(frozen=True, eq=False)
class Node:
    """A model of the search.

    Attributes:
        fit, evidence, whiteness: the fit of the model, its evidence, the test of its residuals.
        candidates: further effects that were tried beside it; none before it was explored.
    """

    fit: Fit
    evidence: Evidence
    whiteness: Whiteness
    candidates: tuple[Candidate, ...] = ()

    @property
    def names(self) -> Names:
        """Names of the model's effects."""
        return frozenset(self.fit.terms.names)

    @property
    def excess(self) -> float:
        """The part of chi2 that noise does not explain."""
        return max(self.whiteness.chi2 - self.whiteness.dof, 1e-9)

    @property
    def fits(self) -> Fits:
        """The fits of its candidates."""
        return {(self.names, c.name): c.fit for c in self.candidates if c.fit is not None}


def node_of(trials: Trials, found: Fit) -> Node:
    """A fit with its evidence and the test of its residuals."""
    evidence = trials.evidence(found)
    return Node(found, evidence, trials.whiteness(found, evidence.parameters))


def explored(trials: Trials, node: Node, all_: bool, progress: Progress) -> Node:
    """The node after every effect was tried that it does not have.

    Args:
        trials: how effects are tried.
        node: a model.
        all_: whether to fit all candidates that promise something, or only the best of them.
        progress: called with what is being done and the fraction that is done.
    """
    refused, promising = _screened(trials, node, lambda text, part: progress(text, 0.5 * part))
    chosen = promising if all_ else _most_promising(promising)
    tried = _fitted(
        trials, node, promising, chosen, lambda text, part: progress(text, 0.5 + 0.5 * part)
    )
    return replace(node, candidates=_judged(node, (*refused, *tried)))


def _screened(
    trials: Trials, node: Node, progress: Progress
) -> tuple[list[Candidate], list[Candidate]]:
    """Effects that are not worth a fit, with the reason; and the others, by their promise."""
    prune = _PRUNE_NOISE if node.whiteness.is_noise else _PRUNE_OTHER
    todo = [c for c in trials.candidates(trials.problem) if c.name not in node.names]

    def screened(c: Candidate) -> Candidate:
        if c.why_not is None:
            c = screen(trials, node.fit, c.layout)
        return c.refused(Reason(Why.CHANCE, p=c.p)) if c.why_not is None and c.p > prune else c

    out = shared_out(
        screened, todo, lambda: Shared(trials, node, todo), _told(progress, "trying", len(todo))
    )
    promising = sorted((c for c in out if c.why_not is None), key=lambda c: -_promise(c))
    return [c for c in out if c.why_not is not None], promising


def _told(progress: Progress, doing: str, count: int) -> Callable[[Candidate], None]:
    """Progress by the number of candidates that were begun."""
    begun = iter(range(count))
    return lambda c: progress(f"{doing} {c.name}", next(begun) / count)


def _promise(c: Candidate) -> float:
    """Rough linear estimate of the gain in ln evidence: each direction costs three."""
    directions = c.starts.directions if c.starts is not None else 1
    return 0.5 * c.drop - 3.0 * directions


def _most_promising(ranked: Sequence[Candidate]) -> list[Candidate]:
    """A few candidates to fit: the most promising ones, and the most promising small ones.

    Large groups promise more than any small effect beside them, whether or not they are present.
    """
    first = list(ranked[: _FITTED - _FITTED_SMALL])
    small = [c for c in ranked if len(c.layout) <= SMALL and c not in first][:_FITTED_SMALL]
    rest = [c for c in ranked if c not in first and c not in small]
    return [*first, *small, *rest[: _FITTED - len(first) - len(small)]]


def _fitted(
    trials: Trials,
    node: Node,
    promising: Sequence[Candidate],
    chosen: Sequence[Candidate],
    progress: Progress,
) -> list[Candidate]:
    """All promising candidates in their order: the chosen ones fitted, the others refused."""
    first, others = list(chosen[:1]), list(chosen[1:])
    told = _told(progress, "fitting", len(chosen))

    def fits(some: Sequence[Candidate], best: float) -> list[Candidate]:
        limit = hopeless(node.fit.chi2, best)
        return shared_out(
            lambda c: fit_candidate(trials, node.fit, c, limit), some,
            lambda: Shared(trials, node, some), told,
        )  # fmt: skip

    tried = fits(first, np.inf)
    best = min((c.fit.chi2 for c in tried if c.fit is not None), default=np.inf)
    tried += fits(others, best)
    by_name = {c.name: c for c in tried}
    refused = Reason(Why.PROMISES_LESS)
    return [by_name[c.name] if c.name in by_name else c.refused(refused) for c in promising]


def hopeless(without: float, best: float) -> float:
    """chi2 above which a trial is given up, given that of the model without and the best so far."""
    limit = 4.0 * best + 0.02 * without
    if best < (1.0 - LEAST_PART) * without:
        # if one effect explains much, the search never goes on from one that explains little
        limit = min(limit, (1.0 - LEAST_PART) * without)
    return limit


def _judged(node: Node, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Candidates with the reason why they are not added, if there is one."""
    count = sum(1 for c in candidates if c.fit is not None or c.drop > 0)

    def reason(c: Candidate) -> Reason | None:
        if c.fit is None or c.evidence is None or c.why_not is not None:
            return c.why_not
        if c.p * count > FALSE_ALARM:
            return Reason(Why.CHANCE_OVER_ALL, p=c.p * count)
        if c.evidence.log - node.evidence.log < LEAST_GAIN:
            return Reason(Why.EXPLAINS_LITTLE, parameters=len(c.layout))
        return None

    return tuple(replace(c, why_not=reason(c)) for c in candidates)


def children_of(trials: Trials, node: Node) -> list[Node]:
    """The models with one more effect that are worth going on from, beside an explored node."""
    chosen = (c for c in node.candidates if c.why_not is None)
    return [node_of(trials, c.fit) for c in chosen if c.fit is not None]
