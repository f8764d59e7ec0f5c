"""What a foreign file says of a robot, and the robot that this makes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from seecr.counted import some
from seecr.description.cables import EXAMPLE, ea_of
from seecr.description.mjcf import load_robot
from seecr.description.points import home_of, plane_of, robot_numbers
from seecr.description.robot import Joint, Robot
from seecr.errors import InputError, SeecrError
from seecr.files import written
from seecr.pose import Array
from seecr.units import in_si, millimetres


@dataclass(frozen=True, eq=False)
class Draft:
    """A robot as a file and a user say it; what they do not say is None, of single cables NaN.

    Attributes:
        path: of the file. name: of the robot.
        exit_points, anchor_points: (m, 3) [m], in the base and in the platform's frame.
        ea, stiffness: (m,) [N] and [N/m].
        cable_names: m names, or none.
        mass: [kg]. centre_of_mass: (3,) [m]. inertia: (3, 3) [kg m^2].
        pose: the reference pose (7,), or its position (3,).
        joints: of the platform, empty for a free one; None if ``plane`` decides.
        plane: xy, xz, yz; None for free; auto if it is to be deduced.
        limits: [N] lowest and highest tension that all cables may have.
        notes: what the file says and no robot holds.
    """

    path: Path
    name: str
    exit_points: Array
    anchor_points: Array
    ea: Array
    stiffness: Array
    cable_names: tuple[str, ...] = ()
    mass: float | None = None
    centre_of_mass: Array | tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: Array | None = None
    pose: Array | tuple[float, ...] | None = None
    joints: tuple[Joint, ...] | None = None
    plane: str | None = "auto"
    limits: tuple[float, float] = (0.0, np.inf)
    notes: tuple[str, ...] = ()

    def with_options(
        self, mass: str | None = None, ea: str | None = None, at: tuple[float, ...] | None = None,
        com: tuple[float, ...] | None = None, planar: str | None = None, free: bool = False,
    ) -> Draft:  # fmt: skip
        """The same with what a user says, which goes before what the file says.

        Args:
            mass: such as 25kg. ea: such as 3e5N, or a rope.
            at: the reference pose. com: the centre of mass.
            planar: the platform's plane, or auto for that of all points. free: it has none.

        Raises:
            InputError: no quantity of that kind, or points in no plane.
        """
        changes: dict[str, Any] = {}
        if mass is not None:
            changes["mass"] = in_si(mass, "kg")
            if changes["mass"] is None or changes["mass"] <= 0.0:
                text = f"--mass: expected a mass above zero with its unit, as 25kg, got {mass!r}"
                raise InputError(text)
        if ea is not None:
            strength, note = ea_of(ea, "--ea")
            changes["ea"] = np.full(len(self.ea), strength)
            changes["stiffness"] = np.full(len(self.ea), np.nan)
            changes["notes"] = (*self.notes, note) if note else self.notes
        if com is not None:
            changes["centre_of_mass"] = com
        if planar is not None or free:
            if planar == "auto":
                points = (self.exit_points, self.anchor_points)
                # a level platform below a level frame has two: at home it is in one
                planar = plane_of(*points, home_of(*points, None)) or plane_of(*points)
            if planar is None and not free:
                text = f"{self.path}: its points are in no one plane; say --planar xy, xz or yz"
                raise InputError(text)
            changes |= {"joints": None, "plane": None if free else planar}
        elif at is not None and self.joints:
            text = f"{self.path}: its joints belong to its own reference pose; leave out --at"
            raise InputError(text)
        if at is not None:
            changes["pose"] = at
        return replace(self, **changes)

    def robot(self) -> tuple[Robot, tuple[str, ...]]:
        """The robot, and what is to be told of it.

        Raises:
            InputError: nobody says the mass or the elasticity, or no robot has these numbers.
        """
        asked = [] if self.mass else ["the platform's mass; give it, such as --mass 25kg"]
        unsaid = np.isnan(self.ea) & np.isnan(self.stiffness)
        if np.any(unsaid):
            names = self.cable_names or [f"cable{i + 1}" for i in range(len(unsaid))]
            which = [name for name, not_said in zip(names, unsaid, strict=True) if not_said]
            of = "its cables stretch" if unsaid.all() else f"{some(which)} stretch"
            asked.append(f"how far {of}; give E S or a rope, such as --ea 3e5N or --ea {EXAMPLE!r}")
        if self.mass is None or asked:
            raise InputError(f"{self.path}: does not say {'; nor '.join(asked)}")
        # nothing keeps a free platform on one point from turning about it: it is a point mass
        one_point = self.joints == () and bool(np.all(self.anchor_points == self.anchor_points[0]))
        try:
            numbers, replaced = robot_numbers(
                self.exit_points, self.anchor_points, self.mass, self.ea, self.stiffness, self.pose,
                None if one_point else self.plane, self.centre_of_mass, self.inertia,
                None if one_point else self.joints,
            )  # fmt: skip
            robot = Robot(self.name, **numbers, cable_names=self.cable_names)
        except SeecrError as error:
            raise InputError(f"{self.path}: {error}") from None
        return robot, (*self.notes, *self._deduced(robot, replaced))

    def _deduced(self, robot: Robot, replaced: bool) -> list[str]:
        """What was deduced of the platform, and what is strange about it."""
        notes = []
        if self.pose is None:
            place = " ".join(f"{part:.4g}" for part in robot.reference_pose[:3])
            notes.append(
                f"the reference pose, where the winches are zeroed, is not given: {place} m is the "
                "middle of the frame; --at X Y Z says another"
            )
        if robot.joints and not self.joints:
            slides = " ".join(joint.name for joint in robot.joints if joint.kind == "slide")
            kind = f"planar: it slides along {slides} and turns; --free frees it"
            if not robot.turns:
                kind = f"a point mass on slides along {slides}, as all its anchor points are one"
            notes.append(f"the platform is {kind}")
        if replaced and robot.turns:
            notes.append(
                "its inertia is that of no body: replaced by that of a solid box around the anchor "
                "points, which affects frequencies alone"
            )
        low, high = robot.anchor_points.min(axis=0), robot.anchor_points.max(axis=0)
        away = np.linalg.norm(robot.centre_of_mass - np.clip(robot.centre_of_mass, low, high))
        told = any("centre of mass" in note for note in self.notes)
        if robot.turns and not told and away > np.linalg.norm(high - low):
            place = " ".join(f"{part:g}" for part in robot.centre_of_mass)
            notes.append(
                f"the centre of mass ({place}) m is {away:.3g} m away from the anchor points, "
                "farther than these are from each other: if it only fills a field, say --com X Y Z"
            )
        return notes


def write_robot(robot: Robot, path: Path, comment: str) -> None:
    """Write a robot's MJCF if it can be read back, and nothing if it cannot.

    Raises:
        InputError: it would be refused, as with a platform larger than its frame.
        InputFileError: the file cannot be written.
    """
    with written(path) as (part,):
        robot.save(part, comment)
        try:
            load_robot(part)
        except SeecrError as error:
            raise InputError(str(error).replace(str(part), f"{path} (not written)")) from None


def pulley_notes(radii: list[float]) -> list[str]:
    """The note about pulleys of these radii [m], which no robot's file holds."""
    known = sorted({radius for radius in radii if radius > 0.0})
    if not known:
        return []
    return [
        f"pulleys of {' and '.join(millimetres(radius, 3) for radius in known)} radius are in no "
        f"robot's file: add the effect pulley_radius with radius_m = {known[-1]:g} to a model"
    ]
