"""The nearest poses that tensions within limits can hold, where wanted ones cannot be held.

Least position^2 + (length x rotation)^2 subject to balance, W(q) tau = -w(q), and limits: a
sequence of projections on the linearised balance (Gauss-Newton), each the same small problem as
a distribution of tensions, with the change of the pose among its unknowns.

From the wanted pose that goes to what is near it, but only where the workspace curves less than
the pose is far away. So a second search starts where the way from home leaves the workspace and
stays in it: each step aims but a little nearer to the wanted pose, which has the same answers, goes
back to balance, and counts where it came nearer (Levenberg's way with the length of steps). The
nearer of both answers is taken; there may be nearer ones still, turned otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.distribution import balanced, distribute, least_parts
from seecr.joints import pose_of_values, values_of_pose
from seecr.pose import Array, pose_add, pose_difference
from seecr.robot import Robot

Balance = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""Balance at poses (k, 7) of some rows, which may come again: matrices (k, d, m), loads (k, d)."""

# Rounds from the wanted pose, of which there are more where nothing follows; steps from home, and
# how often each goes back to balance; halvings of the way from home.
_ROUNDS, _ALONE, _INWARD, _RESTORED, _HALVINGS = 60, 200, 150, 2, 7
# How often rows go on from one another's answers, and by how much nearer these have to be.
_SHARED, _NEARER = 2, 1e-3
# A step that comes nearer by less than this part of its length ends the search.
_FLAT = 1e-7
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
    rows = np.arange(len(wanted))
    way.run(away, found, rows, _ALONE if fix_position else _ROUNDS)
    if not fix_position:
        way.keep_nearer(away, found, *way.from_home(rows))
        for _ in range(_SHARED):
            way.keep_nearer(away, found, *way.from_others(away, found))
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

    def run(
        self, away: Array, found: NDArray[np.bool_], rows: NDArray[np.intp], rounds: int
    ) -> None:
        """Go on from ``away`` (n, d) in some rows; that and ``found`` are changed in place."""
        n, length = len(self.wanted), self.robot.length
        expected, share = np.full(n, np.inf), np.ones(n)
        tensions = np.zeros(self.least.shape)
        tensions[rows] = self._balanced(away[rows], rows)[0]
        good, pulled = away.copy(), tensions.copy()
        helps = np.zeros(n, dtype=np.intp)
        for _ in range(rounds):
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

    def keep_nearer(
        self, away: Array, found: NDArray[np.bool_], other: Array, rows: NDArray[np.intp]
    ) -> None:
        """Take what was found for rows where it is nearer; the first two are changed in place."""
        nearer = np.linalg.norm(other, axis=1) < np.linalg.norm(away[rows], axis=1)
        nearer |= ~found[rows]
        away[rows[nearer]], found[rows] = other[nearer], True

    def from_home(self, rows: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
        """Answers (k, d) and their rows, from where the straight ways from home end to be held."""
        home = self.to(self.robot.reference_pose)
        rows = rows[self.held(home[rows], rows)]
        return self._inward(home[rows] * (1.0 - self._held_part(home[rows], rows)[:, None]), rows)

    def from_others(self, away: Array, found: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
        """Answers and their rows, from other rows' answers where these are nearer than the own."""
        own = np.where(found, np.linalg.norm(away, axis=1), np.inf)
        start, least = away.copy(), (1.0 - _NEARER) * own
        for pose in self.placed(away[found], np.flatnonzero(found)):
            there = self.to(pose)
            size = np.linalg.norm(there, axis=1)
            start = np.where((size < least)[:, None], there, start)
            least = np.minimum(size, least)
        rows = np.flatnonzero(least < (1.0 - _NEARER) * own)
        rows = rows[self.held(start[rows], rows)]
        return self._inward(start[rows], rows)

    def _inward(self, away: Array, rows: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
        """From poses (k, d) that are held to the nearest ones that are, and their rows."""
        pulls, length = self._balanced(away, rows)[0], self.robot.length
        reach, still = np.full(len(rows), length), np.arange(len(rows))
        for _ in range(_INWARD):
            if len(still) == 0:
                break
            at, far = rows[still], np.linalg.norm(away[still], axis=1)
            part = reach[still] / np.maximum(far, 1e-300)
            to, pull, left = self._nearer(away[still], pulls[still], at, np.minimum(part, 1.0))
            gain = far - np.linalg.norm(to, axis=1)
            better = (left <= _TIGHT * self.scale[at]) & (gain > 0.0)
            away[still[better]], pulls[still[better]] = to[better], pull[better]
            flat = better & (gain < _FLAT * reach[still])
            reach[still] *= np.where(better, 2.0, 0.25)
            still = still[~flat & (reach[still] > _ENOUGH * length) & (far > _ENOUGH * length)]
        return away, rows

    def _held_part(self, home: Array, rows: NDArray[np.intp]) -> Array:
        """(k,) how much of the straight way from home to the wanted poses can be held."""
        inner, outer = np.zeros(len(rows)), np.ones(len(rows))
        for _ in range(_HALVINGS):
            middle = 0.5 * (inner + outer)
            ok = self.held(home * (1.0 - middle[:, None]), rows)
            inner, outer = np.where(ok, middle, inner), np.where(ok, outer, middle)
        return inner

    def _nearer(
        self, away: Array, tensions: Array, rows: NDArray[np.intp], part: Array
    ) -> tuple[Array, Array, Array]:
        """A part of the way on and back to balance: where to, tensions, what is left [N]."""
        to, pull = away, tensions
        for k in range(_RESTORED + 1):
            goal = to * (1.0 - part[:, None]) if k == 0 else to
            step, change, _, possible = self._step(to, pull, rows, goal=goal)
            to = np.where(possible[:, None], to + step, away)
            pull = np.where(possible[:, None], pull + change, tensions)
        matrix, load = self.balance(self.placed(to, rows), rows)
        left = np.abs(np.einsum("ndm,nm->nd", matrix, pull) - load).max(axis=1)
        return to, pull, left

    def held(self, away: Array, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether the poses so far from those of rows can be held."""
        return np.asarray(self._balanced(away, rows)[1] < _TIGHT)

    def _balanced(self, away: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Tensions (k, m) that come nearest to balance, and what is left of the load (k,)."""
        if len(rows) == 0:
            return np.empty((0, self.least.shape[1])), np.empty(0)
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
        self,
        away: Array,
        tensions: Array,
        rows: NDArray[np.intp],
        helps: NDArray[np.intp] | None = None,
        goal: Array | None = None,
    ) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Steps of way and tensions, what is out of balance [N], whether there is a step.

        ``helps`` (n,) counts where least squares lost it to rounding, changed in place; without it
        nothing helps. To ``goal`` (k, d), or the wanted poses with the least tensions.
        """  # fmt: skip
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
        near = np.zeros(low.shape)
        if goal is not None:
            near = np.concatenate([tensions * unit, goal], axis=1)
        aim = load + np.einsum("ndk,nk->nd", rates, away)
        answer, possible = distribute(whole, aim, near, low, high)
        if helps is None:
            return (
                answer[:, m:] - away,
                answer[:, :m] / unit - tensions,
                np.abs(left).max(1),
                possible,
            )
        helps[rows[~possible]] += 1
        for i in np.flatnonzero(~possible & (helps[rows] <= _HELPS)):
            step = least_parts(whole[i], aim[i], low[i], high[i], m)
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
        (k, d), step = away.shape, _DIFFERENCE * self.robot.length
        sides = step * np.concatenate([np.eye(d), -np.eye(d)])
        moved = (away + sides[:, None]).reshape(-1, d)
        matrix, load = self.balance(self.placed(moved, np.tile(rows, 2 * d)), np.tile(rows, 2 * d))
        left = np.einsum("ndm,nm->nd", matrix, np.tile(tensions, (2 * d, 1))) - load
        plus, minus = left.reshape(2, d, k, -1)
        return np.asarray(np.moveaxis(plus - minus, 0, 2) / (2.0 * step))
