"""Where the cable runs, and what holds the exit points.

Points may be those of passive lines; pulleys, and the frame that yields, are of winches alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from seecr.description.robot import Robot
from seecr.effects.base import Effect, OfRobot, Total, mean_length, of_length, parameter
from seecr.effects.setup import Setup
from seecr.pose import Array

# No sheave's radius is this part of the cables' length: they would hardly leave it.
_WIDEST = 0.4


@dataclass(frozen=True, eq=False)
class PulleyRadius(Effect):
    """Cables leave over swivelling sheaves of this radius.

    The cable enters at A_i vertically from below, runs over the top of a sheave whose centre
    is at A_i + r e, e the horizontal direction to the anchor point, and leaves along the
    tangent; length = r (pi - psi) + free part (Pott, Cable-Driven Parallel Robots, 2018,
    section 7.2, with the wrap measured from the point of entry).
    """

    name: ClassVar[str] = "pulley_radius"
    place: ClassVar[str] = "geometry"
    title: ClassVar[str] = "pulleys with a radius"
    advice: ClassVar[str] = "measure a sheave with a caliper: expect a radius of {radius:.1f} mm"

    radius: float = parameter("m", of_length(0.02), bounds=(0.0, of_length(0.5)))

    def edit_setup(self, setup: Setup) -> None:
        setup.pulley_radius = setup.pulley_radius + self.radius

    def totals(self, robot: Robot) -> dict[str, Total]:
        widest = _WIDEST * mean_length(robot)
        return {"radius": Total(self.radius, 0.0, "m", upper=widest)}


@dataclass(frozen=True, eq=False)
class ExitPointError(Effect):
    """Exit points are off by a vector each, in the base frame: A_i -> A_i + error_i.

    True less assumed.
    """

    name: ClassVar[str] = "exit_point_error"
    anew: ClassVar[tuple[str, ...]] = ("file", "run")
    place: ClassVar[str] = "geometry"
    title: ClassVar[str] = "misplaced exit points"
    advice: ClassVar[str] = (
        "survey the exit points with the tracker: expect the errors found, the largest "
        "{largest:+.1f} mm ({which}: {total:.1f} mm, not {total_nominal:.1f})"
    )

    error: Array = parameter("m", of_length(2e-3), size="point")

    def edit_setup(self, setup: Setup) -> None:
        setup.exit_points = setup.exit_points + self.error.reshape(-1, 3)

    def totals(self, robot: Robot) -> dict[str, Total]:
        return _points(robot.exit_points, self.error)


@dataclass(frozen=True, eq=False)
class AnchorPointError(Effect):
    """Anchor points are off by a vector each, in the platform frame: B_i -> B_i + error_i.

    True less assumed.
    """

    name: ClassVar[str] = "anchor_point_error"
    anew: ClassVar[tuple[str, ...]] = ("file",)
    place: ClassVar[str] = "geometry"
    title: ClassVar[str] = "misplaced anchor points"
    advice: ClassVar[str] = (
        "measure the platform's anchor points: expect the errors found, the largest "
        "{largest:+.1f} mm ({which}: {total:.1f} mm, not {total_nominal:.1f})"
    )

    error: Array = parameter("m", of_length(2e-3), size="point")

    def edit_setup(self, setup: Setup) -> None:
        setup.anchor_points = setup.anchor_points + self.error.reshape(-1, 3)

    def totals(self, robot: Robot) -> dict[str, Total]:
        return _points(robot.anchor_points, self.error)


def _points(nominal: Array, error: Array) -> dict[str, Total]:
    """Coordinates (m, 3) of points, each under the name of its error."""
    return {
        f"error_{i + 1}_{axis}_m": Total(float(point[k] + off[k]), float(point[k]), "m")
        for i, (point, off) in enumerate(zip(nominal, error.reshape(-1, 3), strict=True))
        for k, axis in enumerate("xyz")
    }


# A frame that yields a third as much as its cables stretch.
_PLAUSIBLE = OfRobot(
    "0.3 x the mean cable length / the mean E S",
    lambda robot: 0.3 * mean_length(robot) / robot.mean_ea,
)


@dataclass(frozen=True, eq=False)
class FrameCompliance(Effect):
    """Exit points yield to the pull of their cable: A_i -> A_i + C T_i u, C = diag(s, s, upwards).

    u points from A_i along the cable, s is the compliance sideways (Hooke); up is against
    gravity. Frames are stiffer upwards than sideways. Where both are alike the frame moves the
    way it is pulled and the cable is longer by s T_i: from poses this cannot be told from elastic
    cable behind the exit point of length s x E S.
    """

    name: ClassVar[str] = "frame_compliance"
    place: ClassVar[str] = "structure"
    title: ClassVar[str] = "a compliant frame"
    advice: ClassVar[str] = (
        "pull an exit point with a spring balance beside a dial gauge: expect {sideways:.4g} mm "
        "per newton sideways, {upwards:.4g} mm upwards"
    )
    renamed: ClassVar[dict[str, tuple[str, ...]]] = {
        "compliance_m_per_N": ("sideways_m_per_N", "upwards_m_per_N")
    }

    sideways: float = parameter("m_per_N", _PLAUSIBLE, bounds=(0.0, 1e3))
    upwards: float = parameter("m_per_N", _PLAUSIBLE, bounds=(0.0, 1e3))

    def edit_setup(self, setup: Setup) -> None:
        setup.compliance = setup.compliance + self.sideways
        setup.lift = setup.lift + (self.upwards - self.sideways)
