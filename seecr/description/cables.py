"""Ropes that robots are built with: E S and weight per metre, by material and diameter.

They are typical values for a first model. A rope of a third more or less E S is no surprise, one of
polyester of half or twice as much; new ropes are softer until they have been loaded some times.
Hang a known weight on a known length where it matters.
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

from seecr.errors import InputError
from seecr.units import in_si

_STANDARD_GRAVITY = 9.80665  # [m/s^2]
# Smallest and largest diameter [m] of what is sold as a rope of one of these materials.
_THINNEST, _THICKEST = 1e-4, 0.1
# A braided rope's circle is this part fibre, and the rope has this part of the fibre's modulus,
# since its strands cross at an angle. Ropes of twelve strands weigh about 0.75 of a full circle,
# of which finish is a part, and a 6 mm rope of SK78 stretches by 1 % under 13 kN: 0.7 and 0.6
# (weights and stretch as rope makers state them; McKenna, Hearle, O'Hear, Handbook of fibre rope
# technology, 2004, chapters 3 and 4).
_FIBRE, _BRAIDED = 0.70, 0.60


@dataclass(frozen=True)
class Material:
    """What ropes of one kind have in common.

    Attributes:
        name: as it is typed.
        modulus: E S over the area of the rope's circle [Pa].
        density: mass per metre over that area [kg/m^3].
        source: of both.
    """

    name: str
    modulus: float
    density: float
    source: str


def _wire_rope(name: str, area: float, mass: float, what: str) -> Material:
    """By EN 12385-4: ``area`` d^2 is metal, and ``mass`` d^2 / 100 is kg/m, with d in mm.

    Feyrer, Wire Ropes, 2nd ed. 2015, has the factors in table 1.9, and moduli in section 2.2.
    """
    circle = math.pi / 4.0
    return Material(
        name, 100e9 * area / circle, 1e4 * mass / circle,
        f"{what}, by EN 12385-4 and a rope modulus of 100 GPa",
    )  # fmt: skip


def _braid(name: str, modulus: float, density: float, what: str) -> Material:
    """Of fibres with this modulus [Pa] and density [kg/m^3], as their makers state them."""
    return Material(
        name, _FIBRE * _BRAIDED * modulus, _FIBRE * density,
        f"a braid of {what}, by its data sheet's {modulus / 1e9:g} GPa and {density:g} kg/m^3",
    )  # fmt: skip


MATERIALS = (
    _wire_rope("steel 7x19", 0.418, 0.381, "6x19M around a strand, which is 7x19"),
    _wire_rope("steel 6x19", 0.384, 0.359, "6x19 with a fibre core"),
    _braid("dyneema", 113e9, 975.0, "Dyneema SK78"),
    _braid("vectran", 75e9, 1410.0, "Vectran HT"),
    _braid("kevlar", 70.5e9, 1440.0, "Kevlar 29"),
    _braid("polyester", 10e9, 1380.0, "high-tenacity polyester"),
)
"""The catalogue. Plain ``steel`` is the first of steel."""

EXAMPLE = "steel 7x19 3mm"
# What E S may be [N]: a steel rope as thick as an arm has 1e9.
_LEAST_EA, _MOST_EA = 1e-3, 1e12


@dataclass(frozen=True)
class Rope:
    """One rope of the catalogue.

    Attributes:
        name: material and diameter. ea: E S [N].
        weight: per metre [N/m], the value of the effect ``cable_weight``.
        source: of its numbers.
    """

    name: str
    ea: float
    weight: float
    source: str


def rope_of(text: str, label: str = "cable") -> Rope:
    """A rope by material and diameter, such as ``"steel 7x19 3mm"`` or ``"dyneema 6 mm"``.

    Args:
        text: as typed. label: the option or argument, for the error.

    Raises:
        InputError: an unknown material (the known ones are listed), or no diameter with its unit.

    Example:
        >>> round(rope_of("steel 7x19 3mm").ea)
        376200
    """
    words = re.fullmatch(r"\s*([a-z].*?)\s+([-+.\d]\S*?\s*[a-z]*)\s*", text.lower())
    name = "" if words is None else " ".join(words[1].split())
    material = next((one for one in MATERIALS if name in (one.name, one.name.split()[0])), None)
    if words is None or material is None:
        known = [one.name for one in MATERIALS]
        near = difflib.get_close_matches(text.lower(), known, n=len(known), cutoff=0.0)
        raise InputError(
            f"{label}: expected E S such as 3e5N, or a rope by material and diameter such as "
            f"{EXAMPLE!r}, got {text!r}; known are {', '.join(near)} (nearest first)"
        )
    # a bare number would be metres, and nobody means those
    diameter = None if re.fullmatch(r"[-+.\de]*", words[2]) else in_si(words[2], "m")
    if diameter is None or not _THINNEST <= diameter <= _THICKEST:
        raise InputError(
            f"{label}: expected a diameter from {1e3 * _THINNEST:g}mm to {1e3 * _THICKEST:g}mm "
            f"after {name}, such as {EXAMPLE!r}, got {words[2]!r} in {text!r}"
        )
    area = 0.25 * math.pi * diameter**2
    return Rope(
        f"{material.name} {1e3 * diameter:g}mm", area * material.modulus,
        area * material.density * _STANDARD_GRAVITY, material.source,
    )  # fmt: skip


def ea_of(text: str, label: str) -> tuple[float, str]:
    """E S [N] of a number with its unit, or of a rope; and for people what that rope is.

    Raises:
        InputError: neither, or a number that no cable has.
    """
    ea = in_si(text, "N")
    if ea is None:
        rope = rope_of(text, label)
        return rope.ea, (
            f"{rope.name}: E S = {rope.ea:.4g} N, typical of {rope.source}; it weighs "
            f"{rope.weight:.3g} N/m, which the effect cable_weight adds"
        )
    if not _LEAST_EA <= ea <= _MOST_EA:
        raise InputError(
            f"{label}: expected E S from {_LEAST_EA:g} to {_MOST_EA:g} N, or a rope such as "
            f"{EXAMPLE!r}, got {text!r}"
        )
    return ea, ""
