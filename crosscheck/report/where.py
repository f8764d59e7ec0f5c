"""The map of where the model fails, before and after, with the same scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from crosscheck.diagnosis.path import Drawn, drawn, magnification, views_of
from crosscheck.fit.least_squares.problem import POSITION, Kind, Problem, kinds_read
from crosscheck.report.drawing import GREY, INK, MANY, blank, grid, image, styled
from seecr.counted import counted
from seecr.pose import Array

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
    place = before.state.prediction.pose[:, :3]
    views = views_of(place[problem.use])
    stages = [before] if after is before else [before, after]
    # a model alone has its views side by side, two have them one below the other
    across = len(views) if len(stages) == 1 else len(stages)
    with styled():
        heights = [_height(place[problem.use], view, across) for view in views]
        rows = [max(heights)] if len(stages) == 1 else heights
        figure = blank(sum(rows) + 0.62 * len(rows) + 0.35)
        panels = figure.subplots(
            len(rows), across, squeeze=False, gridspec_kw={"height_ratios": rows}
        )
        columns = panels.T if len(stages) == 1 else panels
        bar = _draw(figure, columns, problem, stages, place, views)
        if bar is not None:
            _move_beside(figure, bar, panels.ravel().tolist())
            _crop(figure)
        words = "Where the model fails" + (", before and after" if len(stages) > 1 else "")
        return image(figure, words)


def _height(place: Array, view: tuple[int, int], columns: int) -> float:
    """Of a panel [in] whose two axes have the same scale."""
    span = np.ptp(place, axis=0)
    if not span.any():  # one pose, or all alike
        span = np.ones(3)
    wide, high = (max(float(span[k]), 0.15 * float(span.max())) for k in view)
    return float(np.clip(8.6 / columns * (high + 0.3 * wide) / (1.3 * wide), 1.1, _MOST_HEIGHT))


def _draw(
    figure: Figure,
    panels: Any,
    problem: Problem,
    stages: list[Drawn],
    place: Array,
    views: list[tuple[int, int]],
) -> Axes | None:
    """Draw the panels; the colour bar's axes, if there is one."""
    magnify = magnification(problem, stages[0].state)
    kind = _coloured(problem)
    top = _top(problem, stages[0], kind) if kind else 1.0
    dots = None
    for column, stage in enumerate(stages):
        for axes, view in zip(panels[:, column], views, strict=True):
            dots = _dots(axes, problem, stage, place, view, kind, top) or dots
            if magnify:
                _arrows(axes, problem, stage, place, view, magnify)
            _frame(axes, place[problem.use], view)
        title = _title(stages, column, magnify)
        panels[0, column].set_title(title, loc="left", color=INK)
    if dots is not None and kind is not None:
        beyond = max(_largest(problem, stage, kind) for stage in stages) > top
        bar = figure.colorbar(
            dots, ax=panels.ravel().tolist(), shrink=0.7, pad=0.01, aspect=28,
            extend="max" if beyond else "neither",
            panchor=False,  # panels stay at the left, where narrow ones have room for a title
        )  # fmt: skip
        bar.set_label(f"{kind.name} error [{kind.unit}]")
        bar.outline.set_visible(False)
        return bar.ax
    return None


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


def _title(stages: list[Drawn], column: int, magnify: float) -> str:
    stage = stages[column]
    when = "" if len(stages) == 1 else ("before: ", "after: ")[column]
    names = stage.label if column == 0 else " ".join(f"+ {n}" for n in stage.state.terms.names)
    if len(names) > _LONGEST:
        names = f"with {counted(len(stage.state.terms.names), 'effect')}"
    scale = f"   (arrows drawn {drawn(magnify)})" if magnify and column == 0 else ""
    return when + names + scale


def _coloured(problem: Problem) -> Kind | None:
    """What the dots show: the orientation, or else the tensions."""
    read = [kind for kind in kinds_read(problem) if kind.name != "position"]
    return read[0] if read else None


def _largest(problem: Problem, stage: Drawn, kind: Kind) -> float:
    return float(np.nanmax(kind.sizes(problem, stage.state.raw))) * kind.factor


def _top(problem: Problem, stage: Drawn, kind: Kind) -> float:
    size = kind.sizes(problem, stage.state.raw) * kind.factor
    return max(float(np.nanpercentile(size, _LARGEST)), 1e-12)


def _dots(
    axes: Axes,
    problem: Problem,
    stage: Drawn,
    place: Array,
    view: tuple[int, int],
    kind: Kind | None,
    top: float,
) -> Any:
    rows = problem.use
    many = bool(rows.sum() > MANY)
    x, y = place[rows][:, view[0]], place[rows][:, view[1]]
    style: dict[str, Any] = {"linewidths": 0, "zorder": 3, "rasterized": many}
    if kind is None:
        axes.scatter(x, y, s=5, color=GREY, **style)
        return None
    size = (kind.sizes(problem, stage.state.raw) * kind.factor)[rows]
    worst_last = np.argsort(np.nan_to_num(size))
    return axes.scatter(
        x[worst_last], y[worst_last], s=9 if many else 16, c=size[worst_last], cmap=_COLOURS,
        norm=Normalize(0.0, top), **style,
    )  # fmt: skip


def _arrows(
    axes: Axes, problem: Problem, stage: Drawn, place: Array, view: tuple[int, int], magnify: float
) -> None:
    error = np.where(problem.counted[:, POSITION], stage.state.raw[:, POSITION], 0.0)
    rows = np.flatnonzero(problem.use)[:: rows_per_arrow(problem)]
    axes.quiver(
        place[rows, view[0]], place[rows, view[1]], error[rows, view[0]], error[rows, view[1]],
        angles="xy", scale_units="xy", scale=1.0 / magnify, units="inches", width=0.017,
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
    magnify, kind = magnification(problem, stage.state), _coloured(problem)
    parts = []
    if magnify:
        parts.append(
            f"Arrows: measured minus predicted position at {_which(rows_per_arrow(problem))}; an "
            f"error of 1 mm is drawn as an arrow of {magnify:g} mm."
        )
    if kind is not None:
        parts.append(f"Dots: the {kind.name} error.")
    return " ".join(parts)


def _which(every: int) -> str:
    return "each pose" if every == 1 else f"one pose in {every}"
