"""The figure of a sweep: what is off, tensions and slack cables, along its commands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from seecr.curves import alike
from seecr.pose import Array
from seecr.report.drawing import COLOURS, figure
from seecr.statics.solution import Solution

__all__ = ["sweep_figure"]

# What says which pose it is, where no coordinate does.
_NUMBERS = ("line of the file", "pose, counted from 0")
# More cables than colours are told apart by dashes.
_DASHES = ("-", "--", ":", "-.")
# Beyond so many cables a legend says nothing.
_MOST_NAMED = 24


def sweep_figure(
    path: Path, solution: Solution, commanded: bool = True, wanted: bool = False
) -> None:
    """Deviation, rotation, tensions and slack cables along a sweep.

    Args:
        path: the file.
        solution: of the sweep.
        commanded: whether poses were commanded, and not lengths.
        wanted: whether they are what lengths were told for.
    """
    at, label = _along(solution, commanded, "wanted" if wanted else "commanded")
    mark: dict[str, Any] = {"marker": "o", "markersize": 2.5, "linewidth": 1.1}
    if label in _NUMBERS:
        mark["linewidth"] = 0.5
    panels = [_tensions, _slack]
    if commanded:
        panels = [_deviations, _rotations, *panels]
    with figure(path, len(panels), 1, sharex=True, figsize=(7.4, 2.1 * len(panels))) as axes:
        for panel, ax in zip(panels, axes[:, 0], strict=True):
            panel(ax, solution, at, mark)
        axes[0, 0].set_title(solution.robot.name)
        axes[-1, 0].set_xlabel(label)


def _along(solution: Solution, commanded: bool, word: str) -> tuple[Array, str]:
    """What to draw over: the coordinate that the sweep goes along, else the file's line."""
    if commanded and len(solution) > 1:
        steps = np.diff(solution.command, axis=0)
        moves = [k for k in range(7) if np.any(np.abs(steps[:, k]) > 1e-12)]
        one_way = len(moves) == 1 and len({*np.sign(steps[:, moves[0]])}) == 1
        if one_way and moves[0] < 3:
            return 1e3 * solution.command[:, moves[0]], f"{word} {'xyz'[moves[0]]} [mm]"
    if solution.line is not None:
        return solution.line.astype(float), _NUMBERS[0]
    return np.arange(float(len(solution))), _NUMBERS[1]


def _deviations(ax: Any, solution: Solution, at: Array, mark: dict[str, Any]) -> None:
    moved = 1e3 * solution.deviation[:, :3]
    _curves(ax, at, moved, [f"d{name}" for name in "xyz"], mark)
    ax.set_ylabel("deviation [mm]")
    _legend(ax)


def _rotations(ax: Any, solution: Solution, at: Array, mark: dict[str, Any]) -> None:
    turned = np.degrees(solution.deviation[:, 3:])
    _curves(ax, at, turned, [f"about {name}" for name in "xyz"], mark)
    ax.set_ylabel("rotation [°]")
    _legend(ax)


def _tensions(ax: Any, solution: Solution, at: Array, mark: dict[str, Any]) -> None:
    _curves(ax, at, solution.tensions, solution.robot.cable_names, mark)
    ax.set_ylabel("tension [N]")
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    if solution.robot.n_cables <= _MOST_NAMED:
        _legend(ax)


def _curves(
    ax: Any, at: Array, values: Array, names: Sequence[str], mark: dict[str, Any]
) -> None:  # fmt: skip
    """Each column of values (n, k) by its name; those that lie on each other once, with all."""
    for first, *others in alike([values]):
        # the same axis or cable has the same colour in every figure
        colour, style = COLOURS[first % len(COLOURS)], _DASHES[first // len(COLOURS) % len(_DASHES)]
        said = ", ".join(names[k] for k in (first, *others))
        ax.plot(at, values[:, first], style, color=colour, label=said, **mark)


def _legend(ax: Any) -> None:
    """Beside the axes, where it covers nothing."""
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)


def _slack(ax: Any, solution: Solution, at: Array, mark: dict[str, Any]) -> None:
    count = np.where(solution.converged, solution.slack.sum(axis=1), np.nan)
    ax.plot(at, count, color="black", drawstyle="steps-mid", **mark)
    lost = ~solution.converged
    if np.any(lost):
        ax.plot(at[lost], np.zeros(int(lost.sum())), "x", color=COLOURS[4], label="no rest")
        _legend(ax)
    ax.set_ylabel("slack cables")
    ax.set_ylim(-0.3, solution.robot.n_cables + 0.3)
    ax.yaxis.get_major_locator().set_params(integer=True)
