"""Fits effects to readings: damped Gauss-Newton with expected sizes as priors and its own noise.

The unknowns are z = (value - null)/scale with the prior z ~ N(0, width^2), and the coefficients of
at most one field F of an unknown effect, which are integrated out. The fit minimises

    <r, r> + ln det(noise) + sum (z/width)^2 + sum ((z_known - z)/s)^2

with <a, b> = a^T (Sigma + F F^T)^-1 b for residuals r in units of the stated noise (a field is
given in units of its prior width). Values that were measured independently are further readings.
Noise and weights of readings are estimated in turn with the values. A fit begins with white noise
as large as the median residual: that holds it together while it is far off, and no row counts as
far off because the model is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from crosscheck.fit.algebra import inverse_of, root_beside_one
from crosscheck.fit.problem import KINDS, Problem
from crosscheck.fit.state import State, evaluate, free_derivatives, known_left, known_readings
from crosscheck.inference.noise import (
    STATED_NOISE,
    Chain,
    Noise,
    chain_of,
    estimate,
    log_det,
    mixture,
    outliers,
    whitened,
)
from seecr.effects import Terms
from seecr.pose import Array

TRACKER = "tracker_frame"
"""The effect that has no expected size: a tracker may stand anywhere."""

FLAT, SHAPES = 300.0, 30.0
"""Prior widths of what has no expected size: a tracker's frame, and shapes."""

# Rounds of estimating noise and weights, the change at which these have settled, steps of a round.
_ROUNDS, _SETTLED, _STEPS = 4, 0.05, 6
# The factor by which noise falls at a time where a fit is cooled; it sets the effort.
_COOLER = 3.0
# A step is the last if it gains less than both this part of the objective and this much.
_PART, _GAIN = 1e-3, 1e-2
# Trials of a step, each damped ten times more; the longest step in expected sizes (or widths).
_DAMPINGS, _MOST = 12, 5.0
# A value whose posterior is no narrower than this part of its prior is not determined by the data.
_UNSEEN = 0.98
# A parameter of which an expected size moves the readings by less than this part of their noise
# moves none.
_IDLE = 1e-5


@dataclass(frozen=True, eq=False)
class Data:
    """What is fitted.

    Attributes:
        problem, factor: readings and their noise factors, :meth:`Problem.noise`.
        chain: the order of the readings.
        frozen: treat the history of the rows as constant in derivatives.
    """

    problem: Problem
    factor: Array
    chain: Chain
    frozen: bool = True

    @classmethod
    def of(cls, problem: Problem, terms: Terms, frozen: bool = True) -> Data:
        """The readings of a problem, with noise as a model sees it."""
        return cls(problem, problem.noise_under(terms.effects), chain_of(problem), frozen)

    @property
    def free(self) -> tuple[str, ...]:
        """Effects whose values belong to the data, of which no size is expected."""
        return self.problem.data.free

    def state(self, terms: Terms, near: State | None = None, trial: bool = False) -> State:
        """A model at given values; see :func:`evaluate`."""
        return evaluate(self.problem, terms, self.factor, near, trial)

    def derivatives(self, state: State) -> Array:
        """(N, p) derivatives of the prediction by z, in units of the stated noise."""
        return free_derivatives(self.problem, state, frozen=self.frozen)

    def width(self, terms: Terms, widths: Mapping[str, float]) -> Array:
        """(p,) prior standard deviations of z; 1 by default, 0 for values that are fixed."""
        flat = dict.fromkeys((TRACKER, *self.free), FLAT)
        each = {**flat, **widths}
        parts = [np.where(t.layout.shape, SHAPES, each.get(t.name, 1.0)) for t in terms]
        return np.where(terms.knowledge.fixed, 0.0, np.concatenate([np.zeros(0), *parts]))


class Metric:
    """The inner product <a, b> of a fit's residuals."""

    def __init__(self, chain: Chain, noise: Noise, weight: Array, field: Array | None) -> None:
        """Of some noise, weights (N,) of readings, and a field (N, k) in units of its width."""
        self.chain, self.noise, self.weight, self.field = chain, noise, weight, field
        if field is not None:
            self._columns = self.white(field)
            self._root = root_beside_one(self._columns)

    def white(self, values: Array) -> Array:
        """Whitened values, the field left in."""
        return whitened(self.chain, self.noise, self.weight, values)

    def split(self, values: Array) -> tuple[Array, Array]:
        """Whitened values a and what the field takes of them, b: <x, y> is a_x a_y - b_x b_y."""
        white = self.white(values)
        if self.field is None:
            return white, np.zeros((0, *values.shape[1:]))
        along = self._columns.T @ white
        part = linalg.solve_triangular(self._root, along, lower=True, check_finite=False)
        return white, np.asarray(part)

    def power(self, residual: Array) -> float:
        """<r, r> of a residual (N,)."""
        white, part = self.split(residual)
        return float(white @ white) - float(part @ part)

    def normal(self, x: Array, residual: Array) -> tuple[Array, Array]:
        """<x, x> and <x, r> of columns (N, p) and a residual (N,)."""
        (white, part), (left, rest) = self.split(x), self.split(residual)
        return white.T @ white - part.T @ part, white.T @ left - part.T @ rest

    def equations(self, state: State, jacobian: Array) -> tuple[Array, Array]:
        """Normal matrix (p, p) of z and gradient (p,) at a state, with what is known of values."""
        known = known_readings(state.terms)[0]
        normal, gradient = self.normal(jacobian, state.white)
        return normal + known.T @ known, gradient + known.T @ known_left(state.terms)

    def less_field(self, residual: Array) -> Array:
        """A residual (N,) without the most probable part of the field, if there is one."""
        if self.field is None:
            return residual
        _white, part = self.split(residual)
        most = linalg.solve_triangular(self._root, part, lower=True, trans=1, check_finite=False)
        return np.asarray(residual - self.field @ most)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit of effects, with its own noise.

    Attributes:
        data: what was fitted. state: the model at its best values.
        jacobian: (N, p) derivatives of the prediction by z at or near them.
        width: (p,) prior standard deviations of z; 0 for values that are held.
        noise: the noise. weight: (N,) weight of each reading.
        log_outliers: what the mixture for outliers adds to the ln likelihood.
        settled: whether the fit converged.
        field: (N, k) the field of an unknown effect in units of its width; None without one.
    """

    data: Data
    state: State
    jacobian: Array
    width: Array
    noise: Noise
    weight: Array
    log_outliers: float
    settled: bool
    field: Array | None = None

    @classmethod
    def at(
        cls, data: Data, state: State, jacobian: Array, width: Array, noise: Noise, rest: Array,
        field: Array | None, settled: bool = False,
    ) -> Fit:  # fmt: skip
        """With the weights that this noise gives to what is left, ``rest`` (N,)."""
        weight, added = mixture(data.chain, noise, rest)
        return cls(data, state, jacobian, width, noise, weight, added, settled, field)

    @property
    def terms(self) -> Terms:
        """The effects with their values."""
        return self.state.terms

    @property
    def z(self) -> Array:
        """(p,) values in expected sizes from null."""
        return self.terms.sizes

    @property
    def valid(self) -> bool:
        """Whether every counted row was solved."""
        return self.state.valid

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """(p,) values that ended on a bound."""
        terms = self.terms
        out = (terms.vector <= terms.lower) | (terms.vector >= terms.upper)
        return np.asarray(out & ~terms.knowledge.fixed)

    @property
    def outlying(self) -> NDArray[np.bool_]:
        """(n,) rows in which some kind of reading hardly counts."""
        return outliers(self.data.chain, self.weight, self.data.problem.data.n_rows)

    @property
    def free(self) -> NDArray[np.bool_]:
        """(p,) values that are neither held nor on a bound."""
        return (self.width > 0.0) & ~self.at_bound

    def with_far_off(self, rows: NDArray[np.bool_]) -> Fit:
        """The same, some rows (n,) marked as outliers, which rms errors leave out."""
        problem = self.data.problem.with_far_off(rows)
        return replace(self, data=replace(self.data, problem=problem))

    @cached_property
    def metric(self) -> Metric:
        """The inner product of its residuals."""
        return Metric(self.data.chain, self.noise, self.weight, self.field)

    @property
    def cost(self) -> float:
        """The objective: -2 ln of likelihood and prior, with the noise's volume."""
        noise = log_det(self.data.chain, self.noise) - 2.0 * self.log_outliers
        return _cost(self.metric, self.state, self.width) + noise

    @cached_property
    def left(self) -> Array:
        """(N,) residual without the field's part, in units of the stated noise."""
        return self.metric.less_field(self.state.white)

    @property
    def white(self) -> Array:
        """(N,) residual without the field's part, whitened."""
        return self.metric.white(self.left)

    @cached_property
    def equations(self) -> tuple[Array, Array]:
        """Normal matrix (p, p) and gradient (p,) of its values, see :meth:`Metric.equations`."""
        return self.metric.equations(self.state, self.jacobian)

    @cached_property
    def spread(self) -> Array:
        """(p, p) posterior covariance of z, from data and prior; 0 for values that do not move."""
        free = np.flatnonzero(self.free)
        out = np.zeros((len(self.width), len(self.width)))
        if len(free):
            own = np.ix_(free, free)
            out[own] = inverse_of(self.equations[0][own] + np.diag(self.width[free] ** -2.0))
        return out

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """(p,) values that the data determine: their posterior is narrower than their prior."""
        error = np.sqrt(np.diag(self.spread))
        return self.free & (error < _UNSEEN * np.where(self.width > 0.0, self.width, 1.0))

    @cached_property
    def covariance(self) -> Array:
        """(p, p) covariance of the values in their units; inf on the diagonal if not determined.

        A value on its bound has the error that it would have by itself.
        """
        scale = self.terms.scale
        out = self.spread * np.outer(scale, scale)
        lost = np.flatnonzero(~self.seen & ~self.terms.knowledge.fixed)
        out[lost, :], out[:, lost] = 0.0, 0.0
        for k in lost:
            out[k, k] = np.inf
            if self.at_bound[k]:
                power = self.metric.power(self.jacobian[:, k])
                alone = np.sqrt(1.0 / max(power, 1e-300))
                out[k, k] = (scale[k] * alone) ** 2 if alone < _UNSEEN * self.width[k] else np.inf
        return out

    @property
    def stderr(self) -> Array:
        """(p,) standard errors in the units of the values; inf if not determined."""
        return np.sqrt(np.diag(self.covariance))

    def with_idle(self, covariance: Array) -> Array:
        """A covariance (p, p) in which what moves no reading has its expected size as error."""
        out, moves = covariance.copy(), np.linalg.norm(self.jacobian, axis=0)
        idle = np.isinf(np.diag(out)) & (moves < _IDLE)
        out[idle, idle] = self.terms.scale[idle] ** 2
        return out

    @property
    def correlation(self) -> Array:
        """(p, p) correlations of the values; 0 for parameters that are not determined."""
        error = np.where(np.isfinite(self.stderr) & (self.stderr > 0), self.stderr, np.inf)
        finite = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        out = finite / error[:, None] / error[None, :]
        np.fill_diagonal(out, 1.0)
        return out


def fit(
    data: Data,
    start: State,
    widths: Mapping[str, float] | None = None,
    field: Array | None = None,
    noise: Noise | None = None,
    rounds: int = _ROUNDS,
) -> Fit:
    """Fit a model from a valid state, with its own noise.

    Args:
        data, start: what is fitted, and the model at its starting values.
        widths: prior widths of its effects, in expected sizes; 1 by default.
        field: (N, k) columns of an unknown effect in units of their width, or None.
        noise: where to begin; by default white and as large as the median residual.
        rounds: of estimating the noise and fitting with it.
    """
    width = data.width(start.terms, widths or {})
    jacobian = data.derivatives(start)
    flat = Metric(data.chain, STATED_NOISE, np.ones(len(start.white)), field)
    rest = flat.less_field(start.white)
    noise = _hot(data.chain, rest) if noise is None else noise
    return _from(Fit.at(data, start, jacobian, width, noise, rest, field), rounds)


def _from(begun: Fit, rounds: int) -> Fit:
    """Fit values with the noise, and the noise with the values, until neither changes."""
    found = begun
    for k in range(rounds):
        state, jacobian, settled = _settle(
            found.data, found.state, found.width, found.metric, found.jacobian
        )
        found = replace(found, state=state, jacobian=jacobian, settled=settled)
        new, old = _noise_of(found), found.noise
        rest = replace(found, noise=new).metric.less_field(state.white)
        found = Fit.at(found.data, state, jacobian, found.width, new, rest, found.field, settled)
        change = np.abs(np.log(new.scale / old.scale)) + np.abs(new.rho - old.rho)
        if float(np.max(change)) < _SETTLED and k:
            break
    return found


def cooled(data: Data, start: State) -> State:
    """A model from a valid state, fitted under white noise that falls to what is stated.

    It is for all effects together, which leave no more than what is stated. Where a fit is far off,
    noise that is estimated beside it explains what is left, and the fit ends too early (graduated
    non-convexity: Blake and Zisserman, Visual Reconstruction, 1987).
    """
    width, state, jacobian = data.width(start.terms, {}), start, data.derivatives(start)
    noise, weight = _hot(data.chain, start.white), np.ones(len(start.white))
    while True:
        metric = Metric(data.chain, noise, weight, None)
        state, jacobian, _settled = _settle(data, state, width, metric, jacobian)
        if np.all(noise.scale == 1.0):
            return state
        noise = replace(noise, scale=np.maximum(noise.scale / _COOLER, 1.0))


def without_rows(fit: Fit, absent: NDArray[np.bool_]) -> State:
    """The model fitted without some readings (N,), from a fit of all of them, with its noise."""
    data = replace(fit.data, chain=fit.data.chain.without(absent))
    metric = Metric(data.chain, fit.noise, np.where(absent, 0.0, fit.weight), fit.field)
    return _settle(data, fit.state, fit.width, metric, fit.jacobian)[0]


def unfitted(data: Data, terms: Terms, state: State | None = None) -> Fit:
    """A model at its stated values in the form of a fit, with the stated noise; nothing moves."""
    state = data.state(terms) if state is None else state
    count, readings = len(terms), len(state.white)
    jacobian = data.derivatives(state) if state.valid else np.zeros((readings, count))
    none = np.zeros(count)
    return Fit(data, state, jacobian, none, STATED_NOISE, np.ones(readings), 0.0, state.valid)


def _hot(chain: Chain, residual: Array) -> Noise:
    """White noise as large as the median residual of each kind, and at least as stated."""
    scale = np.ones(len(KINDS))
    for k in np.unique(chain.kind):
        scale[k] = max(1.0, float(np.median(np.abs(residual[chain.kind == k]))) / 0.6745)
    return Noise(scale, np.zeros(len(KINDS)))


def _noise_of(fit: Fit) -> Noise:
    """The noise that maximises the marginal likelihood about a fit, the field integrated out."""
    terms, width = fit.terms, fit.width
    on_bound = (terms.vector <= terms.lower) | (terms.vector >= terms.upper)
    free = (width > 0.0) & ~on_bound
    x, wide, z = fit.jacobian[:, free], width[free], terms.sizes[free]
    # independent measurements narrow the prior and move its mean, and y with it
    known, readings = known_readings(terms)
    power = np.sum(known**2, axis=0)[free]
    narrow = 1.0 / np.sqrt(wide**-2.0 + power)
    middle = narrow**2 * (known.T @ readings)[free]
    y = fit.state.white + x @ (z - middle)
    if fit.field is not None:
        x, narrow = np.hstack([x, fit.field]), np.append(narrow, np.ones(fit.field.shape[1]))
    return estimate(fit.data.chain, fit.noise, fit.weight, x, y, narrow)


def _settle(
    data: Data, state: State, width: Array, metric: Metric, jacobian: Array, steps: int = _STEPS
) -> tuple[State, Array, bool]:
    """Gauss-Newton until nothing is gained: the state, its derivatives, whether it settled."""
    damping = 1e-4
    for _ in range(steps):
        step = _step(data, state, jacobian, width, metric, damping)
        if step is None:
            return state, jacobian, True
        before, gain, state, damping = step
        if gain < max(_PART * before, _GAIN):
            return state, jacobian, True  # so near that the derivatives are still accurate
        jacobian = data.derivatives(state)
    return state, jacobian, False


def _step(
    data: Data, state: State, jacobian: Array, width: Array, metric: Metric, damping: float
) -> tuple[float, float, State, float] | None:
    """The objective, by how much a step lowers it, the state then and the next damping, or None."""
    terms, z = state.terms, state.terms.sizes
    normal, gradient = metric.equations(state, jacobian)
    move = _movable(-gradient, terms, width)
    if len(move) == 0:
        return None
    inverse2 = 1.0 / width[move] ** 2
    slope = z[move] * inverse2 - gradient[move]
    normal = normal[np.ix_(move, move)] + np.diag(inverse2)
    before = _cost(metric, state, width)
    for _ in range(_DAMPINGS):
        step = np.zeros(len(z))
        step[move] = -np.linalg.solve(normal + np.diag(damping * np.diag(normal)), slope)
        step *= min(1.0, _MOST / max(float(np.max(np.abs(step) / np.maximum(width, 1.0))), 1e-300))
        expected = -(2.0 * slope @ step[move] + step[move] @ normal @ step[move])
        if expected < 0.1 * _GAIN:
            return None
        moved = np.clip(terms.vector + step * terms.scale, terms.lower, terms.upper)
        trial = data.state(terms.with_vector(moved), state, trial=True)
        after = _cost(metric, trial, width) if trial.valid else np.inf
        if after < before:
            return before, before - after, trial, max(0.1 * damping, 1e-9)
        damping = max(10.0 * damping, 1e-4)
    return None


def _movable(slope: Array, terms: Terms, width: Array) -> NDArray[np.intp]:
    """Indices of parameters that may move: neither held nor pushed against a bound."""
    slope = slope + terms.sizes / np.where(width > 0.0, width, 1.0) ** 2
    low = (terms.vector <= terms.lower) & (slope > 0)
    high = (terms.vector >= terms.upper) & (slope < 0)
    return np.flatnonzero((width > 0.0) & ~low & ~high)


def _cost(metric: Metric, at: State, width: Array) -> float:
    """The objective: -2 ln of likelihood and prior, with this noise, up to a constant."""
    off, free = known_left(at.terms), width > 0.0
    prior = float(np.sum((at.terms.sizes[free] / width[free]) ** 2))
    return metric.power(at.white) + float(off @ off) + at.log_det + prior
