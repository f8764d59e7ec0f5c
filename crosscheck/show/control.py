"""What schemes of control did in MuJoCo: traces as CSV, a figure, and recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.controlled.result import TimedControl, TimedScheme
from seecr.columns.csv import table_text
from seecr.pose import Array
from seecr.result import COORDINATES, Record, named
from seecr.show.colours import COLOURS, COMMAND, MUJOCO, SERIES
from seecr.show.control import LEAST, schemes_json
from seecr.show.figures import figure


def timed_json(result: TimedControl) -> dict[str, Record]:
    """``schemes`` in ``control.json``: as of seecr control, with what MuJoCo did as ``timed``."""
    out = schemes_json(result.at_rest)
    for name, one in result.schemes.items():
        out[name]["timed"] = one.records()
    return out


# Instants that a recording shows.
_MOST_INSTANTS = 4000


def trace_csv(one: TimedScheme) -> str:
    """What happened under a scheme, one row for each instant, in SI units."""
    trace, m = one.trace, [str(k + 1) for k in range(one.trace.told.shape[1])]
    return table_text({
        "t_s": trace.t, "pose": trace.row, "held": trace.held.astype(int),
        **named("want_{}", COORDINATES, one.rest.solution.command[trace.row]),
        **named("pose_{}", COORDINATES, trace.pose), **named("read_{}", COORDINATES, trace.read),
        **named("told_{}_m", m, trace.told), **named("paid_{}_m", m, trace.paid),
        **named("tension_{}_N", m, trace.tensions),
    })  # fmt: skip


def away_mm(one: TimedScheme) -> Array:
    """(k,) [mm] from the pose that is wanted at each instant."""
    wanted = one.rest.solution.command[one.trace.row]
    return np.asarray(1e3 * np.linalg.norm(one.trace.pose[:, :3] - wanted[:, :3], axis=1))


def timed_figure(path: Path, result: TimedControl) -> None:
    """Errors of all schemes over time; tensions and lengths of each."""
    every = list(result.schemes.values())
    count = 1 + 2 * len(every)
    with figure(path, count, 1, sharex=True, figsize=(7.4, 1.9 * count)) as axes:
        ax = axes[0, 0]
        for k, one in enumerate(every):
            shade = COLOURS[k % len(COLOURS)]
            off = np.maximum(away_mm(one), LEAST)
            ax.plot(one.trace.t, off, color=shade, linewidth=1.0, label=one.rest.scheme)
        ax.set_yscale("log")
        ax.set_ylabel("from the wanted\nposition [mm]")
        ax.set_title(f"{result.at_rest.robot.name} in MuJoCo")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        for k, one in enumerate(every):
            _cables(axes[1 + 2 * k, 0], one, one.trace.tensions, "tension [N]")
            home = result.at_rest.robot.rest_lengths
            _cables(axes[2 + 2 * k, 0], one, 1e3 * (one.trace.paid - home), "winches [mm]")
        axes[-1, 0].set_xlabel("time [s]")


def _cables(ax: Any, one: TimedScheme, values: Array, what: str) -> None:
    for k, name in enumerate(one.rest.solution.robot.cable_names):
        shade = COLOURS[k % len(COLOURS)]
        ax.plot(one.trace.t, values[:, k], color=shade, linewidth=0.8, label=name)
    ax.set_ylabel(f"{one.rest.scheme}\n{what}")
    if len(one.rest.solution.robot.cable_names) <= len(COLOURS):
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)


def write_timed_recording(one: TimedScheme, path: str | Path) -> None:
    """Write what happened under a scheme over time: wanted, believed, true and read platform.

    Raises:
        InputFileError: the file cannot be written.
    """
    from seecr.show.scene import States
    from seecr.show.stream import settling_index
    from seecr.show.sweep_recording import Curves, MovingPlatform, write_platforms

    trace, robot = one.trace, one.rest.solution.robot
    some = slice(None, None, max(1, len(trace.t) // _MOST_INSTANTS))
    row, poses, pulls, paid = (
        values[some] for values in (trace.row, trace.pose, trace.tensions, trace.paid)
    )
    shown = {
        "wanted": MovingPlatform("wanted", one.rest.solution.command[row], COMMAND),
        "believed": MovingPlatform("believed", one.rest.believed[row], SERIES[2]),
        "read": MovingPlatform("read", trace.read[some], SERIES[4]),
        "true": MovingPlatform("mujoco", poses, MUJOCO, solid=True),
    }
    away = np.log10(np.maximum(away_mm(one)[some], LEAST))
    turned = dict(zip(robot.cable_names, 1e3 * (paid - robot.rest_lengths).T, strict=True))
    curves = [
        Curves("plot/error", "From the wanted position, 10^… mm", {one.rest.scheme: away}),
        Curves("plot/winches", "Winches from home [mm]", turned),
    ]
    write_platforms(
        path, f"{robot.name} {one.rest.scheme}", robot, [settling_index(trace.t[some])],
        list(shown.values()), ("mujoco", States(poses, pulls, paid, pulls <= 0.0)), curves,
        {who: shown[who].colour for who in ("wanted", "read", "true")},
    )  # fmt: skip
