"""The robot as it really is: its described numbers, changed by each effect.

This is written from the effects' definitions, not from seecr's code for them: only names and
parameters are shared. All numbers are SI; frames and signs are as in the effects' own docstrings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate

Reading = tuple[Array, Array, Array]
"""Position (n, 3) [m], quaternion (n, 4), tensions (n, m) [N]."""
Sensor = Callable[[Reading], Reading]


@dataclass(frozen=True, eq=False)
class PassiveLine:
    """A line without a winch: a spring, rest length [m] and E S [N], or a constant force [N]."""

    exit_point: Array
    anchor_point: Array
    rest: float
    ea: float
    pushes: bool
    force: float


@dataclass(eq=False)
class TrueRobot:
    """Numbers for MuJoCo's model and the winches; m lines.

    Attributes:
        robot: as described.
        passive: its lines without winches, where they are set apart; then m is of the others.
        exit_points, anchor_points: (m, 3) [m] true positions.
        mass: [kg]; centre_of_mass: (3,) [m]; gravity: (3,) [m/s^2]; wrench: (6,) [N, N m].
        ea: (m,) [N]; quadratic, cubic: of T = EA (eps + quadratic eps^2 + cubic eps^3).
        pulley_radius: [m]; winch_side: [m]; cable_weight: [N/m].
        compliance, compliance_up: [m/N] of the exit points, sideways and upwards.
        friction: exponent of the capstan.
        hysteresis: amplitude [N]; hysteresis_stretch: [m].
        creep: part of the elastic strain; creep_time: [s].
        zero_pose: (7,) of the platform when the winches were zeroed.
        offset: (m,) [m]; gain: (m,); backlash: [m]; expansion: [1/K]; zero_temperature: [C].
        run_out: (sine (m,) [m], cosine (m,) [m], drum radius [m]) of each eccentricity.
        sensors: functions of the sensing effects on the readings, in order.
    """

    robot: Robot
    exit_points: Array
    anchor_points: Array
    mass: float
    centre_of_mass: Array
    gravity: Array
    ea: Array
    zero_pose: Array
    offset: Array
    gain: Array
    wrench: Array = field(default_factory=lambda: np.zeros(6))
    quadratic: float = 0.0
    cubic: float = 0.0
    pulley_radius: float = 0.0
    winch_side: float = 0.0
    compliance: float = 0.0
    compliance_up: float = 0.0
    cable_weight: float = 0.0
    friction: float = 0.0
    hysteresis: float = 0.0
    hysteresis_stretch: float = 1.0
    creep: float = 0.0
    creep_time: float = 1.0
    backlash: float = 0.0
    expansion: float = 0.0
    zero_temperature: float = 20.0
    run_out: list[tuple[Array, Array, float]] = field(default_factory=list)
    sensors: list[Sensor] = field(default_factory=list)
    passive: tuple[PassiveLine, ...] = ()

    @property
    def n_cables(self) -> int:
        """Number of cables m."""
        return len(self.exit_points)

    @property
    def up(self) -> Array:
        """Unit vector (3,) about which pulleys swivel: the frame's own vertical."""
        return self.robot.up

    @property
    def has_history(self) -> bool:
        """Whether a cable's tension depends on its past."""
        return self.hysteresis > 0 or self.friction > 0 or self.creep > 0


def true_robot(robot: Robot, effects: Sequence[Effect] = (), apart: bool = True) -> TrueRobot:
    """The robot with its effects, in the order in which they act.

    Args:
        robot: as described. effects: that it really has.
        apart: whether passive lines are set apart.

    Raises:
        CrosscheckError: an effect that has no truth here, such as a user's own.
    """
    true = TrueRobot(
        robot=robot,
        exit_points=robot.exit_points.copy(),
        anchor_points=robot.anchor_points.copy(),
        mass=robot.mass,
        centre_of_mass=robot.centre_of_mass.copy(),
        gravity=robot.gravity.copy(),
        ea=robot.ea.copy(),
        zero_pose=robot.reference_pose.copy(),
        offset=np.zeros(robot.n_cables),
        gain=np.zeros(robot.n_cables),
    )
    for effect in effects:
        if effect.name in _SENSING:
            true.sensors.append(partial(_SENSING[effect.name], effect))
        elif effect.name in _BODILY:
            true = replace(true, **_BODILY[effect.name](true, effect))
        else:
            raise CrosscheckError(
                f"effect {effect.name}: MuJoCo cannot simulate it; expected one of "
                f"{', '.join(TRUE_EFFECTS)}"
            )
    if true.pulley_radius and true.compliance != true.compliance_up:
        raise CrosscheckError(
            f"frame_compliance {true.compliance:g} m/N sideways and {true.compliance_up:g} m/N "
            "upwards: MuJoCo cannot simulate this with pulley_radius; expected equal values"
        )
    return _passive_apart(true) if apart and not robot.all_driven else true


def _passive_apart(true: TrueRobot) -> TrueRobot:
    """The robot on its driven cables, and the passive lines beside them.

    What winches and their ropes do wrong is of the former alone; points and stiffness are of all.
    """
    robot = true.robot
    if robot.n_driven == 0:
        raise CrosscheckError(
            f"robot {robot.name}: no winch drives any of its lines, so commands move nothing; "
            "expected a cable that is not passive"
        )
    driven = robot.driven
    lines = tuple(
        PassiveLine(
            true.exit_points[i], true.anchor_points[i], float(robot.rest_lengths[i]),
            float(true.ea[i]), bool(robot.pushes[i]), float(robot.constant_tension_N[i]),
        )
        for i in np.flatnonzero(~driven)
    )  # fmt: skip
    return replace(
        true, robot=robot.only(driven), passive=lines,
        run_out=[(sine[driven], cosine[driven], radius) for sine, cosine, radius in true.run_out],
        **{name: getattr(true, name)[driven] for name in _OF_CABLES},
    )  # fmt: skip


# What every cable has one of.
_OF_CABLES = ("exit_points", "anchor_points", "ea", "offset", "gain")


def _add(**parameters: str) -> Callable[[TrueRobot, Any], dict[str, Any]]:
    """An effect that adds its parameters, by the names of the robot's numbers."""

    def changed(true: TrueRobot, effect: Any) -> dict[str, Any]:
        out = {}
        for name, parameter in parameters.items():
            value, more = getattr(true, name), getattr(effect, parameter)
            out[name] = value + (np.reshape(more, np.shape(value)) if np.ndim(more) else more)
        return out

    return changed


def _zero_pose(true: TrueRobot, effect: Any) -> dict[str, Any]:
    turned = quat_multiply(quat_from_rotvec(effect.rotation), true.zero_pose[3:])
    return {"zero_pose": np.concatenate([true.zero_pose[:3] + effect.position, turned])}


def _tilt(true: TrueRobot, effect: Any) -> dict[str, Any]:
    turn = quat_from_rotvec(np.array([effect.tilt_x, effect.tilt_y, 0.0]))
    return {"gravity": quat_rotate(turn, true.gravity)}


def _frame(effect: Any, reading: Reading) -> Reading:
    position, quat, tensions = reading
    turn = quat_from_rotvec(effect.rotation)
    return quat_rotate(turn, position) + effect.shift, quat_multiply(turn, quat), tensions


def _target(effect: Any, reading: Reading) -> Reading:
    position, quat, tensions = reading
    turned = quat_multiply(quat, quat_from_rotvec(effect.rotation))
    return position + quat_rotate(quat, effect.shift), turned, tensions


_SENSING: dict[str, Callable[[Any, Reading], Reading]] = {
    "tracker_frame": _frame,
    "tracker_target": _target,
    "tracker_scale": lambda effect, read: (effect.factor * read[0], read[1], read[2]),
    "tension_scale": lambda effect, read: (read[0], read[1], effect.factor * read[2]),
}

# What each effect changes of the robot's numbers.
_BODILY: dict[str, Callable[[TrueRobot, Any], dict[str, Any]]] = {
    "cable_length_offset": _add(offset="offset"),
    "initial_pose_error": _zero_pose,
    "drum_gain": _add(gain="gain"),
    "length_scale": _add(gain="factor"),
    "drum_eccentricity": lambda true, effect: {
        "run_out": [*true.run_out, (effect.sine, effect.cosine, effect.drum_radius)],
    },
    "backlash": _add(backlash="gap"),
    "thermal_expansion": lambda _true, effect: {
        "expansion": effect.expansion, "zero_temperature": effect.zero_temperature,
    },
    "pulley_radius": _add(pulley_radius="radius"),
    "exit_point_error": _add(exit_points="error"),
    "anchor_point_error": _add(anchor_points="error"),
    "stiffness": lambda true, effect: {
        "ea": np.where(true.robot.driven, effect.factor * true.ea, true.ea),
    },
    "cable_stiffness": lambda true, effect: {"ea": true.ea * effect.factor},
    "nonlinear_elasticity": _add(quadratic="quadratic", cubic="cubic"),
    "winch_side_length": _add(winch_side="length"),
    "cable_weight": _add(cable_weight="weight"),
    "hysteresis": lambda _true, effect: {
        "hysteresis": effect.amplitude, "hysteresis_stretch": effect.stretch,
    },
    "creep": lambda _true, effect: {"creep": effect.amount, "creep_time": effect.time},
    "exit_friction": _add(friction="friction", winch_side="length"),
    "frame_compliance": _add(compliance="sideways", compliance_up="upwards"),
    "platform_mass": _add(mass="added"),
    "centre_of_mass": _add(centre_of_mass="shift"),
    "external_wrench": lambda true, effect: {
        "wrench": true.wrench + np.concatenate([effect.force, effect.moment]),
    },
    "gravity_tilt": _tilt,
}  # fmt: skip

TRUE_EFFECTS = (*_BODILY, *_SENSING)
"""Names of the effects that a twin can hide."""
