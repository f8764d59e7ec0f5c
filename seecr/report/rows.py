"""The rows of ``sweep.json`` and ``sweep.csv``."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seecr.pose import Array
from seecr.result import Record
from seecr.solution import Solution
from seecr.uncertainty import Spread

__all__ = ["csv_text", "rows_of"]

_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


def rows_of(
    solution: Solution,
    lengths: Array | None = None,
    more: Mapping[str, Sequence[Any]] | None = None,
    spread: Spread | None = None,
) -> list[Record]:
    """One row per command, SI units.

    Args:
        solution: of n commands.
        lengths: (n, m) [m] that were commanded instead of poses.
        more: further values of each row, by name.
        spread: one standard deviation of poses and tensions, where the model says so.
    """
    names = solution.robot.cable_names
    eigenvalues, extra = solution.smallest_eigenvalue, more or {}
    if solution.line is not None:
        extra = {"line": solution.line.tolist(), **extra}
    return [
        {
            **{name: values[i] for name, values in extra.items()},
            "command": solution.command[i].tolist() if lengths is None else None,
            **({} if lengths is None else {"command_lengths_m": lengths[i].tolist()}),
            "pose": solution.pose[i].tolist(),
            "deviation_m": solution.deviation[i, :3].tolist() if lengths is None else None,
            "rotation_rad": solution.deviation[i, 3:].tolist() if lengths is None else None,
            "tensions_N": solution.tensions[i].tolist(),
            "slack": [name for name, s in zip(names, solution.slack[i], strict=True) if s],
            "rest_lengths_m": solution.rest_lengths[i].tolist(),
            "status": solution.status[i].name.lower(),
            "iterations": int(solution.iterations[i]),
            "residual": float(solution.residual[i]),
            "smallest_eigenvalue": float(eigenvalues[i]),
            **_jumps_of(solution, i),
            **_spread_of(spread, i),
        }
        for i in range(len(solution))
    ]


def _jumps_of(solution: Solution, i: int) -> Record:
    if solution.jumps is None:
        return {}
    return {
        "jumps": [
            {
                "command": jump.command.tolist(),
                "before": jump.before.tolist(),
                "after": jump.after.tolist(),
                "energy_J": jump.energy,
                "certain": jump.certain,
            }
            for jump in solution.jumps[i]
        ]
    }


def _spread_of(spread: Spread | None, i: int) -> Record:
    if spread is None:
        return {}
    return {
        "position_stderr_m": spread.position[i].tolist(),
        "rotation_stderr_rad": spread.rotation[i].tolist(),
        "seen_stderr": spread.seen[i].tolist(),
        "tensions_stderr_N": spread.tensions[i].tolist(),
    }


def csv_text(rows: Sequence[Record]) -> str:
    """Rows as a CSV; its commands are read again as a list of commands.

    Numbers have all their digits; cells without a number are empty.
    """
    table = [_flat(row) for row in rows]
    out = io.StringIO()
    writer = csv.DictWriter(out, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return out.getvalue()


def _flat(row: Record) -> dict[str, str]:
    """One row of sweep.json as cells by column."""
    m = len(row["tensions_N"])
    cables = [str(i + 1) for i in range(m)]
    out: dict[str, Any] = {key: row[key] for key in ("run", "t_s", "temperature_C") if key in row}
    if row["command"] is not None:
        out |= _named("cmd_{}", _POSE, row["command"])
    else:
        out |= _named("length_{}_m", cables, row["command_lengths_m"])
    out |= _named("pose_{}", _POSE, row["pose"])
    if row["deviation_m"] is not None:
        out |= _named("deviation_{}_m", "xyz", row["deviation_m"])
        out |= _named("rotation_{}_rad", "xyz", row["rotation_rad"])
    out |= _named("tension_{}_N", cables, row["tensions_N"])
    if "position_stderr_m" in row:
        out |= _named("pose_{}_stderr_m", "xyz", row["position_stderr_m"])
        out |= _named("rotation_{}_stderr_rad", "xyz", row["rotation_stderr_rad"])
        out |= _named("cable_{}_stderr_N", cables, row["tensions_stderr_N"])
    out |= {key: row[key] for key in ("status", "residual", "smallest_eigenvalue")}
    out["slack"] = " ".join(row["slack"])
    return {name: _cell(value) for name, value in out.items()}


def _named(pattern: str, names: Sequence[str], values: Sequence[float]) -> dict[str, Any]:
    return {pattern.format(name): value for name, value in zip(names, values, strict=True)}


def _cell(value: Any) -> str:
    if isinstance(value, float):
        # adding zero turns -0.0 into 0.0
        return repr(value + 0.0) if np.isfinite(value) else ""
    return str(value)
