"""Axes for figures: labels with units, and colours that everybody can tell apart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from seecr.files import written

STYLE: Any = {
    "font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False,
    "axes.spines.right": False, "legend.frameon": False, "figure.dpi": 150,
    "svg.hashsalt": "seecr", "svg.fonttype": "none", "axes.titlesize": 9.5,
}  # fmt: skip
"""Of every figure; pages have a few things of their own."""


@contextmanager
def figure(path: Path | None, rows: int = 1, columns: int = 1, **options: Any) -> Iterator[Any]:
    """Axes (rows, columns) of a figure that is written when the block ends, as png, svg or pdf.

    Without a path it is not written.
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):
        # without pyplot: no window system, and nothing that stays in memory
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        size = options.pop("figsize", (6.4 * columns, 2.2 * rows))
        drawn = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(drawn)
        yield drawn.subplots(rows, columns, squeeze=False, **options)
        if path is None:
            return
        metadata = {"Date": None} if path.suffix == ".svg" else None
        with written(path) as (part,):
            drawn.savefig(part, format=path.suffix.removeprefix("."), metadata=metadata)
