"""One file of measurements while it is being read: columns in SI, refusals with their place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.errors import InputFileError
from crosscheck.measurements.columns import QUATERNION, Header, near_misses
from crosscheck.measurements.data import Mask
from crosscheck.measurements.table import Table
from seecr.pose import Array

if TYPE_CHECKING:
    from seecr.robot import Robot

# Files with six digits are rounded by up to 1e-6; a quaternion farther off is a mistake.
_NORM_TOLERANCE = 1e-3


class Source:
    """A table, what its columns mean, the robot it is about, and the notes taken on the way."""

    def __init__(self, table: Table, header: Header, robot: Robot) -> None:
        self.table, self.header, self.robot = table, header, robot
        self.notes: list[str] = []

    @property
    def n_rows(self) -> int:
        """Number of rows n."""
        return len(self.table.line)

    def has(self, quantity: str) -> bool:
        """Whether there is such a column."""
        return quantity in self.header.columns

    def name(self, quantity: str) -> str:
        """The column's name in the file."""
        return self.header.columns[quantity].name

    def column(self, quantity: str, *, blank_is_nan: bool = False) -> Array:
        """One column (n,) in SI."""
        column = self.header.columns[quantity]
        return column.unit.to_si(self.table.numbers(column.index, blank_is_nan=blank_is_nan))

    def readings(self, prefix: str, parts: Sequence[str]) -> Array:
        """Columns ``prefix_part`` (n, k) in SI; NaN where there is no column or an empty cell."""
        values = np.full((self.n_rows, len(parts)), np.nan)
        for k, part in enumerate(parts):
            quantity = f"{prefix}_{part}"
            if self.has(quantity):
                values[:, k] = self.column(quantity, blank_is_nan=True)
                if np.all(np.isnan(values[:, k])):
                    self.notes.append(f"Column {self.name(quantity)} is empty: not measured.")
        return values

    def quaternions(self, prefix: str, *, blank_is_nan: bool) -> Array:
        """Unit quaternions (n, 4); rows of NaN where all four cells are empty."""
        given = self.header.present(prefix, QUATERNION)
        missing = [f"{prefix}_{part}" for part in QUATERNION if part not in given]
        if missing:
            raise self.half_there("quaternion", missing, "all four or none")
        parts = [self.column(f"{prefix}_{p}", blank_is_nan=blank_is_nan) for p in QUATERNION]
        quat = np.stack(parts, axis=1)
        self._check_whole(prefix, np.isnan(quat))
        norm: Array = np.linalg.norm(quat, axis=1)
        self._check_norm(prefix, quat, norm)
        unit: Array = quat / norm[:, None]
        return unit

    def _check_whole(self, prefix: str, blank: Mask) -> None:
        text = "quaternion half there; expected all four cells filled or all four empty"
        for k, part in enumerate(QUATERNION):
            alone = blank[:, k] & ~np.all(blank, axis=1)
            self.refuse(alone, f"{prefix}_{part}", lambda row: text)

    def _check_norm(self, prefix: str, quat: Array, norm: Array) -> None:
        def text(row: int) -> str:
            got = " ".join(f"{value:g}" for value in quat[row])
            return (
                f"expected a unit quaternion, scalar first, got {got} with norm {norm[row]:.6g}; "
                "check the order and the columns"
            )

        self.refuse(np.abs(norm - 1.0) > _NORM_TOLERANCE, f"{prefix}_qw", text)

    def refuse(self, wrong: Mask, quantity: str, text: Callable[[int], str]) -> None:
        """Raise at the first row that is wrong (n,), if any."""
        if np.any(wrong):
            row = int(np.argmax(wrong))
            raise self.table.error(text(row), row=row, column=self.name(quantity))

    def half_there(self, what: str, missing: Sequence[str], need: str) -> InputFileError:
        """Error for a group of columns that is not complete."""
        near = near_misses(self.header)
        text = f"{what} columns half there; expected {need}, {' '.join(missing)} missing{near}"
        return self.table.error(text)
