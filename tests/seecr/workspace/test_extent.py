"""How far a default grid extends where gravity is not along -z, and where joints keep a plane."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kept_figures import keep_figures
from robots import turned

from seecr.description.mjcf import load_robot
from seecr.errors import InputError
from seecr.show.files import write_arrays
from seecr.show.map_figure import map_figure
from seecr.workspace.edges import boundary
from seecr.workspace.grid import Workspace, grid_ends, own_directions
from seecr.workspace.maps import default_axes, workspace_map

COGIRO = replace(load_robot("demobot_cogiro"), floor=None)
PLANAR = load_robot("planar_vertical")
HALF = np.pi / 2.0


@pytest.mark.parametrize("rotvec", [[2 * HALF, 0, 0], [HALF, 0, 0], [0, -HALF, 0], [0, 0, HALF]])
def test_the_grid_turns_along_where_gravity_stays_along_an_axis(rotvec: list[float]) -> None:
    other, turn = turned(COGIRO, rotvec)
    own = np.array([[axis[0], axis[-1]] for axis in default_axes(COGIRO, 3)])
    there = np.array([[axis[0], axis[-1]] for axis in default_axes(other, 3)])
    np.testing.assert_allclose(there, np.sort(turn @ own, axis=1), atol=1e-12)


def test_with_oblique_gravity_all_of_the_turned_box_is_in_the_grid() -> None:
    other, turn = turned(COGIRO, [0.3, 0.5, 0.1])
    low, high = grid_ends(COGIRO, COGIRO.reference_pose[3:])
    x, y, z = np.meshgrid(*zip(low, high, strict=True), indexing="ij")
    corners = np.stack([x, y, z], axis=-1).reshape(-1, 3) @ turn.T
    wide = grid_ends(other, other.reference_pose[3:])
    # a box of the points, whose corners are those of the box only where four points are
    exits = other.exit_points
    below = exits - 2.0 * ((exits - other.reference_pose[:3]) @ other.up)[:, None] * other.up
    for points in (exits, below):
        assert np.all(points >= wide[0] - 1e-12) and np.all(points <= wide[1] + 1e-12)
    assert np.all(wide[1] - wide[0] <= np.ptp(corners, axis=0) + 1e-12)


def test_the_grid_of_a_planar_robot_lies_in_its_plane_also_if_exit_points_do_not() -> None:
    apart = PLANAR.exit_points + np.array([[0, 0.1, 0], [0, -0.1, 0]] * 4)[: PLANAR.n_cables]
    robot = replace(PLANAR, exit_points=apart)
    axes = default_axes(robot, 3)
    assert [len(axis) for axis in axes] == [3, 1, 3] and axes[1][0] == robot.reference_pose[1]


@pytest.mark.parametrize("rotvec", [[0, 0, np.radians(30.0)], [0.4, 0, 0], [0.2, 0.1, 0.5]])
def test_an_oblique_plane_has_a_grid_of_its_own(rotvec: list[float]) -> None:
    """It had been refused."""
    other, turn = turned(PLANAR, rotvec)
    directions = own_directions(other)
    assert directions is not None
    u, v, w = directions
    assert directions @ directions.T == pytest.approx(np.eye(3)) and np.linalg.det(directions) > 0.0
    # in the plane, level, and upwards
    assert abs(v @ turn[:, 1]) == pytest.approx(1.0) and u[2] == 0.0 and u[0] > 0.0 and w[2] > 0.0
    axes = default_axes(other, 3)
    assert [len(axis) for axis in axes] == [3, 1, 3]
    place = directions @ other.reference_pose[:3]
    assert axes[1][0] == pytest.approx(place[1], abs=1e-12)
    exits = other.exit_points @ directions.T
    for k in (0, 2):
        assert axes[k][0] - 1e-12 <= exits[:, k].min() and exits[:, k].max() <= axes[k][-1] + 1e-12


def test_planes_and_lines_along_axes_keep_these() -> None:
    for robot in (PLANAR, COGIRO, replace(PLANAR, joints=PLANAR.joints[:1])):
        assert own_directions(robot) is None


@pytest.mark.parametrize("climbs", [False, True])
def test_a_line_has_a_grid_along_itself(climbs: bool) -> None:
    along = np.array([0.6, 0.0, 0.8]) if climbs else np.array([0.8, 0.6, 0.0])
    slide = replace(PLANAR.joints[0], axis=along)
    robot = replace(PLANAR, joints=(slide,))
    directions = own_directions(robot)
    assert directions is not None and directions[2 if climbs else 0] == pytest.approx(along)
    assert [len(axis) for axis in default_axes(robot, 3)] == ([1, 1, 3] if climbs else [3, 1, 1])


def test_the_floor_ends_an_oblique_grid_too() -> None:
    aside = np.array([0.0, 0.05, 0.0])
    pose = PLANAR.reference_pose + np.concatenate([aside, np.zeros(4)])
    there = replace(PLANAR, reference_pose=pose, exit_points=PLANAR.exit_points + aside)
    other, _turn = turned(there, [0.4, 0, 0])
    other = replace(other, floor=-0.05)
    directions = own_directions(other)
    assert directions is not None
    axes = default_axes(other, 3)
    u, v, w = (axis[0] for axis in axes)
    assert (np.array([u, v, w]) @ directions)[2] == pytest.approx(
        other.standing_height(other.reference_pose[3:])
    )
    assert workspace_map(other, *axes, elastic=False).region.endswith(", down to the floor")


def test_joints_that_only_turn_have_no_grid() -> None:
    beside = replace(PLANAR.joints[2], point=PLANAR.reference_pose[:3] + np.array([0.1, 0.0, 0.0]))
    with pytest.raises(InputError, match="do not reach a grid of one orientation") as told:
        default_axes(replace(PLANAR, joints=(beside,)))
    assert "a sweep" in str(told.value)


def test_a_grid_beside_an_oblique_plane_says_which_axes_it_has() -> None:
    other, _turn = turned(PLANAR, [0, 0, np.radians(30.0)])
    with pytest.raises(
        InputError, match=r"cannot reach u v w 0.[45] 0.2 0.1 m of the grid"
    ) as told:
        workspace_map(other, [0.4, 0.5], [0.0, 0.2], [0.1])
    assert "here with v 0 m (u along (0.866, 0.5, 0), v along" in str(told.value)


def test_a_grid_beside_the_plane_says_where_it_leaves_it() -> None:
    with pytest.raises(InputError, match="its joints cannot reach x y z") as told:
        workspace_map(PLANAR, [0.4, 0.5], [0.0, 0.2], [0.1])
    assert "x y z 0.4 0.2 0.1 m" in str(told.value)
    assert f"here with y {PLANAR.reference_pose[1]:.6g} m" in str(told.value)


FLOORLESS = replace(load_robot("planar_vertical"), floor=None)
# About the vertical: the plane stays upright, so that w is z.
LEANING, LEAN = turned(FLOORLESS, [0.0, 0.0, np.radians(30.0)])


@pytest.fixture(scope="module")
def maps() -> tuple[Workspace, Workspace]:
    """Along the axes, and turned."""
    plain = workspace_map(FLOORLESS, *default_axes(FLOORLESS, 9))
    return plain, workspace_map(LEANING, *default_axes(LEANING, 9))


def test_the_map_turns_along_with_the_robot(maps: tuple[Workspace, Workspace]) -> None:
    plain, oblique = maps
    assert oblique.places == pytest.approx(plain.places @ LEAN.T, abs=1e-12)
    assert oblique.margin == pytest.approx(plain.margin, abs=1e-9)
    assert oblique.stiffness == pytest.approx(plain.stiffness, rel=1e-5)
    assert oblique.deviation == pytest.approx(plain.deviation @ LEAN.T, abs=1e-6)
    assert plain.directions is None and oblique.directions == pytest.approx(LEAN.T)


def test_rows_and_places_in_words_are_by_x_y_and_z(maps: tuple[Workspace, Workspace]) -> None:
    _, oblique = maps
    row, place = oblique.records()[-1], oblique.places[-1, -1, -1]
    assert [row["x_m"], row["y_m"], row["z_m"]] == pytest.approx(place)
    assert (
        oblique.place((8, 0, 8))
        == f"x y z {' '.join(f'{p:.7g}' for p in np.round(1e3 * place, 1))} mm"
    )
    told = oblique.as_json()
    at = oblique.softest_at
    assert at is not None and told["softest_where_feasible"]["pose_m"] == pytest.approx(
        oblique.places[at]
    )
    assert told["directions"] == pytest.approx(LEAN.T)


def test_the_map_says_which_way_its_axes_go(maps: tuple[Workspace, Workspace]) -> None:
    plain, oblique = maps
    words = "grid: u along (0.866, 0.5, 0), v along (-0.5, 0.866, 0), w along (0, 0, 1) of x y z"
    assert oblique.lines()[0] == words and oblique.lines()[1:] == plain.lines()
    assert oblique.region.startswith("region: u 0.04 to 0.76 m, v 0 m, w ")


def test_the_edge_of_an_oblique_map_is_that_of_the_other(maps: tuple[Workspace, Workspace]) -> None:
    own, there = (
        boundary(one.robot, *one.crossings(one.feasible), tolerance=1e-5)[:, :3] for one in maps
    )
    assert len(own) > 5 and there == pytest.approx(own @ LEAN.T, abs=2e-5)
    assert maps[1].along_axes(there) == pytest.approx(own, abs=2e-5)


def test_the_figure_names_u_and_w_and_has_the_edge_in_its_place(
    maps: tuple[Workspace, Workspace], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kept = keep_figures(monkeypatch)
    for found in maps:
        edge = boundary(found.robot, *found.crossings(found.feasible), tolerance=1e-4)
        map_figure(tmp_path / "map.png", found, edge=edge)
    plain, oblique = kept
    assert oblique.axes[0].get_ylabel() == "w [mm]" and oblique.axes[0].get_title() == "v = 0 mm"
    assert "u [mm]" in [ax.get_xlabel() for ax in oblique.axes]
    title = oblique.get_suptitle().splitlines()
    for vector in ("(0.866, 0.5, 0)", "(-0.5, 0.866, 0)", "(0, 0, 1)"):
        assert any(vector in line.replace("\N{NO-BREAK SPACE}", " ") for line in title)
    own, there = (one.axes[0].lines[0].get_xydata() for one in (plain, oblique))
    assert len(own) > 5 and there == pytest.approx(own, abs=0.2)


def test_arrays_have_the_axes_and_their_directions(
    maps: tuple[Workspace, Workspace], tmp_path: Path
) -> None:
    write_arrays(tmp_path / "map.npz", maps[1])
    with np.load(tmp_path / "map.npz") as kept:
        assert "x_m" not in kept
        corner = np.array([kept[f"{name}_m"][-1] for name in "uvw"])
        assert corner @ kept["directions"] == pytest.approx(maps[1].places[-1, -1, -1])
