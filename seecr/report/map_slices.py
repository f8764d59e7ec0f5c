"""The figure of a map: slices through it, one row of panels for each thing that it knows."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.errors import InputError
from seecr.pose import Array
from seecr.report.drawing import COLOURS, figure
from seecr.workspace.grid import Workspace

__all__ = ["map_figure"]

# Of the edge of what can be held.
_EDGE = COLOURS[4]
# A grid of more than this [m] is told in metres.
_LARGE = 5.0
# Letters of a title that fit into an inch.
_LETTERS = 13
# Margins grow without end towards the height of the exit points: so many times what half of the
# poses have is the end of their colours.
_OUTSTANDING = 4.0
# What is moved or turned by less [mm, deg] is not: colours up to there would show rounding.
_STILL = 1e-6


def map_figure(path: Path, found: Workspace, most: int = 4, edge: Array | None = None) -> None:
    """Slices of a workspace: what can be held, slack cables, deviation and tilt at rest.

    Where the map has probabilities, they come second.

    Args:
        path: the file.
        found: the workspace, with two or three axes of more than one value.
        most: slices drawn; they lie across the last axis, or that with one value. The title says
            of how many.
        edge: (k, 7) poses at the edge of what can be held; those in a slice are dots on it.

    Raises:
        InputError: a grid that goes along fewer than two axes.
    """
    lengths = [len(axis) for axis in found.axes]
    if sum(n > 1 for n in lengths) < 2:
        raise InputError("a figure of a map needs at least two axes with more than one value")
    across = 2 if min(lengths) > 1 else int(np.argmin(lengths))
    wide, high = (k for k in range(3) if k != across)
    picked = np.unique(np.linspace(0, lengths[across] - 1, most + 2).round().astype(int)[1:-1])
    panels = [_held_panel]
    if found.chance is not None:
        panels.append(_chance_panel)
    if np.any(found.rests):
        panels += [_slack_panel, _away_panel, _turn_panel]
    size = (0.9 + 2.9 * len(picked), 0.5 + 2.3 * len(panels))
    metres = max(float(np.ptp(axis)) for axis in found.axes) > _LARGE
    unit, per_metre = ("m", 1.0) if metres else ("mm", 1e3)
    extents = per_metre * found.axes[wide], per_metre * found.axes[high]
    with figure(path, len(panels), len(picked), sharex=True, sharey=True, figsize=size) as axes:
        number = np.arange(found.margin.size).reshape(lengths)
        slices = [np.take(number, k, across) for k in picked]
        for row, panel in zip(axes, panels, strict=True):
            shown = panel(found, row, *extents, slices)
            row[0].figure.colorbar(shown, ax=list(row), **_bar_of(panel, found))
            row[0].set_ylabel(f"{'xyz'[high]} [{unit}]")
        if edge is not None:
            _dots(axes, per_metre * edge[:, [wide, high]], _in_slices(found, edge, across, picked))
        for k, ax in zip(picked, axes[0], strict=True):
            ax.set_title(f"{'xyz'[across]} = {per_metre * found.axes[across][k]:.4g} {unit}")
        for ax in axes[-1]:
            ax.set_xlabel(f"{'xyz'[wide]} [{unit}]")
        words = [*_left_out(found, across, len(picked)), *_white(found, slices)]
        drawn = any(_has_edge(inside) for inside in _inside(found, slices))
        if drawn or (edge is not None and len(edge)):
            words.append("orange: the edge of what tensions within the limits can hold")
        if words:
            title = textwrap.fill("; ".join(words), int(_LETTERS * size[0]))
            axes[0, 0].figure.suptitle(title, fontsize=9)


def _left_out(found: Workspace, across: int, shown: int) -> list[str]:
    """How many slices there are, where not all of them are drawn."""
    whole = len(found.axes[across])
    return [f"{shown} of {whole} values of {'xyz'[across]}"] if shown < whole else []


def _white(found: Workspace, slices: Slices) -> list[str]:
    """What cells without a colour are, where there are any."""
    one = np.concatenate([number.ravel() for number in slices])
    why = [] if found.feasible.ravel()[one].all() else ["cannot be held (margin)"]
    if found.rests.any() and not found.rests.ravel()[one].all():
        why.append("does not come to rest (below it)")
    return ["white: " + ", or ".join(why)] if why else []


def _in_slices(found: Workspace, edge: Array, across: int, picked: Any) -> list[Any]:
    """Which of the edge's poses lie in each of some slices: those between two poses of it."""
    axis = found.axes[across]
    near = 1e-9 * max(float(np.ptp(axis)), 1e-9)
    return [np.abs(edge[:, across] - axis[k]) <= near for k in picked]


def _dots(axes: Any, places: Array, slices: list[Any]) -> None:
    """The edge's places (k, 2) on every panel of their slice."""
    for row in axes:
        for ax, own in zip(row, slices, strict=True):
            ax.plot(*places[own].T, ".", color=_EDGE, markersize=2.5)


Slices = list[NDArray[np.intp]]


def _bar_of(panel: Any, found: Workspace) -> dict[str, Any]:
    words = {
        _held_panel: "tension margin [N]", _chance_panel: "probability",
        _slack_panel: "slack cables",
        _away_panel: "off its command [mm]", _turn_panel: "turned [°]",
    }  # fmt: skip
    more: dict[str, Any] = {"extend": "max"}
    if panel is _chance_panel:
        more = {}
    elif panel is _slack_panel:
        more = {"ticks": np.arange(found.robot.n_cables + 1)}
    return {"label": words[panel], "shrink": 0.9, **more}


def _held_panel(found: Workspace, row: Any, x: Array, y: Array, slices: Slices) -> Any:
    """The margin where poses can be held, with the workspace's boundary."""
    flat = np.where(found.feasible, found.margin, np.nan).ravel()
    finite = flat[np.isfinite(flat)]
    half = float(np.median(finite)) if len(finite) else 0.0
    top = min(_top(finite), _OUTSTANDING * half) or 1.0
    return _colours(row, x, y, [flat[k] for k in slices], 0.0, top, None, found, slices)


def _chance_panel(found: Workspace, row: Any, x: Array, y: Array, slices: Slices) -> Any:
    """The probability that a pose can be held, with the boundary of the model's own values."""
    assert found.chance is not None
    chance = found.chance.ravel().astype(float)
    return _colours(row, x, y, [chance[k] for k in slices], 0.0, 1.0, "cividis", found, slices)


def _slack_panel(found: Workspace, row: Any, x: Array, y: Array, slices: Slices) -> Any:
    import matplotlib

    count = np.where(found.rests, found.slack, np.nan).ravel()
    m = found.robot.n_cables
    steps = matplotlib.colormaps["viridis"].resampled(m + 1)
    return _colours(row, x, y, [count[k] for k in slices], -0.5, m + 0.5, steps, found, slices)


def _away_panel(found: Workspace, row: Any, x: Array, y: Array, slices: Slices) -> Any:
    away = 1e3 * np.linalg.norm(found.deviation, axis=-1).ravel()
    top = _end(found, away)
    return _colours(row, x, y, [away[k] for k in slices], 0.0, top, None, found, slices)


def _turn_panel(found: Workspace, row: Any, x: Array, y: Array, slices: Slices) -> Any:
    turn = np.degrees(np.linalg.norm(found.rotation, axis=-1)).ravel()
    top = _end(found, turn)
    return _colours(row, x, y, [turn[k] for k in slices], 0.0, top, None, found, slices)


def _end(found: Workspace, values: Array) -> float:
    """Where colours of how far off it rests end: at what poses have that can be held.

    Poses outside of the workspace fall by a hundred times that, and all others would be of one
    colour.
    """
    for some in (values[found.feasible.ravel()], values):
        known = some[np.isfinite(some)]
        if len(known) and (top := float(np.quantile(known, 0.95))) > _STILL:
            return top
    return 1.0


def _top(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, 0.95)) or 1.0 if len(known) else 1.0


def _colours(
    row: Any, x: Array, y: Array, values: list[Array], low: float, high: float,
    colours: Any = None, found: Workspace | None = None, slices: Slices | None = None,
) -> Any:  # fmt: skip
    """Coloured cells of each slice; with the workspace's boundary over them where it is given."""
    shown = None
    inside = [] if found is None or slices is None else _inside(found, slices)
    for k, (ax, value) in enumerate(zip(row, values, strict=True)):
        shown = ax.pcolormesh(
            x, y, value.T, vmin=low, vmax=high, cmap=colours, shading="nearest",
            rasterized=True,  # else lines show between the cells of an SVG
        )  # fmt: skip
        if inside and _has_edge(inside[k]):
            ax.contour(x, y, inside[k].T, levels=[0.0], colors=_EDGE, linewidths=1.2)
        ax.set_aspect("equal")
        ax.grid(False)
    return shown


def _inside(found: Workspace, slices: Slices) -> list[Array]:
    """Margins of each slice, as far as a line at zero between them takes them."""
    inside = np.where(found.feasible, np.maximum(found.margin, 0.0), found.margin)
    return [np.clip(inside.ravel()[one], -1e3, 1e3) for one in slices]


def _has_edge(inside: Array) -> bool:
    """Whether margins of a slice have an edge between them: of robots with few cables none has."""
    return bool(inside.min() < 0.0 < inside.max())
