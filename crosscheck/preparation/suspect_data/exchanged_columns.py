"""Columns of cables that were exchanged: each belongs to another cable.

Lengths are compared with those at the measured poses as they vary from row to row, since offsets
are constant; tensions by the load that they balance. Columns are named only if the exchange
explains far more than any other: cables that pull alike, as a mirror's do, show none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.preparation.suspect_data.orders import reordered
from crosscheck.preparation.suspect_data.pulls import Pulls
from seecr.pose import Array, quat_from_rxyz
from seecr.prediction.experiment import Prediction
from seecr.units import short

# Another cable explains a column this many times better than its own, and than any other does.
_BETTER = 4.0
# Columns that were exchanged are explained, by then, at most so many times worse than the others.
_AS_WELL = 3.0
# Least number of rows, and most columns that are looked at together.
_LEAST_ROWS, _MOST = 8, 4
_KEPT = "They are taken as they stand."
# Standard deviation of normal noise over its mean size.
_NORMAL = 1.2533


def exchange_doubts(problem: Problem, at: Prediction) -> list[str]:
    """Sentences that name columns of lengths or tensions that seem exchanged.

    Args:
        problem: the data with their noise. at: what the model as it stands predicts.
    """
    # where lengths are exchanged the platform is not where it is predicted
    return list(_lengths(problem)) or list(_tensions(problem, at))


def _lengths(problem: Problem) -> Iterator[str]:
    """About commanded lengths, held against the straight lengths at the measured poses."""
    read, pose = problem.data.command_lengths, _measured_pose(problem)
    if read is None or pose is None:
        return
    straight = problem.robot.nominal_lengths(pose)
    for name, mine in _files(problem):
        rows = mine & np.isfinite(straight).all(axis=1)
        if rows.sum() < _LEAST_ROWS:
            continue
        apart = misfits(read[rows], straight[rows], problem.sigma.position_m or 0.0)
        found = exchanges(apart)
        # if all are, an axis or the tracker's frame may be reversed instead
        if found and len(found) < len(apart):
            here, there = (
                f"{short(1e3 * float(np.sqrt(np.mean(np.square(sizes)))))} mm"
                for sizes in (
                    [apart[i, i] for i in found],
                    [apart[i, j] for i, j in found.items()],
                )
            )
            yield (
                f"{name}{_seem('length', found)}: apart from constants they differ by {here} from "
                f"the straight lengths at the measured poses, and by {there} if they are "
                f"exchanged. {_KEPT}"
            )


def _tensions(problem: Problem, at: Prediction) -> Iterator[str]:
    """About measured tensions, which are to balance the load."""
    if not problem.data.has_tension:
        return
    pulls = Pulls(problem, at)
    for name, rows in _files(problem):
        found = reordered(pulls, rows)
        if found is None:
            continue
        # if all are, an axis may be reversed instead, which positions would show
        if len(found.cables) < problem.robot.n_cables or problem.data.has_position:
            yield (
                f"{name}{_seem('tension', found.cables)}: as they stand the measured tensions "
                f"leave {short(found.here)} N of the load unbalanced, and {short(found.there)} N "
                f"if they are exchanged. {_KEPT}"
            )


def _files(problem: Problem) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Each file's name, as a sentence begins with it, and its rows (n,) with readings."""
    data = problem.data
    for k in np.unique(data.file):
        yield (f"{data.files[k]}: " if data.files else ""), data.read & (data.file == k)


def _seem(what: str, found: Mapping[int, int]) -> str:
    """Which columns seem exchanged, and of which cable each is if they are more than two."""
    names = {i: f"{what}_{i + 1}" for i in sorted(found)}
    *others, last = names.values()
    of = [f"{name} is of cable {found[i] + 1}" for i, name in names.items()]
    more = f" ({', '.join(of)})" if others[1:] else ""
    return f"The columns {', '.join(others)} and {last} seem exchanged{more}"


def _measured_pose(problem: Problem) -> Array | None:
    """Poses (n, 7) as measured; what no sensor reads is as at the reference pose.

    NaN in rows whose position was not read; None without two coordinates of it.
    """
    data, home = problem.data, problem.robot.reference_pose
    if data.position_mask.sum() < 2:
        return None
    place = np.where(data.position_mask, data.position, home[:3])
    quat = data.quat_wxyz
    if quat is None:
        quat = quat_from_rxyz(data.angles_rad)
    known = np.asarray(np.isfinite(quat).all(axis=1))
    return np.concatenate([place, np.where(known[:, None], quat, home[3:])], axis=1)


def misfits(read: Array, expected: Array, noise: float) -> Array:
    """How column i, as read, varies about what is expected of cable j, (m, m).

    Args:
        read, expected: (n, m). noise: the least that they can vary, apart from luck.
    """
    off = read[:, :, None] - expected[:, None, :]
    spread = _NORMAL * np.mean(np.abs(off - np.median(off, axis=0)), axis=0)
    return np.asarray(np.maximum(spread, max(noise, 1e-12)))


def exchanges(apart: Array) -> dict[int, int]:
    """For columns that seem exchanged, the cable that each is of; empty if none is certain.

    Args:
        apart: (m, m) misfit of column i and cable j.
    """
    own = np.diagonal(apart)
    far = (own[:, None] > _BETTER * apart).any(axis=1)
    some = np.flatnonzero(far)
    if not 2 <= len(some) <= min(_MOST, max(2, len(own) // 2)):
        return {}
    block = apart[np.ix_(some, some)]
    best = _best_order(block)
    if best is None or not _fits_as_well(block[np.arange(len(some)), best], own[~far]):
        return {}
    return {int(i): int(some[j]) for i, j in zip(some, best, strict=True)}


def _best_order(block: Array) -> NDArray[np.intp] | None:
    """The only order of cables in which all columns fit far better than in their own, if any."""
    rows = np.arange(len(block))
    orders = np.array(list(permutations(rows)))
    best = orders[int(np.argmin(np.log(block[rows, orders]).sum(axis=1)))]
    there = block[rows, best]
    # any other order has a column that fits far worse
    worse = (block[rows, orders] > _BETTER * there).any(axis=1)
    same = (orders == best).all(axis=1)
    moved = np.diagonal(block) > _BETTER * there
    return best if moved.all() and (worse | same).all() else None


def _fits_as_well(there: Array, others: Array) -> bool:
    """Whether exchanged columns fit about as well as those that were not."""
    return len(others) == 0 or bool(there.max() <= _AS_WELL * np.median(others))
