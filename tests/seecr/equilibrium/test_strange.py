"""Robots that are hardly meant so are told with the likely cause; others are not."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import ran
from click.testing import CliRunner

import seecr
from crosscheck.planning.design import make_plan
from seecr import Commands, load_robot, model_path, solve
from seecr.cli import main
from seecr.description.mjcf import model_names
from seecr.equilibrium.strange import strained, strained_rows, strange

EXITS = np.array([[x, y, z] for x in (-3.0, 3.0) for y in (-2.0, 2.0) for z in (2.9, 3.0)])
ANCHORS = np.array(
    [[0.1 * x, 0.1 * y, h] for x in (-3.0, 3.0) for y in (-2.0, 2.0) for h in (-0.25, 0.25)]
)
HERE = np.array([0.2, 0.1, 1.0])


def hall(
    path: Path, of: np.ndarray = HERE, place: np.ndarray | None = HERE, unit: float = 1.0,
    gravity: str = "0 0 -9.81", stiffness: float = 20000.0, strain: float = 1e-3,
) -> Path:  # fmt: skip
    """A robot whose rest lengths are those of the pose ``of``, and whose body is at ``place``."""
    lengths = np.linalg.norm(EXITS - of - ANCHORS, axis=1) / (1.0 + strain)

    def at(point: np.ndarray) -> str:
        return " ".join(repr(float(unit * value)) for value in point)

    exits = "".join(f'<site name="a{i}" pos="{at(p)}"/>' for i, p in enumerate(EXITS))
    anchors = "".join(f'<site name="b{i}" pos="{at(p)}"/>' for i, p in enumerate(ANCHORS))
    ropes = "".join(
        f'<spatial springlength="0 {float(unit * length)!r}" stiffness="{stiffness}">'
        f'<site site="a{i}"/><site site="b{i}"/></spatial>'
        for i, length in enumerate(lengths)
    )
    pos = "" if place is None else f'pos="{at(place)}"'
    path.write_text(
        f'<mujoco><option gravity="{gravity}"/><worldbody>{exits}<body {pos}><freejoint/>'
        f'<inertial pos="0 0 0" mass="25" diaginertia="1 1 1"/>{anchors}</body></worldbody>'
        f"<tendon>{ropes}</tendon></mujoco>"
    )
    return path


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"gravity": "0 0 9.81"}, ("gravity points up (0 0 9.81 m/s^2", "a minus sign missing")),
        ({"gravity": "0 3 9"}, ("gravity points up (0 3 9 m/s^2",)),
        ({"unit": 1000.0}, ("the frame is 7.21 km wide: is it in millimetres?",)),
        ({"unit": 300.0}, ("the frame is 2.16 km wide",)),
        ({"of": HERE + np.array([0.4, 0.3, 0.05]), "strain": 0.0}, (
            "rest lengths are not those of the reference pose", "they fit the platform 50",
            "mm away, at 0.6 0.4 1.05 m", "is springlength that of another pose?")),
        ({"of": HERE + np.array([0.0, -0.9, 0.2])}, ("they fit the platform 922 mm away",)),
        ({"place": None, "strain": 0.0},
         ("they fit the platform 1025 mm away", "platform's body missing?")),
        ({"place": None, "of": np.array([0.4, 0.3, 1.72]), "strain": 0.0},
         ("they fit the platform 1791 mm",)),
        ({"stiffness": 200.0, "gravity": "0 0 -98.1"}, ("strained by",)),
    ],
)  # fmt: skip
def test_what_no_robot_has_is_told_with_its_cause_before_any_result(
    parts: dict[str, object], words: tuple[str, ...], tmp_path: Path
) -> None:
    path = hall(tmp_path / "robot.xml", **parts)  # type: ignore[arg-type]
    (said,) = strange(seecr.load_robot(path))
    assert said.startswith(f"{path}: ")
    for word in words:
        assert word in said
    x, y, z = seecr.load_robot(path).reference_pose[:3]
    answer = ran(f"seecr pose {path} {x} {y} {z} --alone --json")
    assert f"note: {said}\n" in answer.stderr and not answer.stdout.startswith("note")


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"strain": -0.02},  # long cables, that hang loosely where they are zeroed
        {"strain": 0.04},  # as much as Dyneema stretches before it breaks
        {"of": HERE + np.array([0.03, 0.0, 0.0])},
        {"gravity": "0 -9.81 0"},  # y is up
        {"gravity": "0 0 0"},
    ],
)
def test_nothing_is_said_of_what_robots_have(parts: dict[str, object], tmp_path: Path) -> None:
    assert strange(seecr.load_robot(hall(tmp_path / "robot.xml", **parts))) == ()  # type: ignore[arg-type]


def test_rubber_that_holds_it_where_it_is_drawn_is_of_no_other_pose() -> None:
    """Two lines of 10 % strain carry the weight: fewer cables than freedoms fit any pose."""
    robot = seecr.load_robot("planar_two_cable")
    home = robot.reference_pose
    ea = np.full(2, 6.0 * robot.weight)
    soft = replace(robot, ea=ea)
    for _ in range(60):  # rest lengths with which it rests where it is drawn
        there = seecr.solve(soft, home)
        strain = there.tensions[0] / ea
        soft = replace(robot, ea=ea, rest_lengths=robot.reference_lengths / (1.0 + strain))
    assert np.max(soft.reference_lengths / soft.rest_lengths - 1.0) > 0.05
    assert not any("another pose" in said or "missing" in said for said in strange(soft))


@pytest.mark.parametrize("name", model_names())
def test_shipped_robots_are_not_strange(name: str) -> None:
    assert strange(seecr.load_robot(name)) == ()


# --- Cables strained as no rope is: most likely a number in another unit


def test_what_a_rest_length_or_a_stiffness_too_small_does_is_told() -> None:
    robot = load_robot("demobot_cogiro")
    short = robot.rest_lengths.copy()
    short[3] *= 0.6
    (note,) = strained(replace(robot, rest_lengths=short))
    assert f"{robot.source}: cable4 is strained by 66.7 % at the reference pose" in note
    assert "is springlength about the distance of the sites [m], are stiffness in N/m" in note
    # 3 N per strain of one: the weight stretches the cables
    (note,) = strained(replace(robot, ea=np.full(8, 3.0)))
    assert "cable1, cable2 and 6 more are strained by up to" in note


def test_one_cable_is_one() -> None:
    """In closed form: a weight of 2 N on a cable of 10 N per strain of one."""
    robot = load_robot("planar_vertical")
    bob = replace(
        robot, exit_points=[[0.4, 0.0, 1.0]], anchor_points=[[0.0, 0.0, 0.0]], ea=[10.0],
        rest_lengths=[0.8], mass=2.0 / 9.81, cable_names=("rope",), joints=robot.joints[1:2],
        centre_of_mass=np.zeros(3), reference_pose=[0.4, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0],
    )  # fmt: skip
    (note,) = strained(bob)
    assert "rope is strained by 20 % at the reference pose" in note
    assert strained(replace(bob, ea=[20.1])) == ()


def test_of_rows_the_most_strained_one_is_told() -> None:
    """In closed form: cables of 0.2 m stretched to the 0.4 m between exits and bar."""
    robot = load_robot("planar_two_cable")
    at = np.tile(robot.reference_pose, (3, 1))
    rows = Commands(at, lengths=np.array([[0.6, 0.6], [0.2, 0.2], [0.21, 0.21]]))
    found = solve(robot, rows)
    (note,) = strained_rows(found)
    assert "cable1, cable2 are strained by up to 100 % at pose 1, which is much for a rope" in note
    (note,) = strained_rows(replace(found, line=np.array([2, 3, 4])))
    assert "at line 3," in note
    assert strained_rows(found.rows(np.array([0]))) == ()
    (note,) = strained_rows(found.rows(np.array([1])))
    assert "where the platform rests," in note


def test_a_robot_that_is_told_to_be_strained_is_so_in_all_rows() -> None:
    robot = replace(load_robot("demobot_cogiro"), ea=np.full(8, 3.0))
    assert strained(robot) and strained_rows(solve(robot, robot.reference_pose)) == ()


@pytest.mark.parametrize("command", ["sweep", "pose", "correct"])
def test_every_command_tells_of_strained_rows_once(command: str, tmp_path: Path) -> None:
    """Of lengths that strain cables by all their length nothing was said."""
    (tmp_path / "len.csv").write_text("length_1_m,length_2_m\n0.6,0.6\n0.2,0.2\n")
    (tmp_path / "cmd.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.5,0,0.9\n")
    words, said = {
        "sweep": ([tmp_path / "len.csv", "--out", tmp_path / "s"], " 100 % at line 3, "),
        "pose": (["0.5", "0", "0.95", "--cable", "30", "--alone"], " % where the platform rests, "),
        "correct": (
            [tmp_path / "cmd.csv", "--cable", "60", "--highest", "90", "--out", tmp_path / "c"],
            " % at line 2, ",
        ),
    }[command]
    words = ["planar_two_cable", *map(str, words)]
    out = CliRunner().invoke(main, [command, *words]).stdout
    assert out.count("which is much for a rope") == 1 and said in out


@pytest.mark.slow
def test_it_is_told_where_notes_on_a_robot_are(tmp_path: Path) -> None:
    text = model_path("demobot_cogiro").read_text()
    (tmp_path / "soft.xml").write_text(
        re.sub(r'stiffness="([^"]*)"', lambda m: f'stiffness="{float(m[1]) / 1e3}"', text)
    )
    said = "strained by up to "
    words = ["pose", str(tmp_path / "soft.xml"), "0.4", "0.25", "0.15", "--alone"]
    assert said in CliRunner().invoke(main, words).stderr
    robot = load_robot(tmp_path / "soft.xml")
    poses = np.tile(robot.reference_pose, (7, 1))
    poses[:, 2] += np.linspace(0.0, 0.06, 7)
    assert any(said in note for note in make_plan(robot, poses).notes)
