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
# A braid's circle is this part fibre, and the braid has this part of the fibre's modulus, as its
# strands cross at an angle: ropes of twelve strands weigh about 0.75 of a full circle, part of that
# is finish, and a 6 mm rope of SK78 stretches by 1 % under 13 kN (as rope makers state it; McKenna,
# Hearle, O'Hear, Handbook of fibre rope technology, 2004, chapters 3 and 4).
_FIBRE, _BRAIDED = 0.70, 0.60
# By EN 12385-4 a wire rope has C d^2 of metal and W d^2 kg per 100 m, and breaks at K d^2 R, with d
# in mm and R = 1770 N/mm^2, the usual grade (the factors are also in Feyrer, Wire Ropes, 2nd ed.
# 2015, table 1.9; in section 2.2 moduli of about 100 GPa).
_WIRE_MODULUS, _GRADE = 100e9, 1770e6
_WIRE_ROPES = {
    "steel 7x19": (0.418, 0.381, 0.332, "6x19M around a strand, which is 7x19"),
    "steel 6x19": (0.384, 0.359, 0.330, "6x19 with a fibre core"),
}
# Modulus [GPa], density [kg/m^3] and strength [GPa] of fibres, of the order that makers state.
# Published moduli scatter: 101 to 113 GPa for Dyneema, 60 to 75 for Vectran (Scientific Reports
# 11:8705, 2021, table 1, has the lower ones).
_FIBRES = {
    "dyneema": (113.0, 975.0, 3.4, "Dyneema SK78"),
    "vectran": (75.0, 1410.0, 3.2, "Vectran HT"),
    "kevlar": (70.5, 1440.0, 2.9, "Kevlar 29"),
    "polyester": (10.0, 1380.0, 1.1, "high-tenacity polyester"),
}
_SQUARE = 4.0 / math.pi  # the square of a diameter over the area of its circle

# By name: E S [Pa] and mass per metre [kg/m^3], over the area of the circle, and their source.
MATERIALS = {
    name: (_WIRE_MODULUS * c * _SQUARE, 1e4 * w * _SQUARE, f"{what}, by EN 12385-4 and 100 GPa")
    for name, (c, w, _k, what) in _WIRE_ROPES.items()
} | {
    name: (
        _FIBRE * _BRAIDED * 1e9 * e, _FIBRE * rho,
        f"a braid of {what}, of {e:g} GPa and {rho:g} kg/m^3",
    )
    for name, (e, rho, _strength, what) in _FIBRES.items()
}  # fmt: skip
"""The catalogue. Plain ``steel`` is the first of steel."""

# The angle at which a braid's strands cross takes as much of its strength as of its modulus.
BREAKING_STRAINS = {
    name: _GRADE * k / (_WIRE_MODULUS * c) for name, (c, _w, k, _what) in _WIRE_ROPES.items()
} | {name: strength / e for name, (e, _rho, strength, _what) in _FIBRES.items()}
"""Tension over E S at which new ropes of the catalogue break."""

NONE_BREAKS = f"and a wire rope of steel breaks at {100.0 * min(BREAKING_STRAINS.values()):.2g} %"
"""What is said of a strain that breaks no rope of the catalogue."""


def breaking_words(strain: float) -> str:
    """Which ropes of the catalogue a strain breaks: "enough to break ..."; "" if none."""
    weakest = sorted(BREAKING_STRAINS.items(), key=lambda item: item[1])
    broken = [f"{name} ({100.0 * at:.2g} %)" for name, at in weakest if at <= strain]
    return f"enough to break ropes of {', '.join(broken)}" if broken else ""


EXAMPLE = "steel 7x19 3mm"
# What E S may be [N]: a steel rope as thick as an arm has 1e9.
_LEAST_EA, _MOST_EA = 1e-3, 1e12


@dataclass(frozen=True)
class Rope:
    """One rope of the catalogue.

    Attributes:
        name: material and diameter. ea: E S [N]. breaks: breaking load of a new rope [N].
        weight: per metre [N/m], the value of the effect ``cable_weight``.
        source: of its numbers.
    """

    name: str
    ea: float
    weight: float
    source: str
    breaks: float


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
    material = next((one for one in MATERIALS if name in (one, one.split()[0])), None)
    if words is None or material is None:
        near = difflib.get_close_matches(text.lower(), MATERIALS, n=len(MATERIALS), cutoff=0.0)
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
    modulus, density, source = MATERIALS[material]
    area = 0.25 * math.pi * diameter**2
    weight = area * density * _STANDARD_GRAVITY
    ea = area * modulus
    name = f"{material} {1e3 * diameter:g}mm"
    return Rope(name, ea, weight, source, ea * BREAKING_STRAINS[material])


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
