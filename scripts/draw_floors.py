"""Draw docs/pictures/floors.svg: the floors of both packages, with the rooms on each.

    python scripts/draw_floors.py

A room is a folder or file at the top of a package. The floors are the table of
``tests/test_imports.py``, which holds every import to them. A test runs :func:`picture` and goes
red where the drawing is out of date.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "pictures" / "floors.svg"
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "support")]

from test_imports import TABLE, rooms_of  # noqa: E402

# What each floor is for, from the lowest up.
PURPOSES = (
    "every other part may use these",
    "files, poses, units, numbers",
    "what the robot is, and what it is told",
    "effects, balance of forces, readings",
    "where it rests, how it gets there",
    "what people see and type",
    "errors, arguments",
    "MuJoCo's physics; files of data",
    "residuals, fits, sets of effects",
    "where a model is off; what to measure",
    "which effects are missing",
    "what people see and type",
)

# Sizes [pixels].
_FLOOR, _BOX, _TITLE, _ROOMS, _LETTER, _GAP = 42, 30, 34, 285, 8.0, 8
_COLOURS = {"crosscheck": ("#e8f0fb", "#3d6fb0"), "seecr": ("#fdf0e0", "#c0792a")}


def picture() -> str:
    """The drawing as SVG text, the same for the same table."""
    body: list[str] = []
    y, package = 8, ""
    for line, purpose in reversed(tuple(zip(TABLE, PURPOSES, strict=True))):
        if line.partition(":")[0] != package:
            package = line.partition(":")[0]
            body.append(_text(package, 16, y + 23, 18, _COLOURS[package][1], "bold"))
            y += _TITLE
        body += _floor(line, purpose, y)
        y += _FLOOR
    size = f'width="{_width():.0f}" height="{y + 4}" viewBox="0 0 {_width():.0f} {y + 4}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *body, "</svg>\n"])


def _floor(line: str, purpose: str, y: int) -> Iterator[str]:
    """A floor: its background, what it is for, and its rooms from left to right."""
    fill, edge = _COLOURS[line.partition(":")[0]]
    size = f'width="{_width() - 16:.0f}" height="{_FLOOR - 4}"'
    yield f'<rect x="8" y="{y}" {size} rx="6" fill="{fill}"/>'
    yield _text(purpose, 20, y + 24, 13, "#5b6570")
    x = float(_ROOMS)
    for title in _titles(line):
        yield (
            f'<rect x="{x:.0f}" y="{y + 4}" width="{_box(title):.0f}" height="{_BOX}" rx="5" '
            f'fill="white" stroke="{edge}"/>'
        )
        yield _text(title, x + 9, y + 24, 13, "#1d2733")
        x += _box(title) + _GAP


def _titles(line: str) -> list[str]:
    """The rooms of a floor, folders with a stroke."""
    folders = [ROOT.joinpath(*room.split(".")).is_dir() for room in rooms_of(line)]
    names = [room.partition(".")[2] for room in rooms_of(line)]
    return [f"{name}/" if folder else name for name, folder in zip(names, folders, strict=True)]


def _box(title: str) -> float:
    """Width of a room."""
    return _LETTER * len(title) + 22


@cache
def _width() -> float:
    """Of the picture, in which the widest floor has room."""
    return _ROOMS + 12 + max(sum(_box(title) + _GAP for title in _titles(line)) for line in TABLE)


def _text(words: str, x: float, y: int, size: int, fill: str, weight: str = "normal") -> str:
    return (
        f'<text x="{x:.0f}" y="{y}" font-size="{size}" fill="{fill}" '
        f'font-weight="{weight}">{escape(words)}</text>'
    )


if __name__ == "__main__":
    part = PICTURE.with_suffix(".svg.part")
    part.write_text(picture(), encoding="utf-8")
    part.replace(PICTURE)
    sys.stdout.write(f"{PICTURE.name}: {len(TABLE)} floors\n")
