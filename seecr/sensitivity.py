"""How readings change with the effects' parameters, by the implicit function theorem.

At a solved pose the wrench w(q, theta) is zero; so dq/d theta = -K^-1 dg/d theta with g = -w the
gradient of the energy and K its stiffness. One factorisation of K serves all parameters. dg/d
theta comes from differencing the effects' edits at the fixed pose: nothing is solved again.
Rows with history are the exception: their walk is repeated with each parameter shifted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seecr import cable_law, statics
from seecr.effects.base import Effect, Layout, Readings
from seecr.experiment import Experiment, Prediction, read
from seecr.pose import Array, pose_add, quat_conjugate, quat_multiply, rotvec_from_quat
from seecr.statics import Tables

# Differencing steps, in plausible sizes of a parameter.
_CENTRAL, _ONE_SIDED, _WALK = 1e-4, 1e-5, 1e-3


@dataclass(frozen=True, eq=False)
class Term:
    """An effect with values: ``layout`` says which, ``vector`` (p,) how much."""

    layout: Layout
    vector: Array

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.layout.name

    def effect(self) -> Effect:
        """The effect itself."""
        return self.layout.build(self.vector)


def effects_of(terms: Sequence[Term]) -> list[Effect]:
    """The effects of terms, in their order."""
    return [term.effect() for term in terms]


def sensitivities(
    experiment: Experiment, terms: Sequence[Term], at: Prediction, columns: Sequence[int] = ()
) -> Array:
    """Derivative of the readings by the terms' parameters.

    Args:
        experiment: robot and commands.
        terms: effects with values, in the order in which they act.
        at: the prediction with those values.
        columns: which parameters (counted through all terms); all by default.

    Returns:
        (n, 6 + m, p): position [m], rotation vector [rad], tensions [N], by each parameter.
    """
    wanted = list(columns) if len(columns) else list(range(sum(len(t.layout) for t in terms)))
    if at.has_history:
        return _by_walking(experiment, terms, at, wanted)
    out = np.zeros((*_shape(at), len(wanted)))
    inverse = _inverse_stiffness(at)
    sensing = _sensing(terms)
    for c, (which, k) in enumerate(_positions(terms, wanted)):
        shifted = _shifted(terms, which, k)
        if _walks(experiment, shifted):
            out[..., c] = _difference(experiment, shifted, at)
            continue
        out[..., c] = _one(experiment, terms, shifted, at, inverse, sensing)
    return out


def length_sensitivities(at: Prediction) -> Array:
    """Derivative of pose and tensions by each cable's rest length, (n, 6 + m, m)."""
    n, width = _shape(at)
    m = width - 6
    out = np.zeros((n, width, m))
    inverse = _inverse_stiffness(at)
    step = 1e-6 * at.tables.length
    for i in range(m):
        plus, minus = (_lengthened(at.tables, i, sign * step) for sign in (1.0, -1.0))
        move, tension = _response(at, plus, minus, 2 * step, inverse)
        out[:, :6, i], out[:, 6:, i] = move, tension
    return out


def _shape(at: Prediction) -> tuple[int, int]:
    n, m = at.tables.cables.shape[:2]
    return n, 6 + m


def _positions(terms: Sequence[Term], wanted: list[int]) -> list[tuple[int, int]]:
    flat = [(i, k) for i, term in enumerate(terms) for k in range(len(term.layout))]
    return [flat[c] for c in wanted]


@dataclass(frozen=True, eq=False)
class _Shift:
    """Terms with one parameter shifted up and down, ``apart`` from each other."""

    plus: list[Term]
    minus: list[Term]
    apart: float
    physical: bool  # whether the shifted effect edits the setup


def _shifted(terms: Sequence[Term], which: int, k: int, part: float | None = None) -> _Shift:
    term = terms[which]
    layout, value = term.layout, float(term.vector[k])
    step = (_CENTRAL if part is None else part) * float(layout.scale[k])
    up, down = value + step, value - step
    if down < layout.lower[k] or up > layout.upper[k]:
        step = (_ONE_SIDED if part is None else part) * float(layout.scale[k])
        inside = down < layout.lower[k]
        up, down = (value + step, value) if inside else (value, value - step)

    def with_value(number: float) -> list[Term]:
        vector = term.vector.copy()
        vector[k] = number
        return [Term(layout, vector) if i == which else t for i, t in enumerate(terms)]

    physical = layout.effect.edit_setup is not Effect.edit_setup
    return _Shift(with_value(up), with_value(down), up - down, physical)


def _sensing(terms: Sequence[Term]) -> bool:
    return any(t.layout.effect.edit_readings is not Effect.edit_readings for t in terms)


def _walks(experiment: Experiment, shift: _Shift) -> bool:
    """Whether the shift brings history into a model that has none yet."""
    if not shift.physical:
        return False
    return experiment.setup(effects_of(shift.plus)).has_history


def _one(
    experiment: Experiment,
    terms: Sequence[Term],
    shift: _Shift,
    at: Prediction,
    inverse: Array,
    sensing: bool,
) -> Array:
    n, width = _shape(at)
    move, tension = np.zeros((n, 6)), np.zeros((n, width - 6))
    if shift.physical:
        strains = at.found.states[..., cable_law.STRAIN]
        plus = statics.assemble(experiment.setup(effects_of(shift.plus)), strains)
        minus = statics.assemble(experiment.setup(effects_of(shift.minus)), strains)
        move, tension = _response(at, plus, minus, shift.apart, inverse)
    if not sensing:
        return np.concatenate([move, tension], axis=1)
    half = 0.5 * shift.apart
    poses, tensions = at.poses, at.tensions
    ahead = read(
        effects_of(shift.plus), at.setup, pose_add(poses, half * move), tensions + half * tension
    )
    behind = read(
        effects_of(shift.minus), at.setup, pose_add(poses, -half * move), tensions - half * tension
    )
    return readings_difference(ahead, behind) / shift.apart


def _response(
    at: Prediction, plus: Tables, minus: Tables, apart: float, inverse: Array
) -> tuple[Array, Array]:
    """Change of pose (n, 6) and tensions (n, m) between two tables, per unit of ``apart``."""
    ahead, behind = statics.evaluate(plus, at.found), statics.evaluate(minus, at.found)
    force = (ahead.gradient - behind.gradient) / apart
    step = -np.einsum("nij,nj->ni", inverse, force)
    tension = ahead.states[..., cable_law.TENSION] - behind.states[..., cable_law.TENSION]
    tension = tension / apart + np.einsum("nmd,nd->nm", at.found.slopes, step)
    return _as_motion(at, step), tension


def _as_motion(at: Prediction, step: Array) -> Array:
    """Steps (n, d) in the loop's coordinates as displacement and rotation vector (n, 6)."""
    tables = at.tables
    if tables.screws.shape[1] == 0:
        return step / np.repeat([1.0, tables.length], 3)
    ahead = statics.evaluate(tables, _moved(at, 1e-6 * step)).deviation
    behind = statics.evaluate(tables, _moved(at, -1e-6 * step)).deviation
    turn = quat_multiply(ahead[:, 3:], quat_conjugate(behind[:, 3:]))
    both = [ahead[:, :3] - behind[:, :3], rotvec_from_quat(turn)]
    return np.concatenate(both, axis=1) / 2e-6


def _moved(at: Prediction, step: Array) -> statics.Evaluation:
    n = len(step)
    found = statics.take_evaluation(at.found, np.arange(n))
    found.values = found.values + step
    return found


def _inverse_stiffness(at: Prediction) -> Array:
    """Inverse of the stiffness of each row; of what is stiff, where a row is singular."""
    hessian = np.where(np.isfinite(at.found.hessian), at.found.hessian, 0.0)
    return np.linalg.pinv(hessian, rcond=1e-12, hermitian=True)


def _lengthened(tables: Tables, cable: int, by: float) -> Tables:
    longer = statics.take(tables, np.arange(len(tables)))
    longer.cables[:, cable, cable_law.REST] += by
    longer.cables[:, cable, cable_law.GAP] -= by
    return longer


def _by_walking(
    experiment: Experiment, terms: Sequence[Term], at: Prediction, wanted: list[int]
) -> Array:
    out = np.zeros((*_shape(at), len(wanted)))
    for c, (which, k) in enumerate(_positions(terms, wanted)):
        out[..., c] = _difference(experiment, _shifted(terms, which, k, _WALK), at)
    return out


def _difference(experiment: Experiment, shift: _Shift, at: Prediction) -> Array:
    """Difference of two predictions that are solved in full."""
    near = None if at.has_history else at
    ahead = experiment.predict(effects_of(shift.plus), near)
    behind = experiment.predict(effects_of(shift.minus), near)
    change = readings_difference(ahead.readings, behind.readings) / shift.apart
    change[~(ahead.solved & behind.solved)] = 0.0
    return change


def readings_difference(a: Readings, b: Readings) -> Array:
    """Readings a less b, (n, 6 + m): position, rotation vector from b to a, tensions."""
    turn = quat_multiply(a.quat_wxyz, quat_conjugate(b.quat_wxyz))
    return np.concatenate(
        [a.position - b.position, rotvec_from_quat(turn), a.tensions - b.tensions], axis=1
    )
