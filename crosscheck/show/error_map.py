"""The map of where the model fails, before and after, with the same scale."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from crosscheck.fit.problem import POSITION, Kind, Problem, kinds_read
from crosscheck.show.arrows import Drawn, drawn, magnification, views_of
from crosscheck.show.figures import MANY, blank, grid, image, styled
from seecr.counted import counted
from seecr.pose import Array
from seecr.show.colours import GREY, INK

# Colours end at this percentile of the errors.
_LARGEST = 98.0
_MOST_HEIGHT = 3.4
# More arrows than this hide each other.
_MOST_ARROWS = 250
# Viridis without its bright half: dots of small errors stand out from white by 3 to 1, and from
# the dark page, on which figures are inverted.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.42, 1.0, 128)))

# What is left empty at the edges [in].
_EDGE = 0.08
# A title of more letters than these does not fit above a panel: the effects are counted instead.
_LONGEST = 48


def failure_map(problem: Problem, before: Drawn, after: Drawn) -> str:
    """Arrows of the position error and dots of the orientation error at each measured pose."""
    shown = _Map(problem, [before] if after is before else [before, after])
    views = views_of(shown.place)
    alone = len(shown.stages) == 1
    # a model alone has its views side by side, two have them one below the other
    across = len(views) if alone else len(shown.stages)
    with styled():
        heights = [_height(shown.place, view, across) for view in views]
        rows = [max(heights)] if alone else heights
        figure = blank(sum(rows) + 0.62 * len(rows) + 0.35)
        panels = figure.subplots(
            len(rows), across, squeeze=False, gridspec_kw={"height_ratios": rows}
        )
        bar = _draw(figure, panels.T if alone else panels, shown, views)
        if bar is not None:
            _move_beside(figure, bar, panels.ravel().tolist())
            _crop(figure)
        return image(figure, "Where the model fails" + (", before and after" * (not alone)))


@dataclass(frozen=True, eq=False)
class _Map:
    """What all panels have in common: the data, and the models that are compared with them."""

    problem: Problem
    stages: list[Drawn]

    @cached_property
    def place(self) -> Array:
        """(k, 3) [m] where the rows that count are drawn."""
        return self.stages[0].state.prediction.pose[self.problem.use, :3]

    @cached_property
    def magnify(self) -> float:
        """Factor on the length of arrows; 0 for none."""
        return magnification(self.problem, self.stages[0].state)

    @cached_property
    def kind(self) -> Kind | None:
        """What the dots show: the orientation, or else the tensions."""
        read = [kind for kind in kinds_read(self.problem) if kind.name != "position"]
        return read[0] if read else None

    def sizes(self, stage: Drawn, kind: Kind) -> Array:
        """(k,) errors of one kind, in its unit for people."""
        return (kind.sizes(self.problem, stage.state.raw) * kind.factor)[self.problem.use]

    def top(self, kind: Kind) -> float:
        """End of the colours."""
        sizes = self.sizes(self.stages[0], kind)
        return max(float(np.nanpercentile(sizes, _LARGEST)), 1e-12)


def _height(place: Array, view: tuple[int, int], columns: int) -> float:
    """Of a panel [in] whose two axes have the same scale."""
    span = np.ptp(place, axis=0)
    if not span.any():  # one pose, or all alike
        span = np.ones(3)
    wide, high = (max(float(span[k]), 0.15 * float(span.max())) for k in view)
    return float(np.clip(8.6 / columns * (high + 0.3 * wide) / (1.3 * wide), 1.1, _MOST_HEIGHT))


def _draw(figure: Figure, panels: Any, shown: _Map, views: list[tuple[int, int]]) -> Axes | None:
    """Draw the panels; the colour bar's axes, if there is one."""
    dots = None
    for column, stage in enumerate(shown.stages):
        for axes, view in zip(panels[:, column], views, strict=True):
            dots = _dots(axes, shown, stage, view) or dots
            if shown.magnify:
                _arrows(axes, shown, stage, view)
            _frame(axes, shown.place, view)
        panels[0, column].set_title(_title(shown, column), loc="left", color=INK)
    kind = shown.kind
    if dots is None or kind is None:
        return None
    largest = max(float(np.nanmax(shown.sizes(stage, kind))) for stage in shown.stages)
    bar = figure.colorbar(
        dots, ax=panels.ravel().tolist(), shrink=0.7, pad=0.01, aspect=28,
        extend="max" if largest > shown.top(kind) else "neither",
        panchor=False,  # panels stay at the left, where narrow ones have room for a title
    )  # fmt: skip
    bar.set_label(f"{kind.name} error [{kind.unit}]")
    bar.outline.set_visible(False)
    return bar.ax


def _move_beside(figure: Figure, bar: Axes, panels: list[Axes]) -> None:
    """Move the colour bar to the panels, which equal scales of x and y make narrower than planned.

    Beside them, as far as it was to be from them, and at half their height.
    """
    layout = figure.get_layout_engine()
    assert layout is not None
    layout.execute(figure)
    figure.set_layout_engine("none")
    planned = max(panel.get_position(original=True).x1 for panel in panels)
    for panel in panels:
        panel.apply_aspect()
    places = [panel.get_position() for panel in panels]
    low, high = min(one.y0 for one in places), max(one.y1 for one in places)
    bar.apply_aspect()
    here = bar.get_position()
    height = min(here.height, high - low)
    bar.set_aspect("auto")
    left = here.x0 - planned + max(one.x1 for one in places)
    bar.set_position((left, 0.5 * (low + high - height), here.width, height))


def _crop(figure: Figure) -> None:
    """Cut what is empty at the right and below, without moving anything on the paper."""
    wide, high = figure.get_size_inches()
    seen = figure.get_tightbbox(figure._get_renderer())  # type: ignore[attr-defined]
    right, cut = min(wide, seen.x1 + _EDGE), max(0.0, seen.y0 - _EDGE)
    for axes in figure.axes:
        x, y, w, h = axes.get_position(original=True).bounds
        place = (x * wide / right, (y * high - cut) / (high - cut))
        axes.set_position((*place, w * wide / right, h * high / (high - cut)))
    figure.set_size_inches(right, high - cut)


def _title(shown: _Map, column: int) -> str:
    stage, names = shown.stages[column], shown.stages[column].state.terms.names
    when = "" if len(shown.stages) == 1 else ("before: ", "after: ")[column]
    words = stage.label if column == 0 else " ".join(f"+ {name}" for name in names)
    if len(words) > _LONGEST:
        words = f"with {counted(len(names), 'effect')}"
    scale = f"   (arrows drawn {drawn(shown.magnify)})" if shown.magnify and column == 0 else ""
    return when + words + scale


def _dots(axes: Axes, shown: _Map, stage: Drawn, view: tuple[int, int]) -> Any:
    many = len(shown.place) > MANY
    x, y = shown.place[:, view].T
    style: dict[str, Any] = {"linewidths": 0, "zorder": 3, "rasterized": many}
    if shown.kind is None:
        axes.scatter(x, y, s=5, color=GREY, **style)
        return None
    size = shown.sizes(stage, shown.kind)
    worst_last = np.argsort(np.nan_to_num(size))
    return axes.scatter(
        x[worst_last], y[worst_last], s=9 if many else 16, c=size[worst_last], cmap=_COLOURS,
        norm=Normalize(0.0, shown.top(shown.kind)), **style,
    )  # fmt: skip


def _arrows(axes: Axes, shown: _Map, stage: Drawn, view: tuple[int, int]) -> None:
    problem = shown.problem
    every = rows_per_arrow(problem)
    error = np.where(problem.counted[:, POSITION], stage.state.raw[:, POSITION], 0.0)[problem.use]
    axes.quiver(
        *shown.place[::every, view].T, *error[::every, view].T,
        angles="xy", scale_units="xy", scale=1.0 / shown.magnify, units="inches", width=0.017,
        headwidth=3.6, headlength=4.2, headaxislength=3.8, minlength=0.0, color=INK, zorder=4,
    )  # fmt: skip


def rows_per_arrow(problem: Problem) -> int:
    """Arrows are drawn for one row in so many."""
    return int(np.ceil(problem.use.sum() / _MOST_ARROWS))


def _frame(axes: Axes, place: Array, view: tuple[int, int]) -> None:
    names = "xyz"
    span = float(np.max(np.ptp(place, axis=0)))
    margin = 0.15 * span or 0.05  # [m] about one pose
    low, high = place.min(axis=0) - margin, place.max(axis=0) + margin
    axes.set_xlim(float(low[view[0]]), float(high[view[0]]))
    axes.set_ylim(float(low[view[1]]), float(high[view[1]]))
    axes.set_aspect("equal", adjustable="box", anchor="NW")
    axes.set_xlabel(f"{names[view[0]]} [m]")
    axes.set_ylabel(f"{names[view[1]]} [m]")
    grid(axes)


def caption(problem: Problem, stage: Drawn) -> str:
    """What arrows and dots mean."""
    shown, every = _Map(problem, [stage]), rows_per_arrow(problem)
    parts = []
    if shown.magnify:
        which = "each pose" if every == 1 else f"one pose in {every}"
        parts.append(
            f"Arrows: measured minus predicted position at {which}; an error of 1 mm is drawn as "
            f"an arrow of {shown.magnify:g} mm."
        )
    if shown.kind is not None:
        parts.append(f"Dots: the {shown.kind.name} error.")
    return " ".join(parts)
