"""Exports of motion capture: OptiTrack's Motive and Vicon's Nexus.

The first row has pairs (format version, units, rotation type), then there are a few rows of labels,
some of which depend on the version, then ``Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,...``. Quaternions
have the scalar last; Y is up unless chosen otherwise; cells of hidden bodies are blank.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.importing.logs import Block, FileRows, Logged, Row
from seecr.columns.csv import VICON
from seecr.counted import counted
from seecr.pose import Array
from seecr.units import of_columns

_EXPECTED_MOTIVE = "expected a CSV export of Motive, which begins with Format Version"
_METRES = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001}
_BODIES, _MARKERS = ("rigid body", "bone"), ("marker", "rigid body marker")
_AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class _Labels:
    """The rows of labels above the numbers: the type, name and quantity of each column."""

    kind: Row
    name: Row
    quantity: Row


def read_motive(path: Path) -> Logged:
    """Read an export of Motive.

    Raises:
        InputFileError: another kind of file, rotations of unknown type, or broken rows.
    """
    rows = FileRows.of(path, _EXPECTED_MOTIVE)
    settings = _settings(rows)
    top = next((k for k, row in enumerate(rows.cells) if row and row[0] == "Frame"), None)
    if top is None:
        raise rows.error("has no row of labels that begins with Frame; is the file cut off?")
    labels = _labels(rows, top)
    body = range(top + 1, 1 + max(k for k, row in enumerate(rows.cells) if any(row)))
    block = Block.of(rows, top, body)
    _check_count(rows, settings, block)
    time = next((c for c, cell in enumerate(block.labels) if cell.startswith("Time (")), None)
    rate = settings.get("Export Frame Rate", "")
    if time is None and not re.fullmatch(r"\d*[1-9]\d*(\.\d*)?", rate):
        raise rows.error("expected a column Time (Seconds), got none; export it again", top)
    # a time code is that of day, in frames of a camera: the number of the frame is finer
    t_s = block.numbers([0])[:, 0] / float(rate) if time is None else block.numbers([time])[:, 0]
    block.check_times(t_s, block.labels[time or 0])
    factor = _metres(rows, settings)
    bodies, markers = {}, {}
    for (kind, name), columns in _motive_things(labels, block.labels).items():
        place = [columns.get(("Position", axis)) for axis in _AXES]
        turn = [columns.get(("Rotation", axis)) for axis in ("W", *_AXES)]
        if None in place:
            continue
        position = factor * block.numbers([c for c in place if c is not None])
        if kind in _MARKERS:
            markers[name] = position
        elif kind in _BODIES:
            bodies[name] = (position, _quaternions(block, settings, turn))
    return Logged(path, t_s, block.line, bodies, markers, up="y")


def _settings(rows: FileRows) -> Mapping[str, str]:
    first = rows.cells[rows.first]
    if first[0] != "Format Version":
        text = f"begins with {first[0]!r}; {_EXPECTED_MOTIVE}{rows.taken_for()}"
        raise rows.error(text, rows.first)
    return dict(zip(first[::2], first[1::2], strict=False))


def _labels(rows: FileRows, top: int) -> _Labels:
    """The rows of labels by their content: version 1.22 does not name them, 1.25 adds one."""
    kind: Row = []
    name: Row = []
    quantity: Row = []
    for row in rows.cells[rows.first + 1 : top]:
        words = {cell.lower() for cell in row if cell}
        label = row[1].lower() if len(row) > 1 else ""
        if label == "type" or words & {*_BODIES, *_MARKERS}:
            kind = row
        elif label == "name" or (kind and not name and not label):
            name = row
        elif "position" in words:
            quantity = row
    if not (kind and name and quantity):
        lacking = "types" if not kind else "names" if not name else "Rotation and Position"
        text = f"expected rows of labels with Rigid Body, names and Position, got none of {lacking}"
        raise rows.error(text + "; export it again with the header", top)
    return _Labels(kind, name, quantity)


def _check_count(rows: FileRows, settings: Mapping[str, str], block: Block) -> None:
    said = settings.get("Total Exported Frames", "")
    if said.isdigit() and len(block.body) < int(said):
        text = (
            f"expected {counted(int(said), 'frame')} as the first line says, got "
            f"{len(block.body)}; is the file cut off? Export it again"
        )
        raise rows.error(text, block.body[-1])


def _metres(rows: FileRows, settings: Mapping[str, str]) -> float:
    unit = settings.get("Length Units", "")
    if unit.lower() not in _METRES:
        text = f"expected Length Units Meters, Centimeters or Millimeters, got {unit!r}"
        raise rows.error(f"{text}; export it again with one of them", rows.first)
    if settings.get("Coordinate Space", "Global").lower() != "global":
        text = f"expected Coordinate Space Global, got {settings['Coordinate Space']!r}"
        raise rows.error(f"{text}; export it again in global coordinates", rows.first)
    return _METRES[unit.lower()]


def _motive_things(labels: _Labels, axes: Row) -> dict[tuple[str, str], dict[tuple[str, str], int]]:
    """By type and name, the column of each quantity and axis."""
    out: dict[tuple[str, str], dict[tuple[str, str], int]] = {}
    for c in range(2, min(len(labels.kind), len(labels.name), len(labels.quantity), len(axes))):
        thing = (labels.kind[c].lower(), labels.name[c])
        out.setdefault(thing, {}).setdefault((labels.quantity[c], axes[c]), c)
    return out


def _quaternions(
    block: Block, settings: Mapping[str, str], columns: list[int | None]
) -> Array | None:
    given = [c for c in columns if c is not None]
    if not given:
        return None
    said = settings.get("Rotation Type", "Quaternion")
    if said.lower() == "quaternion" and len(given) == 4:
        return block.quaternions(given)
    if sorted(said.upper()) != list("XYZ") or len(given) != 3 or columns[0] is not None:
        text = (
            f"expected Rotation Type Quaternion, or an order of Euler angles such as XYZ, got "
            f"{said!r} with {counted(len(given), 'column')} of rotations; export it again"
        )
        raise block.rows.error(text, block.rows.first)
    # Motive turns about moving axes in the order of the type's letters ("relative" in its SDK's
    # samples): XYZ is R = Rx Ry Rz
    return rotations(np.radians(block.numbers(given)), said.upper())


# CSV and text exports of Vicon's Nexus: blocks of segments and of trajectories.
#
# A block begins with its kind and its rate, then rows of names, labels and units; other blocks
# (devices, joints) are ignored. Time is frame over rate.

_EXPECTED_VICON = "expected an export of Vicon, whose blocks begin with Segments or Trajectories"
ROTATIONS = "vector, or the order of Euler angles such as xyz (about fixed axes) or XYZ (moving)"
_PLACES = (("TX", "TY", "TZ"), ("X", "Y", "Z"))
_QUATERNION, _THREE = ("RW", "RX", "RY", "RZ"), ("RX", "RY", "RZ")


@dataclass(frozen=True)
class _Found:
    """A block of an export: its kind, its rate [Hz], names above its columns, units, numbers."""

    kind: str
    rate: float
    names: list[str]
    units: list[str]
    block: Block


def read_vicon(path: Path, rotation: str | None = None, *, bodies_too: bool = True) -> Logged:
    """Read an export of Nexus.

    Args:
        path: the file.
        rotation: the meaning of three numbers of a rotation, :data:`ROTATIONS`; None if there are
            none.
        bodies_too: read segments; without them the meaning of rotations does not matter.

    Raises:
        InputFileError: another kind of file, broken rows, or rotations of unknown meaning.
    """
    rows = FileRows.of(path, _EXPECTED_VICON)
    begins = rows.cells[rows.first][0]
    if begins.lower() not in VICON:
        raise rows.error(f"begins with {begins!r}; {_EXPECTED_VICON}{rows.taken_for()}", rows.first)
    found = [block for block in _blocks(rows) if block.kind in ("segments", "trajectories")]
    if not found:
        raise rows.error("has no block Segments or Trajectories; export it with these", rows.first)
    frames = [one.block.numbers([0])[:, 0] for one in found]
    for one, frame in zip(found, frames, strict=True):
        one.block.check_times(frame / one.rate, "Frame")
    for one, frame in zip(found[1:], frames[1:], strict=True):
        if not np.array_equal(frame, frames[0]):
            text = f"expected the frames of the first block again, got {len(frame)} different ones"
            raise rows.error(f"{text}; export the blocks one at a time", one.block.body[0])
    bodies: dict[str, tuple[Array, Array | None]] = {}
    markers: dict[str, Array] = {}
    for one in found:
        for name, columns in _vicon_things(one).items():
            place = next((p for p in _PLACES if set(p) <= set(columns)), None)
            if place is None:
                continue
            position = _lengths(one, [columns[axis] for axis in place])
            if one.kind == "trajectories":
                markers[name] = position
            elif bodies_too:
                bodies[name] = (position, _rotations(one, columns, rotation))
    t_s = frames[0] / found[0].rate
    return Logged(path, t_s, found[0].block.line, bodies, markers)


def _blocks(rows: FileRows) -> list[_Found]:
    out = []
    starts = [k for k, row in enumerate(rows.cells) if row and row[0] == "Frame"]
    for top in starts:
        if top < 3 or not any(rows.cells[top - 3]):
            text = "expected the kind, rate and names of the block above, got an incomplete header"
            raise rows.error(f"{text}; export it again", top)
        kind, rate = rows.cells[top - 3][0].lower(), _rate(rows, top - 2)
        end = top + 2
        while end < len(rows.cells) and any(rows.cells[end]):
            end += 1
        block = Block.of(rows, top, range(top + 2, end))
        out.append(_Found(kind, rate, rows.cells[top - 1], rows.cells[top + 1], block))
    return out


def _rate(rows: FileRows, row: int) -> float:
    cell = rows.cells[row][0] if rows.cells[row] else ""
    try:
        rate = float(cell)
    except ValueError:
        rate = math.nan
    if not rate > 0.0:
        raise rows.error(f"expected the rate of the block in Hz, got {cell!r}", row)
    return rate


def _vicon_things(one: _Found) -> dict[str, dict[str, int]]:
    """By name, the column of each label; a name is above the first of its columns."""
    out: dict[str, dict[str, int]] = {}
    name = ""
    for c, label in enumerate(one.block.labels):
        if c < 2:
            continue
        name = one.names[c] if c < len(one.names) and one.names[c] else name
        out.setdefault(name, {})[label.upper()] = c
    return out


def _unit(one: _Found, column: int) -> str:
    return one.units[column] if column < len(one.units) else ""


def _lengths(one: _Found, columns: list[int]) -> Array:
    units = of_columns("m")
    unit = _unit(one, columns[0])
    if unit not in units:
        row = one.block.label_row + 1
        text = f"expected a unit of length under the labels ({', '.join(units)}), got {unit!r}"
        raise one.block.rows.error(text, row, one.block.labels[columns[0]])
    return units[unit].to_si(one.block.numbers(columns))


def _rotations(one: _Found, columns: dict[str, int], rotation: str | None) -> Array | None:
    if set(_QUATERNION) <= set(columns):
        return one.block.quaternions([columns[axis] for axis in _QUATERNION])
    if not set(_THREE) <= set(columns):
        return None
    if rotation is None:
        text = "three numbers of a rotation can mean several things; expected --rotation"
        raise one.block.rows.error(f"{text} {ROTATIONS}", one.block.label_row)
    given = [columns[axis] for axis in _THREE]
    unit = of_columns("rad").get(_unit(one, given[0]))
    if unit is None:
        text = f"expected deg or rad under the labels, got {_unit(one, given[0])!r}"
        raise one.block.rows.error(text, one.block.label_row + 1)
    return rotations(unit.to_si(one.block.numbers(given)), rotation)


def rotations(angles: Array, rotation: str) -> Array:
    """Quaternions (n, 4) of three numbers (n, 3) [rad], of a kind in :data:`ROTATIONS`.

    NaN where the body was not seen.
    """
    out, seen = np.full((len(angles), 4), np.nan), np.isfinite(angles).all(axis=1)
    if rotation == "vector":
        turn = Rotation.from_rotvec(angles[seen])
    else:
        order = ["xyz".index(axis) for axis in rotation.lower()]
        turn = Rotation.from_euler(rotation, angles[seen][:, order])
    out[seen] = turn.as_quat(scalar_first=True)
    return out
