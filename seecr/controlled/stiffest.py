"""Tensions within limits that make a stiffness of the platform largest.

At a pose the stiffness matrix K is linear in the tensions of straight cables,
K = sum (E S + tau_i)/l_i u_i u_i^T + geometric part, and the tensions that balance are a polytope.
The least eigenvalue of K and the stiffness against a force along a direction, 1/(u^T K^-1 u), are
concave in K. So the largest is found by cutting planes (Kelley, The cutting-plane method for
solving convex programs, SIAM Journal 8, 1960): linear programs whose bounds close on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seecr.compiled.columns import TENSION
from seecr.controlled.belief import Belief
from seecr.counted import some
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble, take
from seecr.tensions.balance import (
    balance_of,
    driven_tables,
    here,
    rest_for,
    with_passive,
    with_rest,
)
from seecr.tensions.distribution import tension_limits

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a force or moment, base frame; "least" is that of the least stiffness."""

# A cable without tension has no stiffness: none is asked to have less than this part of the load.
_LEAST = 1e-3
# Most cutting planes, and the part by which the bounds may differ in the end.
_CUTS, _CLOSE = 100, 1e-7
_FOUND, _UNBOUNDED = 0, 3  # how SciPy's linear program ends


def stiffest_tensions(belief: Belief) -> Array:
    """Aims (n, k) [N] for :func:`seecr.correct`; those of the belief where nothing balances.

    They are of the k driven cables, as read of their lines. Passive lines are part of the load and
    of the stiffness. Cables with weight, and others whose K is not linear, are taken as linear
    about the tensions of the belief's own aim.

    Raises:
        InputError: an unknown direction, or a stiffness that grows with tensions without end.
    """
    along, limits = belief.limits.stiff, belief.limits
    if along != "least" and along not in DIRECTIONS:
        raise InputError(
            f"stiffness: expected least or one of {some(DIRECTIONS, 6)} as its direction, "
            f"got {along!r}"
        )
    robot, found = belief.robot, belief.correction
    low, high = tension_limits(robot, limits.lowest, limits.highest)
    whole = assemble(belief.experiment.setup(belief.effects))
    tables = driven_tables(whole, robot)
    pulls = np.nan_to_num(found.solution.tensions * robot.falls)[:, robot.driven]
    aims = np.clip(pulls, low, high)
    matrices, loads = balance_of(tables, low, np.maximum(aims, _LEAST * tables.scale[:, None]))
    for i in np.flatnonzero(found.held):
        least = np.maximum(low, _LEAST * tables.scale[i])
        row = np.array([i])
        start = np.maximum(aims[i], least)
        shape = _Shape.of(robot, take(whole, row), take(tables, row), start, along)
        best = _largest(shape, matrices[i], loads[i], least, high)
        if best is not None:
            aims[i] = np.clip(best, low, high)
    return aims / robot.falls[robot.driven]


@dataclass(frozen=True, eq=False)
class _Shape:
    """K = base + sum (tau_i - start_i) slopes_i at one pose, and what of it is to be large.

    Attributes:
        start: (k,) [N] of the driven cables. base: (d, d) [N/m]. slopes: (k, d, d) [1/m].
        force: (d,) of a direction; None for the least eigenvalue.
        root: (d, d) with root root^T the products of the coordinates' motions.
    """

    start: Array
    base: Array
    slopes: Array
    force: Array | None
    root: Array

    @classmethod
    def of(cls, robot: Robot, whole: Tables, driven: Tables, start: Array, along: str) -> _Shape:
        """Of one pose, with the tables of all lines and those of the driven cables."""
        k = len(start)
        step = max(1e-3 * float(driven.scale[0]), 1e-6 * float(start.max()))
        trials = start + step * np.concatenate([np.zeros((1, k)), np.eye(k)])
        many, own = (take(one, np.zeros(k + 1, dtype=np.intp)) for one in (whole, driven))
        strung = with_rest(many, with_passive(robot, rest_for(own, trials)))
        there = batch.evaluate(strung, here(strung))
        matrices = batch.stiffness(strung, there)
        # not the tensions asked for where cables have weight, but those that these lengths have
        pulls = there.states[:, robot.driven, TENSION]
        apart = np.diagonal(pulls[1:] - pulls[0])
        slopes = (matrices[1:] - matrices[0]) / apart[:, None, None]
        motions = batch.motions(strung, there)[0]
        force = None if along == "least" else motions[:, DIRECTIONS.index(along)]
        root = np.linalg.cholesky(motions @ motions.T)
        return cls(pulls[0], matrices[0], slopes, force, root)

    def value(self, tensions: Array) -> tuple[float, Array]:
        """The stiffness [N/m] with tensions (k,), and its derivative (k,) [1/m] by them."""
        matrix = self.base + np.einsum("m,mde->de", tensions - self.start, self.slopes)
        inverse = np.linalg.inv(self.root)
        values, vectors = np.linalg.eigh(inverse @ matrix @ inverse.T)
        if self.force is None or values[0] <= 0.0:
            motion, value, factor = inverse.T @ vectors[:, 0], float(values[0]), 1.0
        else:
            motion = np.linalg.solve(matrix, self.force)
            value = 1.0 / float(self.force @ motion)
            factor = value**2
        return value, factor * np.einsum("d,mde,e->m", motion, self.slopes, motion)


def _largest(shape: _Shape, matrix: Array, load: Array, low: Array, high: Array) -> Array | None:
    """Tensions (k,) [N] with the largest stiffness; None if none within the limits balance."""
    from scipy.optimize import linprog  # takes a while to import

    m, cuts, ends = len(low), [], []
    aim = np.append(np.zeros(m), -1.0)
    equal = np.column_stack([matrix, np.zeros(len(load))])
    ends_of = [(a, None if np.isinf(b) else b) for a, b in zip(low, high, strict=True)]
    bounds = [*ends_of, (None, None)]
    now, best, most = shape.start, None, -np.inf
    for _ in range(_CUTS):
        value, slope = shape.value(now)
        if best is not None and value > most:
            best, most = now, value
        cuts.append(np.append(-slope, 1.0))
        ends.append(value - slope @ now)
        found = linprog(aim, np.array(cuts), np.array(ends), equal, load, bounds)
        if found.status == _UNBOUNDED:
            raise InputError(
                "scheme stiffness: the stiffness grows with the tensions without end; expected a "
                "highest tension [N]"
            )
        if found.status != _FOUND:
            return None
        now = found.x[:m]
        if best is None:
            best, most = now, shape.value(now)[0]
        if -found.fun - most <= _CLOSE * abs(most):
            break
    return best
