"""Fits many effects at once: damped Gauss-Newton with plausible sizes as priors.

The unknowns are z = (value - null)/scale with the prior z ~ N(0, width^2), which keeps poorly
identifiable parameters near null. The noise is tempered: it starts at up to a hundred times its
size, so that the prior holds the fit together while it is far off, and then decreases. Rows that
are far off get less weight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.noise.colour import WHITE, Chain, Colour, whitened
from crosscheck.calibration.noise.robust import row_weights
from crosscheck.fit.least_squares.known import free_derivatives, known_left, known_readings
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, evaluate
from seecr.effects import Terms
from seecr.pose import Array

TEMPERS = (100.0, 30.0, 10.0, 3.0, 1.0)
# Gauss-Newton steps at each temperature, and at the last one.
_STEPS, _LAST = 4, 20
# A step is the last if it gains less than both this part of the objective and this much.
_PART, _GAIN = 1e-3, 1e-2
# Largest step in plausible sizes, or in prior widths if these are larger.
_MOST = 5.0


@dataclass(frozen=True, eq=False)
class JointFit:
    """A joint fit.

    Attributes:
        state: the model at its best values.
        jacobian: (N, p) derivatives of the prediction by z, in units of the stated noise.
        width: (p,) prior standard deviations of z.
        colour: the noise of the fit.
        weight: (N,) weight of each reading.
        settled: whether the fit converged.
    """

    state: State
    jacobian: Array
    width: Array
    colour: Colour
    weight: Array
    settled: bool

    @property
    def terms(self) -> Terms:
        """The effects with their values."""
        return self.state.terms

    @property
    def z(self) -> Array:
        """(p,) values in plausible sizes from null."""
        return self.state.terms.sizes

    def whitened(self, chain: Chain, values: Array) -> Array:
        """Whiten residuals (N,) or derivatives (N, p) that are in units of the stated noise."""
        return whitened(chain, self.colour, self.weight, values)


@dataclass(frozen=True, eq=False)
class Setting:
    """What stays the same during a fit.

    Attributes:
        problem, factor: the data and their noise factors, :meth:`Problem.noise`.
        chain: the order of the readings.
        frozen: treat the history of the rows as constant in derivatives.
        watch: called after each step with chi2 per reading.
        weight: (N,) weight of each reading; None to compute it from the residuals.
    """

    problem: Problem
    factor: Array
    chain: Chain
    frozen: bool = False
    watch: Callable[[float], None] = lambda _chi2: None
    weight: Array | None = None

    @property
    def free(self) -> tuple[str, ...]:
        """Effects whose values belong to the data."""
        return self.problem.data.free

    def weight_at(self, colour: Colour, state: State) -> Array:
        """(N,) weight of each reading."""
        return row_weights(self.chain, colour, state.white) if self.weight is None else self.weight


@dataclass(frozen=True, eq=False)
class _Step:
    """A step that lowers the objective: by how much, the objective before, and the new state."""

    gain: float
    before: float
    damping: float
    state: State


def tempered(setting: Setting, start: State, width: Array) -> JointFit:
    """Fit with white noise scaled up, by a hundred at most, and then less and less."""
    far = np.sqrt(start.chi2 / max(len(start.white), 1))
    joint = None
    for temper in TEMPERS:
        if temper > max(far, 1.0):
            continue  # the model is nearer than that already
        steps = _LAST if temper == TEMPERS[-1] else _STEPS
        state, known = (start, None) if joint is None else (joint.state, joint.jacobian)
        joint = settle(setting, state, width, WHITE.hotter(temper), steps, known)
    assert joint is not None
    return JointFit(joint.state, joint.jacobian, width, WHITE, joint.weight, joint.settled)


def settle(
    setting: Setting,
    state: State,
    width: Array,
    colour: Colour,
    steps: int = _LAST,
    jacobian: Array | None = None,
) -> JointFit:
    """Make Gauss-Newton steps until nothing is gained.

    Args:
        setting: data and derivatives.
        state: where to start; must be valid.
        width: (p,) prior standard deviations of z; 0 holds a parameter.
        colour: the noise.
        steps: most steps.
        jacobian: derivatives at the start or very near to it, if they are known.
    """
    damping, settled = 1e-4, False
    weight = setting.weight_at(colour, state)
    if jacobian is None:
        jacobian = scaled_derivatives(setting, state)
    for _ in range(steps):
        step = _step(setting, state, jacobian, width, colour, weight, damping)
        if step is None:
            settled = True
            break
        damping, state = step.damping, step.state
        setting.watch(state.chi2 / max(len(state.white), 1))
        weight = setting.weight_at(colour, state)
        if step.gain < max(_PART * step.before, _GAIN):
            settled = True  # so near that the derivatives are still accurate
            break
        jacobian = scaled_derivatives(setting, state)
    return JointFit(state, jacobian, width, colour, weight, settled)


def moved_on(setting: Setting, joint: JointFit, weight: Array, steps: int) -> State:
    """Continue a fit with other weights (N,) of readings, with its present derivatives."""
    state, damping = joint.state, 1e-9
    for _ in range(steps):
        step = _step(setting, state, joint.jacobian, joint.width, joint.colour, weight, damping)
        if step is None:
            break
        damping, state = step.damping, step.state
        if step.gain < _GAIN:
            break
    return state


def scaled_derivatives(setting: Setting, state: State) -> Array:
    """(N, p) derivatives of the prediction by z, in units of the stated noise."""
    return free_derivatives(setting.problem, state, frozen=setting.frozen)


def _step(
    setting: Setting, state: State, jacobian: Array, width: Array, colour: Colour,
    weight: Array, damping: float,
) -> _Step | None:  # fmt: skip
    """A step that lowers the objective; None if there is none."""
    terms = state.terms
    scale, lower, upper = terms.scale, terms.lower, terms.upper
    values, z = terms.vector, terms.sizes

    def objective(at: State) -> float:
        return cost(setting, colour, weight, at, width)

    known = known_readings(terms)[0]
    x = np.concatenate([whitened(setting.chain, colour, weight, jacobian), known])
    y = np.concatenate(
        [whitened(setting.chain, colour, weight, state.white), known_left(terms)]
    )  # fmt: skip
    move = _movable(-x.T @ y, z, width, values, (lower, upper))
    if len(move) == 0:
        return None
    x, inverse2 = x[:, move], 1.0 / width[move] ** 2
    gradient = z[move] * inverse2 - x.T @ y
    normal = x.T @ x + np.diag(inverse2)
    before = objective(state)
    for _ in range(12):
        step = np.zeros(len(z))
        damped = normal + np.diag(damping * np.diag(normal))
        step[move] = -np.linalg.solve(damped, gradient)
        step *= min(1.0, _MOST / max(float(np.max(np.abs(step) / np.maximum(width, 1.0))), 1e-300))
        moved = np.clip(values + step * scale, lower, upper)
        expected = -(2.0 * gradient @ step[move] + step[move] @ normal @ step[move])
        if expected < 0.1 * _GAIN:
            return None
        there = terms.with_vector(moved)
        trial = evaluate(setting.problem, there, setting.factor, state, trial=True)
        after = objective(trial) if trial.valid else np.inf
        if after < before:
            return _Step(before - after, before, max(0.1 * damping, 1e-9), trial)
        damping = max(10.0 * damping, 1e-4)
    return None


def _movable(
    slope: Array, z: Array, width: Array, values: Array, limits: tuple[Array, Array]
) -> NDArray[np.intp]:
    """Indices of parameters that may move: neither held nor pushed against a bound."""
    lower, upper = limits
    slope = slope + z / np.where(width > 0.0, width, 1.0) ** 2
    held = (width == 0.0) | ((values <= lower) & (slope > 0)) | ((values >= upper) & (slope < 0))
    return np.flatnonzero(~held)


def cost(setting: Setting, colour: Colour, weight: Array, at: State, width: Array) -> float:
    """The objective of a joint fit: -2 ln of likelihood and prior, up to a constant.

    Noise and weights are taken as given.
    """
    white = whitened(setting.chain, colour, weight, at.white)
    off = known_left(at.terms)
    power = float(white @ white) + float(off @ off)
    return power + at.log_det + penalty(at.terms.sizes, width)


def penalty(z: Array, width: Array) -> float:
    """Contribution of the prior to the objective."""
    free = width > 0.0
    return float(np.sum((z[free] / width[free]) ** 2))
