"""How figures are drawn and put into the page: SVG with text as text, in one set of colours."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

# Okabe and Ito (2008): pairs that stay apart for every common kind of colour blindness.
BEFORE, AFTER, UNSURE = "#D55E00", "#0072B2", "#8a94a0"
INK, GREY, FAINT, NOISE = "#1d2329", "#6b747d", "#e7eaed", "#d9dee3"
WIDTH = 10.4
"""Width of a figure [in]; the page scales it to its own."""

MANY = 400
"""More marks than this are drawn as an image: the page is to stay small."""

_STYLE = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # names of cables and runs are a user's
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.axisbelow": True,
    "axes.linewidth": 0.7,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "text.color": INK,
    "figure.dpi": 72,
    "savefig.dpi": 170,
    "legend.frameon": False,
    "hatch.linewidth": 0.7,
}


@contextmanager
def styled(salt: str) -> Iterator[None]:
    """The style of all figures; ``salt`` keeps the names inside one apart from the others'."""
    with matplotlib.rc_context({**_STYLE, "svg.hashsalt": salt}):
        yield


def blank(height: float, width: float = WIDTH) -> Figure:
    """An empty figure that fills the page's width, so high [in]."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure


def grid(axes: Axes, axis: str = "both") -> None:
    """Faint lines behind the marks."""
    axes.grid(True, axis=axis, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]


def svg(figure: Figure, words: str) -> str:
    """The figure as an element of the page.

    Args:
        figure: drawn.
        words: what it shows, for those who cannot see it.
    """
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # in a page no namespaces are declared, and a style sheet inside would be the whole page's
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\n?", "", text, flags=re.DOTALL)
    head = f'<svg role="img" aria-label="{html.escape(words, quote=True)}"'
    text = re.sub(r'<svg width="[^"]*" height="[^"]*"', lambda _m: head, text, count=1)
    # a hundredth of a point is finer than any screen
    return re.sub(r"(\d+\.\d\d)\d+", r"\1", text).strip()
