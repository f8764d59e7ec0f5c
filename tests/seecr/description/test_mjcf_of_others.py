"""MJCF as others write it: read as MuJoCo itself moves it, with notes about what is left out."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hall import EXITS, SITES, hall, tendon
from mujoco_rest import rest_of

import seecr
from seecr.description.joints import motion_columns, pose_of_values, values_of_pose
from seecr.pose import pose_difference, quat_rotate

SLIDES = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
HINGES = "".join(
    f'<joint name="h{a}" type="hinge" pos="0 0 0.3" axis="{axis}"/>'
    for a, axis in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
)
BALL = '<joint name="knee" type="ball" pos="0 0 0.3"/>'
LOOSE = (
    '<body name="box" pos="0.4 0.4 0.05"><freejoint/><geom size="0.05" mass="0.1"/></body>'
    '<body name="swing" pos="2 2 1"><joint type="hinge"/><geom size="0.05" pos="0 0 -1"/>'
    '<body name="bob" pos="0 0 -1"><joint type="ball"/><geom size="0.05" pos="0 0 -1"/></body>'
    "</body>"
)
WELDED = (
    '<body name="tool" pos="0.03 0.02 -0.1" euler="20 0 70"><geom type="box" size="0.02 0.03 0.05" '
    'mass="0.4"/><body name="tip" pos="0 0.1 0" euler="0 40 0"><inertial pos="0.01 0.02 0.03" '
    'mass="0.25" diaginertia="0.002 0.003 0.004"/>{}</body></body>'
)
LUGS = f'<body name="lugs" pos="0.01 0.02 0.03" euler="5 0 20">{SITES}</body>'
MOCAP = EXITS.replace(
    '<site name="a1" pos="-1.1 0.8 1.75"/>',
    '<body name="post" mocap="true" pos="-1.1 0.8 0"><site name="a1" pos="0 0 1.75"/></body>',
)
REEVED = {
    2: '<site site="a{0}"/><site site="p{0}"/><site site="a{0}"/>',
    4: '<site site="p{0}"/>' + 2 * '<site site="a{0}"/><site site="p{0}"/>',
    0.5: '<pulley divisor="2"/><site site="a{0}"/><site site="p{0}"/>',
    1.5: '<site site="a{0}"/><site site="p{0}"/><pulley divisor="2"/><site site="p{0}"/>'
    '<site site="a{0}"/>',
}
SERVO = '<actuator><position name="m0" tendon="rope0" kp="50"/><motor name="m1" tendon="rope1"/>'
MOTORS = '<actuator><motor name="w0" tendon="rope0" gear="0.02"/></actuator>'


def ropes(spring: str, path: str | None = None) -> str:
    return "".join(tendon(i, spring, path and path.format(i)) for i in range(4))


def reeved(falls: float) -> dict[str, str]:
    spring = f'springlength="0 {1.52 * falls}" stiffness="{900 / falls**2}"'
    return {"tendons": ropes(spring, REEVED[falls])}


KEY = '<keyframe><key name="home" qpos="0.1 0 0.7 1 0 0 0"/></keyframe>'
CLASS = (
    '<default><default class="line"><tendon stiffness="900"/><default class="thin"><tendon '
    'springlength="1.52"/></default></default></default>'
)
TRIES = {
    "plain": ({}, ()),
    "motors": ({"rest": MOTORS}, ("1 actuator (w0) left out: winches are what commands pay out",)),
    "servo": (
        {"rest": SERVO + "</actuator>"},
        ("2 actuators (m0 and m1) left out", "1 actuator (m0) would pull in MuJoCo even at ctrl"),
    ),
    "keyframe": ({"rest": KEY}, ("keyframe home left out: winches are zeroed",)),
    "welded": ({"inside": SITES + WELDED.format("")}, ()),
    "welded lugs": ({"inside": LUGS}, ()),
    "welded far": (
        {"inside": SITES.replace('<site name="p3" pos="0.12 -0.09 0.02"/>', "")
         + WELDED.format('<site name="p3" pos="0.05 -0.2 0.1"/>')}, (),
    ),
    "static": ({"world": f'<body pos="0 0 0.1" euler="0 0 10">{EXITS}</body>'}, ()),
    "mocap": ({"world": MOCAP}, ()),
    "loose": ({"world": EXITS + LOOSE}, (
        "each of the bodies box and swing is left out: no cable touches it",
    )),
    "reeved twice": (reeved(2), ("rope3 runs 2 times between its points: read as one cable of 4",)),
    "reeved four times": (reeved(4), ("runs 4 times",)),
    "divisor": (reeved(0.5), ("runs 0.5 times",)),
    "branches": (reeved(1.5), ("runs 1.5 times",)),
    "no springlength": (
        {"tendons": ropes('stiffness="900"')},
        ("has no springlength: its length at the reference pose is taken", "1.5"),
    ),
    "one springlength": (
        {"tendons": ropes('stiffness="900" springlength="1.52"')},
        ("has one springlength (1.52 m), with which it would push as well",),
    ),
    "of a class": (
        {"tendons": ropes('class="thin"'), "head": CLASS}, ("has one springlength (1.52 m)",)
    ),
    "ball": ({"joint": BALL}, ()),
    "three hinges": ({"joint": HINGES}, ()),
    "slides and ball": ({"joint": SLIDES + BALL}, ()),
    "lift and ball": ({"joint": SLIDES.split("/>")[2] + "/>" + BALL}, ()),
}  # fmt: skip


def without(name: str) -> tuple[str, ...]:
    return {"loose": ("box", "swing"), "motors": ("actuators",), "servo": ("actuators",)}.get(
        name, ()
    )


@pytest.mark.parametrize("name", TRIES)
def test_a_robot_rests_where_mujoco_brings_its_file(name: str, tmp_path: Path) -> None:
    parts, words = TRIES[name]
    path = hall(tmp_path / "robot.xml", **parts)
    robot = seecr.load_robot(path)
    told = "\n".join(robot.notes)
    assert all(word in told for word in words) and bool(words) == bool(robot.read), told
    assert all(note.startswith(f"{path}: ") for note in robot.read)
    # as MuJoCo reads it, one springlength pushes: it is read otherwise, which the note tells
    theirs = rest_of(path, "ee", without(name), one_way="which it would push" in told)
    ours = seecr.solve(robot, robot.reference_pose)
    assert ours.converged[0], ours
    off = pose_difference(ours.pose, theirs.pose[None])[0]
    assert np.abs(off).max() < 1e-7, off
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-4)
    assert theirs.tensions.max() > 1.0


@pytest.mark.parametrize("name", ["welded", "welded lugs", "welded far"])
def test_welded_bodies_are_merged_as_mujoco_fuses_them(name: str, tmp_path: Path) -> None:
    parts = TRIES[name][0]
    ours = seecr.load_robot(hall(tmp_path / "robot.xml", **parts))
    fused = hall(tmp_path / "fused.xml", **parts, head='<compiler fusestatic="true"/>')
    model = mujoco.MjModel.from_xml_path(str(fused))
    assert model.nbody == 2
    theirs = seecr.load_robot(fused)
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[1])
    inertia = axes.reshape(3, 3) @ np.diag(model.body_inertia[1]) @ axes.reshape(3, 3).T
    assert ours.mass == pytest.approx(float(model.body_mass[1]), rel=1e-14)
    assert ours.centre_of_mass == pytest.approx(model.body_ipos[1], abs=1e-14)
    # MuJoCo 3.13 turns its axes until they are right to 1e-6
    assert ours.inertia == pytest.approx(inertia, abs=1e-6 * inertia.max())
    assert ours.anchor_points == pytest.approx(theirs.anchor_points, abs=1e-14)


def test_three_slides_and_a_ball_are_a_free_joint(tmp_path: Path) -> None:
    ball = seecr.load_robot(hall(tmp_path / "ball.xml", joint=SLIDES + BALL))
    free = seecr.load_robot(hall(tmp_path / "free.xml"))
    assert ball.joints == () and np.array_equal(ball.reference_pose, free.reference_pose)
    flat = seecr.load_robot(hall(tmp_path / "flat.xml", joint=2 * '<joint type="slide"/>' + BALL))
    assert [joint.name for joint in flat.joints] == ["joint1", "joint2", "knee_x", "knee_y",
                                                     "knee_z"]  # fmt: skip
    assert "ball knee" in repr(flat)


def test_a_ball_turns_about_its_centre_and_about_nothing_drawn(tmp_path: Path) -> None:
    robot = seecr.load_robot(hall(tmp_path / "robot.xml", joint=BALL, place='pos="0 0 1"'))
    centre = np.array([0.0, 0.0, 1.3])
    for turn in ([0.5, 0.5, 0.5, 0.5], [np.sqrt(0.5), 0, np.sqrt(0.5), 0], [0, 1, 0, 0],
                 [np.sqrt(0.5), 0, 0, -np.sqrt(0.5)], [0.5, -0.5, 0.5, 0.5]):  # fmt: skip
        quat = np.array(turn, float)
        place = centre - quat_rotate(quat, np.array([0.0, 0.0, 0.3]))
        pose = np.concatenate([place, quat])
        values, screws = values_of_pose(robot, pose)
        back, _screws = pose_of_values(robot, values)
        assert pose_difference(back, pose[None]) == pytest.approx(np.zeros((1, 6)), abs=1e-12)
        # quarter and half turns about drawn axes are no singular places: all three turns count
        columns = motion_columns(screws, pose[None, :3])[0, 3:]
        assert np.linalg.svd(columns)[1].min() > 0.05


def test_an_exported_ball_and_block_and_tackle_are_read_back(tmp_path: Path) -> None:
    path = hall(tmp_path / "robot.xml", joint=SLIDES.split("/>")[0] + "/>" + BALL, **reeved(4))
    robot = seecr.load_robot(path)
    (tmp_path / "out.xml").write_text(seecr.export(robot, ()).text)
    back = seecr.load_robot(tmp_path / "out.xml")
    assert np.array_equal(back.falls, [4.0] * 4) and len(back.joints) == 4
    ours, theirs = (seecr.solve(one, one.reference_pose) for one in (robot, back))
    assert ours.pose == pytest.approx(theirs.pose, abs=1e-12)
    assert ours.tensions == pytest.approx(theirs.tensions, rel=1e-10)


def test_tensions_of_a_block_and_tackle_are_those_of_its_line(tmp_path: Path) -> None:
    """Read, predicted, limited and aimed at: all a quarter of those of the straight cable."""
    line = seecr.load_robot(hall(tmp_path / "line.xml", **reeved(4)))
    one = seecr.load_robot(hall(tmp_path / "one.xml"))
    assert line.rest_lengths == pytest.approx(one.rest_lengths) and np.all(line.falls == 4.0)
    pose = line.reference_pose
    ours, theirs = (seecr.predict(robot, pose) for robot in (line, one))
    assert 4.0 * ours.tensions == pytest.approx(theirs.tensions, rel=1e-9)
    assert 4.0 * ours.readings.tensions == pytest.approx(theirs.readings.tensions, rel=1e-9)
    assert 4.0 * ours.solution().tensions == pytest.approx(theirs.tensions, rel=1e-9)
    rates = []
    for robot in (line, one):
        terms = seecr.Terms([seecr.Term.of(robot, "platform_mass")])
        case = seecr.Experiment(robot, seecr.Commands(pose[None]))
        rates.append(seecr.sensitivities(case, terms, case.predict(terms.effects))[0, 6:])
    assert 4.0 * rates[0] == pytest.approx(rates[1], rel=1e-6) and np.any(rates[1] != 0.0)
    limits = {"lowest": 2.0, "highest": 30.0}
    wide = {"lowest": 8.0, "highest": 120.0}
    some, whole = seecr.correct(line, pose, **limits), seecr.correct(one, pose, **wide)
    assert some.lengths == pytest.approx(whole.lengths, rel=1e-9)
    assert 4.0 * some.solution.tensions == pytest.approx(whole.solution.tensions, rel=1e-9)
    assert some.solution.tensions.min() > 2.0 - 1e-3


@pytest.mark.parametrize(
    ("file", "same", "part"),
    [
        ("05-child-bodies/gripper_welded.xml", "05-child-bodies/gripper_welded_fusestatic.xml", 1),
        ("08-reeving/robot.xml", "08-reeving/by_hand.xml", 0.5),
    ],
)
def test_published_files_equal_those_written_by_hand(
    file: str, same: str, part: float, shared_data: Path
) -> None:
    one, other = (seecr.load_robot(shared_data / "public" / name) for name in (file, same))
    pose = [0.1, 0.05, 0.85, 1, 0, 0, 0]
    ours, theirs = seecr.solve(one, pose), seecr.solve(other, pose)
    assert ours.pose == pytest.approx(theirs.pose, abs=1e-12)
    assert ours.tensions == pytest.approx(part * theirs.tensions, rel=1e-9)


@pytest.mark.parametrize(
    ("file", "leave"),
    [
        ("01-position-actuators/springs_and_motors.xml", ("actuators",)),
        ("04-stiffness-only/robot.xml", ()),
        ("04-stiffness-only/single_springlength.xml", ()),
        ("04-stiffness-only/in_default_class.xml", ()),
        ("05-child-bodies/gripper_welded.xml", ()),
        ("05-child-bodies/sites_in_child.xml", ()),
        ("06-include-frames-mocap/robot.xml", ()),
        ("08-reeving/robot.xml", ()),
        ("08-reeving/pulley_divisor.xml", ()),
        ("12-two-bodies/dropped_object_in_scene.xml", ("box",)),
    ],
)
def test_published_files_rest_where_mujoco_brings_them(
    file: str, leave: tuple[str, ...], shared_data: Path
) -> None:
    path = shared_data / "public" / file
    robot, theirs = seecr.load_robot(path), rest_of(path, "ee", leave)
    ours = seecr.solve(robot, robot.reference_pose)
    assert np.abs(pose_difference(ours.pose, theirs.pose[None])).max() < 1e-7
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-4)
