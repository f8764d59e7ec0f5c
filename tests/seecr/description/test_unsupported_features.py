"""What an MJCF has beside cables that may hold or stop the platform, and that users are told."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest
from click.testing import CliRunner

from seecr.cli import main
from seecr.description.mjcf import load_robot, model_names, model_path, unsupported_features

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
