"""What the cables carry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from seecr.description.robot import Robot
from seecr.effects.base import Effect, OfRobot, Total, parameter
from seecr.effects.setup import Setup
from seecr.pose import Array, quat_from_rotvec, quat_rotate

# No platform is lighter than this part of what its file says, nor has its centre of mass this
# many of its own lengths outside of its anchor points.
_LEAST_MASS, _FARTHEST = 0.05, 2.0
# Expected sizes, and what the robot's length is.
_LENGTH = "half the largest distance of two anchor points"
_TENTH = OfRobot("10 % of the platform's mass", lambda r: 0.1 * r.mass)
_FORCE = OfRobot("3 % of the weight", lambda r: 0.03 * r.usual_load)


@dataclass(frozen=True, eq=False)
class PlatformMass(Effect):
    """The platform is heavier than assumed: m -> m + added. Positive: heavier."""

    name: ClassVar[str] = "platform_mass"
    anew: ClassVar[tuple[str, ...]] = ("file",)
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "mass of the platform"
    advice: ClassVar[str] = "weigh the platform: expect {mass:.4g} kg, not {mass_nominal:.4g}"

    added: float = parameter("kg", _TENTH, bounds=(lambda r: -0.99 * r.mass, 1e6))

    def edit_setup(self, setup: Setup) -> None:
        # a platform keeps a thousandth of its mass, whatever a search tries
        setup.mass = max(setup.mass + self.added, 1e-3 * setup.robot.mass)

    def totals(self, robot: Robot) -> dict[str, Total]:
        mass = robot.mass
        return {"mass": Total(mass + self.added, mass, "kg", lower=_LEAST_MASS * mass)}


@dataclass(frozen=True, eq=False)
class CentreOfMass(Effect):
    """The centre of mass is off by a vector, in the platform frame: c -> c + shift.

    True less assumed.
    """

    name: ClassVar[str] = "centre_of_mass"
    anew: ClassVar[tuple[str, ...]] = ("file",)
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "centre of mass of the platform"
    advice: ClassVar[str] = (
        "balance the platform on an edge: expect its centre at "
        "({x:.1f}, {y:.1f}, {z:.1f}) mm of its frame, not "
        "({x_nominal:.1f}, {y_nominal:.1f}, {z_nominal:.1f})"
    )

    shift: Array = parameter(
        "m", OfRobot(f"10 % of {_LENGTH}", lambda r: 0.1 * r.length), size="vector"
    )

    def edit_setup(self, setup: Setup) -> None:
        setup.centre_of_mass = setup.centre_of_mass + self.shift

    def totals(self, robot: Robot) -> dict[str, Total]:
        far = _FARTHEST * robot.length
        lower, upper = robot.anchor_points.min(axis=0) - far, robot.anchor_points.max(axis=0) + far
        centre, moved = robot.centre_of_mass, robot.centre_of_mass + self.shift
        return {
            axis: Total(float(moved[k]), float(centre[k]), "m", float(lower[k]), float(upper[k]))
            for k, axis in enumerate("xyz")
        }


@dataclass(frozen=True, eq=False)
class ExternalWrench(Effect):
    """A constant force at the platform origin and a constant moment: w_e -> w_e + (f, m).

    Both act on the platform and are given in the base frame (paper, eq 3). A dangling hose or
    cable tray, or a spring.
    """

    name: ClassVar[str] = "external_wrench"
    anew: ClassVar[tuple[str, ...]] = ("file",)
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "a constant force and moment on the platform"
    advice: ClassVar[str] = "look for a hose or cable that pulls on the platform, and remove it"

    force: Array = parameter("N", _FORCE, size="vector")
    moment: Array = parameter(
        "Nm", OfRobot(f"{_FORCE.words} x {_LENGTH}", lambda r: _FORCE(r) * r.length), size="vector"
    )

    def edit_setup(self, setup: Setup) -> None:
        setup.wrench = setup.wrench + np.concatenate([self.force, self.moment])


@dataclass(frozen=True, eq=False)
class GravityTilt(Effect):
    """The base frame is not level: g -> R((tilt_x, tilt_y, 0)) g, R of a rotation vector.

    Positive turns gravity, seen in the base frame, about base x and y by the right hand.
    """

    name: ClassVar[str] = "gravity_tilt"
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "a frame that is not level"
    advice: ClassVar[str] = (
        "put a level on the frame: expect {tilt_x:.2f} deg about x and {tilt_y:.2f} deg about y"
    )

    tilt_x: float = parameter("rad", 0.01, bounds=(-1.0, 1.0))
    tilt_y: float = parameter("rad", 0.01, bounds=(-1.0, 1.0))

    def edit_setup(self, setup: Setup) -> None:
        if self.tilt_x or self.tilt_y:
            setup.gravity = _tilted(self.tilt_x, self.tilt_y, tuple(setup.gravity.tolist()))


@lru_cache(maxsize=16)
def _tilted(tilt_x: float, tilt_y: float, gravity: tuple[float, float, float]) -> Array:
    """Gravity in a frame that is tilted; a fit asks for the same again with each parameter."""
    turned = quat_rotate(quat_from_rotvec(np.array([tilt_x, tilt_y, 0.0])), np.array(gravity))
    turned.flags.writeable = False
    return turned
