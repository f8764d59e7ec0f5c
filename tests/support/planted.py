"""Faults planted in the code itself: one piece of a module's text becomes another.

Only the changed functions get new code, in place, so that whoever imported them runs it too.
Compiled functions run as plain Python meanwhile: nothing is compiled, and nothing cached.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

import seecr.compiled
from seecr.compiled import cable

COMPILED = "seecr.compiled."


def run_in_python(patch: pytest.MonkeyPatch) -> None:
    """Let every compiled function run as the Python that it is written in."""
    for found in pkgutil.iter_modules(seecr.compiled.__path__):
        importlib.import_module(COMPILED + found.name)
    called, law = cable.cable_pull, cable._pull
    for module in [
        m for name, m in sys.modules.items() if name.startswith(("seecr", "crosscheck"))
    ]:
        for name, value in list(vars(module).items()):
            if isinstance(value, Dispatcher):
                # the law of a cable is called by its address, which Python cannot do
                run = law if value is called else value
                patch.setattr(module, name, run.py_func)


def plant(patch: pytest.MonkeyPatch, name: str, old: str, new: str) -> None:
    """Replace a piece of the text of a module, which must stand there once."""
    module = importlib.import_module(name)
    assert module.__file__ is not None
    path = Path(module.__file__)
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path.name}: expected {old!r} once, got {text.count(old)} times"
    before, after = (compile(t, path, "exec") for t in (text, text.replace(old, new)))
    assert plant_code(patch, module, before, after), f"{path.name}: {old!r} is in no function"


def plant_code(
    patch: pytest.MonkeyPatch, module: ModuleType, before: CodeType, after: CodeType
) -> list[str]:
    """Give the functions of a module that differ their code of ``after``; says which."""
    was, now = _functions(before), _functions(after)
    changed = [key for key in was if was[key].co_code != now[key].co_code
               or was[key].co_consts != now[key].co_consts
               or was[key].co_names != now[key].co_names]  # fmt: skip
    return [key for key in changed if _set_code(patch, module, key, now[key])]


def _functions(code: CodeType, place: str = "") -> dict[str, CodeType]:
    """Code of the functions and methods of a module, by qualified name; their parts are theirs."""
    found = {}
    for one in code.co_consts:
        if not isinstance(one, CodeType) or one.co_name.startswith("<"):
            continue
        if one.co_flags & 0x2:  # CO_NEWLOCALS: a function, not the body of a class
            found[place + one.co_name] = one
        else:
            found |= _functions(one, f"{place}{one.co_name}.")
    return found


def _set_code(patch: pytest.MonkeyPatch, module: ModuleType, key: str, code: CodeType) -> bool:
    owner: Any = module
    *classes, name = key.split(".")
    for one in classes:
        owner = getattr(owner, one)
    value = vars(owner).get(name)
    for wrapped in ("fget", "func", "__func__", "py_func", "__wrapped__"):
        value = getattr(value, wrapped, value)
    own: CodeType | None = getattr(value, "__code__", None)
    if own is None or own.co_filename != code.co_filename:  # an Enum has another's __new__
        return False
    patch.setattr(value, "__code__", code)
    return True
