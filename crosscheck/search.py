"""Stepwise search for missing effects: forward by evidence, with look-back, never by rms alone.

Each step fits every candidate for itself, keeps those whose fall of chi2 cannot be chance given
how many were tried, takes the one of most evidence, and asks for better predictions of runs left
out. Then it looks back: an effect that the new one makes needless is dropped, one that another
explains better with the rest is swapped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from crosscheck.candidates import Candidate, layouts_for, ordered, try_candidate
from crosscheck.evidence import Evidence, evidence
from crosscheck.fit import Fit, fit
from crosscheck.held_out import HeldOut, hold_out, improves, unfitted
from crosscheck.noise import Whiteness, whiteness
from crosscheck.problem import Problem
from seecr.pose import Array

# Family-wise chance of a false alarm, over all candidates of a step.
FALSE_ALARM = 0.01
# Least gain in log evidence for one more effect (20:1), and the margin within which two models
# explain equally well.
LEAST_GAIN, EQUAL = 3.0, 3.0
MOST_EFFECTS = 5

Progress = Callable[[str, float], None]


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
    """

    problem: Problem
    factor: Array
    noise_scale: float
    steps: list[Step]
    base: tuple[str, ...]

    @property
    def last(self) -> Step:
        """The model the search ended with."""
        return self.steps[-1]

    @property
    def found(self) -> tuple[str, ...]:
        """Effects added, in the order of adding."""
        names = [t.name for t in self.last.fit.terms if t.name not in self.base]
        order = [s.added for s in self.steps]
        return tuple(sorted(names, key=lambda n: order.index(n) if n in order else len(order)))


def search(
    problem: Problem,
    base: Fit,
    factor: Array,
    noise_scale: float = 1.0,
    progress: Progress = lambda _text, _part: None,
) -> Search:
    """Add effects to the base model until what is left is noise or nothing helps."""
    names = tuple(t.name for t in base.terms)
    steps = [_step("", problem, base, factor, noise_scale)]
    out = Search(problem, factor, noise_scale, steps, names)
    while len(out.found) < MOST_EFFECTS:
        here = out.last
        here.candidates = try_all(problem, here.fit, factor, noise_scale, progress, len(steps))
        following = _choose(problem, here, factor, noise_scale)
        if following is None:
            break
        following = _look_back(problem, following, names, here, factor, noise_scale)
        steps.append(following)
    return out


def _step(added: str, problem: Problem, best: Fit, factor: Array, scale: float) -> Step:
    ev = evidence(best, scale)
    held = hold_out(problem, best, factor) if best.terms else unfitted(problem, (), best)
    white = whiteness(problem, best.state.white / scale, ev.parameters)
    return Step(added, best, ev, white, held)


def try_all(
    problem: Problem, base: Fit, factor: Array, scale: float, progress: Progress, round_: int
) -> list[Candidate]:
    """Every effect of the catalogue that the model does not have, fitted beside it."""
    have = {t.name for t in base.terms}
    todo = [c for c in layouts_for(problem) if c.name not in have]
    # the cheap ones first: they tell how good a fit must be to be worth finishing
    todo.sort(key=lambda c: (len(c.layout.effect.shapes(base.state.prediction.setup)), len(c.layout)))
    best, out = np.inf, []
    # beside a model that leaves noise, only what its derivative promises is worth a fit
    left = whiteness(problem, base.state.white / scale, base.jacobian.shape[1])
    prune = 0.02 if left.is_noise else 0.3
    for k, candidate in enumerate(todo):
        progress(f"round {round_}: {candidate.name}", k / len(todo))
        if not candidate.why_not:
            hopeless = 4.0 * best + 0.02 * base.chi2
            candidate = try_candidate(
                problem, base, candidate.layout, factor, scale, hopeless, prune
            )
            if candidate.fit is not None:
                best = min(best, candidate.fit.chi2)
        out.append(candidate)
    return out


def _choose(problem: Problem, here: Step, factor: Array, scale: float) -> Step | None:
    """The best candidate that chance does not explain and that predicts runs left out."""
    tried = [c for c in here.candidates if c.fit is not None and c.evidence is not None]
    for c in tried:
        assert c.evidence is not None
        gain = c.evidence.log - here.evidence.log
        if c.p * len(tried) > FALSE_ALARM:
            c.why_not = f"chance explains it (p {min(1.0, c.p * len(tried)):.2g} over all tried)"
        elif gain < LEAST_GAIN:
            c.why_not = f"explains too little for its {len(c.layout)} parameters"
    good = [c for c in tried if not c.why_not]
    good.sort(key=lambda c: -(c.evidence.log if c.evidence else -np.inf))
    for c in good[:4]:
        assert c.fit is not None
        best = fit(problem, c.fit.terms, factor, c.fit.state)
        if not best.valid:
            c.why_not = best.why
            continue
        step = _step(c.name, problem, best, factor, scale)
        mean, error = improves(here.held_out, step.held_out)
        if not step.held_out.valid or mean <= 0.0 or mean < 0.5 * error:
            c.why_not = "does not predict runs left out any better"
            continue
        return step
    return None


def _look_back(
    problem: Problem, step: Step, base: tuple[str, ...], before: Step, factor: Array, scale: float
) -> Step:
    """Drop what is needless now; swap what another effect explains better with the rest."""
    step = _drop_needless(problem, step, base, factor, scale)
    own = [t.name for t in step.fit.terms if t.name not in base and t.name != step.added]
    for name in own:
        rest = ordered([t for t in step.fit.terms if t.name != name])
        without = fit(problem, rest, factor, step.fit.state)
        if not without.valid:
            continue
        better: Candidate | None = None
        rivals = sorted(
            (c for c in before.candidates if c.evidence and c.name not in [t.name for t in rest]),
            key=lambda c: -(c.evidence.log if c.evidence else -np.inf),
        )
        for rival in rivals[:6]:
            if rival.name == name:
                continue
            trial = try_candidate(problem, without, rival.layout, factor, scale)
            good = trial.evidence is not None and (
                trial.evidence.log > step.evidence.log + LEAST_GAIN
            )
            if good and (better is None or _log(trial) > _log(better)):
                better = trial
        if better is not None and better.fit is not None:
            best = fit(problem, better.fit.terms, factor, better.fit.state)
            swapped = _step(step.added, problem, best, factor, scale)
            if best.valid and swapped.evidence.log > step.evidence.log:
                step = swapped
    return _drop_needless(problem, step, base, factor, scale)


def _log(candidate: Candidate) -> float:
    return candidate.evidence.log if candidate.evidence is not None else -np.inf


def _drop_needless(
    problem: Problem, step: Step, base: tuple[str, ...], factor: Array, scale: float
) -> Step:
    for term in step.fit.terms:
        if term.name in base or term.name == step.added:
            continue
        rest = [t for t in step.fit.terms if t.name != term.name]
        shorter = fit(problem, rest, factor, step.fit.state)
        if shorter.valid and evidence(shorter, scale).log > step.evidence.log - LEAST_GAIN:
            return _drop_needless(
                problem, _step(step.added, problem, shorter, factor, scale), base, factor, scale
            )
    return step
