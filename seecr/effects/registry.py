"""The effects there are: our own, those of entry points, and those that a user's program gives.

The catalogue is what a diagnosis considers: our own effects, those that installed packages declare,
and those that were introduced. A class that a function was given, or an instance of it, is known by
its name from then on, as in a model's file, but is considered only where it is given again.
"""

from __future__ import annotations

import difflib
import importlib.util
import sys
import traceback
from collections.abc import Collection
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

from seecr.counted import some
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.effects.actuation import (
    Backlash,
    CableLengthOffset,
    DrumEccentricity,
    DrumGain,
    InitialPoseError,
    LengthScale,
    ThermalExpansion,
)
from seecr.effects.base import Effect, Layout
from seecr.effects.cable import (
    CableStiffness,
    CableWeight,
    Creep,
    ExitFriction,
    Hysteresis,
    NonlinearElasticity,
    Stiffness,
    WinchSideLength,
)
from seecr.effects.edits import check_class
from seecr.effects.geometry import AnchorPointError, ExitPointError, FrameCompliance, PulleyRadius
from seecr.effects.load import CentreOfMass, ExternalWrench, GravityTilt, PlatformMass
from seecr.effects.sensing import TensionScale, TrackerFrame, TrackerScale, TrackerTarget
from seecr.errors import InputError, InputFileError
from seecr.files import read_text

BUILT_IN: tuple[type[Effect], ...] = (
    CableLengthOffset, InitialPoseError, DrumGain, LengthScale, DrumEccentricity, Backlash,
    ThermalExpansion, PulleyRadius, ExitPointError, AnchorPointError, Stiffness, CableStiffness,
    NonlinearElasticity, WinchSideLength, CableWeight, Hysteresis, Creep, ExitFriction,
    FrameCompliance, PlatformMass, CentreOfMass, ExternalWrench, GravityTilt, TrackerFrame,
    TrackerTarget, TrackerScale, TensionScale,
)  # fmt: skip

GivenEffect: TypeAlias = str | type[Effect] | Effect
"""An effect by its name, its class or an instance of it."""

# Effects that a user's program introduced to the catalogue, and those that it gave to a function.
_introduced: dict[str, type[Effect]] = {}
_given: dict[str, type[Effect]] = {}


def _load(entry: EntryPoint) -> object:
    """What an entry point names, or one line about why it cannot be had."""
    try:
        return entry.load()
    except (ImportError, AttributeError, SyntaxError) as error:
        raise InputError(
            f"entry point {entry.name} ({entry.value}) cannot be loaded: {error}; correct the "
            "package that declares it, or uninstall it"
        ) from error


@lru_cache(maxsize=1)
def catalogue() -> dict[str, type[Effect]]:
    """All effects by name: the built-in ones, those of entry points ``seecr.effects``, and those
    that were introduced.
    """
    found = {effect.name: effect for effect in BUILT_IN}
    for entry in entry_points(group="seecr.effects"):
        where = f"entry point {entry.name} ({entry.value})"
        effect = check_class(_load(entry), where)
        if effect.name in found:
            raise _taken(effect, where)
        found[effect.name] = effect
    return {**found, **_introduced}


def _taken(effect: type[Effect], where: str) -> InputError:
    return InputError(
        f"{where} names its effect {effect.name}, which exists already; expected a name of its own"
    )


def introduce(effect: type[Effect]) -> type[Effect]:
    """Make an effect of one's own part of the catalogue, as an installed package does.

    It holds for this process; in a program of one's own it may stand above the class, over
    ``@dataclass``. A class of the same name that was introduced before is replaced.

    Args:
        effect: a subclass of :class:`seecr.Effect`.

    Returns:
        the same class.

    Raises:
        InputError: no effect, or one with the name of an effect that is built in or installed.

    Example:
        ``seecr.introduce(Hose)``
    """
    kind = check_class(effect, _named(effect))
    there = catalogue().get(kind.name)
    if there is not None and there is not kind and kind.name not in _introduced:
        raise _taken(kind, _named(kind))
    _introduced[kind.name] = _given[kind.name] = kind
    catalogue.cache_clear()
    return kind


def _named(given: object) -> str:
    """A class in words."""
    return f"class {getattr(given, '__name__', None) or repr(given)}"


def class_of(given: GivenEffect) -> type[Effect]:
    """The class of an effect, which is known by its name from now on.

    Raises:
        InputError: no effect of that name, something else than an effect, or a class of one's own
            with the name of an effect of the catalogue.
    """
    if isinstance(given, str):
        return effect_named(given)
    kind = given if isinstance(given, type) else type(given)
    there = catalogue().get(kind.name) if issubclass(kind, Effect) else None
    if kind is there:
        return kind
    if not isinstance(given, type) and not isinstance(given, Effect):
        raise InputError(
            f"expected the name of an effect, got {given!r:.60}; its class or an instance will do"
        )
    kind = check_class(kind, _named(kind))
    if there is not None and kind.name not in _introduced:
        raise _taken(kind, _named(kind))
    _given[kind.name] = kind
    return kind


def known() -> dict[str, type[Effect]]:
    """The catalogue, and further effects that functions were given, by name."""
    return {**_given, **catalogue()}


def considered_of(names: Collection[str]) -> list[type[Effect]]:
    """The effects of the catalogue, and those of one's own that are among names."""
    every = catalogue()
    return [*every.values(), *(e for n, e in _given.items() if n in names and n not in every)]


def effect_named(name: str) -> type[Effect]:
    """The effect of that name.

    Args:
        name: such as ``"pulley_radius"``.

    Returns:
        its class.

    Raises:
        InputError: there is none; lists the known ones, nearest first, unless it is a file's name.

    Example:
        ``seecr.effect_named("pulley_radius").by_hand()``
    """
    if not isinstance(name, str):
        raise InputError(f"expected the name of an effect, got {name!r}")
    every = known()
    if name in every:
        return every[name]
    if any(mark in name for mark in "./\\"):
        raise InputError(
            f"expected the name of an effect, such as pulley_radius, got {name!r}, which looks "
            "like a file's name" + ("; --effect names it" if ".py" in name else "")
        )
    near = difflib.get_close_matches(name, every, n=len(every), cutoff=0.0)
    own = "; one of your own is known by --effect FILE.py:CLASS, or in Python by seecr.introduce"
    is_misspelt = bool(difflib.get_close_matches(name, every))
    raise InputError(
        f"no effect {name!r}; known, nearest first: {', '.join(near)}{'' if is_misspelt else own}"
    )


def layout_of(effect: GivenEffect, robot: GivenRobot) -> Layout:
    """The flat parameters of an effect for a robot.

    Args:
        effect: its name, its class, or an instance of it.
        robot: as described, or its MJCF.

    Returns:
        names, units, expected sizes and bounds of its p parameters.

    Raises:
        InputError: neither the name of an effect nor an effect.

    Example:
        ``seecr.layout_of("pulley_radius", robot).scale``
    """
    kind = effect if isinstance(effect, type) else class_of(effect)
    if not issubclass(kind, Effect):
        raise InputError(f"expected the name of an effect, or its class, got {effect!r}")
    return Layout.of(kind, robot_of(robot))


# Effects of files of the user's own: ``my_effects.py:Hose``.
#
# The file runs as any program does; it is the user's. Its folder joins Python's path, at the end,
# so that the file may import what is beside it, and other processes find the class again.

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
