"""The last line of each command: the next one, with its arguments."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from seecr import Commands, Solution

Words = tuple[object, ...]


def following(*words: object) -> str:
    """The line that names a command, as a shell takes it."""
    return f"next: {shlex.join(str(word) for word in words)}"


def given_with(cable: str | None, model: Path | None) -> Words:
    """Options that the next command needs too."""
    cables = () if cable is None else ("--cable", cable)
    return cables if model is None else (*cables, "--model", model)


def after_pose(solution: Solution, robot: Path, turned: Sequence[float], options: Words) -> str:
    """The way there from the reference pose; the workspace, where there is none or no rest."""
    machine, command = solution.robot, solution.command[0]
    start, end = (_numbers(pose[:3]) for pose in (machine.reference_pose, command))
    if start == end or not solution.converged.all():
        return following("seecr", "map", robot, *options)
    way = ("--turned", *_numbers(turned)) if turned else ()
    return following("seecr", "sweep", robot, "--line", *start, *end, *way, *options)


def after_sweep(commands: Commands, robot: Path, poses: Path | None, options: Words) -> str:
    """Correcting the poses of a file; what measuring told lengths would show; the workspace."""
    if poses is None:
        return following("seecr", "map", robot, *options)
    if commands.lengths is None:
        return following("seecr", "correct", robot, poses, *options)
    return following("crosscheck", "plan", robot, poses)


def _numbers(values: Iterable[float]) -> list[str]:
    return [f"{value + 0.0:g}" for value in values]
