"""Figures of a model's errors: the map of where it fails, and the wall of its residuals.

The wall shows residuals cable by cable against what they may follow, and what remains with effects.
What kind of effect it is shows at a glance: an offset is a constant, a gain a slope with length,
a drum a sine, creep a curve in time, friction and backlash a step with the direction of motion.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from crosscheck.comparison.quantities import cable_errors, cable_lengths, channels, travel
from crosscheck.fit.problem import KINDS, POSITION, TENSION, Kind, Problem, kinds_read
from crosscheck.show.arrows import Drawn, drawn, magnification, views_of
from crosscheck.show.figures import MANY, blank, dots, grid, image, styled
from seecr.counted import counted
from seecr.pose import Array
from seecr.prediction.experiment import Prediction
from seecr.show.colours import AFTER, BEFORE, GREY, INK, NOISE, TINT

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


# More rows of panels than this are too many to look at: the worst are shown.
_MOST_ROWS = 12
_ROW_HEIGHT = 0.78
# Room beside the panels, over the page's width: for names of so many letters, and for each more.
_LEFT, _SHORT, _LETTER = 0.105, 8, 0.0072
# Letters of a line of a name, and lines of one; a name that is longer ends in dots.
_LINE, _MOST_LINES = 13, 3
# No number stands so near to the end of a panel, in parts of all of them: it would touch the next
# panel's.
_END = 0.0175


@dataclass(frozen=True, eq=False)
class Wall:
    """Residuals as rows of panels.

    Attributes:
        title: what is shown. names: (k,) of the rows of panels.
        measured: (n, k) residuals of the model as it stood. predicted: (n, k) what the effects
            added account for. noise: (k,) one standard deviation.
        unit: of these. abscissae: name and values, (n,) or (n, k).
    """

    title: str
    names: list[str]
    measured: Array
    predicted: Array
    noise: Array
    unit: str
    abscissae: list[tuple[str, Array]]

    @property
    def left(self) -> Array:
        """(n, k) what remains with these effects."""
        return self.measured - self.predicted


def walls_of(problem: Problem, before: Drawn, after: Drawn) -> list[Wall]:
    """Cable lengths where the whole pose was read, else its readings; tensions where read."""
    raw = before.state.raw
    change = raw - after.state.raw
    prediction = after.state.prediction
    out = []
    errors, noise = cable_errors(problem, raw, before.state.prediction)
    predicted, _ = cable_errors(problem, change, before.state.prediction)
    names = list(problem.robot.cable_names)
    if np.isfinite(errors).any():
        out.append(
            Wall("Errors of cable length", names, 1e3 * errors, 1e3 * predicted,
                 1e3 * np.mean(noise, axis=0), "mm", _of_cables(problem, prediction))
        )  # fmt: skip
    elif problem.counted[:, :6].any():
        out.append(_of_readings(problem, raw, change, prediction))
    if problem.counted[:, TENSION].any():
        shown = np.where(problem.counted[:, TENSION], raw[:, TENSION], np.nan)
        part = np.where(np.isfinite(shown), change[:, TENSION], np.nan)
        seen = np.flatnonzero(np.isfinite(shown).any(axis=0))
        level = np.full(len(seen), problem.sigma.tension_N or 0.0)
        against = [
            (name, values[:, seen] if values.ndim == 2 else values)
            for name, values in _of_cables(problem, prediction)
        ]
        out.append(
            Wall("Errors of tension", [names[k] for k in seen], shown[:, seen], part[:, seen],
                 level, "N", against)
        )  # fmt: skip
    return out


def _of_cables(problem: Problem, prediction: Prediction) -> list[tuple[str, Array]]:
    out = [("length of the cable [m]", cable_lengths(problem, prediction))]
    out.append(("its tension [N]", prediction.tensions))
    out.append(("reeled in ← last move [mm] → paid out", 1e3 * length_changes(problem, prediction)))
    return out + _time(problem)


def _of_readings(problem: Problem, raw: Array, change: Array, prediction: Prediction) -> Wall:
    """Where the pose was read in part: its readings against place and time."""
    kept = [c for c in range(6) if problem.counted[:, c].any()]
    names, _units = channels(problem)
    factor = np.array([KINDS[0].factor] * 3 + [KINDS[1].factor] * 3)
    sigma = np.array([problem.sigma.position_m or 0.0] * 3)
    sigma = np.concatenate([sigma, [problem.sigma.orientation_rad or 0.0] * 3])
    units = [KINDS[0 if c < 3 else 1].unit for c in kept]
    shown = np.where(problem.counted[:, kept], raw[:, kept], np.nan) * factor[kept]
    part = np.where(np.isfinite(shown), change[:, kept] * factor[kept], np.nan)
    place = travel(problem, prediction).pose[:, :3]
    wide = np.ptp(place[problem.use], axis=0) > 1e-6 * problem.robot.length
    abscissae = [(f"{'xyz'[k]} [m]", place[:, k]) for k in range(3) if wide[k]]
    rows = [names[c] for c in kept]
    if len(set(units)) > 1:
        rows = [f"{name} [{unit}]" for name, unit in zip(rows, units, strict=True)]
    unit = units[0] if len(set(units)) == 1 else ""
    level = sigma[kept] * factor[kept]
    return Wall("Errors of the readings", rows, shown, part, level, unit,
                (abscissae + _time(problem))[:4])  # fmt: skip


def _time(problem: Problem) -> list[tuple[str, Array]]:
    t_s = problem.data.t_s
    if t_s is None or np.ptp(t_s) == 0.0:
        return [("row", np.arange(problem.data.n_rows, dtype=float) + 1.0)]
    return [("time [s]", t_s - t_s.min())]


def length_changes(problem: Problem, prediction: Prediction) -> Array:
    """Commanded change of each cable's length (n, m) [m] since the row before in its run.

    NaN for the first row of a run: its long way from the reference pose would hide the others.
    """
    first = problem.experiment.commands.starts
    lengths = problem.experiment.commands.lengths
    if lengths is None:
        lengths = problem.robot.nominal_lengths(travel(problem, prediction).pose)
    before = np.concatenate([lengths[:1], lengths[:-1]])
    return np.asarray(np.where(first[:, None], np.nan, lengths - before))


def draw_wall(wall: Wall, alone: str = BEFORE) -> str:
    """One row of panels per cable (or reading), one column per abscissa.

    Args:
        wall: residuals. alone: their colour where no effect accounts for a part of them.
    """
    rows = _worth_showing(wall)
    names = [_in_lines(wall.names[k]) for k in rows]
    widest = max(len(line) for name in names for line in name.split("\n"))
    with styled():
        height = _ROW_HEIGHT * len(rows) + 0.75
        figure = blank(height, constrained=False)
        panels = figure.subplots(
            len(rows), len(wall.abscissae), squeeze=False,
            gridspec_kw={
                "left": _LEFT + _LETTER * max(widest - _SHORT, 0), "right": 0.995,
                "bottom": 0.5 / height, "top": 1.0 - 0.25 / height,
                "wspace": 0.07 if wall.unit else 0.16, "hspace": 0.16,
            },
        )  # fmt: skip
        _share(panels, wall, rows)
        _ticks(panels, numbered_inside=not wall.unit)
        for place, k in enumerate(rows):
            for axes, (_name, values) in zip(panels[place], wall.abscissae, strict=True):
                _panel(axes, _of_row(values, k), wall, k, alone)
            panels[place, 0].set_ylabel(
                names[place], rotation=0, ha="right", va="center", labelpad=6
            )
        for axes, (name, _values) in zip(panels[-1], wall.abscissae, strict=True):
            axes.set_xlabel(name)
        unit = f" [{wall.unit}]" if wall.unit else ""
        panels[0, 0].set_title(f"{wall.title}{unit}", loc="left", fontsize=8.5)
        return image(figure, f"{wall.title} against what they may follow")


def _in_lines(name: str) -> str:
    """A name beside its panel in short lines: in one it would leave the page."""
    pieces = re.findall(rf"[^\s_/.-]{{1,{_LINE - 1}}}[\s_/.-]?|[\s_/.-]", name)
    lines = [""]
    for piece in pieces:
        if len(f"{lines[-1]}{piece}".rstrip()) > _LINE:
            lines.append("")
        lines[-1] += piece
    lines = [line.strip() for line in lines]
    if len(lines) > _MOST_LINES:
        lines[_MOST_LINES - 1 :] = [f"{lines[_MOST_LINES - 1][: _LINE - 1]}…"]
    return "\n".join(lines)


class _Inner(MaxNLocator):
    """Round numbers, none so near to the end of a panel that it touches those of the next."""

    def __init__(self, columns: int) -> None:
        super().__init__(nbins="auto", steps=[1, 2, 2.5, 5, 10])
        self.room = _END * columns

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """Places of ticks between two values."""
        room = self.room * (vmax - vmin)
        places = np.asarray(super().tick_values(vmin, vmax))
        return places[(places > vmin + room) & (places < vmax - room)]


def _worth_showing(wall: Wall) -> list[int]:
    count = wall.measured.shape[1]
    with np.errstate(invalid="ignore"):
        size = np.nanmean(np.where(np.isfinite(wall.measured), wall.measured**2, 0.0), axis=0)
    worst = np.argsort(-size)[:_MOST_ROWS]
    return sorted(int(k) for k in worst) if count > _MOST_ROWS else list(range(count))


def _of_row(values: Array, k: int) -> Array:
    return values if values.ndim == 1 else values[:, k]


def _share(panels: Any, wall: Wall, rows: list[int]) -> None:
    """Limits that panels have in common.

    Matplotlib's own way looks at every other panel for each thing that is drawn in one.
    """
    for column, (_name, values) in enumerate(wall.abscissae):
        read = [_of_row(values, k)[np.isfinite(wall.measured[:, k])] for k in rows]
        for axes in panels[:, column]:
            axes.set_xlim(_limits(read, 0.04))
    for place, k in enumerate(rows):
        alike = rows if wall.unit else [k]
        heights = [wall.measured[:, alike], wall.left[:, alike], 2.0 * wall.noise[alike]]
        for axes in panels[place]:
            axes.set_ylim(_limits([*heights, -2.0 * wall.noise[alike]], 0.05))


def _ticks(panels: Any, *, numbered_inside: bool) -> None:
    """Round numbers below the last row and beside the first column, or of every panel's height."""
    for place, column in np.ndindex(panels.shape):
        axes = panels[place, column]
        axes.xaxis.set_major_locator(_Inner(panels.shape[1]))
        axes.locator_params(axis="y", nbins=3)
        axes.tick_params(
            labelbottom=place == len(panels) - 1, labelleft=column == 0 or numbered_inside
        )
        grid(axes, "x")


def _limits(values: list[Array], margin: float) -> tuple[float, float]:
    """From the least to the largest finite value and a part of that beyond."""
    every = np.concatenate([np.ravel(v) for v in values])
    every = every[np.isfinite(every)]
    if len(every) == 0 or np.ptp(every) == 0.0:
        middle = float(every[0]) if len(every) else 0.0
        return middle - 0.5, middle + 0.5
    room = margin * float(np.ptp(every))
    return float(every.min()) - room, float(every.max()) + room


def _panel(axes: Axes, x: Array, wall: Wall, k: int, alone: str) -> None:
    y = wall.measured[:, k]
    level = float(wall.noise[k])
    axes.axhspan(-2 * level, 2 * level, color=NOISE, linewidth=0, zorder=0)
    many = bool(np.isfinite(y).sum() > MANY)
    overlaid = bool(np.any(wall.predicted[np.isfinite(wall.predicted)] != 0.0))
    dots(axes, x, y, 2.4 if many else 4.4, TINT if overlaid else alone, 0.6)
    if overlaid:
        dots(axes, x, wall.left[:, k], 1.0 if many else 2.0, AFTER, 0.7)
    axes.axhline(0.0, color=INK, linewidth=0.5, zorder=1)
    if many:
        axes.set_rasterization_zorder(0.8)  # both kinds of dots as one image per panel
