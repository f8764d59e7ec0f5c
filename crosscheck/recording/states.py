"""What one physics says the robot does, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class States:
    """Poses and cables at k commands, or at k instants.

    Attributes:
        pose: (k, 7); rows with NaN are not drawn.
        tensions: (k, m) [N].
        rest_lengths: (k, m) [m].
        slack: (k, m).
    """

    pose: Array
    tensions: Array
    rest_lengths: Array
    slack: NDArray[np.bool_]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which rows have an answer, (k,)."""
        return np.asarray(np.isfinite(self.pose).all(axis=1))
