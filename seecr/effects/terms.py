"""Effects with values: one of them, and the ordered collection of them that makes a model."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import finite
from seecr.counted import some
from seecr.description.mjcf import GivenRobot
from seecr.description.robot import Robot
from seecr.effects.base import Effect, Knowledge, Layout, Readings, Total, beyond
from seecr.effects.registry import GivenEffect, catalogue, class_of, layout_of
from seecr.effects.setup import Setup
from seecr.errors import InputError
from seecr.pose import Array
from seecr.units import parameter_name, shown

# An effect with values of its own for each file or run.
#
# A tracker that is set up anew every day, a platform that is placed by hand before each run: one
# set of values would be wrong for all. In a model's file such an effect says `per_file = true` or
# `per_run = true`; its own values stand with the names of the files or runs that they are of, and
# those of no file in particular are what a further one is expected to have.

KINDS = ("file", "run")
"""What an effect may have values of its own for."""


@dataclass(frozen=True, eq=False)
class Values:
    """An effect's parameters (p,) for one file or run, their standard errors and what is known."""

    vector: Array
    stderr: Array
    knowledge: Knowledge


@dataclass(frozen=True, eq=False)
class Own:
    """Values of an effect for each file or run that a model knows.

    Attributes:
        kind: "file" or "run". values: by their names.

    Raises:
        InputError: another kind.
    """

    kind: str
    values: Mapping[str, Values]

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            words = " or ".join(map(repr, KINDS))
            raise InputError(f"values of an effect's own are per {words}, got {self.kind!r}")


@dataclass(frozen=True, eq=False)
class Apart(Effect):
    """Effects of one kind for several files or runs.

    Where nobody takes rows apart it is what it is in ``rest``, which has no file in particular.
    """

    rest: Effect = field(default_factory=Effect)
    kind: str = "file"
    parts: Mapping[str, Effect] = field(default_factory=dict)

    def at(self, name: str) -> Effect:
        """The effect in a file or run."""
        return self.parts.get(name, self.rest)

    def edit_setup(self, setup: Setup) -> None:
        self.rest.edit_setup(setup)

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        self.rest.edit_readings(readings, setup)

    def totals(self, robot: Robot) -> dict[str, Total]:
        return {
            f"{name}: {key}": total
            for name, part in self.parts.items()
            for key, total in part.totals(robot).items()
        }


@dataclass(frozen=True, eq=False, repr=False)
class ApartLayout(Layout):
    """The parameters of an effect for several files or runs, one after the other.

    Attributes:
        base: those of one. kind: "file" or "run". parts: names of the files or runs.
        rest: (p,) values wherever else.
    """

    base: Layout
    kind: str
    parts: tuple[str, ...]
    rest: Array

    @property
    def cable_by_cable(self) -> list[NDArray[np.intp]]:
        own = self.base.cable_by_cable
        return [k * len(self.base) + group for k in range(len(self.parts)) for group in own]

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        return {
            f"{part}: {whole}": tuple(f"{part}: {key}" for key in keys)
            for part in self.parts
            for whole, keys in self.base.groups.items()
        }

    def part(self, name: str) -> slice:
        """Where the parameters of a file or run stand."""
        first = self.parts.index(name) * len(self.base)
        return slice(first, first + len(self.base))

    def build(self, vector: Array) -> Effect:
        parts = {name: self.base.build(vector[self.part(name)]) for name in self.parts}
        return Apart(self.base.build(self.rest), self.kind, parts)

    def start(self, shape: dict[str, float]) -> Array:
        return np.tile(self.base.start(shape), len(self.parts))


def apart(base: Layout, kind: str, parts: tuple[str, ...], rest: Array) -> ApartLayout:
    """A layout for several files or runs; names of parameters begin with those of these."""

    def times(values: Any) -> Any:
        return np.tile(values, len(parts))

    return ApartLayout(
        base.effect,
        tuple(f"{part}: {key}" for part in parts for key in base.names),
        base.units * len(parts),
        times(base.null), times(base.lower), times(base.upper), times(base.scale),
        times(base.shape), (), base, kind, parts, rest,
    )  # fmt: skip


# Default of a field that __post_init__ makes from the others when it is not given.
_FILLED_IN: Any = None


@dataclass(frozen=True, eq=False, repr=False)
class Term:
    """An effect with values: ``layout`` says which, ``vector`` (p,) how much.

    ``knowledge`` says which values no fit may move and which were measured independently; ``own``
    has the values for files or runs that have their own, None where all have the same.
    """

    layout: Layout
    vector: Array
    knowledge: Knowledge = _FILLED_IN
    own: Own | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.layout, Layout):
            raise InputError(
                f"Term: expected an effect's layout and its values, got {self.layout!r}; "
                "seecr.Term.of(robot, 'pulley_radius', radius_m=0.01) makes one of a name"
            )
        given: Any = self.knowledge
        if given is None:
            object.__setattr__(self, "knowledge", Knowledge.nothing(len(self.layout)))

    @classmethod
    def of(cls, robot: GivenRobot, name: GivenEffect, **values: float) -> Term:
        """An effect by its name, with some parameters; the others are at null.

        Args:
            robot: that it is for, or its MJCF.
            name: of the effect, such as ``"pulley_radius"``; also its class, or an instance, whose
                parameters it then has.
            values: by the parameters' names, such as ``radius_m=0.01`` or ``gain_3=0.002``.

        Raises:
            InputError: no such effect, no such parameter, or a value that no robot has.
        """
        layout = layout_of(class_of(name), robot)
        vector = layout.null.copy()
        if isinstance(name, Effect):
            vector = layout.vector_of(name)
            for k, value in enumerate(vector):
                _within(layout, k, value)
        for key, value in values.items():
            k = _place_of(layout, key)
            vector[k] = _within(layout, k, value)
        return cls(layout, vector)

    def __repr__(self) -> str:
        """The effect with its first few values, in the units that people read."""
        layout = self.layout
        rows = zip(layout.names, layout.units, self.vector, strict=True)
        values = [
            f"{parameter_name(key, unit)} = {shown(value, unit)}" for key, unit, value in rows
        ]
        return f"{self.name}: {some(values)}"

    def with_vector(self, values: Array) -> Term:
        """The same effect with other values (p,); what is known of them stays."""
        return Term(self.layout, values, self.knowledge, self.own)

    def fixed(self, *names: str) -> Term:
        """The same, its values never to be fitted: those of the named parameters, or all.

        Raises:
            InputError: no such parameter.
        """
        held = self.knowledge.fixed.copy()
        held[[_place_of(self.layout, name) for name in names or self.layout.names]] = True
        return replace(self, knowledge=replace(self.knowledge, fixed=held))

    def measured(self, **values: tuple[float, float]) -> Term:
        """The same, some parameters measured independently: a reading in every fit.

        Args:
            values: (value, standard error) by the parameters' names; fits start at the value.

        Raises:
            InputError: no such parameter, a value that no robot has, or an error that is not above
                zero.
        """
        vector, known = self.vector.copy(), self.knowledge
        value, stderr = known.value.copy(), known.stderr.copy()
        for key, (number, error) in values.items():
            if not (np.isfinite(error) and error > 0.0):
                raise InputError(
                    f"effect {self.name}: {key}: expected a standard error above 0, got {error!r}"
                )
            k = _place_of(self.layout, key)
            vector[k] = value[k] = _within(self.layout, k, number)
            stderr[k] = error
        return replace(self, vector=vector, knowledge=replace(known, value=value, stderr=stderr))

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.layout.name

    @property
    def sizes(self) -> Array:
        """(p,) z = (value - null)/scale: how many expected sizes the values are from null."""
        return (self.vector - self.layout.null) / self.layout.scale

    def effect(self) -> Effect:
        """The effect itself."""
        return self._effect

    @cached_property
    def _effect(self) -> Effect:
        return self.layout.build(self.vector)

    def is_possible(self, robot: Robot) -> bool:
        """Whether the robot can have it: no negative mass, no wheel larger than its cable."""
        return all(total.possible for total in self.effect().totals(robot).values())


def _within(layout: Layout, k: int, value: float) -> float:
    """A value within the limits of parameter k."""
    name = layout.names[k]
    array = finite(value, name)
    if array.ndim:
        raise InputError(f"{name}: expected one number, got an array of shape {array.shape}")
    number = float(array)
    if wrong := beyond(layout, k, number):
        raise InputError(f"effect {layout.name}: {name}: {wrong}")
    return number


def _place_of(layout: Layout, key: str) -> int:
    """The number of a parameter."""
    if key not in layout.names:
        near = difflib.get_close_matches(key, layout.names, n=3, cutoff=0.0)
        raise InputError(
            f"effect {layout.name}: no parameter {key}; the nearest "
            f"{'is' if len(near) == 1 else 'are'} {', '.join(near)}"
        )
    return layout.names.index(key)


class Terms:
    """The effects of a model with their values, in the order in which they act.

    That order is the catalogue's; effects that it does not know come last. The parameters of all
    terms count through as one vector: ``len`` is their number p, and every array of a collection
    is (p,). Iterating gives the terms. Nothing changes in place; every change is a new collection.
    """

    def __init__(self, terms: Iterable[Term] = ()) -> None:
        """Put terms in order.

        Raises:
            InputError: an effect is there twice.
        """
        place = {name: i for i, name in enumerate(catalogue())}
        self._terms = tuple(sorted(terms, key=lambda t: place.get(t.name, len(place))))
        for name in self.names:
            if self.names.count(name) > 1:
                raise InputError(f"effect {name} is among the terms twice; expected it once")

    def __iter__(self) -> Iterator[Term]:
        return iter(self._terms)

    def __len__(self) -> int:
        return sum(len(term.layout) for term in self._terms)

    def __bool__(self) -> bool:
        return bool(self._terms)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Term:
        """The term of an effect, by its name."""
        return self._terms[self._place(name)]

    def __repr__(self) -> str:
        return f"Terms({', '.join(self.names)})"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(term.name for term in self._terms)

    @cached_property
    def labels(self) -> tuple[tuple[str, str], ...]:
        """Of every parameter: the effect's name and its own, such as ("drum_gain", "gain_3")."""
        return tuple((term.name, key) for term in self._terms for key in term.layout.names)

    @property
    def effects(self) -> list[Effect]:
        """The effects themselves."""
        return [term.effect() for term in self._terms]

    @cached_property
    def vector(self) -> Array:
        """(p,) values, each in its own unit."""
        return _joined([term.vector for term in self._terms])

    @cached_property
    def null(self) -> Array:
        """(p,) values at which the effects are absent."""
        return _joined([term.layout.null for term in self._terms])

    @cached_property
    def scale(self) -> Array:
        """(p,) expected sizes."""
        return _joined([term.layout.scale for term in self._terms])

    @cached_property
    def lower(self) -> Array:
        """(p,) lowest values."""
        return _joined([term.layout.lower for term in self._terms])

    @cached_property
    def upper(self) -> Array:
        """(p,) highest values."""
        return _joined([term.layout.upper for term in self._terms])

    @cached_property
    def knowledge(self) -> Knowledge:
        """Which values (p,) no fit may move, and which were measured independently."""
        return Knowledge.joined([term.knowledge for term in self._terms])

    @property
    def sizes(self) -> Array:
        """(p,) z = (value - null)/scale: how many expected sizes the values are from null."""
        return (self.vector - self.null) / self.scale

    def part(self, name: str) -> slice:
        """Where the parameters of an effect stand among all.

        Raises:
            KeyError: no such effect here.
        """
        place = self._place(name)
        first = sum(len(term.layout) for term in self._terms[:place])
        return slice(first, first + len(self._terms[place].layout))

    def own(self, name: str) -> NDArray[np.bool_]:
        """(p,) which of all parameters are those of an effect; none, if it is not here."""
        return np.array([effect == name for effect, _key in self.labels], dtype=bool)

    def with_vector(self, values: ArrayLike) -> Terms:
        """The same effects with other values (p,)."""
        vector = np.asarray(values, float)
        if vector.shape != (len(self),):
            raise InputError(f"values must be ({len(self)},), got {vector.shape}")
        ends = np.cumsum([len(term.layout) for term in self._terms], dtype=int)[:-1]
        parts = np.split(vector, ends)
        return Terms(
            term.with_vector(part.copy()) for term, part in zip(self._terms, parts, strict=False)
        )

    def with_term(self, term: Term) -> Terms:
        """These and one more, in place of that of the same name if there is one."""
        if term.name not in self:
            return Terms([*self._terms, term])
        # fits shift one parameter after the other: what is in order stays so
        other, place = Terms.__new__(Terms), self._place(term.name)
        other._terms = (*self._terms[:place], term, *self._terms[place + 1 :])
        return other

    def without(self, name: str) -> Terms:
        """All but that of an effect."""
        return Terms(term for term in self._terms if term.name != name)

    def only(self, names: Iterable[str]) -> Terms:
        """Those of some effects alone."""
        kept = set(names)
        return Terms(term for term in self._terms if term.name in kept)

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(f"{name} is not among {', '.join(self.names) or 'no terms'}")
        return self.names.index(name)


def _joined(parts: list[Array]) -> Array:
    whole = np.concatenate(parts) if parts else np.zeros(0)
    whole.flags.writeable = False
    return whole
