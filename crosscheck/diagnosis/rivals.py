"""What these data cannot tell apart, from the subspaces that effects span, and from refits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.diagnosis.search import EQUAL, Search
from crosscheck.fit.candidates import Candidate, try_candidate
from crosscheck.fit.evidence import evidence
from crosscheck.fit.gauss_newton import Fit, basis, fit, projected
from seecr.effects import catalogue
from seecr.effects.base import Layout
from seecr.pose import Array

# An effect that can imitate less than this part of another's signal is not refitted for it.
_LIKELY = 0.9
# A rival that leaves this much more chi2 has been told apart, whatever its evidence.
_TOLD_APART = 9.0


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
        return next(t.layout for t in self.fit.terms if t.name == self.name)


def rivals_of(found: Search, name: str) -> list[Rival]:
    """Effects that could stand in for ``name`` in the final model, the best first."""
    problem, factor, scale = found.problem, found.factor, found.noise_scale
    final = found.last
    rest = final.fit.terms.without(name)
    without = fit(problem, rest, factor, final.fit.state) if rest else found.steps[0].fit
    if not without.valid:
        return []
    out = []
    for candidate in _likely(found, name, without):
        trial = candidate
        if trial.fit is None or len(found.found) > 1:
            trial = try_candidate(problem, without, candidate.layout, factor, scale)
        if trial.fit is None or not trial.fit.valid:
            continue
        best = fit(problem, trial.fit.terms, factor, trial.fit.state)
        if not best.valid:
            continue
        # where structure is left over, differences count against that, not against the noise
        left = max(1.0, final.whiteness.scale**2)
        loss = (final.evidence.log - evidence(best, scale).log) / left
        worse = (best.chi2 - final.fit.chi2) / scale**2 / left
        if abs(loss) < EQUAL and worse < _TOLD_APART:
            out.append(Rival(candidate.name, best, loss))
    # one that contains another (friction on a cable behind the exit point, with no friction)
    # says nothing that the other does not
    names = {name, *(r.name for r in out)}
    out = [r for r in out if catalogue()[r.name].parent not in names]
    return sorted(out, key=lambda r: r.loss)


def _likely(found: Search, name: str, without: Fit) -> list[Candidate]:
    """Candidates that fitted nearly as well as the effect, or can imitate what it does."""
    final = found.last
    have = final.fit.terms.names
    own = final.fit.terms.own(name)
    signal = final.fit.jacobian[:, own] @ final.fit.terms.sizes[own]
    signal = projected(signal[:, None], final.fit.jacobian[:, ~own])[:, 0]
    pool, best = _tried_beside(found, name)
    # structure that was left over then counts as noise
    margin = 4.0 * _TOLD_APART * max(found.noise_scale**2, best / max(final.whiteness.dof, 1))
    out = []
    for c in pool:
        if c.name in have or c.fit is None:
            continue
        if c.fit.chi2 < best + margin:
            out.append(c)
        elif len(found.found) > 1:
            # fitted beside another model, its own fit does not say all
            columns = c.fit.jacobian[:, c.fit.terms.own(c.name)]
            if contained(signal, projected(columns, without.jacobian)) > _LIKELY:
                out.append(c)
    return out


def _tried_beside(found: Search, name: str) -> tuple[list[Candidate], float]:
    """Candidates of the step that chose the effect, beside all that came before; its chi2."""
    for step in reversed(found.steps):
        for c in step.candidates:
            if c.name == name:
                return step.candidates, c.fit.chi2 if c.fit is not None else found.last.fit.chi2
    return [], found.last.fit.chi2


def contained(signal: Array, columns: Array) -> float:
    """Part of a signal's power that columns can imitate."""
    power = float(signal @ signal)
    if power == 0.0 or columns.shape[1] == 0:
        return 0.0
    imitated = basis(columns).T @ signal
    return float(imitated @ imitated) / power


def containment(a: Array, b: Array) -> float:
    """Part of what effect a does, over its plausible sizes, that b can imitate: 1 - lam_g|h/lam_g.

    Args:
        a, b: (N, p) whitened derivatives by plausible sizes.
    """
    power = float(np.sum(a**2))
    if power == 0.0:
        return 0.0
    left = projected(a, b)
    return 1.0 - float(np.sum(left**2)) / power
