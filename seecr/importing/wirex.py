"""Robots of WireX (and WireCenter): a ``.wcrfx`` file.

Its conventions (A. Pott, WireX, RobotData.cpp): each ``chain`` is a cable from its ``base`` to its
``platform``, in metres; the base's radius is that of its pulley, which turns about the base's third
axis; ``elasticity`` is Young's modulus [Pa] on a circle of the cable's ``radius``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from seecr.errors import Faults
from seecr.importing.draft import Draft, pulley_notes
from seecr.importing.xml_tree import Node, numbers_of, read_xml
from seecr.pose import Array

_EXPECTED = "expected a robot of WireX (*.wcrfx), <models> with a <robot> in it"
# cos of the angle of a pulley's axis from the vertical beyond which it leans: 0.08 degrees.
_UPRIGHT = 1.0 - 1e-6
_FREE = "3R3T"  # its word for six degrees of freedom
# The centre of mass that it gives every robot and writes into every file; it reads none.
_FILLER = [0.0, 1.0, 0.2]


def read_wirex(path: Path) -> Draft:
    """The robot of a file; of several the first.

    Raises:
        InputFileError: no such file, or one without a robot; all its faults are told at once.
    """
    root = read_xml(path, "models", _EXPECTED)
    faults = Faults()
    robot = _part(root, "robot", faults)
    chains = list(robot.every("chain"))
    if not chains:
        faults.add(robot.error("has no <chain>; expected one for each cable, in <geometry>"))
    bases, ends = ([_part(one, tag, faults) for one in chains] for tag in ("base", "platform"))
    exits, anchors = ([_point(node, faults) for node in some] for some in (bases, ends))
    platform = _part(robot, "platform", faults)
    mass = _value(platform, "mass", faults)
    if mass < 0.0:
        faults.add(platform.error(f"<platform>: expected a mass of 0 or more, got {mass:g}"))
    centre, tensor = platform.child("centerofgravity"), platform.child("inertiatensor")
    at = np.zeros(3) if centre is None else _point(centre, faults)
    inertia = None
    if tensor is not None:
        parts = (
            _value(tensor, f"I{key}", faults, 0.0) for key in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        xx, yy, zz, xy, xz, yz = parts
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    radii = [_value(base, "radius", faults, 0.0) for base in bases]
    leaning = sum(abs(_value(base, "a33", faults, 1.0)) < _UPRIGHT for base in bases)
    ea, notes = _elasticity(root, faults)
    faults.check()
    notes += pulley_notes(radii)
    if leaning and any(radii):
        notes.append(f"{leaning} of them turn about a leaning axis; in that effect it is vertical")
    if at.tolist() == _FILLER:
        notes.append(
            "the centre of mass (0 1 0.2) m is what WireX writes for every robot: if it is not "
            "this robot's, say --com X Y Z"
        )
    nan = np.full(len(chains), math.nan)
    return Draft(
        path, robot.values.get("name") or path.stem, np.array(exits), np.array(anchors),
        np.full(len(chains), ea), nan, (), mass, at, inertia, notes=tuple(notes),
        joints=() if robot.values.get("motionpattern", "").upper() == _FREE else None,
    )  # fmt: skip


def _part(node: Node, tag: str, faults: Faults) -> Node:
    """The element of that name in a node; an empty one, and a fault, if there is none."""
    found = node.child(tag)
    if found is None:
        faults.add(node.error(f"<{node.tag}>: expected <{tag}> in it, got none"))
        return replace(node.empty(tag), values=dict.fromkeys(("x", "y", "z", "mass"), "0"))
    return found


def _value(node: Node, key: str, faults: Faults, default: float | None = None) -> float:
    """The number of an attribute; it may be missing if there is a default."""
    if key not in node.values and default is not None:
        return default
    text = node.values.get(key, "")
    return float(numbers_of(node, text, f"<{node.tag}> {key}", 1, faults)[0])


def _point(node: Node, faults: Faults) -> Array:
    return np.array([_value(node, axis, faults) for axis in "xyz"])


def _elasticity(root: Node, faults: Faults) -> tuple[float, list[str]]:
    """E S [N] of the file's cables, NaN without one; and what to say of it."""
    cable = root.child("cable")
    if cable is None:
        return math.nan, []
    modulus, radius, mass = (
        _value(cable, key, faults, 0.0) for key in ("elasticity", "radius", "weight")
    )
    if not (modulus > 0.0 and radius > 0.0):
        return math.nan, []
    ea = modulus * math.pi * radius**2
    said = [
        f"E S = {ea:.4g} N by the file: {modulus / 1e9:g} GPa on a radius of {1e3 * radius:g} mm"
    ]
    if mass > 0.0:
        said.append(f"its cables weigh {9.81 * mass:.3g} N/m, which the effect cable_weight adds")
    return ea, said
