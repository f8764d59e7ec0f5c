"""What keeps an MJCF from being read: all of it in one answer, and what ``--fix`` makes of it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from called import ran
from click.testing import CliRunner
from hall import CORNERS, EXITS, SITES, hall, tendon
from mujoco_rest import rest_of

import seecr
from seecr.cli import main
from seecr.description.fixing import write_fixed
from seecr.description.mjcf import load_robot, model_names, model_path, unsupported_features
from seecr.pose import pose_difference

GOOD = 'springlength="0 1.52" stiffness="900"'
ROPE = 'limited="true" range="0 1.6"'
WINCHES = "".join(
    f'<site name="w{i}" pos="{1.1 * x} {0.8 * y} 0.1"/>'
    for i, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)))
)
SECOND = (
    '<body name="lower" pos="0 0 0.3"><freejoint/><geom size="0.05"/><site name="q0"/>'
    '<site name="q1" pos="0.1 0 0"/></body>'
)
TOOL = (
    '<body name="tool" pos="0.08 0 -0.1"><joint name="pivot" type="hinge" axis="0 1 0"/>'
    '<geom size="0.05"/></body>'
)
HANGS = tendon(7, GOOD, '<site site="p0"/><site site="q0"/>').replace("rope7", "hang")


def ropes(*springs: str) -> str:
    return "".join(tendon(i, spring) for i, spring in enumerate(springs))


# Each kind damaged in three ways at once: parts of the file, and what the answer names.
DAMAGED = {
    "servos without springs": (
        {
            "tendons": ropes("", "", GOOD, 'springlength="0.5 1.5" stiffness="900"'),
            "rest": '<actuator><position name="m0" tendon="rope0" kp="9"/></actuator>'
            '<equality><weld name="grip" body1="ee"/></equality>',
        },
        ("tendon rope0 has stiffness 0 and an actuator alone, which is not read; expected an",
         "tendon rope1 has stiffness 0; expected an elastic cable",
         'tendon rope3 has springlength "0.5 1.5"; expected two values, "0 l0"',
         "equality constraint grip holds the platform beside its cables; expected none"),
    ),
    "ropes": (
        {"tendons": ropes(ROPE, ROPE, f"{ROPE} stiffness='-3'", GOOD.replace("900", "900 5")),
         "joint": '<joint name="rail" type="slide" stiffness="3"/>'},
        ("each of the tendons rope0, rope1 and rope2 is a rope that cannot stretch (range up to "
         '1.6 m), without stiffness; expected an elastic cable: springlength="0 l0" with its rest '
         'length l0, and a positive stiffness="E S / l0" [N/m], with E S [N] the force that would '
         "double its length; l0 would be 1.6 m",
         "tendon rope3 has a polynomial stiffness; expected one number",
         "joint rail has a spring; expected cables to carry the load"),
    ),
    "bodies": (
        {"world": EXITS + SECOND, "tendons": ropes(GOOD, GOOD, GOOD, "") + HANGS,
         "inside": SITES + TOOL},
        ("3 moving bodies hang together (lower, ee and tool); expected one platform, and cables",
         "tendon hang holds another moving body",
         "tendon rope3 has stiffness 0"),
    ),
    "welded": (
        {"inside": SITES + '<body name="tip" gravcomp="0.5"><geom size="0.02"/></body>',
         "head": '<option wind="3 0 0" density="1.2"><flag spring="disable"/></option>'},
        ("body tip has gravcomp 0.5; expected none", "the option wind pushes the platform",
         "the flag spring is disabled"),
    ),
    "reeved": (
        {"tendons": tendon(0, GOOD, '<site site="a0"/><site site="p0"/><site site="a1"/>')
         + tendon(1, GOOD, '<site site="a1"/><site site="a2"/>')
         + tendon(2, GOOD, '<site site="a2"/><site site="p2"/><site site="p1"/>')
         + tendon(3, GOOD, '<site site="p3"/><site site="p2"/>')},
        ("tendon rope0 has parts between different points", "use the same two sites for all",
         "tendon rope1 has all its sites on the world", "tendon rope3 has all its sites on the pla",
         "tendon rope2 runs through guide sites; expected exactly two, exit point and anchor point:"
         " it ends at its first site on the platform"),
    ),
    "guided": (
        {"world": EXITS + WINCHES + '<geom name="drum" type="cylinder" size="0.03 1" pos="0 0 9"/>',
         "tendons": tendon(0, GOOD, '<site site="w0"/><site site="a0"/><site site="p0"/>')
         + tendon(1, GOOD, '<site site="a1"/><geom geom="drum"/><site site="p1"/>')
         + tendon(2, ROPE) + tendon(3)},
        ("tendon rope0 runs through guide sites; expected exactly two, exit point and anchor "
         "point, and the 1.6 m before the exit point as effect winch_side_length in a model",
         "tendon rope1 is wrapped around a geom (drum)", "as effect pulley_radius in a model",
         "tendon rope2 is a rope"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", DAMAGED)
def test_all_objections_come_in_one_answer(kind: str, tmp_path: Path) -> None:
    parts, words = DAMAGED[kind]
    path = hall(tmp_path / "robot.xml", **parts)
    with pytest.raises(seecr.RobotError) as caught:
        seecr.load_robot(path)
    head, *lines = str(caught.value).splitlines()
    assert head.startswith(f"{path}: {len(lines)} objections") and len(lines) >= 3
    for word in words:
        assert word in str(caught.value)
    answer = ran(f"seecr pose {path} 0 0 1", 2)
    assert answer.stdout == ""
    assert [line.strip() for line in answer.stderr.splitlines()[1:]] == [x.strip() for x in lines]


@pytest.mark.parametrize("kind", [kind for kind in DAMAGED if kind not in ("welded",)])
def test_what_cannot_be_mended_is_said_and_nothing_written(kind: str, tmp_path: Path) -> None:
    path = hall(tmp_path / "robot.xml", **DAMAGED[kind][0])
    answer = ran(f"seecr pose {path} --fix {tmp_path / 'out.xml'}", 2)
    assert "--fix cannot mend this, so that nothing is written:" in answer.stderr
    assert sorted(one.name for one in tmp_path.iterdir()) == ["robot.xml"]


LOOSE = '<body name="box" pos="2 0 0"><freejoint/><geom name="side" size="0.1"/></body>'
SINGLE = 'springlength="1.52" stiffness="900"'
MENDED = {
    "springs": (
        {"tendons": ropes(SINGLE, 'stiffness="900"', GOOD, GOOD)},
        ('each of the tendons rope0 and rope1 has springlength="0 l0" as it was read, l0 1.52 a',),
    ),
    "motors": (
        {"rest": '<actuator><motor tendon="rope0"/></actuator><sensor><actuatorfrc actuator="a"/>'
         "</sensor>".replace('actuator="a"', 'actuator="m"'), "tendons": ropes(*4 * [GOOD])},
        ("<actuator> with 1 element is left out", "<sensor> with 1 element is left out"),
    ),
    "loose": (
        {"world": EXITS + LOOSE, "rest": '<contact><exclude body1="box" body2="ee"/></contact>'
         '<keyframe><key qpos="0 0 0 1 0 0 0 0 0 0 1 0 0 0"/></keyframe>'},
        ("body box is left out: no cable touches it", "<keyframe> with 1 element is left out"),
    ),
    "held": (
        {"rest": '<equality><weld body1="ee"/></equality>',
         "head": '<option><flag spring="disable"/></option>'},
        ("<equality> with 1 element is left out", "the flag spring is no longer disabled"),
    ),
    "idle tendons": (
        {"tendons": ropes(*4 * [GOOD]) + tendon(8, GOOD, '<site site="a0"/><site site="a1"/>')},
        ("tendon rope8 is left out: it is not between the world and the platform",),
    ),
}  # fmt: skip
MENDED["motors"][0]["rest"] = MENDED["motors"][0]["rest"].replace("<motor ", '<motor name="m" ')


@pytest.mark.parametrize("kind", MENDED)
def test_a_mended_file_is_the_same_robot_without_objections(kind: str, tmp_path: Path) -> None:
    parts, words = MENDED[kind]
    path, out = hall(tmp_path / "robot.xml", **parts), tmp_path / "new.xml"
    answer = ran(f"seecr pose {path} --fix {out}", 0)
    assert answer.stdout.startswith(f"wrote {out}: {path}, but\n")
    for word in words:
        assert word in answer.stdout
    robot = seecr.load_robot(out)
    assert robot.read == () and robot.n_cables == 4
    expected = seecr.load_robot(hall(tmp_path / "plain.xml"))
    rest = expected.rest_lengths.copy()
    if kind == "springs":
        rest[1] = expected.reference_lengths[1]
    assert robot.rest_lengths == pytest.approx(rest, rel=1e-14)
    for name in ("exit_points", "anchor_points", "mass", "centre_of_mass", "inertia"):
        assert np.array_equal(getattr(robot, name), getattr(expected, name))


def test_a_geom_that_moves_with_the_platform_is_no_exit_point(tmp_path: Path) -> None:
    round_it = '<site site="a0"/><geom geom="drum"/><site site="p0"/>'
    drum = '<geom name="drum" type="sphere" size="0.03" pos="0.2 0.2 0.1"/>'
    path = hall(
        tmp_path / "robot.xml", inside=SITES + drum,
        tendons=tendon(0, GOOD, round_it) + "".join(tendon(i) for i in (1, 2, 3)),
    )  # fmt: skip
    with pytest.raises(seecr.RobotError, match="--fix cannot mend this"):
        write_fixed(path, tmp_path / "new.xml")


def test_a_file_is_never_written_over_and_one_without_fault_not_written(tmp_path: Path) -> None:
    path = hall(tmp_path / "robot.xml", tendons=ropes(*4 * [SINGLE]))
    (tmp_path / "there.xml").write_text("mine")
    for out in ("there.xml", "robot.xml"):
        answer = ran(f"seecr pose {path} --fix {tmp_path / out}", 2)
        assert "exists; expected the name of a new file" in answer.stderr
    assert (tmp_path / "there.xml").read_text() == "mine"
    good = hall(tmp_path / "good.xml")
    answer = ran(f"seecr pose {good} --fix {tmp_path / 'new.xml'}", 0)
    assert answer.stdout == f"{good}: nothing to mend, so that nothing is written\n"
    assert not (tmp_path / "new.xml").exists()


@pytest.mark.parametrize(
    "words",
    ["seecr pose {}", "seecr sweep {}", "seecr map {}", "seecr correct {}", "seecr export {}",
     "crosscheck compare {}", "crosscheck diagnose {}", "crosscheck plan {}", "crosscheck add {}",
     "crosscheck calibrate {}", "crosscheck twin {}", "crosscheck effects --robot {}",
     "crosscheck import --robot {}"],
)  # fmt: skip
def test_every_command_that_takes_a_robot_mends_it(words: str, tmp_path: Path) -> None:
    path = hall(tmp_path / "robot.xml", tendons=ropes(*4 * [SINGLE]))
    ran(f"{words.format(path)} --fix {tmp_path / 'new.xml'}", 0)
    assert seecr.load_robot(tmp_path / "new.xml").read == ()


def test_included_files_are_written_in_their_place(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "lines.xml").write_text(
        f"<mujoco><tendon>{ropes(*4 * [SINGLE])}</tendon></mujoco>"
    )
    path = hall(tmp_path / "robot.xml", tendons="", rest='<include file="sub/lines.xml"/>')
    assert "has one springlength" in seecr.load_robot(path).notes[0]
    out = tmp_path / "elsewhere" / "new.xml"
    write_fixed(path, out)
    assert "include" not in out.read_text()
    assert np.all(seecr.load_robot(out).rest_lengths == 1.52)


def test_without_guide_sites_it_is_the_original_with_the_effect_named(tmp_path: Path) -> None:
    """MuJoCo's rest of the guided file is that of the mended one with winch_side_length."""
    world = EXITS
    for i, corner in enumerate(CORNERS):
        x, y = corner
        world += f'<site name="w{i}" pos="{1.1 * x} {0.8 * y} {0.1 + 0.05 * i}"/>'
    way = '<site site="w{0}"/><site site="a{0}"/><site site="p{0}"/>'
    spring = 'springlength="0 3.12" stiffness="70"'
    guided = "".join(tendon(i, spring, way.format(i)) for i in range(4))
    path = hall(tmp_path / "robot.xml", world=world, tendons=guided)
    (change,) = write_fixed(path, tmp_path / "new.xml")
    assert "; winch_side_length 1.6 m in a model put back the rest" in change
    robot = seecr.load_robot(tmp_path / "new.xml")
    assert robot.rest_lengths == pytest.approx(np.full(4, 1.52), rel=1e-12)
    assert robot.ea == pytest.approx(np.full(4, 70 * 3.12), rel=1e-12)
    theirs = rest_of(path, "ee")
    ours = seecr.solve(
        robot, robot.reference_pose, effects=[seecr.effect_named("winch_side_length")(length=1.6)]
    )
    assert np.abs(pose_difference(ours.pose, theirs.pose[None])).max() < 1e-7
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-5)
    plain = seecr.solve(robot, robot.reference_pose)  # the effect does matter here
    assert np.abs(pose_difference(plain.pose, ours.pose)).max() > 0.01


def test_without_its_wheels_it_is_the_original_with_both_effects_named(tmp_path: Path) -> None:
    """Wheels that stand in the planes of their cables, with the winches below their rims."""
    r, lean, world, tendons = 0.04, 0.06, "", ""
    for i, (x, y) in enumerate(CORNERS):
        turn = np.degrees(np.arctan2(-y, -x))
        world += (
            f'<body pos="{0.9 * x} {0.9 * y} 1.8" euler="0 0 {turn}"><geom name="wheel{i}" '
            f'type="cylinder" size="{r} 0.01" euler="90 0 0" contype="0" conaffinity="0"/>'
            f'<site name="w{i}" pos="{-r} 0 -1.2"/><site name="top{i}" pos="{lean * r} 0 {2 * r}"/>'
            "</body>"
        )
        way = f'<site site="w{i}"/><geom geom="wheel{i}" sidesite="top{i}"/><site site="p{i}"/>'
        tendons += tendon(i, 'springlength="0 2.75" stiffness="90"', way)
    inside = "".join(f'<site name="p{i}" pos="{0.1 * x} {0.1 * y} 0"/>'
                     for i, (x, y) in enumerate(CORNERS))  # fmt: skip
    inside += '<geom size="0.01" pos="-0.01 0 0" mass="0.7"/>'  # its weight is in the middle
    path = hall(
        tmp_path / "robot.xml", world=world, inside=inside, tendons=tendons, place='pos="0 0 0.7"'
    )
    (change,) = write_fixed(path, tmp_path / "new.xml")
    assert "; pulley_radius 0.04 m and winch_side_length 1.2 m in a model put" in change
    robot = seecr.load_robot(tmp_path / "new.xml")
    theirs = rest_of(path, "ee")
    effects = [seecr.effect_named("pulley_radius")(radius=r),
               seecr.effect_named("winch_side_length")(length=1.2)]  # fmt: skip
    ours = seecr.solve(robot, robot.reference_pose, effects=effects)
    assert np.abs(pose_difference(ours.pose, theirs.pose[None])).max() < 1e-6
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-4)
    assert np.abs(pose_difference(ours.pose, robot.reference_pose[None])).max() > 0.01


# --- What an MJCF has beside cables that may hold or stop the platform, and that users are told


PLANAR = model_path("planar_vertical").read_text(encoding="utf-8")
SLIDE = '<joint name="x" type="slide"'
OFF = '<geom contype="0" conaffinity="0"'
TOUCH = (OFF, '<geom contype="1" conaffinity="1"')

# A ball above a floor, with a shelf that is fixed to the world.
BALL = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" {floor}/>
<body name="shelf"><geom size="0.1" {shelf}/></body>
<body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size="0.1" {ball}/><geom size="0.1"/>
</body></worldbody><contact>{contact}</contact></mujoco>"""
SHY = 'contype="0" conaffinity="0"'


def planar(*changes: tuple[str, str]) -> str:
    text = PLANAR
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def found(text: str, body: str = "platform") -> tuple[str, ...]:
    model = mujoco.MjModel.from_xml_string(text)
    return unsupported_features(model, model.body(body).id)


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        (SLIDE, f'{SLIDE} range="-1 1"', "joint limits"),
        ('width="0.0012"', 'width="0.0012" range="0 2" limited="true"', "tendon limits"),
        (SLIDE, f'{SLIDE} frictionloss="0.1"', "dry friction"),
        ('width="0.0012"', 'width="0.0012" frictionloss="0.1"', "dry friction"),
        (*TOUCH, "contacts"),
    ],
)
def test_what_may_hold_the_platform_is_named_one_by_one(old: str, new: str, name: str) -> None:
    assert found(planar((old, new))) == (name,)


def test_damping_shifts_no_rest() -> None:
    assert found(planar((SLIDE, f'{SLIDE} damping="2"'))) == ()


@pytest.mark.parametrize(
    ("flag", "left"),
    [
        ("contact", ("joint limits", "dry friction")),
        ("limit", ("dry friction", "contacts")),
        ("frictionloss", ("joint limits", "contacts")),
        ("constraint", ()),
    ],
)
def test_what_the_file_switches_off_does_not_count(flag: str, left: tuple[str, ...]) -> None:
    everything = (SLIDE, f'{SLIDE} range="-1 1" frictionloss="0.1"')
    text = planar(everything, TOUCH)
    assert found(text) == ("joint limits", "dry friction", "contacts")
    option = f'<option><flag {flag}="disable"/></option>'
    assert found(text.replace("<worldbody>", f"{option}<worldbody>")) == left


@pytest.mark.parametrize(
    ("floor", "shelf", "ball", "contact", "touch"),
    [
        ("", "", "", "", True),
        (SHY, "", "", "", True),  # the shelf
        (SHY, SHY, "", "", False),  # geoms of the ball itself never touch each other
        ('contype="2" conaffinity="2"', SHY, "", "", False),
        ('contype="2" conaffinity="1"', SHY, "", "", True),  # either side may ask
        ('contype="1" conaffinity="0"', SHY, "", "", True),
        ("", "", "", '<exclude body1="ball" body2="shelf"/>', True),
        ("", SHY, "", '<exclude body1="world" body2="ball"/>', False),
        ("", "", "", '<exclude body1="ball" body2="shelf"/><exclude body1="world" body2="ball"/>',
         False),
        (SHY, SHY, SHY, '<pair geom1="floor" geom2="ball"/>', True),
    ],
)  # fmt: skip
def test_contacts_count_where_the_platform_may_touch_its_surroundings(
    floor: str, shelf: str, ball: str, contact: str, touch: bool
) -> None:
    text = BALL.format(floor=floor, shelf=shelf, ball=ball, contact=contact)
    assert found(text, "ball") == (("contacts",) if touch else ())


@pytest.mark.parametrize("name", model_names())
def test_shipped_robots_have_nothing_to_tell(name: str) -> None:
    robot = load_robot(name)
    assert robot.left_out == () and robot.notes == ()


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rough") / "rough.xml"
    path.write_text(planar((SLIDE, f'{SLIDE} range="-1 1" frictionloss="0.1"'), TOUCH))
    return path


def test_the_robot_tells_in_a_sentence(rough: Path) -> None:
    (note,) = load_robot(rough).notes
    assert note.startswith(f"{rough} has joint limits, dry friction and contacts: left out here")


@pytest.mark.parametrize(
    "words",
    [
        ["pose", "ROBOT", "0.4", "0", "0.2", "--alone"],
        ["sweep", "ROBOT", "--line", "0.4", "0", "0.2", "0.5", "0", "0.2", "--count", "2"],
        ["correct", "ROBOT", "POSES"],
        ["map", "ROBOT", "--grid", "0.4", "0", "0.2:0.25:2", "--no-elastic"],
        ["export", "ROBOT", "OUT/out.xml"],
    ],
    ids=lambda words: words[0],
)
def test_every_command_tells_it_once(rough: Path, tmp_path: Path, words: list[str]) -> None:
    (tmp_path / "poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0,0.2\n")
    places = {"ROBOT": str(rough), "POSES": str(tmp_path / "poses.csv")}
    args = [places.get(word, word).replace("OUT", str(tmp_path)) for word in words]
    if words[0] in ("sweep", "map"):
        args += ["--no-recording", "--figure", "none"]
    got = CliRunner().invoke(main, [*args, *(["--out", str(tmp_path)] * (words[0] != "export"))])
    assert got.exit_code == 0, got.output
    assert got.stdout.count("left out here") == 0
    assert got.stderr.splitlines().count(f"note: {load_robot(rough).notes[0]}") == 1
