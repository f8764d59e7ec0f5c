"""Starting values from the forces at the measured poses, where nothing has to be solved.

Where cables go slack and taut, the error of the pose has many local minima; the unbalanced force
at the measured pose has few: the pattern of slack cables is that of the measured pose, whatever
the parameters. Its noise is that of the pose times the stiffness, g = K dq, which weighs it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.problem import Problem
from seecr import statics
from seecr.effects.base import Effect, Layout
from seecr.pose import Array
from seecr.sensitivity import Term, effects_of

_ROUNDS, _STEP = 6, 1e-4
# Forces are known no better than this part of the load.
_FLOOR = 1e-3


def start_from_forces(problem: Problem, terms: Sequence[Term], layout: Layout) -> Array | None:
    """Values of one more effect that balance the forces at the measured poses best; or None.

    None where poses were not measured whole, or the effect does not act on forces.
    """
    data, effect = problem.data, layout.effect
    acts = effect.edit_setup is not Effect.edit_setup
    if not acts or data.quat_wxyz is None or problem.robot.joints or np.any(layout.shape):
        return None
    whole = np.isfinite(data.position).all(axis=1) & np.isfinite(data.quat_wxyz).all(axis=1)
    rows = np.flatnonzero(problem.use & whole)
    if len(rows) <= len(layout):
        return None
    forces = _Forces(problem, terms, layout, rows)
    z = np.zeros(len(layout))
    for _ in range(_ROUNDS):
        jacobian, white = forces.derivatives(z), forces.at(z)
        normal = jacobian.T @ jacobian + 1e-2 * np.eye(len(z))
        step = -np.linalg.solve(normal, jacobian.T @ white + 1e-2 * z)
        z = z + step * min(1.0, 2.0 / max(float(np.max(np.abs(step))), 1e-300))
        if float(np.max(np.abs(step))) < 1e-3:
            break
    return np.clip(layout.null + z * layout.scale, layout.lower, layout.upper)


class _Forces:
    """Unbalanced forces at the measured poses, in units of their noise."""

    def __init__(
        self, problem: Problem, terms: Sequence[Term], layout: Layout, rows: Array
    ) -> None:
        self.problem, self.terms, self.layout, self.rows = problem, terms, layout, rows
        data = problem.data
        assert data.quat_wxyz is not None
        self.poses = np.concatenate([data.position, data.quat_wxyz], axis=1)[rows]
        length = problem.robot.length
        sigma = problem.sigma
        self.pose_sigma = np.repeat(
            [sigma.position_m or 1e-4, (sigma.orientation_rad or 1e-3) * length], 3
        )

    def _evaluate(self, z: Array) -> statics.Evaluation:
        values = self.layout.null + z * self.layout.scale
        effects = effects_of([*self.terms, Term(self.layout, values)])
        tables = statics.take(statics.assemble(self.problem.experiment.setup(effects)), self.rows)
        at = statics.Evaluation.empty(len(tables), tables.cables.shape[1], tables.n_dof)
        at.deviation[:] = statics.deviations(tables, self.poses)
        self.load = tables.scale
        return statics.evaluate(tables, at)

    def at(self, z: Array) -> Array:
        """(6 k,) whitened forces; fixes the weights for the derivatives that follow."""
        found = self._evaluate(z)
        spread = found.hessian * self.pose_sigma
        noise = spread @ np.swapaxes(spread, 1, 2)
        noise += np.eye(6) * (_FLOOR * self.load[:, None, None]) ** 2
        self.factor = np.linalg.cholesky(noise)
        return self._whiten(found.gradient)

    def _whiten(self, gradient: Array) -> Array:
        return np.asarray(np.linalg.solve(self.factor, gradient[..., None]), float).ravel()

    def derivatives(self, z: Array) -> Array:
        """(6 k, p) derivatives of the whitened forces, with the weights of this z."""
        self.at(z)
        columns = []
        for k in range(len(z)):
            shift = np.zeros(len(z))
            shift[k] = _STEP
            ahead, behind = self._evaluate(z + shift), self._evaluate(z - shift)
            columns.append(self._whiten(ahead.gradient - behind.gradient) / (2.0 * _STEP))
        return np.stack(columns, axis=1)
