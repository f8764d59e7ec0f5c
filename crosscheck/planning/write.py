"""Writes what a plan proposes as files of commands for a controller."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.given import numbers_of
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.write import write_measurements
from crosscheck.planning.planned import Adding
from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.result import Plan
from seecr.errors import InputError
from seecr.files import check_writable
from seecr.pose import Array

NAME = "plan.json"
_OWN = "poses.csv"


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

    Example:
        ``crosscheck.write_plan(crosscheck.make_plan(robot, data), "plan")``
    """
    if not isinstance(plan, Plan):
        raise InputError(f"expected a plan, as make_plan returns it, got {type(plan).__name__}")
    folder = Path(folder)
    files = {_OWN: (plan.planned.problem.data, "")} if own else {}
    for item in plan.suggestions:
        if item.reached and item.commands is not None:
            files[_addition(item.kind)] = (item.commands, slack_remark(item))
    for name, (commands, slack) in files.items():
        check_writable(folder / name)
        folder.mkdir(parents=True, exist_ok=True)
        remarks = "; ".join(filter(None, [remark_of(commands), slack]))
        write_measurements(folder / name, commands.without_readings(), remarks)
    return tuple(files)


def planned_files(out: Path, read: Path | None) -> dict[str, Any]:
    """``names`` and ``sometimes`` for :func:`seecr.folders.staged`.

    Commands that are planned now, ``read``, may be those of an older plan in ``out``: they stay.
    """
    own = [] if read is not None and (out / _OWN).resolve() == read.resolve() else [_OWN]
    return {
        "names": [NAME, "plan.html", *(_with_toml([_OWN]) if read is None else ())],
        "sometimes": _with_toml([*own, *map(_addition, Adding)]),
    }


def _with_toml(names: Iterable[str]) -> list[str]:
    return [one for name in names for one in (name, str(Path(name).with_suffix(".toml")))]


def _addition(kind: Adding) -> str:
    return f"add-{kind.value}.csv"


def remark_of(commands: Measurements) -> str:
    """Which lines, below the remark and the header, are way points; "" if none are."""
    lines = ", ".join(str(row + 3) for row in np.flatnonzero(~commands.read))
    return lines and f"way points, passed without a reading: lines {lines}"


def slack_remark(item: Suggestion) -> str:
    """Which lines, below the remark and the header, leave cables slack; "" if none do."""
    loose = [f"line {k + 3} ({' '.join(names)})" for k, names in enumerate(item.slack) if names]
    return f"cables are slack at {', '.join(loose)}" if loose else ""


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
