"""What schemes of control did: rows for files, a figure, and a recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from seecr.columns.csv import table_text
from seecr.controlled.result import Control, Controlled
from seecr.pose import Array
from seecr.result import Record
from seecr.show.colours import COLOURS, COMMAND, SERIES, cable_colours
from seecr.show.figures import figure
from seecr.show.files import SweepRows
from seecr.show.sweep_figure import along

LEAST = 1e-5
"""What is nearer to a wanted pose than this [mm, deg] is there: it has no place on an axis of
decades.
"""
_STYLES = ("-", "--", ":", "-.")


def schemes_json(result: Control) -> dict[str, Record]:
    """``schemes`` in ``control.json``: of each the rows as in ``sweep.json``, and what it did."""
    out: dict[str, Record] = {}
    for name, one in result.schemes.items():
        rows = SweepRows(one.solution, one.told, wanted=one.solution.command).as_json()
        for row, told in zip(rows, one.told, strict=True):
            row["command"] = row["wanted"]
            if not np.isfinite(told).all():
                row["status"] = "no_command"
        out[name] = {"rows": rows, **one.head_json()}
    return out


def control_csv(result: Control) -> str:
    """``control.csv``: one row for each pose of each scheme, in SI units."""
    rows = list(result.records())
    return table_text({name: [row[name] for row in rows] for name in rows[0]})


def control_figure(path: Path, result: Control) -> None:
    """Errors, tensions and, with feedback, how the loops settle, one line for each scheme."""
    first = next(iter(result.schemes.values()))
    at, label = along(first.solution, True, "wanted")
    loops = any(one.radius is not None for one in result.schemes.values())
    panels: dict[str, Callable[[Controlled], Array]] = {"position error [mm]": _away_mm}
    if result.robot.turns:
        panels["rotation error [°]"] = _turned_deg
    count = len(panels) + 1 + loops
    with figure(path, count, 1, figsize=(7.4, 2.1 * count)) as axes:
        pull = axes[len(panels), 0]
        for number, one in enumerate(result.schemes.values()):
            style = _style(number)
            for ax, off in zip(axes[:, 0], panels.values(), strict=False):
                shown = np.where(one.rests, np.maximum(off(one), LEAST), np.nan)
                ax.plot(at, shown, label=one.scheme, **style)
            tensions = np.where(one.rests[:, None], one.solution.tensions, np.nan)
            pull.plot(at, tensions.min(axis=1), **style)
            pull.plot(at, tensions.max(axis=1), **style)
        for ax, name in zip(axes[:, 0], panels, strict=False):
            _decades(ax)
            ax.set_ylabel(name)
        pull.set_ylabel("least and largest\ntension [N]")
        pull.set_xlabel(label)
        handles = axes[0, 0].get_legend_handles_labels()
        axes[0, 0].legend(*handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        axes[0, 0].set_title(result.robot.name)
        if loops:
            _settling(axes[-1, 0], result)


def _style(number: int) -> dict[str, Any]:
    """Of one scheme: colours differ, and where there are many also dashes."""
    turn = _STYLES[number % len(_STYLES)]
    return {"color": COLOURS[number % len(COLOURS)], "linestyle": turn, "marker": "o",
            "markersize": 2.5, "linewidth": 1.2}  # fmt: skip


def _away_mm(one: Controlled) -> Array:
    """(n,) distances from the wanted positions."""
    return np.asarray(1e3 * np.linalg.norm(one.solution.deviation[:, :3], axis=1))


def _turned_deg(one: Controlled) -> Array:
    return np.asarray(np.degrees(np.linalg.norm(one.solution.deviation[:, 3:], axis=1)))


def _decades(ax: Any) -> None:
    """An axis of decades; of nearly one value, with one decade below it to be named."""
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, 0.03 * high), 2.0 * high)


def _settling(ax: Any, result: Control) -> None:
    """The largest error of the positions read after each step, over the poses where loops hold."""
    for number, one in enumerate(result.schemes.values()):
        if one.radius is None:
            continue
        off = 1e3 * np.linalg.norm(one.history[:, :, :3], axis=2)
        known = np.isfinite(off).any(axis=1)
        most = np.nanmax(np.where(known[:, None], off, 0.0), axis=1)[known]
        how = {**_style(number), "marker": ""}
        ax.plot(np.arange(len(most)), np.maximum(most, LEAST), **how)
    _decades(ax)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlabel("step")
    ax.set_ylabel("largest error\nread [mm]")


def write_control_recording(result: Control, path: str | Path) -> None:
    """Write a recording: the wanted platform, and where it rests under each scheme.

    With a single scheme also where its controller believes the platform, and what is read.

    Raises:
        InputFileError: the file cannot be written.
    """
    from seecr.show.stream import sweep_index
    from seecr.show.sweep_recording import (
        Curves,
        MovingPlatform,
        states_of_solution,
        write_platforms,
    )

    every = list(result.schemes.values())
    wanted, last = every[0].solution.command, every[-1]
    shades = cable_colours(len(every))
    shown = [
        MovingPlatform("wanted", wanted, COMMAND),
        *(
            MovingPlatform(one.scheme, one.solution.pose, shade, solid=True)
            for one, shade in zip(every, shades, strict=True)
        ),
    ]
    who = {one.name: one.colour for one in shown[:3]}
    if len(every) == 1:
        more = [MovingPlatform("believed", last.believed, SERIES[2]),
                MovingPlatform("read", last.read, SERIES[4])]  # fmt: skip
        shown += more
        who = {one.name: one.colour for one in (shown[0], *more)}
    off = {one.scheme: np.log10(np.maximum(_away_mm(one), LEAST)) for one in every}
    errors = Curves("plot/error", "Position error, 10^… mm", off)
    write_platforms(
        path, f"{result.robot.name} control", result.robot, sweep_index(wanted), shown,
        (last.scheme, states_of_solution(last.solution)), [errors], who, last.rests,
    )  # fmt: skip
