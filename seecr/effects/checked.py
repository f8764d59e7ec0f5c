"""Effects from other people's packages: what they declare and what they return, checked.

A wrong shape or a NaN would else surface as a pose that does not converge, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import numpy as np

from seecr.effects.base import PLACES, Effect, Readings
from seecr.effects.setup import QUANTITIES, Setup
from seecr.errors import InputError
from seecr.pose import Array


def check_class(effect: type[Effect], where: str) -> None:
    """Check that a class declares an effect as :mod:`seecr.effects.base` says.

    Raises:
        InputError: naming ``where`` it comes from and what is amiss.
    """
    if effect.place not in PLACES:
        raise InputError(
            f"{where}: effect {effect.name} has place {effect.place!r}; expected one of "
            f"{', '.join(PLACES)}"
        )
    if "__dataclass_fields__" not in vars(effect):
        raise InputError(
            f"{where}: effect {effect.name} is no dataclass, so its parameters would be lost; "
            "write @dataclass(frozen=True, eq=False) above the class"
        )
    for item in fields(effect):
        if "unit" not in item.metadata:
            raise InputError(
                f"{where}: effect {effect.name} has a field {item.name} that is no parameter; "
                "expected seecr.effects.parameter(unit, scale, ...)"
            )
    if effect.edit_setup is Effect.edit_setup and effect.edit_readings is Effect.edit_readings:
        raise InputError(
            f"{where}: effect {effect.name} changes nothing; expected it to define edit_setup or "
            "edit_readings"
        )


def edit_setup(effect: Effect, setup: Setup) -> None:
    """Let an effect edit a setup; complain in its name about what it leaves there."""
    first = len(setup.laws)
    if is_built_in(type(effect)):
        effect.edit_setup(setup)
        return
    setup.own()  # ours put arrays anew; nothing says that others do
    effect.edit_setup(setup)
    for name, item in QUANTITIES.items():
        value = _finite(getattr(setup, name), f"effect {effect.name} leaves setup.{name}")
        shape = item.shape_of(setup.robot, len(setup.commands))
        if value.shape != shape:
            raise InputError(
                f"effect {effect.name} leaves setup.{name} of shape {value.shape}; expected {shape}"
            )
    setup.laws[first:] = [_checked_law(law, effect.name) for law in setup.laws[first:]]


def edit_readings(effect: Effect, readings: Readings, setup: Setup) -> None:
    """Let an effect edit readings; complain in its name about what it leaves there."""
    if is_built_in(type(effect)):
        effect.edit_readings(readings, setup)
        return
    names = [item.name for item in fields(Readings)]
    before = {name: getattr(readings, name) for name in names}
    unsolved = ~np.isfinite(readings.position).all(axis=1)
    effect.edit_readings(readings, setup)
    for name in names:
        value = getattr(readings, name)
        if np.shape(value) != before[name].shape:
            raise InputError(
                f"effect {effect.name} leaves readings.{name} of shape {np.shape(value)}; expected "
                f"{before[name].shape}"
            )
        _finite(value[~unsolved], f"effect {effect.name} leaves readings.{name}")


def _checked_law(law: Callable[[Array], Array], name: str) -> Callable[[Array], Array]:
    def checked(strain: Array) -> Array:
        tension = _finite(law(strain), f"effect {name}: its law returns a tension")
        if tension.shape != strain.shape:
            raise InputError(
                f"effect {name}: its law returns tensions of shape {tension.shape}; expected "
                f"{strain.shape}, one for each strain"
            )
        return tension

    return checked


def _finite(value: object, what: str) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (OverflowError, TypeError, ValueError):
        raise InputError(f"{what} that is no number: {value!r:.60}; expected numbers") from None
    if not np.all(np.isfinite(array)):
        raise InputError(f"{what} that is not finite; expected finite numbers")
    return array


def is_built_in(effect: type[Effect]) -> bool:
    """Whether the effect is our own: those are tested, and fits call them often."""
    return effect.__module__.startswith("seecr.effects.")
