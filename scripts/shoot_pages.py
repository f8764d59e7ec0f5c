"""Photograph the pages: light and dark, wide and as narrow as a telephone, and as printed.

    python scripts/shoot_pages.py [FOLDER] [PAGE...]

Twins of small robots are compared, diagnosed and planned for; their pages and pictures are written
to the folder (``pages`` without one). With names of pages only those are made. Where there is no
Chromium or Chrome on the path the pages are written and no pictures are taken.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import browser

from crosscheck.comparison.residuals import compare
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.planning.design import make_plan
from crosscheck.show.pictures import write_page
from crosscheck.twin.make import Twin, make_twin
from seecr.description.mjcf import model_path
from seecr.files import Made

WIDTHS = (1280, 390)
FEW = ("stiffness", "platform_mass", "pulley_radius", "exit_point_error", "tracker_frame")


def twin(robot: str, *effects: str, points: int = 8, tensions: bool = True) -> Twin:
    """A robot that is measured with these effects."""
    return make_twin(model_path(robot), 3, effects=effects, points=points, tensions=tensions)


def _compared(robot: str, *effects: str, points: int = 8) -> Callable[[Path, Made], None]:
    def write(path: Path, made: Made) -> None:
        one = twin(robot, *effects, points=points)
        write_page(compare(one.robot, one.measured), path, made)

    return write


def _diagnosed(robot: str, *effects: str, points: int = 8) -> Callable[[Path, Made], None]:
    def write(path: Path, made: Made) -> None:
        one = twin(robot, *effects, points=points)
        write_page(diagnose(one.robot, one.measured, only=FEW), path, made)

    return write


def _unknown(path: Path, made: Made) -> None:
    """Of a fault for which it may not look."""
    one = twin("planar_vertical", "gravity_tilt", "cable_length_offset", points=12)
    write_page(diagnose(one.robot, one.measured, only=FEW[:2]), path, made)


def _planned(robot: str) -> Callable[[Path, Made], None]:
    def write(path: Path, made: Made) -> None:
        one = twin(robot, points=6)
        write_page(make_plan(one.robot, one.measured), path, made)

    return write


PAGES: dict[str, Callable[[Path, Made], None]] = {
    "compare": _compared("demobot_cogiro", "pulley_radius"),
    "compare-agrees": _compared("planar_vertical"),
    "diagnose": _diagnosed("demobot_parallel", "pulley_radius", "exit_point_error", points=10),
    "diagnose-nothing": _diagnosed("planar_vertical"),
    "diagnose-unknown": _unknown,
    "plan": _planned("demobot_cogiro"),
}


def main(folder: Path, *names: str) -> None:
    """Write the pages and take their pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or PAGES:
        page = folder / f"{name}.html"
        PAGES[name](page, Made.now(f"python scripts/shoot_pages.py {name}", []))
        print(*photograph(page), sep="\n")


def photograph(page: Path) -> list[str]:
    """Take the pictures of a page, beside it; what there is to say of each."""
    if browser.browser() is None:
        return [f"{page.name}: no pictures, as there is no Chromium or Chrome on the path"]
    out = []
    for width in WIDTHS:
        size = browser.measure(page, width)
        too_wide = f", too wide: {' '.join(size.wide)}" if size.width > width else ""
        moved = f", to be moved sideways: {' '.join(size.moved)}" if size.moved else ""
        out.append(f"{page.name} at {width}: {size.width} x {size.height}{too_wide}{moved}")
        for dark in (False, True):
            path = page.with_name(f"{page.stem}-{width}-{'dark' if dark else 'light'}.png")
            browser.shoot(page, path, width, dark=dark, height=size.height)
    browser.print_page(page, page.with_suffix(".pdf"))
    return out


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("pages"))
    parser.add_argument("pages", nargs="*", metavar="page", help=" ".join(PAGES))
    given = parser.parse_args()
    if unknown := set(given.pages) - set(PAGES):
        parser.error(f"no page {', '.join(sorted(unknown))}; pages are {', '.join(PAGES)}")
    main(given.folder, *given.pages)
