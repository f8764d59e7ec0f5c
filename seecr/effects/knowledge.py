"""What is known of an effect's parameters beside the data that a fit sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Of p parameters: which are never fitted, and which somebody measured independently.

    Attributes:
        fixed: (p,) bool: stays as it is in every fit.
        value: (p,) measured independently, each in its unit; NaN where nobody did.
        stderr: (p,) standard error of that; inf where nobody did.
    """

    fixed: NDArray[np.bool_]
    value: Array
    stderr: Array

    @classmethod
    def nothing(cls, count: int) -> Knowledge:
        """Of so many parameters, nothing."""
        return cls(np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.inf))

    @classmethod
    def joined(cls, parts: Sequence[Knowledge]) -> Knowledge:
        """Of several effects' parameters, one after another."""
        whole = [cls.nothing(0), *parts]
        return cls(
            np.concatenate([part.fixed for part in whole]),
            np.concatenate([part.value for part in whole]),
            np.concatenate([part.stderr for part in whole]),
        )

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(p,) whether a fit is to take what was measured as a reading."""
        return np.asarray(np.isfinite(self.stderr) & ~self.fixed)

    @property
    def any(self) -> bool:
        """Whether anything is known."""
        return bool(np.any(self.fixed) or np.any(self.measured))
