"""Figures by themselves: an image with words, dots, and the map's caption."""

from __future__ import annotations

import base64
import itertools
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from crosscheck.show import error_figures
from crosscheck.show.error_figures import rows_per_arrow
from crosscheck.show.figures import MANY, blank, collecting, dots, image, plain_log, styled


def drawn(points: int) -> str:
    """The SVG of so many dots."""
    with styled():
        figure = blank(1.0)
        axes = figure.subplots()
        x = np.linspace(0.1, 1.0, points)
        x[0] = np.nan
        dots(axes, x, x, 2.0, "#123456", 1.0)
        markup = image(figure, 'what "it" <shows>')
    assert markup.startswith('<img alt="what &quot;it&quot; &lt;shows&gt;" src="data:image/svg')
    found = re.search(r'base64,([^"]*)">$', markup)
    assert found is not None
    return base64.b64decode(found[1]).decode()


@pytest.mark.slow
def test_a_figure_is_an_image_with_words_and_the_same_twice() -> None:
    text = drawn(5)
    assert ElementTree.fromstring(text).tag.endswith("svg")
    assert drawn(5) == text


@pytest.mark.parametrize("points", [5, MANY + 2])
def test_dots_that_were_not_read_are_not_drawn(points: int) -> None:
    text = drawn(points)
    if points <= MANY:
        (path,) = re.findall(r'd="(M[^"]*)"[^>]*stroke: #123456', text)
        assert path.count("M") == points - 1
    else:
        assert text.count("<use") >= points - 1


def dots_on_png(folder: Path, points: int) -> tuple[float, float, float]:
    """Of one dot among so many on a PNG: its middle and width, in parts of the picture."""
    with styled(), collecting() as drawn:
        figure = blank(2.0, 2.0, layout="none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        dots(axes, np.full(points, 0.25), np.full(points, 0.75), 14.4, "#ff0000", 1.0)
        axes.set_axis_off()
        image(figure, "some dots")
    drawn["some-dots"].savefig(folder / "dots.png", dpi=130)
    with Image.open(folder / "dots.png") as taken:
        red = np.asarray(taken.convert("RGB"))[..., 1] < 128
    down, across = np.nonzero(red)
    size = len(red)
    return across.mean() / size, 1.0 - down.mean() / size, np.ptp(across) / size


@pytest.mark.parametrize("points", [1, MANY + 2])
def test_dots_are_on_the_png_too_where_they_are_and_as_large(tmp_path: Path, points: int) -> None:
    """14.4 pt are a tenth of 2 in."""
    assert dots_on_png(tmp_path, points) == pytest.approx((0.25, 0.75, 0.1), abs=0.01)


@pytest.mark.parametrize(("rows", "every"), [(1, 1), (250, 1), (251, 2), (1000, 4)])
def test_arrows_are_thinned_out(rows: int, every: int) -> None:
    shown: Any = SimpleNamespace(rows=np.arange(rows))
    assert rows_per_arrow(shown) == every


def light(colour: np.ndarray) -> float:
    """Relative luminance of sRGB (3,), as WCAG 2.2 defines it."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def in_the_dark(colour: np.ndarray) -> np.ndarray:
    """What the page's filter makes of it: invert(.92) hue-rotate(180deg)."""
    luma = np.array([0.213, 0.715, 0.072])
    inverted = 0.92 - 0.84 * colour
    return np.clip(2.0 * (luma @ inverted) - inverted, 0.0, 1.0)


def test_dots_of_small_errors_stand_out_from_light_and_dark_pages() -> None:
    style = Path(error_figures.__file__).with_name("page.css").read_text()
    assert "invert(.92) hue-rotate(180deg)" in style and "--paper: #14181c" in style
    paper = light(np.array([0x14, 0x18, 0x1C]) / 255.0)
    for part in np.linspace(0.0, 1.0, 11):
        colour = np.array(error_figures._COLOURS(part)[:3])
        assert 1.05 / (light(colour) + 0.05) >= 3.0
        assert (light(in_the_dark(colour)) + 0.05) / (paper + 0.05) >= 3.0


def test_labels_of_a_wide_range_are_plain_numbers_that_do_not_touch() -> None:
    with styled():
        figure = blank(1.2, 3.0, layout="none")
        axes = figure.subplots()
        plain_log(axes)
        for low, top, least in ((0.01, 30.0, 4), (1.0, 1e2, 5), (1e-2, 1e3, 5)):
            axes.set_xlim(low, top)
            figure.canvas.draw()
            labels = [label for label in axes.get_xticklabels() if label.get_text()]
            assert {"1", "10"} <= {label.get_text() for label in labels}
            assert not any("10^" in label.get_text() for label in labels)
            shown = [
                one.get_window_extent() for one in labels if low <= one.get_position()[0] <= top
            ]
            assert len(shown) >= least
            assert all(a.x1 + 2.0 < b.x0 for a, b in itertools.pairwise(shown))
