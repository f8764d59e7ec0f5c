"""Tension from stretch, of the winches' ropes: passive lines are of another make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from seecr.description.robot import Robot
from seecr.effects.base import Effect, OfRobot, Total, mean_length, of_length, parameter
from seecr.effects.setup import Setup
from seecr.pose import Array


def usual_strain(robot: Robot) -> float:
    """Strain of a cable that carries half the weight, or of the pretension if that is more.

    The pretension is the median over the cables at the reference pose, as the robot is described.
    """
    stretched = np.median((robot.reference_lengths / robot.rest_lengths - 1.0)[robot.typical])
    return max(0.5 * robot.usual_load / robot.mean_ea, float(stretched), 1e-9)


def usual_stretch(robot: Robot) -> float:
    """Stretch [m] of such a cable."""
    return usual_strain(robot) * mean_length(robot)


_STRAIN = "the strain of a cable under half the weight (of the pretension, if that is more)"


def _heaviest(robot: Robot) -> float:
    """Weight per metre [N/m] of a cable that is as heavy as the platform: none is."""
    return robot.weight / mean_length(robot) if robot.weight > 0.0 else 1e5


@dataclass(frozen=True, eq=False)
class Stiffness(Effect):
    """All cables are stiffer than assumed by one factor: E S -> factor E S (paper, eq 10).

    Above 1: stiffer. Of the winches' ropes; a passive spring is of another make, see
    ``cable_stiffness``.
    """

    name: ClassVar[str] = "stiffness"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "stiffness of all cables"
    advice: ClassVar[str] = (
        "hang a known weight on a known length of cable: expect E S = {ea:.4g} N, not "
        "{ea_nominal:.4g}"
    )

    factor: float = parameter("", 0.3, null=1.0, bounds=(0.02, 50.0))

    def edit_setup(self, setup: Setup) -> None:
        setup.ea = np.where(setup.robot.driven, setup.ea * self.factor, setup.ea)

    def totals(self, robot: Robot) -> dict[str, Total]:
        ea = robot.mean_ea
        return {"ea": Total(self.factor * ea, ea, "N", lower=0.0)}


@dataclass(frozen=True, eq=False)
class CableStiffness(Effect):
    """Each cable is stiffer than assumed by a factor of its own: E S_i -> factor_i E S_i.

    Above 1: stiffer (paper, eq 10). Passive springs have one, too.
    """

    name: ClassVar[str] = "cable_stiffness"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "stiffness of each cable"
    parent: ClassVar[str] = "stiffness"
    advice: ClassVar[str] = (
        "hang a known weight on each cable: expect the factors found, the one furthest from 1 "
        "being {largest:.3f} ({which}): E S = {total:.4g} N, not {total_nominal:.4g}"
    )

    factor: Array = parameter("", 0.2, null=1.0, bounds=(0.02, 50.0), size="spring")

    def edit_setup(self, setup: Setup) -> None:
        setup.ea = setup.ea * self.factor

    def totals(self, robot: Robot) -> dict[str, Total]:
        return {
            f"factor_{i + 1}": Total(float(factor * ea), float(ea), "N", lower=0.0)
            for i, (ea, factor) in enumerate(zip(robot.ea, self.factor, strict=True))
            if ea > 0.0
        }


@dataclass(frozen=True, eq=False)
class NonlinearElasticity(Effect):
    """Cables stiffen (or soften) as they stretch.

    T = E S (eps + quadratic eps^2 + cubic eps^3), a polynomial in the strain (Kraus, Force
    control of cable-driven parallel robots, 2016). Positive: stiffening. A metre holds the energy
    E S (eps^2/2 + quadratic eps^3/3 + cubic eps^4/4). The slope of a softening cable is never less
    than a hundredth of E S (our own rule): where the polynomial would fall, the cable still pulls
    a little more when it is stretched further.
    """

    name: ClassVar[str] = "nonlinear_elasticity"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "cables that stiffen as they stretch"
    advice: ClassVar[str] = (
        "pull a cable to several loads: expect the curve found, E S = {slope:.4g} N at the usual "
        "load, not {slope_nominal:.4g}"
    )

    quadratic: float = parameter("", OfRobot(f"0.3 / {_STRAIN}", lambda r: 0.3 / usual_strain(r)))
    cubic: float = parameter(
        "", OfRobot(f"0.3 / the square of {_STRAIN}", lambda r: 0.3 / usual_strain(r) ** 2)
    )

    def edit_setup(self, setup: Setup) -> None:
        setup.quadratic = setup.quadratic + self.quadratic
        setup.cubic = setup.cubic + self.cubic

    def totals(self, robot: Robot) -> dict[str, Total]:
        # the slope of the tension where cables usually work: they do not push when pulled
        strain, ea = usual_strain(robot), robot.mean_ea
        slope = 1.0 + 2.0 * self.quadratic * strain + 3.0 * self.cubic * strain**2
        return {"slope": Total(slope * ea, ea, "N", lower=0.0)}


@dataclass(frozen=True, eq=False)
class WinchSideLength(Effect):
    """Elastic cable between winch and exit point, under the same tension.

    It adds a stretch of T length/(E S) (Hooke), whatever the length in front of the exit point.
    """

    name: ClassVar[str] = "winch_side_length"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "elastic cable behind the exit points"
    advice: ClassVar[str] = "measure the cable between drum and exit point: expect {length:.0f} mm"

    length: float = parameter("m", of_length(0.5), bounds=(0.0, 1e4))

    def edit_setup(self, setup: Setup) -> None:
        setup.winch_side = setup.winch_side + self.length


@dataclass(frozen=True, eq=False)
class CableWeight(Effect):
    """Cables have a weight per metre and sag: an elastic catenary between A_i and B_i.

    With H, V the pulls at the anchor point and w the weight per metre, the span is
    x = H (asinh((V + w L)/H) - asinh(V/H))/w + H L/(E S) and likewise the rise (Irvine, Cable
    Structures, 1981, section 1.2). The tension reported is that at the exit point. It has an
    energy, H x + V z - int (T + T^2/(2 E S)) ds and what all else stores. Over a pulley, on which
    the cable is taken to weigh nothing, it has none: round a closed way it does the work
    w r int sin(psi) dS, S what arc and series stretch by; on the DemoBot (0.02 N/m, r 30 mm)
    5e-7 J between two ways to a pose, on CoGiRo (0.63 N/m, r 0.1 m) 1e-6 J.
    """

    name: ClassVar[str] = "cable_weight"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "cables with weight, which sag"
    advice: ClassVar[str] = "weigh ten metres of cable: expect {weight_10m:.2f} N"

    weight: float = parameter(
        "N_per_m",
        OfRobot(
            "2 % of the weight / the mean cable length",
            lambda r: 0.02 * r.usual_load / mean_length(r),
        ),
        bounds=(0.0, _heaviest),
    )

    def edit_setup(self, setup: Setup) -> None:
        setup.cable_weight = setup.cable_weight + self.weight

    def totals(self, robot: Robot) -> dict[str, Total]:
        heaviest = 0.5 * _heaviest(robot)
        return {
            "weight": Total(self.weight, 0.0, "N_per_m", upper=heaviest),
            "weight_10m": Total(10.0 * self.weight, 0.0, "N", upper=10.0 * heaviest),
        }


@dataclass(frozen=True, eq=False)
class Hysteresis(Effect):
    """Cables pull less when they relax than when they are stretched.

    T = E S eps + z, z Dahl's friction of the amplitude given, turning over within the stretch
    e = l0 eps given: dz/de = (amplitude - z sign(de))/stretch (Dahl 1968; for cables
    Miermeister et al. 2015). z = 0 at rest at the start of each run. On the way to each row two to
    eight poses are solved, by the distance; cables are taken to turn round at these.
    """

    name: ClassVar[str] = "hysteresis"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "hysteresis of the cables"
    advice: ClassVar[str] = (
        "load and unload one cable: expect the two curves to differ by twice {amplitude:.3f} N"
    )

    amplitude: float = parameter(
        "N",
        OfRobot(
            "10 % of the weight / the number of cables", lambda r: 0.1 * r.usual_load / r.n_cables
        ),
        bounds=(0.0, 1e6),
    )
    stretch: float = parameter(
        "m",
        OfRobot(f"30 % of the mean cable length x {_STRAIN}", lambda r: 0.3 * usual_stretch(r)),
        null=1e-3, bounds=(1e-9, 10.0), shape=True,
    )  # fmt: skip

    def edit_setup(self, setup: Setup) -> None:
        setup.hysteresis = setup.hysteresis + self.amplitude
        if self.amplitude:
            setup.hysteresis_stretch = np.full_like(setup.hysteresis_stretch, self.stretch)

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        usual = usual_stretch(setup.robot)
        return [{"stretch": part * usual} for part in (0.1, 0.3, 1.0)]


@dataclass(frozen=True, eq=False)
class Creep(Effect):
    """Cables go on stretching under load: Kelvin-Voigt.

    The creep strain c follows time dc/dt = amount T/(E S) - c: under constant tension it ends
    at ``amount`` times the elastic strain. It goes by the clock, through runs and pauses; the
    tension is taken as linear in time between rows, and as that at the reference pose between
    runs.
    """

    name: ClassVar[str] = "creep"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "cables that creep under load"
    needs: ClassVar[tuple[str, ...]] = ("time",)
    advice: ClassVar[str] = "hold one pose for an hour and track it: expect it to sink"

    amount: float = parameter("", 0.2, bounds=(0.0, 100.0))
    time: float = parameter("s", 100.0, null=100.0, bounds=(1e-2, 1e9), shape=True)

    def edit_setup(self, setup: Setup) -> None:
        setup.creep = setup.creep + self.amount
        if self.amount:
            setup.creep_time = np.full_like(setup.creep_time, self.time)

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        time = setup.commands.time
        if time is None or np.ptp(time) == 0:
            return []
        whole = float(np.ptp(time))
        return [{"time": part * whole} for part in (0.01, 0.05, 0.2, 0.7)]


@dataclass(frozen=True, eq=False)
class ExitFriction(Effect):
    """The exit point rubs: the elastic cable behind it feels another tension.

    Capstan (Euler-Eytelwein): the tensions behind and in front differ by at most the factor
    exp(friction), friction = coefficient x wrap angle, against the motion of the cable. It
    shows in the pose through the ``length`` of elastic cable behind the exit point. The motion
    from row to row is taken in two to eight steps, as for ``hysteresis``.
    """

    name: ClassVar[str] = "exit_friction"
    place: ClassVar[str] = "cable"
    title: ClassVar[str] = "friction at the exit points"
    parent: ClassVar[str] = "winch_side_length"
    advice: ClassVar[str] = (
        "pull a cable to and fro over its exit point with a spring balance: expect the two forces "
        "to differ by the factor exp(2 x {friction:.3f})"
    )

    friction: float = parameter("", 0.1, bounds=(0.0, 5.0))
    length: float = parameter("m", of_length(0.5), bounds=(0.0, 1e4))

    def edit_setup(self, setup: Setup) -> None:
        setup.friction = setup.friction + self.friction
        setup.winch_side = setup.winch_side + self.length

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        return [{"length": part * mean_length(setup.robot)} for part in (0.3, 1.0)]
