"""Draw docs/pictures/floors.svg: what stands on what, from the imports themselves.

    python scripts/draw_floors.py

A room is a folder or file at the top of a package; its floor is the one that
``tests/test_imports.py`` holds it to. A line says that the upper room imports the lower one. Where
a room reaches another through a third that it imports as well, the direct line is left out. A test
runs :func:`picture` and goes red where the drawing is out of date.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "pictures" / "floors.svg"
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "support")]

from layered import Layout, arrange  # noqa: E402
from sources import imports, modules, name_of  # noqa: E402
from test_imports import FLOORS, place  # noqa: E402

PACKAGES = ("crosscheck", "seecr")
"""From the upper to the lower one."""

# Sizes [pixels]: of letters, of a room's box and of the space between floors.
_LETTER, _SMALL = 8.0, 6.2
_PADDING, _BOX, _GAP, _FLOOR = 12.0, 40.0, 26.0, 44.0
_MARGIN, _TITLE = 24.0, 44.0
_COLOURS = {"crosscheck": ("#e8f0fb", "#3d6fb0"), "seecr": ("#fdf0e0", "#c0792a")}

Arrows = Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class Room:
    """A box of the drawing.

    Attributes:
        name: of the folder or file, with its package.
        below: rooms of the lower package that it imports, by their last names.
    """

    name: str
    below: tuple[str, ...]

    @property
    def title(self) -> str:
        """What stands in the box: a folder's name ends in a stroke."""
        path = ROOT.joinpath(*self.name.split("."))
        return self.name.split(".")[1] + ("/" if path.is_dir() else "")

    @property
    def lines(self) -> list[str]:
        """Small lines under the title: what it takes of the lower package."""
        if not self.below:
            return []
        words = [f"{PACKAGES[1]}:", *(f"{b}," for b in self.below[:-1]), self.below[-1]]
        lines = [""]
        for word in words:
            if len(lines[-1]) + len(word) > 26:
                lines.append("")
            lines[-1] = f"{lines[-1]} {word}".strip()
        return lines

    @property
    def width(self) -> float:
        """Width of the box [pixels]."""
        longest = max((len(line) for line in self.lines), default=0)
        return 2 * _PADDING + max(_LETTER * len(self.title), _SMALL * longest)

    @property
    def height(self) -> float:
        """Height of the box [pixels]."""
        return _BOX - 8.0 + 12.0 * len(self.lines)


def arrows() -> dict[str, frozenset[str]]:
    """Rooms, each with the rooms on lower floors that it imports."""
    found: dict[str, set[str]] = {name: set() for name in FLOORS}
    for package in PACKAGES:
        for path in modules(package):
            own = place(name_of(path))
            if own in FLOORS:
                found[own] |= {place(target) for target in imports(path)} & set(FLOORS)
    return {a: frozenset(b for b in to if FLOORS[b] < FLOORS[a]) for a, to in found.items()}


def without_detours(graph: Arrows) -> dict[str, frozenset[str]]:
    """The arrows that are not also a way through a third room."""

    @cache
    def reached(start: str) -> set[str]:
        return set(graph[start]).union(*(reached(b) for b in graph[start]))

    return {
        a: frozenset(b for b in to if not any(b in reached(c) for c in to - {b}))
        for a, to in graph.items()
    }


def picture() -> str:
    """The drawing as SVG text, the same for the same imports."""
    graph = arrows()
    blocks = [_block(package, graph) for package in PACKAGES]
    width = max(layout.width for _, layout in blocks) + 2 * _MARGIN
    body: list[str] = []
    top = _MARGIN
    for package, (rooms, layout) in zip(PACKAGES, blocks, strict=True):
        left = (width - layout.width) / 2
        body += _drawn(package, rooms, layout, left, top, width)
        top += layout.height + _TITLE + 1.5 * _MARGIN
    size = f'width="{width:.0f}" height="{top:.0f}" viewBox="0 0 {width:.0f} {top:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *body, "</svg>\n"])


def _block(package: str, graph: Arrows) -> tuple[dict[str, Room], Layout]:
    """A package's rooms, and where they go."""
    own = [name for name in FLOORS if name.startswith(f"{package}.")]
    rooms = {name: Room(name, _below(package, graph[name])) for name in own}
    inner = {name: frozenset(b for b in graph[name] if b in rooms) for name in own}
    floors = sorted({FLOORS[name] for name in own}, reverse=True)
    rows = [sorted(n for n in own if FLOORS[n] == floor) for floor in floors]
    sizes = {name: (room.width, room.height) for name, room in rooms.items()}
    return rooms, arrange(rows, without_detours(inner), sizes, gap=_GAP, space=_FLOOR)


def _below(package: str, targets: frozenset[str]) -> tuple[str, ...]:
    return tuple(sorted(t.split(".")[1] for t in targets if not t.startswith(f"{package}.")))


def _drawn(
    package: str, rooms: Mapping[str, Room], layout: Layout, left: float, top: float, width: float
) -> Iterator[str]:
    """A package's title, its lines, and its boxes over them."""
    fill, edge = _COLOURS[package]
    height = layout.height + _TITLE + 0.5 * _MARGIN
    yield (
        f'<rect x="8" y="{top:.0f}" width="{width - 16:.0f}" height="{height:.0f}" rx="10" '
        f'fill="{fill}" fill-opacity="0.35"/>'
    )
    yield _text(package, 24, top + 28, 18, edge, anchor="start", weight="bold")
    top += _TITLE
    for way in layout.ways:
        yield f'<path d="{_curve(way, left, top)}" fill="none" stroke="#8a94a0"/>'
    for name, room in rooms.items():
        x, y = layout.middle[name]
        yield from _box(room, x + left, y + top, fill, edge)


def _box(room: Room, x: float, y: float, fill: str, edge: str) -> Iterator[str]:
    upper = y - room.height / 2
    yield (
        f'<rect x="{x - room.width / 2:.0f}" y="{upper:.0f}" width="{room.width:.0f}" '
        f'height="{room.height:.0f}" rx="6" fill="{fill}" stroke="{edge}"/>'
    )
    yield _text(room.title, x, upper + 21, 14, "#1d2733")
    for k, line in enumerate(room.lines):
        yield _text(line, x, upper + 36 + 12 * k, 11, "#5b6570")


def _text(
    words: str, x: float, y: float, size: int, fill: str, anchor: str = "middle", weight: str = ""
) -> str:
    bold = f' font-weight="{weight}"' if weight else ""
    return (
        f'<text x="{x:.0f}" y="{y:.0f}" font-size="{size}" fill="{fill}" '
        f'text-anchor="{anchor}"{bold}>{escape(words)}</text>'
    )


def _curve(way: list[tuple[float, float]], left: float, top: float) -> str:
    """A path down through points, upright at each."""
    points = [(x + left, y + top) for x, y in way]
    parts = [f"M{points[0][0]:.0f} {points[0][1]:.0f}"]
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        half = (y0 + y1) / 2
        parts.append(f"C{x0:.0f} {half:.0f} {x1:.0f} {half:.0f} {x1:.0f} {y1:.0f}")
    return " ".join(parts)


if __name__ == "__main__":
    part = PICTURE.with_suffix(".svg.part")
    part.write_text(picture(), encoding="utf-8")
    part.replace(PICTURE)
    sys.stdout.write(f"{PICTURE.name}: {len(FLOORS)} rooms\n")
