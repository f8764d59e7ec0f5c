"""A page that is drawn while something else is written.

Page and recording take a second or two each, much of it to import what draws them.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from crosscheck.cli.choices import figures_in
from seecr.processes import Job, Shared

if TYPE_CHECKING:
    from crosscheck import Comparison, Diagnosis
    from seecr.made import Made


@contextmanager
def page_beside(
    found: Comparison | Diagnosis, path: Path, made: Made, figures: Path | None
) -> Iterator[None]:
    """Write the page of a result, in another process if one is free; it is there at the end.

    Args:
        found: the result. path: the page. made: how it came about.
        figures: folder in which the figures are kept as well; None for none.
    """
    draw = partial(_drawn, found, path, made)
    with figures_in(figures), Job(draw, Shared()) as page:
        yield
        page.result()


def _drawn(found: Comparison | Diagnosis, path: Path, made: Made) -> None:
    from crosscheck.report import write_page

    with _uncollected():
        write_page(found, path, made)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without garbage collection, which takes an eighth of the time of drawing."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()
