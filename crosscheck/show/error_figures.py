"""Figures of a model's errors: the map of where it fails, and the wall of its residuals.

The wall shows residuals cable by cable against what they may follow, and what remains with effects.
What kind of effect it is shows at a glance: an offset is a constant, a gain a slope with length,
a drum a sine, creep a curve in time, friction and backlash a step with the direction of motion.
"""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from crosscheck.comparison.quantities import cable_errors, channels, travel
from crosscheck.fit.problem import KINDS, TENSION, Kind, Problem
from crosscheck.show.blocks import Figure, Line, Panel, Words, pieces, section
from crosscheck.show.figures import MANY, blank, dots, grid, image, styled
from crosscheck.show.residuals import Drawn, Misfit, drawn_words
from seecr.counted import counted
from seecr.pose import Array
from seecr.prediction.experiment import Prediction
from seecr.show.colours import AFTER, BEFORE, GREY, INK, NOISE, TINT

_MOST_HEIGHT = 3.4
# More arrows than this hide each other.
_MOST_ARROWS = 250
# Viridis without its bright half: dots of small errors stand out from white by 3 to 1, and from
# the dark page, on which figures are inverted.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.42, 1.0, 128)))

# A title of more letters than these does not fit above a panel: the effects are counted instead.
_LONGEST = 48


def map_section(
    title: str, problem: Problem, before: Drawn, after: Drawn, more: str = ""
) -> Panel | None:
    """Where the errors are."""
    figure = Figure(failure_map(problem, before, after))
    return section(title, figure, Line(caption(problem, before) + more, "dim"))


def failure_map(problem: Problem, before: Drawn, after: Drawn) -> str:
    """Arrows of the position error and dots of the orientation error at each measured pose."""
    shown = Misfit(problem, before.state)
    stages = [before] if after is before else [before, after]
    alone = len(stages) == 1
    # a model alone has its views side by side, two have them one below the other
    across = len(shown.views) if alone else len(stages)
    with styled():
        heights = [_height(shown.place[shown.rows], view, across) for view in shown.views]
        rows = [max(heights)] if alone else heights
        # panels of equal scales are narrower than planned: their colours stand beside them
        figure = blank(sum(rows) + 0.62 * len(rows) + 0.35, layout="compressed")
        panels = figure.subplots(
            len(rows), across, squeeze=False, gridspec_kw={"height_ratios": rows}
        )
        _draw(figure, panels.T if alone else panels, shown, stages)
        words = "Where the model fails" + (", before and after" * (not alone))
        return image(figure, words, cut=True)


def _height(place: Array, view: tuple[int, int], columns: int) -> float:
    """Of a panel [in] whose two axes have the same scale."""
    span = np.ptp(place, axis=0)
    if not span.any():  # one pose, or all alike
        span = np.ones(3)
    wide, high = (max(float(span[k]), 0.15 * float(span.max())) for k in view)
    return float(np.clip(8.6 / columns * (high + 0.3 * wide) / (1.3 * wide), 1.1, _MOST_HEIGHT))


def _draw(figure: Drawing, panels: Any, shown: Misfit, stages: list[Drawn]) -> None:
    """Draw the panels, and the bar of their colours if there are any."""
    kind, dots = _kind_of_dots(shown), None
    for column, stage in enumerate(stages):
        for axes, view in zip(panels[:, column], shown.views, strict=True):
            dots = _dots(axes, shown, stage, view, kind)
            if shown.magnify:
                _arrows(axes, shown, stage, view)
            _frame(axes, shown.place[shown.rows], view)
        panels[0, column].set_title(_title(shown, stages, column), loc="left", color=INK)
    if kind is None or dots is None:
        return
    largest = max(float(np.nanmax(shown.sizes(stage.state, kind))) for stage in stages)
    bar = figure.colorbar(
        dots, ax=panels.ravel().tolist(), shrink=0.7, pad=0.01, aspect=28,
        extend="max" if largest > shown.top(kind) else "neither",
    )  # fmt: skip
    bar.set_label(f"{kind.name} error [{kind.unit}]")
    bar.outline.set_visible(False)


def _kind_of_dots(shown: Misfit) -> Kind | None:
    """What the dots show: the orientation, or else the tensions."""
    return next((kind for kind in shown.kinds if kind.name != "position"), None)


def _title(shown: Misfit, stages: list[Drawn], column: int) -> str:
    stage, names = stages[column], stages[column].state.terms.names
    when = "" if len(stages) == 1 else ("before: ", "after: ")[column]
    words = stage.label if column == 0 else " ".join(f"+ {name}" for name in names)
    if len(words) > _LONGEST:
        words = f"with {counted(len(names), 'effect')}"
    scale = f"   (arrows drawn {shown.scale})" if shown.magnify and column == 0 else ""
    return when + words + scale


def _dots(axes: Axes, shown: Misfit, stage: Drawn, view: tuple[int, int], kind: Kind | None) -> Any:
    x, y = shown.place[shown.rows][:, view].T
    many = len(x) > MANY
    style: dict[str, Any] = {"linewidths": 0, "zorder": 3, "rasterized": many}
    if kind is None:
        return axes.scatter(x, y, s=5, color=GREY, **style)
    size = shown.sizes(stage.state, kind)[shown.rows]
    worst_last = np.argsort(np.nan_to_num(size))
    return axes.scatter(
        x[worst_last], y[worst_last], s=9 if many else 16, c=size[worst_last], cmap=_COLOURS,
        norm=Normalize(0.0, shown.top(kind)), **style,
    )  # fmt: skip


def _arrows(axes: Axes, shown: Misfit, stage: Drawn, view: tuple[int, int]) -> None:
    rows = shown.rows[:: rows_per_arrow(shown)]
    axes.quiver(
        *shown.place[rows][:, view].T, *shown.errors(stage.state)[rows][:, view].T,
        angles="xy", scale_units="xy", scale=1.0 / shown.magnify, units="inches", width=0.017,
        headwidth=3.6, headlength=4.2, headaxislength=3.8, minlength=0.0, color=INK, zorder=4,
    )  # fmt: skip


def rows_per_arrow(shown: Misfit) -> int:
    """Arrows are drawn for one of so many rows that are drawn."""
    return int(np.ceil(len(shown.rows) / _MOST_ARROWS))


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
    """What arrows and dots mean, and of which rows they are."""
    shown = Misfit(problem, stage.state)
    every, few = rows_per_arrow(shown), drawn_words(problem.data.n_rows)
    parts = []
    if shown.magnify:
        which = "each pose" if every == 1 else f"one pose in {every}"
        which += " of those drawn" if few else ""
        parts.append(
            f"Arrows: measured minus predicted position at {which}; an error of 1 mm is drawn as "
            f"an arrow of {shown.magnify:g} mm."
        )
    if (kind := _kind_of_dots(shown)) is not None:
        parts.append(f"Dots: the {kind.name} error.")
    return " ".join([*parts, few] if few else parts)


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
    """Cable lengths where the whole pose was read, else its readings; tensions where read.

    Of the rows that are drawn.
    """
    rows = Misfit(problem, before.state).drawn
    raw = before.state.raw[rows]
    change = raw - after.state.raw[rows]
    names, out = list(problem.robot.cable_names), []
    against = _of_cables(problem, after.state.prediction, rows)
    errors, noise = cable_errors(problem, raw, before.state.prediction, rows)
    predicted, _ = cable_errors(problem, change, before.state.prediction, rows)
    if np.isfinite(errors).any():
        out.append(
            Wall("Errors of cable length", names, 1e3 * errors, 1e3 * predicted,
                 1e3 * np.mean(noise, axis=0), "mm", against)
        )  # fmt: skip
    elif problem.counted[:, :6].any():
        out.append(_of_readings(problem, raw, change, after.state.prediction, rows))
    if problem.counted[:, TENSION].any():
        shown = np.where(problem.counted[rows, TENSION], raw[:, TENSION], np.nan)
        part = np.where(np.isfinite(shown), change[:, TENSION], np.nan)
        seen = np.flatnonzero(np.isfinite(shown).any(axis=0))
        level = np.full(len(seen), problem.sigma.tension_N or 0.0)
        of_seen = [(name, some[:, seen] if some.ndim == 2 else some) for name, some in against]
        out.append(
            Wall("Errors of tension", [names[k] for k in seen], shown[:, seen], part[:, seen],
                 level, "N", of_seen)
        )  # fmt: skip
    return out


def _of_cables(
    problem: Problem, prediction: Prediction, rows: NDArray[np.int64]
) -> list[tuple[str, Array]]:
    return [
        ("length of the cable [m]", problem.robot.nominal_lengths(prediction.pose[rows])),
        ("its tension [N]", prediction.found.tension[rows] / problem.robot.falls),
        ("reeled in ← last move [mm] → paid out", 1e3 * length_changes(problem, rows)),
        *_time(problem, rows),
    ]


def _of_readings(
    problem: Problem, raw: Array, change: Array, prediction: Prediction, rows: NDArray[np.int64]
) -> Wall:
    """Where the pose was read in part: its readings against place and time."""
    kept = np.flatnonzero(problem.counted[:, :6].any(axis=0)).tolist()
    factor = np.repeat([KINDS[0].factor, KINDS[1].factor], 3)[kept]
    sigma = [problem.sigma.position_m or 0.0, problem.sigma.orientation_rad or 0.0]
    shown = np.where(problem.counted[rows][:, kept], raw[:, kept], np.nan) * factor
    part = np.where(np.isfinite(shown), change[:, kept] * factor, np.nan)
    place = travel(problem, prediction).pose[:, :3]
    wide = np.ptp(place[problem.use], axis=0) > 1e-6 * problem.robot.length
    abscissae = [(f"{'xyz'[k]} [m]", place[rows, k]) for k in range(3) if wide[k]]
    names, units = [channels(problem)[0][c] for c in kept], [KINDS[c // 3].unit for c in kept]
    unit = units[0] if len(set(units)) == 1 else ""
    if not unit:
        names = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    return Wall("Errors of the readings", names, shown, part, np.repeat(sigma, 3)[kept] * factor,
                unit, (abscissae + _time(problem, rows))[:4])  # fmt: skip


def _time(problem: Problem, rows: NDArray[np.int64]) -> list[tuple[str, Array]]:
    t_s = problem.data.t_s
    if t_s is None or np.ptp(t_s) == 0.0:
        return [("row", np.arange(problem.data.n_rows, dtype=float)[rows] + 1.0)]
    return [("time [s]", t_s[rows] - t_s.min())]


def length_changes(problem: Problem, rows: NDArray[np.int64]) -> Array:
    """Commanded change of each cable's length (k, m) [m] since the row before in its run.

    NaN for the first row of a run: its long way from the reference pose would hide the others.
    """
    commands, robot = problem.experiment.commands, problem.robot
    first = commands.starts[rows]

    def at(some: NDArray[np.int64]) -> Array:
        given = commands.lengths
        return robot.nominal_lengths(commands.pose[some]) if given is None else given[some]

    return np.asarray(np.where(first[:, None], np.nan, at(rows) - at(np.maximum(rows - 1, 0))))


def wall_section(
    title: str, problem: Problem, before: Drawn, after: Drawn, alone: str, key: Words = (),
    noise: str = "noise",
) -> Panel | None:  # fmt: skip
    """What the errors of each cable look like, with a key to their colours; ``alone`` is that of
    errors that no effect accounts for.
    """
    walls = [Figure(draw_wall(wall, alone)) for wall in walls_of(problem, before, after)]
    words = (
        f"Grey background: two standard deviations of the {noise}. A constant suggests an offset, "
        "a slope over the length a gain, a sine an eccentric drum, a curve over time creep, and a "
        "step between reeled in and paid out friction or backlash."
    )
    hint = Line((*pieces(key), words), "dim")
    return section(title, hint, *walls) if walls else None


def draw_wall(wall: Wall, alone: str = BEFORE) -> str:
    """One row of panels per cable (or reading), one column per abscissa.

    Args:
        wall: residuals. alone: their colour where no effect accounts for a part of them.
    """
    size = np.where(np.isfinite(wall.measured), wall.measured**2, 0.0).sum(axis=0)
    rows = sorted(np.argsort(-size)[:_MOST_ROWS].tolist())
    names = [_in_lines(wall.names[k]) for k in rows]
    widest = max(len(line) for name in names for line in name.split("\n"))
    with styled():
        height = _ROW_HEIGHT * len(rows) + 0.75
        figure = blank(height, layout="none")
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
    parted = re.sub(r"(?<=[_/.])", " ", name)  # a line may end there, too
    lines = textwrap.wrap(parted, _LINE, max_lines=_MOST_LINES, placeholder="…")
    return "\n".join(re.sub(r"(?<=[_/.]) ", "", line) for line in lines)


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
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)
    room = margin * (high - low) or 0.5
    return low - room, high + room


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
