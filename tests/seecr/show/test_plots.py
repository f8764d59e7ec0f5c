"""Legends that cover no curve, names of cables."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from matplotlib.colors import to_rgb
from PIL import Image
from recordings import Readback
from robots import slides

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.pose import Array
from seecr.show.colours import COLOURS, alike, joined
from seecr.show.figures import figure
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import cable_labels, extent
from seecr.show.sweep_recording import write_sweep_recording

SIZE = (600.0, 200.0)
RIGHT_TOP, LEFT_TOP = rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop
RIGHT_BOTTOM, LEFT_BOTTOM = rrb.Corner2D.RightBottom, rrb.Corner2D.LeftBottom
# So wide a part at either end, and so high a part, is surely the legend's of two short names.
WIDE, TALL = 0.08, 0.2


def curves(*ends: tuple[float, float]) -> np.ndarray:
    """Straight lines over 50 times from their first values to their last ones."""
    return np.stack([np.linspace(*pair, 50) for pair in ends], axis=1)


@pytest.mark.parametrize(
    ("ends", "corner"),
    [
        (((0.0, 1.0), (0.0, 0.0)), LEFT_TOP),
        (((1.0, 0.0), (0.0, 0.0)), RIGHT_TOP),
        (((1.0, 1.0), (1.0, 0.0)), LEFT_BOTTOM),
        (((1.0, 1.0), (0.0, 1.0)), RIGHT_BOTTOM),
    ],
)
def test_a_corner_that_is_free_is_the_legends(
    ends: tuple[tuple[float, float], ...], corner: rrb.Corner2D
) -> None:
    assert legend_of([curves(*ends)], ["a", "b"], SIZE) == Legend(corner)


def test_where_no_corner_is_free_the_axis_is_longer() -> None:
    both = curves((0.0, 1.0), (1.0, 0.0))
    found = legend_of([both], ["dx", "dy"], SIZE)
    assert found.fits and found.values is not None
    low, high = found.values
    assert low < 0.0 and high > 1.0 and high - low < 2.5
    top = found.corner in (RIGHT_TOP, LEFT_TOP)
    free = high - 1.0 if top else -low
    assert free > TALL * (high - low), "as high as the legend is"


def test_a_legend_of_many_says_that_it_does_not_fit() -> None:
    both = curves((0.0, 1.0), (1.0, 0.0))
    assert not legend_of([both], [f"cable{k}" for k in range(8)], SIZE).fits
    assert legend_of([both * np.nan], ["a"], SIZE) == Legend()


def test_all_timelines_have_room_on_one_axis() -> None:
    rising, high = curves((0.0, 1.0)), curves((9.0, 9.0))
    found = legend_of([rising, high], ["a"], SIZE)
    assert found.values is not None and found.values[0] < 0.0 and found.values[1] > 9.0
    assert found.corner in (LEFT_BOTTOM, RIGHT_BOTTOM) or found.values[1] > 10.0


def test_cables_that_leave_side_by_side_have_one_label_and_those_in_front_stand_above() -> None:
    robot = load_robot("demobot_cogiro")
    low, high = extent(robot, robot.reference_pose[None])
    places, names = cable_labels(robot, low, high)
    assert names == ["cable1, 2", "cable3, 4", "cable5, 6", "cable7, 8"]
    lifted = places[:, 2] > robot.exit_points[:, 2].max() + 0.02
    assert lifted.sum() == 2
    assert np.ptp(places[lifted][:, 1]) < 0.1 < np.ptp(places[:, 1])
    apart = replace(robot, exit_points=3.0 * robot.exit_points)
    assert len(cable_labels(apart, low, high)[1]) > 4


def test_curves_that_lie_on_each_other_have_one_name() -> None:
    one = curves((0.0, 1.0), (2.0, 3.0), (0.0, 1.0))
    assert alike([one]) == [[0, 2], [1]]
    assert alike([one, curves((0.0, 1.0), (2.0, 3.0), (0.0, 2.0))]) == [[0], [1], [2]]
    assert joined(["cable1", "cable3"]) == "cable1, 3"
    assert joined(["left", "right"]) == "left, right"
    assert joined(["a1", "b1"]) == "a1, b1" and joined(["rope"]) == "rope"


AWAY, TURN, PULL = "Deviation from the command [mm]", "Rotation from the command [°]", "Tension [N]"


@pytest.mark.parametrize(
    ("robot", "views"),
    [(slides(), {AWAY, PULL}), (load_robot("planar_vertical"), {AWAY, TURN, PULL})],
    ids=["slides", "turns"],
)
def test_rotations_have_a_panel_where_the_platform_turns(
    robot: Robot, views: set[str], tmp_path: Path
) -> None:
    commands = np.tile(robot.reference_pose, (4, 1))
    commands[:, 0] += np.linspace(0.0, 0.06, 4)
    found = solve(robot, commands)
    assert found.converged.all()
    write_sweep_recording(found, tmp_path / "sweep.rrd")
    back = Readback(tmp_path / "sweep.rrd")
    assert {name.split(",")[0] for name in back.views} & {AWAY, TURN, PULL} == views
    drawn = {entity for entity in back.entities("pose") if entity.startswith("/plot/rotation")}
    assert len(drawn) == (4 if TURN in views else 0)
    np.testing.assert_allclose(
        back.scalars("/plot/deviation/dz"), 1e3 * found.deviation[:, 2], atol=1e-9
    )


# --- Figures, whatever is drawn in them


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
