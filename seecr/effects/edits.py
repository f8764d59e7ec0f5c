"""A setup as effects leave it, one after the other, and checks of what effects return."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from operator import is_
from threading import Lock

import numpy as np

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import PLACES, Effect, Readings
from seecr.effects.setup import QUANTITIES, Setup, plain_setup
from seecr.errors import InputError, SeecrError
from seecr.pose import Array


def check_class(effect: object, where: str) -> type[Effect]:
    """The class, if it declares an effect as it should.

    Raises:
        InputError: it does not; ``where`` says of which the error speaks.
    """
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise InputError(
            f"{where} is no effect; expected a subclass of seecr.effects.Effect with a name"
        )
    if not isinstance(effect.name, str) or not effect.name.isidentifier():
        raise InputError(
            f"{where} has the name {effect.name!r}; expected letters, digits and underscores, as "
            'in name: ClassVar[str] = "hose"'
        )
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
    return effect


def edit_setup(effect: Effect, setup: Setup) -> None:
    """Let an effect edit a setup; complain in its name about what it leaves there."""
    first = len(setup.laws)
    if is_built_in(type(effect)):
        effect.edit_setup(setup)
        setup.spare_passive()
        return
    setup.own()  # ours put arrays anew; nothing says that others do
    with _told(effect, "edit_setup"):
        effect.edit_setup(setup)
    for name, item in QUANTITIES.items():
        value = _finite(getattr(setup, name), f"effect {effect.name} leaves setup.{name}")
        shape = item.shape_of(setup.robot, len(setup.commands))
        if value.shape != shape:
            raise InputError(
                f"effect {effect.name} leaves setup.{name} of shape {value.shape}; expected {shape}"
            )
    setup.laws[first:] = [_checked_law(law, effect.name) for law in setup.laws[first:]]
    setup.spare_passive()


def edit_readings(effect: Effect, readings: Readings, setup: Setup) -> None:
    """Let an effect edit readings; complain in its name about what it leaves there."""
    if is_built_in(type(effect)):
        effect.edit_readings(readings, setup)
        return
    names = [item.name for item in fields(Readings)]
    before = {name: getattr(readings, name) for name in names}
    unsolved = ~np.isfinite(readings.position).all(axis=1)
    with _told(effect, "edit_readings"):
        effect.edit_readings(readings, setup)
    for name in names:
        value = getattr(readings, name)
        if np.shape(value) != before[name].shape:
            raise InputError(
                f"effect {effect.name} leaves readings.{name} of shape {np.shape(value)}; expected "
                f"{before[name].shape}"
            )
        _finite(value[~unsolved], f"effect {effect.name} leaves readings.{name}")


@contextmanager
def _told(effect: Effect, method: str) -> Iterator[None]:
    """An error in a program of the user's is told in the effect's name, with its line."""
    try:
        yield
    except SeecrError:
        raise
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise InputError(
            f"effect {effect.name}: {method} raises {type(error).__name__}: {error} "
            f"({last.filename}, line {last.lineno})"
        ) from error


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


def setup_with(
    effects: Sequence[Effect], robot: Robot, commands: Commands, wrench: Array | None = None
) -> Setup:
    """The setup of commands as the effects leave it, in their order; see :func:`plain_setup`."""
    setup = plain_setup(robot, commands, wrench)
    for effect in effects:
        edit_setup(effect, setup)
    return setup


class Edits:
    """What effects make of one setup.

    A fit shifts one parameter after the other: what the effects before it left is kept. Threads
    may ask at once.
    """

    def __init__(self, plain: Setup) -> None:
        self._plain = plain
        self._kept: list[tuple[Effect, Setup]] = []
        self._lock = Lock()

    def by(self, effects: Sequence[Effect]) -> Setup:
        """The setup as the effects leave it, in their order."""
        with self._lock:
            return self._by([effect for effect in effects if _edits(type(effect))])

    def _by(self, effects: Sequence[Effect]) -> Setup:
        same = 0
        for (one, _left), effect in zip(self._kept, effects, strict=False):
            if one is not effect:
                break
            same += 1
        setup = (self._kept[same - 1][1] if same else self._plain).shared()
        if same < len(effects) == len(self._kept):
            later = [effect for effect, _left in self._kept[same + 1 :]]
            if all(map(is_, later, effects[same + 1 :])):
                # one effect is shifted: what all leave as they are will be asked for again
                for effect in effects[same:]:
                    edit_setup(effect, setup)
                return setup
        del self._kept[same:]
        for effect in effects[same:]:
            edit_setup(effect, setup)
            self._kept.append((effect, setup))
            setup = setup.shared()
        return setup


def _edits(effect: type[Effect]) -> bool:
    """Whether an effect edits setups; those of the sensors do not."""
    return effect.edit_setup is not Effect.edit_setup
