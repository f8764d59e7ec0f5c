"""What the statics uses at each pose, before it is solved: the thing that effects edit.

A :class:`Setup` starts as the plain robot of the paper. Effects change its numbers; every
field's null leaves the plain robot, bit for bit. Arrays have a leading axis of n rows where
the number may differ from row to row; fields that belong to the robot are per cable or single.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from seecr.errors import InputError
from seecr.pose import Array
from seecr.robot import Robot


@dataclass(frozen=True, eq=False)
class Commands:
    """What the robot was told, row by row, in time order within a run.

    Attributes:
        pose: (n, 7) commanded poses; for lengths, where the solver starts from.
        lengths: (n, m) [m] commanded rest lengths, or None.
        run: (n,) int, number of the continuous motion a row belongs to.
        time: (n,) [s] or None.
        temperature: (n,) [deg C] or None.
        passed: (k, n, m) [m] commanded changes of length (or lengths) that the way to each row
            passes, in order: where it starts and where cables turn round; None where nobody asks.
    """

    pose: Array
    lengths: Array | None = None
    run: NDArray[np.int64] | None = None
    time: Array | None = None
    temperature: Array | None = None
    passed: Array | None = None

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def starts(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run."""
        return run_starts(self.run, len(self))

    def nominal_change(self, robot: Robot) -> Array:
        """Straight lengths at the commanded poses less those at the reference, (n, m) [m]."""
        if not self._kept or self._kept[0][0] is not robot:
            change = robot.nominal_lengths(self.pose) - robot.reference_lengths
            self._kept[:] = [(robot, change)]
        return self._kept[0][1]

    # of the last robot asked for: every trial of a fit asks again
    _kept: list[tuple[Robot, Array]] = field(default_factory=list, repr=False)


def run_starts(run: NDArray[np.integer] | None, n: int) -> NDArray[np.bool_]:
    """Which of n rows are the first of their run, (n,)."""
    fresh = np.zeros(n, dtype=bool)
    fresh[:1] = True
    if run is not None:
        fresh[1:] = run[1:] != run[:-1]
    return fresh


def play(
    told: Array, run: NDArray[np.int64] | None, half_width: Array, passed: Array | None = None
) -> Array:
    """The play operator: an output that lags its input (n, m) by up to the half-width (m,).

    It starts centred where each run starts: on its first row, or on ``passed[0]`` there. Between
    rows the input goes through ``passed`` (k, n, m), if given, and one way in between.
    """
    way = told[None] if passed is None else np.concatenate([passed, told[None]])
    low, high = way[0] - half_width, way[0] + half_width
    fresh = run_starts(run, len(told))
    low[fresh] = high[fresh] = way[0, fresh]
    # an input moves the output to the nearest point of a band about it, and so do many inputs
    # in turn, with one band for all: that of each row first, then of 2, 4, 8, ... rows
    for at in way[1:]:
        low, high = _band_of_both(low, high, at - half_width, at + half_width)
    rows = 1
    while np.any(low < high):
        low[rows:], high[rows:] = _band_of_both(low[:-rows], high[:-rows], low[rows:], high[rows:])
        rows *= 2
    return low


def _band_of_both(low: Array, high: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """The band that limits to ``low`` and ``high`` and then to ``least`` and ``most``."""
    return np.clip(low, least, most), np.clip(high, least, most)


@dataclass(eq=False)
class Setup:
    """Numbers of a batch of rows; see the module's text.

    Attributes:
        robot: as described, without effects.
        commands: what was commanded.
        exit_points, anchor_points: (m, 3) [m] where they really are.
        zero_pose: (7,) where the platform really was when the winches were zeroed.
        pulley_radius: (m,) [m].
        length_gain: (m,) relative error of the length a winch pays out.
        extra_length: (n, m) [m] paid out beyond the command.
        length_factor: (1 or n, m) by which the paid-out cable has grown.
        backlash: (m,) [m] play between motor and drum.
        ea: (m,) [N].
        quadratic, cubic: (m,) of the elastic law.
        winch_side: (m,) [m] elastic cable behind the exit point.
        compliance: (m,) [m/N] of the exit points.
        cable_weight: (m,) [N/m].
        friction: (m,) capstan exponent at the exit point.
        hysteresis, hysteresis_stretch: (m,) amplitude [N] and stretch [m] of Dahl's model.
        creep, creep_time: (m,) part of the elastic strain that creeps, time constant [s].
        laws: tension a user's effect adds, as functions of strain (n, m) giving (n, m) [N].
        mass: [kg]; centre_of_mass: (3,) [m]; gravity: (3,) [m/s^2].
        wrench: (n, 6) external force [N] at the platform origin and moment [N m], base frame.
    """

    robot: Robot
    commands: Commands
    exit_points: Array
    anchor_points: Array
    zero_pose: Array
    pulley_radius: Array
    length_gain: Array
    extra_length: Array
    length_factor: Array
    backlash: Array
    ea: Array
    quadratic: Array
    cubic: Array
    winch_side: Array
    compliance: Array
    cable_weight: Array
    friction: Array
    hysteresis: Array
    hysteresis_stretch: Array
    creep: Array
    creep_time: Array
    mass: float
    centre_of_mass: Array
    gravity: Array
    wrench: Array
    laws: list[Callable[[Array], Array]] = field(default_factory=list)

    @property
    def commanded_change(self) -> Array:
        """Length [m] the winches were told to pay out since they were zeroed, (n, m).

        For commands in lengths, which are absolute, the lengths themselves.
        """
        if self.commands.lengths is not None:
            return self.commands.lengths
        return self.commands.nominal_change(self.robot)

    def rest_lengths(self) -> Array:
        """Rest lengths really paid out, (n, m) [m].

        At the reference pose the winches were zeroed with the cables as they really ran there;
        elsewhere the paid-out length has moved by the commanded change (contracts: reference
        pose). Lengths commanded as such are absolute.
        """
        told = self.commanded_change
        if np.any(self.backlash):
            told = play(told, self.commands.run, 0.5 * self.backlash, self.commands.passed)
        paid = told * (1.0 + self.length_gain) + self.extra_length
        if self.commands.lengths is not None:
            return paid * self.length_factor
        robot = self.robot
        pretension = robot.rest_lengths - robot.reference_lengths
        zero = self.geometric_lengths(self.zero_pose[None])
        return (zero + pretension + paid) * self.length_factor

    def geometric_lengths(self, poses: Array) -> Array:
        """Lengths (k, m) [m] of straight cables over their pulleys at poses (k, 7)."""
        from seecr.compiled.law import lengths_at  # compiled: takes a while to import

        out = np.empty((len(poses), self.robot.n_cables))
        lengths_at(
            np.ascontiguousarray(poses, dtype=float), self.anchor_points, self.exit_points,
            self.pulley_radius, self.robot.up, out,
        )  # fmt: skip
        return out

    @property
    def has_history(self) -> bool:
        """Whether a row depends on the rows before it."""
        return bool(
            np.any(self.hysteresis)
            or np.any(self.friction)
            or np.any(self.creep)
            or np.any(self.backlash)
        )


def plain_setup(robot: Robot, commands: Commands, wrench: Array | None = None) -> Setup:
    """The setup of the paper's plain robot for commands of n rows.

    Args:
        robot: the robot.
        commands: n rows.
        wrench: (6,) or (n, 6) external wrench; none by default.
    """
    n, m = len(commands), robot.n_cables
    if wrench is None:
        wrench = np.zeros(6)
    wrench = np.asarray(wrench, float)
    if wrench.shape not in ((6,), (n, 6)):
        raise InputError(f"wrench must be (6,) or ({n}, 6), got {wrench.shape}")

    def zeros() -> Array:
        return np.zeros(m)

    return Setup(
        robot=robot,
        commands=commands,
        exit_points=robot.exit_points.copy(),
        anchor_points=robot.anchor_points.copy(),
        zero_pose=robot.reference_pose.copy(),
        pulley_radius=zeros(),
        length_gain=zeros(),
        extra_length=np.zeros((n, m)),
        length_factor=np.ones((1, m)),
        backlash=zeros(),
        ea=robot.ea.copy(),
        quadratic=zeros(),
        cubic=zeros(),
        winch_side=zeros(),
        compliance=zeros(),
        cable_weight=zeros(),
        friction=zeros(),
        hysteresis=zeros(),
        hysteresis_stretch=np.ones(m),
        creep=zeros(),
        creep_time=np.ones(m),
        mass=robot.mass,
        centre_of_mass=robot.centre_of_mass.copy(),
        gravity=robot.gravity.copy(),
        wrench=np.broadcast_to(wrench, (n, 6)).copy(),
    )
