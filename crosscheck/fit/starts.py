"""Where to start fitting an effect: what its derivative promises, and the forces as measured.

The derivative at null says where a linear fit would end. Where cables go slack and taut as a
parameter moves, the solved pose jumps about, and a fit from null ends in the next hollow. At the
*measured* pose the forces depend on the parameters smoothly but for each cable's own slackness:
parameters that make them balance there are a start near the truth. (In identification: the
equation error, in place of the output error.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.problem import Problem
from crosscheck.fit.state import State, derivatives
from seecr import statics
from seecr.compiled.outcomes import CONVERGED
from seecr.effects import Term, Terms
from seecr.effects.base import Effect, Layout
from seecr.experiment import Prediction
from seecr.pose import Array, pose_add, pose_difference
from seecr.sensitivity import motion_of, sensitivities
from seecr.tables import assemble

# Steps of Gauss-Newton; halvings of a step that does not pay.
_STEPS, _HALVINGS = 12, 5
# Directions softer than this part of a row's stiffest say little about forces.
_SOFT = 0.02
# No cable is as stiff as this [N/m].
_ABSURD = 1e20
# The weak prior, in plausible sizes.
_PRIOR = 10.0
# A start is at most this many plausible sizes from null.
_START_SIZES = 3.0
# Part of the cables that are slack from which a fit may end in a hollow.
_SLACK_PART = 0.02
# Effects that shift no reading by this part of its noise, for plausible sizes, are not seen.
_UNSEEN = 0.02


@dataclass(frozen=True, eq=False)
class Starts:
    """Where to start fitting an effect, and what its derivative at null promises.

    Attributes:
        vectors: starting values, the most promising first.
        gain: linearised fall of chi2 of the best. directions: that the data see.
        shapes: about how many shapes were tried for it.
        seen: whether any reading moves by more than a trace of its noise.
    """

    vectors: tuple[Array, ...]
    gain: float
    directions: int
    shapes: float
    seen: bool


def starts_of(problem: Problem, base: Fit, layout: Layout, factor: Array) -> Starts:
    """The most promising starts of an effect beside the base model."""
    shapes = layout.effect.shapes(base.state.prediction.setup)
    scored: list[tuple[float, int, Array, dict[str, float]]] = []
    seen = False
    orthogonal = base.span
    for shape in shapes:
        null = layout.start(shape)
        scale = layout.scale * ~layout.shape
        white = amplitude_columns(problem, base, layout, null) * scale
        seen = seen or bool(np.max(np.abs(white), initial=0.0) > _UNSEEN)
        left = white - orthogonal @ (orthogonal.T @ white)
        z, gain, directions = _linear(left, base.state.white)
        z = np.clip(z, -_START_SIZES, _START_SIZES)
        vector = np.clip(null + z * scale, layout.lower, layout.upper)
        scored.append((gain, directions, vector, shape))
    if not scored:
        return Starts((), 0.0, 1, 1.0, False)
    scored.sort(key=lambda item: -item[0])
    vectors = [vector for _g, _d, vector, _s in scored[:2]]
    if np.any((layout.lower == layout.null) & ~layout.shape):
        # the derivative at a bound can point the wrong way: start inside as well
        inside = layout.start(scored[0][3])
        vectors = [vectors[0], np.where(layout.shape, inside, inside + 0.5 * layout.scale)]
    elif len(shapes) == 1:
        vectors = vectors[:1]
    if int(np.sum(~layout.shape)) > 1 and _some_slack(base):
        balanced = equation_start(problem, base.state, layout, layout.start(scored[0][3]), factor)
        vectors += [] if balanced is None else [balanced]
    # neighbouring shapes are alike: about every third is one more chance of its own
    gain, directions = scored[0][:2]
    return Starts(tuple(vectors), gain, directions, max(1.0, len(shapes) / 3.0), seen)


def _some_slack(base: Fit) -> bool:
    """Whether cables go slack in enough places for a fit to end in a hollow."""
    slack = base.state.prediction.slack
    return float(np.mean(slack)) > _SLACK_PART


def amplitude_columns(problem: Problem, base: Fit, layout: Layout, null: Array) -> Array:
    """(N, p) whitened derivatives by the effect's own parameters at null; 0 for shapes."""
    terms = base.terms.with_term(Term(layout, null))
    own = terms.own(layout.name)
    wanted = np.flatnonzero(own)
    amplitudes = wanted[~layout.shape]
    out = np.zeros((len(base.state.white), len(layout)))
    state = base.state.of(terms)
    if len(amplitudes):
        out[:, ~layout.shape] = derivatives(problem, state, amplitudes.tolist(), frozen=True)
    return out


def _linear(x: Array, r: Array) -> tuple[Array, float, int]:
    """Linear fit of r by columns x with a weak prior: values, fall of chi2, directions seen."""
    normal = x.T @ x
    z: Array = np.asarray(np.linalg.solve(normal + 1e-2 * np.eye(x.shape[1]), x.T @ r), float)
    left = r - x @ z
    directions = int(np.sum(np.linalg.eigvalsh(normal) > 1e-2))
    return z, float(r @ r - left @ left), max(1, directions)


def equation_start(
    problem: Problem, base: State, layout: Layout, start: Array, factor: Array
) -> Array | None:
    """Values of an effect that balance the forces at the measured poses best.

    Args:
        problem: the data; poses must have been measured as a whole.
        base: the model without the effect.
        layout: the effect.
        start: (p,) values to start from; shapes stay as they are there.
        factor: noise factors, :meth:`Problem.noise`.

    Returns:
        (p,) values, or None where this says nothing: effects of the sensors, rows that depend
        on the rows before, rotations that were not read, platforms on joints.
    """
    data = problem.data
    senses = layout.effect.edit_readings is not Effect.edit_readings
    if senses or data.quat_wxyz is None or base.prediction.has_history:
        return None
    if problem.robot.joints:
        return None  # a measured pose is off what joints can reach, by its noise
    whole = np.isfinite(data.position).all(axis=1) & np.isfinite(data.quat_wxyz).all(axis=1)
    rows = problem.use & whole
    if not rows.any() or base.prediction.setup.laws:
        return None
    forces = _Forces(problem, base, layout, factor, rows)
    values, cost, white, at = start, *forces.at(start)
    amplitudes = np.flatnonzero(~layout.shape)
    scale = layout.scale[amplitudes]
    for _ in range(_STEPS):
        if at is None:
            return None
        x = forces.derivatives(values, at, amplitudes) * scale
        z = (values - layout.null)[amplitudes] / scale
        normal = x.T @ x + np.eye(len(z)) / _PRIOR**2
        step = np.linalg.solve(normal, x.T @ white - z / _PRIOR**2)
        for _half in range(_HALVINGS):
            trial = values.copy()
            trial[amplitudes] += step * scale
            trial = np.clip(trial, layout.lower, layout.upper)
            after, white_after, at_after = forces.at(trial)
            if after < cost:
                break
            step = 0.5 * step
        else:
            break
        paid = cost - after
        values, cost, white, at = trial, after, white_after, at_after
        if paid < 1e-3 * cost:
            break
    return values


class _Forces:
    """Forces left over at the measured poses, as the displacements that would balance them."""

    def __init__(
        self, problem: Problem, base: State, layout: Layout, factor: Array,
        rows: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        self.problem, self.base, self.layout, self.factor = problem, base, layout, factor
        data, at = problem.data, base.prediction
        assert data.quat_wxyz is not None
        measured = np.concatenate([data.position, data.quat_wxyz], axis=1)
        read = np.concatenate([at.readings.position, at.readings.quat_wxyz], axis=1)
        # what the sensors do to a pose is taken off
        self.rows = rows & np.isfinite(read).all(axis=1)
        self.poses = at.pose.copy()
        off = pose_difference(measured[self.rows], read[self.rows])
        self.poses[self.rows] = pose_add(at.pose[self.rows], off)

    def terms(self, values: Array) -> Terms:
        """The model with the effect."""
        return self.base.terms.with_term(Term(self.layout, values))

    def at(self, values: Array) -> tuple[float, Array, Prediction | None]:
        """Cost and whitened displacements (N,), and the state they belong to."""
        problem, experiment = self.problem, self.base.experiment
        effects = self.terms(values).effects
        setup = experiment.setup(effects)
        if setup.has_history:
            return np.inf, np.zeros(0), None
        tables = assemble(setup)
        n, m = tables.cables.shape[:2]
        start = statics.Evaluation.empty(n, m, tables.n_dof)
        start.deviation[:] = statics.deviations(tables, self.poses)
        found = statics.evaluate(tables, start)
        found.deviation[:] = start.deviation
        # where a law has no answer the numbers are what was left of trying
        size = np.where(np.isfinite(found.hessian), np.abs(found.hessian), np.inf)
        broken = (found.outcome != CONVERGED) | (size.max(axis=(1, 2)) > _ABSURD)
        if np.any(broken & self.rows):
            return np.inf, np.zeros(0), None
        found.hessian[broken], found.gradient[broken] = 0.0, 0.0
        at = Prediction(setup, tables, found, self.base.prediction.readings, False)
        at.kept["inverse"] = _damped_inverse(found.hessian)
        moved = at.kept["inverse"] @ found.gradient[..., None]
        off = (motion_of(at) @ moved)[..., 0]
        table = np.full(problem.measured.shape, np.nan)
        table[self.rows, :6] = off[self.rows]
        white = self._white(np.where(np.isfinite(table), table, 0.0))
        return float(white @ white), white, at

    def derivatives(self, values: Array, at: Prediction, columns: NDArray[np.intp]) -> Array:
        """(N, k) of the displacements, whitened."""
        terms = self.terms(values)
        wanted = np.flatnonzero(terms.own(self.layout.name))[columns].tolist()
        rates = sensitivities(self.base.experiment, terms, at, wanted, frozen=True)
        rates[~self.rows] = 0.0
        rates[:, 6:] = 0.0
        return self._white(rates)

    def _white(self, values: Array) -> Array:
        return self.problem.whiten(self.factor, values)


def _damped_inverse(stiffness: Array) -> Array:
    """(K^2 + mu^2)^-1 K: what is soft or pushes away at the measured pose is not followed far."""
    power, vectors = np.linalg.eigh(stiffness)
    soft = _SOFT * np.max(np.abs(power), axis=1, keepdims=True)
    damped = power / np.maximum(power**2 + soft**2, 1e-300)
    return np.asarray((vectors * damped[:, None, :]) @ np.swapaxes(vectors, 1, 2), float)
