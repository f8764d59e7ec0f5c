"""Trajectories are followed from rest to rest, and jumps are told."""

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
from crosscheck.settle.settler import Settler
from seecr import Commands, InputError, Robot, Term, load_robot, model_path, solve
from seecr.cli import main
from seecr.description.mjcf import model_names
from seecr.effects.setup import plain_setup
from seecr.equilibrium.following import _flow
from seecr.equilibrium.strange import strained, strained_rows, strange
from seecr.pose import Array, pose_difference, quat_from_rotvec
from seecr.show.batch_words import jump_lines
from seecr.show.files import SweepRows
from seecr.statics.tables import assemble


def parallel(softer: float = 1.0) -> Robot:
    robot = load_robot("demobot_parallel")
    return replace(robot, ea=softer * robot.ea)


def tilted(*numbers: float) -> Array:
    pose = np.array(numbers)
    pose[3:] /= np.linalg.norm(pose[3:])
    return pose


def turning_over(first: float, last: float, n: int) -> Commands:
    """Turned about x from an angle to another [deg], starting at the first."""
    poses = np.tile(parallel().reference_pose, (n, 1))
    turn = np.zeros((n, 3))
    turn[:, 0] = np.radians(np.linspace(first, last, n))
    poses[:, 3:] = quat_from_rotvec(turn)
    return Commands(poses, stands=np.ones(n, dtype=bool))


def test_a_flow_comes_to_rest_where_a_cable_goes_slack_on_the_way() -> None:
    """A Newton step that leads up there, and the next one back, alternated for ever."""
    robot = load_robot("demobot_cogiro")
    command = Commands(np.array([[0.5, 0.5, 0.3, *robot.reference_pose[3:]]]))
    tables = assemble(plain_setup(robot, command))
    beside_a_saddle = tilted(0.48997, 0.4229, 0.30211, 0.67045, 0.72269, -0.11626, -0.12125)
    there, _over = _flow(robot, tables, beside_a_saddle[None], 1.0)
    rest = solve(robot, command.pose, start=there)
    assert np.abs(there[0, :3] - rest.pose[0, :3]).max() < 1e-6
    assert rest.converged[0] and np.linalg.eigvalsh(rest.stiffness[0])[0] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("softer", "command", "energy", "apart", "turned"),
    [
        (1.0, (0.351, 0.216, 0.109, 0.943, 0.163, -0.288, -0.038), -0.01533, 15.7, 26.2),
        (0.1, (0.189, 0.41, 0.143, 0.956, -0.218, 0.196, -0.001), -0.03137, 4.7, 19.2),
    ],
)
def test_the_reference_pose_leads_to_the_other_rest(
    softer: float, command: tuple[float, ...], energy: float, apart: float, turned: float
) -> None:
    robot, pose = parallel(softer), tilted(*command)
    led, own = solve(robot, pose, follow=True), solve(robot, pose)
    assert led.converged.all() and led.jumps == ((),)
    assert led.energy[0] == pytest.approx(energy, abs=1e-5)
    away = pose_difference(led.pose, own.pose)[0]
    assert 1e3 * np.linalg.norm(away[:3]) == pytest.approx(apart, abs=0.1)
    assert np.degrees(np.linalg.norm(away[3:])) == pytest.approx(turned, abs=0.1)
    # in 300 steps, each solved from the rest before
    rest = robot.reference_pose[None]
    way = pose_difference(pose, robot.reference_pose)
    for part in np.linspace(0.0, 1.0, 301):
        at = np.concatenate([robot.reference_pose[:3] + part * way[:3],
                             quat_from_rotvec(part * way[3:])])  # fmt: skip
        rest = solve(robot, at, start=rest).pose
    np.testing.assert_allclose(rest[0], led.pose[0], atol=1e-8)


@pytest.mark.slow
def test_where_a_rest_ends_the_platform_jumps() -> None:
    robot = parallel()
    led = solve(robot, turning_over(140.0, 155.0, 2), follow=True)
    assert led.jumps is not None
    (jump,) = led.jumps[1]
    assert led.jumps[0] == () and led.rows([1]).jumps == ((jump,),)
    # however it is cut into rows: a chord of the lengths would lead past the fold
    finer = solve(robot, turning_over(140.0, 155.0, 8), follow=True)
    assert finer.jumps is not None
    (same,) = [one for jumps in finer.jumps for one in jumps]
    assert np.abs(pose_difference(same.command, jump.command)).max() < 1e-6
    np.testing.assert_allclose(finer.pose[-1], led.pose[-1], atol=1e-9)
    # before the fold it has the rest that was followed, after it another
    angle = 2.0 * np.degrees(np.arctan2(jump.command[4], jump.command[3]))
    before, after = turning_over(angle - 1e-4, angle + 1e-4, 2).pose
    near = solve(robot, before, start=jump.before[None])
    assert near.converged.all() and near.smallest_eigenvalue[0] < 0.02 * led.smallest_eigenvalue[0]
    assert np.abs(pose_difference(near.pose[0], jump.before)).max() < 1e-3
    far = solve(robot, after, start=jump.after[None])
    assert np.abs(pose_difference(far.pose[0], jump.after)).max() < 1e-4
    assert jump.certain and jump.energy > 0.0
    assert np.degrees(np.linalg.norm(jump.size[3:])) == pytest.approx(6.06, abs=0.01)
    # MuJoCo's own dynamics lead there too
    settler = Settler(model_path("demobot_parallel"))
    settled = settler.settle(jump.before, robot.commanded_lengths(after[None])[0])
    assert np.abs(pose_difference(settled.pose, jump.after)).max() < 1e-4
    line, places = jump_lines(led)
    there = [", ".join(f"{1e3 * x:.1f}" for x in one[:3]) for one in (jump.before, jump.after)]
    assert places == f"  from {there[0]} mm to {there[1]} mm"
    lost = replace(led, jumps=((), (replace(jump, after=np.full(7, np.nan)),)))
    assert list(jump_lines(lost))[1] == f"  it was last at {there[0]} mm"
    assert line.startswith(
        f"on the path to pose 1, at command 400.0, 250.0, 150.0 mm, turned by {angle:.2f}, 0.00, "
        "0.00 deg about x y z: its equilibrium ends"
    )
    assert SweepRows(led).as_json()[1]["jumps"][0].as_json()["energy_J"] == jump.energy


@pytest.mark.slow
def test_a_way_back_ends_where_it_began_and_lengths_are_followed_alike() -> None:
    robot = load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[1, 0] += 0.005
    led = solve(robot, poses, follow=True)
    np.testing.assert_allclose(led.pose[2], led.pose[0], atol=1e-9)
    assert list(jump_lines(led)) == [
        "followed from the reference pose: the platform does not jump on the path"
    ]
    assert list(jump_lines(solve(robot, poses[0]))) == []
    told = solve(robot, rest_lengths=led.rest_lengths, follow=True)
    np.testing.assert_allclose(told.pose, led.pose, atol=1e-9)


@pytest.mark.slow
def test_what_does_not_go_with_following_is_refused() -> None:
    robot = parallel()
    with pytest.raises(InputError, match="expected no other method and no start"):
        solve(robot, robot.reference_pose, follow=True, method="fsolve")
    friction = [Term.of(robot, "hysteresis", amplitude_N=0.1)]
    with pytest.raises(InputError, match="solved along the path; leave follow out"):
        solve(robot, robot.reference_pose, follow=True, effects=friction)


# --- Robots that are hardly meant so are told with the likely cause; others are not


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
