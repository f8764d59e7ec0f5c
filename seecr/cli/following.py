"""The last line of each command: the next one, with its arguments."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from seecr import Commands, LowerEquilibria, Model, Robot, Solution

STDIN = "/dev/stdin"
# In a context's ``meta``: what ``--passive`` and ``--effect`` named, for the command that follows.
_PASSIVE, _EFFECTS = "seecr.passive", "seecr.own_effects"
_SAVED = "INPUT"  # stands for a file that came through a pipe


def _kept(key: str) -> tuple[str, ...]:
    """What the running command keeps of an option; nothing where Python calls it."""
    ctx = click.get_current_context(silent=True)
    return () if ctx is None else tuple(ctx.meta.get(key, ()))


def keep_passive(ctx: click.Context, names: Iterable[str]) -> None:
    """Keep the lines that ``--passive`` names."""
    ctx.meta[_PASSIVE] = tuple(names)


def passive_lines() -> tuple[str, ...]:
    """The lines that ``--passive`` of the running command named."""
    return _kept(_PASSIVE)


def introduce_all(texts: Sequence[str]) -> list[str]:
    """Make the effects of ``FILE.py:CLASS`` part of the catalogue; their names.

    Raises:
        InputError: one that cannot be had, or two of one name.
    """
    from seecr import InputError, introduce
    from seecr.effects.registry import load_effect

    found: dict[str, str] = {}
    for text in texts:
        name = introduce(load_effect(text)).name
        if found.setdefault(name, text) != text:
            raise InputError(
                f"--effect: {found[name]} and {text} are both called {name}; expected a name of "
                "its own for each"
            )
    context = click.get_current_context(silent=True)
    if context is not None and texts:
        context.meta[_EFFECTS] = tuple(dict.fromkeys(texts))
    return list(found)


def given_effects() -> tuple[str, ...]:
    """What ``--effect`` was given to the command that is running, with its option, as words."""
    return tuple(word for text in _kept(_EFFECTS) for word in ("--effect", text))


def following(*words: object) -> str:
    """The line that names a command, as a shell takes it, with ``--passive`` as it was given.

    What came through a pipe is gone: a file stands in its place. Effects of the user's own files
    are named again.
    """
    if words[0] in ("seecr", "crosscheck"):
        passive = passive_lines()
        named = ("--passive", ",".join(passive)) if passive else ()
        words = (*words, *given_effects(), *named)
    if not any(_piped(word) for word in words):
        return f"next: {typed(*words)}"
    line = typed(*(_SAVED if _piped(word) else word for word in words))
    return f"next: {line}  # {_SAVED}: what came through the pipe, saved as a file"


def _piped(word: object) -> bool:
    """Whether a word is a file that can be read only once."""
    if not isinstance(word, Path):
        return False
    return str(word) == STDIN or str(word).startswith(("/dev/fd/", "/proc/")) or word.is_fifo()


def typed(*words: object) -> str:
    """A command as a shell takes it."""
    program, *arguments = (str(word) for word in words)
    return shlex.join([_reached(program), *arguments])


def _reached(program: str) -> str:
    """How a shell reaches a program: by its name or, if need be, beside the one that runs.

    Those of a virtual environment that is not active were called by their path.
    """
    beside = Path(sys.argv[0]).with_name(program)
    is_ours = Path(sys.argv[0]).stem in ("seecr", "crosscheck")
    found = shutil.which(program) is not None
    return str(beside) if is_ours and not found and shutil.which(beside) else program


def given_with(cable: str | None, model: Path | None) -> tuple[object, ...]:
    """Options that the next command needs too."""
    cables = () if cable is None else ("--cable", cable)
    return cables if model is None else (*cables, "--model", model)


def mapping(machine: Robot, robot: Path, cable: str | None, model: Model | None) -> str:
    """The workspace with a model; with one that has a history what maps know of it."""
    from seecr import with_history

    file = None if model is None else model.path
    if model is None or not with_history(machine, model):
        return following("seecr", "map", robot, *given_with(cable, file))
    if machine.n_driven < machine.n_dof:  # each pose is solved for, whatever is asked for
        line = following("seecr", "map", robot, *given_with(cable, None))
        return f"{line}  # without the model: a map knows no history"
    return following("seecr", "map", robot, *given_with(cable, file), "--no-elastic")


def after_pose(
    solution: Solution, robot: Path, turned: Sequence[float], cable: str | None,
    model: Model | None,
) -> str:  # fmt: skip
    """The way there from the reference pose; the workspace, where there is none or no rest."""
    machine, command = solution.robot, solution.command[0]
    start, end = (_numbers(pose[:3]) for pose in (machine.reference_pose, command))
    if start == end or not solution.converged.all():
        return mapping(machine, robot, cable, model)
    way = ("--turned", *_numbers(turned)) if turned else ()
    options = given_with(cable, None if model is None else model.path)
    return following("seecr", "sweep", robot, "--line", *start, *end, *way, *options)


def after_sweep(
    lower: LowerEquilibria, commands: Commands, robot: Path, poses: Path | None,
    cable: str | None, model: Model | None,
) -> str:  # fmt: skip
    """The row with the deepest lower equilibrium by itself, or which one the way there leads to.

    Without one correcting the poses of a file; what measuring told lengths would show; the
    workspace.
    """
    options = given_with(cable, None if model is None else model.path)
    if len(lower.rows):
        if commands.lengths is None and commands.loads is None and commands.temperature is None:
            pose = commands.pose[lower.rows[lower.deepest]]
            numbers = (f"{value + 0.0:.10g}" for value in pose)
            return following("seecr", "pose", robot, *numbers, *options)
        if poses is not None and lower.beside.jumps is None:
            return following("seecr", "sweep", robot, poses, *options, "--follow")
    if poses is None:
        return mapping(lower.beside.robot, robot, cable, model)
    if commands.lengths is None:
        return following("seecr", "correct", robot, poses, *options)
    return following("crosscheck", "plan", robot, poses)


def _numbers(values: Iterable[float]) -> list[str]:
    return [f"{value + 0.0:g}" for value in values]
