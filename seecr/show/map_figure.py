"""The figure of a map: slices through it, with one row of panels for each quantity."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seecr.errors import InputError
from seecr.pose import Array
from seecr.show.colours import COLOURS
from seecr.show.figures import figure
from seecr.show.pose_words import on_hinges
from seecr.workspace.grid import Workspace, across_of, colour_end, directions_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colour of the edge of the workspace.
_EDGE = COLOURS[4]
# Dots of the edge at a probability: white with a rim, visible on all colours.
_LIKELY: dict[str, Any] = {
    "markersize": 4.0, "markerfacecolor": "white", "markeredgecolor": "black",
    "markeredgewidth": 0.6,
}  # fmt: skip
# Colours for poses that cannot and can be held, if margins have no numbers.
_NO, _YES = "#D9D9D9", COLOURS[0]
# Cells where the platform is free to move: no scale has this grey, nor stripes.
_FREE, _STRIPES = "#D0D0D0", "#606060"
# A grid larger than this [m] is labelled in metres.
_LARGE = 5.0
# A row of panels is as high as so wide a panel needs, and the room around it, within limits [inch].
_PANEL, _ROOM, _LOWEST, _HIGHEST = 2.4, 0.35, 1.7, 2.3
# Letters of a title that fit into an inch.
_LETTERS = 13
# A vector in such a title, which stays on one line.
_UNBROKEN = re.compile(r"\([-\d.e, ]+\)")
# Logarithmic colours end where so much of what can be held is softer, or stiffer.
_ENDS = (0.05, 0.95)
# Their ends are at least so far apart, as a ratio: otherwise they would show rounding.
_APART = 1.1
# Margins grow without limit towards the height of the exit points: their colours end at so many
# times the median.
_OUTSTANDING = 4.0


def map_figure(
    path: Path | None, found: Workspace, most: int = 4, edge: Array | None = None,
    at_least: float | None = None,
) -> Figure:  # fmt: skip
    """Slices of a workspace: margins, and in equilibrium slack cables, deviation, rotation, if the
    platform can turn, and the stiffness of the softest direction.

    Probabilities, if there are any, come second. At most ``most`` slices are drawn, normal to the
    last axis or to the one with a single value. Poses at the edge (k, 7) are dots, instead of the
    line between the poses of the grid, or beside it if they belong to a probability.

    Raises:
        InputError: a grid with fewer than two axes of more than one value.
    """
    cut = _cut(found, most, edge is None or at_least is not None)
    panels, n = _panels(found), len(cut.picked)
    wide, high = (float(np.ptp(found.axes[k])) for k in (cut.wide, cut.high))
    # of flat slices, and of the bar beside them
    height = float(np.clip(_ROOM + _PANEL * high / wide, _LOWEST, _HIGHEST))
    size = (0.9 + 2.9 * n, 0.7 + height * len(panels))
    with figure(path, len(panels), n, sharex=True, sharey=True, figsize=size) as axes:
        for row, panel in zip(axes, panels, strict=True):
            shown = _colours(cut, row, panel)
            # at the left of their places panels leave room for their labels, however wide they get
            bar = row[0].figure.colorbar(
                shown, ax=list(row), panchor=False, shrink=0.9, label=panel.label, **panel.bar
            )
            bar.minorticks_off()
            row[0].set_ylabel(f"{found.axis_names[cut.high]} [{cut.unit}]")
            if panel.elastic:
                _stripes(cut, row)
        if edge is not None:
            look = {"color": _EDGE, "markersize": 2.5} if at_least is None else _LIKELY
            places = cut.per_metre * found.along_axes(edge[:, :3])[:, [cut.wide, cut.high]]
            for column, own in zip(axes.T, cut.with_dots(edge), strict=True):
                for ax in column:
                    ax.plot(*places[own].T, ".", **look)
        for k, ax in zip(cut.picked, axes[0], strict=True):
            at = cut.per_metre * found.axes[cut.across][k]
            ax.set_title(f"{found.axis_names[cut.across]} = {at:.4g} {cut.unit}")
        for ax in axes[-1]:
            ax.set_xlabel(f"{found.axis_names[cut.wide]} [{cut.unit}]")
        words = _UNBROKEN.sub(
            lambda vector: vector[0].replace(" ", "\N{NO-BREAK SPACE}"),
            "; ".join(_words(cut, edge, at_least)),
        )
        title = [found.robot.name, *textwrap.wrap(words, int(_LETTERS * size[0]))]
        axes[0, 0].figure.suptitle("\n".join(title), fontsize=9)
    drawn: Figure = axes[0, 0].figure
    return drawn


@dataclass(frozen=True, eq=False)
class _Cut:
    """Slices of a map.

    Attributes:
        found: the map.
        across, wide, high: the axis normal to the slices, and those of their panels.
        picked: (k,) indices of the slices along the first of these.
        slices: indices of the poses of each.
        unit, per_metre: for the axes.
        outlined: whether a line is drawn between the poses that can be held and the others.
    """

    found: Workspace
    across: int
    wide: int
    high: int
    picked: NDArray[np.intp]
    slices: list[NDArray[np.intp]]
    unit: str
    per_metre: float
    outlined: bool

    @property
    def poses(self) -> NDArray[np.intp]:
        """Indices of all poses that are drawn."""
        return np.concatenate([number.ravel() for number in self.slices])

    def inside(self) -> list[Array]:
        """Margins of each slice, for the contour at zero between them.

        An infinite margin does not say where between two poses the contour is, nor does that of
        cables which hold a pose loosely, zero; both are replaced by a typical value. Where margins
        only tell yes or no, it is half way between.
        """
        found = self.found
        if _yes_or_no(found):
            sides = np.where(found.feasible, 1.0, -1.0).ravel()
            return [sides[one] for one in self.slices]
        inside = np.where(found.feasible, np.maximum(found.margin, 0.0), found.margin).ravel()
        known = np.abs(inside[np.isfinite(inside) & (inside != 0.0)])
        far = float(np.median(known)) if len(known) else 1.0
        inside = np.nan_to_num(inside, posinf=far, neginf=-far)
        if np.any(inside > 0.0):
            inside = np.where(found.feasible.ravel() & (inside == 0.0), far, inside)
        return [inside[one] for one in self.slices]

    def with_dots(self, edge: Array) -> list[NDArray[np.bool_]]:
        """Whether each pose of the edge lies in each slice, that is, between two poses of it."""
        axis = self.found.axes[self.across]
        # along axes of its own a place has rounding
        least = 1e-9 if self.found.directions is None else self.found.robot.reach
        near = 1e-9 * max(float(np.ptp(axis)), least)
        across = self.found.along_axes(edge[:, :3])[:, self.across]
        return [np.abs(across - axis[k]) <= near for k in self.picked]


def _cut(found: Workspace, most: int, outlined: bool) -> _Cut:
    """At most so many slices of a map."""
    lengths = [len(axis) for axis in found.axes]
    if sum(n > 1 for n in lengths) < 2:
        raise InputError("a figure of a map needs at least two axes with more than one value")
    across = across_of(found)
    wide, high = (k for k in range(3) if k != across)
    picked = np.unique(np.linspace(0, lengths[across] - 1, most + 2).round().astype(int)[1:-1])
    number = np.arange(found.margin.size).reshape(lengths)
    slices = [np.take(number, k, across) for k in picked]
    metres = max(float(np.ptp(axis)) for axis in found.axes) > _LARGE
    unit = ("m", 1.0) if metres else ("mm", 1e3)
    return _Cut(found, across, wide, high, picked, slices, *unit, outlined)


def _words(cut: _Cut, edge: Array | None, at_least: float | None) -> Iterator[str]:
    """What is not drawn, and the colours and dots that no colour bar explains."""
    shown, whole = len(cut.picked), len(cut.found.axes[cut.across])
    if shown < whole:
        yield f"{shown} of {whole} values of {cut.found.axis_names[cut.across]}"
    if cut.found.directions is not None:
        yield directions_words(cut.found.directions)
    yield from _white(cut)
    yield from _without_end(cut)
    if cut.found.rests.any():
        yield "arrows: what is beyond a bar's end has its last colour"
    dots = edge is not None and bool(np.any(cut.with_dots(edge)))
    if (cut.outlined and any(map(_has_edge, cut.inside()))) or (dots and at_least is None):
        yield "orange: the edge of the poses that tensions within the limits can hold"
    if dots and at_least is not None:
        yield f"white dots: the edge of the poses held with a probability of {at_least:g}"


def _white(cut: _Cut) -> Iterator[str]:
    """The meaning of cells without a colour of the scales, if there are any."""
    found, shown, why = cut.found, cut.poses, []
    if not _yes_or_no(found) and not found.feasible.ravel()[shown].all():
        why.append("cannot be held (margin)")
    if found.rests.any() and not (found.rests | found.free).ravel()[shown].all():
        why.append("does not come to rest (below it)")
    if why:
        yield "white: " + ", or ".join(why)
    if found.rests.any() and found.free.ravel()[shown].any():
        yield "grey with stripes: balanced, but free to move"


def _without_end(cut: _Cut) -> Iterator[str]:
    """The meaning of margins beyond the colour bar, if there are any."""
    margin = cut.found.margin.ravel()[cut.poses]
    if not np.isposinf(margin).any():
        return
    if _yes_or_no(cut.found):
        yield "where the platform can be held, cables can be tightened without limit"
        return
    larger = np.isfinite(margin) & (margin > _top_margin(cut.found))
    also = "a larger margin, or " if larger.any() else ""
    yield f"yellow, beyond the bar: {also}cables can be tightened without limit"


def _yes_or_no(found: Workspace) -> bool:
    """Whether margins only tell that poses can be held or not.

    Those of robots with fewer cables than degrees of freedom are 0; and all are infinite if cables
    can be tightened without limit everywhere.
    """
    held = found.margin[found.feasible]
    few = found.robot.n_driven < found.robot.n_dof
    return few or (len(held) > 0 and bool(np.isposinf(held).all()))


@dataclass(frozen=True, eq=False)
class Layer:
    """One quantity of the elastic map.

    Attributes:
        name: of its entity in a recording. title: in words. unit: "" for a count.
        values: (nx, ny, nz), NaN where the platform is not at rest. top: end of its colours.
    """

    name: str
    title: str
    unit: str
    values: Array
    top: float

    @property
    def label(self) -> str:
        """The title with the unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def elastic_layers(found: Workspace) -> tuple[Layer, ...]:
    """How many cables are slack, how far off its command the platform rests, and how turned."""
    slack = np.where(found.rests, found.slack, np.nan).astype(float)
    away = 1e3 * np.linalg.norm(found.deviation, axis=-1).astype(float)
    out = [
        Layer("slack", "slack cables", "", slack, float(found.robot.n_cables)),
        Layer("away", "off the command", "mm", away, colour_end(found, away)),
    ]
    if found.robot.turns:
        turn = np.degrees(np.linalg.norm(found.rotation, axis=-1).astype(float))
        out.append(Layer("turn", "turned", "°", turn, colour_end(found, turn)))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class _Panel:
    """A quantity with its colours.

    Attributes:
        label: of its colour bar. values: (nx, ny, nz), NaN for no colour.
        how: the colours, as ``pcolormesh`` takes them. bar: options of the colour bar.
        elastic: whether it is of the elastic map.
    """

    label: str
    values: Array
    how: Mapping[str, Any]
    bar: Mapping[str, Any]
    elastic: bool = True


def _panels(found: Workspace) -> list[_Panel]:
    """What can be held and with which probability; then where the platform comes to rest."""
    panels = [_held(found)]
    if found.chance is not None:
        how = {"vmin": 0.0, "vmax": 1.0, "cmap": "cividis"}
        panels.append(_Panel("probability", found.chance.astype(float), how, {}, False))
    if np.any(found.rests):
        panels += [*map(_elastic, elastic_layers(found)), _softest(found)]
    return panels


def _held(found: Workspace) -> _Panel:
    """The margin where poses can be held; or only whether they can."""
    if _yes_or_no(found):
        from matplotlib.colors import ListedColormap
        from matplotlib.ticker import FuncFormatter

        said = FuncFormatter(lambda value, _: "yes" if value > 0.5 else "no")
        how = {"vmin": -0.5, "vmax": 1.5, "cmap": ListedColormap([_NO, _YES])}
        bar = {"ticks": [0, 1], "format": said}
        return _Panel("can be held", found.feasible.astype(float), how, bar, False)
    top = _top_margin(found)
    # cells with NaN have no colour
    margin = np.where(np.isposinf(found.margin), 2.0 * top, found.margin)
    held = np.where(found.feasible, margin, np.nan)
    how = {"vmin": 0.0, "vmax": top}
    return _Panel("tension margin [N]", held, how, {"extend": "max"}, False)


def _elastic(layer: Layer) -> _Panel:
    """A quantity from 0 on: in shades, or in steps if it is a count."""
    if layer.unit:
        how: dict[str, Any] = {"vmin": 0.0, "vmax": layer.top}
        return _Panel(layer.label, layer.values, how, {"extend": "max"})
    import matplotlib

    steps = np.arange(layer.top + 1.0)
    shades = matplotlib.colormaps["viridis"].resampled(len(steps))
    how = {"vmin": -0.5, "vmax": layer.top + 0.5, "cmap": shades}
    return _Panel(layer.label, layer.values, how, {"ticks": steps.astype(int)})


def _softest(found: Workspace) -> _Panel:
    """The smallest stiffness, on a logarithmic scale: towards the edge it falls by decades.

    It is in N/m, on hinges alone in N m/rad (:func:`seecr.show.pose_words.stiffness_words`).
    """
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter

    stiffness = np.where(found.rests & (found.stiffness > 0.0), found.stiffness, np.nan)
    unit = "N/m"
    if on_hinges(found.robot):
        stiffness = stiffness / np.sum(np.asarray(found.softest)[..., 3:] ** 2, axis=-1)
        unit = "N m/rad"
    ends = _soft_ends(stiffness, found.feasible)
    numbers = FuncFormatter(lambda value, _: f"{value:.12g}")
    bar = {"extend": "both", "ticks": _ticks(*ends), "format": numbers}
    label = f"stiffness of the\nsoftest direction [{unit}]"
    return _Panel(label, stiffness.astype(float), {"norm": LogNorm(*ends)}, bar)


def _top_margin(found: Workspace) -> float:
    """Upper end of the colour bar of margins."""
    held = found.margin[found.feasible]
    finite = held[np.isfinite(held)]
    if len(finite) == 0:
        return 1.0
    top = float(np.quantile(finite, 0.95)) or 1.0
    return min(top, _OUTSTANDING * float(np.median(finite))) or 1.0


def _soft_ends(stiffness: Array, held: NDArray[np.bool_]) -> tuple[float, float]:
    """Ends of the colours of a stiffness, from poses that can be held, if there are any."""
    for some in (stiffness[held], stiffness):
        known = some[np.isfinite(some)]
        if len(known):
            low, high = (float(np.quantile(known, part)) for part in _ENDS)
            wider = max(1.0, np.sqrt(_APART * low / high))
            return low / wider, high * wider
    return 1.0, 10.0


def _ticks(low: float, high: float) -> Array:
    """Round numbers between the ends of a logarithmic scale."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    decades = np.log10(high / low)
    some = (
        MaxNLocator(5) if decades < 1.0
        else LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.0 else (1.0,))
    )  # fmt: skip
    ticks = np.asarray(some.tick_values(low, high))
    return ticks[(ticks >= low) & (ticks <= high)]


def _colours(cut: _Cut, row: Any, panel: _Panel) -> Any:
    """Coloured cells of each slice, with the edge of the workspace on top."""
    x, y = (cut.per_metre * cut.found.axes[k] for k in (cut.wide, cut.high))
    shown = None
    for ax, one, inside in zip(row, cut.slices, cut.inside(), strict=True):
        shown = ax.pcolormesh(
            x, y, panel.values.ravel()[one].T, **panel.how, shading="nearest",
            rasterized=True,  # otherwise lines show between the cells of an SVG
        )  # fmt: skip
        if cut.outlined and _has_edge(inside):
            ax.contour(x, y, inside.T, levels=[0.0], colors=_EDGE, linewidths=1.2)
        ax.set_aspect("equal", anchor="W")
        ax.grid(False)
    return shown


def _stripes(cut: _Cut, row: Any) -> None:
    """Grey cells with stripes where the platform is free to move."""
    import matplotlib
    from matplotlib.colors import ListedColormap

    x, y = (cut.per_metre * cut.found.axes[k] for k in (cut.wide, cut.high))
    free = np.where(cut.found.free, 1.0, np.nan).ravel()
    for ax, one in zip(row, cut.slices, strict=True):
        if np.isfinite(free[one]).any():
            with matplotlib.rc_context({"hatch.color": _STRIPES}):
                ax.pcolor(
                    x, y, free[one].T, cmap=ListedColormap([_FREE]), shading="nearest",
                    hatch="/////", rasterized=True, zorder=0.5,
                )  # fmt: skip


def _has_edge(inside: Array) -> bool:
    """Whether a slice has poses on both sides of the edge."""
    return bool(inside.min() < 0.0 < inside.max())
