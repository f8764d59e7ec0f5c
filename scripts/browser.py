"""Look at a page with the Chromium or Chrome on the path: measure it, photograph it, print it.

A window cannot be as narrow as a telephone, a frame in it can: pages are looked at in a frame.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
# Chromium's least width of a window, and of its height what no page gets [pixels].
_LEAST, _FRAME = 500, 200
# Nobody's page takes longer [s].
_PATIENCE = 60
_MEASURE = """
const frame = document.querySelector("iframe");
frame.onload = () => {
  const page = frame.contentDocument, root = page.documentElement;
  const style = (e) => page.defaultView.getComputedStyle(e);
  const scrolls = (e) => ["auto", "scroll"].includes(style(e).overflowX);
  const inside = (e) => e !== page.body && (scrolls(e) || inside(e.parentElement));
  const wide = [...page.body.querySelectorAll("*")].filter(
    (e) => e.getBoundingClientRect().right > root.clientWidth + 1 && !inside(e.parentElement));
  const moved = [...page.querySelectorAll(".scrolls")].filter((e) => e.scrollWidth > e.clientWidth);
  const said = (some) => some.map((e) => e.outerHTML.slice(0, 80));
  document.title = JSON.stringify({width: root.scrollWidth, height: root.scrollHeight,
    wide: said(wide), moved: said(moved)});
};
"""


@dataclass(frozen=True)
class Size:
    """What a page takes [pixels], and the beginnings of elements that reach beyond its width.

    Tables in a box of their own can be ``moved`` sideways if they do not fit into it.
    """

    width: int
    height: int
    wide: list[str]
    moved: list[str]


def browser() -> str | None:
    """The browser's program; None where there is none."""
    return next((found for name in _NAMES if (found := shutil.which(name))), None)


def measure(page: Path, width: int) -> Size:
    """How large a page is where it may be so wide [pixels]."""
    with tempfile.TemporaryDirectory() as scratch:
        framed = _framed(page, width, 800, Path(scratch))
        return Size(**json.loads(title(framed)))


def title(page: Path) -> str:
    """The title of a page once its scripts have run."""
    dump = _run(page, "--dump-dom", "--window-size=1400,900", "--virtual-time-budget=3000")
    found = re.search(r"<title>(.*?)</title>", dump, re.DOTALL)
    assert found is not None, dump[:300]
    return html.unescape(found[1])


def shoot(
    page: Path, path: Path, width: int, *, dark: bool = False, height: int | None = None,
    scale: float = 1.0,
) -> None:  # fmt: skip
    """Photograph a page from its top, so wide [pixels]; all of it unless a height is given."""
    height = height or measure(page, width).height
    with tempfile.TemporaryDirectory() as scratch:
        framed = _framed(page, width, height, Path(scratch))
        _run(
            framed, f"--screenshot={path}", f"--force-device-scale-factor={scale}",
            f"--window-size={max(width, _LEAST)},{height + _FRAME}",
            f"--blink-settings=preferredColorScheme={0 if dark else 1}",
        )  # fmt: skip
    with Image.open(path) as taken:
        cut = taken.convert("RGB").crop((0, 0, round(scale * width), round(scale * height)))
    cut.save(path, optimize=True)


def print_page(page: Path, path: Path) -> None:
    """The page as it comes from a printer, as a PDF."""
    _run(page, f"--print-to-pdf={path}", "--no-pdf-header-footer")


def _framed(page: Path, width: int, height: int, folder: Path) -> Path:
    """A page that holds another one in a frame of that size [pixels]."""
    inner = html.escape(page.read_text(encoding="utf-8"), quote=True)
    style = f"width: {width}px; height: {height}px; border: 0; display: block"
    path = folder / "framed.html"
    path.write_text(
        '<!DOCTYPE html><html><head><meta charset="utf-8"><title></title></head>'
        f'<body style="margin: 0"><iframe style="{style}" srcdoc="{inner}"></iframe>'
        f"<script>{_MEASURE}</script></body></html>",
        encoding="utf-8",
    )
    return path


def _run(page: Path, *options: str) -> str:
    program = browser()
    assert program is not None, "no Chromium or Chrome on the path"
    with tempfile.TemporaryDirectory() as profile:
        done = subprocess.run(
            [program, *_QUIET, f"--user-data-dir={profile}", *options, page.resolve().as_uri()],
            check=True, capture_output=True, text=True, timeout=_PATIENCE,
        )  # fmt: skip
    return done.stdout
