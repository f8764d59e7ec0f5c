"""Colours of figures, pages and recordings, and curves that coincide, which are drawn once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array

Rgba = tuple[int, int, int, int]
Colours = NDArray[np.uint8]

# Okabe and Ito (2008), "Color Universal Design", whose colours can be told apart with every common
# kind of colour blindness; black is left out, as the viewer's plots are dark.
SKY, ORANGE = (86, 180, 233, 255), (230, 159, 0, 255)
GREEN, YELLOW = (0, 158, 115, 255), (240, 228, 66, 255)
BLUE, VERMILION = (50, 120, 200, 255), (213, 94, 0, 255)
PINK, SILVER = (204, 121, 167, 255), (190, 190, 190, 255)
SERIES: tuple[Rgba, ...] = (SKY, ORANGE, GREEN, YELLOW, PINK, VERMILION, BLUE, SILVER)

# The same on white paper; brown for their yellow, which is faint there.
COLOURS = (
    "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#000000", "#8B5A2B",
)  # fmt: skip
AFTER, BEFORE, TINT = COLOURS[0], COLOURS[4], "#EFA06B"
CALM = "#6f7f8f"
"""Of the model as it stands where nothing is missing: no colour of alarm."""

INK, GREY, FAINT, NOISE = "#1d2329", "#6b747d", "#e7eaed", "#d9dee3"

COMMAND: Rgba = (225, 225, 225, 255)
SEECR: Rgba = (60, 140, 225, 255)
MUJOCO: Rgba = (255, 150, 30, 255)
FRAME: Rgba = (120, 126, 134, 255)
SLACK: Rgba = (165, 165, 165, 255)

# Viridis (van der Walt and Smith, 2015) at 0.25, 0.35 ... 0.95, 1: even steps of lightness, so that
# it also works in grey. Its darkest quarter is left out on a dark background.
_VIRIDIS = np.array([
    [59, 82, 139], [46, 109, 142], [37, 132, 142], [30, 155, 138], [45, 178, 125],
    [86, 198, 103], [136, 213, 72], [195, 223, 35], [253, 231, 37],
], dtype=float)  # fmt: skip


def scale_colours(values: Array, top: float) -> Colours:
    """Colours (..., 4) of values (...) on the scale from 0 to ``top``."""
    part = np.clip(np.asarray(values, float) / top, 0.0, 1.0) * (len(_VIRIDIS) - 1)
    grid = np.arange(len(_VIRIDIS))
    channels = [np.interp(part, grid, _VIRIDIS[:, c]) for c in range(3)]
    opaque = np.full(part.shape, 255.0)
    return np.stack([*channels, opaque], axis=-1).round().astype(np.uint8)


def cable_colours(count: int) -> list[Rgba]:
    """One colour per cable, from Okabe and Ito for up to eight cables."""
    if count <= len(SERIES):
        return list(SERIES[:count])
    scale = scale_colours(np.arange(count, dtype=float), max(count - 1.0, 1.0))
    return [(red, green, blue, alpha) for red, green, blue, alpha in scale.tolist()]


def round_up(value: float) -> float:
    """The next number 1, 1.5, 2, 3, 4, 5, 6 or 8 times a power of ten: the top of a scale."""
    if not value > 0.0 or not np.isfinite(value):
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    steps = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
    return float(power * next(s for s in steps if s * power >= value * (1.0 - 1e-12)))


# Curves closer to each other than this part of the largest value coincide.
_ALIKE = 1e-6


def alike(curves: Sequence[Array]) -> list[list[int]]:
    """Groups of indices of curves that coincide on all timelines.

    Args:
        curves: (n, k) for each timeline.
    """
    whole = np.concatenate([np.asarray(values, float) for values in curves])
    near = _ALIKE * float(np.nanmax(np.abs(whole), initial=0.0))
    groups: list[list[int]] = []
    for k in range(whole.shape[1]):
        for group in groups:
            if np.allclose(whole[:, group[0]], whole[:, k], 0.0, near, equal_nan=True):
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def joined(names: Sequence[str]) -> str:
    """Several names as one, with a common beginning only once, as in "cable1, 2"."""
    first, *others = names
    stem = first.rstrip("0123456789")
    same = stem and all(
        name.startswith(stem) and name[len(stem) :].isdigit() for name in (first, *others)
    )
    return ", ".join([first, *(name[len(stem) :] if same else name for name in others)])
