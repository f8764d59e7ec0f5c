"""Looks back on a search: drops effects that became unnecessary, sorts the rest by their gain."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from crosscheck.diagnosis.node import LEAST_GAIN, Names, Node, hopeless, node_of
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.held_out import HeldOut, hold_out, pays, unfitted
from crosscheck.fit.reasons import Reason, Why
from seecr.effects import Terms

# Gauss-Newton steps for an intermediate model that the search did not meet.
_ITERATIONS = 8


@dataclass(frozen=True, eq=False, kw_only=True)
class Step(Node):
    """An intermediate model, with the candidates tried beside it, and how well it does.

    Attributes:
        added: name of the effect that was added last, "" for the start.
        held_out: its errors on held-out runs.
    """

    added: str
    held_out: HeldOut

    @property
    def tried(self) -> int:
        """How many effects were tried beside it."""
        return sum(1 for c in self.candidates if c.fit is not None or c.drop)


def step_of(trials: Trials, added: str, node: Node) -> Step:
    """A node with its errors on held-out runs."""
    if added:
        held = hold_out(trials.problem, node.fit, trials.factor, trials.fit)
    else:
        held = unfitted(trials.problem, node.fit)
    model = node.fit, node.evidence, node.whiteness, node.candidates
    return Step(*model, added=added, held_out=held)


def fitted_to_the_end(trials: Trials, node: Node) -> Node:
    """The node with its model fitted to convergence, because trials stop early."""
    if not node.fit.terms:
        return node
    full = trials.refit(node.fit.terms, node.fit.state)
    return node_of(trials, full) if full.valid else node


def without_needless(trials: Trials, node: Node, held: Collection[str]) -> Node:
    """The node without effects that are not worth their evidence; those in ``held`` stay."""
    own = [name for name in node.fit.terms.names if name not in held]
    if len(own) < 2:
        return node
    far = hopeless(node.fit.chi2, node.fit.chi2)
    for name in own:
        rest = node.fit.terms.without(name)
        shorter = trials.refit(rest, node.fit.state, hopeless=far)
        if not shorter.valid or shorter.chi2 > far:
            continue
        other = node_of(trials, shorter)
        if other.evidence.log > node.evidence.log - LEAST_GAIN:
            return without_needless(trials, other, held)
    return node


def in_order(
    trials: Trials, root: Node, last: Node, seen: Mapping[Names, Node]
) -> tuple[Step, ...]:
    """Steps from the start to the last model, each adding the effect that gains most.

    Each step has to predict held-out runs better than the one before. An effect that only does so
    together with the next one (because alone it extrapolates wildly, say) waits for that.
    """
    steps, waiting = [step_of(trials, "", root)], list[Step]()
    terms = root.fit.terms
    todo = [name for name in last.fit.terms.names if name not in terms]
    while todo:
        tried = []
        for name, node in _options(trials, terms, todo, last, seen):
            tried.append(step_of(trials, name, node))
            if pays(steps[-1].held_out, tried[-1].held_out):
                chosen = tried[-1]
                steps, waiting = [*steps, *waiting, chosen], []
                break
        else:
            if not tried:
                break
            chosen = tried[0]
            waiting.append(chosen)
        terms = chosen.fit.terms
        todo = [name for name in todo if name != chosen.added]
    return (_blamed(steps[0], [step.added for step in waiting]), *steps[1:])


def _options(
    trials: Trials, terms: Terms, todo: Sequence[str], last: Node, seen: Mapping[Names, Node]
) -> list[tuple[str, Node]]:
    """The present model with each of the effects that are still to come, the best fit first."""
    out = []
    for name in todo:
        names = frozenset((*terms.names, name))
        met = seen.get(names)
        if len(todo) == 1:
            node = last
        elif met is not None:
            node = met
        else:
            some = last.fit.terms.only(names)
            found = trials.refit(some, last.fit.state, iterations=_ITERATIONS)
            if not found.valid:
                continue
            node = node_of(trials, found)
        out.append((name, node if met is None else replace(node, candidates=met.candidates)))
    return sorted(out, key=lambda option: option[1].fit.chi2)


def _blamed(first: Step, names: Collection[str]) -> Step:
    """The first step, with the reason why some effects that were found are not listed after all."""
    reason = Reason(Why.NOT_PREDICTIVE)
    candidates = tuple(
        c.refused(reason) if c.name in names and c.why_not is None else c for c in first.candidates
    )
    return replace(first, candidates=candidates)
