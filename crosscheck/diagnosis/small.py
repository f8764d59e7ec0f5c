"""Lists small effects that each explain much, for data in which structure remains.

Large groups of parameters imitate anything. An effect with few parameters and a plausible size that
removes most of what is unexplained on held-out runs is there all the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from crosscheck.diagnosis.node import LEAST_GAIN, node_of
from crosscheck.diagnosis.order import Step, step_of
from crosscheck.diagnosis.search import MOST_EFFECTS, Search
from crosscheck.fit.effects.candidates import Candidate, try_candidate
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.held_out import significantly_improves
from crosscheck.fit.effects.possible import is_plausible
from crosscheck.fit.noise.smooth import beyond_smooth
from seecr.processes import Shared, shared_out

# What is there takes no kind of reading farther off on held-out runs than so many times.
_FARTHER = 1.1


def small_effects_alone(
    found: Search, parameters: int, shares: tuple[float, float]
) -> Search | None:
    """A search among small effects only, each of which explains much; None if there is none.

    This is for data that keep some structure whatever is added. Large groups imitate anything, but
    an effect with few parameters that removes nearly all of it is there, and so may be the next one
    if it removes a good part of the rest. Effects are not listed if a smooth field over the
    workspace explains as much: a lens looks much like a scale.

    Args:
        found: a search that did not end with noise.
        parameters: most parameters that an effect may have.
        shares: least part of the unexplained chi2 on held-out runs that the first effect, and each
            later one, must remove.
    """
    search = replace(found, steps=found.steps[:1])
    while len(search.found) < MOST_EFFECTS:
        last = search.last
        if search.found:
            tried = tuple(_small_candidates(search, parameters))
            last = replace(last, candidates=tried)
            search = replace(search, steps=(*search.steps[:-1], last))
        step = _small_step(search, parameters, shares[1] if search.found else shares[0])
        if step is None:
            break
        search = replace(search, steps=(*search.steps, step))
    return search if search.found else None


def _small_step(search: Search, parameters: int, share: float) -> Step | None:
    """The small effect with the most evidence, if it explains such a share of the remainder."""
    best = _best_small(search.last.candidates, parameters)
    if best is None or best.fit is None:
        return None
    full = search.trials.refit(best.fit.terms, best.fit.state)
    if not full.valid:
        return None
    step = step_of(search.trials, best.name, node_of(search.trials, full))
    significant = significantly_improves(search.last.held_out, step.held_out)
    listed = significant and not np.any(full.at_bound) and share_of(search.last, step) > share
    listed = listed and not spoils(search.last, step)
    if not listed or not beyond_smooth(search.problem, search.last.fit.state, full.state, share):
        return None
    return step


def _best_small(candidates: Sequence[Candidate], parameters: int) -> Candidate | None:
    def fits(c: Candidate, found: Fit | None) -> bool:
        few = len(c.layout) <= parameters and not _contradicted(c, candidates)
        return few and found is not None and not np.any(found.at_bound) and _happens(found, c)

    small = [c for c in candidates if fits(c, c.fit)]
    return max(small, key=lambda c: c.evidence.log if c.evidence else -np.inf, default=None)


def _contradicted(candidate: Candidate, others: Sequence[Candidate]) -> bool:
    """Whether an effect that contains this one explains more (drums that differ, not all alike)."""
    own = candidate.evidence
    wider = [c.evidence for c in others if c.layout.effect.parent == candidate.name]
    return own is not None and any(e is not None and e.log > own.log + LEAST_GAIN for e in wider)


def _happens(found: Fit, candidate: Candidate) -> bool:
    return is_plausible(found.terms[candidate.name])


def _small_candidates(search: Search, parameters: int) -> list[Candidate]:
    """The small effects that the last model does not have, fitted beside it."""
    held, trials = search.last.fit.terms.names, search.trials
    small = [
        c.layout
        for c in trials.candidates(trials.problem)
        if c.name not in held and c.why_not is None and len(c.layout) <= parameters
    ]
    return shared_out(
        partial(try_candidate, trials, search.last.fit), small, lambda: Shared(search, small)
    )


def spoils(before: Step, step: Step) -> bool:
    """Whether a step takes one kind of reading farther off on held-out runs.

    An effect may explain most of the position error and be paid for by the orientation: a tracker
    that lags behind looks like backlash to it.
    """
    was, now = before.held_out.rms, step.held_out.rms
    pairs = ((old, now.get(key)) for key, old in was.items())
    return any(new > _FARTHER * old for old, new in pairs if old is not None and new is not None)


def share_of(before: Step, step: Step) -> float:
    """Part of the unexplained chi2 on held-out runs that a step removed."""
    unexplained = float(before.held_out.chi2.sum() - before.held_out.readings.sum())
    fall = float(before.held_out.chi2.sum() - step.held_out.chi2.sum())
    return float(np.clip(fall / unexplained, 0.0, 1.0)) if unexplained > 0 else 0.0
