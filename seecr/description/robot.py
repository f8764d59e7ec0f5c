"""The robot as numbers: points, cables, load, and the platform's degrees of freedom."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.counted import between, counted
from seecr.description.cables import EXAMPLE, rope_of
from seecr.description.mjcf_text import plain_text
from seecr.description.points import Joint as Joint  # of a robot
from seecr.description.points import robot_numbers
from seecr.errors import InputError, RobotError
from seecr.files import path_of, write_text
from seecr.pose import LARGEST, Array, all_finite, quat_rotate, transform_points

ABSURD = 10.0
"""Commands and rest lengths beyond this many times the frame's reach are in another unit."""

ITS_A_POINT = (
    "all cables are anchored at one point of the platform, about which nothing keeps it from "
    "turning; if it is to be a point mass, give it three slide joints instead of the free joint"
)
"""The cause of much that fails for a robot that :attr:`Robot.is_point`, and its cure."""

# Anchor points are one if they are no farther apart than this part of the robot's length.
_ONE_POINT = 1e-6

# For so many poses straight lengths are worth loading compiled functions.
_MANY = 1000

# What every cable has one of.
_OF_CABLES = ("exit_points", "anchor_points", "ea", "rest_lengths")

# Default of a field that __post_init__ makes from the others when it is not given.
_FILLED_IN: Any = None

IDENTITY_POSE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A platform on elastic cables. Arrays are read-only; use ``dataclasses.replace``.

    Attributes:
        name: of the robot, for people.
        exit_points: A_i in the base frame, (m, 3) [m].
        anchor_points: B_i in the platform frame, (m, 3) [m].
        ea: k_c = E S of each cable, (m,) [N] (paper, eq 10).
        rest_lengths: of the cables at the reference pose, (m,) [m].
        mass: of the platform [kg].
        centre_of_mass: in the platform frame, (3,) [m].
        gravity: (3,) [m/s^2] in the base frame.
        reference_pose: (7,) at which the winches were zeroed.
        joints: in the order of the chain; empty for a free platform.
        cable_names: m names.
        source: the file it was read from.
        inertia: of the platform about its centre of mass, in its frame, (3, 3) [kg m^2]; zero if
            unknown. It affects no equilibrium.
        left_out: what the file has that may hold or stop the platform beside its cables, such as
            "contacts"; statics leave it out.
        falls: how often the line of each cable runs to and fro between its two points (m,), as in a
            block and tackle. ``ea`` and ``rest_lengths`` are those of one straight cable that pulls
            as all together; the line's own tension is that part of its tension. One without.
        read: sentences about what its file says otherwise than it was read.
        floor: [m] z of the level floor below the platform, a static plane of the file; None without
            one. Statics leave it out; maps end there.
        driven: (m,) bool, lines on winches; by default all that neither push nor have a constant
            tension. The others are passive: commands and winches leave their rest lengths alone.
        pushes: (m,) bool, springs that also push: T = k_c (l/l0 - 1) where they are shorter too.
        constant_tension_N: (m,) [N] of lines of constant force, such as counterweights, with all
            falls; 0 for others. They have no stiffness, and their rest length means nothing.
    """

    name: str
    exit_points: Array
    anchor_points: Array
    ea: Array
    rest_lengths: Array
    mass: float
    centre_of_mass: Array = field(default_factory=lambda: np.zeros(3))
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    reference_pose: Array = field(default_factory=lambda: IDENTITY_POSE.copy())
    joints: tuple[Joint, ...] = ()
    cable_names: tuple[str, ...] = ()
    source: Path | None = None
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    left_out: tuple[str, ...] = ()
    floor: float | None = None
    falls: Array = field(default_factory=lambda: np.ones(0))
    read: tuple[str, ...] = ()
    driven: NDArray[np.bool_] = _FILLED_IN
    pushes: NDArray[np.bool_] = _FILLED_IN
    constant_tension_N: Array = _FILLED_IN

    def __post_init__(self) -> None:
        m = np.shape(self.exit_points)[0]
        if np.all(np.asarray(self.falls) == 1.0):  # also where cables were left out
            object.__setattr__(self, "falls", np.ones(m))
        self._fill_in_kinds(m)
        shapes = {
            "exit_points": (m, 3),
            "anchor_points": (m, 3),
            "ea": (m,),
            "rest_lengths": (m,),
            "centre_of_mass": (3,),
            "gravity": (3,),
            "reference_pose": (7,),
            "inertia": (3, 3),
            "falls": (m,),
            "constant_tension_N": (m,),
        }
        for name, shape in shapes.items():
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise InputError(f"robot {self.name}: {name} must be {shape}, got {value.shape}")
            if not all_finite(value):
                raise self._not_finite(name, value, m)
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if not self.cable_names:
            object.__setattr__(self, "cable_names", tuple(f"cable{i + 1}" for i in range(m)))
        self._check_values()

    @classmethod
    def from_points(
        cls, exit_points: ArrayLike, anchor_points: ArrayLike, *, mass: float,
        ea: ArrayLike | None = None, stiffness: ArrayLike | None = None, cable: str | None = None,
        at: ArrayLike | None = None, plane: str | None = "auto",
        centre_of_mass: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike | None = None,
        gravity: ArrayLike = (0.0, 0.0, -9.81), names: Sequence[str] = (), name: str = "robot",
    ) -> Robot:  # fmt: skip
        """A robot from its points.

        Rest lengths are the straight lengths at the reference pose, as if the winches were zeroed
        there with cables that are just taut: under its weight the platform sags from it.
        :func:`seecr.correct` finds rest lengths that hold a pose, with a lowest tension.

        Args:
            exit_points: A_i in the base frame, (m, 3) [m].
            anchor_points: B_i in the platform frame, (m, 3) [m]; (3,) if all are one point. Then
                the platform is a point mass and gets slides alone, since nothing could keep it
                from turning.
            mass: of the platform [kg].
            ea, stiffness, cable: one of them: k_c = E S [N], E S over rest length [N/m], each one
                number or one for each cable, or a rope such as ``"steel 7x19 3mm"``.
            at: the reference pose (7,), or its position (3,) without a turn; by default level, in
                the middle of the frame, half way up to the highest exit point.
            plane: ``"xz"``, ``"xy"`` or ``"yz"`` for a planar platform, which slides and turns in
                that plane, None for a free one; ``"auto"``: planar if all points are in one plane.
            centre_of_mass: in the platform frame, (3,) [m].
            inertia: about the centre of mass, (3, 3) [kg m^2]; by default that of a solid box
                around the anchor points. It affects no equilibrium.
            gravity: (3,) [m/s^2]. names: of the m cables. name: of the robot.

        Raises:
            InputError, RobotError: shapes or numbers that are no robot's.

        Example:
            >>> corners = [[0, 0, 3], [6, 0, 3], [6, 4, 3], [0, 4, 3]]
            >>> seecr.Robot.from_points(corners, [0, 0, 0], mass=25, ea=3e5, at=[3, 2, 1])
        """
        if sum(one is not None for one in (ea, stiffness, cable)) != 1:
            raise InputError(
                "expected one of ea=3e5 [N], stiffness=1e5 [N/m] (numbers, or one for each cable) "
                f"and cable={EXAMPLE!r}, got none or several"
            )
        strength = rope_of(cable).ea if cable is not None else np.nan if ea is None else ea
        numbers, replaced = robot_numbers(
            exit_points, anchor_points, mass, strength, np.nan if stiffness is None else stiffness,
            at, plane, centre_of_mass, inertia,
        )  # fmt: skip
        if names and len(names) != len(numbers["ea"]):
            raise InputError(f"names: expected {len(numbers['ea'])}, got {len(names)}")
        if replaced:
            raise InputError(
                "inertia: expected that of a body about its centre of mass, with positive moments, "
                "none larger than the sum of the others; leave it out for that of a solid box"
            )
        down = np.asarray(gravity, float)
        return cls(name, **numbers, gravity=down, cable_names=tuple(names))

    def save(self, path: str | Path, comment: str = "") -> None:
        """Write the robot as MJCF, which :func:`seecr.load_robot` reads back.

        Raises:
            InputError, InputFileError: no path, or the file cannot be written.
        """
        about = comment or f"{self.name}; written by seecr"
        write_text(path_of(path, "the MJCF to write"), plain_text(self, about))

    def _fill_in_kinds(self, m: int) -> None:
        """Say of each line whether it pushes and whether a winch drives it, if nobody has said.

        Plain values of another number of lines are those of a robot whose lines were replaced.
        """
        for name, plain in (("constant_tension_N", 0.0), ("pushes", False), ("driven", True)):
            given = getattr(self, name)
            if given is None or (np.shape(given) != (m,) and np.all(np.equal(given, plain))):
                given = np.full(m, plain)
                if name == "driven":
                    given = ~(self.pushes | (self.constant_tension_N != 0.0))
            value = np.array(given, dtype=type(plain))
            if value.shape != (m,):
                raise InputError(f"robot {self.name}: {name} must be ({m},), got {value.shape}")
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """The robot in a few lines, for people."""
        words = [f"ball {j.name[:-2]}" if j.ball else f"{j.kind} {j.name}" for j in self.joints]
        held = ", ".join(dict.fromkeys(words))
        platform = f"a platform on joints ({held})" if self.joints else "a free platform"
        ends = zip("xyz", self.exit_points.min(axis=0), self.exit_points.max(axis=0), strict=True)
        frame = ", ".join(f"{axis} {between(*ends_)}" for axis, *ends_ in ends)
        place = " ".join(f"{part:.4g}" for part in self.reference_pose[:3])
        lengths = self.reference_lengths
        return "\n".join(
            (
                f"{self.name}: {counted(len(self.ea), 'cable')}, {platform} of {self.mass:.4g} kg",
                f"exit points: {frame} m",
                f"at the reference pose, x y z {place} m, cables are "
                f"{between(lengths.min(), lengths.max())} m long",
                f"E S: {between(self.ea.min(), self.ea.max())} N",
                *(words.partition(": ")[2] for words in self._passive_words()),
            )
        )

    def _not_finite(self, name: str, value: Array, m: int) -> InputError:
        """The error about a number that is none; it names the cable if each has one."""
        what = "stiffness x rest length" if name == "ea" else name
        if name in _OF_CABLES:
            rows = np.abs(value.reshape(m, -1)).max(axis=1)
            i = int(np.argmin(rows <= LARGEST))
            of = self.cable_names[i] if self.cable_names else f"cable{i + 1}"
            what = f"{what} of {of}"
        return InputError(
            f"robot {self.name}: {what} holds a number that is not finite, or beyond {LARGEST:g}"
        )

    def _check_values(self) -> None:
        if self.n_cables == 0:
            raise RobotError(f"robot {self.name}: expected at least one cable, got none")
        for i, name in enumerate(self.cable_names):
            if fault := self._fault_of_kind(i):
                raise RobotError(f"robot {self.name}: {name} {fault}")
            if self.ea[i] <= 0 and self.constant_tension_N[i] == 0.0:
                raise RobotError(
                    f"robot {self.name}: {name} has stiffness {self.ea[i]:g} N; "
                    "expected stiffness x rest length above zero"
                )
            if self.rest_lengths[i] <= 0:
                raise RobotError(
                    f"robot {self.name}: {name} has rest length {self.rest_lengths[i]:g} m; "
                    "expected a positive length"
                )
        if not 0 <= self.mass <= LARGEST:
            raise RobotError(
                f"robot {self.name}: expected a mass from 0 to {LARGEST:g} kg, got {self.mass:g} kg"
            )
        short = self.nominal_lengths(self.reference_pose[None])[0] <= 1e-9 * self.length
        if np.any(short):
            name = self.cable_names[int(np.argmax(short))]
            raise RobotError(
                f"robot {self.name}: {name} has its anchor point on its exit point at the "
                "reference pose; expected them apart"
            )

    def _fault_of_kind(self, i: int) -> str:
        """What is wrong with a line that pushes or has a constant tension; "" if nothing is."""
        tension = self.constant_tension_N[i]
        if tension < 0.0:
            return f"has a constant tension of {tension:g} N; expected one above zero"
        if tension > 0.0 and self.ea[i] != 0.0:
            return (
                f"has a constant tension and a stiffness x rest length of {self.ea[i]:g} N; "
                "expected 0, a constant force is no spring"
            )
        if self.driven[i] and (tension > 0.0 or self.pushes[i]):
            what = "has a constant tension" if tension > 0.0 else "pushes"
            return f"{what} and is driven; expected it passive, no winch drives such a line"
        return ""

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Names of the lines that no winch drives."""
        return tuple(n for n, on in zip(self.cable_names, self.driven, strict=True) if not on)

    @cached_property
    def all_driven(self) -> bool:
        """Whether there are no passive lines."""
        return bool(self.driven.all())

    def only(self, lines: NDArray[np.bool_]) -> Robot:
        """The same platform on some of its lines (m,)."""
        of_lines = (*_OF_CABLES, "falls", "driven", "pushes", "constant_tension_N")
        some: dict[str, Any] = {name: getattr(self, name)[lines] for name in of_lines}
        names = zip(self.cable_names, lines, strict=True)
        return replace(self, cable_names=tuple(n for n, kept in names if kept), **some)

    @property
    def n_driven(self) -> int:
        """Number of lines on winches."""
        return int(self.driven.sum())

    @cached_property
    def typical(self) -> NDArray[np.bool_]:
        """(m,) lines whose numbers are the robot's usual ones: the driven, else all springs.

        All, where there is neither.
        """
        springs = self.ea > 0.0
        every = springs if springs.any() else ~springs
        return self.driven if self.driven.any() else every

    @property
    def mean_ea(self) -> float:
        """Mean E S [N] of the lines that are :attr:`typical`."""
        return float(np.mean(self.ea[self.typical]))

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user of the robot's file should know.

        On what it was :attr:`read` as, :attr:`left_out`, :attr:`is_point`, and lines that are not
        :attr:`driven`.
        """
        point = (f"{self.source or self.name}: {ITS_A_POINT}",) if self.is_point else ()
        return (*self.read, *point, *self._left_out_words(), *self._passive_words())

    def _passive_words(self) -> tuple[str, ...]:
        if self.all_driven:
            return ()
        kinds = [self._kind_words(int(i)) for i in np.flatnonzero(~self.driven)]
        nothing = "" if self.driven.any() else "; commands move nothing"
        return (f"{self.source or self.name}: no winch drives {', '.join(kinds)}{nothing}",)

    def _kind_words(self, i: int) -> str:
        name = self.cable_names[i]
        if self.constant_tension_N[i] > 0.0:
            return f"{name} (pulls with {self.constant_tension_N[i]:g} N at any length)"
        kind = "pulls and pushes" if self.pushes[i] else "pulls"
        return f"{name} ({kind}, rest length {self.rest_lengths[i]:.4g} m throughout)"

    def _left_out_words(self) -> tuple[str, ...]:
        if not self.left_out:
            return ()
        *others, last = self.left_out
        names = f"{', '.join(others)} and {last}" if others else last
        return (
            f"{self.source or self.name} has {names}: left out here, where nothing but its cables "
            "holds the platform",
        )

    @property
    def is_point(self) -> bool:
        """Whether a free platform has all its cables at one point, about which it can turn."""
        wide = np.ptp(self.anchor_points, axis=0).max()
        return not self.joints and bool(wide <= _ONE_POINT * self.length)

    @property
    def n_cables(self) -> int:
        """Number of cables m."""
        return len(self.exit_points)

    @property
    def n_dof(self) -> int:
        """Degrees of freedom of the platform: 6 if free, else one per joint."""
        return len(self.joints) or 6

    @cached_property
    def hinges(self) -> NDArray[np.bool_]:
        """(d,) whether each coordinate is a rotation; the last three of a free platform are."""
        if not self.joints:
            return np.repeat([False, True], 3)
        return np.array([joint.kind == "hinge" for joint in self.joints])

    @property
    def turns(self) -> bool:
        """Whether the platform can turn at all: on slides alone it cannot."""
        return bool(self.hinges.any())

    @property
    def up(self) -> Array:
        """Unit vector (3,) against gravity; base z if there is none.

        Pulleys swivel about this axis. They are carried by the frame, so the effect of a tilted
        gravity does not change it.
        """
        g = np.linalg.norm(self.gravity)
        return -self.gravity / g if g > 0 else np.array([0.0, 0.0, 1.0])

    def standing_height(self, quat_wxyz: Array) -> float:
        """z [m] of the platform's origin where, so turned, it stands on the floor.

        The platform is what is known of it: anchor points, centre of mass and origin. Without a
        floor it is minus infinity.
        """
        if self.floor is None:
            return -np.inf
        points = np.concatenate([self.anchor_points, self.centre_of_mass[None], np.zeros((1, 3))])
        return float(self.floor - quat_rotate(quat_wxyz, points)[:, 2].min())

    @property
    def weight(self) -> float:
        """Weight of the platform [N]."""
        return float(self.mass * np.linalg.norm(self.gravity))

    @property
    def usual_load(self) -> float:
        """Typical cable force [N]: the weight, or without one the force at a strain of 0.1 %."""
        return self.weight if self.weight > 0.0 else 1e-3 * self.mean_ea

    @cached_property
    def length(self) -> float:
        """Characteristic length [m]: half the largest distance of two anchor points; see glossary.

        It makes torques comparable with forces, and is in every stiffness of one unit: cables can
        balance a torque of weight times length by moving the weight from one anchor point to
        another. It is at least a
        hundredth of the largest distance from the reference position to an exit point, which
        matters for a platform with one anchor point.
        """
        b = self.anchor_points
        reach = 0.5 * float(np.max(np.linalg.norm(b[:, None] - b[None], axis=-1)))
        exits = self.exit_points - self.reference_pose[:3]
        floor = 0.01 * float(np.max(np.linalg.norm(exits, axis=-1)))
        # if all exit points are at the reference position, a hundredth of the longest cable
        longest = float(np.max(self.nominal_lengths(self.reference_pose[None])))
        return max(reach, floor) or 0.01 * longest

    @cached_property
    def reach(self) -> float:
        """Largest distance [m] of two exit points, or of one and the reference position."""
        points = np.concatenate([self.exit_points, self.reference_pose[None, :3]])
        return float(np.max(np.linalg.norm(points[:, None] - points[None], axis=-1)))

    @cached_property
    def reference_lengths(self) -> Array:
        """Straight lengths |A_i - (t + R B_i)| at the reference pose, (m,) [m]."""
        return np.asarray(self.nominal_lengths(self.reference_pose[None])[0])

    def nominal_lengths(self, poses: Array) -> Array:
        """Straight lengths |A_i - (t + R B_i)| at poses (n, 7), as (n, m) [m] (eqs 1, 2).

        Positions (n, 3) are poses turned as the reference pose.
        """
        poses = np.asarray(poses, float)
        if poses.shape[-1] == 3:
            turn = np.broadcast_to(self.reference_pose[3:], (*poses.shape[:-1], 4))
            poses = np.concatenate([poses, turn], axis=-1)
        if poses.ndim == 2 and len(poses) >= _MANY:
            from seecr.compiled.cable_law import lengths_at  # takes a while to import

            out, straight = np.empty((len(poses), self.n_cables)), np.zeros(self.n_cables)
            points = (np.array(a, float, order="C") for a in (self.anchor_points, self.exit_points))
            lengths_at(np.array(poses, order="C"), *points, straight, self.up, out)
            return out
        anchors = transform_points(poses, self.anchor_points)
        return np.asarray(np.linalg.norm(self.exit_points - anchors, axis=-1))

    def commanded_lengths(self, poses: Array) -> Array:
        """Rest lengths that the winches pay out for commanded poses (n, 7), as (n, m) [m].

        They are the rest lengths at the reference pose plus the difference of straight lengths. If
        the MJCF's rest lengths are the straight lengths at the reference pose, as in the paper
        (step 3), they are the straight lengths at the commanded pose. Those of passive lines stay.
        """
        offset = self.rest_lengths - self.reference_lengths
        lengths = self.nominal_lengths(poses) + offset
        return lengths if self.all_driven else np.where(self.driven, lengths, self.rest_lengths)
