"""Published robots: each read from its own format rests where SciPy and plain MuJoCo say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from published import CASPR, WIREX, caspr_files, wirex_file
from scipy.spatial.transform import Rotation

import seecr
from seecr.description.joints import unresisted, values_of_pose
from seecr.importing.caspr import read_caspr
from seecr.importing.draft import Draft
from seecr.importing.wirex import read_wirex
from seecr.pose import pose_add
from seecr.show.pose_words import home_lines, reason

# Elasticity is asked for: CASPR's files of ideal cables and some of WireX's have none.
EA = "2e5N"


def draft_of(folder: Path, program: str, name: str, **changes: Any) -> Draft:
    if program == "caspr":
        return read_caspr(*caspr_files(folder, name, **changes), None)
    return read_wirex(wirex_file(folder, name, **changes))


EVERY = [*(("caspr", name) for name in CASPR), *(("wirex", name) for name in WIREX)]


def unbalanced(path: Path, robot: seecr.Robot, pose: np.ndarray) -> float:
    """Largest generalised force [N, N m] that MuJoCo finds unbalanced at a pose."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = values_of_pose(robot, pose[None])[0][0] if robot.joints else pose
    mujoco.mj_forward(model, data)
    return float(np.abs(data.qfrc_passive - data.qfrc_bias).max())


@pytest.mark.parametrize(("program", "name"), EVERY, ids=lambda one: one)
def test_a_published_robot_rests_where_mujoco_finds_its_forces_balanced(
    program: str, name: str, tmp_path: Path
) -> None:
    draft = draft_of(tmp_path, program, name)
    if np.isnan(draft.ea).any():
        draft = draft.with_options(ea=EA)
    robot, _notes = draft.robot()
    if name in ("kntu_planar", "two_dof", "example_spherical"):  # without a load at home
        rest = seecr.correct(robot, robot.reference_pose[None], lowest=20.0).commands.lengths
        assert rest is not None
        robot = replace(robot, rest_lengths=rest[0])
    solution = seecr.solve(robot, robot.reference_pose)
    assert solution.converged.all()
    assert "at rest: forces balance" in next(home_lines(solution))
    path = tmp_path / "robot.xml"
    robot.save(path)
    pulls = float(np.abs(solution.tensions).max())
    assert unbalanced(path, robot, solution.pose[0]) < 1e-8 * pulls
    # what is moved a little along its first freedom is not balanced
    away = pose_add(solution.pose[0], 1e-4 * solution.motion(0, np.eye(robot.n_dof)[0]))
    assert unbalanced(path, robot, away) > 1e-6 * pulls


def test_every_kind_of_number_of_a_caspr_robot(tmp_path: Path) -> None:
    """Attachments about the joint, inertia about the centre of mass, limits that are no lengths."""
    draft = draft_of(tmp_path, "caspr", "cogiro")
    one = CASPR["cogiro"]
    points = np.array(one["cables"])
    np.testing.assert_array_equal(draft.exit_points, points[:, :3])
    np.testing.assert_array_equal(draft.anchor_points, points[:, 3:])
    assert draft.mass == 91.058 and draft.joints == () and draft.limits == (100.0, 5000.0)
    np.testing.assert_array_equal(draft.pose, [0, 0, 2, 1, 0, 0, 0])
    assert draft.inertia is not None
    np.testing.assert_array_equal(np.diag(draft.inertia), [36.598, 35.982, 25.439])
    assert draft.cable_names[0] == "cable 1" and "others with --set: bare" in draft.notes[0]
    with pytest.raises(seecr.SeecrError, match="does not say how far its cables stretch; give E S"):
        draft.robot()


def test_attachments_about_the_centre_of_mass_and_inertia_about_the_joint(tmp_path: Path) -> None:
    """The same robot said in both ways; Steiner as MuJoCo's own composite body has it."""
    one = CASPR["cogiro"]
    c, mass = np.array(one["centre"]), one["mass"]
    xx, yy, zz, xy, xz, yz = one["inertia"]
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    # parallel axes, outwards; what MuJoCo compiles below is the inertia about the centre again
    shifted = about_com + mass * (c @ c * np.eye(3) - np.outer(c, c))
    six = shifted[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
    moved = [[*row[:3], *(np.array(row[3:]) - c).tolist()] for row in one["cables"]]
    plain = draft_of(tmp_path, "caspr", "cogiro").with_options(ea=EA)
    other = draft_of(
        tmp_path, "caspr", "cogiro", inertia=six, inertia_about="joint", about="com", cables=moved
    ).with_options(ea=EA)
    np.testing.assert_allclose(plain.anchor_points, other.anchor_points, atol=1e-12)
    assert plain.inertia is not None and other.inertia is not None
    np.testing.assert_allclose(plain.inertia, other.inertia, atol=1e-12)
    robot, _notes = other.robot()
    robot.save(tmp_path / "out.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    np.testing.assert_allclose(
        np.sort(model.body_inertia[1]), np.linalg.eigvalsh(about_com), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("joint", "start", "expected"),
    [
        ("SPATIAL_EULER_XYZ", [1, 2, 3, 0.3, -0.2, 0.5], "xyz"),
        ("PLANAR_XY", [1, 2, 0.4], "z"),
        ("PLANAR_XZ", [1, 2, 0.4], "y"),
        ("PLANAR_YZ", [1, 2, 0.4], "x"),
        ("S_EULER_XYZ", [0.3, -0.2, 0.5], "xyz"),
        ("U_XZ", [0.3, 0.5], "xz"),
        ("R_Y", [0.7], "y"),
        ("T_XYZ", [1, 2, 3], ""),
    ],
)
def test_the_pose_at_the_joints_initial_values(
    joint: str, start: list[float], expected: str, tmp_path: Path
) -> None:
    """As SciPy turns it, in the order of the axes."""
    draft = draft_of(tmp_path, "caspr", "cogiro", joint=joint, start=start, place=[0.1, 0.2, 0.3])
    slides = len(start) - len(expected)
    angles = start[slides:]
    turn = Rotation.identity()
    if expected:
        # rotations about moving axes are upper case for SciPy
        turn = Rotation.from_euler(expected.upper(), angles if angles[1:] else angles[0])
    letters = {"PLANAR_XZ": [0, 2], "PLANAR_YZ": [1, 2]}.get(joint, list(range(slides)))
    place = np.array([0.1, 0.2, 0.3])
    place[letters] += start[:slides]
    assert draft.pose is not None
    pose = np.asarray(draft.pose)
    np.testing.assert_allclose(pose[:3], place)
    there = Rotation.from_quat(pose[3:], scalar_first=True)
    np.testing.assert_allclose(there.as_matrix(), turn.as_matrix(), atol=1e-15)
    # and MuJoCo's joints move it from zero by these values
    if draft.joints:
        base = draft_of(
            tmp_path,
            "caspr",
            "cogiro",
            joint=joint,
            start=[0.0] * len(start),
            place=[0.1, 0.2, 0.3],
        )
        base.with_options(ea=EA).robot()[0].save(tmp_path / "base.xml")
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "base.xml"))
        data = mujoco.MjData(model)
        data.qpos[:] = start
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.xpos[1], place, atol=1e-12)
        np.testing.assert_allclose(data.xmat[1].reshape(3, 3), turn.as_matrix(), atol=1e-12)


def test_a_planar_file_with_one_moment_keeps_it_about_its_hinge(tmp_path: Path) -> None:
    robot, notes = draft_of(tmp_path, "caspr", "kntu_planar").with_options(ea=EA).robot()
    np.testing.assert_array_equal(robot.inertia, 0.1 * np.eye(3))
    assert not any("inertia" in note for note in notes)
    solution = seecr.solve(robot, robot.reference_pose)
    assert not solution.converged.any()
    assert "nothing loads them: tighten them with --pretension 10" in reason(solution)


def test_springs_have_their_own_elasticity_and_pulleys_are_told(tmp_path: Path) -> None:
    robot, _notes = draft_of(tmp_path, "caspr", "two_dof").robot()
    np.testing.assert_array_equal(robot.ea, np.full(robot.n_cables, 13000.0))
    draft = draft_of(tmp_path, "caspr", "cuhk_cucablerobot")
    assert any("pulley_radius with radius_m = 0.045" in note for note in draft.notes)


def test_every_kind_of_number_of_a_wirex_robot(tmp_path: Path) -> None:
    draft = draft_of(tmp_path, "wirex", "ipanema")
    np.testing.assert_allclose(draft.ea, 110e9 * np.pi * 0.006**2)
    assert draft.mass == 25.0 and list(draft.centre_of_mass) == [0, 1, 0.2]
    robot, notes = draft.robot()
    np.testing.assert_allclose(robot.reference_pose[:3], [0, 0, 1])
    text = " ".join(notes)
    for told in (
        "110 GPa on a radius of 6 mm", "0.226 N/m", "pulleys of 100 mm radius",
        "pulley_radius with radius_m = 0.1", "its inertia is that of no body",
        "the centre of mass (0 1 0.2) m is what WireX writes for every robot", "say --com X Y Z",
        "the reference pose, where the winches are zeroed, is not given: 0 0 1 m",
    ):  # fmt: skip
        assert told in text
    beside = draft_of(tmp_path, "caspr", "cogiro", centre=[0, 1, 5]).with_options(ea=EA)
    assert any("(0 1 5) m is 4.03 m away from the anchor" in note for note in beside.robot()[1])
    assert any("WireX writes" in n for n in draft_of(tmp_path, "wirex", "cablemasterrobot").notes)
    assert not any("WireX writes" in n for n in draft_of(tmp_path, "wirex", "hrpcables").notes)
    assert not any(
        "of mass (0 0 0)" in note for note in draft.with_options(com=(0, 0, 0)).robot()[1]
    )


# --- why a robot does not rest ---------------------------------------------------------------


def test_two_cables_leave_four_motions_free(tmp_path: Path) -> None:
    """Of six degrees of freedom two cables determine two, by the rank of their directions."""
    rows = CASPR["cogiro"]["cables"][:2]
    robot, _notes = draft_of(tmp_path, "caspr", "cogiro", cables=rows).with_options(ea=EA).robot()
    everything = np.ones(2, dtype=bool)
    free = unresisted(robot, robot.reference_pose, everything)
    assert free.shape == (4, 6)
    # along them lengths change by the square of the step, by differences
    for motion in free:
        for sign in (-1.0, 1.0):
            pose = pose_add(robot.reference_pose, sign * 1e-5 * motion)
            change = robot.nominal_lengths(pose[None])[0] - robot.reference_lengths
            assert np.abs(change).max() < 1e-8


def test_cables_through_one_axis_leave_the_turn_about_it(tmp_path: Path) -> None:
    exits = np.array(CASPR["cogiro"]["cables"])[:, :3]
    anchors = np.zeros((len(exits), 3))
    anchors[::2, 2] = 0.5
    rows = np.hstack([exits, anchors]).tolist()
    robot, _notes = (
        draft_of(tmp_path, "caspr", "cogiro", cables=rows, centre=[0, 0, 0])
        .with_options(ea=EA)
        .robot()
    )
    said = reason(seecr.solve(robot, robot.reference_pose))
    assert "no cable, taut or slack, resists 1 motion: turn about z" in said


def test_a_free_platform_on_one_point_is_a_point_mass(tmp_path: Path) -> None:
    rows = [[*row[:3], 0.1, 0.2, 0.3] for row in CASPR["cogiro"]["cables"]]
    robot, notes = draft_of(tmp_path, "caspr", "cogiro", cables=rows).with_options(ea=EA).robot()
    assert [joint.name for joint in robot.joints] == ["x", "y", "z"]
    assert any("a point mass on slides along x y z" in note for note in notes)
    assert seecr.solve(robot, robot.reference_pose).converged.all()


# --- damage ----------------------------------------------------------------------------------


def refused(read: Any, *files: Path) -> str:
    with pytest.raises(seecr.SeecrError) as caught:
        read(*files)
    text = str(caught.value)
    assert all(line.startswith(str(files[0].parent)) for line in text.split("\n"))
    return text


def damaged(path: Path, *pairs: tuple[str, str]) -> Path:
    text = path.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


def test_all_faults_of_a_caspr_platform_are_told_at_once(tmp_path: Path) -> None:
    bodies, cables = caspr_files(tmp_path, "cogiro")
    damaged(
        bodies, ("<mass>91.058</mass>", "<mass>heavy</mass>"), ("0 0 2 0 0 0", "0 0 2"),
        ("<Ixz>3.012</Ixz>", ""), ('ref="com"', 'ref="middle"'),
    )  # fmt: skip
    text = refused(lambda a, b: read_caspr(a, b, None), bodies, cables)
    for told in (
        "line 6: q_initial: expected 6 numbers, got '0 0 2'",
        "line 8: <mass>: expected a number, got 'heavy'",
        "line 11: <inertia>: expected <Ixz> in it",
        '<inertia>: expected ref="com" or ref="joint", got \'middle\'',
    ):  # fmt: skip
        assert told in text


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ([("SPATIAL_EULER_XYZ", "R_AXIS")], "line 6: joint type 'R_AXIS': expected one of R_X, "),
        (
            [("</link_rigid>", '</link_rigid><link_rigid num="2"/>')],
            "has 2 links: a chain of bodies",
        ),
        ([("<links ", "<parts "), ("</links>", "</parts>")], "has 0 links: no platform"),
        ([("</bodies_system>", "")], "is no XML: no element found"),
        (
            [("<bodies_system>", "<cables>"), ("</bodies_system>", "</cables>")],
            "begins with <cables>",
        ),
    ],
)
def test_a_caspr_platform_that_is_none_is_told(
    pairs: list[tuple[str, str]], told: str, tmp_path: Path
) -> None:
    bodies, cables = caspr_files(tmp_path, "cogiro")
    assert told in refused(lambda a, b: read_caspr(a, b, None), damaged(bodies, *pairs), cables)


def test_all_faults_of_caspr_cables_are_told_at_once(tmp_path: Path) -> None:
    bodies, cables = caspr_files(tmp_path, "cogiro")
    damaged(
        cables, ('attachment_reference="joint"', 'attachment_reference="hull"'),
        ("-7.1775 -5.4361 5.3911", "-7.1775 -5.4361"), ("<link>1</link>", "<link>2</link>"),
        ("<force_min>100.0</force_min>", "<force_min>low</force_min>"),
    )  # fmt: skip
    text = refused(lambda a, b: read_caspr(a, b, None), bodies, cables)
    for told in (
        f"{cables}: ", "cable 'cable 1': expected attachment_reference com or joint, got 'hull'",
        "cable 'cable 1' is attached to links 0, 2; expected 0 (the base) and 1 (the platform)",
    ):  # fmt: skip
        assert told in text


def test_sets_without_cables_on_winches_are_told_with_those_that_have_them(tmp_path: Path) -> None:
    bodies, cables = caspr_files(tmp_path, "cogiro")
    with pytest.raises(
        seecr.SeecrError, match=r"set 'bare' does not exist, or has no cables; .*--set: original"
    ):
        read_caspr(bodies, cables, "bare")
    with pytest.raises(seecr.SeecrError, match="set 'other' does not exist"):
        read_caspr(bodies, cables, "other")
    text = cables.read_text().replace("cable_ideal", "cable_vsd_polynomial")
    cables.write_text(text)
    with pytest.raises(
        seecr.SeecrError, match="has <cable_vsd_polynomial>, with a force that is no"
    ):
        read_caspr(bodies, cables, None)


def test_all_faults_of_a_wirex_robot_are_told_at_once(tmp_path: Path) -> None:
    path = wirex_file(tmp_path, "ipanema")
    damaged(
        path, ('mass="25"', 'mass="-3"'), ('x="-2"', 'x="left"'), ('radius="0.1"', 'radius="wide"'),
        ("<platform x=", "<plate x="), ('y="1"', ""),
    )  # fmt: skip
    text = refused(read_wirex, path)
    for told in (
        f"{path}: ", "<platform>: expected a mass of 0 or more, got -3",
        "<base> x: expected a number, got 'left'", "<base> radius: expected a number, got 'wide'",
        "<chain>: expected <platform> in it, got none",
        "<centerofgravity> y: expected a number, got",
    ):  # fmt: skip
        assert told in text


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is no XML: no element found"),
        ("<mujoco/>", "line 1: begins with <mujoco>; expected a robot of WireX"),
        ("<models/>", "line 1: <models>: expected <robot> in it, got none"),
        ("<models><robot><platform mass='1'/></robot></models>", "has no <chain>"),
        ("PK\x03\x04", "is a zip archive or an Excel workbook"),
    ],
)
def test_what_is_no_wirex_robot_is_told(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.wcrfx"
    path.write_text(text)
    assert told in refused(read_wirex, path)
