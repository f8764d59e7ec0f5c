"""MJCF for MuJoCo alone: cables that need bodies and springs of their own.

A cable starts behind its exit point A and ends on the platform:
    winch on a spring - (sheave | exit point on springs) - chain of point masses - anchor point

with each part only if an effect needs it. MuJoCo has no swivelling sheave with a groove: sheaves
face their cables at one pose, so that the file is for that pose.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace

import numpy as np

from seecr.compiled.columns import UP
from seecr.description.joints import values_of_pose
from seecr.description.mjcf_text import cable, dot, numbers_text, scene, text_of
from seecr.description.passive import write_pull
from seecr.description.robot import Robot
from seecr.effects.setup import Setup
from seecr.pose import Array, transform_points
from seecr.statics.solution import Solution

# A hanging cable as a chain of springs with point masses, in equilibrium where the catenary is.
#
# A chain of n springs with equal masses deviates from its catenary by an error of order 1/n^2.
# Most of that vanishes if the masses between carry a little more of the weight and the ends a
# little less. The rest is removed at the pose of the file: the chain is built up from the anchor
# point, with the catenary's pull there, and the exit point is moved to where the chain ends.

# Most Newton steps to a strain; four suffice.
_ROUNDS = 20


@dataclass(frozen=True)
class HangingCable:
    """The cable that a chain replaces, in its vertical plane: (across, up) from the exit point.

    Attributes:
        span: (2,) [m] position of its anchor point.
        pull: (2,) [N] of the cable on its anchor point.
        weight: [N] of its free part.
        length: [m] unstretched, of its free part.
        ea: [N].
        law: (3,) coefficients of the strain, its square and its cube:
            T = ea (law . (e, e^2, e^3)).
        radius: [m] of the sheave, whose centre is at (radius, 0); 0 without one.
    """

    span: Array
    pull: Array
    weight: float
    length: float
    ea: float
    law: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class HangingChain:
    """A chain of n springs in equilibrium, in its vertical plane.

    Attributes:
        places: (n - 1, 2) [m] of the masses, from the exit point on.
        between, end: [N] weight of each mass, and of those at either end.
        tension: (n,) [N] of the springs, from the exit point on.
        strain: (n,) at which the cable's law has these tensions.
        length: (n,) [m] of the springs, the uppermost from where it leaves its sheave.
        leaning: [rad] angle from straight down at which it leaves.
        beside: (2,) [m] from the exit point to that of the chain.
    """

    places: Array
    between: float
    end: float
    tension: Array
    strain: Array
    length: Array
    leaning: float
    beside: Array


def hanging(cable: HangingCable, n: int) -> HangingChain:
    """The chain of n springs that hangs like a catenary.

    Each mass between carries 1/sqrt(1 - 1/n^2) of an equal share. Then the mean square of the
    springs' pull across a taut cable is that of the catenary, and so is the loss of span by sag
    (our own derivation). Springs have the catenary's length for a linear law; nonlinear parts are
    in series.
    """
    between = cable.weight / np.sqrt(n**2 - 1.0)
    force = np.tile(cable.pull, (n, 1))
    # whatever the masses between carry, the middle of the cable carries half the weight
    force[:, 1] += 0.5 * cable.weight + between * (np.arange(n) - 0.5 * (n - 1))
    tension = np.hypot(force[:, 0], force[:, 1])
    along = force / tension[:, None]
    length = cable.length / n * (1.0 + tension / cable.ea)
    places = cable.span + np.cumsum(length[:-1, None] * along[:-1], axis=0)
    # the line of the uppermost spring touches the sheave, or passes through the exit point
    last, way = along[-1], np.array([cable.radius, 0.0]) - places[-1]
    off = way[0] * last[1] - way[1] * last[0] + cable.radius
    length[-1] = way @ last
    return HangingChain(
        places[::-1], between, 0.5 * (cable.weight - (n - 1) * between), tension[::-1],
        _strain(cable, tension[::-1]), length[::-1], float(np.arctan2(-last[0], last[1])),
        off * np.array([-last[1], last[0]]),
    )  # fmt: skip


def _strain(cable: HangingCable, tension: Array) -> Array:
    """Strains (n,) at which the law gives tensions (n,) [N], by Newton's method."""
    by, square, cube = cable.law
    strain = tension / cable.ea
    if square or cube:
        for _ in range(_ROUNDS):
            over = strain * (by + strain * (square + strain * cube)) - tension / cable.ea
            strain = strain - over / (by + strain * (2.0 * square + strain * 3.0 * cube))
    return np.asarray(strain)


# How MuJoCo moves the bodies of cables: a time step that is stable, and drag that ends swinging.
#
# Neither shifts an equilibrium. MuJoCo's `discrete` integrator is implicit in springs, but in
# their stiffness at the beginning of a step only: as cables turn, long steps add energy.

# Largest angle by which the fastest motion of a cable advances in a step [rad]. Pushed platforms on
# hanging cables stayed at rest up to 117 and ran away from 148.
_PER_STEP = 30.0
# MuJoCo's own step [s], where cables allow it.
_LONGEST = 0.002


def fastest(stiffness: float, mass: float) -> float:
    """Bound of the angular frequencies [1/s] of masses [kg] between springs [N/m] on either side.

    It is that of neighbours that move against each other.
    """
    return float(2.0 * np.sqrt(stiffness / mass))


def drag(tension: float, length: float, mass: float, part: float) -> float:
    """Drag coefficient [N s/m] that damps the first mode of a cable of this mean tension [N],
    length [m] and mass [kg] critically, and acts on a part [kg] of it.
    """
    first = np.pi * np.sqrt(tension / (mass * length))
    return float(2.0 * first * part)


def take_steps(root: ET.Element, rate: float, damped: bool) -> None:
    """Write the time step of a file whose cables have bodies of their own, and say why.

    Their fastest motion has the angular frequency ``rate`` [1/s], 0 without bodies; masses have
    drag and are ``damped``.
    """
    if rate == 0.0:
        return
    step = min(_LONGEST, _PER_STEP / rate)
    option = next(root.iter("option"))
    option.set("timestep", f"{step:.2g}")
    if not damped:
        return
    # conjugate gradients end after as many steps as there are unknowns; MuJoCo stops at 100
    option.set("iterations", str(6 + sum(1 for _ in root.iter("joint"))))
    root.insert(
        list(root).index(option),
        ET.Comment(
            f" parts of cables swing at up to {rate:.2g} rad/s: longer steps than {step:.2g} s may "
            "be unstable. Their drag only ends their swinging; where they rest it is zero "
        ),
    )


SEGMENTS = 24
"""Springs of a cable with weight. At the pose of the file they hang exactly as the catenary does,
elsewhere nearly so.
"""

# Mass of carriers of exit points and winches [platform's mass]; gravcomp removes its weight.
_SMALL = 0.01
# A cable whose horizontal extent is a smaller part of its length goes straight up or down.
_ABOVE = 1e-12
# Turns a cylinder's axis from z to y, normal to the sheave's plane.
_ACROSS = "0.7071067811865476 -0.7071067811865476 0 0"


def bodies_text(setup: Setup, solution: Solution, comment: str) -> str:
    """The file at one solved pose, its keyframe ``rest``, of one row as the effects left it."""
    robot = _described(setup)
    root, world, body = scene(robot, comment)
    tendons = ET.Element("tendon")
    ends = transform_points(solution.pose, robot.anchor_points)[0]
    cables = [_Cable(setup, solution, i, ends[i]) for i in range(robot.n_cables)]
    joints = [value for one in cables for value in one.write(world, body, tendons)]
    root.append(tendons)
    take_steps(root, max(one.rate() for one in cables), any(one.chain for one in cables))
    _push(root, world, body, setup.wrench[0])
    for i in np.flatnonzero(robot.constant_tension_N):
        write_pull(root, robot.cable_names[i], float(robot.constant_tension_N[i]))
    rest = solution.pose[0]
    if robot.joints:
        rest = values_of_pose(robot, solution.pose)[0][0]
    frames = ET.SubElement(root, "keyframe")
    ET.SubElement(frames, "key", name="rest", qpos=numbers_text(rest, joints))
    return text_of(root)


def _described(setup: Setup) -> Robot:
    """The robot with the edited quantities that its description can hold."""
    return replace(
        setup.robot, exit_points=setup.exit_points, anchor_points=setup.anchor_points,
        ea=setup.ea, mass=setup.mass, centre_of_mass=setup.centre_of_mass, gravity=setup.gravity,
    )  # fmt: skip


def _push(root: ET.Element, world: ET.Element, body: ET.Element, wrench: Array) -> None:
    """A constant wrench (6,) at the platform's origin, in the directions of the base frame."""
    if not np.any(wrench):
        return
    ET.SubElement(world, "site", name="base")
    ET.SubElement(body, "site", name="origin")
    ET.SubElement(
        ET.SubElement(root, "actuator"), "general", name="wrench", site="origin", refsite="base",
        gear=numbers_text(wrench), gainprm="0", biastype="affine", biasprm="1",
    )  # fmt: skip


class _Cable:
    """One cable of the file, from its winch to its anchor point (3,) [m] at the equilibrium."""

    def __init__(self, setup: Setup, solution: Solution, i: int, end: Array) -> None:
        self.i, self.end, self.robot = i, end, setup.robot
        self.exit, self.anchor = setup.exit_points[i], setup.anchor_points[i]
        # the vertical of the planes in which cables hang and sheaves stand
        self.up = solution.tables.load[0, UP : UP + 3]
        self.length, self.ea = float(solution.rest_lengths[0, i]), float(setup.ea[i])
        self.law = (1.0, float(setup.quadratic[i]), float(setup.cubic[i]))
        self.radius = float(setup.pulley_radius[i])
        self.sideways = float(setup.compliance[i])
        upwards = self.sideways + float(setup.lift[i])
        self.pushes = bool(setup.robot.pushes[i])
        self.series = float(setup.winch_side[i]) / self.ea if self.ea > 0.0 else 0.0
        self.yields: list[tuple[Array, float]] = []
        if self.radius > 0.0:
            self.series += self.sideways
        else:
            across = np.linalg.svd(self.up[None])[2][1:]
            soft = [(axis, self.sideways) for axis in across] + [(self.up, upwards)]
            self.yields = [(axis, by) for axis, by in soft if by > 0.0]
        self.tail = self.length if self.radius > 0.0 or self.series > 0.0 else 0.0
        self.gravity = float(np.linalg.norm(setup.gravity))
        self.small = _SMALL * setup.mass
        self.at_rest: list[float] = []
        along = (end - self.exit) / np.linalg.norm(end - self.exit)
        self.tension = float(solution.tensions[0, i] * setup.robot.falls[i])
        self.pull, self.weight = self.tension * along, 0.0
        self.chain: HangingChain | None = None
        if setup.cable_weight[i] > 0.0:
            self.weight = float(setup.cable_weight[i]) * self.length
            self._hang(float(setup.cable_weight[i]), *solution.evaluation.guess[0, i])

    def _hang(self, weight: float, flat: float, steep: float, free: float) -> None:
        """Make it a chain: weight [N/m], pull on the anchor point [N], free length [m]."""
        self.pull = flat * self._ahead() - (steep + self.weight) * self.up
        if self.yields:
            # the catenary adds the exit point's motion to its length; here the exit point itself
            # moves
            free -= self.sideways * self.tension / (1.0 + self.tension / self.ea)
        away = self.end - self.exit - self._given_way()
        span = np.array([away @ self._ahead(), away @ self.up])
        pull = np.array([-flat, steep])
        cable = HangingCable(span, pull, weight * free, free, self.ea, self.law, self.radius)
        self.chain, self.free = hanging(cable, SEGMENTS), free
        self.tension = float(self.chain.tension[0])
        self.exit = self.exit + self._by(self.chain.beside)

    def _by(self, way: Array) -> Array:
        """Base-frame vector (3,) of (across, up) in the cable's vertical plane."""
        return np.asarray(way[0] * self._ahead() + way[1] * self.up)

    def _given_way(self) -> Array:
        """Displacement of the exit point, (3,) [m]."""
        moved = np.zeros(3)
        for axis, by in self.yields:
            moved += by * float(self.pull @ axis) * axis
        return moved

    def write(self, world: ET.Element, body: ET.Element, tendons: ET.Element) -> list[float]:
        """Write the cable; returns the equilibrium values of its joints."""
        carrier = self._exit(world)
        nodes = [] if self.chain is None else self._chain(self.chain, world, body, carrier)
        points = [*nodes, f"anchor{self.i + 1}"]
        name = self.robot.cable_names[self.i]
        for j, point in enumerate(points):
            start = [("site", {"site": nodes[j - 1]})] if j else self._behind()
            own, rest = self._spring_of_cable(j)
            curved = [self.ea * c / own ** (k + 1) for k, c in enumerate(self.law)]
            cable(
                tendons, name if self.chain is None else f"{name}-{j + 1}",
                [*start, ("site", {"site": point})], rest,
                curved if any(self.law[1:]) else curved[:1], 0.01 * self.robot.length,
                self.pushes,
            )  # fmt: skip
        return self.at_rest

    def rate(self) -> float:
        """Bound of the angular frequency [1/s] of its own bodies between its springs; 0 if none.

        Springs of joints do not count: they are linear, so that no step is too long for them.
        """
        carried = [self.small] if self.yields or self.series > 0.0 else []
        own, strain = self.length, np.array([self.tension / self.ea if self.ea > 0.0 else 0.0])
        if self.chain is not None:
            carried.append(self.chain.between / self.gravity)
            own, strain = self.free / SEGMENTS, self.chain.strain
        by, square, cube = self.law
        slope = by + strain * (2.0 * square + 3.0 * cube * strain)
        return max((fastest(self.ea * slope.max() / own, one) for one in carried), default=0.0)

    def _spring_of_cable(self, j: int) -> tuple[float, float]:
        """Unstretched and rest length [m] of the j-th spring from the exit point."""
        if self.chain is None:
            return self.length, self.length + self.tail
        own, way, strain = self.free / SEGMENTS, self.chain.length[j], self.chain.strain[j]
        if j == 0:
            arc = self.radius * (np.pi - self.chain.leaning)
            own += arc / (1.0 + strain)
            way += arc + (self.tail - self.series * self.tension if self.tail else 0.0)
        return own, way - own * strain

    def _carrier(self, parent: ET.Element, name: str, place: Array) -> ET.Element:
        """A body of small mass, held by springs, without weight."""
        body = ET.SubElement(parent, "body", name=name, pos=numbers_text(place), gravcomp="1")
        self._weigh(body, self.small)
        return body

    def _spring(self, body: ET.Element, axis: Array, compliance: float, pull: float) -> None:
        """Add a spring along an axis, and its equilibrium value under a pull [N]."""
        ET.SubElement(
            body,
            "joint",
            type="slide",
            axis=numbers_text(axis),
            stiffness=numbers_text(1.0 / compliance),
        )
        self.at_rest.append(compliance * pull)

    def _exit(self, world: ET.Element) -> ET.Element:
        """Write exit point, winch and sheave; returns the body that holds the first."""
        number, parent, place = self.i + 1, world, self.exit
        if self.yields:
            parent, place = self._carrier(world, f"frame{number}", place), np.zeros(3)
            for axis, by in self.yields:
                self._spring(parent, axis, by, float(self.pull @ axis))
        ET.SubElement(
            parent, "site", name=f"exit{number}", pos=numbers_text(place), size=dot(self.robot)
        )
        below = place - self.tail * self.up
        if self.series > 0.0:
            winch = self._carrier(parent, f"winch{number}", below)
            self._spring(winch, self.up, self.series, self.tension)
            ET.SubElement(winch, "site", name=f"winch{number}")
        elif self.radius > 0.0:
            ET.SubElement(parent, "site", name=f"winch{number}", pos=numbers_text(below))
        if self.radius > 0.0:
            self._sheave(world)
        return parent

    def _sheave(self, world: ET.Element) -> None:
        r, number = self.radius, self.i + 1
        ahead = self._ahead()
        wheel = ET.SubElement(
            world, "body", name=f"sheave{number}", pos=numbers_text(self.exit),
            xyaxes=numbers_text(ahead, np.cross(self.up, ahead)),
        )  # fmt: skip
        ET.SubElement(
            wheel, "geom", name=f"sheave{number}", type="cylinder", size=numbers_text(r, 0.2 * r),
            pos=numbers_text(r, 0.0, 0.0), quat=_ACROSS, contype="0", conaffinity="0", mass="0",
        )  # fmt: skip
        # On top, where MuJoCo is to lay the cable. MuJoCo 4 wants this between the normals of both
        # tangents, 3.13 nearer to the arc's middle than to that of the way round below. For every
        # direction of a cable of half to twice its length, both hold by this angle to the exit.
        lean = 0.5 * np.arctan2(r, self.tail)
        side = [r - 2.0 * r * np.sin(lean), 0.0, 2.0 * r * np.cos(lean)]
        ET.SubElement(wheel, "site", name=f"over{number}", pos=numbers_text(side))

    def _ahead(self) -> Array:
        """Horizontal direction (3,) to the anchor point; arbitrary if there is none."""
        across = np.linalg.svd(self.up[None])[2][1]
        way = self.end - self.exit
        ahead = way - (way @ self.up) * self.up
        size = np.linalg.norm(ahead)
        return np.asarray(ahead / size if size > _ABOVE * np.linalg.norm(way) else across)

    def _behind(self) -> list[tuple[str, dict[str, str]]]:
        """The path of the cable up to the point where it leaves."""
        number = self.i + 1
        winch = [("site", {"site": f"winch{number}"})] if self.tail > 0.0 else []
        if self.radius > 0.0:
            return [*winch, ("geom", {"geom": f"sheave{number}", "sidesite": f"over{number}"})]
        return [*winch, ("site", {"site": f"exit{number}"})]

    def _chain(
        self, chain: HangingChain, world: ET.Element, body: ET.Element, carrier: ET.Element
    ) -> list[str]:
        """Write point masses between springs and at the ends; returns the sites between."""
        start = self.exit - self._by(chain.beside) + self._given_way()
        mass, part = self.weight / self.gravity, chain.between / self.gravity
        slowing = numbers_text(drag(self.tension, self.free, mass, part))
        names = []
        for j, place in enumerate(chain.places, start=1):
            name = f"node{self.i + 1}-{j}"
            there = start + self._by(place)
            node = ET.SubElement(world, "body", name=name, pos=numbers_text(there))
            for axis in np.eye(3):
                ET.SubElement(node, "joint", type="slide", axis=numbers_text(axis), damping=slowing)
            self._weigh(node, part)
            ET.SubElement(node, "site", name=name, size=dot(self.robot))
            names.append(name)
            self.at_rest += [0.0, 0.0, 0.0]
        end = ET.SubElement(body, "body", pos=numbers_text(self.anchor))
        self._weigh(end, chain.end / self.gravity)
        if self.yields:
            rest = self.weight - (SEGMENTS - 1) * chain.between - chain.end
            self._weigh(ET.SubElement(carrier, "body"), rest / self.gravity)
        return names

    def _weigh(self, body: ET.Element, mass: float) -> None:
        """Give a body a mass [kg] that hardly resists turning."""
        turning = 1e-3 * mass * self.robot.length**2
        ET.SubElement(
            body, "inertial", pos="0 0 0", mass=numbers_text(mass),
            diaginertia=numbers_text([turning] * 3),
        )  # fmt: skip
