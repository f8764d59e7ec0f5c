"""Effects of files of the user's own: ``my_effects.py:Hose``.

The file runs as any program does; it is the user's. Its folder joins Python's path, at the end, so
that the file may import what is beside it, and other processes find the class again.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

from seecr.counted import some
from seecr.effects.base import Effect
from seecr.effects.edits import check_class
from seecr.errors import InputError, InputFileError
from seecr.files import read_text

_EXPECTED = "expected FILE.py:CLASS, such as my_effects.py:Hose"


def load_effect(given: str) -> type[Effect]:
    """The class that ``FILE.py:CLASS`` names; the file is run.

    Raises:
        InputError: not of that form, or the class is no effect, and what it lacks.
        InputFileError: no such file, it cannot be run, or it has no such class.
    """
    file, _colon, name = given.rpartition(":")
    if not file.endswith(".py") or not name.isidentifier():
        if given.endswith(".py") and Path(given).is_file():
            has = _has(_run(Path(given)))
            raise InputError(f"{given}: expected a class after the file, FILE.py:CLASS; {has}")
        raise InputError(f"--effect: {_EXPECTED}, got {given!r}")
    module = _run(Path(file))
    if not hasattr(module, name):
        raise InputFileError.at(file, f"has no class {name}; {_has(module)}")
    return check_class(getattr(module, name), f"{file}: {name}")


def _has(module: ModuleType) -> str:
    """The effects that a file has, in words."""
    own = [
        name
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, Effect) and value is not Effect
    ]
    return f"it has {some(own)}" if own else "it has no subclass of seecr.Effect"


def _run(path: Path) -> ModuleType:
    """The module of a file; run once, however often it is named."""
    text = read_text(path, _EXPECTED)
    here = path.resolve()
    there = sys.modules.get(path.stem)
    taken = there is not None or path.stem in sys.stdlib_module_names
    if there is not None and getattr(there, "__file__", None) == str(here):
        return there
    name = f"{path.stem}_of_effects" if taken else path.stem
    spec = importlib.util.spec_from_file_location(name, here)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    if str(here.parent) not in sys.path:
        sys.path.append(str(here.parent))
    sys.modules[name] = module  # dataclasses look their module up
    try:
        exec(compile(text, str(here), "exec"), vars(module))
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise InputFileError.at(
            path, f"cannot be run: {in_words(error)}", line=line_in(error, str(here))
        ) from error
    return module


def in_words(error: BaseException) -> str:
    """What went wrong in a program of the user's."""
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}{': ' if said else ''}{said}"


def line_in(error: BaseException, file: str) -> int | None:
    """The line of a file at which an error arose."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    return next((f.lineno for f in reversed(frames) if f.filename == file), None)
