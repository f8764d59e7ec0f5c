"""Columns of cables that were exchanged: each belongs to another cable.

Every order of cables in which two, three or four columns are exchanged is tried. It is named if it
leaves far less than the order of the file, and than any other that exchanges no more columns:
cables that pull alike, as a mirror's do, show none.

* Lengths are held against those at the measured poses as they vary from row to row, since offsets
  are constant.
* Tensions are held against the load. Wrong stiffnesses, lengths and pretensions shift tensions
  between cables, but not their resultant, which balances the load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import TENSION, Problem
from crosscheck.preparation.unread import rows_of_files
from seecr.pose import Array, quat_from_rxyz
from seecr.prediction.experiment import Prediction
from seecr.statics.tables import portions
from seecr.units import short
from seecr.workspace.margins import balance_equations

# An order of cables leaves so many times less than that of the file, and than any other. Effects
# leave some of what they explain, but exchanged cables differ by decimetres and by most of a load.
_BETTER, _ALONE = 4.0, 2.0
# Lengths that were exchanged fit, by then, at most so many times worse than the others.
_AS_WELL = 3.0
# Least number of rows; most orders that are compared, and most columns that are exchanged.
_LEAST_ROWS, _MOST_ORDERS, _MOST = 8, 2_000, 4
# Where cables mostly pull against each other, small errors of direction outweigh what they hold.
_LEAST_HELD = 0.03
# Standard deviation of normal noise over its mean size.
_NORMAL = 1.2533
# Less than any noise: no misfit is smaller.
_TINY = 1e-12

Left = Callable[[NDArray[np.intp]], Array]
"""What is left unexplained (k,) in orders of cables (k, m); never less than the noise."""


def exchange_doubts(problem: Problem, pulls: Pulls | None) -> list[str]:
    """Sentences that name columns of lengths or tensions that seem exchanged."""
    # where lengths are exchanged the platform is not where it is predicted
    return list(_lengths(problem)) or ([] if pulls is None else list(_tensions(problem, pulls)))


def _lengths(problem: Problem) -> Iterator[str]:
    """About commanded lengths, held against the straight lengths at the measured poses."""
    read, pose = problem.data.command_lengths, _measured_pose(problem)
    if read is None or pose is None:
        return
    straight = problem.robot.nominal_lengths(pose)
    read = np.where(problem.robot.driven, read, straight)  # nobody commands the others
    for name, mine in rows_of_files(problem):
        rows = mine & np.isfinite(straight).all(axis=1)
        apart = misfits(read[rows], straight[rows], problem.sigma.position_m or 0.0)
        order = exchanged_lengths(apart, int(rows.sum()))
        # if all are, an axis or the tracker's frame may be reversed instead
        if order and len(order) < len(apart):
            own = list(order)
            pairs = (apart[own, own], apart[own, list(order.values())])
            here, there = (1e3 * float(np.sqrt(np.mean(x**2))) for x in pairs)
            yield (
                f"{name}{_seem('length', order)}: apart from constants they differ by "
                f"{short(here)} mm from the straight lengths at the measured poses, and by "
                f"{short(there)} mm if they are exchanged. They are taken as they stand."
            )


def _tensions(problem: Problem, pulls: Pulls) -> Iterator[str]:
    """About measured tensions, which are to balance the load."""
    m = problem.robot.n_cables
    for name, mine in rows_of_files(problem):
        rows = mine & pulls.whole
        if rows.sum() < _LEAST_ROWS:
            continue
        left = unbalanced(pulls, rows, problem.sigma.tension_N or 0.0)
        order = exchanged(left, m, int(rows.sum()))
        # if all are, an axis may be reversed instead, which positions would show
        if order and (len(order) < m or problem.data.has_position):
            own = np.arange(m)
            here, there = left(np.stack([own, [order.get(i, i) for i in own.tolist()]])).tolist()
            yield (
                f"{name}{_seem('tension', order)}: as they stand the measured tensions leave "
                f"{short(here)} N of the load unbalanced, and {short(there)} N if they are "
                "exchanged. They are taken as they stand."
            )


def _seem(what: str, order: Mapping[int, int]) -> str:
    """Which columns seem exchanged, and of which cable each is if they are more than two."""
    names = {i: f"{what}_{i + 1}" for i in sorted(order)}
    *others, last = names.values()
    of = [f"{name} is of cable {order[i] + 1}" for i, name in names.items()]
    more = f" ({', '.join(of)})" if others[1:] else ""
    return f"The columns {', '.join(others)} and {last} seem exchanged{more}"


def exchanged(left: Left, m: int, rows: int) -> dict[int, int]:
    """For columns that seem exchanged, the cable that each is of; empty if none is certain.

    ``left`` says what orders of m cables leave unexplained in a number of rows.
    """
    own = np.arange(m)
    found: dict[int, int] = {}
    if rows < _LEAST_ROWS or m < 2:
        return found
    most = float(left(own[None])[0]) / _BETTER
    tried = np.zeros(0)
    for orders in _orders(m):
        sizes = left(orders)
        tried = np.concatenate([tried, sizes])
        best = orders[int(np.argmin(sizes))]
        there = float(sizes.min())
        if there <= most:
            most = there / _ALONE  # exchanging more columns must pay, once fewer explain most
            alone = (tried < _ALONE * there).sum() == 1
            found = {int(i): int(best[i]) for i in np.flatnonzero(best != own)} if alone else {}
    return found


def _orders(m: int) -> Iterator[NDArray[np.intp]]:
    """Orders (k, m) of cables with two columns exchanged, then with three, and so on."""
    for moved in range(2, min(_MOST, m) + 1):
        rows = []
        for some in combinations(range(m), moved):
            for other in permutations(some):
                if all(i != j for i, j in zip(some, other, strict=True)):
                    order = np.arange(m)
                    order[list(some)] = other
                    rows.append(order)
            if len(rows) > _MOST_ORDERS:
                return
        yield np.array(rows)


def _measured_pose(problem: Problem) -> Array | None:
    """Poses (n, 7) as measured; what no sensor reads is as at the reference pose.

    NaN in rows whose position was not read; None without two coordinates of it.
    """
    data, home = problem.data, problem.robot.reference_pose
    if data.position_mask.sum() < 2:
        return None
    place = np.where(data.position_mask, data.position, home[:3])
    quat = quat_from_rxyz(data.angles_rad) if data.quat_wxyz is None else data.quat_wxyz
    known = np.asarray(np.isfinite(quat).all(axis=1))
    return np.concatenate([place, np.where(known[:, None], quat, home[3:])], axis=1)


def misfits(read: Array, expected: Array, noise: float) -> Array:
    """How column i, as read (n, m), varies about what is expected of cable j, (m, m).

    It is no less than the noise.
    """
    off = read[:, :, None] - expected[:, None, :]
    if not len(off):
        return np.zeros(off.shape[1:])
    spread = _NORMAL * np.mean(np.abs(off - np.median(off, axis=0)), axis=0)
    return np.asarray(np.maximum(spread, max(noise, _TINY)))


def exchanged_lengths(apart: Array, rows: int) -> dict[int, int]:
    """For columns of lengths that seem exchanged, the cable that each is of.

    An order is as good as its worst column, and exchanged columns fit about as well as the others.
    ``apart`` (m, m) holds the :func:`misfits` of some rows.
    """
    columns = np.arange(len(apart))
    order = exchanged(lambda orders: apart[columns, orders].max(axis=1), len(apart), rows)
    others = [apart[i, i] for i in columns if i not in order]
    there = max((apart[i, j] for i, j in order.items()), default=0.0)
    return order if not others or there <= _AS_WELL * np.median(others) else {}


@dataclass(frozen=True, eq=False)
class Pulls:
    """Tensions as measured and as predicted, and what they hold along the platform's coordinates.

    Attributes:
        matrix: gives (k, d, m) forces per tension of some rows at their predicted poses, torques
            over the robot's length: that of all rows takes as much memory as all else together.
        measured, expected: (n, m) [N], 0 where one of them is not known.
        whole: (n,) rows in which all cables were read: what an unread one holds is not known.
        free: whether balance alone fixes every tension, since there is no pretension.
    """

    matrix: Callable[[NDArray[np.intp]], Array]
    measured: Array
    expected: Array
    whole: NDArray[np.bool_]
    free: bool

    @classmethod
    def of(cls, problem: Problem, at: Prediction) -> Pulls | None:
        """Of some data, beside what the model as it stands predicts; None if no tension counts."""
        if not problem.counted[:, TENSION].any():
            return None
        robot = problem.robot
        pose = np.where(at.solved[:, None], at.pose, robot.reference_pose)
        known: NDArray[np.bool_] = problem.counted[:, TENSION] & at.solved[:, None]
        known &= np.isfinite(at.readings.tensions)
        return cls(
            matrix=lambda rows: balance_equations(robot, pose[rows])[0],
            measured=np.where(known, problem.data.tensions, 0.0),
            expected=np.where(known, at.readings.tensions, 0.0),
            whole=np.asarray(known.all(axis=1)),
            free=robot.n_driven <= robot.n_dof,
        )

    @cached_property
    def load(self) -> Array:
        """(n, d) [N] what the predicted tensions hold."""
        return self.held(self.expected)

    def held(self, tensions: Array) -> Array:
        """The resultant (n, d) [N] of tensions (n, m)."""
        every = portions(np.arange(len(tensions)))
        return np.concatenate([(self.matrix(k) @ tensions[k][..., None])[..., 0] for k in every])

    def carried(self) -> Array:
        """Part (n,) of the load that the measured tensions hold; NaN where it is not known."""
        total = self.expected.sum(axis=1)
        if self.free:  # any of the tensions tells
            some, whole, known = self.measured.sum(axis=1), total, total > 0.0
        else:
            some = (self.held(self.measured) * self.load).sum(axis=1)
            whole = (self.load**2).sum(axis=1)
            known = self.whole & (np.sqrt(whole) > _LEAST_HELD * total)
        return np.where(known, some / np.where(known, whole, 1.0), np.nan)


def unbalanced(pulls: Pulls, rows: NDArray[np.bool_], noise: float) -> Left:
    """What measured tensions leave of the load [N] in any order of cables, over some rows (n,).

    Each order may have a scale: load cells and masses that are off by one factor do not count.
    """
    count, m = int(rows.sum()), pulls.measured.shape[1]
    gram, along, squares = np.zeros((m * m, m * m)), np.zeros((m, m)), np.zeros(4)
    for some in portions(np.flatnonzero(rows)):
        matrix, read, load = pulls.matrix(some), pulls.measured[some], pulls.load[some]
        # each column i of tensions at each cable j, and their products with others and the load
        at = np.einsum("ndj,ni->ijnd", matrix, read).reshape(m * m, -1)
        gram += at @ at.T
        along += (at @ load.ravel()).reshape(m, m)
        squares += [float((x**2).sum()) for x in (pulls.expected[some], read, matrix, load)]
    gram = gram.reshape(m, m, m, m)
    of_expected, of_read, of_matrix, whole = squares.tolist()
    scale = math.sqrt(of_expected) / max(math.sqrt(of_read), _TINY)
    least = max(scale * noise * math.sqrt(of_matrix / count), _TINY)
    columns = np.arange(m)

    def left(orders: NDArray[np.intp]) -> Array:
        held = np.maximum(along[columns, orders].sum(axis=1), 0.0)
        square = gram[
            columns[None, :, None], orders[:, :, None], columns[None, None, :], orders[:, None, :]
        ].sum(axis=(1, 2))
        rest = whole - held**2 / np.maximum(square, 1e-300)
        return np.asarray(np.maximum(np.sqrt(np.maximum(rest, 0.0) / count), least))

    return left
