"""Writes what a plan proposes as files of commands for a controller."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.given import numbers_of
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.write import write_measurements
from crosscheck.planning.planned import Adding
from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.result import Plan
from seecr.errors import InputError, InputFileError
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


def sometimes_written(out: Path, read: Path | None) -> list[str]:
    """Names of the files that only some plans have, for :func:`seecr.files.staged`.

    Users call their own commands ``poses.csv``, too. It is an older plan's only if that plan
    in ``out`` says that it wrote it, and stays if it is what is planned now, ``read``.
    """
    planned = read is not None and (out / _OWN).resolve() == read.resolve()
    own = [_OWN] if _OWN in _wrote(out) and not planned else []
    names = [Path(name) for name in (*own, *map(_addition, Adding))]
    return [str(one) for name in names for one in (name, name.with_suffix(".toml"))]


def check_own(out: Path) -> None:
    """Check that chosen poses replace none but those of an older plan.

    Raises:
        InputFileError: there are others.
    """
    there = [out / _OWN, (out / _OWN).with_suffix(".toml")]
    mine = [path for path in there if path.exists()]
    if mine and _OWN not in _wrote(out):
        raise InputFileError.at(
            mine[0],
            f"would be overwritten, but is not part of an older result: no {NAME} next to it says "
            "that it wrote it; expected a new folder or that of an older plan; name one with --out",
        )


def _wrote(out: Path) -> list[object]:
    """``files`` of the older plan in a folder; nothing if there is none that can be read."""
    try:
        older = json.loads((out / NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    files = older.get("files") if isinstance(older, dict) else None
    return files if isinstance(files, list) else []


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
