"""Reading robots from MJCF: the numbers, and one sentence for every file that is no robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from random_robots import KINDS, random_robot, write_mjcf
from robots import RECTANGLE
from scipy.spatial.transform import Rotation

from seecr.description.mjcf import load_robot
from seecr.description.mjcf_text import cable, numbers_text, plain_text, scene, text_of
from seecr.description.robot import Joint, Robot
from seecr.equilibrium.solving import solve
from seecr.errors import RobotError
from seecr.pose import quat_from_rotvec, quat_rotate

WORLD = '<site name="A1" pos="0 0 2"/><site name="A2" pos="1 0 2"/>'
PLATFORM = (
    '<body name="platform" pos="0.5 0 1">{joint}<inertial pos="0 0 -0.1" mass="3" '
    'diaginertia="1 1 1"/><site name="B1" pos="-0.1 0 0"/><site name="B2" pos="0.1 0 0"/>'
    "{extra}</body>"
)
TENDONS = (
    '<spatial name="left" springlength="0 1.1" stiffness="200"><site site="A1"/><site site="B1"/>'
    '</spatial><spatial name="right" springlength="0 1.1" stiffness="300"><site site="A2"/>'
    '<site site="B2"/></spatial>'
)


def mjcf(
    folder: Path,
    *,
    world: str = WORLD,
    joint: str = "<freejoint/>",
    extra: str = "",
    platform: str = PLATFORM,
    tendons: str = TENDONS,
    rest: str = "",
) -> Path:
    body = platform.format(joint=joint, extra=extra)
    path = folder / "robot.xml"
    path.write_text(
        f'<mujoco model="two ropes"><worldbody>{world}{body}</worldbody>'
        f"<tendon>{tendons}</tendon>{rest}</mujoco>"
    )
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(path)
    text = str(caught.value)
    assert "\n" not in text and text.startswith(str(path))
    return text.removeprefix(f"{path}: ")


# --- what is read ------------------------------------------------------------------------------


def test_every_number_of_a_small_file(tmp_path: Path) -> None:
    robot = load_robot(mjcf(tmp_path, rest='<option gravity="0 1 -9"/>'))
    assert robot.name == "two ropes" and robot.source == tmp_path / "robot.xml"
    assert robot.cable_names == ("left", "right")
    assert np.array_equal(robot.exit_points, [[0, 0, 2], [1, 0, 2]])
    assert np.array_equal(robot.anchor_points, [[-0.1, 0, 0], [0.1, 0, 0]])
    assert np.array_equal(robot.ea, [200 * 1.1, 300 * 1.1])
    assert np.array_equal(robot.rest_lengths, [1.1, 1.1])
    assert robot.mass == 3.0 and np.array_equal(robot.centre_of_mass, [0, 0, -0.1])
    assert np.array_equal(robot.gravity, [0, 1, -9])
    assert np.array_equal(robot.reference_pose, [0.5, 0, 1, 1, 0, 0, 0])
    assert robot.joints == () and robot.n_dof == 6


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_written_out_is_read_back(kind: str, tmp_path: Path) -> None:
    for seed in range(5):
        robot = random_robot(np.random.default_rng(seed), kind)
        back = load_robot(write_mjcf(robot, tmp_path / "robot.xml"))
        for name in ("exit_points", "anchor_points", "ea", "rest_lengths", "centre_of_mass",
                     "gravity", "reference_pose"):  # fmt: skip
            assert getattr(back, name) == pytest.approx(getattr(robot, name), rel=1e-15, abs=1e-15)
        assert back.mass == robot.mass and len(back.joints) == len(robot.joints)
        for ours, theirs in zip(robot.joints, back.joints, strict=True):
            assert (theirs.kind, theirs.name) == (ours.kind, ours.name)
            assert theirs.axis == pytest.approx(ours.axis, abs=1e-14)
            assert theirs.point == pytest.approx(ours.point, abs=1e-13)


def test_sites_in_either_order_are_the_same_robot(tmp_path: Path) -> None:
    plain = load_robot(mjcf(tmp_path))
    swapped = TENDONS.replace('<site site="A1"/><site site="B1"/>',
                              '<site site="B1"/><site site="A1"/>')  # fmt: skip
    assert swapped != TENDONS
    other = load_robot(mjcf(tmp_path, tendons=swapped))
    assert np.array_equal(plain.exit_points, other.exit_points)
    assert np.array_equal(plain.anchor_points, other.anchor_points)


def test_exit_points_may_stand_on_fixed_bodies_inside_one_another(tmp_path: Path) -> None:
    world = (
        '<body name="mast" pos="0 0 1.5" euler="0 0 90"><body name="arm" pos="0.5 0 0.5" '
        'quat="0 1 0 0"><site name="A1" pos="0.1 0.2 0.3"/></body></body>'
        '<site name="A2" pos="1 0 2"/>'
    )
    robot = load_robot(mjcf(tmp_path, world=world))
    # arm turns (0.1, 0.2, 0.3) about x by 180 deg, the mast turns the sum by 90 deg about z
    assert robot.exit_points[0] == pytest.approx([0.2, 0.6, 1.7], abs=1e-15)


@pytest.mark.parametrize(
    ("planes", "floor"),
    [
        ("", None),
        ('<geom type="plane" size="1 1 1" pos="9 9 -0.5"/>', -0.5),
        ('<body pos="0 0 2" euler="180 0 0"><geom type="plane" size="1 1 1" pos="0 0 1.8" '
         'euler="180 0 0"/></body>', 0.2),  # of a fixed body
        ('<geom type="plane" size="1 1 1" euler="5 0 0"/>', None),  # a ramp
        ('<geom type="plane" size="1 1 1" euler="180 0 0"/>', None),  # a ceiling
        ('<geom type="plane" size="1 1 1" pos="0 0 3"/>', None),  # above the platform
        ('<geom type="box" size="1 1 1"/>', None),
        ('<geom type="plane" size="1 1 1"/><geom type="plane" size="1 1 1" pos="0 0 0.3"/>', 0.3),
    ],
)  # fmt: skip
def test_the_floor_is_the_highest_level_plane_below(
    planes: str, floor: float | None, tmp_path: Path
) -> None:
    robot = load_robot(mjcf(tmp_path, world=f"{WORLD}{planes}"))
    assert robot.floor == (None if floor is None else pytest.approx(floor, abs=1e-12))


def test_degrees_by_default_and_radians_where_the_compiler_says(tmp_path: Path) -> None:
    turned = PLATFORM.replace('pos="0.5 0 1"', 'pos="0.5 0 1" euler="0 0 30"')
    degrees = load_robot(mjcf(tmp_path, platform=turned))
    radians = load_robot(
        mjcf(
            tmp_path,
            platform=turned.replace("0 0 30", repr(np.pi / 6).join(["0 0 ", ""])),
            rest='<compiler angle="radian"/>',
        )
    )
    expected = quat_from_rotvec(np.array([0, 0, np.pi / 6]))
    for robot in (degrees, radians):
        assert robot.reference_pose[3:] == pytest.approx(expected, abs=1e-15)
        assert np.array_equal(robot.anchor_points[0], [-0.1, 0, 0])  # in the platform's frame


def test_joints_of_a_turned_body_are_in_the_base_frame(tmp_path: Path) -> None:
    turned = PLATFORM.replace('pos="0.5 0 1"', 'pos="0.5 0 1" quat="0.8 0 0.6 0"')
    joint = (
        '<joint name="lift" type="slide" axis="0 0 1"/>'
        '<joint type="hinge" axis="0 2 0" pos="0.2 0 0"/>'
    )
    robot = load_robot(mjcf(tmp_path, platform=turned, joint=joint))
    lift, hinge = robot.joints
    assert (lift.kind, lift.name, hinge.kind, hinge.name) == ("slide", "lift", "hinge", "joint2")
    quat = np.array([0.8, 0, 0.6, 0])
    assert lift.axis == pytest.approx(quat_rotate(quat, np.array([0.0, 0, 1])), abs=1e-15)
    assert hinge.axis == pytest.approx([0, 1, 0], abs=1e-15)
    shift = quat_rotate(quat, np.array([0.2, 0, 0]))
    assert hinge.point == pytest.approx(np.array([0.5, 0, 1]) + shift, abs=1e-15)
    assert robot.n_dof == 2


def test_pretension_of_the_file_is_honoured(tmp_path: Path) -> None:
    """Two cables in line across the platform, each 10 mm short: 0.01/0.89 of E S pulls."""
    world = '<site name="A1" pos="-1 0 1"/><site name="A2" pos="2 0 1"/>'
    straight = 1.4
    tendons = TENDONS.replace("0 1.1", f"0 {straight - 0.01!r}")
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 0 1"))
    tendons = tendons.replace('"300"', '"200"')
    robot = load_robot(mjcf(tmp_path, world=world, joint=slides, tendons=tendons))
    for x in (0.5, 0.6):  # elsewhere too: the paid-out length moves by the commanded difference
        answer = solve(robot, [x, 0, 1, 1, 0, 0, 0], gravity=[0.0, 0, 0])
        sides = np.array([1.4 + (x - 0.5), 1.4 - (x - 0.5)]) - 0.01
        assert answer.rest_lengths[0] == pytest.approx(sides, rel=1e-14)
        assert answer.tensions[0] == pytest.approx(robot.ea[0] * 0.02 / sides.sum(), rel=1e-12)


def test_reference_pose_is_where_mujoco_starts_not_where_a_joint_reads_zero(tmp_path: Path) -> None:
    joint = '<joint name="lift" type="slide" axis="0 0 1" ref="0.7"/>'
    robot = load_robot(mjcf(tmp_path, joint=joint))
    assert np.array_equal(robot.reference_pose, [0.5, 0, 1, 1, 0, 0, 0])


# --- what is refused ---------------------------------------------------------------------------


def test_missing_folder_and_broken_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert refusal(tmp_path / "none.xml") == "no such file; expected an MJCF model of the robot"
    assert refusal(tmp_path) == "is a folder; expected an MJCF file"
    broken = tmp_path / "broken.xml"
    for text in ("<mujoco><worldbody>", "<urdf/>"):
        broken.write_text(text)
        assert refusal(broken).startswith("MuJoCo cannot read this as MJCF: ")
    broken.write_text('<mujoco>\n<option gravity="0 0 nan"/>\n</mujoco>')
    assert refusal(broken) == 'line 2: holds gravity="0 0 nan"; expected numbers'
    broken.write_text('<mujoco model="nano"><site name="nan"/></mujoco>')
    assert "expected numbers" not in refusal(broken)
    other = {"": "is empty; ", "\x00\x01": "is a binary file; ",
             "run,t_s\n1,2\n": "begins with 'run,t_s', which is not XML; "}  # fmt: skip
    for text, words in other.items():
        broken.write_text(text)
        assert refusal(broken).startswith(f"{words}expected the robot as MJCF, XML that begins")
    broken.write_text('<mujoco><worldbody><body mas="1"/></worldbody></mujoco>')
    assert "mas" in refusal(broken)  # MuJoCo's own words about the place come along
    assert sorted(p.name for p in tmp_path.iterdir()) == ["broken.xml"]  # and no log file


FREE = "<freejoint/>"
SLIDE = '<joint name="rail" type="slide" axis="1 0 0"/>'


def changed(old: str, new: str) -> dict[str, str]:
    """TENDONS with its first ``old`` replaced."""
    assert old in TENDONS
    return {"tendons": TENDONS.replace(old, new, 1)}


DRUM = '<geom name="drum" type="cylinder" size="0.1 0.1" pos="9 9 9"/>'
CART = f'<body name="cart">{SLIDE}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
INSIDE = PLATFORM.replace("{joint}", '<joint type="hinge"/>') + "</body>"
SEVEN = "".join(f'<joint type="hinge" axis="0 1 {i}"/>' for i in range(7))
GEAR = '<fixed name="gear"><joint joint="rail" coef="1"/></fixed>'
OVER = '<geom geom="drum"/>'
CURVED = 'stiffness="200 30"'


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ({"joint": ""}, "no moving body; expected one body with a free joint or with slide and"),
        ({"joint": SLIDE.replace("axis", 'stiffness="5" axis')}, "joint rail has a spring; expec"),
        ({"joint": SLIDE.replace("axis", 'stiffness="0 500" axis')},
         "joint rail has a spring; expected cables to carry the load"),
        ({"joint": '<joint name="loose" type="free" stiffness="5"/>'},
         "joint loose has a spring; expected cables to carry the load"),
        ({"joint": SEVEN}, "MuJoCo cannot read this as MJCF: Error: more than 6 dofs in body"),
        ({"platform": CART + INSIDE},
         "2 moving bodies hang together (cart and platform); expected one platform, and cables"),
        ({"platform": PLATFORM.replace("<body ", '<body gravcomp="1" ')},
         "body platform has gravcomp 1; expected none, the cables carry the weight"),
        ({"rest": '<option><flag spring="disable"/></option>'},
         "the flag spring is disabled; expected springs, the cables are springs"),
        ({"rest": '<option wind="3 0 0" density="1.2"/>'},
         "the option wind pushes the platform; expected none, and the push as an effect: ext"),
        ({"rest": '<equality><weld body1="platform"/></equality>'},
         "equality constraint number 1 holds the platform beside its cables; expected none: leave"),
        ({"tendons": ""}, "no cables; expected one <spatial> tendon per cable, through two sites"),
        (changed("0 1.1", "0.5 1.1"), 'tendon left has springlength "0.5 1.1"; expected'),
        (changed("0 1.1", "0 0"), 'tendon left has springlength "0 0"'),
        (changed('stiffness="300"', 'stiffness="0"'),
         'tendon right has stiffness 0; expected an elastic cable: springlength="0 l0" with'),
        (changed('stiffness="300"', ""), "tendon right has stiffness 0"),
        (changed('stiffness="300"', 'stiffness="-2"'), "tendon right has stiffness -2"),
        (changed('stiffness="200"', CURVED), "tendon left has a polynomial stiffness; expected on"),
        (changed('<site site="B1"/>', '<site site="B1"/><site site="B2"/>'),
         "tendon left runs through guide sites; expected exactly two, exit point and anchor point: "
         "it ends at its first site on the platform; --fix OUT.xml writes the robot without this"),
        ({"world": WORLD + DRUM, **changed('<site site="A1"/>', '<geom geom="drum"/>')},
         "MuJoCo cannot read this as MJCF: "),
        ({"world": WORLD + DRUM, **changed('<site site="B1"/>', f'{OVER}<site site="B1"/>')},
         "tendon left is wrapped around a geom (drum); expected a straight cable from its exit po"),
        (changed('"B1"', '"A2"'), "tendon left has all its sites on the world; expected one on"),
        (changed('"A1"', '"B2"'), "tendon left has all its sites on the platform; expected on"),
        ({"joint": SLIDE, "tendons": GEAR},
         "no cables; expected one <spatial> tendon per cable, through two sites"),
        ({"joint": SLIDE, "tendons": GEAR.replace("<fixed ", '<fixed stiffness="5" ')},
         "tendon gear is a fixed tendon, a spring between joints; expected <spatial> tendons"),
    ],
)  # fmt: skip
def test_files_that_are_no_cable_robot(parts: dict[str, str], text: str, tmp_path: Path) -> None:
    assert refusal(mjcf(tmp_path, **parts)).startswith(text)


@pytest.mark.parametrize("old", ["left", "platform", "two ropes"])
def test_a_name_that_is_not_utf_8_is_told_with_the_file(old: str, tmp_path: Path) -> None:
    """From an editor that saves in Latin-1: MuJoCo takes the bytes as they are."""
    path = mjcf(tmp_path)
    text = path.read_bytes().replace(f'name="{old}"'.encode(), b'name="c\xe2ble"')
    path.write_bytes(text.replace(f'model="{old}"'.encode(), b'model="c\xe2ble"'))
    assert refusal(path).startswith("the name 'c\ufffdble' is not UTF-8; expected a file in UTF-8")


def test_gravity_switched_off_in_the_file_is_off(tmp_path: Path) -> None:
    off = mjcf(tmp_path, rest='<option><flag gravity="disable"/></option>')
    assert np.array_equal(load_robot(off).gravity, np.zeros(3))


def test_anchor_on_its_exit_point_names_the_cable(tmp_path: Path) -> None:
    path = mjcf(tmp_path, world=WORLD.replace("1 0 2", "0.6 0 1"))
    with pytest.raises(RobotError, match=r"right has its anchor point on its exit point"):
        load_robot(path)
    almost = mjcf(tmp_path, world=WORLD.replace("1 0 2", "0.6 0 1.00000001"))
    assert load_robot(almost).n_cables == 2


def test_mass_may_be_zero_but_the_answer_says_nothing_holds_the_platform(tmp_path: Path) -> None:
    robot = replace(load_robot(mjcf(tmp_path)), mass=0.0)
    answer = solve(robot, robot.reference_pose)
    assert not answer.converged[0]


def test_a_platform_far_larger_than_its_frame_is_refused(tmp_path: Path) -> None:
    far = PLATFORM.replace('"0 0 -0.1"', '"0 0 -100"')
    assert refusal(mjcf(tmp_path, platform=far)) == (
        "body platform has its centre of mass 100 m from its anchor points; expected metres, of "
        "the size of the frame, 1.12 m across"
    )
    wide = PLATFORM.replace('"0.1 0 0"', '"100 0 0"')
    text = refusal(mjcf(tmp_path, platform=wide))
    assert text.startswith("tendon right is anchored 100 m from the origin of body platform; ")
    long = TENDONS.replace("0 1.1", "0 1100", 1)
    assert refusal(mjcf(tmp_path, tendons=long)).startswith("tendon left has rest length 1100 m;")
    short = TENDONS.replace("0 1.1", "0 1e-9", 1)
    assert refusal(mjcf(tmp_path, tendons=short)) == (
        "tendon left has rest length 1e-09 m, but its sites are 1.08 m apart at the reference "
        "pose; expected both in metres"
    )


def test_numbers_that_no_robot_has_name_the_file_and_the_cable(tmp_path: Path) -> None:
    told = "robot two ropes: {} of right holds a number that is not finite, or beyond 1e+30"
    for number in ("1e300", "inf", "-inf"):
        far = WORLD.replace("1 0 2", f"1 0 {number}")
        assert refusal(mjcf(tmp_path, world=far)) == told.format("exit_points")
        away = PLATFORM.replace('"0.1 0 0"', f'"0.1 {number} 0"')
        assert refusal(mjcf(tmp_path, platform=away)) == told.format("anchor_points")
    stiff = TENDONS.replace('"200"', '"1e150"')
    text = refusal(mjcf(tmp_path, tendons=stiff))
    assert text.startswith("robot two ropes: stiffness x rest length of left holds a number that")
    there = WORLD.replace("0 0 2", "0.4 0 1")
    text = refusal(mjcf(tmp_path, world=there))
    assert text.startswith("robot two ropes: left has its anchor point on its exit point at the")


def test_wind_in_no_medium_and_a_medium_without_wind_push_nothing(tmp_path: Path) -> None:
    for option in ('wind="3 0 0"', 'density="1.2" viscosity="2e-5"'):
        assert load_robot(mjcf(tmp_path, rest=f"<option {option}/>")).n_cables == 2


# --- The MJCF tree, by what MuJoCo makes of it


TURN = Rotation.from_rotvec([0.3, -0.5, 0.8])
# A body whose axes are not those of its frame; no plate is as flat as to break the triangle rule.
INERTIA = np.array([[0.5, 0.02, -0.03], [0.02, 0.6, 0.04], [-0.03, 0.04, 0.7]])


def turned(**changes: object) -> Robot:
    """The robot with its platform turned at the reference pose."""
    pose = RECTANGLE.reference_pose.copy()
    pose[3:] = TURN.as_quat(scalar_first=True)
    return replace(RECTANGLE, reference_pose=pose, inertia=INERTIA, **changes)


def loaded(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_numbers_keep_all_digits_and_zero_has_no_sign() -> None:
    values = [0.1 + 0.2, -1e-300, np.pi, np.nextafter(1.0, 2.0)]
    text = numbers_text(values, -0.0)
    assert [float(word) for word in text.split()] == [*values, 0.0] and text.endswith(" 0.0")


def test_two_dashes_in_a_remark_do_not_end_it() -> None:
    root = ET.fromstring(plain_text(RECTANGLE, "made with --figure none -->"))
    assert root.tag == "mujoco" and root.find("worldbody") is not None


def test_of_unknown_inertia_a_body_gets_that_of_its_mass_at_its_length() -> None:
    model, _data = loaded(plain_text(RECTANGLE, "a test"))
    np.testing.assert_allclose(model.body_inertia[1], np.full(3, 2.0 * 0.5**2))


def test_joints_are_in_the_base_frame_however_the_platform_is_turned() -> None:
    point, axis = np.array([1.0, 2.5, -1.0]), np.array([0.6, 0.0, 0.8])
    robot = turned(
        joints=(Joint("slide", "along", axis, point), Joint("hinge", "about", axis, point))
    )
    model, data = loaded(plain_text(robot, "a test"))
    assert model.jnt_type.tolist() == [mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE]
    np.testing.assert_allclose(data.xaxis, [axis, axis], atol=1e-12)
    np.testing.assert_allclose(data.xanchor[1], point, atol=1e-12)


@pytest.mark.parametrize(("rest", "force"), [(1.0, 300.0 * 1.0), (2.5, 0.0)])
def test_a_cable_pulls_by_its_stretch_and_never_pushes(rest: float, force: float) -> None:
    """Of 2 m between its ends, with 300 N/m."""
    root, world, body = scene(RECTANGLE, "a test")
    ET.SubElement(world, "site", name="here", pos=numbers_text([0.0, 0.0, 0.0]))
    ET.SubElement(body, "site", name="there", pos=numbers_text([-1.5, -2.0, -0.5]))
    tendons = ET.SubElement(root, "tendon")
    path = [("site", {"site": "here"}), ("site", {"site": "there"})]
    cable(tendons, "one", path, rest, [300.0], 0.01)
    _model, data = loaded(text_of(root))
    assert data.ten_length[0] == pytest.approx(2.0)
    pull = np.linalg.norm(data.qfrc_spring[:3])
    assert pull == pytest.approx(force, abs=1e-9)
