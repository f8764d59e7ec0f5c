"""Anchors in the settings of firmware: RepRapFirmware's Hangprinter, Klipper's winches, Maslow 4.

They count in millimetres, and their platform is one point. RepRapFirmware (``M669 K6``, ``M666``,
HangprinterKinematics.cpp) and Klipper (``kinematics: winch``) zero their winches where that point
is at the origin. In ``M666``, W is the mass, S the force that would double a line's length, U how
often a line runs to and fro, I and X the least and largest force of a line. Maslow, in
``maslow.yaml``, moves in the plane of x and y, upright where Maslow_vertical is true.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from seecr.errors import Faults, InputError, InputFileError
from seecr.files import read_text
from seecr.importing.draft import Draft
from seecr.pose import Array, all_finite

FIRMWARE = {"reprap": ".g", "klipper": ".cfg", "maslow": ".yaml"}
"""Kinds of firmware, and how the files of their settings end."""

_EXPECTED = {
    "reprap": "a line such as M669 K6 A0:-2000:-100 B2000:1000:-100 C-2000:1000:-100 D0:0:3000",
    "klipper": "sections [stepper_a] with anchor_x, anchor_y and anchor_z",
    "maslow": "tlX, tlY, trX, trY, blX, blY, brX and brY, or Maslow_tlX and so on",
}
_CORNERS = ("tl", "tr", "bl", "br")
_WORD = re.compile(r"([A-Z])([-+.\d:eE]+)")
# Letters of anchors, in their order.
_LETTERS = {"reprap": "ABCDIJLO", "klipper": "abcdefgh"}


def read_firmware(kind: str, path: Path) -> Draft:
    """The robot of a file of settings.

    Args:
        kind: of :data:`FIRMWARE`. path: of the file.

    Raises:
        InputFileError: no such settings, or anchors that are incomplete; all faults at once.
    """
    lines = [
        (number, line.split(";" if kind == "reprap" else "#")[0].strip())
        for number, line in enumerate(read_text(path, f"expected {_EXPECTED[kind]}").split("\n"), 1)
    ]
    faults = Faults()
    readers = {"reprap": _of_reprap, "klipper": _of_klipper, "maslow": _of_maslow}
    anchors = readers[kind](lines)
    if not anchors:
        raise InputFileError.at(path, f"has no anchors; expected {_EXPECTED[kind]}")
    for name, (line, texts) in anchors.items():
        if len(texts) != 3 or "" in texts or not all_finite(_numbers(texts)):
            text = f"anchor {name}: expected x, y and z [mm], got {' '.join(texts) or 'none'}"
            faults.add(InputFileError.at(path, text, line=line))
    faults.check()
    exits = 1e-3 * np.array([_numbers(texts) for _line, texts in anchors.values()])
    if kind == "maslow":
        return _flat(path, exits, tuple(anchors), lines)
    return _hung(path, exits, tuple(f"line_{name.lower()}" for name in anchors), lines)


def _numbers(texts: Iterable[str]) -> Array:
    """Numbers of texts; NaN for what is none."""
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        return np.array([np.nan])


_Said = dict[str, tuple[int, list[str]]]


def _words_of(lines: list[tuple[int, str]], code: str) -> Iterator[tuple[int, str, list[str]]]:
    """The words of a code in RepRapFirmware: line, letter, and numbers with colons between."""
    for number, line in lines:
        start, _, words = line.partition(" ")
        for letter, value in _WORD.findall(words) if start == code else ():
            yield number, letter, value.split(":")


def _of_reprap(lines: list[tuple[int, str]]) -> _Said:
    """Anchors of M669; older firmware knows the height of D alone."""
    return {
        letter: (number, ["0", "0", *texts] if len(texts) == 1 else texts)
        for number, letter, texts in _words_of(lines, "M669")
        if letter in _LETTERS["reprap"]
    }


def _of_klipper(lines: list[tuple[int, str]]) -> _Said:
    found: _Said = {}
    section = ""
    for number, line in lines:
        if head := re.fullmatch(r"\[(\w+)\]", line):
            section = head[1].removeprefix("stepper_")
        elif entry := re.fullmatch(r"anchor_([xyz])\s*[:=]\s*(.*)", line):
            found.setdefault(section, (number, ["", "", ""]))[1]["xyz".index(entry[1])] = entry[2]
    return found


def _of_maslow(lines: list[tuple[int, str]]) -> _Said:
    """The corners; their heights, which a planar robot has none of, need not be there."""
    found: _Said = {}
    for number, line in lines:
        entry = re.fullmatch(r"(?:\$/)?(?:Maslow_)?([tb][lr])([XYZ])\s*[:=]\s*(.*)", line)
        if entry:
            place = found.setdefault(entry[1], (number, ["", "", "0"]))[1]
            place["XYZ".index(entry[2])] = entry[3]
    return {name: found.get(name, (1, [])) for name in _CORNERS} if found else {}


def _hung(path: Path, exits: Array, names: tuple[str, ...], lines: list[tuple[int, str]]) -> Draft:
    """A point on lines that is zeroed at the origin, with what M666 says of it, if anything."""
    m, notes = len(exits), list[str]()
    said = {letter: _numbers(texts) for _line, letter, texts in _words_of(lines, "M666")}
    falls = np.resize(said.get("U", np.ones(1)), m)
    if np.any(falls != 1.0):
        notes.append(
            "lines run to and fro as U of M666 says: each is one cable with E S times U, and "
            "tensions are those of all its parts"
        )
    # the forces of M666 are those of one part of a line
    low, high = falls * said.get("I", np.zeros(1)), falls * said.get("X", np.array([np.inf]))
    return Draft(
        path, path.stem, exits, np.zeros((m, 3)), said.get("S", np.array([np.nan])) * falls,
        np.full(m, np.nan), names, float(said["W"][0]) if "W" in said else None,
        pose=(0.0, 0.0, 0.0), limits=(float(low.max()), float(high.min())), notes=tuple(notes),
    )  # fmt: skip


def _flat(path: Path, exits: Array, names: tuple[str, ...], lines: list[tuple[int, str]]) -> Draft:
    """A point in the plane of its four anchors, which lies or stands upright."""
    upright = any(re.fullmatch(r"Maslow_vertical:\s*true", line) for _number, line in lines)
    exits = exits * [1.0, 1.0, 0.0]
    if upright:
        exits = exits[:, [0, 2, 1]]
    notes = ("heights of belts above the plane (tlZ and so on) are left out",)
    m = len(exits)
    nan = np.full(m, np.nan)
    plane = "xz" if upright else "xy"
    return Draft(path, path.stem, exits, np.zeros((m, 3)), nan, nan, names, plane=plane,
                 notes=notes)  # fmt: skip


_WROTE = "anchors [mm] by seecr export"


def settings_beside(kind: str, out: Path) -> Path:
    """The file for the settings of a kind of firmware, beside an exported robot.

    Raises:
        InputError: there is one of that name that no export wrote.
    """
    path = out.with_name(f"{out.stem}-{kind}{FIRMWARE[kind]}")
    if path.exists() and _WROTE not in path.read_text(encoding="utf-8", errors="replace"):
        raise InputError(f"{path}: is of no export; rename it, or export to another name")
    return path


def firmware_text(kind: str, exit_points: Array) -> str:
    """Exit points (m, 3) [m] as settings of a kind of firmware.

    Raises:
        InputError: another number of them than that firmware has.
    """
    head = f"{';' if kind == 'reprap' else '#'} {_WROTE}\n"
    return head + _settings(kind, 1e3 * exit_points + 0.0)


def _settings(kind: str, places: Array) -> str:
    if kind == "maslow":
        if len(places) != 4:
            raise InputError(f"maslow: expected 4 exit points, tl tr bl br, got {len(places)}")
        if np.ptp(places[:, 1]) < np.ptp(places[:, 2]):  # in the plane of x and z
            places = places[:, [0, 2, 1]]
        pairs = [
            f"Maslow_{corner}{axis}: {place['XY'.index(axis)]:.3f}"
            for corner, place in zip(_CORNERS, places, strict=True)
            for axis in "XY"
        ]
        return "\n".join(pairs) + "\n"
    letters = _LETTERS[kind][: len(places)]
    if len(letters) < len(places):
        raise InputError(f"{kind}: expected at most {len(letters)} exit points, got {len(places)}")
    named = zip(letters, places, strict=True)
    if kind == "reprap":
        words = " ".join(f"{letter}{x:.3f}:{y:.3f}:{z:.3f}" for letter, (x, y, z) in named)
        return f"M669 K6 N{len(places)} {words}\n"
    return "\n".join(
        f"[stepper_{letter}]\nanchor_x: {x:.3f}\nanchor_y: {y:.3f}\nanchor_z: {z:.3f}\n"
        for letter, (x, y, z) in named
    )
