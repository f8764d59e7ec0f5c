"""``--fix``: a robot's file with what can be mended mended, as its author wrote it otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from seecr.counted import counted
from seecr.description.bodies import body_name, pose_within, reference_of, site_within
from seecr.description.findings import Said, listed, sentences
from seecr.description.mjcf import Reading, load_robot, read_file
from seecr.description.tendons import Way, tendon_name, way_of
from seecr.errors import InputError, RobotError
from seecr.files import check_writable, written
from seecr.pose import Array, quat_rotate, transform_points

if TYPE_CHECKING:
    import mujoco

# Sections that statics have no use for, and that may name what is taken out.
_BESIDE = ("actuator", "keyframe", "equality", "contact", "sensor")
# A wheel stands in a vertical plane if the cosine between its axis and the vertical is below this.
_UPRIGHT = 1e-3
_SAME = 1e-6  # [m] lengths that differ by less are the same
_STRAIGHT = (
    "runs straight from its exit point to its anchor point, with its E S and its stretch at the "
    "reference pose as they were"
)


def write_fixed(path: str | Path, out: Path) -> list[str]:
    """Write a robot's file without what keeps it from being read, or is read otherwise.

    Args:
        path: of the robot. out: a file that does not exist.

    Returns:
        sentences about what was changed; none if nothing is to be, and then nothing is written.

    Raises:
        RobotError: something cannot be mended. InputError: there is such a file.
    """
    reading = read_file(path)
    if out.exists():
        raise InputError(f"--fix: {out} exists; expected the name of a new file")
    lost = reading.found.unfixable
    if lost:
        lines = [f"{reading.path}: --fix cannot mend this, so that nothing is written:"]
        raise RobotError("\n".join([*lines, *(f"  - {text}" for text in lost)]))
    if not reading.found.objections:
        reading.robot()  # sizes that no robot has
    changes = _Mending(reading).done()
    if not changes:
        return []
    files = [one for one in reading.text.root.iter() if one.get("file")]
    if files and out.absolute().parent != reading.path.absolute().parent:
        raise InputError(
            f"--fix: {reading.path} names other files, such as {files[0].get('file')}; expected "
            f"a new file beside it, in {reading.path.parent}"
        )
    check_writable(out)
    text = ET.tostring(reading.text.root, encoding="unicode") + "\n"
    out.parent.mkdir(parents=True, exist_ok=True)
    with written(out) as (part,):
        part.write_text(text, encoding="utf-8", newline="\n")
        try:
            load_robot(part)
        except RobotError as error:
            text = str(error).replace(str(part), "mended it still has a fault")
            raise RobotError(f"{reading.path}: nothing is written: {text}") from None
    return changes


class _Mending:
    """Changes of the XML of a robot that was read."""

    def __init__(self, reading: Reading) -> None:
        self.model, self.root = reading.model, reading.text.root
        self.platform, self.text, self.path = reading.platform, reading.text, reading.path
        self.reference = reference_of(self.model, self.platform)
        self.kinds = reading.kinds
        self.changes: list[Said] = []
        self.parents = {child: parent for parent in self.root.iter() for child in parent}

    def done(self) -> list[str]:
        """Mend all; sentences about what changed."""
        self._turn_on_springs()
        self._take_out_bodies()
        if len(self.text.tendons) != self.model.ntendon:
            raise RobotError(
                f"{self.path}: --fix cannot mend tendons that MuJoCo attaches from other models or "
                "repeats; expected each written as an element of its own"
            )
        for i, tendon in enumerate(list(self.text.tendons)):
            self._mend(i, tendon)
        for kind in _BESIDE:
            self._take_out_section(kind)
        return list(sentences(self.changes))

    def _say(self, kind: str, name: str, text: str, value: str = "") -> None:
        self.changes.append(Said(kind, name, text, value))

    def _remove(self, element: ET.Element) -> None:
        self.parents[element].remove(element)

    def _turn_on_springs(self) -> None:
        for flag in self.root.iter("flag"):
            if flag.attrib.pop("spring", "enable") == "disable":
                self._say("", "", "the flag spring is no longer disabled")

    def _take_out_bodies(self) -> None:
        """Loose bodies; they are found by their number, as MuJoCo counts: depth first."""
        worlds = [one for one in self.root if one.tag == "worldbody"]
        bodies = [body for world in worlds for body in world.iter("body")]
        names = [self.model.body(b).name for b in range(1, self.model.nbody)]
        alike = [body.get("name", "") for body in bodies] == names
        for b in self.platform.loose:
            if not alike:
                raise RobotError(
                    f"{self.path}: --fix cannot take out body {body_name(self.model, b)} among "
                    "bodies that MuJoCo attaches or repeats; expected each written as an element"
                )
            self._remove(bodies[b - 1])
            self._say("body", body_name(self.model, b), "is left out: no cable touches it")

    def _take_out_section(self, kind: str) -> None:
        """Actuators, constraints and keyframes; contacts and sensors where they may name others."""
        sections = [one for one in self.root if one.tag == kind]
        stays = {"contact": not self.platform.loose, "sensor": not self.changes}
        if not sections or stays.get(kind, False):
            return
        count = sum(isinstance(one.tag, str) for section in sections for one in section)
        for section in sections:
            self.root.remove(section)
        self._say("", "", f"<{kind}> with {counted(count, 'element')} is left out")

    def _mend(self, i: int, tendon: ET.Element) -> None:
        model, name = self.model, tendon_name(self.model, i)
        if tendon.tag == "fixed":
            self._remove(tendon)
            self._say("tendon", name, "is left out: it is a fixed tendon, of joints")
            return
        way = way_of(model, self.platform, i)
        if not way.spans:
            self._remove(tendon)
            self._say("tendon", name, "is left out: it is not between the world and the platform")
            return
        rest, stiffness = float(model.tendon_lengthspring[i, 1]), float(model.tendon_stiffness[i])
        if way.geoms or any(way.guides):
            straight, before, stretch = self._straighten(i, tendon, way)
            self._say("tendon", name, f"{_STRAIGHT}{_by_effects(model, way, before)}")
            if self.kinds.constant_tension_N[i] > 0.0:
                return
            # E S stays, and the stretch at the reference pose: what is left out is paid out before
            ea, rest = stiffness * rest, straight - stretch
            tendon.set("stiffness", repr(ea / rest))
        elif model.tendon_lengthspring[i, 0] != 0.0 and not self.kinds.pushes[i]:
            self._say(
                "tendon", name, 'has springlength="0 l0" as it was read, l0 {} m', f"{rest:g}"
            )
        else:
            return
        tendon.set("springlength", f"{rest if self.kinds.pushes[i] else 0} {rest!r}")

    def _straighten(self, i: int, tendon: ET.Element, way: Way) -> tuple[float, float, float]:
        """Two sites instead of the way.

        Returns:
            lengths [m] between them at the reference pose and before the exit point, and the
            stretch [m] there.
        """
        exit_site, anchor_site, _divisor = way.spans[0]
        anchor = site_within(self.model, anchor_site, self.platform.body)
        there = transform_points(self.reference[None], anchor[None])[0, 0]
        came = place = site_within(self.model, exit_site)
        names = [str(self.model.site(site).name) for site in (exit_site, anchor_site)]
        if way.geoms:
            place = _leaves(self.model, way.geoms[-1], there)
            names[0] = f"exit_of_{tendon_name(self.model, i)}"
            world = next(one for one in self.root if one.tag == "worldbody")
            pos = " ".join(repr(float(value)) for value in place)
            ET.SubElement(world, "site", name=names[0], pos=pos).tail = "\n  "
        for one in list(tendon):
            tendon.remove(one)
        for site in names:
            ET.SubElement(tendon, "site", site=site)
        straight = float(np.linalg.norm(place - there))
        before = way.guides[0] + float(np.linalg.norm(came - place))
        length, whole = float(self.model.tendon_length0[i]), sum(way.guides) - way.guides[0]
        whole += before + straight
        # A way over a wheel is longer than the chord from a point of its rim, by half its girth at
        # most, and shorter by less than the radius where it comes in aslant; others are other ways.
        round_it = sum(float(self.model.geom_size[geom, 0]) for geom in way.geoms)
        if not -round_it - _SAME <= length - whole <= np.pi * round_it + _SAME:
            length = whole
            self._say(
                "tendon", tendon_name(self.model, i),
                "passes beside its geom in MuJoCo at the reference pose, and is taken to run over",
            )  # fmt: skip
        return straight, before, length - float(self.model.tendon_lengthspring[i, 1])


def _leaves(model: mujoco.MjModel, geom: int, there: Array) -> Array:
    """The exit point (3,) [m] of a cable over a geom towards ``there``.

    Of a wheel in a vertical plane it is where the cable comes up to it, as pulley_radius counts; of
    others the point of the geom's surface that is nearest to the anchor point.
    """
    position, quat = pose_within(model, int(model.geom_bodyid[geom]))
    centre = position + quat_rotate(quat, model.geom_pos[geom])
    axis = quat_rotate(quat, quat_rotate(model.geom_quat[geom], np.array([0.0, 0.0, 1.0])))
    radius = float(model.geom_size[geom, 0])
    up = -model.opt.gravity / max(float(np.linalg.norm(model.opt.gravity)), 1e-300)
    along = there - centre
    if abs(axis @ up) < _UPRIGHT:
        flat = along - (along @ up) * up
        return np.asarray(centre - radius * flat / np.linalg.norm(flat))
    return np.asarray(centre + radius * along / np.linalg.norm(along))


def _by_effects(model: mujoco.MjModel, way: Way, before: float) -> str:
    """Which effects of a model put back what was left out."""
    parts = []
    if way.geoms:
        radii = [f"{model.geom_size[geom, 0]:g} m" for geom in way.geoms]
        parts.append(f"pulley_radius {listed(dict.fromkeys(radii))}")
    if before > 0.0:
        parts.append(f"winch_side_length {before:.4g} m")
    return f"; {' and '.join(parts)} in a model put back the rest" if parts else ""


def told(path: str | Path, out: Path, changes: Sequence[str]) -> list[str]:
    """What ``--fix`` tells."""
    if not changes:
        return [f"{path}: nothing to mend, so that nothing is written"]
    return [f"wrote {out}: {path}, but"] + [f"  - {text}" for text in changes]
