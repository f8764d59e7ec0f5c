"""Column names that are close to known ones, and names that only look alike."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

from seecr.columns.table import show

# Other programs' names for a column, if the spelling is not close enough to guess.
_ALIASES = {"time": "t_s", "time_s": "t_s", "timestamp": "t_s", "temp_c": "temperature_C"}
# Similarity from which a name may be a misspelt one.
_NEAR = 0.75
_ROTATION = re.compile(
    r"roll|pitch|yaw|euler|heading|rotvec|rodrigues|(?:^|_)(?:phi|theta|psi|rot)(?:_|$)",
    re.IGNORECASE,
)
_OF_CABLE = re.compile(r"(length|tension)_(.+)")
# So much of a name that it would be a column, if it were a cable's; results have others besides.
_OF_NO_CABLE = re.compile(r"(length|tension)_(?!\d+_)[^_]+(_(m|cm|mm|um|N|kN))?")
OUR_ROTATIONS = (
    "a rotation is meas_rx_deg meas_ry_deg meas_rz_deg with R = Rx(rx) Ry(ry) Rz(rz), or the "
    "quaternion meas_qw meas_qx meas_qy meas_qz"
)


def meant_by(unused: Sequence[str], absent: Sequence[str]) -> dict[str, str]:
    """For unused names that are close to a missing one, that name.

    Only the spelling may differ: what distinguishes one known name from another (the axis, the
    cable) has to be in the name.
    """
    ours = {name.lower(): name for name in absent}
    ours |= {alias: name for alias, name in _ALIASES.items() if name in absent}
    found = {}
    for name in unused:
        if _ROTATION.search(name):
            continue
        near = difflib.get_close_matches(name.lower(), ours, n=8, cutoff=_NEAR)
        told = [one for one in near if one in _ALIASES or _distinct(one) <= _distinct(name)]
        if told:
            found[name] = ours[told[0]]
    return found


def _distinct(name: str) -> set[str]:
    """The distinguishing parts of a name: x, qw, rz, the number of a cable."""
    parts = re.split(r"[\W_]+|(?<=\D)(?=\d)|(?<=\d)(?=\D)", name.lower())
    whole = {part for part in parts if re.fullmatch(r"q[wxyz]|r?[xyz]|\d+", part)}
    # as in cmdx_m, with the axis attached to the word
    stuck = {part[-1] for part in parts if re.fullmatch(r"[a-pr-z]{2,}[xyz]", part)}
    return whole | stuck


def other_rotations(unused: Sequence[str]) -> list[str]:
    """Names of rotations by words that have different meanings for different people."""
    return [name for name in unused if _ROTATION.search(name)]


def numbered(name: str, cables: Sequence[str]) -> str:
    """The name of a column with the number of its cable, from 1, in place of the cable's name.

    Other names stay as they are. A cable whose name is a number has no name here: numbers are those
    in the order of the robot's description.
    """
    match = _OF_CABLE.fullmatch(name)
    if match is None:
        return name
    prefix, rest = match[1], match[2]
    meant = [
        (number, rest.removeprefix(cable))
        for number, cable in enumerate(cables, start=1)
        if rest.startswith(cable) and not cable.isdigit()
    ]
    fits = [one for one in meant if re.fullmatch(r"(_[^_]*)?", one[1])]
    if not fits:
        return name
    # of cables a and a_m the first is meant where that leaves a unit, else the longer name
    number, unit = min(fits, key=lambda one: (not one[1], len(one[1])))
    return f"{prefix}_{number}{unit}"


def of_no_cable(unused: Sequence[str]) -> list[str]:
    """Names of lengths or tensions of no cable that the robot has."""
    return [name for name in unused if _OF_NO_CABLE.fullmatch(name)]


def no_cable_note(names: Sequence[str], cables: Sequence[str]) -> list[str]:
    """The sentence about :func:`of_no_cable`, which names the cables that there are."""
    if not names or not cables:
        return unused_note(names, [])
    word, verb = ("Column", "is") if len(names) == 1 else ("Columns", "are")
    numbers = ", ".join(f"{k} ({cable})" for k, cable in enumerate(cables, start=1))
    return [
        f"{word} {', '.join(names)} {verb} not used: the robot's cables are {numbers}, by number "
        "or name."
    ]


def question(name: str, meant: str) -> str:
    """The question about a name that is close to a known one."""
    return f"Column {show(name)} is not used; did you mean {meant}?"


def unused_note(names: Sequence[str], rotations: Sequence[str]) -> list[str]:
    """Sentences that list the columns without a known meaning."""
    notes = []
    if rotations:
        word = "Column" if len(rotations) == 1 else "Columns"
        verb = "is" if len(rotations) == 1 else "are"
        listed = " ".join(rotations)
        notes.append(
            f"{word} {listed} {verb} not used, because roll, pitch and yaw have several "
            f"conventions: here {OUR_ROTATIONS}."
        )
    if names:
        notes.append(f"Not used: {', '.join(names)}.")
    return notes
