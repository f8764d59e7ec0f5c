"""Robots from points: against closed forms, SciPy's least energy, and what MuJoCo compiles."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq, minimize
from scipy.spatial.transform import Rotation
from sources import ROOT

import seecr
from seecr.description.cables import MATERIALS, breaking_words, ea_of, rope_of
from seecr.description.fingerprint import check_robot, fingerprint
from seecr.errors import InputError

CORNERS = [[0.0, 0.0, 3.0], [6.0, 0.0, 3.0], [6.0, 4.0, 3.0], [0.0, 4.0, 3.0]]
BOX = [[-0.3, -0.2, 0.1], [0.3, -0.2, 0.1], [0.3, 0.2, 0.1], [-0.3, 0.2, 0.1]]
TURN = Rotation.from_rotvec([0.1, -0.2, 0.3])
POSE = [3.0, 2.0, 1.0, *TURN.as_quat(scalar_first=True)]
INERTIA = np.array([[0.5, 0.02, -0.03], [0.02, 0.6, 0.04], [-0.03, 0.04, 0.7]])


def made(**changes: Any) -> seecr.Robot:
    given: dict[str, Any] = {"mass": 25.0, "ea": 3e5, "at": [3.0, 2.0, 1.0], **changes}
    exits, anchors = given.pop("exit_points", CORNERS), given.pop("anchor_points", BOX)
    return seecr.Robot.from_points(exits, anchors, **given)


# --- closed forms ----------------------------------------------------------------------------


def test_a_point_mass_on_two_cables_hangs_where_the_closed_form_says() -> None:
    """By symmetry straight below the middle: 2 EA (l - l0)/l0 sin(angle) = m g."""
    ea, half, deep = 2e4, 1.5, 1.2
    robot = seecr.Robot.from_points(
        [[-half, 0, 2], [half, 0, 2]], [0, 0, 0], mass=8.0, ea=ea, at=[0, 0, 2 - deep]
    )
    assert [(joint.kind, joint.name) for joint in robot.joints] == [("slide", "x"), ("slide", "z")]
    rest = np.hypot(half, deep)

    def short(depth: float) -> float:
        length = np.hypot(half, depth)
        return float(2 * ea * (length - rest) / rest * depth / length - 8.0 * 9.81)

    sag = brentq(short, deep, 2 * deep, xtol=1e-15)
    solution = seecr.solve(robot, robot.reference_pose)
    np.testing.assert_allclose(solution.pose[0, :3], [0, 0, 2 - sag], atol=1e-9)


def test_a_point_mass_on_three_cables_shares_its_weight() -> None:
    """Three cables at 120 degrees and one length: each pulls m g / (3 cos of its slope)."""
    around = 2 * np.pi * np.arange(3) / 3
    exits = np.column_stack([np.cos(around), np.sin(around), np.full(3, 2.0)])
    robot = seecr.Robot.from_points(exits, np.zeros((3, 3)), mass=6.0, stiffness=1e7, at=[0, 0, 1])
    solution = seecr.solve(robot, robot.reference_pose)
    slope = (2 - solution.pose[0, 2]) / np.hypot(1.0, 2 - solution.pose[0, 2])
    np.testing.assert_allclose(solution.tensions[0], 6.0 * 9.81 / 3 / slope, rtol=1e-9)
    assert robot.n_dof == 3 and not robot.turns
    np.testing.assert_allclose(robot.ea, 1e7 * np.sqrt(2.0))


def test_a_free_platform_rests_where_its_energy_is_least() -> None:
    robot = made(at=POSE, centre_of_mass=[0.02, 0.01, -0.05])
    exits, anchors = np.array(CORNERS), np.array(BOX)
    home = np.linalg.norm(exits - (np.array(POSE[:3]) + TURN.apply(anchors)), axis=1)
    np.testing.assert_allclose(robot.rest_lengths, home, rtol=1e-14)

    def energy(x: np.ndarray) -> float:
        turn = Rotation.from_rotvec(x[3:])
        stretch = np.linalg.norm(exits - (x[:3] + turn.apply(anchors)), axis=1) - home
        lift = (x[:3] + turn.apply([0.02, 0.01, -0.05]))[2]
        return float(np.sum(0.5 * 3e5 / home * np.maximum(stretch, 0) ** 2) + 25 * 9.81 * lift)

    solution = seecr.solve(robot, robot.reference_pose)
    pose = solution.pose[0]
    mine = np.concatenate([pose[:3], Rotation.from_quat(pose[3:], scalar_first=True).as_rotvec()])
    found = minimize(energy, mine + 1e-3, method="BFGS", jac="3-point", options={"gtol": 1e-6})
    np.testing.assert_allclose(mine, found.x, atol=2e-7)
    assert energy(mine) <= found.fun + 1e-9


def test_scalars_stand_for_all_cables_and_rows_for_each() -> None:
    one, each = made(ea=3e5), made(ea=[3e5] * 4)
    np.testing.assert_array_equal(one.ea, each.ea)
    uneven = made(ea=None, stiffness=[1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(uneven.ea, [1, 2, 3, 4] * uneven.rest_lengths)
    np.testing.assert_allclose(made(ea=None, cable="steel 7x19 3mm").ea, 376.2e3)


# --- what is deduced -------------------------------------------------------------------------


@pytest.mark.parametrize(("plane", "axis"), [("yz", 0), ("xz", 1), ("xy", 2)])
def test_points_in_one_plane_make_a_planar_platform(plane: str, axis: int) -> None:
    """Whose joints are those that MuJoCo moves it by."""
    flat = np.delete(np.arange(3), axis)
    exits, anchors = np.zeros((3, 3)), np.zeros((3, 3))
    exits[:, flat], anchors[:, flat] = [[0, 0], [2, 0], [1, 2]], [[-0.1, 0], [0.1, 0], [0, 0.1]]
    exits[:, axis] = 0.7
    at = np.zeros(3)
    at[flat], at[axis] = [1.0, 0.7], 0.7
    robot = seecr.Robot.from_points(exits, anchors, mass=1.0, ea=100.0, at=at)
    kinds = [(joint.kind, joint.name) for joint in robot.joints]
    assert kinds == [("slide", plane[0]), ("slide", plane[1]), ("hinge", "turn")]
    np.testing.assert_array_equal(robot.joints[2].axis, np.eye(3)[axis])
    assert not seecr.Robot.from_points(exits, anchors, mass=1.0, ea=100.0, at=at, plane=None).joints
    beside = exits + 0.1 * np.eye(3)[axis] * np.arange(3)[:, None]
    assert not seecr.Robot.from_points(beside, anchors, mass=1.0, ea=100.0, at=at).joints
    forced = seecr.Robot.from_points(beside, anchors, mass=1.0, ea=100.0, at=at, plane=plane)
    assert [joint.name for joint in forced.joints] == [plane[0], plane[1], "turn"]


@pytest.mark.parametrize(
    ("exits", "height"),
    [
        (CORNERS, 1.5),  # half way up
        ([*CORNERS, [0, 0, -1.0]], 1.0),  # the ground is the lowest exit point
        ([[0, 0, 0], [3, 0, 0], [0, 4, 0]], -2.5),  # below, by half the frame's width
    ],
)
def test_without_a_pose_the_home_is_in_the_middle(exits: list[Any], height: float) -> None:
    robot = seecr.Robot.from_points(exits, [0, 0, 0], mass=1.0, ea=1e4)
    points = np.array(exits)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    np.testing.assert_allclose(robot.reference_pose[:3], [*middle[:2], height])


# --- the file --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "robot",
    [
        made(at=POSE, centre_of_mass=[0.01, -0.02, 0.03], inertia=INERTIA, names=list("abcd")),
        made(anchor_points=[0, 0, 0], cable="dyneema 2mm", ea=None, gravity=[0, 0.5, -9.7]),
        seecr.Robot.from_points(
            [[0, 0, 2], [2, 0, 2]], [[-0.1, 0, 0.05], [0.1, 0, 0]], mass=0.8, ea=1e3, at=[1, 0, 1],
        ),
    ],
    ids=["free", "point", "planar"],
)  # fmt: skip
def test_a_saved_robot_loads_back_equal(robot: seecr.Robot, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    robot.save(path)
    again = seecr.load_robot(path)
    assert check_robot(path, dict(fingerprint(robot)), again) == ()
    np.testing.assert_allclose(again.ea, robot.ea, rtol=1e-15)
    np.testing.assert_array_equal(again.gravity, robot.gravity)
    assert [(one.kind, one.name) for one in again.joints] == [
        (one.kind, one.name) for one in robot.joints
    ]
    for mine, its in zip(robot.joints, again.joints, strict=True):
        np.testing.assert_allclose([*its.axis, *its.point], [*mine.axis, *mine.point], atol=1e-15)
    # and MuJoCo makes of it the body that was meant
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.nbody == 2 and model.body_mass[1] == robot.mass
    axes = Rotation.from_quat(model.body_iquat[1], scalar_first=True).as_matrix()
    compiled = axes * model.body_inertia[1] @ axes.T
    # whose axes MuJoCo 3.13 turns until they are right to 1e-6
    np.testing.assert_allclose(compiled, robot.inertia, atol=1e-6 * robot.inertia.max())


def test_without_an_inertia_it_is_that_of_a_box_around_the_anchor_points() -> None:
    """m/12 (b^2 + c^2): a plate of 0.6 x 0.4 m, as thick as a hundredth of a cable."""
    robot = made()
    a, b, c = 0.6, 0.4, 0.01 * robot.rest_lengths.max()
    expected = 25 / 12 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    np.testing.assert_allclose(robot.inertia, np.diag(expected))


def test_a_floor_is_kept(tmp_path: Path) -> None:
    from dataclasses import replace

    replace(made(), floor=0.25).save(tmp_path / "floor.xml")
    assert seecr.load_robot(tmp_path / "floor.xml").floor == 0.25


# --- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"ea": None}, "expected one of ea=3e5 [N], stiffness=1e5 [N/m]"),
        ({"stiffness": 3.0}, "got none or several"),
        ({"ea": [1.0, 2.0]}, "ea: expected shape (4,), got (2,)"),
        ({"ea": "soft"}, "ea: expected numbers, got 'soft'"),
        ({"ea": -1.0}, "cable1 has stiffness -1 N"),
        ({"exit_points": [1, 2, 3]}, "exit_points: expected shape (m, 3), one row a cable, got"),
        ({"exit_points": [[0, 0, np.nan]]}, "exit_points holds numbers that are not finite"),
        ({"anchor_points": BOX[:3]}, "anchor_points: expected shape (4, 3), got (3, 3)"),
        ({"at": [1, 2]}, "at: expected a position (3,) [m], or a pose (7,)"),
        ({"at": [1, 2, 3, 0.5, 0, 0, 0]}, "unit quaternion, scalar first, got [1.0, 2.0, 3.0, 0.5"),
        ({"plane": "zx"}, "plane: expected yz, xz, xy, auto"),
        ({"mass": -1.0}, "expected a mass from 0"),
        ({"names": ["a"]}, "names: expected 4, got 1"),
        ({"inertia": np.diag([1.0, 1.0, 3.0])}, "none larger than the sum of the others"),
        ({"cable": "wool 3mm", "ea": None}, "known are"),
    ],
)  # fmt: skip
def test_what_is_no_robot_is_told(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(seecr.SeecrError) as caught:
        made(**changes)
    assert told in str(caught.value) and "\n" not in str(caught.value)


# --- The catalogue of ropes: its numbers by hand, and what is no rope


def test_a_wire_rope_has_the_area_and_the_mass_of_the_standard() -> None:
    """EN 12385-4, for 6x19M around a strand: C = 0.418, W = 0.381 kg per 100 m and mm^2."""
    rope = rope_of("steel 7x19 3mm")
    np.testing.assert_allclose(rope.ea, 100e9 * 0.418 * 0.003**2)
    np.testing.assert_allclose(rope.weight, 0.381 * 9 / 100 * 9.80665)
    assert rope.name == "steel 7x19 3mm"
    np.testing.assert_allclose(rope_of("steel 6x19 6 mm").ea, 100e9 * 0.384 * 0.006**2)


def test_ropes_break_at_the_loads_of_tables() -> None:
    """DIN 3060 has 5.28 kN for 3 mm with a steel core; 6 mm of SK78 break at 40 to 48 kN."""
    assert abs(rope_of("steel 7x19 3mm").breaks - 5280.0) < 30.0
    assert 38e3 < rope_of("dyneema 6mm").breaks < 48e3
    steel, elongation = rope_of("steel 7x19 3mm"), 5280.0 / (100e9 * 0.418 * 0.003**2)
    assert breaking_words(0.99 * elongation) == ""
    assert breaking_words(1.01 * steel.breaks / steel.ea).endswith("steel 7x19 (1.4 %)")


def test_a_braid_is_near_what_rope_makers_say() -> None:
    """6 mm of SK78 stretches by about 1 % under 13 kN and weighs about 21 g/m."""
    rope = rope_of("dyneema 6mm")
    assert 0.008 < 13e3 / rope.ea < 0.012
    assert 0.017 < rope.weight / 9.81 < 0.023


@pytest.mark.parametrize("material", MATERIALS)
def test_stiffness_and_weight_grow_with_the_square_of_the_diameter(material: str) -> None:
    thin, thick = rope_of(f"{material} 2mm"), rope_of(f"  {material.upper()}   0.4 cm ")
    np.testing.assert_allclose([thick.ea, thick.weight], [4 * thin.ea, 4 * thin.weight])
    # no rope is stiffer than a solid bar of steel, or heavier
    area = np.pi * 0.001**2
    assert thin.ea < 210e9 * area and thin.weight < 7850 * 9.81 * area


def test_the_page_has_these_numbers() -> None:
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z\dx ]+)` \| ([\d.]+) \| ([\d.]+) \|", page, re.MULTILINE)
    assert [name for name, _ea, _weight in rows] == list(MATERIALS)
    for name, ea, weight in rows:
        rope = rope_of(f"{name} 1mm")
        assert float(ea) == pytest.approx(1e-3 * rope.ea, rel=2e-3)
        assert float(weight) == pytest.approx(1e3 * rope.weight / 9.80665, rel=2e-3)


def test_steel_alone_is_7x19_and_a_number_is_itself() -> None:
    assert rope_of("steel 3 mm") == rope_of("steel 7x19 3mm")
    assert ea_of("3e5N", "--ea") == (3e5, "")
    assert ea_of("300kN", "--ea")[0] == ea_of("300000", "--ea")[0] == 3e5
    ea, said = ea_of("vectran 1mm", "--ea")
    assert ea == rope_of("vectran 1mm").ea and "cable_weight" in said and "75 GPa" in said


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dynema 3mm", "known are dyneema, "),
        ("3e5 N/m", "expected E S such as 3e5N, or a rope by material and diameter such as"),
        ("steel", "expected E S such as 3e5N, or a rope"),
        (
            "steel 7x19",
            "a diameter from 0.1mm to 100mm after steel, such as 'steel 7x19 3mm', got '7x19'",
        ),
        ("steel 3", "after steel, such as 'steel 7x19 3mm', got '3' in 'steel 3'"),
        ("kevlar 3m", "got '3m'"),
        ("kevlar -3mm", "got '-3mm'"),
        ("0N", "expected E S from 0.001 to 1e+12 N"),
        ("-4kN", "expected E S from 0.001"),
    ],
)
def test_what_is_no_rope_is_told(text: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        ea_of(text, "--ea")
    assert str(caught.value).startswith("--ea: ") and told in str(caught.value)
