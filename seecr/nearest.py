"""The nearest poses that tensions within limits can hold, where wanted ones cannot be held.

Least position^2 + (length x rotation)^2 subject to balance, W(q) tau = -w(q), and limits: a
sequence of projections on the linearised balance (Gauss-Newton), each the same small problem as
a distribution of tensions, with the change of the pose among its unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.distribution import balanced, distribute
from seecr.joints import pose_of_values, values_of_pose
from seecr.pose import Array, pose_add, pose_difference
from seecr.robot import Robot

Balance = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""Balance at poses (k, 7) of some rows: matrices (k, d, m) and loads (k, d), A tau = load."""

_ROUNDS = 200
# Steps of a pose that a linear program may help with: each takes milliseconds.
_HELPS = 30
# A pose this near to the limit is held with something to spare: tensions, relative to the load.
_INSIDE = 1e-6
# Weight of a tension of one load, as a displacement over the robot's length: next to none.
_WEIGHT = 1e-3
# Largest step, difference for derivatives, and steps that end the search, over the length.
_LARGEST, _DIFFERENCE, _ENOUGH = 0.3, 1e-5, 1e-6
# Balance that ends it, of the load; steps that do not fall by this are halved, down to this.
_TIGHT, _FALLS, _SLOWEST = 1e-9, 0.7, 0.02


def nearest(
    robot: Robot,
    wanted: Array,
    balance: Balance,
    low: Array,
    high: Array,
    scale: Array,
    fix_position: bool = False,
) -> tuple[Array, NDArray[np.bool_]]:
    """The nearest poses that can be held, and whether any were found.

    Args:
        robot: as described.
        wanted: (n, 7).
        balance: what holds at a pose.
        low, high: (m,) limits [N].
        scale: (n,) [N] load.
        fix_position: the position is kept, only the orientation gives way.

    Returns:
        (n, 7) and (n,) bool.
    """
    inside = _INSIDE * scale[:, None]
    least = np.minimum(low + inside, 0.5 * (low + np.minimum(high, 1e300)))
    most = np.maximum(high - inside, least)
    values = values_of_pose(robot, wanted)[0] if robot.joints else None
    # how far each coordinate may go from its wanted value: rotations times the length
    free = np.full(robot.n_dof, np.inf)
    if fix_position:
        free[~robot.hinges] = 0.0
    way = _Way(robot, wanted, values, balance, least, most, scale, free)
    away, found = np.zeros((len(wanted), robot.n_dof)), np.zeros(len(wanted), dtype=bool)
    way.run(away, found, np.arange(len(wanted)))
    lost = np.flatnonzero(~found)
    if not fix_position and len(lost):
        # from afar the linearised balance leads nowhere: go from where the robot is at home, if
        # it can be held there
        home = way.to(robot.reference_pose)
        lost = lost[way.held(home[lost], lost)]
        away[lost] = home[lost]
        way.run(away, found, lost)
    return way.placed(away, np.arange(len(wanted))), found


@dataclass(frozen=True, eq=False)
class _Way:
    """The search for n poses; ``away`` (n, d) is how far each is from its wanted one [m]."""

    robot: Robot
    wanted: Array
    values: Array | None
    balance: Balance
    least: Array
    most: Array
    scale: Array
    free: Array

    def run(self, away: Array, found: NDArray[np.bool_], rows: NDArray[np.intp]) -> None:
        """Go on from ``away`` (n, d) in some rows; that and ``found`` are changed in place."""
        if len(rows) == 0:
            return
        n, length = len(self.wanted), self.robot.length
        expected, share = np.full(n, np.inf), np.ones(n)
        tensions = np.zeros(self.least.shape)
        tensions[rows] = self._balanced(away[rows], rows)[0]
        good, pulled = away.copy(), tensions.copy()
        helps = np.zeros(n, dtype=np.intp)
        for _ in range(_ROUNDS):
            step, change, left, possible = self._step(away[rows], tensions[rows], rows, helps)
            size = np.linalg.norm(step, axis=1)
            done = possible & (left <= _TIGHT * self.scale[rows]) & (size <= _ENOUGH * length)
            found[rows[done]] = True
            # curvature that the linearised balance does not see can make whole steps go to and fro
            slower = np.maximum(0.5 * share[rows], _SLOWEST)
            slow = (size > expected[rows]) | ~possible
            share[rows] = np.where(slow, slower, share[rows])
            on, back = rows[possible & ~done], rows[~possible]
            good[on], pulled[on] = away[on], tensions[on]
            part = np.minimum(share[rows], _LARGEST * length / np.maximum(size, 1e-300))
            # what is left where all goes as the linearised balance says, and somewhat more
            expected[rows] = (1.0 - (1.0 - _FALLS) * part) * size
            part = part[possible & ~done][:, None]
            away[on] += part * step[possible & ~done]
            tensions[on] += part * change[possible & ~done]
            # too far: half the way back to where there was a step, until that is no way any more
            near = np.linalg.norm(away[back] - good[back], axis=1) <= _ENOUGH * length
            back = back[~near]
            away[back] = 0.5 * (away[back] + good[back])
            tensions[back] = 0.5 * (tensions[back] + pulled[back])
            rows = np.sort(np.concatenate([on, back]))
            if len(rows) == 0:
                break

    def held(self, away: Array, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether the poses so far from those of rows can be held."""
        return np.asarray(self._balanced(away, rows)[1] < _TIGHT)

    def _balanced(self, away: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Tensions (k, m) that come nearest to balance, and what is left of the load (k,)."""
        each = zip(rows, *self.balance(self.placed(away, rows), rows), strict=True)
        found = [balanced(a, load, self.least[i], self.most[i]) for i, a, load in each]
        tensions = np.array([one for one, _left in found]).reshape(len(rows), -1)
        return tensions, np.array([left for _one, left in found])

    def to(self, pose: Array) -> Array:
        """(n, d) how far a pose is from each wanted one."""
        if self.values is None:
            change = pose_difference(pose, self.wanted)
        else:
            change = values_of_pose(self.robot, pose[None])[0] - self.values
        return change * np.where(self.robot.hinges, self.robot.length, 1.0)

    def _step(
        self, away: Array, tensions: Array, rows: NDArray[np.intp], helps: NDArray[np.intp]
    ) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Steps of way and tensions, what is out of balance [N], whether there is a step.

        ``helps`` (n,) counts where least squares lost it to rounding, changed in place.
        """
        k, m = tensions.shape
        matrix, load = self.balance(self.placed(away, rows), rows)
        rates = self._rates(away, tensions, rows)
        left = np.einsum("ndm,nm->nd", matrix, tensions) - load
        # unknowns: tensions, scaled to next to nothing, and the whole way from the wanted pose
        unit = (_WEIGHT * self.robot.length / self.scale[rows])[:, None]
        whole = np.concatenate([matrix / unit[:, None], rates], axis=2)
        low, high = (
            np.concatenate([one[rows] * unit, np.tile(sign * self.free, (k, 1))], axis=1)
            for one, sign in ((self.least, -1.0), (self.most, 1.0))
        )
        aim = load + np.einsum("ndk,nk->nd", rates, away)
        answer, possible = distribute(whole, aim, np.zeros(low.shape[1]), low, high)
        helps[rows[~possible]] += 1
        for i in np.flatnonzero(~possible & (helps[rows] <= _HELPS)):
            step = _by_parts(whole[i], aim[i], low[i], high[i], m)
            if step is not None:
                answer[i], possible[i] = step, True
        return answer[:, m:] - away, answer[:, :m] / unit - tensions, np.abs(left).max(1), possible

    def placed(self, away: Array, rows: NDArray[np.intp]) -> Array:
        """Poses (k, 7) so far from the wanted ones of rows."""
        change = away * np.where(self.robot.hinges, 1.0 / self.robot.length, 1.0)
        if self.values is None:
            return pose_add(self.wanted[rows], change)
        return pose_of_values(self.robot, self.values[rows] + change)[0]

    def _rates(self, away: Array, tensions: Array, rows: NDArray[np.intp]) -> Array:
        """Derivatives (k, d, d) of what is out of balance by the way, the tensions kept."""
        d, step = away.shape[1], _DIFFERENCE * self.robot.length
        out = np.empty((len(away), d, d))
        for k in range(d):
            sides = []
            for sign in (1.0, -1.0):
                moved = away + sign * step * np.eye(d)[k]
                matrix, load = self.balance(self.placed(moved, rows), rows)
                sides.append(np.einsum("ndm,nm->nd", matrix, tensions) - load)
            out[..., k] = (sides[0] - sides[1]) / (2.0 * step)
        return out


def _by_parts(matrix: Array, aim: Array, low: Array, high: Array, m: int) -> Array | None:
    """Balance with the least sum of parts of the way, where least squares lose it to rounding.

    The first m unknowns are tensions, which cost nothing. A linear program (HiGHS, by SciPy).
    """
    from scipy.optimize import linprog

    d = matrix.shape[1] - m
    unit = np.abs(matrix).max(axis=0)
    unit = np.where(unit > 0.0, unit, 1.0)
    scaled = matrix / unit
    found = linprog(
        np.concatenate([np.zeros(m), np.tile(1.0 / unit[m:], 2)]),
        A_eq=np.concatenate([scaled, -scaled[:, m:]], axis=1),
        b_eq=aim,
        bounds=[
            *zip(low[:m] * unit[:m], high[:m] * unit[:m], strict=True),
            *zip(np.zeros(2 * d), np.tile(high[m:] * unit[m:], 2), strict=True),
        ],
        method="highs",
    )
    if found.status != 0:
        return None
    way = found.x[m : m + d] - found.x[m + d :]
    return np.asarray(np.concatenate([found.x[:m], way]) / unit)
