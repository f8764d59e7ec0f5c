"""Writes what a plan proposes as files of commands for a controller."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.given import numbers_of
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.write import write_measurements
from crosscheck.planning.result import Plan
from seecr.errors import InputError
from seecr.files import check_writable
from seecr.pose import Array

__all__ = ["box_of", "write_plan"]


def write_plan(plan: Plan, folder: str | Path, own: bool = True) -> tuple[str, ...]:
    """Write the commands of a plan, and those of each useful addition, for a controller.

    Args:
        plan: the result of :func:`make_plan`.
        folder: folder to write to; it is created if necessary.
        own: whether to write the plan's own commands, ``poses.csv``, or only ``add-KIND.csv``.

    Returns:
        Names of the files.

    Raises:
        InputFileError: the folder cannot be made or written to.
        InputError: not a plan.
    """
    if not isinstance(plan, Plan):
        raise InputError(f"expected a plan, as make_plan returns it, got {type(plan).__name__}")
    folder = Path(folder)
    files = {"poses.csv": plan.planned.problem.data} if own else {}
    for item in plan.suggestions:
        if item.reached and item.commands is not None:
            files[f"add-{item.kind.value}.csv"] = item.commands
    for name, commands in files.items():
        check_writable(folder / name)
        folder.mkdir(parents=True, exist_ok=True)
        write_measurements(folder / name, _unread(commands), remark_of(commands))
    return tuple(files)


def remark_of(commands: Measurements) -> str:
    """Which lines, below the remark and the header, are way points; "" if none are."""
    lines = ", ".join(str(row + 3) for row in np.flatnonzero(~commands.read))
    return lines and f"way points, passed without a reading: lines {lines}"


def _unread(data: Measurements) -> Measurements:
    """Commands and their loads, without any readings."""
    n, nothing = data.n_rows, np.zeros(3, dtype=bool)
    return replace(
        data,
        position=np.full((n, 3), np.nan),
        quat_wxyz=None,
        angles_rad=np.full((n, 3), np.nan),
        tensions=np.full((n, data.n_cables), np.nan),
        position_mask=nothing,
        angle_mask=nothing,
        tension_mask=np.zeros(data.n_cables, dtype=bool),
    )


def box_of(text: str) -> Array:
    """Parse six numbers with commas to the lowest and highest position (2, 3) [m].

    Raises:
        CrosscheckError: the text is anything else.
    """
    expected = "X0,Y0,Z0,X1,Y1,Z1 in metres, the lower corner first"
    values = numbers_of("--box", text, 6, expected)
    if not np.all(values[:3] <= values[3:]):
        raise CrosscheckError(f"--box: expected {expected}, got {text!r}")
    return values.reshape(2, 3)
