"""A model of the search, and what comes of trying every further effect beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.equals import SMALL
from crosscheck.fit.candidates import Candidate, Trials, fit_candidate, screen
from crosscheck.fit.evidence import FALSE_ALARM, Evidence
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.noise import Whiteness
from crosscheck.fit.prepare import Progress
from crosscheck.fit.reasons import Reason, Why

# Least gain in log evidence for one more effect (20:1).
LEAST_GAIN = 3.0
# An effect that takes away less than this part of what noise does not explain is no cause.
LEAST_PART = 0.25
# Candidates fitted beside a model after the first round, and small ones among them.
_FITTED, _FITTED_SMALL = 7, 2
# Beside a model that leaves noise, an effect is only fitted if chance explains what its
# derivative promises with less than this; beside others it must be very likely chance.
_PRUNE_NOISE, _PRUNE_OTHER = 0.02, 0.3

Names = frozenset[str]
# Fits of candidates by (effects beside it, its name).
Fits = Mapping[tuple[Names, str], Fit]


@dataclass(frozen=True, eq=False)
class Node:
    """A model of the search.

    Attributes:
        fit, evidence, whiteness: of the model.
        candidates: what trying further effects gave; none before it was explored.
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
        """What noise does not explain, of chi2."""
        return max(self.whiteness.chi2 - self.whiteness.dof, 1e-9)

    @property
    def fits(self) -> Fits:
        """The fits of its candidates."""
        return {(self.names, c.name): c.fit for c in self.candidates if c.fit is not None}


def node_of(trials: Trials, found: Fit) -> Node:
    """A fit with its evidence and the test of what it leaves."""
    evidence = trials.evidence(found)
    return Node(found, evidence, trials.whiteness(found, evidence.parameters))


def explored(trials: Trials, node: Node, all_: bool, progress: Progress) -> Node:
    """The node with every effect tried that it does not have.

    Args:
        trials: how effects are tried.
        node: a model.
        all_: whether all that promise something are fitted, or only those that promise most.
        progress: called with what is being done and its share.
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
    """Effects that are not worth a fit, with the reason; and the others, the best first."""
    prune = _PRUNE_NOISE if node.whiteness.is_noise else _PRUNE_OTHER
    todo = [c for c in trials.candidates(trials.problem) if c.name not in node.names]
    out = []
    for k, c in enumerate(todo):
        progress(f"looking at {c.name}", k / len(todo))
        if c.why_not is None:
            c = screen(trials, node.fit, c.layout)
        if c.why_not is None and c.p > prune:
            c = c.refused(Reason(Why.CHANCE, p=c.p))
        out.append(c)
    promising = sorted((c for c in out if c.why_not is None), key=lambda c: -_promise(c))
    return [c for c in out if c.why_not is not None], promising


def _promise(c: Candidate) -> float:
    """Linearised gain in evidence, roughly: three for each direction."""
    directions = c.starts.directions if c.starts is not None else 1
    return 0.5 * c.drop - 3.0 * directions


def _most_promising(ranked: Sequence[Candidate]) -> list[Candidate]:
    """A few candidates to fit: those that promise most, and the small ones that do.

    Large groups promise more than any small effect beside them, true or not.
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
    """The chosen candidates fitted, the others refused, in the same order."""
    best, out = np.inf, []
    for k, c in enumerate(promising):
        if c not in chosen:
            out.append(c.refused(Reason(Why.PROMISES_LESS)))
            continue
        progress(f"fitting {c.name}", k / len(promising))
        tried = fit_candidate(trials, node.fit, c, hopeless(node.fit.chi2, best))
        best = min(best, np.inf if tried.fit is None else tried.fit.chi2)
        out.append(tried)
    return out


def hopeless(without: float, best: float) -> float:
    """The chi2 above which a trial is given up: of the model without, of the best so far."""
    limit = 4.0 * best + 0.02 * without
    if best < (1.0 - LEAST_PART) * without:
        # nobody goes on from what explains little where another explains much
        limit = min(limit, (1.0 - LEAST_PART) * without)
    return limit


def _judged(node: Node, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Each candidate with the reason why it is not to be added, if there is one."""
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
    """Models with one effect more that an explored node says are worth it."""
    chosen = (c for c in node.candidates if c.why_not is None)
    return [node_of(trials, c.fit) for c in chosen if c.fit is not None]
