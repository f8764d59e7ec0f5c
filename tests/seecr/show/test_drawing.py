"""Figures, whatever is drawn in them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from seecr.pose import Array
from seecr.show.colours import COLOURS
from seecr.show.figures import figure


def drawn(path: Path) -> bytes:
    with figure(path, 1, 2, figsize=(2.0, 1.0)) as axes:
        axes[0, 1].plot([0.0, 1.0], [0.0, 1.0], label="a tension")
        axes[0, 1].set_title("a title")
        assert not path.exists()
    return path.read_bytes()


def test_the_same_is_drawn_into_the_same_file(tmp_path: Path) -> None:
    """Which tells that a picture in the repository is up to date."""
    first = drawn(tmp_path / "a.svg")
    assert drawn(tmp_path / "b.svg") == first
    assert b"<dc:date" not in first and b"a title</text>" in first


def test_a_figure_is_as_large_as_asked_for(tmp_path: Path) -> None:
    drawn(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (300, 150)


def test_what_fails_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), figure(tmp_path / "a.png"):
        raise RuntimeError
    assert not list(tmp_path.iterdir())


# Linear RGB as seen without one kind of cone: Machado et al. (2009), table 1, severity 1.0.
SEEN = {
    "all cones": np.eye(3),
    "no long": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]]
    ),
    "no middle": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]]
    ),
    "no short": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
         [0.004733, 0.691367, 0.303900]]
    ),
}  # fmt: skip
# Linear sRGB to CIE XYZ of white 1 (IEC 61966-2-1, white D65).
XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
) / np.array([[0.9505], [1.0], [1.0890]])  # fmt: skip


def lab(colour: str, seen: Array) -> Array:
    """CIE L*a*b* of a colour as it is seen."""
    part = np.array(to_rgb(colour))
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(XYZ @ np.clip(seen @ linear, 0.0, 1.0))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize("cones", SEEN)
def test_lines_of_eight_cables_differ_for_everybody(cones: str) -> None:
    """The eighth colour was the second one for whoever sees no red, and nearly so without green."""
    every = [lab(colour, SEEN[cones]) for colour in COLOURS]
    apart = [np.linalg.norm(a - b) for a, b in combinations(every, 2)]
    assert min(apart) > 15.0
