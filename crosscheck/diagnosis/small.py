"""What can be said where structure is left over: small effects that each explain much.

Large groups of parameters imitate anything. An effect of a few parameters, of a size that
happens, that takes away most of what runs left out leave unexplained is there all the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.diagnosis.search import MOST_EFFECTS, Search, Step
from crosscheck.fit.candidates import Candidate, layouts_for, try_candidate
from crosscheck.fit.evidence import evidence
from crosscheck.fit.gauss_newton import fit
from crosscheck.fit.held_out import hold_out, surely_improves
from crosscheck.fit.noise import whiteness
from seecr.effects import Term

# Where structure is left over, an effect of more plausible sizes than this is not believed.
PLAUSIBLE = 20.0


def smallest_sure(found: Search, parameters: int, shares: tuple[float, float]) -> Search | None:
    """The way by small effects alone, each of which explains much by itself.

    For data that keep some structure whatever is added: large groups imitate anything, but an
    effect of a few parameters that takes away nearly all is there; and so may be the next one,
    if it takes away a good part of what the first leaves.

    Args:
        found: a search that did not end with noise.
        parameters: most that an effect may have.
        shares: least part of what runs left out leave unexplained that the first effect and
            each after it must take away.
    """
    way = Search(
        found.problem, found.factor, found.noise_scale, found.steps[:1], found.base, found.known
    )
    while len(way.found) < MOST_EFFECTS:
        step = _small_step(way, parameters, shares[1] if way.found else shares[0])
        if step is None:
            break
        way = replace(way, steps=[*way.steps, step])
    return way if way.found else None


def _small_step(way: Search, parameters: int, share: float) -> Step | None:
    problem, last = way.problem, way.last
    if way.found:
        last.candidates = _small_candidates(way, parameters)
    small = [
        c
        for c in last.candidates
        if c.fit is not None and c.evidence is not None and len(c.layout) <= parameters
        and not np.any(c.fit.at_bound) and is_plausible(c.fit.terms[c.name])
    ]  # fmt: skip
    if not small:
        return None
    best = max(small, key=lambda c: c.evidence.log if c.evidence else -np.inf)
    assert best.fit is not None
    full = fit(problem, best.fit.terms, way.factor, best.fit.state)
    if not full.valid:
        return None
    ev = evidence(full, way.noise_scale)
    white = whiteness(problem, full.state.white / way.noise_scale, ev.parameters)
    step = Step(best.name, full, ev, white, hold_out(problem, full, way.factor))
    sure = surely_improves(last.held_out, step.held_out) and not np.any(full.at_bound)
    return step if sure and share_of(last, step) > share else None


def is_plausible(term: Term) -> bool:
    """Whether an effect is of a size that happens; what shapes it has no such size."""
    amplitudes = ~term.layout.shape
    return bool(np.all(np.abs(term.sizes)[amplitudes] < PLAUSIBLE))


def _small_candidates(way: Search, parameters: int) -> list[Candidate]:
    """The small effects that the last model does not have, fitted beside it."""
    held = way.last.fit.terms.names
    out = []
    for c in layouts_for(way.problem):
        if c.name in held or c.why_not or len(c.layout) > parameters:
            continue
        out.append(try_candidate(way.problem, way.last.fit, c.layout, way.factor, way.noise_scale))
    return out


def share_of(before: Step, step: Step) -> float:
    """Part of the unexplained chi2 of runs left out that a step took away."""
    unexplained = float(before.held_out.chi2.sum() - before.held_out.readings.sum())
    fall = float(before.held_out.chi2.sum() - step.held_out.chi2.sum())
    return float(np.clip(fall / unexplained, 0.0, 1.0)) if unexplained > 0 else 0.0
