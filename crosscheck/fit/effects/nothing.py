"""How far the values of an effect are from nothing, in their own standard errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from seecr.effects import Terms
from seecr.pose import Array


def distance_from_nothing(
    terms: Terms, covariance: Array, own: NDArray[np.bool_]
) -> tuple[float, int]:
    """Distance of some parameters together from null, in standard errors (Mahalanobis).

    Args:
        terms: effects with their values.
        covariance: (p, p) covariance of these; inf on the diagonal if unidentifiable.
        own: (p,) bool, which parameters.

    Returns:
        The distance and the number of parameters in it. Shapes, fixed values and unidentifiable
        parameters do not count. The distance is infinite if no parameter was free.
    """
    shape = np.concatenate([term.layout.shape for term in terms])
    free = own & ~shape & ~terms.knowledge.fixed
    if not free.any():
        return float("inf"), 0
    seen = np.flatnonzero(free & np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0))
    if not len(seen):
        return 0.0, 1
    scale = terms.scale[seen]
    z = (terms.vector - terms.null)[seen] / scale
    part = covariance[np.ix_(seen, seen)] / np.outer(scale, scale)
    squared = float(z @ np.linalg.pinv(part, hermitian=True) @ z)
    return float(np.sqrt(max(squared, 0.0))), len(seen)


def is_nothing(distance: float, count: int) -> bool:
    """Whether values together are within one standard error of null.

    For one value that is a distance of 1, below which chance stays in 68 %; for several values it
    is the distance below which chance stays as often.
    """
    if not np.isfinite(distance):
        return False
    return bool(special.chdtr(count, distance**2) <= special.chdtr(1, 1.0))
