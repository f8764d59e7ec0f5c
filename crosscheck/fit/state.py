"""A model at given values: what is known of these, what they predict, residuals and derivatives.

A value z = (value - null)/scale that was measured independently with the standard error s counts as
one more reading: y = z_measured/s, with the derivative 1/s and unit noise. It adds
((z_measured - z)/s)^2 to the objective. Many rows outweigh it, and then the values that explain the
data are not those that were measured: one of the two is wrong. A fixed value has zero derivatives.
A fit may pass through sizes that no robot can have, a result may not.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.length_errors import with_length_errors
from crosscheck.fit.problem import Problem, in_units_of
from seecr.counted import some
from seecr.description.robot import Robot
from seecr.effects import Term, Terms
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, Prediction
from seecr.prediction.parted import rates

# A row is far off if the mean square of its whitened residuals exceeds _FAR_OFF. It may then rest
# in another equilibrium, but only if no more than _FEW_ROWS of all rows are far off.
_FAR_OFF, _FEW_ROWS = 25.0, 0.25
# So many of its standard errors, a value measured independently is contradicted.
CONTRADICTED = 3.0


@dataclass(eq=False)
class State:
    """A model at given values, compared with the data of a problem.

    Attributes:
        terms: the effects with their values.
        prediction: prediction of all rows; if commanded lengths are noisy, at their most likely
            errors.
        raw: (n, 6 + m) residuals at the commanded lengths, in SI units; NaN where nothing was read.
        table: (n, 6 + m) whitened residuals. white: (N,) whitened residuals that count.
        factor: Cholesky factors of the noise, :meth:`Problem.noise`.
        chi2: sum of squares of ``white``; inf if a counted row was not solved.
        log_det: log determinant of the counted rows' noise over that of the readings alone.
        experiment: the commands with the most likely length errors.
    """

    terms: Terms
    prediction: Prediction
    raw: Array
    table: Array
    white: Array
    factor: Array
    chi2: float
    log_det: float
    experiment: Experiment

    @property
    def valid(self) -> bool:
        """Whether every counted row was solved."""
        return bool(np.isfinite(self.chi2))

    def of(self, terms: Terms) -> State:
        """The same state, as that of other terms (usually some more, at their null values)."""
        return replace(self, terms=terms)

    def among(self, problem: Problem) -> State:
        """The same state, of a problem in which other rows of the same data count."""
        valid = bool(np.all(self.prediction.solved[problem.use]))
        white = self.table[problem.counted]
        valid = valid and bool(np.all(np.isfinite(white)))
        log_det = _log_det(problem, self.factor) if problem.sigma.length_m else 0.0
        chi2 = float(white @ white) if valid else np.inf
        return replace(self, white=white, chi2=chi2, log_det=log_det)


def evaluate(
    problem: Problem,
    terms: Terms,
    factor: Array,
    near: State | None = None,
    trial: bool = False,
    predicted: Prediction | None = None,
) -> State:
    """Predict with the terms, and compare with the readings.

    If commanded lengths are noisy, their most likely errors are found row by row, and the noise is
    propagated from there: a cable that is slack as commanded may have been taut at its true length.

    Args:
        problem, terms: the readings, and the effects with values.
        factor: :meth:`Problem.noise`; only used if commanded lengths are exact.
        near: a state to start from.
        trial: the rest need not be solved once a counted row with history is lost.
        predicted: what the terms predict where commanded lengths are exact, if it is known.
    """
    effects = terms.effects
    experiment = problem.experiment if near is None else near.experiment
    start = None if near is None else near.prediction
    if not problem.sigma.length_m:
        needed = problem.use if trial else None
        prediction = predicted
        if prediction is None:
            prediction = experiment.predict(effects, start, needed)
        raw = problem.residuals(prediction.readings)
        state = _compared(problem, terms, prediction, raw, factor, experiment)
        return _on_measured_branch(problem, state)
    at = with_length_errors(problem, effects, experiment.length_errors, start)
    experiment, lines = experiment.with_length_errors(at.lines.errors), at.lines
    raw = lines.at_commands()
    state = _compared(problem, terms, at.prediction, raw, lines.factor, experiment)
    return _as_likely(problem, state, at.cost(problem))


def _on_measured_branch(problem: Problem, state: State) -> State:
    """If a few rows are far off, move them to the equilibrium nearest to the measured pose.

    With slack cables a platform can have several stable equilibria. The reading tells in which of
    them the robot came to rest; the model only has to contain it. Models with history or users'
    cable laws, platforms on joints and data without quaternions are left as they are.
    """
    data, at = problem.data, state.prediction
    if data.quat_wxyz is None or at.has_history or at.setup.laws or problem.robot.joints:
        return state
    if at.solved.all() and np.abs(state.white).max(initial=0.0) <= _FAR_OFF**0.5:
        return state  # as most are
    size = np.nansum(state.table**2, axis=1) / np.maximum(problem.measured.sum(axis=1), 1)
    whole = np.isfinite(data.position).all(axis=1) & np.isfinite(data.quat_wxyz).all(axis=1)
    rows = np.flatnonzero(problem.use & whole & ((size > _FAR_OFF) | ~at.solved))
    if len(rows) == 0 or len(rows) > _FEW_ROWS * problem.use.sum():
        return state
    poses = np.concatenate([data.position, data.quat_wxyz], axis=1)[rows]
    effects = state.terms.effects

    def moved(some: NDArray[np.intp], to: Array) -> State:
        """The state with some rows at the equilibria nearest to other poses."""
        other = state.experiment.from_other_starts(effects, at, some, to)
        raw = problem.residuals(other.readings)
        return _compared(problem, state.terms, other, raw, state.factor, state.experiment)

    there = moved(rows, poses)
    other = there.prediction
    better = np.nansum(there.table**2, axis=1) < 0.5 * np.nansum(state.table**2, axis=1)
    better = (better | ~at.solved) & other.solved
    keep = rows[better[rows]]
    if len(keep) == 0:
        return state
    return moved(keep, other.pose[keep])


def _compared(
    problem: Problem,
    terms: Terms,
    prediction: Prediction,
    raw: Array,
    factor: Array,
    experiment: Experiment,
) -> State:
    filled = np.where(problem.measured & np.isfinite(raw), raw, 0.0)
    table = in_units_of(factor, filled[..., None])[..., 0]
    table[~problem.measured] = np.nan
    none = np.zeros(0)
    return State(terms, prediction, raw, table, none, factor, np.inf, 0.0, experiment).among(
        problem
    )


def _log_det(problem: Problem, factor: Array) -> float:
    """Of the counted rows' noise over that of the readings alone."""
    diagonal = np.log(np.diagonal(factor, axis1=1, axis2=2)) - np.log(problem.reading_sigma)
    return 2.0 * float(diagonal[problem.counted].sum())


def _as_likely(problem: Problem, state: State, cost: Array) -> State:
    """The state with residuals scaled up to the true cost of each row's most likely errors.

    If a cable goes slack, the linearised residuals promise a lower chi2 than any length errors
    reach, and a fit would run to where they promise most.
    """
    promised = np.nansum(state.table**2, axis=1)
    more = np.where(np.isfinite(cost) & (promised > 0.0), cost / np.maximum(promised, 1e-300), 1.0)
    table = state.table * np.sqrt(np.maximum(more, 1.0))[:, None]
    white = table[problem.counted]
    chi2 = float(white @ white) if state.valid else np.inf
    return replace(state, table=table, white=white, chi2=chi2)


def derivatives(
    problem: Problem,
    state: State,
    columns: Sequence[int] = (),
    frozen: bool = False,
) -> Array:
    """(N, p) whitened derivatives of the prediction by the terms' parameters."""
    change = rates(state.experiment, state.terms, state.prediction, columns, frozen)
    return problem.whiten(state.factor, problem.as_read(change, state.prediction.readings))


def amplitude_columns(problem: Problem, state: State, term: Term) -> Array:
    """(N, p) whitened derivatives by the parameters of one effect in a state that may lack it.

    Its history is held, and columns of shapes are 0.
    """
    terms = state.terms.with_term(term)
    wanted = np.flatnonzero(terms.own(term.name))[~term.layout.shape]
    out = np.zeros((len(state.white), len(term.layout)))
    if len(wanted):
        rates = derivatives(problem, state.of(terms), wanted.tolist(), frozen=True)
        out[:, ~term.layout.shape] = rates
    return out


def free_derivatives(problem: Problem, state: State, frozen: bool = False) -> Array:
    """(N, p) whitened derivatives of the prediction by z; 0 for fixed values."""
    terms = state.terms
    if not len(terms):
        return np.zeros((len(state.white), 0))
    rates = derivatives(problem, state, frozen=frozen)
    return np.asarray(rates * np.where(terms.knowledge.fixed, 0.0, terms.scale))


# --- what is known of values ---------------------------------------------------------------------


def known_readings(terms: Terms) -> tuple[Array, Array]:
    """Independent measurements with unit noise: derivatives by z (k, p), and readings (k,)."""
    known = terms.knowledge
    own = np.flatnonzero(known.measured)
    columns = np.zeros((len(own), len(terms)))
    columns[np.arange(len(own)), own] = (terms.scale / known.stderr)[own]
    return columns, ((known.value - terms.null) / known.stderr)[own]


def known_left(terms: Terms) -> Array:
    """(k,) measured minus current values of those measured independently, in standard errors."""
    columns, readings = known_readings(terms)
    return np.asarray(readings - columns @ terms.sizes)


def contradictions(terms: Iterable[Term]) -> list[str]:
    """A sentence for each effect with values far from their independent readings."""
    return [text for text in map(_contradiction, terms) if text]


def _contradiction(term: Term) -> str:
    off = np.abs(term.vector - term.knowledge.value) / term.knowledge.stderr
    against = term.knowledge.measured & (off > CONTRADICTED)
    if not against.any():
        return ""
    names = np.array(term.layout.names)[against].tolist()
    verb = "is" if len(names) == 1 else "are up to"
    return (
        f"{term.name}: {some(names)} {verb} {off[against].max():.3g} standard errors from "
        "what was measured independently: check that measurement, and what else was taken for known"
    )


def can_be(robot: Robot, terms: Terms, stood: Terms) -> bool:
    """Whether a robot can have these values (no negative mass, no wheel larger than its cable).

    A fit that is stopped by a bound other than nothing wants more than any robot has, and is no
    optimum. What was impossible in the model as it ``stood`` is the user's own.
    """

    def may_be(term: Term) -> bool:
        return term.is_possible(robot) and not _is_stopped(term)

    own = {term.name for term in stood if not may_be(term)}
    return all(term.name in own or may_be(term) for term in terms)


def _is_stopped(term: Term) -> bool:
    """Whether a fitted amplitude is at a bound that is not nothing."""
    layout, value = term.layout, term.vector
    at_bound = (value <= layout.lower) | (value >= layout.upper)
    fitted = ~layout.shape & ~term.knowledge.fixed
    return bool(np.any(at_bound & (value != layout.null) & fitted))


def largest_size(term: Term) -> float:
    """The largest absolute value of an effect's parameters in expected sizes, without shapes."""
    return float(np.max(np.abs(term.sizes[~term.layout.shape]), initial=0.0))
