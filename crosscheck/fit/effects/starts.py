"""Chooses starting points for the fit of an effect, from its derivatives and from the forces.

The derivative at null tells where a linear fit would end. But where cables change between slack and
taut as a parameter moves, the solved pose jumps, and a fit that starts at null ends in a local
minimum nearby. At the *measured* poses, forces depend smoothly on the parameters apart from each
cable's own slackness, so parameters that balance them there are a start near the optimum. (In
system identification: the equation error instead of the output error.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.least_squares.definite import solved
from crosscheck.fit.least_squares.imitation import beside
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, derivatives, evaluate
from seecr.compiled.outcomes import CONVERGED
from seecr.effects import Term, Terms
from seecr.effects.base import Effect, Layout
from seecr.pose import Array
from seecr.pose_rows import changes_between, moved_by
from seecr.prediction.experiment import Prediction
from seecr.prediction.parted import PartedPrediction
from seecr.prediction.sensitivity import motion_of, sensitivities, with_inverse
from seecr.statics import batch
from seecr.statics.tables import assemble
from seecr.threads import run_parts

# Most evaluations of the forces; the search ends if their sum of squares falls by a smaller part.
_EVALUATIONS, _FALL = 15, 1e-3
# The search begins so far inside the bounds, in plausible sizes.
_INSIDE = 1e-6
# Directions that are softer than this part of a row's stiffest one say little about forces.
_SOFT = 0.02
# No cable is as stiff as this [N/m].
_ABSURD = 1e20
# A start is at most this many plausible sizes from null.
_START_SIZES = 3.0
# If more than this part of the cables is slack, a fit may end in a local minimum.
_SLACK_PART = 0.02
# An effect is not seen if its plausible size shifts no reading by more than this part of its noise.
UNSEEN = 0.02
# With fewer rows than this, a second thread for the shapes of an effect does not pay.
_MANY_ROWS = 600


@dataclass(frozen=True, eq=False)
class Starts:
    """Starting points for the fit of an effect, and what its derivative at null promises.

    Attributes:
        vectors: starting values, the most promising first.
        balanced: computes values that balance the forces, or None; it takes a while.
        gain: promised fall of chi2 at the best shape.
        directions: how many directions of the parameters the data see.
        shapes: effective number of shapes that were tried, to correct p-values.
        seen: whether a plausible size moves any reading by more than a trace of its noise.
    """

    vectors: tuple[Array, ...]
    gain: float
    directions: int
    shapes: float
    seen: bool
    balanced: Callable[[], Array | None] | None = None

    def __iter__(self) -> Iterator[Array]:
        """The starting values, in the order in which to try them."""
        yield from self.vectors
        further = None if self.balanced is None else self.balanced()
        if further is not None:
            yield further


def starts_of(problem: Problem, base: Fit, layout: Layout, factor: Array) -> Starts:
    """The most promising starting points of an effect beside the base model."""
    shapes = layout.effect.shapes(base.state.prediction.setup)
    if not shapes:
        return Starts((), 0.0, 1, 1.0, False)
    scored = _scored(problem, base, layout, shapes)
    seen = any(one.seen for one in scored)
    scored.sort(key=lambda one: -one.gain)
    best = scored[0]
    gain, directions = best.gain, best.directions
    vectors = [one.vector for one in scored[:2]]
    if np.any((layout.lower == layout.null) & ~layout.shape):
        # at a bound the derivative can point the wrong way: start inside as well
        inside, across = _across(problem, base, Term(layout, best.null), factor)
        vectors = [vectors[0], inside] if across < gain else [inside, vectors[0]]
        gain = max(gain, across)
    elif len(shapes) == 1:
        vectors = vectors[:1]
    balanced = None
    if int(np.sum(~layout.shape)) > 1 and _some_slack(base):
        balanced = partial(equation_start, problem, base.state, layout, best.null, factor)
    # neighbouring shapes are alike: every third counts as an independent trial
    return Starts(tuple(vectors), gain, directions, max(1.0, len(shapes) / 3.0), seen, balanced)


@dataclass(frozen=True, eq=False)
class _Scored:
    """What the linear model promises of an effect at one shape.

    Attributes:
        null: (p,) null values at this shape. vector: (p,) values that explain most.
        gain: fall of chi2. directions: number of directions that the data see.
        seen: whether a plausible size moves any reading.
    """

    null: Array
    vector: Array
    gain: float
    directions: int
    seen: bool


def _scored(
    problem: Problem, base: Fit, layout: Layout, shapes: Sequence[dict[str, float]]
) -> list[_Scored]:
    """What the linear model promises of an effect at each shape, in their order."""
    span = base.span  # computed once, before the threads need it
    scale = layout.scale * ~layout.shape

    def score(shape: dict[str, float]) -> _Scored:
        null = layout.start(shape)
        white = amplitude_columns(problem, base, layout, null) * scale
        seen = bool(np.max(np.abs(white), initial=0.0) > UNSEEN)
        z, gain, directions = _linear(beside(white, span), base.state.white)
        z = np.clip(z, -_START_SIZES, _START_SIZES)
        vector = np.clip(null + z * scale, layout.lower, layout.upper)
        return _Scored(null, vector, gain, directions, seen)

    out: list[_Scored] = [score(shapes[0])]  # fills the caches that all of them share
    rest = shapes[1:]
    if problem.data.n_rows < _MANY_ROWS:
        return out + [score(shape) for shape in rest]
    found: dict[int, _Scored] = {}

    def run(part: slice) -> None:
        found[part.start] = score(rest[part.start])

    run_parts(run, [slice(k, k + 1) for k in range(len(rest))])
    return out + [found[k] for k in range(len(rest))]


def _across(problem: Problem, base: Fit, null: Term, factor: Array) -> tuple[Array, float]:
    """Values inside the bounds, and the fall of chi2 promised by the change at a plausible size.

    The sag of a cable grows with the square of its weight, so its derivative at null may point
    opposite to the effect of any weight.
    """
    layout = null.layout
    span = np.where(layout.shape, 0.0, layout.scale)

    def moved(part: float) -> Array:
        return np.clip(null.vector + part * span, layout.lower, layout.upper)

    half = moved(0.5)
    terms = base.terms.with_term(null.with_vector(moved(1.0)))
    there = evaluate(problem, terms, factor, base.state)
    if not there.valid:
        return half, 0.0
    white = base.state.white
    change = beside(white - there.white, base.span)
    power = float(change @ change)
    part = float(np.clip(change @ white / max(power, 1e-300), 0.0, _START_SIZES))
    promised = part * (2.0 * float(change @ white) - part * power)
    return (moved(part) if part > 0.0 else half), promised


def _some_slack(base: Fit) -> bool:
    """Whether enough cables are slack for a fit to end in a local minimum."""
    slack = base.state.prediction.slack
    return float(np.mean(slack)) > _SLACK_PART


def amplitude_columns(problem: Problem, base: Fit, layout: Layout, null: Array) -> Array:
    """(N, p) whitened derivatives by an effect's parameters at null; columns of shapes are 0."""
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
    z: Array = solved(normal + 1e-2 * np.eye(x.shape[1]), x.T @ r)
    left = r - x @ z
    directions = int(np.sum(np.linalg.eigvalsh(normal) > 1e-2))
    return z, float(r @ r - left @ left), max(1, directions)


def equation_start(
    problem: Problem, base: State, layout: Layout, start: Array, factor: Array
) -> Array | None:
    """Values of an effect that best balance the forces at the measured poses.

    Args:
        problem: the data; poses must have been measured completely.
        base: the model without the effect.
        layout: the effect.
        start: (p,) values to start from; shapes are kept.
        factor: noise factors, :meth:`Problem.noise`.

    Returns:
        (p,) values. None if this is impossible: for effects of the sensors, models with history,
        users' cable laws or separate values for files or runs, platforms on joints, data without
        orientations.
    """
    rows = _balanced_rows(problem, base, layout)
    if not rows.any():
        return None
    forces = _Forces(problem, base, layout, factor, rows)
    free = ~layout.shape
    null, scale = layout.null[free], layout.scale[free]

    def values(z: Array) -> Array:
        out = start.copy()
        out[free] = null + z * scale
        return out

    def residuals(z: Array) -> Array:
        return np.concatenate([forces.displacements(values(z)), z / PRIOR_SIZES])

    def jacobian(z: Array) -> Array:
        rates = forces.derivatives(values(z)) * scale
        return np.concatenate([-rates, np.eye(len(z)) / PRIOR_SIZES])

    lower, upper = (layout.lower[free] - null) / scale, (layout.upper[free] - null) / scale
    # start inside the bounds: at null, friction has other derivatives than at any other value
    begin = np.clip((start[free] - null) / scale, lower + _INSIDE, upper - _INSIDE)
    if not np.all(np.isfinite(residuals(begin))):
        return None
    found = optimize.least_squares(
        residuals,
        begin,
        jacobian,
        (lower, upper),
        max_nfev=_EVALUATIONS,
        ftol=_FALL,
        xtol=None,
        gtol=None,
    )
    return np.clip(values(found.x), layout.lower, layout.upper)


def _balanced_rows(problem: Problem, base: State, layout: Layout) -> NDArray[np.bool_]:
    """(n,) rows whose measured pose determines the forces there; none if no row's does."""
    data, at = problem.data, base.prediction
    senses = layout.effect.edit_readings is not Effect.edit_readings
    # with joints, noise puts a measured pose off the poses that the platform can reach
    silent = senses or at.has_history or bool(at.setup.laws) or bool(problem.robot.joints)
    silent = silent or isinstance(at, PartedPrediction)
    if silent or data.quat_wxyz is None:
        return np.zeros(data.n_rows, dtype=bool)
    read = np.isfinite(data.position).all(axis=1) & np.isfinite(data.quat_wxyz).all(axis=1)
    return np.asarray(problem.use & read)


class _Forces:
    """Forces that are unbalanced at the measured poses, as the displacements that balance them."""

    def __init__(
        self, problem: Problem, base: State, layout: Layout, factor: Array,
        rows: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        self.problem, self.base, self.layout, self.factor = problem, base, layout, factor
        data, at = problem.data, base.prediction
        assert data.quat_wxyz is not None
        measured = np.concatenate([data.position, data.quat_wxyz], axis=1)
        read = np.concatenate([at.readings.position, at.readings.quat_wxyz], axis=1)
        # the readings are freed of what the sensors add, by the model
        self.rows = rows & np.isfinite(read).all(axis=1)
        self.poses = at.pose.copy()
        off = changes_between(measured[self.rows], read[self.rows])
        self.poses[self.rows] = moved_by(at.pose[self.rows], off)

    def terms(self, values: Array) -> Terms:
        """The model with the effect."""
        return self.base.terms.with_term(Term(self.layout, values))

    def displacements(self, values: Array) -> Array:
        """(N,) whitened displacements that would balance the forces; inf without a solution."""
        at = self._at(values)
        if at is None:
            return np.full(self.problem.n_readings, np.inf)
        moved = _damped_inverse(at.found.hessian) @ at.found.gradient[..., None]
        off = (motion_of(at) @ moved)[..., 0]
        table = np.zeros(self.problem.measured.shape)
        table[self.rows, :6] = np.where(np.isfinite(off), off, 0.0)[self.rows]
        return self.problem.whiten(self.factor, table)

    def derivatives(self, values: Array) -> Array:
        """(N, k) whitened derivatives by the effect's amplitudes; 0 without a solution."""
        at, terms = self._at(values), self.terms(values)
        wanted = np.flatnonzero(terms.own(self.layout.name))[~self.layout.shape].tolist()
        if at is None:
            return np.zeros((self.problem.n_readings, len(wanted)))
        rates = sensitivities(self.base.experiment, terms, at, wanted, frozen=True)
        rates[~self.rows] = 0.0
        rates[:, 6:] = 0.0
        return self.problem.whiten(self.factor, rates)

    def _at(self, values: Array) -> Prediction | None:
        """The model held at the measured poses; None if it has no solution there."""
        setup = self.base.experiment.setup(self.terms(values).effects)
        if setup.has_history:
            return None
        tables = assemble(setup)
        start = batch.Evaluation.at_commands(tables)
        start.deviation[:] = batch.deviations(tables, self.poses)
        found = batch.evaluate(tables, start)
        found.deviation[:] = start.deviation
        # where a cable law has no solution, numbers of the last attempt are left in the arrays
        size = np.where(np.isfinite(found.hessian), np.abs(found.hessian), np.inf)
        broken = (found.outcome != CONVERGED) | (size.max(axis=(1, 2)) > _ABSURD)
        if np.any(broken & self.rows):
            return None
        found.hessian[broken], found.gradient[broken] = 0.0, 0.0
        at = Prediction(setup, tables, found, self.base.prediction.readings, False)
        return with_inverse(at, _damped_inverse(found.hessian))


def _damped_inverse(stiffness: Array) -> Array:
    """(K^2 + mu^2)^-1 K: keeps displacements small in soft or unstable directions."""
    power, vectors = np.linalg.eigh(stiffness)
    soft = _SOFT * np.max(np.abs(power), axis=1, keepdims=True)
    damped = power / np.maximum(power**2 + soft**2, 1e-300)
    return np.asarray((vectors * damped[:, None, :]) @ np.swapaxes(vectors, 1, 2), float)
