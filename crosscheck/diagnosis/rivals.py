"""Effects that these data cannot tell apart, from the subspaces that they span and from refits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.sets.equals import EQUAL, are_equals
from crosscheck.diagnosis.node import hopeless
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.candidates import Candidate, try_candidate
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.least_squares.imitation import basis, beside, imitated
from seecr.effects import catalogue
from seecr.effects.base import Layout
from seecr.processes import Shared, shared_out

# An effect is only refitted in place of another if it can imitate this part of its signal.
_LIKELY = 0.9
TOLD_APART = 9.0
"""A rival that leaves this much more chi2 can be told apart, whatever its evidence."""
# Least evidence that the further parameters of an effect that contains another must gain.
_FURTHER = 1.0
# A converged trial is not fitted further if it is so many times as far off as a rival may be.
_MENDED = 4.0


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that explains the data as well as the one listed.

    Attributes:
        name: name of the rival. fit: the model with it instead. loss: ln evidence lost with it.
    """

    name: str
    fit: Fit
    loss: float

    @property
    def layout(self) -> Layout:
        """The parameters of the rival."""
        return self.fit.terms[self.name].layout

    @property
    def is_better(self) -> bool:
        """Whether it explains more than the effect listed, and not only as well."""
        return self.loss <= -EQUAL


def rivals_of(found: Search, name: str, apart: float = TOLD_APART) -> list[Rival]:
    """Effects that explain as well in place of ``name`` in the final model; see `in_place_of`."""
    return [rival for rival in in_place_of(found, name, apart) if not rival.is_better]


def in_place_of(found: Search, name: str, apart: float = TOLD_APART) -> list[Rival]:
    """Effects that explain as well as ``name`` in the final model or better, the best first.

    Args:
        found: the search. name: name of the effect.
        apart: difference of chi2 from which on a rival can be told apart, whatever its evidence;
            infinite if the effect is not sure, so that evidence alone decides.
    """
    final = found.last
    rest = final.fit.terms.without(name)
    without = found.trials.refit(rest, final.fit.state) if rest else found.steps[0].fit
    if not without.valid:
        return []
    own = len(final.fit.terms[name].layout)
    likely = _likely(found, name, without)
    tried = shared_out(
        lambda c: _in_its_place(found, c, without, apart), likely,
        lambda: Shared(found, without, likely),
    )  # fmt: skip
    every = {rival.name: rival for rival in tried if rival is not None}
    out = {rival.name for rival in every.values() if _explains_as_well(found, rival, own, apart)}
    for rival in sorted(out):
        # an effect that contains another (friction on a cable behind the exit point, with zero
        # friction) does all that the other does; it stays if its further parameters may be there
        loss, alone = every[rival].loss, loss_of_its_part(rival, name, every)
        if alone < loss + _FURTHER:
            out |= {catalogue()[rival].parent} - {name}
        if loss > alone + EQUAL:
            out -= {rival}
    return sorted((every[rival] for rival in out), key=lambda r: r.loss)


def loss_of_its_part(rival: str, name: str, every: Mapping[str, Rival]) -> float:
    """ln evidence lost with the effect that a rival of ``name`` contains; inf if not tried."""
    inner = catalogue()[rival].parent
    if inner == name:
        return 0.0
    return every[inner].loss if inner in every else np.inf


def _explains_as_well(found: Search, rival: Rival, own: int, apart: float) -> bool:
    """Whether a rival explains as much as the effect, which has ``own`` parameters, or more."""
    worse = (rival.fit.chi2 - found.last.fit.chi2) / found.last.whiteness.inflation**2
    return are_equals(rival.loss, own, len(rival.layout)) and worse < apart


def _in_its_place(found: Search, candidate: Candidate, without: Fit, apart: float) -> Rival | None:
    """The candidate fitted in place of the effect; None if it leaves far more."""
    trials, final = found.trials, found.last
    # if structure remains, differences count relative to it and not to the noise, and correlated
    # residuals count for fewer
    left = final.whiteness.inflation**2
    trial, far = candidate, hopeless(without.chi2, final.fit.chi2)
    if trial.fit is None or len(found.found) > 1:
        trial = try_candidate(trials, without, candidate.layout, far)
    if trial.fit is None or not trial.fit.valid:
        return None
    if trial.fit.settled and not trial.fit.state.prediction.has_history:
        far = min(far, final.fit.chi2 + _MENDED * max(apart, TOLD_APART) * left)
    if trial.fit.chi2 > far:
        return None
    best = trials.refit(trial.fit.terms, trial.fit.state)
    if not best.valid:
        return None
    loss = (final.evidence.log - trials.evidence(best).log) / left
    return Rival(candidate.name, best, loss)


def _likely(found: Search, name: str, without: Fit) -> list[Candidate]:
    """Candidates that fitted nearly as well as the effect, or can imitate its signal."""
    final = found.last
    own = final.fit.terms.own(name)
    signal = final.fit.jacobian[:, own] @ final.fit.terms.sizes[own]
    signal = beside(signal, final.fit.spanned(~own))
    pool, best = _tried_beside(found, name)
    # structure that remained then counts as noise
    left = max(best / max(final.whiteness.dof, 1), final.whiteness.inflation**2)
    margin = _MENDED * TOLD_APART * max(1.0, left)

    def likely(fitted: Fit, other: str) -> bool:
        if fitted.chi2 < best + margin:
            return True
        if len(found.found) < 2:
            return False
        # it was fitted beside another model, so that its chi2 does not tell everything
        columns = beside(fitted.jacobian[:, fitted.terms.own(other)], without.span)
        return imitated(signal, basis(columns)) > _LIKELY

    return [
        c
        for c in pool
        if c.name not in final.fit.terms and c.fit is not None and likely(c.fit, c.name)
    ]


def _tried_beside(found: Search, name: str) -> tuple[Sequence[Candidate], float]:
    """Candidates that were tried when the effect was chosen, and the effect's chi2 there."""
    for step in reversed(found.steps):
        for c in step.candidates:
            if c.name == name:
                return step.candidates, c.fit.chi2 if c.fit is not None else found.last.fit.chi2
    return [], found.last.fit.chi2
