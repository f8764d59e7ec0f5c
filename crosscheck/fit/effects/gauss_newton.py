"""Damped Gauss-Newton fit of effects to measurements.

Unknowns are in plausible sizes from null, z = (value - null)/scale. A weak prior with a standard
deviation of ten plausible sizes keeps unidentifiable directions near null. A trial step is rejected
if a row cannot be solved there; a fit whose start cannot be solved is invalid and gives no number.
Fixed values stay as they are; values measured independently count as further readings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.imitation import basis
from crosscheck.fit.least_squares.known import free_derivatives, known_left, known_readings
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, evaluate
from seecr.effects import Terms
from seecr.pose import Array

# Standard deviation of the weak prior, in plausible sizes.
PRIOR_SIZES = 10.0
# A direction with a larger standard error than this, in plausible sizes, is not identifiable.
UNSEEN_SIZES = 100.0
# A parameter of which a plausible size moves the readings by less than this part of their noise
# moves none.
_IDLE = 1e-5
_ITERATIONS = 40
_GAIN = 1e-3
# Most trials of a step, each damped ten times more than the last; longest step, in plausible sizes.
_DAMPINGS, _LONGEST = 12, 5.0
# A hopeless fit is given up after _FEW steps, or after _FEW_FAR if chi2 is _FAR times the limit.
_FEW, _FEW_FAR, _FAR = 4, 2, 10.0
# Derivatives serve for at most this many further steps before they are computed again.
_STALE = 2


class FitStatus(Enum):
    """How a fit ended; the values of the enum are what people read."""

    SOLVED = "every row that counts was solved"
    UNSOLVED_AT_START = "some rows could not be solved at the start of the fit"
    UNSOLVED_AT_VALUES = "some rows could not be solved with the model's values"


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted terms and the uncertainty of their parameters.

    Most fits of a search are only asked for their values. Derivatives at these values cost more
    than the values themselves, so they are computed when they are first needed.

    Attributes:
        state: the model at its best values.
        derive: computes ``jacobian``.
        spread: computes ``covariance`` from the jacobian.
        at_bound: (p,) bool parameters that ended on a bound.
        status: whether all rows were solved.
        iterations: number of Gauss-Newton steps.
        settled: whether the fit converged before it ran out of steps.
    """

    state: State
    derive: Callable[[], Array]
    spread: Callable[[Array], Array]
    at_bound: NDArray[np.bool_]
    status: FitStatus
    iterations: int
    settled: bool = True

    @property
    def valid(self) -> bool:
        """Whether every counted row was solved, so that the numbers are those of a fit."""
        return self.status is FitStatus.SOLVED

    @property
    def terms(self) -> Terms:
        """The effects with their fitted values."""
        return self.state.terms

    @property
    def chi2(self) -> float:
        """Sum of squared whitened residuals."""
        return self.state.chi2

    @cached_property
    def jacobian(self) -> Array:
        """(N, p) whitened derivatives of the prediction by z; 0 for fixed values."""
        return self.derive()

    @cached_property
    def covariance(self) -> Array:
        """(p, p) covariance of the values in their units; inf on the diagonal if unidentifiable."""
        return self.spread(self.jacobian)

    @cached_property
    def span(self) -> Array:
        """Basis (N, k) of all signals that the parameters can imitate, see :meth:`spanned`."""
        return self.spanned(np.ones(len(self.terms), dtype=bool))

    def spanned(self, which: NDArray[np.bool_]) -> Array:
        """Basis (N, k) of the signals that some parameters (p,) can imitate.

        The basis is orthonormal. If values were measured independently its vectors are shorter,
        because such parameters are not free to imitate anything.
        """
        columns, _readings = known_readings(self.terms)
        whole = np.concatenate([self.jacobian, columns])[:, which]
        return basis(whole)[: len(self.jacobian)]

    @property
    def stderr(self) -> Array:
        """(p,) standard errors; inf for a parameter that is not identifiable."""
        return np.sqrt(np.diag(self.covariance))

    def with_idle(self, covariance: Array) -> Array:
        """A covariance (p, p) in which no value is unknown only because it moves no reading.

        A force across the plane of a planar robot is never seen, nor is it felt. The error of such
        a value is its plausible size.
        """
        out, moves = covariance.copy(), np.linalg.norm(self.jacobian, axis=0)
        idle = np.isinf(np.diag(out)) & (moves < _IDLE)
        out[idle, idle] = self.terms.scale[idle] ** 2
        return out

    @property
    def correlation(self) -> Array:
        """(p, p) correlations of the values; 0 for parameters that are not identifiable."""
        error = np.where(np.isfinite(self.stderr) & (self.stderr > 0), self.stderr, np.inf)
        finite = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        out = finite / error[:, None] / error[None, :]
        np.fill_diagonal(out, 1.0)
        return out


def fit(
    problem: Problem,
    terms: Terms,
    factor: Array,
    start: State | None = None,
    free: NDArray[np.bool_] | None = None,
    iterations: int = _ITERATIONS,
    hopeless: float = np.inf,
    quick: bool = False,
) -> Fit:
    """Fit the terms' parameters, starting from their values.

    Args:
        problem: readings and their noise.
        terms: effects; their values are the starting point.
        factor: noise factors, :meth:`Problem.noise`, constant during the fit.
        start: a solved state near the starting point, to save time.
        free: (p,) which parameters may move, apart from fixed ones; by default all.
        iterations: most Gauss-Newton steps.
        hopeless: stop after a few steps if chi2 is still above this.
        quick: treat the history of the rows as constant in derivatives. That is accurate enough to
            compare models, but not for final values.
    """
    state = evaluate(problem, terms, factor, start)
    if not state.valid:
        return not_fitted(state, FitStatus.UNSOLVED_AT_START, np.inf)
    fixed = terms.knowledge.fixed
    descent = _Descent(problem, factor, ~fixed if free is None else free & ~fixed, quick)
    end = descent.run(state, iterations if len(terms) else 0, hopeless)
    state = end.state
    found = state.terms
    at_bound = ((found.vector <= found.lower) | (found.vector >= found.upper)) & ~fixed
    return Fit(
        state,
        partial(_derived, descent, end),
        partial(_spread, found, descent.free & ~at_bound),
        at_bound,
        FitStatus.SOLVED,
        end.count,
        end.settled,
    )


def _derived(descent: _Descent, end: _End) -> Array:
    return descent.jacobian(end.state) if end.jacobian is None else end.jacobian


def _spread(found: Terms, moved: NDArray[np.bool_], jacobian: Array) -> Array:
    """Covariance (p, p) of the values, given readings and independent measurements; 0 if fixed."""
    whole = np.concatenate([jacobian, known_readings(found)[0]])
    covariance = _covariance(whole, found.scale, moved)
    covariance[found.knowledge.fixed] = 0.0
    return covariance


def not_fitted(state: State, status: FitStatus, variance: float) -> Fit:
    """A model at values that no fit has moved, in the form of a fit; (p, p) covariances are alike.

    Args:
        state: the model. status: whether its rows were solved. variance: the covariances.
    """
    p = len(state.terms)
    return Fit(
        state,
        partial(np.zeros, (len(state.white), p)),
        partial(_alike, np.full((p, p), variance)),
        np.zeros(p, dtype=bool),
        status,
        0,
    )


def _alike(covariance: Array, _jacobian: Array) -> Array:
    return covariance


def _corrected(jacobian: Array, before: State, after: State) -> Array:
    """Broyden's rank-one update: makes the derivatives agree with the change of the last step."""
    step = after.terms.sizes - before.terms.sizes
    change = before.white - after.white  # of the prediction
    length = float(step @ step)
    if length == 0.0:
        return jacobian
    return jacobian + np.outer(change - jacobian @ step, step) / length


def _objective(state: State) -> float:
    z, off = state.terms.sizes / PRIOR_SIZES, known_left(state.terms)
    return state.chi2 + state.log_det + float(z @ z) + float(off @ off)


@dataclass(frozen=True, eq=False)
class _End:
    """Where a descent ended.

    Attributes:
        state: the best state. jacobian: its derivatives, if they are known already.
        count: number of steps. settled: whether nothing was left to gain.
    """

    state: State
    jacobian: Array | None
    count: int
    settled: bool


@dataclass(frozen=True, eq=False)
class _Tried:
    """One step of a descent.

    Attributes:
        state: the new state; None if no step improves the objective.
        damping: what the next step begins with.
        gain: how far the objective fell. promised: how far it should fall by the derivatives.
    """

    state: State | None
    damping: float
    gain: float = 0.0
    promised: float = 0.0


@dataclass(frozen=True, eq=False)
class _Descent:
    """Damped Gauss-Newton on a problem, in which only the ``free`` (p,) parameters move."""

    problem: Problem
    factor: Array
    free: NDArray[np.bool_]
    quick: bool

    def jacobian(self, state: State) -> Array:
        """(N, p) whitened derivatives of the prediction by z."""
        return free_derivatives(self.problem, state, frozen=self.quick)

    def run(self, state: State, iterations: int, hopeless: float) -> _End:
        """Descend to the best state within so many steps; give up where chi2 is hopeless."""
        damping, count, stale = 1e-3, 0, 0
        jacobian = np.zeros((0, len(state.terms)))
        while count < iterations:
            count += 1
            if stale == 0:
                jacobian = self.jacobian(state)
            step = self.step(state, jacobian, damping)
            after, damping = step.state, step.damping
            if after is None:
                if stale == 0:
                    return _End(state, jacobian, count, True)
                stale = 0  # the derivatives are of an earlier step: try again with new ones
                continue
            # derivatives cost much more than a trial: they are reused while steps go well
            if stale < _STALE and (
                after.chi2 < 0.3 * state.chi2 or step.gain > 0.9 * step.promised
            ):
                stale += 1
                jacobian = _corrected(jacobian, state, after)
            else:
                stale = 0
            state = after
            lost = state.chi2 > (hopeless if count >= _FEW else _FAR * hopeless)
            if step.gain < _GAIN:
                return _End(state, None, count, True)
            if count >= _FEW_FAR and lost:
                break
        return _End(state, None, count, iterations == 0)

    def step(self, state: State, jacobian: Array, damping: float) -> _Tried:
        """The first step that improves the objective, with more and more damping."""
        terms, z = state.terms, state.terms.sizes
        known, off = known_readings(terms)[0], known_left(terms)
        gradient = z / PRIOR_SIZES**2 - jacobian.T @ state.white - known.T @ off
        normal = jacobian.T @ jacobian + known.T @ known + np.eye(len(z)) / PRIOR_SIZES**2
        move = self._moving(terms, gradient)
        if len(move) == 0:
            return _Tried(None, damping)
        before = _objective(state)
        for _ in range(_DAMPINGS):
            by = _damped_step(normal, gradient, move, damping)
            values = np.clip(terms.vector + by * terms.scale, terms.lower, terms.upper)
            there = terms.with_vector(values)
            trial = evaluate(self.problem, there, self.factor, state, trial=True)
            after = _objective(trial) if trial.valid else np.inf
            promised = -2.0 * float(gradient @ by + 0.5 * by @ normal @ by)
            if after < before:
                return _Tried(trial, max(0.2 * damping, 1e-9), before - after, promised)
            if trial.valid and promised < _GAIN:  # nothing left to gain
                break
            damping = max(10.0 * damping, 1e-4)
        return _Tried(None, damping)

    def _moving(self, terms: Terms, gradient: Array) -> NDArray[np.intp]:
        """Indices of parameters that are free and not pushed against a bound."""
        low = (terms.vector <= terms.lower) & (gradient > 0)
        high = (terms.vector >= terms.upper) & (gradient < 0)
        return np.flatnonzero(self.free & ~low & ~high)


def _damped_step(normal: Array, gradient: Array, move: NDArray[np.intp], damping: float) -> Array:
    """(p,) step in plausible sizes, shortened so that no element exceeds ``_LONGEST``."""
    part = normal[np.ix_(move, move)]
    step = np.zeros(len(gradient))
    step[move] = -np.linalg.solve(part + np.diag(damping * np.diag(part)), gradient[move])
    return step * min(1.0, _LONGEST / max(float(np.max(np.abs(step))), 1e-300))


def _covariance(jacobian: Array, scale: Array, moved: NDArray[np.bool_]) -> Array:
    """Covariance of the values; inf on the diagonal for parameters that are not identifiable."""
    p = jacobian.shape[1]
    out = np.zeros((p, p))
    index = np.flatnonzero(moved)
    if len(index):
        _u, s, vt = np.linalg.svd(jacobian[:, index], full_matrices=False)
        seen = s > 1.0 / UNSEEN_SIZES
        v = vt[seen].T / s[seen]
        block = v @ v.T
        lost = 1.0 - np.sum(vt[seen] ** 2, axis=0)
        unseen = lost > 1e-4
        block[unseen, :] = 0.0
        block[:, unseen] = 0.0
        block[unseen, unseen] = np.inf
        out[np.ix_(index, index)] = block * scale[index][:, None] * scale[index][None, :]
    # a parameter that did not move or is on its bound gets the error that it would have by itself
    for k in np.flatnonzero(~moved):
        norm = float(np.linalg.norm(jacobian[:, k])) if len(jacobian) else 0.0
        out[k, k] = (scale[k] / norm) ** 2 if norm * UNSEEN_SIZES > 1.0 else np.inf
    return out
