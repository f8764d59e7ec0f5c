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
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
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
}  # fmt: skip


@contextmanager
def styled() -> Iterator[None]:
    """The style of all figures."""
    with matplotlib.rc_context(_STYLE):
        yield


def blank(height: float, width: float = WIDTH, *, constrained: bool = True) -> Figure:
    """An empty figure, so high and wide [in], in which Matplotlib finds room for all labels if it
    is ``constrained``, which takes its time.
    """
    layout = ConstrainedLayoutEngine(w_pad=_ROOM) if constrained else None
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasSVG(figure)
    return figure


def grid(axes: Axes, axis: str = "both") -> None:
    """Faint lines behind the marks."""
    axes.grid(True, axis=axis, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]


_folder: ContextVar[FilePath | None] = ContextVar("folder", default=None)


@contextmanager
def keeping(folder: FilePath | None) -> Iterator[None]:
    """Figures that are drawn meanwhile are kept in a folder too, as SVG and PNG."""
    token = _folder.set(folder)
    try:
        yield
    finally:
        _folder.reset(token)


_collected: ContextVar[dict[str, Figure] | None] = ContextVar("collected", default=None)


@contextmanager
def collecting() -> Iterator[dict[str, Figure]]:
    """The figures that are drawn meanwhile, by the names of the files they would be kept in."""
    drawn: dict[str, Figure] = {}
    token = _collected.set(drawn)
    try:
        yield drawn
    finally:
        _collected.reset(token)


def _keep(figure: Figure, svg: bytes, words: str) -> None:
    folder, drawn = _folder.get(), _collected.get()
    name = re.sub(r"[^a-z0-9]+", "-", words.lower()).strip("-")
    if drawn is not None:
        drawn[name] = figure
    if folder is None:
        return
    (folder / f"{name}.svg").write_bytes(svg)
    FigureCanvasAgg(figure)
    figure.savefig(folder / f"{name}.png", metadata={"Software": None})
    FigureCanvasSVG(figure)


def image(figure: Figure, words: str) -> str:
    """The figure as an element of the page; ``words`` say what it shows to who cannot see it."""
    buffer = io.BytesIO()
    if (layout := figure.get_layout_engine()) is not None:
        # else Matplotlib draws all of it once more, to find that out
        layout.execute(figure)
        figure.set_layout_engine("none")
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=nothing)
    _keep(figure, buffer.getvalue(), words)
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    alt = html.escape(words, quote=True)
    # a narrower figure is that part of the page's width: its letters are as large as others'
    part = figure.get_figwidth() / WIDTH
    style = f' style="--part: {part:.3f}"' if part < 1.0 else ""
    return f'<img alt="{alt}"{style} src="data:image/svg+xml;base64,{text}">'


class _Dots(PathPatch):
    """Lines from a point to itself with round ends: dots in SVG, in a tenth of the text.

    Agg leaves out lines without length: for it they are drawn as markers.
    """

    def __init__(self, points: Array, size: float, colour: str, order: float) -> None:
        codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(points))
        path = Path(np.repeat(points, 2, axis=0), codes)
        path.should_simplify = False  # it would take dots for needless points of a line
        super().__init__(
            path, fill=False, edgecolor=colour, linewidth=size, capstyle="round", zorder=order
        )
        self._markers = Line2D(*points.T, **_as_markers(size, colour))

    def draw(self, renderer: RendererBase) -> None:
        """Draw them as the renderer shows them."""
        if not isinstance(renderer, RendererAgg):
            super().draw(renderer)
            return
        assert self.axes is not None
        self._markers.set_figure(self.axes.figure)
        self._markers.set_transform(self.axes.transData)
        self._markers.set_clip_path(self.axes.patch)
        self._markers.draw(renderer)


def _as_markers(size: float, colour: str) -> dict[str, Any]:
    return {
        "linestyle": "none", "marker": "o", "markersize": size, "markeredgewidth": 0,
        "color": colour,
    }  # fmt: skip


def dots(axes: Axes, x: Array, y: Array, size: float, colour: str, order: float) -> None:
    """Round dots of one colour, so many points wide."""
    seen = np.isfinite(x) & np.isfinite(y)
    points = np.stack([x[seen], y[seen]], axis=1)
    if len(points) == 0:
        return
    if len(points) > MANY:
        axes.plot(*points.T, zorder=order, **_as_markers(size, colour))
        return
    # add_patch would look for the bends of each dot
    axes.add_artist(_Dots(points, size, colour, order))
    axes.update_datalim(points)
    axes.autoscale_view()


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
