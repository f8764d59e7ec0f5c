"""Known loads: what the platform carried in each row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.errors import InputError
from seecr.pose import LARGEST, Array, all_finite


@dataclass(frozen=True, eq=False)
class Loads:
    """Known payloads and external wrenches of n rows, such as weights hung on the platform.

    A payload's weight follows the model's gravity. It is attached before the way to its row begins.

    Attributes:
        mass: (n,) [kg] of the payload.
        centre: (n, 3) [m] of the payload, in the platform's frame; NaN if it is the platform's own
            centre of mass, including any effect on that.
        wrench: (n, 6) [N, N m] force at the platform's origin and moment, base frame.
    """

    mass: Array
    centre: Array
    wrench: Array

    @classmethod
    def of(
        cls,
        n: int,
        mass: Array | None = None,
        centre: Array | None = None,
        wrench: Array | None = None,
    ) -> Loads:
        """Loads of n rows; one number or vector applies to all rows, None means no load.

        Raises:
            InputError: a shape that does not fit n rows, or numbers that are not finite.
        """
        return cls(
            _filled("payload mass", mass, 0.0, (n,)),
            _filled("payload centre", centre, np.nan, (n, 3)),
            _filled("wrench", wrench, 0.0, (n, 6)),
        )

    def __len__(self) -> int:
        return len(self.mass)

    def rows(self, index: NDArray[np.integer]) -> Loads:
        """The loads of some rows."""
        return Loads(self.mass[index], self.centre[index], self.wrench[index])

    def followed_by(self, other: Loads) -> Loads:
        """These rows, then those of another."""
        return Loads(
            *(
                np.concatenate([getattr(self, name), getattr(other, name)])
                for name in ("mass", "centre", "wrench")
            )
        )

    @property
    def kinds(self) -> NDArray[np.int64]:
        """(n,) number of each row's load among the different loads."""
        loaded = self.mass[:, None] != 0.0
        # NaN (the platform's own centre) equals NaN, and the centre does not matter without a
        # payload
        own = np.isnan(self.centre) & loaded
        centre = np.where(loaded & ~own, self.centre, 0.0)
        table = np.concatenate([self.mass[:, None], own, centre, self.wrench], axis=1)
        return np.asarray(np.unique(table, axis=0, return_inverse=True)[1].reshape(-1))

    @property
    def changes(self) -> NDArray[np.bool_]:
        """(n,) rows with another load than the row before."""
        return np.concatenate([[False], np.diff(self.kinds) != 0])


def _filled(name: str, value: Array | None, otherwise: float, shape: tuple[int, ...]) -> Array:
    given = np.asarray(otherwise if value is None else value, float)
    try:
        out = np.array(np.broadcast_to(given, shape))
    except ValueError:
        raise InputError(f"{name} must be {shape}, got {given.shape}") from None
    if not all_finite(out[~np.isnan(out)]) or (otherwise == 0.0 and np.isnan(out).any()):
        raise InputError(f"{name} must be finite numbers, none beyond {LARGEST:g}, got {given}")
    return out
