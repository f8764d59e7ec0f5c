"""The range of the data that a model was fitted to, and what lies beyond it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit
from numpy.typing import ArrayLike, NDArray

from seecr.counted import between, counted
from seecr.pose import Array
from seecr.units import millimetres

if TYPE_CHECKING:
    from seecr.prediction.cells import Where

TABLE = "fitted_to"
"""The table of a model that holds the range."""

_POSITION, _TENSION = "position_m", "tension_N"
# Beyond the data is a tension of so many times the largest one, and a position outside the box of
# the data by this part of its diagonal, or of the robot's length if all data are at about one
# place.
_TENSE, _OUTSIDE, _SPOT = 1.2, 0.1, 0.02
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class DataReach:
    """The range of positions and tensions in the data, as the model predicts them.

    Attributes:
        low, high: (3,) [m] corners of the box of the positions, base frame.
        least, largest: [N] of all tensions.
    """

    low: Array
    high: Array
    least: float
    largest: float

    @classmethod
    def of(cls, positions: Array, tensions: Array) -> DataReach | None:
        """The range of positions (n, 3) [m] and tensions (n, m) [N]; None if there are no rows."""
        if len(positions) == 0:
            return None
        ends = positions.min(axis=0), positions.max(axis=0)
        return cls(*ends, float(tensions.min()), float(tensions.max()))

    @classmethod
    def read(cls, where: Where, document: Mapping[str, Any]) -> DataReach | None:
        """The range in a model's document; None if it states none.

        Raises:
            InputFileError: values that are not numbers, or corners in the wrong order.
        """
        table = document.get(TABLE)
        if table is None:
            return None
        try:
            low, high = np.asarray(table[_POSITION], float)
            least, largest = np.asarray(table[_TENSION], float)
            fine = low.shape == high.shape == (3,) and np.all(low <= high) and least <= largest
        except (OverflowError, TypeError, ValueError, KeyError):
            fine = False
        if not fine:
            raise where.error(
                f"[{TABLE}]: expected {_POSITION} = [[x, y, z], [x, y, z]], the corners of the "
                f"data, and {_TENSION} = [least, largest]; leave it out if it is not known",
                key=TABLE,
            )
        return cls(low, high, float(least), float(largest))

    def as_toml(self) -> tomlkit.items.Table:
        """The table of a model that holds the range."""
        table = tomlkit.table()
        table.add(tomlkit.comment("Where the platform was in the data, and its cable tensions."))
        corners, pulls = np.stack([self.low, self.high]), np.array([self.least, self.largest])
        table[_POSITION] = _rounded(corners).tolist()
        table[_TENSION] = _rounded(pulls).tolist()
        return table

    def outside(self, positions: ArrayLike, length: float) -> NDArray[np.float64]:
        """Distance (n,) [m] of positions (n, 3) from the box; 0 inside the box and near it.

        Args:
            positions: [m], base frame; NaN counts as inside.
            length: of the robot [m].
        """
        positions = np.asarray(positions, float)
        over = np.maximum(np.maximum(self.low - positions, positions - self.high), 0.0)
        away = np.nan_to_num(np.linalg.norm(over, axis=1))
        near = max(_OUTSIDE * float(np.linalg.norm(self.high - self.low)), _SPOT * length)
        return np.where(away > near, away, 0.0)

    def beyond(self, positions: Array, tensions: Array, length: float) -> tuple[str, ...]:
        """A sentence about the rows beyond the data; an empty tuple if there are none.

        Args:
            positions: (n, 3) [m] where the platform is at rest.
            tensions: (n, m) [N] there.
            length: of the robot [m].
        """
        away = self.outside(positions, length)
        pulls = np.nan_to_num(tensions).max(axis=1, initial=0.0)
        tense = pulls > _TENSE * self.largest
        rows = (away > 0.0) | tense
        if not np.any(rows):
            return ()
        parts = []
        if np.any(tense):
            parts.append(
                f"tensions up to {pulls.max():.4g} N, whereas the data have "
                f"{between(self.least, self.largest)} N"
            )
        if np.any(away > 0.0):
            parts.append(f"up to {millimetres(away.max(), 3)} outside the region of the data")
        which = "" if len(rows) == 1 else f" at {int(rows.sum())} of {counted(len(rows), 'pose')}"
        return (
            f"beyond the data that the model was fitted to{which}: {', '.join(parts)}; "
            "predictions there are extrapolated",
        )


def _rounded(values: Array) -> Array:
    """Values rounded to some digits of their spread: a base frame may be far from the robot."""
    apart = float(np.ptp(values, axis=0).max()) or float(np.abs(values).max()) or 1.0
    return np.asarray(np.round(values, _DIGITS - int(np.ceil(np.log10(apart)))) + 0.0)
