"""MJCF for MuJoCo alone: what of a cable takes bodies and springs of its own.

A cable starts behind its exit point A and ends on the platform:

    winch on a spring - (sheave | exit point on springs) - chain of point masses - anchor point

each part where an effect asks for it. A sheave has a groove, which no geometry of MuJoCo's has:
it is turned to where its cable goes at one pose, so that the file is of that pose.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np

from seecr.exported.chain import hanging
from seecr.exported.scene import cable, dot, numbers, scene, text_of
from seecr.joints import values_of_pose
from seecr.pose import Array, transform_points
from seecr.robot import Robot
from seecr.setup import Setup
from seecr.solution import Solution

SEGMENTS = 24
"""Of a cable with weight; what is left of the catenary goes with one over its square."""

# Mass of what carries exit points and winches over the platform's: gravcomp takes its weight away.
_SMALL = 0.01
# A cable whose way across is a smaller part of it goes straight up.
_ABOVE = 1e-12
# Turns a cylinder's axis, z, to y: across the sheave's plane.
_ACROSS = "0.7071067811865476 -0.7071067811865476 0 0"


def bodies_text(setup: Setup, solution: Solution, comment: str) -> str:
    """The file at one solved pose.

    Args:
        setup: one row, as the effects left it.
        solution: of it; the platform's rest is the keyframe ``rest``.
        comment: a sentence at the top.
    """
    robot = _described(setup)
    root, world, body = scene(robot, comment)
    tendons = ET.Element("tendon")
    ends = transform_points(solution.pose, robot.anchor_points)[0]
    joints: list[float] = []
    for i in range(robot.n_cables):
        joints += _Cable(setup, solution, i, ends[i]).write(world, body, tendons)
    root.append(tendons)
    _push(root, world, body, setup.wrench[0])
    rest = solution.pose[0]
    if robot.joints:
        rest = values_of_pose(robot, solution.pose)[0][0]
    frames = ET.SubElement(root, "keyframe")
    ET.SubElement(frames, "key", name="rest", qpos=numbers(rest, joints))
    return text_of(root)


def _described(setup: Setup) -> Robot:
    """The robot with the numbers that its description has a place for."""
    return replace(
        setup.robot, exit_points=setup.exit_points, anchor_points=setup.anchor_points,
        ea=setup.ea, mass=setup.mass, centre_of_mass=setup.centre_of_mass, gravity=setup.gravity,
    )  # fmt: skip


def _push(root: ET.Element, world: ET.Element, body: ET.Element, wrench: Array) -> None:
    """A constant wrench (6,) at the platform's origin, in the base frame's directions."""
    if not np.any(wrench):
        return
    ET.SubElement(world, "site", name="base")
    ET.SubElement(body, "site", name="origin")
    ET.SubElement(
        ET.SubElement(root, "actuator"), "general", name="wrench", site="origin", refsite="base",
        gear=numbers(wrench), gainprm="0", biastype="affine", biasprm="1",
    )  # fmt: skip


class _Cable:
    """One cable of the file, from its winch to its anchor point (3,) [m] at rest."""

    def __init__(self, setup: Setup, solution: Solution, i: int, end: Array) -> None:
        self.i, self.end, self.robot = i, end, setup.robot
        self.exit, self.up = setup.exit_points[i], setup.robot.up
        self.anchor = setup.anchor_points[i]
        self.length, self.ea = float(solution.rest_lengths[0, i]), float(setup.ea[i])
        self.law = (1.0, float(setup.quadratic[i]), float(setup.cubic[i]))
        self.radius = float(setup.pulley_radius[i])
        sideways, upwards = setup.compliance[i], setup.compliance[i] + setup.lift[i]
        self.series = float(setup.winch_side[i]) / self.ea
        self.yields: list[tuple[Array, float]] = []
        if self.radius > 0.0:
            self.series += float(sideways)
        else:
            across = np.linalg.svd(self.up[None])[2][1:]
            soft = [(axis, float(sideways)) for axis in across] + [(self.up, float(upwards))]
            self.yields = [(axis, by) for axis, by in soft if by > 0.0]
        self.tail = self.length if self.radius > 0.0 or self.series > 0.0 else 0.0
        self.weight = float(setup.cable_weight[i])
        self.gravity = float(np.linalg.norm(setup.gravity))
        self.tension = float(solution.tensions[0, i])
        self.small = _SMALL * setup.mass
        self.at_rest: list[float] = []

    def write(self, world: ET.Element, body: ET.Element, tendons: ET.Element) -> list[float]:
        """Write it; returns where its joints are at rest."""
        self._exit(world)
        nodes = self._chain(world, body) if self.weight > 0.0 else []
        points = [*nodes, f"anchor{self.i + 1}"]
        n, free = len(points), self._free_share()
        name = self.robot.cable_names[self.i]
        for j, point in enumerate(points):
            start = [("site", {"site": nodes[j - 1]})] if j else self._behind()
            part = free / n + (0.0 if j else 1.0 - free)
            own = self.length * part
            curved = [self.ea * c / own ** (k + 1) for k, c in enumerate(self.law)]
            cable(
                tendons, name if n == 1 else f"{name}-{j + 1}",
                [*start, ("site", {"site": point})], own + (0.0 if j else self.tail),
                curved if any(self.law[1:]) else curved[:1], 0.01 * self.robot.length,
            )  # fmt: skip
        return self.at_rest

    def _carrier(self, parent: ET.Element, name: str, place: Array) -> ET.Element:
        """A body of next to no mass that springs hold, and no gravity."""
        body = ET.SubElement(parent, "body", name=name, pos=numbers(place), gravcomp="1")
        turning = 1e-3 * self.small * self.robot.length**2
        ET.SubElement(
            body, "inertial", pos="0 0 0", mass=numbers(self.small),
            diaginertia=numbers([turning] * 3),
        )  # fmt: skip
        return body

    def _spring(self, body: ET.Element, axis: Array, compliance: float, pull: float) -> None:
        """A spring along an axis, and where it rests under a pull [N]."""
        ET.SubElement(
            body, "joint", type="slide", axis=numbers(axis), stiffness=numbers(1.0 / compliance)
        )
        self.at_rest.append(compliance * pull)

    def _exit(self, world: ET.Element) -> None:
        """Exit point, winch and sheave, each on what holds it."""
        number, parent, place = self.i + 1, world, self.exit
        along = (self.end - place) / np.linalg.norm(self.end - place)
        if self.yields:
            parent, place = self._carrier(world, f"frame{number}", place), np.zeros(3)
            for axis, by in self.yields:
                self._spring(parent, axis, by, self.tension * float(axis @ along))
        ET.SubElement(
            parent, "site", name=f"exit{number}", pos=numbers(place), size=dot(self.robot)
        )
        below = place - self.tail * self.up
        if self.series > 0.0:
            winch = self._carrier(parent, f"winch{number}", below)
            self._spring(winch, self.up, self.series, self.tension)
            ET.SubElement(winch, "site", name=f"winch{number}")
        elif self.radius > 0.0:
            ET.SubElement(parent, "site", name=f"winch{number}", pos=numbers(below))
        if self.radius > 0.0:
            self._sheave(world)

    def _sheave(self, world: ET.Element) -> None:
        r, number = self.radius, self.i + 1
        ahead = self._ahead()
        wheel = ET.SubElement(
            world, "body", name=f"sheave{number}", pos=numbers(self.exit),
            xyaxes=numbers(ahead, np.cross(self.up, ahead)),
        )  # fmt: skip
        ET.SubElement(
            wheel, "geom", name=f"sheave{number}", type="cylinder", size=numbers(r, 0.2 * r),
            pos=numbers(r, 0.0, 0.0), quat=_ACROSS, contype="0", conaffinity="0", mass="0",
        )  # fmt: skip
        # over the top: seen from the centre, between the normals to the two tangents
        lean = 0.9 * np.arctan2(r, self.tail)
        side = [r + 2.0 * r * np.sin(lean), 0.0, 2.0 * r * np.cos(lean)]
        ET.SubElement(wheel, "site", name=f"over{number}", pos=numbers(side))

    def _ahead(self) -> Array:
        """Where the sheave is turned to, (3,): to the anchor point; anywhere, if that is above."""
        across = np.linalg.svd(self.up[None])[2][1]
        way = self.end - self.exit
        ahead = way - (way @ self.up) * self.up
        size = np.linalg.norm(ahead)
        return np.asarray(ahead / size if size > _ABOVE * np.linalg.norm(way) else across)

    def _behind(self) -> list[tuple[str, dict[str, str]]]:
        """What the cable goes through up to where it leaves."""
        number = self.i + 1
        winch = [("site", {"site": f"winch{number}"})] if self.tail > 0.0 else []
        if self.radius > 0.0:
            return [*winch, ("geom", {"geom": f"sheave{number}", "sidesite": f"over{number}"})]
        return [*winch, ("site", {"site": f"exit{number}"})]

    def _free_share(self) -> float:
        """Part of the cable that is not on its sheave, as a straight cable has it."""
        if self.radius == 0.0:
            return 1.0
        free, arc = self._leaving()[1:]
        return free / (free + arc)

    def _leaving(self) -> tuple[Array, float, float]:
        """Where it leaves its sheave (3,) [m], and its lengths [m] from there on and before."""
        way, r = self.end - self.exit, self.radius
        rise = float(way @ self.up)
        across = float(np.linalg.norm(way - rise * self.up))
        free = float(np.sqrt((across - r) ** 2 + rise**2 - r**2))
        psi = np.arctan2(rise, across - r) + np.arctan2(free, r)
        out = r * (1.0 + np.cos(psi)) * self._ahead() + r * np.sin(psi) * self.up
        return self.exit + out, free, float(r * (np.pi - psi))

    def _chain(self, world: ET.Element, body: ET.Element) -> list[str]:
        """Point masses between segments, and half a one on the platform; names of their sites."""
        start = self._leaving()[0] if self.radius > 0.0 else self.exit
        free = self.length * self._free_share()
        mass = self.weight * free / SEGMENTS / self.gravity
        hung = hanging(start, self.end, free, self.ea, self.weight * self.up, SEGMENTS)
        names = []
        for j, place in enumerate(hung, start=1):
            name = f"node{self.i + 1}-{j}"
            node = ET.SubElement(world, "body", name=name, pos=numbers(place))
            for axis in np.eye(3):
                ET.SubElement(node, "joint", type="slide", axis=numbers(axis))
            self._point(node, mass)
            ET.SubElement(node, "site", name=name, size=dot(self.robot))
            names.append(name)
            self.at_rest += [0.0, 0.0, 0.0]
        half = ET.SubElement(body, "body", pos=numbers(self.anchor))
        self._point(half, 0.5 * mass)
        return names

    def _point(self, body: ET.Element, mass: float) -> None:
        turning = 1e-3 * mass * self.robot.length**2
        ET.SubElement(
            body, "inertial", pos="0 0 0", mass=numbers(mass), diaginertia=numbers([turning] * 3)
        )
