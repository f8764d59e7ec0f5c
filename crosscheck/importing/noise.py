"""The noise of imported poses: within dwells, and between visits, which show more.

An error that stays the same for a whole dwell, such as a tracker's in its volume or a platform that
sticks, is in no scatter within dwells. What repeats at one place in every visit is in neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.importing.dwells import about_mean
from crosscheck.importing.take import Take
from crosscheck.measurements.data import LEAST, Measurements, Sigma
from seecr.counted import counted
from seecr.pose import Array

# From so many further visits on the size is known to a factor of 1.4, as a stated one is: that of
# three coordinates has a relative error of 1 / sqrt(6 n), twice which is 0.4.
_LEAST_VISITS = 4
_WRITTEN = 3

# Samples that scatter by less than this part of the least change between them show the last digit
# written and no noise. From q / 2 on, the mean of numbers rounded to q is off by 0.002 q at most:
# q exp(-2 (pi / 2)^2) / pi, the first term of the Fourier series of the rounding error.
_DIGITS = 0.5


def noise_of_dwells(takes: Sequence[Take], tensions: Sequence[Array]) -> Sigma:
    """The noise of means, over all dwells; None if the rounding in the files hides it."""

    def pooled(values: Array) -> float | None:
        rms = _rms(values)
        return float(f"{rms:.3g}") if rms > LEAST else None

    def of_means(unit: str) -> float | None:
        error, scatter, step = (
            np.concatenate([getattr(t.dwells, f"{what}_{unit}")[t.used] for t in takes])
            for what in ("error", "scatter", "step")
        )
        hidden = _rms(scatter) < _DIGITS * np.min(step, initial=np.inf)
        return None if hidden else pooled(error)

    pulls = np.concatenate([noise[noise > 0.0] for noise in tensions])
    return Sigma(of_means("m"), of_means("rad"), pooled(pulls))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def noise_words(measured: Measurements) -> str:
    """How large the noise of means is, and of which kind it is not stated."""
    sigma, parts = measured.sigma, []
    if sigma.position_m:
        parts.append(f"position {1e3 * sigma.position_m:.2g} mm")
    if sigma.orientation_rad:
        parts.append(f"orientation {np.degrees(sigma.orientation_rad):.2g} deg")
    if sigma.tension_N:
        parts.append(f"tension {sigma.tension_N:.2g} N")
    out = (
        "noise of the means, estimated from the means of parts of each dwell: "
        f"{', '.join(parts) or 'none'}"
    )
    hidden = ["position"] * (sigma.position_m is None)
    hidden += ["orientation"] * (sigma.orientation_rad is None and measured.quat_wxyz is not None)
    if not hidden:
        return out
    return (
        f"{out}; {' and '.join(hidden)} not stated: within a dwell only the last digit changes, if "
        "any, which shows no noise; other commands estimate it"
    )


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
    return float(f"{np.sqrt(squares / count):.{_WRITTEN}g}") if squares > 0.0 else None
