"""Measurements as the columns of a file, by name and in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Loads
from seecr.pose import Array
from seecr.result import COORDINATES

if TYPE_CHECKING:
    from crosscheck.measurements.data import Measurements


def named_columns(data: Measurements) -> Iterator[tuple[str, list[Any]]]:
    """Names and values (n,) of all columns with content; None if not read."""
    yield "run", data.run.tolist()
    cables = range(1, data.n_cables + 1)
    yield from _columns(["t_s"], data.t_s)
    yield from _columns([f"cmd_{c}" for c in COORDINATES], data.command_pose)
    yield from _columns([f"length_{i}_m" for i in cables], data.command_lengths)
    if data.wanted is not None:
        stated = np.asarray(np.isfinite(data.wanted).any(axis=0))
        yield from _columns([f"want_{c}" for c in COORDINATES], data.wanted, stated)
    yield from _columns([f"meas_{c}_m" for c in "xyz"], data.position, data.position_mask)
    yield from _columns([f"meas_q{c}" for c in "wxyz"], data.quat_wxyz)
    yield from _columns([f"meas_r{c}_rad" for c in "xyz"], data.angles_rad, data.angle_mask)
    yield from _columns([f"tension_{i}_N" for i in cables], data.tensions, data.tension_mask)
    yield from _columns(["temperature_C"], data.temperature_C)
    if data.loads is not None:
        yield from _load_columns(data.loads)


def _load_columns(loads: Loads) -> Iterator[tuple[str, list[Any]]]:
    """The columns of payload and wrench with content."""
    if np.any(loads.mass):
        yield from _columns(["payload_kg"], loads.mass)
        if np.isfinite(loads.centre).any():
            yield from _columns([f"payload_{c}_m" for c in "xyz"], loads.centre)
    wrench = [*(f"force_{c}_N" for c in "xyz"), *(f"moment_{c}_Nm" for c in "xyz")]
    acts = np.array([bool(column.any()) for column in loads.wrench.T])
    yield from _columns(wrench, loads.wrench, acts)


def _columns(
    names: list[str], values: Array | None, mask: NDArray[np.bool_] | None = None
) -> Iterator[tuple[str, list[Any]]]:
    """Columns (n,) or (n, k) with their names, without those that the mask (k,) excludes."""
    if values is None:
        return
    for k, name in enumerate(names):
        if mask is None or mask[k]:
            column = values if values.ndim == 1 else values[:, k]
            yield name, [None if v != v else v for v in column.tolist()]
