"""How well poses repeat that the robot was sent to several times: more than dwells can show.

An error that stays the same for a whole dwell, such as a tracker's in its volume or a platform that
sticks, is in no scatter within dwells. What repeats at one place in every visit is in neither.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.importing.dwells import about_mean
from crosscheck.measurements.data import Measurements, Sigma
from seecr.counted import counted
from seecr.pose import Array

# From so many further visits on the size is known to a factor of 1.4, as a stated one is: that of
# three coordinates has a relative error of 1 / sqrt(6 n), twice which is 0.4.
_LEAST_VISITS = 4
_DIGITS = 3


def repeated(data: Measurements, scatter: Sigma) -> tuple[Sigma, str, str]:
    """The noise that revisited poses show, if enough were, or else that of dwells.

    Visits are compared that have one command and load, and came from one command before: what
    depends on the way there, such as backlash, is no noise.

    Args:
        data: a row for each dwell. scatter: the noise of their means, from within dwells.

    Returns:
        the noise to state, the larger one of each kind; where it comes from; and a sentence.
    """
    visits = [rows for rows in _visits(data) if len(rows) > 1]
    quat = data.quat_wxyz
    kinds = {
        "position_m": [_off(data.position[rows]) for rows in visits],
        "orientation_rad": [] if quat is None else [about_mean(quat[rows])[1] for rows in visits],
        "tension_N": [_off(data.tensions[rows]) for rows in visits],
    }
    further = sum(len(rows) - 1 for rows in visits)
    sizes = {kind: _pooled(some, visits) for kind, some in kinds.items()}
    if further < _LEAST_VISITS or not sizes["position_m"]:
        said = "no pose was revisited often enough to tell how well poses repeat"
        return scatter, "dwell_scatter", f"{said}: the true noise may be larger"
    own = vars(scatter)
    stated = {kind: max(size, own[kind] or 0.0) for kind, size in sizes.items() if size}
    said = f"revisited poses ({counted(further, 'further visit')}) repeat to "
    said += f"{1e3 * float(sizes['position_m']):.2g} mm"
    if sizes["orientation_rad"]:
        said += f" and {np.degrees(sizes['orientation_rad']):.2g} deg"
    return replace(scatter, **stated), "revisited", f"{said}: the larger is stated as the noise"


def _visits(data: Measurements) -> list[list[int]]:
    """Rows that were read with one command and load, after the same command; runs begin at rest."""
    told = data.command_pose if data.command_lengths is None else data.command_lengths
    assert told is not None
    load = np.zeros((data.n_rows, 1)) if data.loads is None else data.loads.mass[:, None]
    keys = np.concatenate([told, load], axis=1).round(9)
    same_run = np.concatenate([[False], data.run[1:] == data.run[:-1]])
    before = np.where(same_run[:, None], np.roll(keys, 1, axis=0), np.inf)
    groups: dict[bytes, list[int]] = {}
    whole = np.isfinite(data.position).all(axis=1)
    for row in np.flatnonzero(whole).tolist():
        groups.setdefault(keys[row].tobytes() + before[row].tobytes(), []).append(row)
    return list(groups.values())


def _off(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=0))


def _pooled(off: list[Array], visits: list[list[int]]) -> float | None:
    """The rms of what visits are off their means, in each part that was read; None of nothing."""
    squares = sum(float(np.nansum(one**2)) for one in off)
    count = sum(
        (len(rows) - 1) * int(np.isfinite(one).all(axis=0).sum())
        for one, rows in zip(off, visits, strict=False)
    )
    return float(f"{np.sqrt(squares / count):.{_DIGITS}g}") if squares > 0.0 else None
