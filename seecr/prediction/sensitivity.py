"""Sensitivities of the readings to the effects' parameters, by the implicit function theorem.

At a solved pose the wrench w(q, theta) is zero, so dq/dtheta = -K^-1 dg/dtheta, with g = -w the
gradient of the energy and K its stiffness. One factorisation of K serves all parameters.
dg/dtheta is a finite difference of the effects' edits at the fixed pose: nothing is solved again.
If rows depend on the rows before, g does too: the history of the cables is then differentiated
forward along the path, and nothing is solved there either.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.arguments import check_kind, numbers
from seecr.commands import Commands
from seecr.compiled.columns import RADIUS, STRAIN, WEIGHT
from seecr.compiled.rates import wrench_by_ends_batch
from seecr.counted import counted
from seecr.effects.base import Effect, Layout, Readings
from seecr.effects.edits import is_built_in
from seecr.effects.setup import QUANTITIES, History, Setup
from seecr.effects.terms import Term, Terms
from seecr.errors import InputError
from seecr.parallel import run_parts
from seecr.pose import Array, changes_between, moved_by
from seecr.prediction.experiment import Experiment, Prediction, read, senses
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble, reassembled

# Sensitivities to where cables begin and end, and to their rest lengths.
#
# A cable's pull depends on its rest length and on where its anchor point B is as seen from its
# exit point A. So the derivatives by A, by B and by l0 all follow from one evaluation of each
# cable (seecr.compiled.rates): with F its force on the platform and K = -dF/dB,
#
#     dF = -K (dB - dA) + dF/dl0 dl0,   dM = (B - p) x dF + (dB in the platform) x F,
#
# where dA and dB move the points, and M is the moment about the platform's origin p.


def are_by_point(tables: Tables) -> bool:
    """Whether the stiffness of all cables is minus the derivative of their force.

    Of heavy cables over pulleys it is the symmetric part of that.
    """
    heavy, over = tables.cables[..., WEIGHT] > 0.0, tables.cables[..., RADIUS] > 0.0
    return not bool(np.any(heavy & over))


def wrench_by_ends(
    rates: Array, poses: Array, exit_moves: Array, anchor_moves: Array, longer: Array
) -> tuple[Array, Array]:
    """Change of the wrench (n, 6, m) by each cable, and of its own tension (n, m).

    Rates are those of the cables at the poses, :func:`seecr.statics.batch.rates_of_cables`; exit
    points (m, 3) move in base axes, anchor points (m, 3) in the platform's, and cables get longer
    (n, m).
    """
    n, m = longer.shape
    wrench, tension = np.empty((n, 6, m)), np.empty((n, m))
    wrench_by_ends_batch(rates, poses, exit_moves, anchor_moves, longer, wrench, tension)
    return wrench, tension


# Terms with a parameter shifted up and down, for finite differences.

# Steps of central and one-sided differences, in expected sizes of a parameter.
_CENTRAL, _ONE_SIDED = 1e-4, 1e-5

# Quantities that affect the statics only through the rest lengths.
_PAID_OUT = {name for name, item in QUANTITIES.items() if item.paid_out}
# Quantities that say where cables begin and end.
_ENDS = {"exit_points", "anchor_points"}
# Quantities that also affect a row through the rows before it.
_OF_HISTORY = {name for name, item in QUANTITIES.items() if item.history is not History.NONE}
# Quantities that have no effect if no effect has a history.
OF_SHAPE = {name for name, item in QUANTITIES.items() if item.history is History.SHAPES}


@dataclass(frozen=True, eq=False)
class Shift:
    """Terms with a parameter, or several of one effect together, shifted up and down.

    ``apart`` is the difference between plus and minus: one number, or one for each parameter.
    """

    plus: Terms
    minus: Terms
    apart: Any
    layout: Layout

    @property
    def physical(self) -> bool:
        """Whether the shifted effect edits the setup."""
        return self.layout.effect.edit_setup is not Effect.edit_setup

    @property
    def sensing(self) -> bool:
        """Whether the shifted effect edits the readings."""
        return self.layout.effect.edit_readings is not Effect.edit_readings


@dataclass(frozen=True, eq=False)
class Sides:
    """Setups with a parameter shifted up and down, and the names of the quantities that differ."""

    plus: Setup
    minus: Setup
    differing: frozenset[str]

    @classmethod
    def of(cls, experiment: Experiment, shift: Shift, commands: Commands | None = None) -> Sides:
        """The setups of a shift, for the rows or for other commands on their way."""
        plus, minus = (experiment.setup(t.effects, commands) for t in (shift.plus, shift.minus))
        return cls(plus, minus, plus.differs(minus))

    @property
    def of_history(self) -> bool:
        """Whether the difference also affects a row through the rows before it."""
        return not self.differing.isdisjoint(_OF_HISTORY)

    @property
    def of_lengths(self) -> bool:
        """Whether only the cables' lengths differ."""
        return self.differing <= _PAID_OUT and not (self.plus.laws or self.minus.laws)

    @property
    def of_ends(self) -> bool:
        """Whether only the points differ between which cables run."""
        return self.differing <= _ENDS and not (self.plus.laws or self.minus.laws)

    def longer(self, apart: Any) -> Array:
        """Rest lengths (n, m) of plus minus those of minus, per unit of ``apart``."""
        return np.asarray((self.plus.rest_lengths() - self.minus.rest_lengths()) / apart)

    def tables(self, base: Tables, strains: Array) -> tuple[Tables, Tables]:
        """Tables of both sides, from ``base`` without a shift; the strains are for users' laws."""
        both = (self.plus, self.minus)
        if self.plus.laws or self.minus.laws:
            ahead, behind = (assemble(one, strains).with_past(base) for one in both)
        else:
            ahead, behind = (reassembled(base, one, self.differing) for one in both)
        return ahead, behind


def shifted(terms: Terms, term: Term, k: Any, part: float | None = None) -> Shift:
    """Shift parameter ``k`` of a term (or, with an index array, several together)."""
    up, down = (
        _up_and_down(term, k, part)
        if np.ndim(k) == 0
        else np.array([_up_and_down(term, one, part) for one in k.tolist()]).T
    )

    def with_value(numbers: Any) -> Terms:
        vector = term.vector.copy()
        vector[k] = numbers
        return terms.with_term(term.with_vector(vector))

    return Shift(with_value(up), with_value(down), up - down, term.layout)


def _up_and_down(term: Term, k: int, part: float | None) -> tuple[float, float]:
    """Values of parameter ``k`` on both sides of its own, or its own where the other is a bound."""
    layout, value = term.layout, float(term.vector[k])
    lower, upper = float(layout.lower[k]), float(layout.upper[k])
    size = float(layout.scale[k])
    # a time constant or radius counts by its relative change. The step is small, since a drum of
    # this radius may have turned many times, but above the residual of a solved path
    if layout.shape[k] and lower > 0.0:
        size = value * (0.1 if part is None else 1.0)
    step = (_CENTRAL if part is None else part) * size
    small = (_ONE_SIDED if part is None else part) * size
    if value - step < lower:
        return value + small, value
    if value + step > upper:
        return value, value - small
    return value + step, value - step


def positions(terms: Terms, wanted: list[int]) -> list[tuple[Term, int]]:
    """The term of each wanted parameter, and its index in that term."""
    every = [(term, k) for term in terms for k in range(len(term.layout))]
    return [every[c] for c in wanted]


def blocks_of_cables(
    terms: Terms, todo: Container[tuple[Term, int]]
) -> list[tuple[Term, NDArray[np.intp]]]:
    """Groups of parameters with one per cable, which can be shifted together.

    That holds for built-in effects only: a user's effect may change other cables too.
    """
    return [
        (term, group)
        for term in terms
        if is_built_in(term.layout.effect)
        for group in term.layout.cable_by_cable
        if all((term, k) in todo for k in group.tolist())
    ]


# Step of finite differences along a path, in expected sizes of a parameter. It is small because a
# cable that is barely taut at the equilibrium is slack close to it.
_WAY = 1e-5
# Step for the sensors' reading of a pose: [rad], or a relative change of a length or tension.
_READ = 1e-5


def sensitivities(
    experiment: Experiment, terms: Terms, at: Prediction, columns: Sequence[int] = (),
    frozen: bool = False,
) -> Array:  # fmt: skip
    """Derivatives of the readings with respect to the terms' parameters.

    Args:
        experiment: robot and commands.
        terms: effects with values.
        at: the prediction with those values.
        columns: indices of the parameters, counted through all terms; all by default.
        frozen: keep the history of each row constant, if the model has one. This is quick, and
            good enough to see which effects could matter, but not to fit them.

    Returns:
        (n, 6 + m, p): position [m], rotation vector [rad] and tensions [N], by each parameter.

    Raises:
        InputError: other arguments, or a prediction for other commands.

    Example:
        ``seecr.sensitivities(experiment, terms, experiment.predict(terms.effects))``
    """
    check_kind(experiment, Experiment, "experiment", "of a robot and commands")
    check_kind(terms, Terms, "terms", "of effects with values")
    check_kind(at, Prediction, "at", "as Experiment.predict returns it")
    if len(at.tables) != len(experiment.commands):
        rows = counted(len(experiment.commands), "command")
        raise InputError(f"at: expected a prediction for {rows}, got {len(at.tables)}")
    wanted = _indices(columns, len(terms))
    out = np.zeros((*_shape(at), len(wanted)))
    by_wrench = _ByWrench(experiment, at, terms)
    if at.has_history and not frozen:
        shifts = [shifted(terms, term, k, _WAY) for term, k in positions(terms, wanted)]
        _ = by_wrench.way  # computed once, for all threads

        def run(part: slice) -> None:
            out[..., part.start] = by_wrench.column(shifts[part.start], along=True)

        # with creep, rows that share a clock cannot be separated; parameters can
        run_parts(run, [slice(c, c + 1) for c in range(len(wanted))])
        return out
    todo = {position: c for c, position in enumerate(positions(terms, wanted))}
    for term, group in blocks_of_cables(terms, todo):
        block = by_wrench.block(shifted(terms, term, group))
        if block is not None:
            out[..., _together([todo.pop((term, k)) for k in group.tolist()])] = block
    for (term, k), c in todo.items():
        out[..., c] = by_wrench.column(shifted(terms, term, k))
    return out


def _indices(columns: Sequence[int], count: int) -> list[int]:
    """Indices of parameters, below their count; all of them where none is named."""
    given = numbers(columns, "columns")
    if given.ndim != 1 or np.any((given != np.round(given)) | (given < 0) | (given >= count)):
        raise InputError(
            f"columns: expected indices of {counted(count, 'parameter')}, from 0, got {columns!r}"
        )
    return given.astype(int).tolist() or list(range(count))


def _together(places: list[int]) -> slice | list[int]:
    """Indices as a slice if they follow one another: to write there takes less time."""
    first, last = places[0], places[-1]
    return slice(first, last + 1) if places == list(range(first, last + 1)) else places


def length_sensitivities(at: Prediction) -> Array:
    """Derivatives of pose and tensions with respect to each cable's rest length, (n, 6 + m, m)."""

    def change(at: Prediction) -> Array:
        still = np.zeros((at.pulls.shape[1], 3))
        longer = np.ones_like(at.pulls) * at.setup.robot.driven  # others stay as long
        by_cable = wrench_by_ends(cable_rates(at), at.pose, still, still, longer)
        return _response_to_wrench(at, *by_cable)

    return _kept(at, "by_length", change)


def cable_rates(at: Prediction) -> Array:
    """What each cable pulls with at a prediction, and how that changes, (n, m, N_RATES)."""
    return _kept(at, "cable_rates", lambda at: batch.rates_of_cables(at.tables, at.found))


def read_by_length(at: Prediction) -> Array:
    """Derivatives of the readings with respect to errors of the rest lengths, (n, 6 + m, m).

    They are for errors that exceed what hysteresis and friction hold.
    """
    change = length_sensitivities(_sliding(at) if at.has_history else at)
    return rates_of_reading(at, at.sensors) @ change if _alters(at) else change


def _sliding(at: Prediction) -> Prediction:
    """The same poses without hysteresis and friction; nothing is solved."""
    tables = at.tables.sliding()
    found = batch.evaluate(tables, at.found)
    return replace(at, tables=tables, found=found, kept={"pose": at.pose})


def _alters(at: Prediction) -> bool:
    """Whether the sensors report anything other than the true pose and pulls of the cables."""
    read, pose = at.readings, at.pose
    there = (pose[:, :3], pose[:, 3:], at.pulls)
    seen = (read.position, read.quat_wxyz, read.tensions)
    return _reeved(at) or (bool(at.sensors) and not all(map(np.array_equal, seen, there)))


def _reeved(at: Prediction) -> bool:
    """Whether a line's tension is not that with which its cable pulls."""
    return bool(np.any(at.setup.robot.falls != 1.0))


def rates_of_reading(at: Prediction, sensors: Sequence[Effect]) -> Array:
    """Derivatives of the readings with respect to pose and tensions, (n, 6 + m, 6 + m)."""
    step = np.full(_shape(at)[1], _READ)
    step[:3] *= at.tables.length
    step[6:] *= max(1.0, float(np.max(np.abs(at.pulls))))
    each = np.diag(step)
    # built-in sensor effects treat each row by itself, so all steps can be rows of one batch
    together = all(is_built_in(type(effect)) for effect in sensors)
    parts = [each] if together else [one[None] for one in each]
    rates = np.concatenate([_read_apart(at, sensors, part) for part in parts], axis=2)
    return np.asarray(rates / step)


def _read_apart(at: Prediction, sensors: Sequence[Effect], steps: Array) -> Array:
    """Half the difference of readings after steps (k, 6 + m) forward and back, (n, 6 + m, k)."""
    n, width = _shape(at)
    k = len(steps)
    change = np.repeat(steps, n, axis=0)
    pose, tensions = np.tile(at.pose, (k, 1)), np.tile(at.pulls, (k, 1))
    ahead, behind = (
        read(sensors, at.setup, moved_by(pose, s * change[:, :6]), tensions + s * change[:, 6:])
        for s in (1.0, -1.0)
    )
    return np.moveaxis(0.5 * readings_difference(ahead, behind).reshape(k, n, width), 0, 2)


def _shape(at: Prediction) -> tuple[int, int]:
    n, m = at.tables.cables.shape[:2]
    return n, 6 + m


@dataclass(eq=False)
class _ByWrench:
    """Columns of the sensitivity at one prediction."""

    experiment: Experiment
    at: Prediction
    terms: Terms

    @cached_property
    def sensing(self) -> list[Effect]:
        """The effects that edit the readings."""
        return [t.effect() for t in self.terms if senses(t.layout.effect)]

    @property
    def reads_otherwise(self) -> bool:
        """Whether readings are others than poses and pulls: through effects, or of reeved lines."""
        return bool(self.sensing) or _reeved(self.at)

    @cached_property
    def read_rates(self) -> Array:
        """Derivatives of the readings with respect to pose and tensions, (n, 6 + m, 6 + m)."""
        own = [(t.name, *t.vector.tolist()) for t in self.terms if senses(t.layout.effect)]
        return _kept(self.at, f"read_rates {own}", lambda at: rates_of_reading(at, self.sensing))

    @cached_property
    def way(self) -> _Waypoints:
        """The path through the rows, for effects with history."""
        return _Waypoints.of(self.experiment, self.at, self.terms)

    def column(self, shift: Shift, along: bool = False) -> Array:
        """Derivative of the readings (n, 6 + m) with respect to the shifted parameter.

        It is computed along the path if ``along`` is set; otherwise only for effects with history.
        """
        n, width = _shape(self.at)
        change = np.zeros((n, width))
        if shift.physical:
            sides = None if along else Sides.of(self.experiment, shift)
            if sides is None or sides.of_history:
                change = self.way.change(shift)
            elif sides.of_lengths:
                longer = sides.longer(shift.apart)
                change = (length_sensitivities(self.at) @ longer[..., None])[..., 0]
            else:
                change = _response(self.at, *self._tables(sides), shift.apart)
        if shift.sensing:
            return self._read(shift, change, shift.apart)
        return (self.read_rates @ change[..., None])[..., 0] if self.reads_otherwise else change

    def block(self, shift: Shift) -> Array | None:
        """Derivatives (n, 6 + m, m) by a per-cable parameter, shifted for all cables together."""
        if shift.sensing:
            return None
        sides = Sides.of(self.experiment, shift)
        if sides.of_history:
            return None
        if sides.of_lengths:
            change = length_sensitivities(self.at) * sides.longer(shift.apart)[:, None, :]
        elif sides.of_ends and are_by_point(self.at.tables):
            change = self._by_ends(sides, shift.apart[:, None])
        else:
            change = _response_by_cable(self.at, *self._tables(sides), shift.apart)
        return np.asarray(self.read_rates @ change if self.reads_otherwise else change)

    def _by_ends(self, sides: Sides, apart: Array) -> Array:
        """Derivatives (n, 6 + m, m) by where each cable begins or ends, ``apart`` (m, 1)."""
        exits = (sides.plus.exit_points - sides.minus.exit_points) / apart
        anchors = (sides.plus.anchor_points - sides.minus.anchor_points) / apart
        longer = sides.longer(apart[:, 0])
        rates = cable_rates(self.at)
        return _response_to_wrench(
            self.at, *wrench_by_ends(rates, self.at.pose, exits, anchors, longer)
        )

    def _tables(self, sides: Sides) -> tuple[Tables, Tables]:
        return sides.tables(self.at.tables, self.at.found.states[..., STRAIN])

    def _read(self, shift: Shift, change: Array, apart: float) -> Array:
        at = self.at

        def seen(side: Terms, sign: float) -> Readings:
            if not shift.physical:
                return read(side.effects, at.setup, at.pose, at.pulls)
            step = (0.5 * sign * apart) * change
            moved = moved_by(at.pose, step[:, :6])
            return read(side.effects, at.setup, moved, at.pulls + step[:, 6:])

        return readings_difference(seen(shift.plus, 1.0), seen(shift.minus, -1.0)) / apart


def _kept(at: Prediction, name: str, make: Callable[[Prediction], Array]) -> Array:
    """A result that many effects need of one prediction, computed once."""
    if name not in at.kept:
        at.kept[name] = make(at)
    return at.kept[name]


def _response(at: Prediction, plus: Tables, minus: Tables, apart: float) -> Array:
    """Change of pose and tensions (n, 6 + m) between two tables, per unit of ``apart``."""
    force, tension = batch.change(plus, minus, at.found)
    out = _after(at, -_inverse_stiffness(at) @ (force / apart)[..., None])[..., 0]
    out[:, 6:] += tension / apart
    return out


def _response_by_cable(at: Prediction, plus: Tables, minus: Tables, apart: Array) -> Array:
    """The same (n, 6 + m, m) for tables in which every cable was changed, by ``apart`` (m,)."""
    force, own = batch.change_by_cable(plus, minus, at.found)
    return _after(at, -_inverse_stiffness(at) @ (force / apart), own / apart)


def _response_to_wrench(at: Prediction, wrench: Array, own: Array) -> Array:
    """Change (n, 6 + m, m) of pose and tensions with cables' wrench (n, 6, m) and own (n, m)."""
    motion = motion_of(at)
    free = at.tables.screws.shape[1] == 0
    along = np.diagonal(motion[0])[:, None] * wrench if free else motion.swapaxes(1, 2) @ wrench
    return _after(at, _inverse_stiffness(at) @ along, own)


def _after(at: Prediction, step: Array, own: Array | None = None) -> Array:
    """Change (n, 6 + m, k) of pose and tensions after steps (n, d, k), and each cable's own."""
    out = np.concatenate([_moved(at, step), at.found.slopes @ step], axis=1)
    if own is not None:
        cable = np.arange(own.shape[1])
        out[:, 6 + cable, cable] += own
    return out


def motion_of(at: Prediction) -> Array:
    """Displacement and rotation vector (n, 6, d) per step in the compiled loop's coordinates."""
    return _kept(at, "motion", lambda at: _motion_at(at.tables, at.found))


def _moved(at: Prediction, step: Array) -> Array:
    """Displacement and rotation vector (n, 6, k) of steps (n, d, k) in those coordinates."""
    motion = motion_of(at)
    if at.tables.screws.shape[1] == 0:
        # each coordinate by itself: a product of matrices is for platforms on joints
        return np.asarray(np.diagonal(motion[0])[:, None] * step)
    return np.asarray(motion @ step)


def _motion_at(tables: Tables, found: batch.Evaluation) -> Array:
    size = np.repeat([1.0, tables.length], 3)
    return np.asarray(batch.motions(tables, found).swapaxes(1, 2) / size[:, None])


def _inverse_stiffness(at: Prediction) -> Array:
    return _kept(at, "inverse", lambda at: _inverse_of(at.tables, at.found))


def _inverse_of(tables: Tables, found: batch.Evaluation) -> Array:
    """Inverse of the stiffness of each row; the pseudo-inverse for rows that are not solved."""
    stiffness = batch.stiffness(tables, found)
    whole = np.where(np.isfinite(stiffness), stiffness, 0.0)
    solved = found.solved
    # a stable row's stiffness is far from singular, and an inverse takes a fifth of the time
    if solved.all():
        return np.asarray(np.linalg.inv(whole))
    out = np.empty_like(whole)
    out[solved] = np.linalg.inv(whole[solved])
    out[~solved] = np.linalg.pinv(whole[~solved], rcond=1e-12)
    return out


@dataclass(frozen=True, eq=False)
class _Waypoints:
    """The N waypoints of a prediction's path, solved once; columns of the history are not filled.

    ``inverse`` (N, d, d) is of the stiffness there, ``motion`` (N or 1, 6, d) see
    :func:`motion_of`.
    """

    experiment: Experiment
    tables: Tables
    found: batch.Evaluation
    inverse: Array
    motion: Array

    @classmethod
    def of(cls, experiment: Experiment, at: Prediction, terms: Terms) -> _Waypoints:
        found = _walk_of(experiment, at, terms)
        setup = experiment.setup(terms.effects, experiment.path.commands)
        tables = assemble(setup, found.states[..., STRAIN])
        return cls(experiment, tables, found, _inverse_of(tables, found), _motion_at(tables, found))

    def change(self, shift: Shift) -> Array:
        """Derivative of pose and tensions (n, 6 + m) with respect to the shifted parameter."""
        path = self.experiment.path
        sides = Sides.of(self.experiment, shift, path.commands)
        plus, minus = sides.tables(self.tables, self.found.states[..., STRAIN])
        step, tension = batch.change_of_walk(plus, minus, path, self.found, self.inverse)
        change = np.concatenate([(self.motion @ step[..., None])[..., 0], tension], axis=1)
        return np.asarray(change[path.rows] / shift.apart)


def _walk_of(experiment: Experiment, at: Prediction, terms: Terms) -> batch.Evaluation:
    """The equilibria at the waypoints under the terms; kept, if the rows do not change from ``at``.

    An effect at its null value may have a shape that matters: cable behind the exit point.
    """
    setup = experiment.setup(terms.effects)
    other = at.setup.differs(setup)
    if other and (setup.has_history or not other <= OF_SHAPE):
        return experiment.walk(terms.effects)[1]
    if at.walk is None:
        at.walk = experiment.walk(terms.effects)[1]
    return at.walk


def readings_difference(a: Readings, b: Readings) -> Array:
    """Readings a minus b, (n, 6 + m): position, rotation vector from b to a, tensions."""
    poses, before = (np.concatenate([one.position, one.quat_wxyz], axis=1) for one in (a, b))
    return np.concatenate([changes_between(poses, before), a.tensions - b.tensions], axis=1)
