"""CSV exports of OptiTrack's Motive 1.2x, recognised by their labels.

The first row has pairs (format version, units, rotation type), then there are a few rows of labels,
some of which depend on the version, then ``Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,...``. Quaternions
have the scalar last; Y is up unless chosen otherwise; cells of hidden bodies are blank.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from crosscheck.importing.logged import Logged
from crosscheck.importing.rows import Block, FileRows, Row, check_body, unit_quaternions
from seecr.counted import counted
from seecr.pose import Array

_EXPECTED = "expected a CSV export of Motive, which begins with Format Version"
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
        InputFileError: another kind of file, rotations other than quaternions, or broken rows.
    """
    rows = FileRows.of(path, _EXPECTED)
    settings = _settings(rows)
    top = next((k for k, row in enumerate(rows.cells) if row and row[0] == "Frame"), None)
    if top is None:
        raise rows.error("has no row of labels that begins with Frame; is the file cut off?")
    labels = _labels(rows, top)
    block = Block(rows, top, _body(rows, top))
    block.check_whole()
    _check_count(rows, settings, block)
    time = next((c for c, cell in enumerate(block.labels) if cell.startswith("Time (")), None)
    if time is None:
        raise rows.error("expected a column Time (Seconds), got none; export it again", top)
    t_s = block.numbers([time])[:, 0]
    block.check_times(t_s, block.labels[time])
    factor = _metres(rows, settings)
    bodies, markers = {}, {}
    for (kind, name), columns in _things(labels, block.labels).items():
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
        text = f"begins with {first[0]!r}; {_EXPECTED}{rows.taken_for()}"
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


def _body(rows: FileRows, top: int) -> range:
    last = max(k for k, row in enumerate(rows.cells) if any(row))
    body = range(top + 1, last + 1)
    check_body(rows, body, "frames")
    return body


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


def _things(labels: _Labels, axes: Row) -> dict[tuple[str, str], dict[tuple[str, str], int]]:
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
    if said.lower() != "quaternion" or len(given) != 4:
        text = f"expected Rotation Type Quaternion, got {said!r}; export it again with quaternions"
        raise block.rows.error(text, block.rows.first)
    return unit_quaternions(
        block.numbers(given), lambda text, row: block.rows.error(text, block.body[row])
    )
