"""The effects there are: our own, and those that other packages declare as entry points."""

from __future__ import annotations

import difflib
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points

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
from seecr.errors import InputError

BUILT_IN: tuple[type[Effect], ...] = (
    CableLengthOffset, InitialPoseError, DrumGain, LengthScale, DrumEccentricity, Backlash,
    ThermalExpansion, PulleyRadius, ExitPointError, AnchorPointError, Stiffness, CableStiffness,
    NonlinearElasticity, WinchSideLength, CableWeight, Hysteresis, Creep, ExitFriction,
    FrameCompliance, PlatformMass, CentreOfMass, ExternalWrench, GravityTilt, TrackerFrame,
    TrackerTarget, TrackerScale, TensionScale,
)  # fmt: skip


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
    """All effects by name: the built-in ones, then those of entry points ``seecr.effects``."""
    found = {effect.name: effect for effect in BUILT_IN}
    for entry in entry_points(group="seecr.effects"):
        effect = _load(entry)
        if not (isinstance(effect, type) and issubclass(effect, Effect) and effect.name):
            raise InputError(
                f"entry point {entry.name} ({entry.value}) is no effect; expected a subclass of "
                "seecr.effects.Effect with a name"
            )
        if effect.name in found:
            raise InputError(
                f"entry point {entry.name} ({entry.value}) names its effect {effect.name}, which "
                "exists already; expected a name of its own"
            )
        check_class(effect, f"entry point {entry.name} ({entry.value})")
        found[effect.name] = effect
    return found


def effect_named(name: str) -> type[Effect]:
    """The effect of that name.

    Raises:
        InputError: there is none; lists the known ones, nearest first, unless it is a file's name.
    """
    if not isinstance(name, str):
        raise InputError(f"expected the name of an effect, got {name!r}")
    known = catalogue()
    if name in known:
        return known[name]
    if any(mark in name for mark in "./\\"):
        raise InputError(
            f"expected the name of an effect, such as pulley_radius, got {name!r}, which looks "
            "like a file's name"
        )
    near = difflib.get_close_matches(name, known, n=len(known), cutoff=0.0)
    raise InputError(f"no effect {name!r}; known, nearest first: {', '.join(near)}")


def layout_of(effect: type[Effect] | str, robot: GivenRobot) -> Layout:
    """The flat parameters of an effect for a robot.

    Args:
        effect: its name, or its class.
        robot: as described, or its MJCF.

    Raises:
        InputError: neither the name of an effect nor an effect's class.
    """
    kind = effect if isinstance(effect, type) else effect_named(effect)
    if not issubclass(kind, Effect):
        raise InputError(f"expected the name of an effect, or its class, got {effect!r}")
    return Layout.of(kind, robot_of(robot))
