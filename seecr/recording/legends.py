"""Legends that cover no curve: the viewer puts a legend into a corner of the plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb

from seecr.pose import Array

# Size of the viewer's legend, in points of a window of 1920 by 1080: height of a name and of the
# margins, width of a letter and of the rest beside a name.
_NAME, _AROUND, _LETTER, _ASIDE = 23.0, 8.0, 6.0, 42.0
# An axis is extended by no more than this factor for a legend: curves would become flat.
_LONGER = 2.0
# Part of the axis that the viewer leaves free at both ends.
_MARGIN = 0.04
_CORNERS = (
    rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop, rrb.Corner2D.RightBottom, rrb.Corner2D.LeftBottom,
)  # fmt: skip


@dataclass(frozen=True)
class Legend:
    """The place of a legend.

    Attributes:
        corner: of the plot. values: the range of the axis, None for the viewer's choice.
        fits: whether it covers nothing.
    """

    corner: rrb.Corner2D = rrb.Corner2D.RightTop
    values: tuple[float, float] | None = None
    fits: bool = True


def legend_of(curves: Sequence[Array], names: Sequence[str], size: tuple[float, float]) -> Legend:
    """The corner in which a legend covers no curve, with a longer axis if necessary.

    Args:
        curves: (n, k) for each timeline, at times that are roughly evenly spaced.
        names: in the legend. size: of the plot, in points of a window of 1920 by 1080.
    """
    known = [values for values in curves if np.isfinite(values).any()]
    if not known or not names:
        return Legend()
    low = min(float(np.nanmin(values)) for values in known)
    high = max(float(np.nanmax(values)) for values in known)
    wide = min((_LETTER * max(map(len, names)) + _ASIDE) / size[0], 1.0)
    tall = min((_NAME * len(names) + _AROUND) / size[1], 0.95)
    span = max(high - low, 1e-12)
    best, taken = _CORNERS[0], np.inf
    for corner in _CORNERS:
        left = corner in (rrb.Corner2D.LeftTop, rrb.Corner2D.LeftBottom)
        top = corner in (rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop)
        reach = max(_reach(values, low, high, wide, left=left, top=top) for values in known)
        # the legend takes the part ``tall`` of an axis of this length
        longer = max(reach / (1.0 - tall), span) / span
        if longer < taken:
            best, taken = corner, longer
    if taken <= 1.0 + _MARGIN and len(known) == 1:
        return Legend(best)
    if taken > _LONGER:
        return Legend(best, fits=False)
    more, edge = (taken - 1.0) * span, _MARGIN * span
    if best in (rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop):
        return Legend(best, (low - edge, high + more + edge))
    return Legend(best, (low - more - edge, high + edge))


def _reach(values: Array, low: float, high: float, wide: float, *, left: bool, top: bool) -> float:
    """How far curves extend towards a corner, from the other end of the axis."""
    count = int(np.ceil(wide * (len(values) - 1))) + 1
    near = values[:count] if left else values[-count:]
    near = near[np.isfinite(near)]
    if len(near) == 0:
        return 0.0
    return float(near.max()) - low if top else high - float(near.min())
