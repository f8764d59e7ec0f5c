"""Tensions farthest inside their limits by a linear program: the peer of ``tension_margin``."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog


def margin_by_highs(matrix: np.ndarray, load: np.ndarray, low: float, high: float) -> float:
    """max t with low + t <= tau <= high - t."""
    d, m = matrix.shape
    rows, right = [np.c_[-np.eye(m), np.ones(m)]], [np.full(m, -low)]
    if np.isfinite(high):
        rows.append(np.c_[np.eye(m), np.ones(m)])
        right.append(np.full(m, high))
    answer = linprog(
        np.r_[np.zeros(m), -1.0], A_ub=np.concatenate(rows), b_ub=np.concatenate(right),
        A_eq=np.c_[matrix, np.zeros(d)], b_eq=load, bounds=[(None, None)] * (m + 1),
        method="highs",
    )  # fmt: skip
    return np.inf if answer.status == 3 else float(answer.x[-1])
