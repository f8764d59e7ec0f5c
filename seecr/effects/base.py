"""What an effect is: a few numbers, and one method that brings them into the model.

An effect is a small frozen dataclass. Its fields are its parameters, made with
:func:`parameter`; at their null values the effect is absent, exactly. It overrides one of two
methods, or both:

- ``edit_setup`` changes numbers the statics uses: lengths, points, masses ... (see
  :class:`seecr.effects.setup.Setup`, whose ``laws`` also take a cable's extra tension by its
  strain);
- ``edit_readings`` changes what the sensors report of the solved pose.

Sensitivities need no derivatives from it: the framework differences the edit, not the solve.
An effect of your own goes through the entry point group ``seecr.effects`` (docs/effects.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from seecr.arguments import numbers
from seecr.commands import Commands
from seecr.counted import counted, some
from seecr.description.robot import Robot
from seecr.effects.setup import Setup
from seecr.errors import InputError
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Of p parameters: which are never fitted, and which somebody measured independently.

    Attributes:
        fixed: (p,) bool: stays as it is in every fit.
        value: (p,) measured independently, each in its unit; NaN where nobody did.
        stderr: (p,) standard error of that; inf where nobody did.
    """

    fixed: NDArray[np.bool_]
    value: Array
    stderr: Array

    @classmethod
    def nothing(cls, count: int) -> Knowledge:
        """Of so many parameters, nothing."""
        return cls(np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.inf))

    @classmethod
    def joined(cls, parts: Sequence[Knowledge]) -> Knowledge:
        """Of several effects' parameters, one after another."""
        whole = [cls.nothing(0), *parts]
        columns = zip(*((p.fixed, p.value, p.stderr) for p in whole), strict=True)
        return cls(*map(np.concatenate, columns))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(p,) whether a fit is to take what was measured as a reading."""
        return np.asarray(np.isfinite(self.stderr) & ~self.fixed)

    @property
    def any(self) -> bool:
        """Whether anything is known."""
        return bool(np.any(self.fixed) or np.any(self.measured))


@dataclass(frozen=True)
class Total:
    """A number as it can be measured on the robot, with the effect and as the robot's file has it.

    What is possible lies between ``lower`` and ``upper``; the unit is that of CSV columns.
    """

    value: float
    nominal: float
    unit: str
    lower: float = -np.inf
    upper: float = np.inf

    @property
    def possible(self) -> bool:
        """Whether a robot can have it."""
        return bool(self.lower < self.value < self.upper)


Scale = float | Callable[[Robot], float]
PLACES = ("actuation", "geometry", "cable", "structure", "load", "sensing")
_AXES = ("x", "y", "z")
# Components of a parameter, by what each is called.
_SIZES: dict[str, Callable[[int], list[str]]] = {
    "one": lambda m: [""],
    "cable": lambda m: [f"_{i + 1}" for i in range(m)],
    "spring": lambda m: [f"_{i + 1}" for i in range(m)],
    "vector": lambda m: [f"_{a}" for a in _AXES],
    "point": lambda m: [f"_{i + 1}_{a}" for i in range(m) for a in _AXES],
}
# Lines that have a component, where not all have.
_HAVE: dict[str, Callable[[Robot], NDArray[np.bool_]]] = {
    "cable": lambda robot: robot.driven,
    "spring": lambda robot: robot.ea > 0.0,
}


@dataclass(eq=False)
class Readings:
    """What the sensors report of n solved rows; effects edit it in place.

    Attributes:
        position: (n, 3) [m]; quat_wxyz: (n, 4); tensions: (n, m) [N].
    """

    position: Array
    quat_wxyz: Array
    tensions: Array


def parameter(
    unit: str,
    scale: Scale,
    *,
    null: float = 0.0,
    bounds: tuple[Scale, Scale] = (-np.inf, np.inf),
    size: str = "one",
    shape: bool = False,
) -> Any:
    """A field of an effect.

    Args:
        unit: as in the suffixes of CSV columns, such as "m" or "rad"; "" for none.
        scale: expected size, one standard deviation from tolerances or data sheets; a number
            or a function of the robot, whose ``words`` are told where there is no robot.
        null: value at which the effect is absent.
        bounds: lowest and highest value, numbers or functions of the robot.
        size: "one" number, one per "cable" on a winch or per "spring" (cables and passive lines,
            but those of constant tension), a "vector" of 3, or a "point" (3 per line); what a
            cable has of its own acts on that cable alone. The effect's array has one for every
            line, null for those without.
        shape: the number only shapes the effect (a time constant, a period): it means nothing
            while the others are null, and the effect says with ``shapes`` where to look.

    Returns:
        the field, for a dataclass.

    Example:
        ``seecr.parameter("m", 0.01, bounds=(0.0, 0.1))``
    """
    _check_parameter(unit, scale, null, bounds, size)
    metadata = dict(unit=unit, scale=scale, null=null, bounds=bounds, size=size, shape=shape)
    return field(default=None if size != "one" else null, metadata=metadata)


def _check_parameter(
    unit: str, scale: Scale, null: float, bounds: tuple[Scale, Scale], size: str
) -> None:
    if not isinstance(unit, str):
        raise InputError(f'unit must be a text such as "m", or "" for none, got {unit!r}')
    if size not in _SIZES:
        raise InputError(f"size must be one of {', '.join(_SIZES)}, got {size!r}")
    if not callable(scale) and not (np.isfinite(scale) and scale > 0):
        raise InputError(
            f"scale must be a positive number or a function of the robot, got {scale!r}"
        )
    if len(bounds) != 2:
        raise InputError(f"bounds must be (lowest, highest), got {bounds!r}")
    lower, upper = (b if not callable(b) else None for b in bounds)
    if (lower is not None and not lower <= null) or (upper is not None and not null <= upper):
        raise InputError(f"bounds must hold the null value {null!r}, got {bounds!r}")


@dataclass(frozen=True, eq=False)
class Effect:
    """Base of all effects; see the module's text.

    Class attributes:
        name: as in model files and reports.
        place: one of PLACES; says where to look.
        title: what it is, in a few words.
        needs: what the data must have: any of "time", "temperature", "poses" (commands in
            poses), "tensions".
        parent: an effect that this one only makes sense beside or contains, or "".
        anew: what may have other values of it: each "file", each "run" (a tracker that was set up
            anew, winches homed before each run), or nothing.
        advice: how to measure it on its own, and after a colon what to expect. ``{name}`` is
            filled with a parameter in millimetres or degrees where those are its units,
            ``{largest}`` and ``{which}`` with the parameter that is the most expected sizes from
            null, and others by :meth:`totals`.
        renamed: of parameters in model files written before: each old key, and those that have
            its value now.
    """

    name: ClassVar[str] = ""
    place: ClassVar[str] = ""
    title: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    parent: ClassVar[str] = ""
    anew: ClassVar[tuple[str, ...]] = ()
    advice: ClassVar[str] = ""
    renamed: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    @classmethod
    def by_hand(cls) -> str:
        """The check that ``advice`` names, without what to expect of it."""
        return cls.advice.split(":")[0]

    def edit_setup(self, setup: Setup) -> None:
        """Change numbers of the setup, in place."""

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        """Change what the sensors report, in place."""

    def totals(self, robot: Robot) -> dict[str, Total]:
        """What a person would measure, where the parameters are differences or may be impossible.

        By the names that ``advice`` has: ``{mass}`` and ``{mass_nominal}``. Those that are named
        as a parameter is, such as ``offset_3_m``, are ``{total}`` and ``{total_nominal}`` where
        that parameter is ``{which}``.
        """
        return {}

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        """Values of the shape parameters to start a search from."""
        return [{}]


@dataclass(frozen=True, eq=False)
class _Part:
    """A field of an effect: the places (k,) that are parameters, of ``width`` with null values.

    ``where`` they stand among all parameters.
    """

    name: str
    size: str
    places: NDArray[np.intp]
    width: int
    null: float
    where: slice

    @property
    def count(self) -> int:
        return len(self.places)

    def whole(self, values: Array) -> Array:
        """The field's array (width,) with these parameters (k,)."""
        if self.count == self.width:
            return values.copy()
        out = np.full(self.width, self.null)
        out[self.places] = values
        return out


@dataclass(frozen=True, eq=False, repr=False)
class Layout:
    """An effect's parameters for one robot, as one flat vector.

    Attributes:
        effect: the class.
        names: (p,) keys such as ``radius_m`` or ``offset_3_m``.
        units: (p,) null, lower, upper, scale: (p,) arrays. shape: (p,) bool.
    """

    effect: type[Effect]
    names: tuple[str, ...]
    units: tuple[str, ...]
    null: Array
    lower: Array
    upper: Array
    scale: Array
    shape: np.ndarray
    _parts: tuple[_Part, ...]

    @classmethod
    def of(cls, effect: type[Effect], robot: Robot) -> Layout:
        """The flat parameters of an effect for a robot."""
        rows: list[tuple[Any, ...]] = []
        parts = []
        for item in fields(effect):
            meta = item.metadata
            suffix = f"_{meta['unit']}" if meta["unit"] else ""
            every = _SIZES[meta["size"]](robot.n_cables)
            have = _HAVE.get(meta["size"])
            places = np.arange(len(every)) if have is None else np.flatnonzero(have(robot))
            endings = [every[k] for k in places]
            given = (meta["null"], *meta["bounds"], meta["scale"])
            numbers = [float(one(robot) if callable(one) else one) for one in given]
            # a shape starts where it may be: bounds go with the robot's size
            if meta["shape"]:
                numbers[0] = min(max(numbers[0], numbers[1]), numbers[2])
            own = (meta["unit"], *numbers, meta["shape"])
            where = slice(len(rows), len(rows) + len(endings))
            rows += [(f"{item.name}{ending}{suffix}", *own) for ending in endings]
            parts.append(_Part(item.name, meta["size"], places, len(every), numbers[0], where))
        columns: list[Any] = list(zip(*rows, strict=True)) or [()] * 7
        names, units, *values, shape = columns
        null, lower, upper, scale = (np.array(value, float) for value in values)
        shaped = np.array(shape, dtype=bool)
        return cls(effect, names, units, null, lower, upper, scale, shaped, tuple(parts))

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"Layout({self.effect.name}: {some(self.names)})"

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    def count(self, field: str) -> int:
        """How many numbers a field of the effect has."""
        return next(part.count for part in self._parts if part.name == field)

    @property
    def cable_by_cable(self) -> list[NDArray[np.intp]]:
        """Parameters that every cable has one of, in their order: one (m,) index array each."""
        apart = {"cable": 1, "spring": 1, "point": len(_AXES)}
        return [
            np.arange(part.where.start + k, part.where.stop, apart[part.size])
            for part in self._parts
            for k in range(apart.get(part.size, 0))
            if part.count == part.width
        ]

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the components of each parameter that has several, by its own: ``shift_m``."""
        out = {}
        for part in self._parts:
            if part.size != "one" and part.count:
                unit = self.units[part.where.start]
                key = f"{part.name}_{unit}" if unit else part.name
                out[key] = self.names[part.where]
        return out

    def build(self, vector: Array) -> Effect:
        """The effect with these parameters."""
        values: dict[str, Any] = {}
        for part in self._parts:
            own = np.asarray(vector[part.where], float)
            values[part.name] = float(own[0]) if part.size == "one" else part.whole(own)
        return self.effect(**values)

    def vector_of(self, effect: Effect) -> Array:
        """Parameters (p,) of an instance of the effect; null where it has none.

        Raises:
            InputError: something else than numbers, or another number of them.
        """
        vector = self.null.copy()
        for part in self._parts:
            value = getattr(effect, part.name)
            if value is not None:
                array = numbers(value, f"effect {self.name}: {part.name}").ravel()
                if len(array) == part.width:  # passive lines have no parameter
                    array = array[part.places]
                if len(array) != part.count:
                    raise InputError(
                        f"effect {self.name}: {part.name}: expected "
                        f"{counted(part.count, 'number')}, got {len(array)}"
                    )
                vector[part.where] = array
        return vector

    def start(self, shape: dict[str, float]) -> Array:
        """Null values, with the shape parameters set."""
        vector = self.null.copy()
        for part in self._parts:
            if part.name in shape:
                vector[part.where] = shape[part.name]
        return vector


def mean_length(robot: Robot) -> float:
    """Mean straight cable length [m] at the reference pose: the scale of lengths."""
    return float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))


@dataclass(frozen=True)
class OfRobot:
    """An expected size, or a bound, that depends on the robot.

    Attributes:
        words: the formula, such as "2 % of the mean cable length".
        value: the number for a robot, in SI.
    """

    words: str
    value: Callable[[Robot], float]

    def __call__(self, robot: Robot) -> float:
        return self.value(robot)


def of_length(part: float) -> OfRobot:
    """An expected size that is a part of the mean cable length."""
    words = f"{100.0 * part:g} % of the mean cable length"
    return OfRobot(words, lambda robot: part * mean_length(robot))


# Limits of values without physical bounds, far beyond what a robot can have: they stop typing
# errors, other units and damaged files, whose squares the solver could not even compute.
# A value may differ from null by so many expected sizes, an angle by one full turn. What a tracker
# reads may be in the coordinates of its hall.
_LARGEST_SIZE, _LARGEST_READ, _TURN = 1e4, 1e5, 2.0 * np.pi


def range_of(layout: Layout, i: int) -> tuple[float, float]:
    """The lowest and the highest value that parameter i may have."""
    lower, upper = float(layout.lower[i]), float(layout.upper[i])
    if layout.shape[i]:  # its bounds are its search range
        return lower, upper
    sizes = _LARGEST_READ if layout.effect.place == "sensing" else _LARGEST_SIZE
    most = _TURN if layout.units[i] == "rad" else sizes * float(layout.scale[i])
    null = float(layout.null[i])
    return max(lower, null - most), min(upper, null + most)


def beyond(layout: Layout, i: int, value: float) -> str:
    """What is wrong with a value that parameter i cannot have; "" if nothing is."""
    low, high = range_of(layout, i)
    if low <= value <= high:
        return ""
    return f"{value:g} is out of bounds; expected {low:g} to {high:g}"


# What commands may lack: as an effect names it, and its column in a file.
_COLUMNS = {"time": "t_s", "temperature": "temperature_C"}


def unfed(effects: Iterable[Effect], commands: Commands) -> tuple[str, ...]:
    """A sentence for each of some effects that is left out for want of times or temperatures."""
    return tuple(
        f"{effect.name} is left out: it needs the {need} of every command "
        f"(Commands.{need}, or column {column} of a file), and there is none"
        for effect in effects
        for need, column in _COLUMNS.items()
        if need in effect.needs and getattr(commands, need) is None and not _absent(effect)
    )


def _absent(effect: Effect) -> bool:
    """Whether an effect's values are those at which it is none."""
    own = [f for f in fields(effect) if "null" in f.metadata and not f.metadata["shape"]]
    values = [(getattr(effect, f.name), f.metadata["null"]) for f in own]
    return all(value is None or bool(np.all(value == null)) for value, null in values)
