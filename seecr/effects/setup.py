"""What the statics uses at each pose, before it is solved: the thing that effects edit.

A :class:`Setup` starts as the plain robot of the paper. Effects change its numbers; every
quantity's plain value leaves the plain robot, bit for bit.

A quantity is declared once, as a field made with :func:`quantity`. What the field says of itself
is read wherever quantities are gone through: to fill a plain setup, to write the compiled tables,
to check what a user's effect leaves, and to tell what a change of it asks to be solved again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from seecr.commands import Commands, play
from seecr.compiled import columns
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array

# Of so many poses at most, straight lengths are kept: 30 times as many fill 20 MB.
_FEW_POSES = 5_000


class History(Enum):
    """Whether rows depend on the rows before them through a quantity."""

    NONE = "rows do not depend on the rows before"
    GIVES = "where it is not zero, rows depend on the rows before"
    SHAPES = "it shapes how rows depend on the rows before, where another gives that"


@dataclass(frozen=True)
class Quantity:
    """What a field of a setup says of itself; see :func:`quantity`."""

    what: str
    unit: str
    shape: tuple[str | int, ...]
    plain: float | str
    column: int | None
    entry: int | None
    paid_out: bool
    history: History
    of_winches: bool

    def shape_of(self, robot: Robot, rows: int) -> tuple[int, ...]:
        """The shape for a robot and a number of rows."""
        sizes = {"rows": rows, "cables": robot.n_cables}
        return tuple(sizes[size] if isinstance(size, str) else size for size in self.shape)

    def plain_of(self, robot: Robot, rows: int) -> Any:
        """The plain value: an array, or a number where there is one for all.

        Arrays of all rows are the value of one of them, shown so many times, and cannot be written.
        """
        value = getattr(robot, self.plain) if isinstance(self.plain, str) else self.plain
        shape = self.shape_of(robot, rows)
        if "rows" in self.shape:
            return np.broadcast_to(np.asarray(value, float), shape)
        return np.array(np.broadcast_to(value, shape), float, order="C") if shape else float(value)


def quantity(
    what: str,
    unit: str,
    shape: tuple[str | int, ...],
    plain: float | str = 0.0,
    *,
    column: int | None = None,
    entry: int | None = None,
    paid_out: bool = False,
    history: History = History.NONE,
    of_winches: bool = True,
) -> Any:
    """A field of :class:`Setup` that effects can edit.

    Args:
        what: what it is, in a few words.
        unit: "" for none.
        shape: of the array: numbers, "cables" and "rows"; () for one number.
        plain: value that leaves the plain robot: a number, or the name of the robot's attribute.
        column: where in a cable's row of the compiled tables it goes, as it is.
        entry: where in the load of a pose it goes, as it is.
        paid_out: it reaches the statics through the rest lengths alone.
        history: whether it makes rows depend on the rows before.
        of_winches: if each cable has one, it is of winches and their ropes: passive lines keep the
            plain value, whatever an effect says. What yields at their ends is in their stiffness.
    """
    of_winches &= "cables" in shape
    item = Quantity(what, unit, shape, plain, column, entry, paid_out, history, of_winches)
    return field(metadata={"quantity": item})


@dataclass(eq=False)
class Setup:
    """Numbers of a batch of n rows, of a robot with m cables; see the module's text.

    Attributes:
        robot: as described, without effects.
        commands: what was commanded.
        laws: tension a user's effect adds, as functions of strain (n, m) giving (n, m) [N].

    The others are quantities: :data:`QUANTITIES` lists them with shapes and units.
    """

    robot: Robot
    commands: Commands
    exit_points: Array = quantity(
        "where they really are, base frame", "m", ("cables", 3), "exit_points",
        column=columns.EXIT, of_winches=False,
    )  # fmt: skip
    anchor_points: Array = quantity(
        "where they really are, platform frame", "m", ("cables", 3), "anchor_points",
        column=columns.ANCHOR, of_winches=False,
    )  # fmt: skip
    zero_pose: Array = quantity(
        "where the platform really was when the winches were zeroed", "m", (7,),
        "reference_pose", paid_out=True,
    )  # fmt: skip
    pulley_radius: Array = quantity(
        "radius of the swivelling pulleys", "m", ("cables",), column=columns.RADIUS
    )
    length_gain: Array = quantity(
        "relative error of the length a winch pays out", "", ("cables",), paid_out=True
    )
    extra_length: Array = quantity(
        "paid out beyond the command", "m", ("rows", "cables"), paid_out=True
    )
    length_factor: Array = quantity(
        "by which the paid-out cable has grown", "", ("rows", "cables"), 1.0, paid_out=True
    )
    backlash: Array = quantity(
        "play between motor and drum", "m", ("cables",), paid_out=True, history=History.GIVES
    )
    ea: Array = quantity("E S", "N", ("cables",), "ea", column=columns.EA, of_winches=False)
    quadratic: Array = quantity(
        "of the elastic law, T = E S (eps + quadratic eps^2 + cubic eps^3)", "", ("cables",),
        column=columns.QUADRATIC,
    )  # fmt: skip
    cubic: Array = quantity("of the elastic law", "", ("cables",), column=columns.CUBIC)
    winch_side: Array = quantity(
        "length of elastic cable behind the exit point", "m", ("cables",),
        column=columns.WINCH_SIDE,
    )  # fmt: skip
    compliance: Array = quantity(
        "of the exit points, sideways", "m/N", ("cables",), column=columns.COMPLIANCE
    )
    lift: Array = quantity(
        "compliance of the exit points upwards less that sideways", "m/N", ("cables",),
        column=columns.LIFT,
    )  # fmt: skip
    cable_weight: Array = quantity(
        "weight per metre of cable", "N/m", ("cables",), column=columns.WEIGHT
    )
    friction: Array = quantity(
        "exponent of the capstan at the exit point", "", ("cables",), column=columns.FRICTION,
        history=History.GIVES,
    )  # fmt: skip
    hysteresis: Array = quantity(
        "amplitude of Dahl's friction in the cable", "N", ("cables",),
        column=columns.HYSTERESIS, history=History.GIVES,
    )  # fmt: skip
    hysteresis_stretch: Array = quantity(
        "stretch over which Dahl's friction turns over", "m", ("cables",), 1.0,
        column=columns.HYSTERESIS_STRETCH, history=History.SHAPES,
    )  # fmt: skip
    creep: Array = quantity(
        "part of the elastic strain that creeps", "", ("cables",), column=columns.CREEP_PART,
        history=History.GIVES,
    )  # fmt: skip
    creep_time: Array = quantity(
        "time constant of the creep", "s", ("cables",), 1.0, column=columns.CREEP_TIME,
        history=History.SHAPES,
    )  # fmt: skip
    mass: float = quantity("of the platform", "kg", (), "mass")
    centre_of_mass: Array = quantity("of the platform, in its frame", "m", (3,), "centre_of_mass")
    gravity: Array = quantity("in the base frame", "m/s^2", (3,), "gravity")
    wrench: Array = quantity(
        "external force at the platform's origin and moment, base frame", "N, N m",
        ("rows", 6), entry=columns.EXTERNAL_FORCE,
    )  # fmt: skip
    laws: list[Callable[[Array], Array]] = field(default_factory=list)

    @property
    def commanded_change(self) -> Array:
        """Length [m] the winches were told to pay out since they were zeroed, (n, m).

        For commands in absolute lengths, the lengths themselves.
        """
        return self.commands.change(self.robot)

    def rest_lengths(self) -> Array:
        """Rest lengths really paid out, (n, m) [m].

        At the reference pose the winches were zeroed with the cables as they really ran there;
        elsewhere the paid-out length has moved by the commanded change. To absolute lengths no
        reference applies. Passive lines have that of the description, whatever is commanded.
        """
        told = self.commanded_change
        if self.backlash.any():
            told = play(told, self.commands.starts, 0.5 * self.backlash, self.commands.passed)
        paid = told * (1.0 + self.length_gain) + self.extra_length
        robot = self.robot
        if not self.commands.absolute:
            pretension = robot.rest_lengths - robot.reference_lengths
            paid = self.geometric_lengths(self.zero_pose[None]) + pretension + paid
        lengths = paid * self.length_factor
        return lengths if robot.all_driven else np.where(robot.driven, lengths, robot.rest_lengths)

    def spare_passive(self) -> None:
        """Give passive lines the plain values of what is of winches and their ropes."""
        if self.robot.all_driven:
            return
        plain = _plain_values(self.robot, len(self.commands))
        driven = self.robot.driven
        for name, item in QUANTITIES.items():
            value = getattr(self, name)
            if item.of_winches and value is not plain[name]:
                setattr(self, name, np.where(driven, value, plain[name]))

    def carried(self) -> tuple[Array, Array]:
        """Mass (n,) [kg] and centre of mass (n, 3) [m] of the platform with its known payloads."""
        loads = self.commands.loads
        if loads is None:
            n = len(self.commands)
            return np.full(n, self.mass), np.tile(self.centre_of_mass, (n, 1))
        total = self.mass + loads.mass
        # the lever from the platform's own centre: exactly that centre where nothing is said
        lever = np.where(np.isnan(loads.centre), 0.0, loads.centre - self.centre_of_mass)
        share = np.divide(loads.mass, total, out=np.zeros_like(total), where=total != 0.0)
        return total, self.centre_of_mass + share[:, None] * lever

    def weight(self) -> Array:
        """Weight (n,) [N] of the platform with its known payloads."""
        return np.asarray(self.carried()[0] * np.linalg.norm(self.gravity))

    def geometric_lengths(self, poses: Array) -> Array:
        """Lengths (k, m) [m] of straight cables over their pulleys at poses (k, 7)."""
        given = (poses, self.anchor_points, self.exit_points, self.pulley_radius)
        if len(poses) > _FEW_POSES:
            return _straight_lengths(self.robot, *(np.array(a, float, order="C") for a in given))
        return _kept_lengths(self.robot, *(np.asarray(a, float).tobytes() for a in given))

    def shared(self) -> Setup:
        """One whose quantities can be put anew; their arrays are those of this one."""
        out = Setup.__new__(Setup)
        out.__dict__.update(self.__dict__)
        out.laws = list(self.laws)
        return out

    def own(self) -> None:
        """Make the arrays its own, so that they can be written in place."""
        for name in QUANTITIES:
            setattr(self, name, copy(getattr(self, name)))

    def differs(self, other: Setup) -> frozenset[str]:
        """Names of the quantities that are not the same to the last bit in another setup."""
        return frozenset(
            name for name in QUANTITIES if not _same(getattr(self, name), getattr(other, name))
        )

    @property
    def has_history(self) -> bool:
        """Whether a row depends on the rows before it."""
        return any(
            bool(np.asarray(getattr(self, name)).any())
            for name, item in QUANTITIES.items()
            if item.history is History.GIVES
        )


def _straight_lengths(
    robot: Robot, poses: Array, anchors: Array, exits: Array, radii: Array
) -> Array:
    from seecr.compiled.cable_law import lengths_at  # takes a while to import

    out = np.empty((len(poses), robot.n_cables))
    lengths_at(poses, anchors, exits, radii, robot.up, out)
    return out


@lru_cache(maxsize=32)
def _kept_lengths(robot: Robot, poses: bytes, anchors: bytes, exits: bytes, radii: bytes) -> Array:
    """See :meth:`Setup.geometric_lengths`; most parameters that a fit shifts leave them alone."""

    def array(given: bytes, *shape: int) -> Array:
        return np.frombuffer(given).reshape(shape).copy()  # writable: see seecr.compiled.jit

    places = (array(anchors, -1, 3), array(exits, -1, 3), array(radii, -1))
    out = _straight_lengths(robot, array(poses, -1, 7), *places)
    out.flags.writeable = False
    return out


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if isinstance(one, np.ndarray):
        # many times faster than comparing small arrays
        return bool(one.tobytes() == other.tobytes())
    return bool(one == other)


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {item.name: item.metadata["quantity"] for item in fields(Setup) if item.metadata}
)
"""What effects can edit in a setup, by name."""


@lru_cache(maxsize=16)
def _plain_values(robot: Robot, rows: int) -> Mapping[str, Any]:
    """Plain values of all quantities: fits make thousands of setups of the same robot."""
    return {name: item.plain_of(robot, rows) for name, item in QUANTITIES.items()}


def plain_setup(robot: Robot, commands: Commands, wrench: Array | None = None) -> Setup:
    """The setup of the paper's plain robot for commands of n rows.

    ``wrench`` (6,) or (n, 6) is external, besides that of the commands' loads.
    """
    n = len(commands)
    plain = _plain_values(robot, n)
    own = {k: v if "rows" in QUANTITIES[k].shape else copy(v) for k, v in plain.items()}
    setup = Setup(robot, commands, **own)
    if commands.loads is not None:
        setup.wrench = commands.loads.wrench.copy()
    if wrench is not None:
        given = np.asarray(wrench, float)
        if given.shape not in ((6,), (n, 6)):
            raise InputError(f"wrench must be (6,) or ({n}, 6), got {given.shape}")
        setup.wrench = setup.wrench + given
    return setup
