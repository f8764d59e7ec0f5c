"""The figure of a sweep: deviations, tensions and slack cables along its commands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.counted import counted
from seecr.pose import Array, pose_difference
from seecr.prediction.uncertainty import Spread
from seecr.show.colours import COLOURS, alike
from seecr.show.figures import figure
from seecr.statics.solution import Solution
from seecr.workspace.bars import BarManifold, Midlines, midline_points
from seecr.workspace.spans import SlackSpan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Labels of the horizontal axis if no coordinate serves.
_NUMBERS = ("line of the file", "pose, counted from 0")
# With more cables than colours, and where curves coincide, dashes distinguish them.
_DASHES = ("-", "--", ":", "-.")
# With more cables than this a legend is useless.
_MOST_NAMED = 24
# Zones are yellow with the fewest slack cables and red with more, as in the paper's Figs 7 and 11.
_FEW, _MANY = (COLOURS[1], 0.18), (COLOURS[4], 0.22)
_BAND: dict[str, Any] = {"alpha": 0.2, "linewidth": 0.8}
# Where the platform jumps.
_JUMP: dict[str, Any] = {"color": "black", "linestyle": (0, (1, 2)), "linewidth": 1.2}


def sweep_figure(
    path: Path | None, solution: Solution, commanded: bool = True, wanted: bool = False,
    runs: ArrayLike | None = None, spread: Spread | None = None, zones: Sequence[SlackSpan] = (),
    bar: BarManifold | None = None,
) -> Figure:  # fmt: skip
    """Deviation, rotation if it can turn, tensions and slack cables along a sweep.

    If it can turn and hangs on two pairs of parallel cables in a plane, also how far the paper's
    point V or H is beside the line of the weight. If it was followed, dotted lines mark its jumps.
    Lines are interrupted between runs (n,), standard deviations are bands, zones of slack cables
    are shaded; without zones slack cables change half way between poses.
    """
    at, label = along(solution, commanded, "wanted" if wanted else "commanded")
    mark: dict[str, Any] = {"marker": "o", "markersize": 2.5, "linewidth": 1.1}
    if label in _NUMBERS:
        mark["linewidth"] = 0.5
    number = np.zeros(len(solution)) if runs is None else np.asarray(runs)
    whole = _Sweep(solution, spread, at, np.flatnonzero(number[1:] != number[:-1]) + 1, mark, zones)
    panels: list[Callable[[Any, _Sweep], None]] = [_tensions, _slack]
    if commanded:
        turned = [_rotations] if solution.robot.turns else []
        panels = [_deviations, *turned, *panels]
    if solution.robot.turns and (met := midline_points(solution)) is not None:
        panels.append(partial(_beside, met=met))
    if bar is not None:
        panels.append(partial(_tilts, bar=bar))
    with figure(path, len(panels), 1, sharex=True, figsize=(7.4, 2.1 * len(panels))) as axes:
        for i, (panel, ax) in enumerate(zip(panels, axes[:, 0], strict=True)):
            for k, place in enumerate(whole.jumps()):
                ax.axvline(place, label=None if i or k else "jump", **_JUMP)
            panel(ax, whole)
        axes[0, 0].set_title(solution.robot.name)
        axes[-1, 0].set_xlabel(label)
        if spread is not None:  # bands have all colours
            from matplotlib.patches import Patch

            handles, _names = axes[0, 0].get_legend_handles_labels()
            band = Patch(color="0.3", label="± one standard\ndeviation", **_BAND)
            _legend(axes[0, 0], handles=[*handles, band])
    drawn: Figure = axes[0, 0].figure
    return drawn


def along(solution: Solution, commanded: bool, word: str) -> tuple[Array, str]:
    """The horizontal axis: the coordinate along which the sweep goes, else the line of the file."""
    if commanded and len(solution) > 1:
        steps = np.diff(solution.command, axis=0)
        moves = [k for k in range(7) if np.any(np.abs(steps[:, k]) > 1e-12)]
        one_way = len(moves) == 1 and len({*np.sign(steps[:, moves[0]])}) == 1
        if one_way and moves[0] < 3:
            return 1e3 * solution.command[:, moves[0]], f"{word} {'xyz'[moves[0]]} [mm]"
    if solution.line is not None:
        return solution.line.astype(float), _NUMBERS[0]
    return np.arange(float(len(solution))), _NUMBERS[1]


@dataclass(frozen=True, eq=False)
class _Sweep:
    """The data of a sweep, and how they are drawn.

    Attributes:
        solution: of n commands.
        spread: of the same, if the model has a covariance.
        at: (n,) horizontal positions.
        starts: (k,) rows at which another run begins.
        mark: style of lines and points.
        zones: of slack cables.
    """

    solution: Solution
    spread: Spread | None
    at: Array
    starts: NDArray[np.intp]
    mark: dict[str, Any]
    zones: Sequence[SlackSpan] = ()

    def ends(self, zone: SlackSpan) -> Array:
        """Horizontal positions (2,) of a zone's ends."""
        return np.interp(zone.rows, np.arange(len(self.at)), self.at)

    def jumps(self) -> Array:
        """Horizontal positions of the jumps on the path that was followed.

        Those on the way from the reference pose to the first row of a run are at that row; where
        lengths were commanded, half way between rows.
        """
        out, solution = [], self.solution
        starts = {0, *self.starts.tolist()}
        for i, jumps in enumerate(solution.jumps or ()):
            last = i if i in starts else i - 1
            for jump in jumps:
                whole, part = (
                    float(np.linalg.norm(pose_difference(to, solution.command[last])))
                    for to in (solution.command[i], jump.command)
                )
                share = min(part / whole, 1.0) if whole > 0.0 and np.isfinite(part) else 0.5
                out.append(self.at[last] + share * (self.at[i] - self.at[last]))
        return np.array(out)

    def shade(self, ax: Any) -> None:
        """Shade the zones in which cables are slack."""
        counts = sorted({len(zone.slack) for zone in self.zones if zone.slack})
        for zone in self.zones:
            if zone.slack:
                colour, alpha = _FEW if len(zone.slack) == counts[0] else _MANY
                ax.axvspan(*self.ends(zone), color=colour, alpha=alpha, linewidth=0.0, zorder=0)

    def shades(self) -> list[Any]:
        """What the shades mean, for a legend; empty where nothing is shaded."""
        from matplotlib.patches import Patch

        counts = sorted({len(zone.slack) for zone in self.zones if zone.slack})
        words = [f"{counted(counts[0], 'cable')} slack", "more"][: len(counts)] if counts else []
        return [
            Patch(color=colour, alpha=alpha, linewidth=0.0, label=said)
            for said, (colour, alpha) in zip(words, (_FEW, _MANY), strict=False)
        ]

    def line(self, ax: Any, values: Array, *how: str, **more: Any) -> None:
        """Draw points (n,), with lines within each run."""
        ax.plot(self._between(), self._broken(values), *how, **self.mark, **more)

    def band(self, ax: Any, values: Array, stderr: Array, least: float, colour: str) -> None:
        """Draw one standard deviation on either side of values (n,), but not below ``least``."""
        edges = np.maximum(values - stderr, np.minimum(values, least)), values + stderr
        ax.fill_between(self._between(), *map(self._broken, edges), color=colour, zorder=1, **_BAND)

    def _between(self) -> Array:
        """Horizontal positions, with one half way for each break."""
        half = 0.5 * (self.at[self.starts - 1] + self.at[self.starts])
        return np.insert(self.at, self.starts, half)

    def _broken(self, values: Array) -> Array:
        """Values with NaN at each break, which interrupts lines."""
        return np.insert(np.asarray(values, float), self.starts, np.nan)


def _deviations(ax: Any, whole: _Sweep) -> None:
    stderr = None if whole.spread is None else 1e3 * whole.spread.position
    _curves(ax, whole, 1e3 * whole.solution.deviation[:, :3], stderr, [f"d{k}" for k in "xyz"])
    ax.set_ylabel("deviation [mm]")
    _legend(ax)


def _rotations(ax: Any, whole: _Sweep) -> None:
    stderr = None if whole.spread is None else np.degrees(whole.spread.rotation)
    turned = np.degrees(whole.solution.deviation[:, 3:])
    _curves(ax, whole, turned, stderr, [f"about {k}" for k in "xyz"])
    ax.set_ylabel("rotation [°]")
    _legend(ax)


def _tensions(ax: Any, whole: _Sweep) -> None:
    robot = whole.solution.robot
    stderr = None if whole.spread is None else whole.spread.tensions
    # cables do not push
    _curves(ax, whole, whole.solution.tensions, stderr, robot.cable_names, least=0.0)
    whole.shade(ax)
    ax.set_ylabel("tension [N]")
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    if robot.n_cables <= _MOST_NAMED:
        _legend(ax)


def _curves(
    ax: Any, whole: _Sweep, values: Array, stderr: Array | None, names: Sequence[str],
    least: float = -np.inf,
) -> None:  # fmt: skip
    """Each column of values (n, k) with its name, and its band if there are errors (n, k).

    Columns that coincide, with their bands, are drawn once with all names. If only the bands
    differ, all are drawn, with dashes that let the lower ones show.
    """
    below = [group.index(k) for k in range(len(names)) for group in alike([values]) if k in group]
    for first, *others in alike([values] if stderr is None else [values, stderr]):
        # the same axis or cable has the same colour in every figure
        colour = COLOURS[first % len(COLOURS)]
        style = _DASHES[(first // len(COLOURS) + below[first]) % len(_DASHES)]
        said = ", ".join(names[k] for k in (first, *others))
        whole.line(ax, values[:, first], style, color=colour, label=said)
        if stderr is not None:
            whole.band(ax, values[:, first], stderr[:, first], least, colour)


def _legend(ax: Any, **more: Any) -> None:
    """A legend beside the axes, where it covers nothing."""
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, **more)


def _slack(ax: Any, whole: _Sweep) -> None:
    solution = whole.solution
    count = np.where(solution.converged, solution.slack.sum(axis=1), np.nan)
    if whole.zones:
        whole.shade(ax)
        ax.plot(*_steps(whole), color="black", linewidth=whole.mark["linewidth"])
        ax.plot(whole.at, count, "o", color="black", markersize=whole.mark["markersize"])
    else:
        whole.line(ax, count, color="black", drawstyle="steps-mid")
    lost = ~solution.converged
    if np.any(lost):
        at = whole.at[lost]
        ax.plot(at, np.zeros(int(lost.sum())), "x", color=COLOURS[4], label="not at rest")
    if handles := [*ax.get_legend_handles_labels()[0], *whole.shades()]:
        _legend(ax, handles=handles)
    ax.set_ylabel("slack cables")
    ax.set_ylim(-0.3, solution.robot.n_cables + 0.3)
    ax.yaxis.get_major_locator().set_params(integer=True)


def _steps(whole: _Sweep) -> tuple[Array, Array]:
    """Corners of the line of slack cables by zone, interrupted between runs and without rest."""
    at, count, run = [], [], None
    for zone in whole.zones:
        if run not in (None, zone.run):
            at.append(np.nan)
            count.append(np.nan)
        run = zone.run
        at += whole.ends(zone).tolist()
        count += 2 * [np.nan if zone.slack is None else float(len(zone.slack))]
    return np.array(at), np.array(count)


def _beside(ax: Any, whole: _Sweep, met: Midlines) -> None:
    whole.line(ax, 1e3 * np.where(np.isfinite(met.beside), met.beside, np.nan), color=COLOURS[0])
    ax.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    whole.shade(ax)
    of = f"point {met.name}" if met.name else "midlines meet"
    ax.set_ylabel(f"{of} beside the\nline of the weight [mm]")


def _tilts(ax: Any, whole: _Sweep, bar: BarManifold) -> None:
    tilts = np.degrees(np.stack([bar.tilt, bar.there, bar.at_command], axis=1))
    _curves(ax, whole, tilts, None, ["at rest", "manifold there", "manifold at\nthe command"])
    ax.set_ylabel("tilt, second end up [°]")
    _legend(ax)
