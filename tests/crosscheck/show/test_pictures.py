"""Results draw themselves; figures by themselves."""

from __future__ import annotations

import base64
import itertools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import made_diagnoses
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import crosscheck
import seecr
from crosscheck.show import error_figures
from crosscheck.show.figures import MANY, blank, collecting, dots, image, plain_log, styled
from crosscheck.show.pictures import render

LINE = np.linspace([0.2, 0.25, 0.1, 1, 0, 0, 0], [0.6, 0.25, 0.1, 1, 0, 0, 0], 5)


def solution() -> seecr.Solution:
    return seecr.solve("demobot_cogiro", LINE)


def by_lengths() -> seecr.Solution:
    robot = seecr.load_robot("demobot_cogiro")
    lengths = robot.rest_lengths - np.outer([0.0, 0.001], np.ones(8))
    found = seecr.solve(robot, seecr.Commands(np.tile(robot.reference_pose, (2, 1)), lengths))
    labels = [axes.get_ylabel() for axes in found.plot().axes]
    assert not any("deviation" in label.lower() for label in labels)
    return found


def correction() -> seecr.Correction:
    return seecr.correct("demobot_cogiro", LINE)


def workspace() -> seecr.Workspace:
    axes = np.linspace(0.2, 0.6, 4), np.linspace(0.1, 0.4, 3), np.array([0.1])
    return seecr.workspace_map("demobot_cogiro", *axes)


def comparison() -> crosscheck.Comparison:
    return crosscheck.compare(made_diagnoses.robot(), made_diagnoses.readings(radius_m=0.01))


def plan() -> crosscheck.Plan:
    return crosscheck.make_plan("demobot_cogiro", LINE)


MADE: dict[str, tuple[Callable[[], Any], str]] = {
    "Solution": (solution, "figure recording"),
    "of lengths": (by_lengths, "figure recording"),
    "Correction": (correction, "figure recording"),
    "Workspace": (workspace, "figure recording"),
    "Comparison": (comparison, "figure page recording"),
    "Diagnosis": (made_diagnoses.pulleys, "figure page recording"),
    "Plan": (plan, "figure page"),
    "Model": (lambda: seecr.new_model("demobot_cogiro"), ""),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
def test_a_result_draws_what_its_command_writes(kind: str, tmp_path: Path) -> None:
    make, has = MADE[kind]
    found = make()
    name = type(found).__name__
    if "figure" in has:
        figure = found.plot()
        assert isinstance(figure, Figure) and any(axes.has_data() for axes in figure.axes)
        figure.savefig(tmp_path / "figure.png")
        assert (tmp_path / "figure.png").stat().st_size > 5_000
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no figure$"):
            found.plot()
    if "page" in has:
        found.save_html(tmp_path / "page.html")
        assert (tmp_path / "page.html").read_text(encoding="utf-8") == render(found)
        with pytest.raises(seecr.InputError, match=r"no figure 'nothing'; there are \w+"):
            found.plot("nothing")
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no page"):
            found.save_html(tmp_path / "page.html")
    if "recording" in has:
        found.save_recording(tmp_path / "made.rrd")
        assert (tmp_path / "made.rrd").read_bytes()[:3] == b"RRF"
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no recording"):
            found.save_recording(tmp_path / "made.rrd")


def test_where_it_cannot_be_written_is_said(tmp_path: Path) -> None:
    found = solution()
    with pytest.raises(seecr.InputError, match=r"x\.mcap: expected a name that ends in \.rrd"):
        found.save_recording(tmp_path / "x.mcap")
    with pytest.raises(seecr.InputError, match=r"Solution has no page; it has a figure and a reco"):
        found.save_html(tmp_path / "x.html")
    (tmp_path / "file").write_text("")
    with pytest.raises(seecr.InputFileError, match=r"cannot write the recording"):
        found.save_recording(tmp_path / "file" / "x.rrd")
    with pytest.raises(seecr.InputError, match="expected"):
        found.save_recording(3)  # type: ignore[arg-type]
    page = plan()
    with pytest.raises(seecr.InputError, match=r"x\.pdf: expected a name that ends in \.html"):
        page.save_html(tmp_path / "x.pdf")
    with pytest.raises(seecr.InputFileError, match="cannot write the page"):
        page.save_html(tmp_path / "file" / "x.html")


@pytest.mark.slow
def test_a_run_of_one_case_is_its_recording(tmp_path: Path) -> None:
    robot = seecr.load_robot("planar_vertical")
    assert robot.source is not None
    case = crosscheck.Case(
        "two", robot.source, robot.source, None, "random", robot.reference_pose[None]
    )
    run = crosscheck.run_suite([case], jobs=1)
    run.save_recording(tmp_path / "run.rrd")
    assert (tmp_path / "run.rrd").read_bytes()[:3] == b"RRF"
    with pytest.raises(seecr.InputError, match=r"this run has 2 cases; run\.results"):
        crosscheck.Run([*run.results, *run.results], run.thresholds, 0, 1, 1.0).save_recording(
            tmp_path / "run.rrd"
        )


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
