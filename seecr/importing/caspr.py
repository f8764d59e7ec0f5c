"""Robots of CASPR: ``*_bodies.xml`` with the platform, ``*_cables.xml`` with sets of cables.

Its conventions (D. Lau et al., CASPR: A comprehensive cable-robot analysis and simulation platform,
IROS 2016, and its sources): coordinates of the platform are about its joint; attachments are about
the joint or the centre of mass, each cable says which; inertia is about either, too; gravity is
9.81 m/s^2 along -z for every robot; E S of a spring is its K.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seecr.description.points import Joint
from seecr.errors import Faults
from seecr.importing.draft import Draft, pulley_notes
from seecr.importing.xml_tree import Node, numbers_in, numbers_of, read_xml
from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate

# What each kind of joint does to the platform, from the base outwards.
_MOTIONS = {
    "R_X": "rx", "R_Y": "ry", "R_Z": "rz", "U_XY": "rx ry", "U_XZ": "rx rz", "U_YZ": "ry rz",
    "P_X": "x", "P_XY": "x y", "P_XZ": "x z", "T_XYZ": "x y z", "PLANAR_XY": "x y rz",
    "PLANAR_XZ": "x z ry", "PLANAR_YZ": "y z rx", "S_EULER_XYZ": "rx ry rz",
    "SPATIAL_EULER_XYZ": "x y z rx ry rz",
}  # fmt: skip
_FREE = "SPATIAL_EULER_XYZ"
# Kinds of cables whose pull is that of a cable, and where the file has E S of them.
_CABLES = {"cable_ideal": None, "cable_linear_spring": "K"}
# Kinds of attachments, and the element with the place of each.
_ENDS = {
    "attachment": "location", "base_rotating_pulley": "fixed_location",
    "screw_base_rotating_pulley": "constant_winch_point",
}  # fmt: skip


def read_caspr(bodies: Path, cables: Path, wanted: str | None) -> Draft:
    """The robot of two files.

    Args:
        bodies: with the platform. cables: with its cables.
        wanted: the set of cables to take; None for the one that the file says is its default.

    Raises:
        InputFileError: no such files, several links, joints or cables that no cable robot with
            one platform has; all faults of a file are told at once.
    """
    body = read_xml(bodies, "bodies_system", "expected CASPR's *_bodies.xml, with <bodies_system>")
    sets = read_xml(cables, "cables", "expected CASPR's *_cables.xml, with <cables>")
    faults = Faults()
    link = _link(body)
    pose, joints = _joint(link, faults)
    physical = link.child("physical")
    if physical is None:
        faults.add(link.error(f"<{link.tag}>: expected <physical> in it, got none"))
        physical = link.empty("physical")
    mass = float(numbers_in(physical, "mass", 1, faults)[0])
    if mass < 0.0:
        faults.add(physical.error(f"<mass>: expected 0 or more, got {mass:g}"))
    centre = numbers_in(physical, "com_location", 3, faults)
    inertia = _inertia(physical, mass, centre, faults)
    faults.check()
    faults = Faults()
    some, which = _chosen(sets, wanted)
    found = list(_cables(some, centre, faults))
    faults.check()
    names, exits, anchors, ea, lowest, highest, radii = map(list, zip(*found, strict=True))
    distinct = len(set(names)) == len(names) and all(names)
    return Draft(
        bodies, bodies.stem.removesuffix("_bodies"), np.array(exits), np.array(anchors),
        np.array(ea), np.full(len(names), np.nan), tuple(names) if distinct else (), mass, centre,
        inertia, pose, joints, limits=(max(lowest), min(highest)),
        notes=(*which, *pulley_notes(radii)),
    )  # fmt: skip


def _link(body: Node) -> Node:
    links = [one for part in body.children if part.tag == "links" for one in part.children]
    links = [one for one in links if one.tag.startswith("link_")]
    if len(links) != 1:
        why = "a chain of bodies, which is not solved for here" if links else "no platform"
        raise body.error(f"has {len(links)} links: {why}; expected one <link_rigid>")
    return links[0]


def _joint(link: Node, faults: Faults) -> tuple[Array, tuple[Joint, ...]]:
    """The pose (7,) at the joint's initial values, and the joints there."""
    joint = link.child("joint") or link.empty("joint")
    kind = joint.values.get("type", "")
    motions = _MOTIONS.get(kind, "").split()
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if not motions:
        faults.add(joint.error(f"joint type {kind!r}: expected one of {', '.join(_MOTIONS)}"))
        return pose, ()
    start = joint.values.get("q_initial", "")
    values = numbers_of(joint, start, "q_initial", len(motions), faults)
    parent = link.child("parent") or link.empty("parent")
    pose[:3] = numbers_in(parent, "location", 3, faults)
    axes = []
    for motion, value in zip(motions, values, strict=True):
        axis = quat_rotate(pose[3:], np.eye(3)["xyz".index(motion[-1])])
        axes.append(axis)
        if motion.startswith("r"):
            pose[3:] = quat_multiply(quat_from_rotvec(value * axis), pose[3:])
        else:
            pose[:3] += value * axis
    if kind == _FREE:
        return pose, ()
    kinds = ["hinge" if motion.startswith("r") else "slide" for motion in motions]
    held = zip(kinds, motions, axes, strict=True)
    return pose, tuple(Joint(*one, point=pose[:3].copy()) for one in held)


def _inertia(physical: Node, mass: float, centre: Array, faults: Faults) -> Array | None:
    """About the centre of mass, (3, 3); None where the file has none."""
    node = physical.child("inertia")
    if node is None:
        return None
    parts = {key: numbers_in(node, key, 1, faults)[0] for key in _PARTS}
    xx, yy, zz, xy, xz, yz = (float(value) for value in parts.values())
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about = node.values.get("ref")
    if about == "joint":  # Steiner
        inertia = inertia - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    elif about != "com":
        faults.add(node.error(f'<inertia>: expected ref="com" or ref="joint", got {about!r}'))
    return inertia


_PARTS = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def _chosen(sets: Node, wanted: str | None) -> tuple[list[Node], list[str]]:
    """The cables of one set, and which it is, if there are several.

    Raises:
        InputFileError: no such set, or one with something else than cables on winches.
    """
    known = {one.values.get("id", ""): one.children for one in sets.every("cable_set")}
    name = sets.values.get("default_cable_set", "") if wanted is None else wanted
    if wanted is None and name not in known:
        name = next(iter(known), "")
    some = known.get(name, [])
    others = {key: cables for key, cables in known.items() if key != name}
    odd = sorted({cable.tag for cable in some} - set(_CABLES))
    if odd or not some:
        fit = [
            key
            for key, cables in others.items()
            if cables and {c.tag for c in cables} <= set(_CABLES)
        ]
        tip = f"; another set with --set: {', '.join(fit)}" if fit else ""
        has = "does not exist, or has no cables"
        if odd:
            has = f"has {' and '.join(f'<{tag}>' for tag in odd)}, with a force that is no winch's"
        text = f"set {name!r} {has}; expected {' or '.join(f'<{tag}>' for tag in _CABLES)}{tip}"
        raise (some[0] if some else sets).error(text)
    if not others:
        return some, []
    return some, [f"cables of set {name!r}; others with --set: {', '.join(others)}"]


def _cables(some: list[Node], centre: Array, faults: Faults) -> Iterator[tuple[Any, ...]]:
    """Name, exit point, anchor point, E S, limits of tension and pulley radius of each cable."""
    for cable in some:
        name, about = cable.values.get("name", ""), cable.values.get("attachment_reference")
        if about not in ("com", "joint"):
            text = f"cable {name!r}: expected attachment_reference com or joint, got {about!r}"
            faults.add(cable.error(text))
        ends = [
            # pulleys are on the base
            (_optional(node, "link", 0.0, faults) if node.tag == "attachment" else 0.0, node)
            for part in cable.children if part.tag == "attachments"
            for node in part.children if node.tag in _ENDS
        ]  # fmt: skip
        ends.sort(key=lambda end: end[0])
        if [link for link, _node in ends] != [0, 1]:
            where = ", ".join(f"{link:g}" for link, _node in ends) or "none"
            text = f"cable {name!r} is attached to links {where}; expected 0 (the base) and 1 (the "
            faults.add(cable.error(f"{text}platform), one point on each"))
            continue
        exit_point, anchor = (numbers_in(node, _ENDS[node.tag], 3, faults) for _, node in ends)
        properties = cable.child("properties") or cable.empty("properties")
        key = _CABLES[cable.tag]
        yield (
            name, exit_point, anchor + centre if about == "com" else anchor,
            np.nan if key is None else numbers_in(properties, key, 1, faults)[0],
            _optional(properties, "force_min", 0.0, faults),
            _optional(properties, "force_max", np.inf, faults),
            _optional(ends[0][1], "pulley_radius", 0.0, faults),
        )  # fmt: skip


def _optional(node: Node, tag: str, default: float, faults: Faults) -> float:
    return default if node.child(tag) is None else float(numbers_in(node, tag, 1, faults)[0])
