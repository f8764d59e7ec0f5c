"""How figures are drawn and put into the page: SVG images, in one set of colours."""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path as FilePath
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from seecr.pose import Array
from seecr.show.colours import FAINT, GREY, INK
from seecr.show.figures import STYLE

WIDTH = 10.4
"""Width of a figure [in]; the page scales it to its own."""

# Beside what is drawn [in]: letters are up to so much wider in a PNG, or in the reader's browser,
# than where they were measured.
_ROOM = 0.09

# Of the ticks for which Matplotlib sees room: labels such as 0.003 are wider than it thinks.
_OF_ROOM = 0.7

# The same figure is the same file.
_NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))

MANY = 400
"""More marks than this are drawn as an image: the page is to stay small."""

_STYLE: Any = {
    **STYLE,
    # text is measured in the first and shown in whatever of these the reader has
    "font.sans-serif": ["DejaVu Sans", "Segoe UI", "Helvetica Neue", "Arial", "sans-serif"],
    "text.parse_math": False,  # names of cables and runs are a user's
    "font.size": 8.5, "axes.titlesize": 9.0, "axes.labelsize": 8.5,
    "axes.grid": False, "grid.alpha": 1.0, "axes.axisbelow": True,
    "axes.linewidth": 0.7, "hatch.linewidth": 0.7,
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), GREY),
    **dict.fromkeys(("axes.labelcolor", "text.color", "xtick.labelcolor", "ytick.labelcolor"), INK),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), 7.5),
    **dict.fromkeys(("xtick.major.width", "ytick.major.width"), 0.6),
    "figure.dpi": 72, "savefig.dpi": 130,
    "path.simplify": False,  # it would take dots for needless points of a line
}  # fmt: skip


@contextmanager
def styled() -> Iterator[None]:
    """The style of all figures."""
    with matplotlib.rc_context(_STYLE):
        yield


def blank(height: float, width: float = WIDTH, *, layout: str = "constrained") -> Figure:
    """An empty figure, so high and wide [in].

    Matplotlib finds room for all labels, which takes its time: "constrained", or "compressed" for
    panels of equal scales. With "none" the caller does.
    """
    engine = ConstrainedLayoutEngine(w_pad=_ROOM, compress=layout == "compressed")
    figure = Figure(figsize=(width, height), layout=None if layout == "none" else engine)
    FigureCanvasSVG(figure)
    return figure


def grid(axes: Axes, axis: str = "both") -> None:
    """Faint lines behind the marks."""
    axes.grid(True, axis=axis, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]


_drawn: ContextVar[dict[str, Figure] | None] = ContextVar("drawn", default=None)


@contextmanager
def collecting() -> Iterator[dict[str, Figure]]:
    """The figures that are drawn meanwhile, by the names of the files they are kept in."""
    drawn: dict[str, Figure] = {}
    token = _drawn.set(drawn)
    try:
        yield drawn
    finally:
        _drawn.reset(token)


@contextmanager
def keeping(folder: FilePath) -> Iterator[None]:
    """Figures that are drawn meanwhile are kept in a folder too, as SVG and PNG."""
    with collecting() as drawn:
        yield
    with styled():
        for name, figure in drawn.items():
            for kind, metadata in (("svg", _NO_METADATA), ("png", {"Software": None})):
                path = folder / f"{name}.{kind}"
                figure.savefig(path, metadata=metadata, bbox_inches="tight", pad_inches=_ROOM)


def image(figure: Figure, words: str, *, cut: bool = False) -> str:
    """The figure as an element of the page; ``words`` say what it shows to who cannot see it.

    ``cut`` to what is drawn, where the layout leaves room around it.
    """
    buffer = io.BytesIO()
    if (layout := figure.get_layout_engine()) is not None:
        # else Matplotlib draws all of it once more, to find that out
        layout.execute(figure)
        figure.set_layout_engine("none")
    around = figure.get_tightbbox().padded(_ROOM) if cut else figure.bbox_inches
    box = around if cut else None
    figure.savefig(buffer, format="svg", metadata=_NO_METADATA, bbox_inches=box)
    if (drawn := _drawn.get()) is not None:
        drawn[re.sub(r"[^a-z0-9]+", "-", words.lower()).strip("-")] = figure
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    alt = html.escape(words, quote=True)
    # a narrower figure is that part of the page's width: its letters are as large as others'
    part = around.width / WIDTH
    style = f' style="--part: {part:.3f}"' if part < 1.0 else ""
    return f'<img alt="{alt}"{style} src="data:image/svg+xml;base64,{text}">'


# A dot is a line so long, as a part of the axis, with round ends.
_POINT = 1e-5


def dots(axes: Axes, x: Array, y: Array, size: float, colour: str, order: float) -> None:
    """Round dots of one colour, so many points wide, on an axis whose limits are known.

    As lines from each point to next to it they are a tenth of the text of markers in an SVG. Many
    are an image anyway.
    """
    x, y = x[np.isfinite(x) & np.isfinite(y)], y[np.isfinite(x) & np.isfinite(y)]
    if len(x) > MANY:
        axes.plot(
            x, y, linestyle="none", marker="o", markersize=size, markeredgewidth=0, color=colour,
            zorder=order,
        )  # fmt: skip
        return
    low, high = axes.get_xlim()
    ends = np.stack([x, x + _POINT * (high - low), np.full(len(x), np.nan)], axis=1)
    axes.plot(
        ends.ravel(), np.repeat(y, 3), color=colour, linewidth=size, solid_capstyle="round",
        zorder=order, snap=False,
    )  # fmt: skip


class _Decades(LogLocator):
    """Ticks at 1 and 3 times powers of ten; at powers alone where their labels would touch."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """Places of ticks between two values."""
        assert self.axis is not None
        room = _OF_ROOM * self.axis.get_tick_space()
        both = 2.0 * np.log10(max(vmax / vmin, 1.0)) <= room
        self.set_params(subs=(1.0, 3.0) if both else (1.0,))
        return super().tick_values(vmin, vmax)


def plain_log(axes: Axes) -> None:
    """A logarithmic axis of x whose labels are plain numbers."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(_Decades())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
