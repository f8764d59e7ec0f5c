"""Exchanges effects that a search ended with for others that the probabilities prefer.

The search adds one effect at a time: what imitates two effects together is added first, and leaves
nothing for the second. Probabilities compare whole sets, and the set they prefer is fitted here.
Of two effects that explained the same when one was added, the other may explain more in the end.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from crosscheck.calibration.judgement.verdict import SURE
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.node import Node, node_of
from crosscheck.diagnosis.order import fitted_to_the_end, in_order
from crosscheck.diagnosis.rivals import Rival
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.candidates import try_candidate
from crosscheck.fit.effects.possible import can_be

IMPROBABLE = 0.5
"""An effect found by the search that is less probable than this may stand in for others."""


def exchanged(found: Search, chances: Chances) -> Search:
    """The search, or one that ends with other effects if these fit better.

    Args:
        found: a search that ended with noise.
        chances: probabilities about its last model.
    """
    gone = [name for name in found.found if chances.of(name) < IMPROBABLE]
    inside = set(found.last.fit.terms.names)
    come = [m[0] for m, p in chances.classes if p > SURE and not inside & set(m)]
    if not gone or not come:
        return found
    node = _fitted(found, gone, come)
    if node is None or not node.whiteness.is_noise:
        return found
    if node.evidence.log <= found.last.evidence.log:
        return found
    return replace(found, steps=in_order(found.trials, found.steps[0], node, {}))


def replaced(found: Search, rivals: Iterable[Rival]) -> Search:
    """The search with an effect replaced by the rival that explains most more in its place.

    It stays as it is if no rival does, or if what does leaves structure or is impossible.

    Args:
        found: a search that ended with noise.
        rivals: effects fitted in place of one that was found.
    """
    stood = found.steps[0].fit.terms
    for rival in sorted(rivals, key=lambda r: r.loss):
        if not rival.is_better:
            break
        node = fitted_to_the_end(found.trials, node_of(found.trials, rival.fit))
        better = node.evidence.log > found.last.evidence.log and node.whiteness.is_noise
        if better and can_be(found.problem.robot, node.fit.terms, stood):
            return replace(found, steps=in_order(found.trials, found.steps[0], node, {}))
    return found


def _fitted(found: Search, gone: list[str], come: list[str]) -> Node | None:
    """The last model with some effects exchanged for others; None if that cannot be fitted."""
    trials, terms = found.trials, found.last.fit.terms
    layouts = {c.name: c.layout for c in trials.candidates(trials.problem) if c.why_not is None}
    kept = terms.only([name for name in terms.names if name not in gone])
    fit = trials.refit(kept, found.last.fit.state)
    for name in come:
        if name not in layouts or not fit.valid:
            return None
        tried = try_candidate(trials, fit, layouts[name])
        if tried.fit is None:
            return None
        fit = tried.fit
    return fitted_to_the_end(trials, node_of(trials, fit))
