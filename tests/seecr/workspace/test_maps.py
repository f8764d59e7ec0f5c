"""Margins against HiGHS, boundaries, maps on grids, robots with too few cables."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from margin_by_highs import margin_by_highs
from random_robots import random_poses, random_robot
from unbalanced import unbalanced

from seecr import parallel
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.inverse import correction
from seecr.inverse.correction import correct, margins_in_place
from seecr.pose import quat_from_rotvec
from seecr.show.batch_words import edge_line, softest_line
from seecr.show.files import write_arrays
from seecr.workspace import maps
from seecr.workspace.edges import boundary
from seecr.workspace.maps import default_axes, workspace_map
from seecr.workspace.margins import balance_equations, feasible, margins_from, tension_margin
from seecr.workspace.planar import bar_tilt

NAMES = ["demobot_cogiro", "demobot_parallel", "demobot_off_centre", "planar_vertical"]


def some_poses(robot: Robot, n: int = 60) -> np.ndarray:
    random = np.random.default_rng(1)
    poses = np.tile(robot.reference_pose, (n, 1))
    if robot.joints:
        poses[:, [0, 2]] += random.uniform(-0.25, 0.25, (n, 2))
        return poses
    poses[:, :3] = random.uniform((0.05, 0.05, 0.05), (0.75, 0.45, 0.4), (n, 3))
    poses[:, 3:] = quat_from_rotvec(0.1 * random.normal(size=(n, 3)))
    return poses


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.5, 6.0)])
def test_margins_are_those_of_highs(name: str, low: float, high: float) -> None:
    robot = load_robot(name)
    poses = some_poses(robot)
    margins = tension_margin(robot, poses, lowest=low, highest=high)
    expected = [margin_by_highs(*each, low, high)
                for each in zip(*balance_equations(robot, poses), strict=True)]  # fmt: skip
    np.testing.assert_allclose(margins, expected, rtol=1e-7, atol=1e-9)
    assert (margins > 0).any() and (margins < 0).any()
    by_search = unbalanced(robot, poses, lowest=low, highest=high) < 1e-9
    np.testing.assert_array_equal(feasible(robot, poses, lowest=low, highest=high), by_search)


@pytest.mark.parametrize("seed", range(6))
def test_robots_of_any_number_of_cables(seed: int) -> None:
    robot = random_robot(np.random.default_rng(seed), "free")
    poses = random_poses(np.random.default_rng(seed), robot, 20)
    margins = tension_margin(robot, poses, highest=50.0)
    if robot.n_cables < robot.n_dof:
        assert np.all(np.isneginf(margins))
        return
    matrices, loads = balance_equations(robot, poses)
    for margin, matrix, load in zip(margins, matrices, loads, strict=True):
        expected = margin_by_highs(matrix, load, 0.0, 50.0)
        assert margin == pytest.approx(expected, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.5, 2.0), (1.0, 1.5)])
@pytest.mark.parametrize("cables", [8, 5, 2])
def test_where_balance_lacks_a_direction_margins_are_those_of_highs(
    cables: int, low: float, high: float
) -> None:
    """A layout may lose a freedom by symmetry: 0 had been said of all that can be held."""
    random = np.random.default_rng(cables)
    matrices = random.normal(size=(12, 6, 2 if cables == 2 else 5))
    matrices = matrices @ random.normal(size=(12, matrices.shape[2], cables))
    tensions = random.uniform(0.3, 2.5, size=(12, cables))
    loads = np.einsum("ndm,nm->nd", matrices, tensions)
    limits = np.full(cables, low), np.full(cables, high)
    margins = margins_from(matrices, loads[:, None], *limits, 1.0)
    expected = [margin_by_highs(*each, low, high) for each in zip(matrices, loads, strict=True)]
    np.testing.assert_allclose(margins, expected, rtol=1e-6, atol=1e-7)
    assert np.isfinite(margins).all() or high == np.inf
    # out of what the cables can do at all
    out = loads + 0.1 * np.linalg.svd(matrices)[0][:, :, -1]
    assert np.all(np.isneginf(margins_from(matrices, out[:, None], *limits, 1.0)))
    sets = np.stack([loads, out], axis=1)
    assert np.all(np.isneginf(margins_from(matrices, sets, *limits, 1.0)))


def test_margins_without_a_bound_are_infinite(tmp_path: Path) -> None:
    """Cables from the corners of a square pull against one another, wherever the platform is."""
    sites = [(x, z) for x in (0, 1) for z in (0, 1)]
    world = "".join(f'<site name="A{i}" pos="{x} 0 {z}"/>' for i, (x, z) in enumerate(sites))
    body = "".join(
        f'<site name="B{i}" pos="{0.1 * x - 0.05} 0 {0.03 - 0.06 * z}"/>'
        for i, (x, z) in enumerate(sites)
    )
    cables = "".join(
        f'<spatial springlength="0 0.69" stiffness="4000"><site site="A{i}"/><site site="B{i}"/>'
        "</spatial>"
        for i in range(4)
    )
    path = tmp_path / "square.xml"
    path.write_text(
        f'<mujoco model="square"><worldbody>{world}<body name="platform" pos="0.5 0 0.5">'
        '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
        '<joint type="hinge" axis="0 1 0"/><inertial pos="0 0 0" mass="0.5" '
        f'diaginertia="1 1 1"/>{body}</body></worldbody><tendon>{cables}</tendon></mujoco>'
    )
    robot = load_robot(path)
    axis = np.linspace(0.1, 0.9, 9)
    poses = np.array([[x, 0, z, 1, 0, 0, 0] for x in axis for z in axis])
    assert np.all(np.isposinf(tension_margin(robot, poses)))
    bounded = tension_margin(robot, poses, highest=1e3)
    expected = [margin_by_highs(*each, 0.0, 1e3)
                for each in zip(*balance_equations(robot, poses), strict=True)]  # fmt: skip
    np.testing.assert_allclose(bounded, expected, rtol=1e-7)
    found = workspace_map(robot, axis, [0.0], axis, elastic=False)
    assert "all cables can be tightened without limit" in str(found)


def test_a_set_of_wrenches_has_the_least_margin() -> None:
    robot = load_robot("demobot_cogiro")
    poses = some_poses(robot, 20)
    pushes = np.array([[0.3, 0, 0, 0, 0, 0], [-0.3, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.01, 0]])
    each = [tension_margin(robot, poses, wrench=one) for one in pushes]
    np.testing.assert_allclose(
        tension_margin(robot, poses, wrenches=pushes), np.min(each, axis=0), atol=1e-12
    )
    by_row = tension_margin(robot, poses, wrench=np.tile(pushes[0], (20, 1)))
    np.testing.assert_allclose(by_row, each[0], atol=1e-12)


def test_the_boundary_is_where_the_margin_vanishes() -> None:
    robot = load_robot("demobot_parallel")
    inside = np.array([[0.4, 0.25, 0.1, 1, 0, 0, 0]] * 2)
    outside = inside.copy()
    outside[:, 0] = [0.1, 0.7]
    found = boundary(robot, inside, outside, tolerance=1e-9)
    np.testing.assert_allclose(tension_margin(robot, found), 0.0, atol=1e-6)
    assert found[0, 0] + found[1, 0] == pytest.approx(0.8, abs=1e-8)
    with pytest.raises(InputError, match="boundary needs poses inside that can be held"):
        boundary(robot, outside, inside)
    for wrong in (0.0, np.nan, np.inf):
        with pytest.raises(InputError, match="must be above 0 and finite, got"):
            boundary(robot, inside, outside, tolerance=wrong)


def test_the_edge_is_looked_for_between_neighbours_of_the_grid() -> None:
    robot = load_robot("demobot_parallel")
    x, y = np.linspace(0.05, 0.75, 8), np.linspace(0.1, 0.4, 5)
    found = workspace_map(robot, x, y, [0.1, 0.2], elastic=False)
    inside, outside = found.crossings(found.feasible)
    assert len(inside) == sum(int(np.abs(np.diff(found.feasible, axis=k)).sum()) for k in range(3))
    step = np.abs(outside[:, :3] - inside[:, :3])
    assert np.count_nonzero(step > 1e-12, axis=1).tolist() == [1] * len(step)
    assert tension_margin(robot, inside).min() > -1e-9 > tension_margin(robot, outside).max()
    edge = boundary(robot, inside, outside, tolerance=1e-6)
    assert np.all(np.abs(edge[:, :3] - inside[:, :3]) <= step + 1e-12)
    out = 1e-6 * (outside - inside)[:, :3] / step.max(axis=1, keepdims=True)
    beyond = np.concatenate([edge[:, :3] + out, edge[:, 3:]], axis=1)
    assert tension_margin(robot, beyond).max() < 0.0 <= tension_margin(robot, edge).min() + 1e-9


@pytest.mark.slow
def test_a_map_is_what_each_pose_says() -> None:
    robot = load_robot("demobot_parallel")
    axes = np.linspace(0.2, 0.6, 5), np.linspace(0.2, 0.3, 2), np.array([0.1, 0.2])
    done: list[int] = []
    found = workspace_map(robot, *axes, progress=done.append)
    assert sum(done) == 20 and found.margin.shape == (5, 2, 2)
    pose = np.array([[axes[0][1], axes[1][0], axes[2][1], 1, 0, 0, 0]])
    alone = solve(robot, pose)
    assert found.margin[1, 0, 1] == tension_margin(robot, pose)[0]
    assert found.slack[1, 0, 1] == alone.slack.sum()
    np.testing.assert_allclose(
        found.deviation[1, 0, 1], alone.deviation[0, :3], rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(
        np.abs(found.softest[1, 0, 1]), np.abs(alone.softest_direction[0]), rtol=1e-3, atol=1e-4
    )
    at = np.unravel_index(np.argmin(np.where(found.feasible, found.stiffness, np.inf)), (5, 2, 2))
    said, told = next(softest_line(found)), found.as_json()["softest_where_feasible"]
    assert f"{found.stiffness[at]:.4g} N/m" in said
    assert f"x y z {1e3 * axes[0][at[0]]:.4g} " in said
    assert told["direction"].tolist() == found.softest[at].tolist()
    assert len(found.records()) == 20
    assert found.records()[0]["softest_rz_rad"] == found.softest[0, 0, 0, 5]
    assert f"{int(found.feasible.sum())} of 20 poses can be held" in str(found)


@pytest.mark.parametrize(
    ("name", "axes", "why"),
    [
        ("demobot_parallel", ([0.04, 0.4, 0.76], [0.04, 0.25], [0.1, 0.2]), "singular"),
        ("planar_two_cable", ([0.1, 0.5], [0.0], [0.5, 1.0]), "no_length"),
        ("camera", ([0.0, 52.5], [0.0, 34.0], [20.0, 25.0]), "no_length"),
    ],
)
def test_a_map_says_why_the_platform_is_not_at_rest(
    name: str, axes: tuple[list[float], ...], why: str, tmp_path: Path
) -> None:
    """They had been NaN without a reason: some balance and are free to turn."""
    robot = load_robot(name)
    found = workspace_map(robot, *axes)
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    poses = np.column_stack([places, np.tile(robot.reference_pose[3:], (len(places), 1))])
    alone = solve(robot, poses)
    lost = np.flatnonzero(~alone.converged)
    assert found.status is not None and len(lost) > 0
    names = [one.name for one in alone.status]
    assert [row["status"] for row in found.records()] == names
    assert {names[row] for row in lost} == {why.upper()}
    np.testing.assert_array_equal(
        np.flatnonzero(found.free), lost if why == "singular" else np.array([], int)
    )
    sentence = alone.status[lost[0]].value
    (said,) = (line for line in found.lines() if "not at rest at " in line)
    at = " ".join(f"{1e3 * x:.7g}" for x in places[lost[0]])
    first = "at" if len(lost) == 1 else "the first at"
    assert said == f"not at rest at {len(lost)} ({why}), {first} x y z {at} mm: {sentence}"
    (told,) = json.loads(found.to_json())["not_at_rest"]
    assert told == {
        "status": why, "poses": len(lost), "first_m": places[lost[0]].tolist(),
        "sentence": sentence,
    }  # fmt: skip
    write_arrays(tmp_path / "map.npz", found)
    with np.load(tmp_path / "map.npz") as kept:
        assert [one.upper() for one in kept["status_names"][kept["status"].ravel()]] == names


def test_a_map_without_the_elastic_robot_has_no_status(tmp_path: Path) -> None:
    found = workspace_map(load_robot("demobot_cogiro"), 0.4, 0.25, [0.1, 0.2], elastic=False)
    assert found.status is None and not found.free.any() and "status" not in found.records()[0]
    assert found.as_json()["not_at_rest"] == []
    write_arrays(tmp_path / "map.npz", found)
    with np.load(tmp_path / "map.npz") as kept:
        assert "status" not in kept


def test_a_map_is_the_same_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot("demobot_parallel")
    axes = np.linspace(0.1, 0.7, 10), np.linspace(0.1, 0.4, 4), np.linspace(0.1, 0.4, 4)
    whole, done = workspace_map(robot, *axes), list[int]()

    def tell(poses: int) -> None:
        assert threading.current_thread() is threading.main_thread()
        done.append(poses)

    monkeypatch.setattr(maps, "_PART", parallel.BLOCK)
    for processors in (1, 2):
        done.clear()
        monkeypatch.setattr(parallel, "processors", lambda n=processors: n)
        parts = workspace_map(robot, *axes, progress=tell)
        assert sum(done) == 160 and min(done) > 0
        assert processors > 1 or done == [64, 64, 32]
        for name in ("margin", "deviation", "rotation", "slack", "stiffness", "softest", "status"):
            np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


@pytest.mark.slow
def test_too_few_cables_are_mapped_by_position() -> None:
    robot = load_robot("planar_two_cable")
    x, z = np.linspace(-0.15, 1.15, 7), np.linspace(0.05, 1.05, 4)
    found = workspace_map(robot, x, 0.0, z, elastic=False)
    places = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1)
    rests = np.isfinite(bar_tilt([[0, 1], [1, 1]], places, 0.1))
    assert 0.4 < rests.mean() < 0.9
    np.testing.assert_array_equal(found.feasible[:, 0], rests)
    with pytest.raises(InputError, match="holds no set of wrenches"):
        workspace_map(robot, x, 0.0, z, wrenches=[[1, 0, 0, 0, 0, 0]])


@pytest.mark.slow
def test_positions_of_four_cables_are_held_where_a_correction_keeps_them() -> None:
    robot = only_cables(load_robot("demobot_parallel"), [0, 2, 4, 6])
    places = np.array([[0.4, 0.25, 0.1], [0.3, 0.2, 0.3], [0.03, 0.25, 0.1], [0.2, 0.4, 0.05]])
    poses = np.column_stack([places, np.tile([1.0, 0.0, 0.0, 0.0], (len(places), 1))])
    kept = correct(robot, poses, prefer="position", highest=6.0)
    kept_there = kept.stays & (np.abs(kept.aimed[:, :3] - places).max(axis=1) < 1e-9)
    assert 0 < kept_there.sum() < len(places)
    held = margins_in_place(robot, poses, (), 0.0, 6.0) >= 0.0
    np.testing.assert_array_equal(held, kept_there)
    assert not kept.held[1:].any()  # only the middle is held level


def test_an_orientation_from_which_the_platform_goes_elsewhere_does_not_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = load_robot("planar_two_cable")
    below, above = robot.reference_pose[:3], [0.5, 0.0, 1.05]
    poses = np.tile([*below, 1.0, 0.0, 0.0, 0.0], (2, 1))
    poses[1, :3] = above  # the cables' ends are above their exit points: balanced, but not stable
    both = np.ones(2, dtype=bool)
    monkeypatch.setattr(correction, "poses_in_place", lambda problem, *_: (problem.wanted, both))
    held = margins_in_place(robot, poses, (), 0.0, 6.0)
    assert held[0] > 0.0 and held[1] == -np.inf


@pytest.mark.slow
@pytest.mark.parametrize("some", [[0, 2, 5], [0, 2, 4, 6], [0, 2, 3, 4, 6]])
def test_platforms_that_must_turn_over_are_found(some: list[int]) -> None:
    """Each position for itself: a search for the nearest orientation holds no more of them."""
    robot = only_cables(load_robot("demobot_parallel"), some)
    found = workspace_map(robot, *default_axes(robot, 5), elastic=False)
    held = found.feasible.ravel()
    places = np.stack(np.meshgrid(*found.axes, indexing="ij"), axis=-1).reshape(-1, 3)
    rows = np.concatenate([np.flatnonzero(~held)[::16], np.flatnonzero(held)[::16]])
    poses = np.column_stack([places[rows], np.tile([1.0, 0.0, 0.0, 0.0], (len(rows), 1))])
    other = correct(robot, poses, prefer="position")
    there = other.stays & (np.abs(other.aimed[:, :3] - places[rows]).max(axis=1) < 1e-9)
    assert not np.any(there & ~held[rows])
    assert held.sum() > 10


@pytest.mark.parametrize("name", ["planar_two_cable", "four"])
def test_margins_of_too_few_cables_are_those_of_tensions_that_hold(name: str) -> None:
    """A limit at which the margin was is the end: with it, nothing is left of the margin."""
    four = name == "four"
    robot = load_robot("demobot_parallel" if four else name)
    robot = only_cables(robot, [0, 2, 4, 6]) if four else robot
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] += [0.0, 0.05 * robot.length, 0.1 * robot.length]
    margins = margins_in_place(robot, poses, (), 0.0, np.inf)
    assert np.all(margins > 0.1 * robot.weight)
    for pose, margin in zip(poses, margins, strict=True):
        less = margins_in_place(robot, pose[None], (), 0.6 * margin, np.inf)
        np.testing.assert_allclose(less, 0.4 * margin, rtol=0.02)
        assert margins_in_place(robot, pose[None], (), 1.05 * margin, np.inf)[0] == -np.inf


def test_a_cable_on_slides_alone_holds_only_what_hangs_below_it() -> None:
    """There is no orientation to look for: that was an error where the platform was above."""
    hung = Robot.from_points([[0, 0, 3]], [0, 0, 0], mass=2, ea=1000, at=[0, 0, 1])
    found = workspace_map(hung, [0.0, 0.3], 0.0, [1.0, 3.5])
    assert found.feasible.ravel().tolist() == [True, False, False, False]
    assert found.margin[0, 0, 0] == pytest.approx(2.0 * 9.81)
    assert np.all(np.isneginf(found.margin[~found.feasible]))


def only_cables(robot: Robot, some: list[int]) -> Robot:
    """The robot with some of its cables."""
    return replace(
        robot, exit_points=robot.exit_points[some], anchor_points=robot.anchor_points[some],
        ea=robot.ea[some], rest_lengths=robot.rest_lengths[some],
        cable_names=tuple(robot.cable_names[k] for k in some),
    )  # fmt: skip


def test_the_default_grid_lies_between_the_exit_points() -> None:
    x, y, z = default_axes(load_robot("demobot_cogiro"), 3)
    np.testing.assert_allclose([x[0], x[-1], y[0], y[-1], z[-1]], [0.04, 0.76, 0.04, 0.46, 0.485])
    assert [len(axis) for axis in default_axes(load_robot("planar_vertical"), 3)] == [3, 1, 3]
    with pytest.raises(InputError, match="values: expected a whole number from 1 on, got -2"):
        default_axes(load_robot("demobot_cogiro"), -2)


def test_the_default_grid_ends_where_the_platform_stands_on_the_floor() -> None:
    robot = load_robot("demobot_cogiro")  # anchor points down to 18 mm below its origin
    assert robot.floor == 0.0
    assert default_axes(robot, 3)[2].tolist() == pytest.approx([0.018, 0.2515, 0.485])
    upended = default_axes(robot, 3, [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])[2]
    assert upended[0] == pytest.approx(0.0515)  # they are up to 51.5 mm beside it
    lower = default_axes(replace(robot, floor=-0.1), 3)[2]
    assert lower[0] == pytest.approx(-0.082)
    for floor in (None, -5.0):  # as far below the reference pose as the exit points are above it
        assert default_axes(replace(robot, floor=floor), 3)[2][0] == pytest.approx(-0.185)
    tall = default_axes(replace(robot, floor=0.149), 3)[2]
    assert tall[0] == 0.15  # the reference pose is in it all the same
    with pytest.raises(InputError, match=r"orientation must be \(4,\), qw qx qy qz, got \(3,\)"):
        default_axes(robot, 3, [1.0, 0.0, 0.0])


def test_a_map_says_where_it_is_and_whether_it_ends_at_the_floor() -> None:
    robot = load_robot("demobot_cogiro")
    found = workspace_map(robot, *default_axes(robot, 2), elastic=False)
    ends = "x 0.04 to 0.76 m, y 0.04 to 0.46 m, z 0.018 to 0.485 m"
    assert found.region == f"region: {ends}, down to the floor"
    document = found.as_json()
    assert document["floor_m"] == 0.0 and document["region_m"][0] == [0.04, 0.76]
    other = workspace_map(robot, 0.4, 0.25, [0.1, 0.2], elastic=False)
    assert other.region == "region: x 0.4 m, y 0.25 m, z 0.1 to 0.2 m"


def test_the_size_of_a_map_is_words_of_their_own_and_one_dead_pose_is_told_as_one() -> None:
    robot = load_robot("planar_vertical")
    home = robot.reference_pose
    found = workspace_map(robot, [home[0], home[0] + 0.25], home[1], home[2], elastic=False)
    assert found.size_words(np.ones((2, 1, 1), bool)) == "0.25 m"
    at = robot.exit_points[0] - robot.anchor_points[0]
    dead = workspace_map(robot, *at)
    assert dead.size_words(np.ones((1, 1, 1), bool)) == ""
    assert dead.lines()[0] == "planar_vertical: 0 of 1 pose can be held"
    assert dead.lines()[2].startswith("not at rest at 1 (no_length), at x y z ")


def test_all_of_a_grid_is_as_large_as_its_box() -> None:
    robot = load_robot("demobot_cogiro")
    axes = np.linspace(0.1, 0.7, 7), np.array([0.1, 0.2, 0.4]), np.linspace(0.05, 0.25, 2)
    found = workspace_map(robot, *axes, elastic=False)
    everywhere = np.ones(found.margin.shape, dtype=bool)
    assert found.size(everywhere) == pytest.approx(0.6 * 0.3 * 0.2)
    line = workspace_map(robot, np.linspace(0.3, 0.55, 5), 0.25, 0.1, elastic=False)
    assert line.feasible.all()
    assert "5 of 5 poses can be held, 0.25 m" in str(line)
    assert line.as_json()["size_feasible"] == pytest.approx(0.25)


def test_a_single_pose_has_no_size() -> None:
    """It was 1.0, without a unit."""
    one = workspace_map(load_robot("demobot_cogiro"), 0.4, 0.25, 0.1, elastic=False)
    document = replace(one, chance=np.ones((1, 1, 1))).as_json(0.95)
    assert document["feasible"] == document["likely"]["poses"] == 1
    sizes = document["cell"], document["size_feasible"], document["likely"]["size"]
    assert sizes == (None, None, None)


def test_the_size_of_a_ball_is_that_of_a_ball() -> None:
    """Cut by the grid's end through its middle, too: half of it is left."""
    robot = load_robot("demobot_cogiro")
    for first, part in ((-1.2, 1.0), (0.0, 0.5)):
        axes = np.linspace(first, 1.2, 61), np.linspace(-1.2, 1.2, 61), np.linspace(-1.2, 1.2, 61)
        x, y, z = np.meshgrid(*axes, indexing="ij")
        found = workspace_map(robot, 0.4, 0.25, 0.1, elastic=False)
        ball = replace(found, axes=axes, margin=1.0 - np.sqrt(x**2 + y**2 + z**2))
        assert ball.size(ball.feasible) == pytest.approx(part * 4.0 / 3.0 * np.pi, rel=0.01)


def test_a_grid_tells_between_which_sizes_the_true_one_lies() -> None:
    """Four digits had been printed of areas that are a tenth off."""
    bar = load_robot("planar_two_cable")
    held = [workspace_map(bar, *default_axes(bar, n), elastic=False) for n in (7, 41)]
    coarse, fine = (one.size(one.feasible) for one in held)
    low, high = held[0].size_between(held[0].feasible)
    assert low < fine < high and abs(coarse / fine - 1.0) > 0.05
    words = held[0].size_words(held[0].feasible)
    assert words.endswith(f" m^2 ({low:.3g} to {high:.3g} at this spacing)")
    assert held[0].as_json()["size_feasible_between"] == (low, high)
    # a whole box is known to all digits
    every = np.ones(held[1].margin.shape, bool)
    assert held[1].size_between(every) == pytest.approx((held[1].size(every),) * 2)
    assert "spacing" not in held[1].size_words(every)


def test_why_there_is_no_edge_of_a_probability() -> None:
    """Where no pose is that likely, all of them "can be held" had been the reason."""
    found = workspace_map(load_robot("demobot_cogiro"), [0.4, 0.5], 0.25, [0.1], elastic=False)
    none = np.zeros((0, 7))
    for chance, reason in (
        (0.5, "no pose of the grid is held"),
        (0.99, "all poses of the grid are"),
    ):
        likely = replace(found, chance=np.full(found.margin.shape, chance, np.float32))
        assert f"no edge was found: {reason}" in edge_line(likely, none, 1e-3, 0.95)
    assert edge_line(found, none, 1e-3).endswith("all poses of the grid can be held")


def test_effects_with_a_memory_have_no_elastic_map() -> None:
    robot = load_robot("demobot_cogiro")
    slow = [Term.of(robot, "hysteresis", amplitude_N=0.05)]
    with pytest.raises(InputError, match=r"in no order, and hysteresis would dep.*--no-elastic"):
        workspace_map(robot, [0.3, 0.4], 0.25, 0.1, effects=slow)
    held = workspace_map(robot, [0.3, 0.4], 0.25, 0.1, effects=slow, elastic=False)
    assert held.feasible.all()


def test_the_default_grid_has_a_zero_and_no_rounding_beside_it() -> None:
    robot = load_robot("demobot_cogiro")
    high = np.array(robot.exit_points)
    high[:, 2] += 2.0 - high[:, 2].max()
    home = np.array([0.4, 0.25, 0.8, 1, 0, 0, 0])
    lifted = replace(robot, exit_points=high, reference_pose=home, floor=None)
    z = default_axes(lifted, 13)[2]  # from -0.4 to 2: linspace gives 5.6e-17 in place of 0
    assert z[[0, 2, -1]].tolist() == [pytest.approx(-0.4), 0.0, 2.0]
