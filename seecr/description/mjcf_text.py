"""MJCF as text: as its author wrote it, and that of a platform on cables with all digits."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike

from seecr.description.passive import write_kinds
from seecr.errors import RobotError
from seecr.pose import quat_conjugate, quat_rotate

if TYPE_CHECKING:
    from seecr.description.robot import Robot


class MjcfText:
    """The XML of a robot's file, read when it is needed.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def root(self) -> ET.Element:
        """The root, with the content of included files instead of ``<include>``."""
        return self._parsed(self.path)

    def _parsed(self, path: Path) -> ET.Element:
        parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
        try:
            root = ET.fromstring(path.read_bytes(), parser)
        except (ET.ParseError, OSError) as error:
            raise RobotError(f"{path}: cannot be read as XML: {error}") from None
        for parent in list(root.iter()):
            for child in [one for one in parent if one.tag == "include"]:
                inside = self._parsed(self._beside(path, child.get("file", "")))
                at = list(parent).index(child)
                parent.remove(child)
                for k, one in enumerate(inside):
                    parent.insert(at + k, one)
        return root

    def _beside(self, path: Path, name: str) -> Path:
        """An included file, which is named as seen from the main one."""
        main = self.path.parent / name
        return main if main.is_file() else path.parent / name

    @cached_property
    def tendons(self) -> list[ET.Element]:
        """The tendons, in MuJoCo's order."""
        sections = [one for one in self.root if one.tag == "tendon"]
        return [one for part in sections for one in part if one.tag in ("spatial", "fixed")]

    def attribute(self, i: int, name: str) -> str | None:
        """What is written for tendon i, itself or by its class; None without."""
        if i >= len(self.tendons):
            return None  # another file's, attached by MuJoCo
        tendon = self.tendons[i]
        if name in tendon.attrib:
            return tendon.get(name)
        return self._of_class(tendon.get("class"), name)

    def _of_class(self, wanted: str | None, name: str) -> str | None:
        """What the defaults of a class say, or of the classes that it is in."""
        parents = {child: parent for parent in self.root.iter() for child in parent}
        tops = [one for one in self.root if one.tag == "default"]
        every = [one for top in tops for one in top.iter("default")]
        some = [one for one in every if one.get("class") == wanted] if wanted else tops
        for one in some:
            while one.tag == "default":
                for own in one.findall("tendon"):
                    if name in own.attrib:
                        return own.get(name)
                one = parents[one]
        return None


# A robot as MJCF, to be written.

_PLATFORM_COLOUR, _CABLE_COLOUR = "0.13 0.35 0.62 1", "0.10 0.12 0.14 1"


def numbers_text(*values: ArrayLike) -> str:
    """Numbers as MJCF text, without rounding."""
    flat = np.concatenate([np.atleast_1d(np.asarray(value, float)) for value in values])
    return " ".join(repr(float(value) + 0.0) for value in flat)


def scene(robot: Robot, comment: str) -> tuple[ET.Element, ET.Element, ET.Element]:
    """The root of a file, with its ``worldbody`` and the platform's body in it.

    The platform is at the reference pose, with its joints, mass and anchor points. Sites are named
    ``exit1``, ``anchor1`` and so on. Exit points and cables are left to the caller.
    """
    root = ET.Element("mujoco", model=robot.name)
    root.append(ET.Comment(f" {comment.replace('--', '- -')} "))
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", gravity=numbers_text(robot.gravity), integrator="discrete")
    span = np.ptp(np.concatenate([robot.exit_points, robot.reference_pose[None, :3]]), axis=0)
    middle = robot.exit_points.mean(axis=0)
    extent = numbers_text(0.75 * np.linalg.norm(span))
    ET.SubElement(root, "statistic", center=numbers_text(middle), extent=extent)
    ET.SubElement(
        ET.SubElement(root, "asset"), "texture", type="skybox", builtin="gradient",
        rgb1="0.93 0.95 0.97", rgb2="0.6 0.68 0.76", width="64", height="384",
    )  # fmt: skip
    world = ET.SubElement(root, "worldbody")
    above = middle + float(np.linalg.norm(np.ptp(robot.exit_points, axis=0))) * robot.up
    ET.SubElement(world, "light", pos=numbers_text(above), dir=numbers_text(-robot.up))
    return root, world, _platform(world, robot)


def _platform(world: ET.Element, robot: Robot) -> ET.Element:
    place, quat = robot.reference_pose[:3], robot.reference_pose[3:]
    body = ET.SubElement(
        world, "body", name="platform", pos=numbers_text(place), quat=numbers_text(quat)
    )
    if not robot.joints:
        ET.SubElement(body, "freejoint")
    back = quat_conjugate(quat)
    for joint in robot.joints:
        pos = numbers_text(quat_rotate(back, joint.point - place))
        if not joint.ball:
            ET.SubElement(
                body, "joint", name=joint.name, type=joint.kind, pos=pos,
                axis=numbers_text(quat_rotate(back, joint.axis)),
            )  # fmt: skip
        elif joint.name.endswith("_x"):  # the first of three that are one
            ET.SubElement(body, "joint", name=joint.name[:-2], type="ball", pos=pos)
    turning = robot.inertia
    if not np.any(turning):  # unknown, but MuJoCo needs one
        turning = robot.mass * robot.length**2 * np.eye(3)
    six = turning[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ET.SubElement(
        body, "inertial", pos=numbers_text(robot.centre_of_mass), mass=numbers_text(robot.mass),
        fullinertia=numbers_text(six),
    )  # fmt: skip
    half = np.maximum(0.5 * np.ptp(robot.anchor_points, axis=0), 0.1 * robot.length)
    middle = robot.anchor_points.mean(axis=0)
    ET.SubElement(
        body, "geom", type="box", pos=numbers_text(middle), size=numbers_text(half), contype="0",
        conaffinity="0", mass="0", rgba=_PLATFORM_COLOUR,
    )  # fmt: skip
    for i, anchor in enumerate(robot.anchor_points, start=1):
        ET.SubElement(body, "site", name=f"anchor{i}", pos=numbers_text(anchor), size=dot(robot))
    return body


def dot(robot: Robot) -> str:
    """Size of sites, which only matters for the picture."""
    return numbers_text(0.05 * robot.length)


def cable(
    tendons: ET.Element, name: str, path: Sequence[tuple[str, dict[str, str]]], rest: float,
    stiffness: Sequence[float], width: float, pushes: bool = False,
) -> None:  # fmt: skip
    """A spring that pulls, and never pushes unless told to, through elements with attributes.

    Its rest length and width are in [m]; to its stiffness [N/m] the coefficients of the square and
    the cube of its stretch are added if it is curved.
    """
    spatial = ET.SubElement(
        tendons, "spatial", name=name, springlength=numbers_text(rest if pushes else 0.0, rest),
        stiffness=numbers_text(*stiffness), width=numbers_text(width), rgba=_CABLE_COLOUR,
    )  # fmt: skip
    for tag, attributes in path:
        ET.SubElement(spatial, tag, attributes)


def text_of(root: ET.Element) -> str:
    """The file's text."""
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def plain_text(robot: Robot, comment: str) -> str:
    """A robot's description, which :func:`seecr.load_robot` reads back to within a digit or two."""
    root, world, _ = scene(robot, comment)
    for i, point in enumerate(robot.exit_points, start=1):
        ET.SubElement(world, "site", name=f"exit{i}", pos=numbers_text(point), size=dot(robot))
    if robot.floor is not None:
        ET.SubElement(
            world, "geom", type="plane", pos=numbers_text(0.0, 0.0, robot.floor), size="0 0 1",
            contype="0", conaffinity="0",
        )  # fmt: skip
    tendons = ET.SubElement(root, "tendon")
    for i, name in enumerate(robot.cable_names):
        rest = float(robot.rest_lengths[i])
        path = [("site", {"site": f"{end}{i + 1}"}) for end in ("exit", "anchor")]
        stiffness, falls = float(robot.ea[i]) / rest, float(robot.falls[i])
        if falls != 1.0:
            path = [("pulley", {"divisor": numbers_text(1.0 / falls)}), *path]
            rest, stiffness = falls * rest, stiffness / falls**2
        width = 0.01 * robot.length
        cable(tendons, name, path, rest, [stiffness], width, bool(robot.pushes[i]))
    write_kinds(root, robot)
    return text_of(root)
