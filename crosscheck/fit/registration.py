"""Registers the tracker's frame to the predicted poses, by any angle, before anything is fitted.

All effects are seen through the tracker. Its frame is therefore registered first and without a
prior, so that the remaining errors do not depend on how the tracker was set up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from seecr.effects import ApartLayout, Layout, Term, layout_of
from seecr.pose import Array, quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat
from seecr.prediction.experiment import Prediction

NAME = "tracker_frame"
# Rounds of reweighting; the scale of the weights is the median distance.
_ROUNDS = 10
# Points show no rotation if their second-largest spread is less than this part of the largest.
_THIN = 1e-3


def registered(problem: Problem, at: Prediction) -> Term | None:
    """The tracker frame that brings the predicted poses nearest to the measured ones.

    Outliers get little weight. None if the positions and orientations read determine no rotation.
    """
    layout = layout_of(NAME, problem.robot)
    data = problem.data
    whole = problem.use & np.isfinite(data.position).all(axis=1) & at.solved
    turn = _turn(problem, at)
    places = (at.readings.position[whole], data.position[whole])
    if turn is None:
        turn = turn_of_points(*places)
    if turn is None:
        return None
    shift = np.zeros(3)
    if whole.any():
        shift = np.median(places[1] - quat_rotate(turn, places[0]), axis=0)
    return Term(layout, np.concatenate([shift, rotvec_from_quat(turn)]))


def registered_each(problem: Problem, at: Prediction, term: Term, mine: NDArray[np.bool_]) -> Term:
    """The effect with its tracker frame registered, or that of each file or run if separate.

    Args:
        problem: the data. at: the prediction with all frames at null.
        term: the effect as it stands. mine: (p,) which of its parameters may move.
    """
    values = term.vector.copy()
    for rows, where in _frames(problem, term.layout):
        frame = registered(problem.only(rows), at) if mine[where].any() else None
        if frame is not None:
            values[where] = frame.vector
    return term.with_vector(values)


def _frames(problem: Problem, layout: Layout) -> list[tuple[NDArray[np.bool_], slice]]:
    """For each frame, the rows (n,) that are read in it and the slice of its parameters."""
    if not isinstance(layout, ApartLayout):
        return [(problem.use, slice(0, len(layout)))]
    names = problem.data.parts[layout.kind]
    return [(names == part, layout.part(part)) for part in layout.parts]


def _turn(problem: Problem, at: Prediction) -> Array | None:
    """The rotation (4,) from predicted to measured orientations; None if none were read."""
    quat = problem.data.quat_wxyz
    if quat is None:
        return None
    rows = problem.use & np.isfinite(quat).all(axis=1) & at.solved
    if not rows.any():
        return None
    turns = quat_multiply(quat[rows], quat_conjugate(at.readings.quat_wxyz[rows]))
    weight, mean = np.ones(len(turns)), turns[0]
    for _ in range(_ROUNDS):
        # the mean is the eigenvector of the largest eigenvalue (Markley et al. 2007)
        mean = np.linalg.eigh((turns * weight[:, None]).T @ turns)[1][:, -1]
        off = np.linalg.norm(rotvec_from_quat(quat_multiply(turns, quat_conjugate(mean))), axis=1)
        weight = _counting(off)
    return np.asarray(mean)


def turn_of_points(here: Array, there: Array) -> Array | None:
    """The rotation (4,) that brings points (k, 3) nearest to others, by iterative reweighting.

    It is the eigenvector of Horn's matrix (Closed-form solution of absolute orientation, 1987).
    None if the points lie on a line, as fewer than three always do.
    """
    if len(here) < 3:
        return None
    weight, turn = np.ones(len(here)), None
    for _ in range(_ROUNDS):
        mean = [np.average(points, axis=0, weights=weight) for points in (here, there)]
        turn = _turn_of_weighted(here - mean[0], there - mean[1], weight)
        if turn is None:
            return None
        off = np.linalg.norm(there - mean[1] - quat_rotate(turn, here - mean[0]), axis=1)
        weight = _counting(off)
    return turn


def _turn_of_weighted(here: Array, there: Array, weight: Array) -> Array | None:
    # points on a line in either frame show no rotation: what bends them in the other is an error
    spreads = [np.linalg.svd(points, compute_uv=False) for points in (here, there)]
    if any(spread[1] <= _THIN * spread[0] for spread in spreads):
        return None
    s = (here * weight[:, None]).T @ there
    cross = np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])
    matrix = np.zeros((4, 4))
    matrix[0, 0] = np.trace(s)
    matrix[0, 1:] = matrix[1:, 0] = cross
    matrix[1:, 1:] = s + s.T - np.trace(s) * np.eye(3)
    return np.asarray(np.linalg.eigh(matrix)[1][:, -1])


def _counting(off: Array) -> Array:
    """Cauchy weights of rows by their distances, scaled by the median."""
    return np.asarray(1.0 / (1.0 + (off / max(float(np.median(off)), 1e-12)) ** 2))
