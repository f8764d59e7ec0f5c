"""Regions of the workspace: halves of the commanded positions along each axis that is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from seecr.pose import Array

# An axis along which the commands spread by less than this part of the longest is not cut.
_FLAT = 0.05


def regions_of(problem: Problem, pose: Array) -> NDArray[np.str_]:
    """The region of each row, (n,) such as "x below 0.4 m, z above 0.15 m".

    Args:
        problem: the data.
        pose: (n, 7) commanded.
    """
    place = pose[:, :3]
    used = place[problem.use] if problem.use.any() else place
    low, high = used.min(axis=0), used.max(axis=0)
    spread = high - low
    words = [[] for _ in place]  # type: list[list[str]]
    for k, axis in enumerate("xyz"):
        if spread[k] <= _FLAT * spread.max() or spread[k] == 0:
            continue
        middle = 0.5 * (low[k] + high[k])
        for row, value in zip(words, place[:, k], strict=True):
            row.append(f"{axis} {'below' if value < middle else 'above'} {middle:.3g} m")
    return np.array([", ".join(row) or "everywhere" for row in words], dtype=np.str_)
