"""The search for missing effects: by evidence, a few models abreast, judged on runs left out.

One effect is added at a time, to a few models abreast: where two effects are missing, the single
effect that explains most is often a large group that blurs both, and the way to the truth leads
through a smaller one that explains less. Every candidate is fitted for itself. The search ends
with a model that leaves noise, or where the next effect takes away little of what is left; then
it looks back, drops what is needless, and puts the rest in the order in which adding them pays.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from crosscheck.fit.candidates import Candidate, fit_candidate, judged, layouts_for, screen
from crosscheck.fit.evidence import FALSE_ALARM, Evidence, evidence
from crosscheck.fit.gauss_newton import Fit, fit
from crosscheck.fit.held_out import HeldOut, hold_out, pays, unfitted
from crosscheck.fit.noise import Whiteness, whiteness
from crosscheck.fit.prepare import Progress
from crosscheck.fit.problem import Problem
from seecr.effects import Term, Terms, catalogue
from seecr.pose import Array

# Least gain in log evidence for one more effect (20:1), and the margin within which two models
# explain equally well.
LEAST_GAIN, EQUAL = 3.0, 3.0
MOST_EFFECTS = 4
# An effect that takes away less than this part of what noise does not explain is no cause.
LEAST_PART = 0.25
# The best few models are fitted again, so often, from values so many plausible sizes away.
_SHAKEN, _SHAKES, _SHAKE = 2, 4, 0.2
# Models abreast, at least so many though none is small, and candidates fitted beside each of
# them after the first round.
_ABREAST, _LARGE, _FITTED, _FITTED_SMALL = 4, 2, 7, 2
# Most parameters of a small effect.
_SMALL = 3
# Beside a model that leaves noise, an effect is only fitted if chance explains what its
# derivative promises with less than this; beside others it must be very likely chance.
_PRUNE_NOISE, _PRUNE_OTHER = 0.02, 0.3


@dataclass(eq=False)
class Step:
    """A model on the way: what was added and how well it does.

    Attributes:
        added: name of the effect added last, "" for the start.
        fit, evidence, whiteness, held_out: of the model.
        candidates: what was tried to go on from here.
    """

    added: str
    fit: Fit
    evidence: Evidence
    whiteness: Whiteness
    held_out: HeldOut
    candidates: list[Candidate] = field(default_factory=list)


@dataclass(eq=False)
class Search:
    """The way of the search.

    Attributes:
        problem: the data. factor: noise factors used throughout.
        noise_scale: noise in units of the stated one, used by all tests.
        steps: from the model as it stood to the last one.
        base: names of the effects the model had.
        known: fits of candidates, for a search of the same data again.
    """

    problem: Problem
    factor: Array
    noise_scale: float
    steps: list[Step]
    base: tuple[str, ...]
    known: dict[tuple[frozenset[str], str], tuple[float, Fit]] = field(default_factory=dict)

    @property
    def last(self) -> Step:
        """The model the search ended with."""
        return self.steps[-1]

    @property
    def found(self) -> tuple[str, ...]:
        """Effects added, in the order of adding."""
        return tuple(step.added for step in self.steps[1:])


@dataclass(eq=False)
class _Node:
    """A model of the search; ``candidates`` are filled when the search goes on from it."""

    fit: Fit
    evidence: Evidence
    whiteness: Whiteness
    candidates: list[Candidate] = field(default_factory=list)

    @property
    def names(self) -> frozenset[str]:
        return frozenset(self.fit.terms.names)

    @property
    def excess(self) -> float:
        return max(self.whiteness.chi2 - self.whiteness.dof, 1e-9)


@dataclass(eq=False)
class _Searcher:
    problem: Problem
    factor: Array
    scale: float
    base: Fit
    progress: Progress
    # fits of candidates by (effects beside it, its name), with the chi2 of those effects alone
    known: dict[tuple[frozenset[str], str], tuple[float, Fit]]

    def run(self) -> Search:
        root = self.node(self.base)
        best, abreast = root, [root]
        seen = {root.names: root}
        for depth in range(MOST_EFFECTS):
            children: list[_Node] = []
            for k, node in enumerate(abreast):
                self.try_all(node, depth, k, len(abreast))
                children += self.children(node, seen)
            better = [c for c in children if c.evidence.log > best.evidence.log + LEAST_GAIN]
            if not better:
                break
            if depth == 0 and not any(c.whiteness.is_noise for c in better):
                better = self.shaken(better, seen)
            noise = [c for c in better if c.whiteness.is_noise]
            top = max(noise or better, key=_standing)
            if not noise and top.excess > (1.0 - LEAST_PART) * best.excess:
                break  # what is left has another cause than the next best guess
            best = top
            abreast = [top] if noise else _diverse(better, root)[: _ABREAST if depth == 0 else 1]
        return self.conclude(root, best, seen)

    def node(self, found: Fit) -> _Node:
        ev = evidence(found, self.scale)
        white = whiteness(self.problem, found.state.white / self.scale, ev.parameters)
        return _Node(found, ev, white)

    def try_all(self, node: _Node, depth: int, which: int, of: int) -> None:
        """Every effect that the node does not have: all fitted at first, then the best few."""
        todo = [c for c in layouts_for(self.problem) if c.name not in node.names]
        prune = _PRUNE_NOISE if node.whiteness.is_noise else _PRUNE_OTHER
        open_: list[Candidate] = []
        for k, c in enumerate(todo):
            part = (which + 0.5 * k / len(todo)) / of
            self.progress(f"round {depth + 1}: looking at {c.name}", part)
            if not c.why_not:
                c = screen(self.problem, node.fit, c.layout, self.factor, self.scale)
            if not c.why_not and c.p > prune:
                c.why_not = f"chance explains it (p {min(1.0, c.p):.2g})"
            (node.candidates if c.why_not else open_).append(c)
        open_.sort(key=lambda c: -_promise(c))
        chosen = open_ if depth == 0 else _promising(open_)
        best = np.inf
        for k, c in enumerate(open_):
            if c not in chosen:
                c.why_not = "promises less than others beside it"
                node.candidates.append(c)
                continue
            self.progress(
                f"round {depth + 1}: fitting {c.name}", (which + 0.5 + 0.5 * k / len(open_)) / of
            )
            hopeless = 4.0 * best + 0.02 * node.fit.chi2
            if best < (1.0 - LEAST_PART) * node.fit.chi2:
                # nobody goes on from what explains little where another explains much
                hopeless = min(hopeless, (1.0 - LEAST_PART) * node.fit.chi2)
            tried = self.tried(node, c, hopeless)
            if tried.fit is not None:
                best = min(best, tried.fit.chi2)
            node.candidates.append(tried)
        self.judge(node)

    def tried(self, node: _Node, screened: Candidate, hopeless: float) -> Candidate:
        """A candidate fitted; with what an earlier search found, where that fitted it."""
        key = (node.names, screened.name)
        known = self.known.get(key)
        if known is not None and known[0] == node.fit.chi2:
            return judged(known[1], node.fit, screened, self.scale)
        out = fit_candidate(self.problem, node.fit, screened, self.factor, self.scale, hopeless)
        if out.fit is not None:
            self.known[key] = (node.fit.chi2, out.fit)
        return out

    def judge(self, node: _Node) -> None:
        """Say of each candidate why it is not to be added, if it is not."""
        count = sum(1 for c in node.candidates if c.fit is not None or c.drop > 0)
        for c in node.candidates:
            if c.fit is None or c.evidence is None or c.why_not:
                continue
            gain = c.evidence.log - node.evidence.log
            if c.p * count > FALSE_ALARM:
                c.why_not = f"chance explains it (p {min(1.0, c.p * count):.2g} over all tried)"
            elif gain < LEAST_GAIN:
                c.why_not = f"explains too little for its {len(c.layout)} parameters"

    def children(self, node: _Node, seen: dict[frozenset[str], _Node]) -> list[_Node]:
        """Models with one effect more that nobody has seen yet."""
        out = []
        for c in node.candidates:
            if c.fit is None or c.why_not:
                continue
            child = self.node(c.fit)
            other = seen.get(child.names)
            if other is None or child.evidence.log > other.evidence.log:
                seen[child.names] = child
                out.append(child)
        return out

    def shaken(self, nodes: list[_Node], seen: dict[frozenset[str], _Node]) -> list[_Node]:
        """The best few fitted again from values nearby: slack cables make local minima."""
        ranked = sorted(nodes, key=lambda c: -c.evidence.log)
        rng = np.random.default_rng(0)
        out = ranked[_SHAKEN:]
        for node in ranked[:_SHAKEN]:
            best = node.fit
            scale, lower, upper = best.terms.scale, best.terms.lower, best.terms.upper
            for k in range(_SHAKES):
                shake = _SHAKE * scale * rng.normal(size=len(scale))
                values = np.clip(best.terms.vector + shake, lower, upper)
                self.progress("fitting again from values nearby", k / _SHAKES)
                again = fit(
                    self.problem, best.terms.with_vector(values), self.factor, best.state,
                    iterations=12, quick=True,
                )  # fmt: skip
                if again.valid and again.chi2 < best.chi2:
                    best = again
            better = node if best is node.fit else self.node(best)
            better.candidates = node.candidates
            seen[better.names] = better
            out.append(better)
        return out

    def conclude(self, root: _Node, best: _Node, seen: dict[frozenset[str], _Node]) -> Search:
        """Fit to the end, look back, and put the effects in order."""
        held = set(self.base.terms.names)
        last = self.settled(best)
        last = self.without_needless(last, held)
        steps = self.in_order(root, last, held, seen)
        return Search(self.problem, self.factor, self.scale, steps, tuple(held), self.known)

    def settled(self, node: _Node) -> _Node:
        if not node.fit.terms or node.fit is self.base:
            return node
        full = fit(self.problem, node.fit.terms, self.factor, node.fit.state)
        return self.node(full) if full.valid else node

    def without_needless(self, node: _Node, held: set[str]) -> _Node:
        """Drop effects whose absence costs no evidence."""
        own = [name for name in node.fit.terms.names if name not in held]
        if len(own) < 2:
            return node
        for name in own:
            shorter = fit(self.problem, node.fit.terms.without(name), self.factor, node.fit.state)
            if not shorter.valid:
                continue
            other = self.node(shorter)
            if other.evidence.log > node.evidence.log - LEAST_GAIN:
                return self.without_needless(other, held)
        return node

    def in_order(
        self, root: _Node, last: _Node, held: set[str], seen: dict[frozenset[str], _Node]
    ) -> list[Step]:
        """Steps from the start to the last model, at each the effect that pays most.

        Each is to predict runs left out better than what came before. One that only pays
        together with the next (alone it extrapolates wildly, say) waits for that.
        """
        steps = [self.step("", root)]
        waiting: list[Step] = []
        todo = [t for t in last.fit.terms if t.name not in held]
        terms = self.base.terms
        while todo:
            options = self.options(terms, todo, last, seen)
            if not options:
                break
            tried = []
            for name, node in options:
                known = seen.get(node.names)
                if known is not None:
                    node.candidates = known.candidates
                tried.append(self.step(name, node))
                if pays(steps[-1].held_out, tried[-1].held_out):
                    steps += [*waiting, tried[-1]]
                    waiting, chosen = [], tried[-1]
                    break
            else:
                chosen = tried[0]
                waiting.append(chosen)
            terms = chosen.fit.terms
            todo = [t for t in todo if t.name != chosen.added]
        for step in waiting:
            self.blame(root, step.added)
        return steps

    def options(
        self, terms: Terms, todo: list[Term], last: _Node,
        seen: dict[frozenset[str], _Node],
    ) -> list[tuple[str, _Node]]:  # fmt: skip
        """The model with each of the effects that are still to come, the best first."""
        if len(todo) == 1:
            return [(todo[0].name, last)]
        out = []
        for term in todo:
            known = seen.get(frozenset([*terms.names, term.name]))
            if known is not None:
                found = known.fit
            else:
                some = last.fit.terms.only([*terms.names, term.name])
                found = fit(self.problem, some, self.factor, last.fit.state, iterations=8)
            if found.valid:
                out.append((term.name, self.node(found)))
        return sorted(out, key=lambda option: option[1].fit.chi2)

    def blame(self, root: _Node, name: str) -> None:
        for c in root.candidates:
            if c.name == name and not c.why_not:
                c.why_not = "does not predict runs left out any better"

    def step(self, added: str, node: _Node) -> Step:
        best = node.fit
        if added and best.terms:
            held = hold_out(self.problem, best, self.factor)
        else:
            held = unfitted(self.problem, best.terms, best)
        return Step(added, best, node.evidence, node.whiteness, held, node.candidates)


def search(
    problem: Problem,
    base: Fit,
    factor: Array,
    noise_scale: float = 1.0,
    progress: Progress = lambda _text, _part: None,
    before: Search | None = None,
) -> Search:
    """Add effects to the base model until what is left is noise or nothing helps.

    ``before`` is a search of the same data with another noise scale: its fits still hold.
    """
    known = {} if before is None else before.known
    return _Searcher(problem, factor, noise_scale, base, progress, known).run()


def _promise(c: Candidate) -> float:
    """Linearised gain in evidence, roughly: three for each direction."""
    directions = c.starts.directions if c.starts is not None else 1
    return 0.5 * c.drop - 3.0 * directions


def _promising(ranked: list[Candidate]) -> list[Candidate]:
    """A few candidates to fit: those that promise most, and the small ones that do.

    Large groups promise more than any small effect beside them, true or not.
    """
    first = ranked[: _FITTED - _FITTED_SMALL]
    small = [c for c in ranked if len(c.layout) <= _SMALL and c not in first][:_FITTED_SMALL]
    rest = [c for c in ranked if c not in first and c not in small]
    return [*first, *small, *rest[: _FITTED - len(first) - len(small)]]


def _standing(node: _Node) -> tuple[float, int]:
    """Evidence; of models alike in it (friction that is null, say) the smaller one counts.

    Of exact equals (exit and anchor points of a platform that cannot turn) that which comes
    first in the catalogue, and not the one that rounding prefers.
    """
    place = {name: i for i, name in enumerate(catalogue())}
    log = node.evidence.log - 0.1 * len(node.fit.at_bound)
    return round(log, 1), -sum(place.get(name, len(place)) for name in node.names)


def _diverse(nodes: list[_Node], root: _Node) -> list[_Node]:
    """A few models to go on from: the best, and the best of the small ones that explain much."""
    ranked = sorted(nodes, key=lambda c: -c.evidence.log)
    enough = (1.0 - LEAST_PART) * root.excess
    out = ranked[:1]
    for most, count in ((_SMALL, 2), (8, 1)):
        small = [c for c in ranked if c.fit.jacobian.shape[1] <= most and c.excess < enough]
        out += [c for c in small if c not in out][:count]
    others = [c for c in ranked if c not in out and c.excess < enough]
    return out + others[: max(0, _LARGE - len(out))]
