"""What these data cannot tell apart, from the subspaces that effects span, and from refits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.equals import EQUAL, are_equals
from crosscheck.diagnosis.node import hopeless
from crosscheck.diagnosis.search import Search
from crosscheck.fit.candidates import Candidate, try_candidate
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.imitation import basis, beside, imitated
from seecr.effects import catalogue
from seecr.effects.base import Layout

# An effect that can imitate less than this part of another's signal is not refitted for it.
_LIKELY = 0.9
# A rival that leaves this much more chi2 has been told apart, whatever its evidence.
_TOLD_APART = 9.0
# What the further parameter of one that contains another must explain to say something.
_FURTHER = 1.0
# A trial that came to its end this many times as far off is not fitted further.
_MENDED = 4.0


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that explains the data as well as the one listed.

    Attributes:
        name: of the rival. fit: the model with it instead. loss: evidence lost with it.
    """

    name: str
    fit: Fit
    loss: float

    @property
    def layout(self) -> Layout:
        """Its parameters."""
        return self.fit.terms[self.name].layout


def rivals_of(found: Search, name: str, apart: float = _TOLD_APART) -> list[Rival]:
    """Effects that could stand in for ``name`` in the final model, the best first.

    Args:
        found: the search. name: of the effect.
        apart: chi2 from which on a rival is too far off whatever its evidence; infinite where the
            effect is not sure, so that evidence alone decides.
    """
    final = found.last
    rest = final.fit.terms.without(name)
    without = found.trials.refit(rest, final.fit.state) if rest else found.steps[0].fit
    if not without.valid:
        return []
    own = len(final.fit.terms[name].layout)
    tried = [_in_its_place(found, c, without, apart) for c in _likely(found, name, without)]
    every = {rival.name: rival for rival in tried if rival is not None}
    out = {rival.name for rival in every.values() if _explains_as_well(found, rival, own, apart)}
    for rival in sorted(out):
        # one that contains another (friction on a cable behind the exit point, with no friction)
        # does all that the other does: it stays where its further parameters may be there too
        loss, alone = every[rival].loss, loss_of_its_part(rival, name, every)
        if alone < loss + _FURTHER:
            out |= {catalogue()[rival].parent} - {name}
        if loss > alone + EQUAL:
            out -= {rival}
    return sorted((every[rival] for rival in out), key=lambda r: r.loss)


def loss_of_its_part(rival: str, name: str, every: Mapping[str, Rival]) -> float:
    """Evidence lost with the effect that a rival of ``name`` contains; infinite if not tried."""
    inner = catalogue()[rival].parent
    if inner == name:
        return 0.0
    return every[inner].loss if inner in every else np.inf


def _explains_as_well(found: Search, rival: Rival, own: int, apart: float) -> bool:
    """Whether it does what the effect of ``own`` parameters does."""
    worse = (rival.fit.chi2 - found.last.fit.chi2) / found.last.whiteness.inflation**2
    alike = rival.loss > -EQUAL and are_equals(rival.loss, own, len(rival.layout))
    return alike and worse < apart


def _in_its_place(found: Search, candidate: Candidate, without: Fit, apart: float) -> Rival | None:
    """The candidate in place of the effect; None where it leaves far more."""
    trials, final = found.trials, found.last
    # where structure is left over, differences count against that, not against the noise, and
    # residuals that go together count for fewer
    left = final.whiteness.inflation**2
    trial, far = candidate, hopeless(without.chi2, final.fit.chi2)
    if trial.fit is None or len(found.found) > 1:
        trial = try_candidate(trials, without, candidate.layout, far)
    if trial.fit is None or not trial.fit.valid:
        return None
    if trial.fit.settled and not trial.fit.state.prediction.has_history:
        far = min(far, final.fit.chi2 + _MENDED * max(apart, _TOLD_APART) * left)
    if trial.fit.chi2 > far:
        return None
    best = trials.refit(trial.fit.terms, trial.fit.state)
    if not best.valid:
        return None
    loss = (final.evidence.log - trials.evidence(best).log) / left
    return Rival(candidate.name, best, loss)


def _likely(found: Search, name: str, without: Fit) -> list[Candidate]:
    """Candidates that fitted nearly as well as the effect, or can imitate what it does."""
    final = found.last
    own = final.fit.terms.own(name)
    signal = final.fit.jacobian[:, own] @ final.fit.terms.sizes[own]
    signal = beside(signal, final.fit.spanned(~own))
    pool, best = _tried_beside(found, name)
    # structure that was left over then counts as noise
    left = max(best / max(final.whiteness.dof, 1), final.whiteness.inflation**2)
    margin = _MENDED * _TOLD_APART * max(1.0, left)

    def likely(fitted: Fit, other: str) -> bool:
        if fitted.chi2 < best + margin:
            return True
        if len(found.found) < 2:
            return False
        # fitted beside another model, its own fit does not say all
        columns = beside(fitted.jacobian[:, fitted.terms.own(other)], without.span)
        return imitated(signal, basis(columns)) > _LIKELY

    return [
        c
        for c in pool
        if c.name not in final.fit.terms and c.fit is not None and likely(c.fit, c.name)
    ]


def _tried_beside(found: Search, name: str) -> tuple[Sequence[Candidate], float]:
    """Candidates of the step that chose the effect, beside all that came before; its chi2."""
    for step in reversed(found.steps):
        for c in step.candidates:
            if c.name == name:
                return step.candidates, c.fit.chi2 if c.fit is not None else found.last.fit.chi2
    return [], found.last.fit.chi2
