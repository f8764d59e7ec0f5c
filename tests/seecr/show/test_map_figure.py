"""What the figure of a map draws where margins have no numbers, and which edge it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kept_figures import keep_figures
from matplotlib.colors import to_hex
from PIL import Image
from robots import slides

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.show.batch_words import softest_line
from seecr.show.map_figure import map_figure
from seecr.workspace.grid import Workspace
from seecr.workspace.maps import workspace_map

pytestmark = pytest.mark.slow
Drawn = Callable[..., Any]
AXIS = np.linspace(0.3, 0.5, 3)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Drawn:
    """The figure of a map, not written."""
    kept = keep_figures(monkeypatch)

    def of(found: Workspace, **more: Any) -> Any:
        map_figure(tmp_path / "map.png", found, **more)
        return kept[-1]

    return of


def a_map(*margins: float) -> Workspace:
    """Nine poses with these margins, y goes faster than x."""
    robot = load_robot("demobot_cogiro")
    found = workspace_map(robot, AXIS, AXIS, 0.1, elastic=False)
    return replace(found, margin=np.array(margins).reshape(3, 3, 1))


def cells(drawing: Any) -> list[str]:
    """Colours of the first panel's cells, y goes faster than x."""
    mesh = drawing.axes[0].collections[0]
    mesh.update_scalarmappable()
    colours = mesh.get_facecolors().reshape(3, 3, 4).transpose(1, 0, 2).reshape(9, 4)
    return [to_hex(one, keep_alpha=True) for one in colours]


def title(drawing: Any) -> str:
    return " ".join(drawing.get_suptitle().split())


def test_a_margin_without_end_has_the_colour_beyond_the_bar(drawn: Drawn) -> None:
    """It had been white, and white was said to be what cannot be held."""
    one = drawn(a_map(-1.0, 1.0, 2.0, -1.0, 3.0, np.inf, -1.0, 3.0, np.inf))
    own, yellow = cells(one), to_hex(one.axes[0].collections[0].cmap(1.0), keep_alpha=True)
    assert own[5] == own[8] == yellow != own[1] and own[0][-2:] == "00"
    assert "white: cannot be held (margin); yellow, beyond the bar: cables can be" in title(one)
    most = drawn(a_map(*[1.0] * 7, 99.0, np.inf))
    assert "beyond the bar: a larger margin, or cables can be tightened" in title(most)
    finite = drawn(a_map(*[1.0] * 8, 99.0))
    assert "beyond" not in title(finite)


def test_the_edge_beside_a_margin_without_end_is_half_way(drawn: Drawn) -> None:
    """It had been at the next pose: infinity is far."""
    one = drawn(a_map(*[-1.0] * 3, *[np.inf] * 6))
    (line,) = one.axes[0].collections[1].get_paths()
    np.testing.assert_allclose(line.vertices[:, 0], 350.0)


def test_the_edge_beside_loosely_held_poses_is_half_way_and_none_leads_through_them(
    drawn: Drawn,
) -> None:
    """It had been at the loosely held poses, whose margin is zero."""
    one = drawn(a_map(*[-1.0] * 3, *[0.0] * 3, *[1.0] * 3))
    (line,) = one.axes[0].collections[1].get_paths()
    np.testing.assert_allclose(line.vertices[:, 0], 350.0)


@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_two_cable"])
def test_margins_without_numbers_are_drawn_as_yes_or_no(drawn: Drawn, name: str) -> None:
    """A bar of newtons from 0 to 1 had stood beside them."""
    yes = np.inf if name == "demobot_cogiro" else 0.0
    one = drawn(a_map(*[-1.0] * 3, *[yes] * 6) if yes else few(-np.inf, yes))
    bar = one.axes[-1]
    assert bar.get_ylabel() == "can be held"
    assert [text.get_text() for text in bar.get_yticklabels()] == ["no", "yes"]
    assert len(set(cells(one))) == 2 and "white" not in title(one)
    assert ("cables can be tightened without limit" in title(one)) == (yes > 0.0)


def test_the_edge_of_a_map_of_yes_and_no_is_half_way(drawn: Drawn) -> None:
    """It was drawn by margins of which only the sign is shown, through cells that can be held."""
    found = few(-np.inf, 0.0)
    margin = np.where(found.feasible, np.array([0.1, 1.0, 5.0]), -np.inf)
    one = drawn(replace(found, margin=margin))
    (line,) = one.axes[0].collections[1].get_paths()
    np.testing.assert_allclose(line.vertices[:, 0], 350.0)


def few(no: float, yes: float) -> Workspace:
    """A map of a robot with fewer cables than freedoms."""
    robot = load_robot("planar_two_cable")
    found = workspace_map(robot, AXIS, 0.0, AXIS, elastic=False)
    return replace(found, margin=np.array([no] * 3 + [yes] * 6).reshape(3, 1, 3))


def test_the_edge_with_a_probability_is_told_from_that_without(drawn: Drawn) -> None:
    """Both had been orange, and the title explained one."""
    found = a_map(*[-1.0] * 3, *[1.0] * 6)
    edge = np.array([[0.37, 0.4, 0.1, 1.0, 0.0, 0.0, 0.0]])
    plain, likely = drawn(found, edge=edge), drawn(found, edge=edge, at_least=0.95)
    own, other = (one.axes[0].lines[0].get_markerfacecolor() for one in (plain, likely))
    orange = to_hex(likely.axes[0].collections[1].get_edgecolor()[0])
    assert to_hex(own) == orange and other == "white"
    # the dots are where the edge is; a line beside them was up to a cell off it
    assert len(plain.axes[0].collections) == 1
    assert "orange: the edge of the poses that tensions" in title(plain) and "dots" not in title(
        plain
    )
    assert "orange: the edge of the poses that tensions" in title(likely)
    assert title(likely).endswith(
        "white dots: the edge of the poses held with a probability of 0.95"
    )
    # an edge in none of the slices is not explained
    elsewhere = edge.copy()
    elsewhere[:, 2] += 0.05
    assert "dots" not in title(drawn(found, edge=elsewhere, at_least=0.95))


def test_labels_of_a_wall_are_whole(drawn: Drawn) -> None:
    """Panels that a first layout made narrow had no room beside them when a second made them wide;
    "z [mm]" was cut off.
    """
    x, z = np.linspace(0.0861, 0.5719, 5), np.linspace(-0.0431, 0.3351, 4)
    one = drawn(workspace_map(load_robot("planar_vertical"), x, 0.0, z))
    one.draw_without_rendering()  # finds the labels' places as writing does
    labels = [text for ax in one.axes for text in (ax.xaxis.label, ax.yaxis.label, ax.title)]
    for text in (one._suptitle, *labels):
        box = text.get_window_extent(one.canvas.get_renderer())
        assert min(box.x0, box.y0) >= 0.0, text
        assert box.x1 <= one.bbox.width and box.y1 <= one.bbox.height, text


def test_a_map_says_whose_it_is(drawn: Drawn) -> None:
    assert drawn(a_map(*[1.0] * 9)).get_suptitle() == "demobot_cogiro"


def test_rows_of_flat_slices_are_low_and_the_ends_of_colours_are_told(drawn: Drawn) -> None:
    robot = load_robot("demobot_cogiro")
    flat = drawn(workspace_map(robot, AXIS, np.linspace(0.2, 0.3, 3), 0.1))
    square = drawn(workspace_map(robot, AXIS, AXIS - 0.15, 0.1))
    assert flat.get_size_inches()[1] < 0.8 * square.get_size_inches()[1]
    assert "arrows: what is beyond a bar's end has its last colour" in title(flat)


@pytest.mark.parametrize(
    ("robot", "turns"), [(slides(), False), (load_robot("planar_vertical"), True)]
)
def test_turns_are_drawn_where_the_platform_can(drawn: Drawn, robot: Robot, turns: bool) -> None:
    figure = drawn(workspace_map(robot, AXIS, np.array([0.0]), np.array([0.15, 0.2])))
    assert ("turned [°]" in [ax.get_ylabel() for ax in figure.axes]) == turns


def test_cells_where_the_platform_is_free_to_move_have_stripes(drawn: Drawn) -> None:
    """They had been white, and white was said to be where it does not come to rest."""
    x, y = np.linspace(0.04, 0.4, 3), np.linspace(0.04, 0.25, 3)
    found = workspace_map(load_robot("demobot_parallel"), x, y, 0.1)
    assert 0 < found.free.sum() < 9 and (found.rests | found.free).all()
    one = drawn(found)
    assert "grey with stripes: balanced, but free to move" in title(one)
    assert "does not come to rest" not in title(one)
    striped = [[own for own in ax.collections if own.get_hatch()] for ax in one.axes[:4]]
    assert [len(own) for own in striped] == [0, 1, 1, 1], "the margin's panel has none"
    assert all(len(own.get_paths()) == found.free.sum() for (own,) in striped[1:])
    fallen = replace(found, status=np.where(found.free, 4, found.status).astype(np.int8))
    other = title(drawn(fallen))
    assert "does not come to rest (below it)" in other and "stripes" not in other


def test_the_stiffness_of_the_softest_direction_is_drawn(drawn: Drawn) -> None:
    """It had been in the file of arrays alone."""
    x, y = np.linspace(0.04, 0.76, 9), np.linspace(0.04, 0.46, 7)
    found = workspace_map(load_robot("demobot_cogiro"), x, y, 0.1)
    one = drawn(found)
    bar = one.axes[-1]
    assert bar.get_ylabel() == "stiffness of the\nsoftest direction [N/m]"
    assert bar.get_yscale() == "log"
    low, high = bar.get_ylim()
    held = found.stiffness[found.feasible]
    assert held.min() <= low < np.median(held) < high <= held.max()
    mesh = one.axes[4].collections[0]
    np.testing.assert_array_equal(mesh.get_array(), found.stiffness[:, :, 0].T)
    ticks = [float(text.get_text()) for text in bar.get_yticklabels()]
    assert len(ticks) >= 2 and min(ticks) >= low and max(ticks) <= high
    # an elastic map alone has it
    plain = drawn(replace(found, slack=np.full_like(found.slack, -1)))
    assert "stiffness" not in " ".join(ax.get_ylabel() for ax in plain.axes)


@pytest.mark.parametrize("decades", [0.0, 0.5, 1.5, 6.0])
def test_stiffnesses_have_plain_ticks_however_far_apart(drawn: Drawn, decades: float) -> None:
    robot = load_robot("demobot_cogiro")
    found = workspace_map(robot, AXIS, AXIS, 0.1)
    stiffness = 30.0 * np.logspace(0.0, decades, 9).reshape(3, 3, 1).astype(np.float32)
    bar = drawn(replace(found, stiffness=stiffness)).axes[-1]
    ticks = [text.get_text() for text in bar.get_yticklabels()]
    assert 2 <= len(ticks) <= 7 and not any("e" in one or "$" in one for one in ticks), ticks


def test_the_softest_pose_of_a_large_robot_has_no_exponent() -> None:
    robot = load_robot("camera")
    (line,) = softest_line(workspace_map(robot, [52.5, 60.0], [34.0], [20.0]))
    assert line.startswith("softest of these at x y z 52500 34000 20000 mm: ")


def test_a_probability_has_a_row_of_its_own_and_one_axis_no_figure(drawn: Drawn) -> None:
    found = a_map(*[-1.0] * 3, *[1.0] * 6)
    assert "probability" not in [ax.get_ylabel() for ax in drawn(found).axes]
    unsure = replace(found, chance=np.where(found.feasible, 0.5, 0.0).astype(np.float32))
    assert "probability" in [ax.get_ylabel() for ax in drawn(unsure).axes]
    with pytest.raises(InputError, match="at least two axes"):
        drawn(workspace_map(found.robot, 0.4, 0.25, [0.1, 0.2], elastic=False))


def test_colours_of_a_map_are_those_of_poses_that_can_be_held(drawn: Drawn) -> None:
    x, y = np.linspace(0.04, 0.76, 9), np.linspace(0.04, 0.46, 7)
    found = workspace_map(load_robot("demobot_cogiro"), x, y, [0.1])
    bars = {ax.get_ylabel(): ax.get_ylim()[1] for ax in drawn(found).axes[4:]}
    away = 1e3 * np.linalg.norm(found.deviation, axis=-1)
    held = away[found.feasible]
    assert np.quantile(held, 0.9) < bars["off the command [mm]"] <= held.max() < 0.2 * away.max()
    turned = np.degrees(np.linalg.norm(found.rotation, axis=-1))
    assert bars["turned [°]"] <= turned[found.feasible].max() < 0.2 * turned.max()


def test_a_map_says_which_slices_it_has_and_what_is_white(drawn: Drawn) -> None:
    robot = load_robot("demobot_cogiro")
    x, y = np.linspace(0.04, 0.76, 7), np.linspace(0.04, 0.46, 5)
    found = workspace_map(robot, x, y, [0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4])
    one = drawn(found)
    assert "4 of 7 values of z; white: cannot be held (margin); arrows: " in title(one)
    assert "orange: the edge" in title(one)
    for ax in one.axes[:4]:
        cells, _edge = ax.collections
        assert cells.get_rasterized(), "lines would show between the cells of an SVG"
    fallen = replace(found, slack=np.where(found.margin > 0.1, found.slack, -1).astype(np.int8))
    words = "cannot be held (margin), or does not come to rest (below it)"
    assert words in title(drawn(fallen))
    said = title(drawn(workspace_map(robot, [0.3, 0.4], [0.2, 0.3], [0.1])))
    assert not any(word in said for word in ("white", "values of", "orange"))


def test_the_title_of_a_narrow_figure_is_whole(tmp_path: Path) -> None:
    found = workspace_map(load_robot("demobot_cogiro"), [0.3, 0.4], 0.25, [0.1, 0.2])
    map_figure(tmp_path / "narrow.png", found)
    picture = np.asarray(Image.open(tmp_path / "narrow.png").convert("L"))
    assert picture[:, [0, -1]].min() == 255


def test_a_large_robots_map_is_drawn_in_metres_and_its_colours_show_most_margins(
    drawn: Drawn,
) -> None:
    x, y = [0, 30, 52.5, 75, 105], [0, 20, 34, 48, 68]
    found = workspace_map(load_robot("camera"), x, y, [8, 24.99], elastic=False)
    panel, bar = drawn(found, most=1).axes
    said = panel.get_xlabel(), panel.get_ylabel(), panel.get_title()
    assert said == ("x [m]", "y [m]", "z = 8 m")
    margins = found.margin[found.feasible]
    assert margins.max() > 1e4 > 1e3 > bar.get_ylim()[1] > np.median(margins)
