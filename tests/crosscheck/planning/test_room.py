"""Poses that are chosen or proposed may be run as they are, on robots of every kind."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import ran, refused_in_a_line
from robots import WAYS, rejointed, turned
from scipy import optimize

import crosscheck
from crosscheck.planning.design import candidate_poses
from crosscheck.planning.planned import Adding
from crosscheck.planning.room import Room
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.pose import Array, rotvec_from_quat, transform_points

pytestmark = pytest.mark.slow

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])

# Two exit points on a wall, a gondola of 0.35 kg on two slides.
PLOTTER = """<mujoco model="plotter"><worldbody>
  <site name="A1" pos="-0.7 0 0"/><site name="A2" pos="0.7 0 0"/>
  <body pos="0 0 -0.6"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="0.35" diaginertia="0.0035 0.0035 0.0035"/>
    <site name="B1"/><site name="B2"/></body></worldbody><tendon>
  <spatial name="c1" springlength="0 0.921954446" stiffness="3253.95687"><site site="A1"/>
    <site site="B1"/></spatial>
  <spatial name="c2" springlength="0 0.921954446" stiffness="3253.95687"><site site="A2"/>
    <site site="B2"/></spatial></tendon></mujoco>"""


@pytest.fixture(scope="module")
def plotter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plotter") / "plotter.xml"
    path.write_text(PLOTTER)
    return path


def plotter_at(command: Array, mass: float = 0.35) -> tuple[Array, Array]:
    """Where the gondola comes to rest and its tensions, from its energy by SciPy alone."""
    exits, length, home = np.array([[-0.7, 0.0], [0.7, 0.0]]), 0.921954446, [0.0, -0.6]
    ea = 3253.95687 * length
    rest = length + np.linalg.norm(command - exits, axis=1) - np.linalg.norm(home - exits, axis=1)

    def energy(p: Array) -> float:
        stretch = np.maximum(np.linalg.norm(p - exits, axis=1) - rest, 0.0)
        return float(np.sum(0.5 * ea / rest * stretch**2) + mass * 9.81 * p[1])

    found = optimize.minimize(energy, command, method="Nelder-Mead",
                              options={"xatol": 1e-12, "fatol": 1e-15})  # fmt: skip
    stretch = np.linalg.norm(found.x - exits, axis=1) - rest
    return found.x, ea / rest * stretch


def test_a_plotter_stays_away_from_the_line_of_its_exit_points(plotter: Path) -> None:
    """It was sent 1.4 mm under it, where it rests 72 mm lower."""
    chosen = crosscheck.choose_poses(plotter, 30)
    near = np.array([[0.1 * k, 0.0, -0.05, *LEVEL] for k in range(-4, 5)])
    plan = crosscheck.make_plan(plotter, near)
    proposed = next(s for s in plan.suggestions if s.kind is Adding.POSES).poses
    assert chosen.command_pose is not None and proposed is not None
    for poses in (chosen.command_pose, proposed):
        rest = [plotter_at(pose[[0, 2]]) for pose in poses]
        at, pulls = np.array([one for one, _ in rest]), np.array([one for _, one in rest])
        assert np.linalg.norm(at - poses[:, [0, 2]], axis=1).max() < 0.015
        assert pulls.min() > 0.1 * 1.7 and pulls.max() < 25.0
        assert np.all(np.abs(at[:, 0]) <= 0.8 * 0.7 + 1e-9)  # 10 % of the width at each side
    assert chosen.command_pose[:, 2].max() < -0.1 * (0.6 + 0.35 / 0.9 * 0.6) + 1e-9  # and above
    # what it says of its own poses is what SciPy finds
    own = crosscheck.make_plan(plotter, chosen).demand
    rest = [plotter_at(pose[[0, 2]]) for pose in chosen.command_pose]
    pulls = np.array([one for _, one in rest])
    off = max(np.linalg.norm(at - pose[[0, 2]])
              for (at, _), pose in zip(rest, chosen.command_pose, strict=True))  # fmt: skip
    assert own is not None and own.off_m == pytest.approx(off, rel=1e-4)
    assert own.tensions_N == pytest.approx([pulls.min(), pulls.max()], rel=1e-5)


ROBOTS = ["demobot_parallel", "demobot_cogiro", "cogiro_large", "ipanema", "camera",
          "planar_vertical", "planar_horizontal", "planar_two_cable"]  # fmt: skip


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_chosen_or_proposed_may_be_run(name: str) -> None:
    """Level, in the frame, above the floor, tensions a few times the usual, taut where it can."""
    robot = load_robot(name)
    chosen = crosscheck.choose_poses(robot, 24).command_pose
    assert chosen is not None
    home = robot.reference_pose[:3]
    few = chosen[np.argsort(np.linalg.norm(chosen[:, :3] - home, axis=1))[:8]]
    added = [s.poses for s in crosscheck.make_plan(robot, few).suggestions if s.poses is not None]
    usual = float(np.median(solve(robot, chosen).tensions.max(axis=1)))
    low, high = robot.exit_points.min(axis=0), robot.exit_points.max(axis=0)
    for poses in (chosen, *added):
        rest = solve(robot, poses)
        assert rest.converged.all() and not rest.slack.any()
        assert np.abs(rotvec_from_quat(poses[:, 3:])).max() < 1e-12
        anchors = transform_points(rest.pose, robot.anchor_points)
        wide = np.ptp(robot.exit_points, axis=0) > 1e-3
        assert np.all((anchors > low) & (anchors < high), axis=(0, 1))[:2][wide[:2]].all()
        assert anchors[..., 2].max() < high[2] and anchors[..., 2].min() > 0.0
        assert rest.tensions.max() < 3.0 * usual and rest.tensions.min() > 0.05 * usual


def test_a_room_has_the_faces_of_its_frame() -> None:
    """A frame with a trapezium for its plan, by plane geometry; a tenth of a millimetre apart."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [3.0, 2.0], [1.0, 2.0]])
    exits = np.array([[x, y, 3.0] for x, y in corners])
    cogiro = load_robot("demobot_cogiro")
    robot = replace(
        cogiro, exit_points=np.concatenate([exits, exits]), anchor_points=np.zeros((8, 3)),
        floor=0.0, reference_pose=np.array([2.0, 1.0, 1.0, *LEVEL]), rest_lengths=np.full(8, 2.0),
    )  # fmt: skip
    room = Room.of(robot)
    normal = np.array([2.0, 1.0]) / np.sqrt(5.0)  # of the side from (4, 0) to (3, 2)
    width = np.ptp(corners @ normal)
    edge = corners[1] @ normal - 0.1 * width
    for far, inside in ((-1e-4, True), (1e-4, False)):
        there = np.append((edge + far) * normal, 1.0)
        assert room.holds(np.concatenate([there, LEVEL])[None]).tolist() == [inside]
        for height, sign in ((3.0 - 0.3, 1.0), (0.3, -1.0)):
            pose = np.array([2.0, 1.0, height + sign * far, *LEVEL])
            assert room.holds(pose[None]).tolist() == [inside]
    # with a box the frame itself is the room; a floor of one's own replaces that of the file
    box = Room.of(robot, box=[[-9.0] * 3, [9.0] * 3], floor=-1.0)
    assert box.holds(np.array([[2.0, 1.0, 2.99, *LEVEL], [2.0, 1.0, -0.99, *LEVEL]])).all()
    assert not box.holds(np.array([[2.0, 1.0, 3.01, *LEVEL], [2.0, 1.0, -1.01, *LEVEL]])).any()
    assert not box.holds(np.full((1, 7), np.nan)).any()


def test_a_platform_that_is_outside_its_frame_may_move_there(tmp_path: Path) -> None:
    """A link on a hinge whose anchor points are above its exit points."""
    path = tmp_path / "link.xml"
    path.write_text("""<mujoco model="link"><worldbody>
      <site name="a1" pos="-0.4 0 0.1"/><site name="a2" pos="0.4 0 0.1"/>
      <body name="link"><joint type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 0.25" mass="0.8" diaginertia="0.01 0.01 0.01"/>
        <site name="b1" pos="-0.03 0 0.3"/><site name="b2" pos="0.03 0 0.3"/></body></worldbody>
      <tendon><spatial name="left" springlength="0 0.4198" stiffness="3000"><site site="a1"/>
        <site site="b1"/></spatial>
      <spatial name="right" springlength="0 0.4198" stiffness="3000"><site site="a2"/>
        <site site="b2"/></spatial></tendon></mujoco>""")
    poses = crosscheck.choose_poses(path, 12).command_pose
    assert poses is not None and len(np.unique(poses.round(9), axis=0)) == 12
    assert solve(load_robot(path), poses).converged.all()


def test_the_command_asks_for_tilts_a_floor_and_limits(tmp_path: Path) -> None:
    robot, out = load_robot("demobot_cogiro"), tmp_path / "p"
    asked = "--rows 24 --tilt 8deg --floor 0.1 --highest 1.5"
    printed = ran(f"crosscheck plan {robot.source} {asked} --out {out}", 0).stdout
    assert "these poses: tensions" in printed and "off the command" in printed
    poses = crosscheck.load_commands(out / "poses.csv", robot).command_pose
    assert poses is not None
    turned = np.linalg.norm(rotvec_from_quat(poses[:, 3:]), axis=1)
    assert turned.max() == pytest.approx(np.radians(8.0), rel=1e-6)
    rest = solve(robot, poses)
    assert transform_points(rest.pose, robot.anchor_points)[..., 2].min() > 0.1
    assert rest.tensions.max() <= 1.5
    told = json.loads((out / "plan.json").read_text())["demand"]
    ends = [rest.tensions.min(), rest.tensions.max()]
    assert told["tensions_N"] == pytest.approx(ends, rel=1e-6)
    off = np.linalg.norm(rest.deviation[:, :3], axis=1).max()
    assert told["off_m"] == pytest.approx(off, rel=1e-3)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("--tilt 8", "--tilt: expected a number with its unit"),
        ("--tilt 8mm", "--tilt: expected a number with its unit"),
        ("--tilt 120deg", "tilt must be an angle from 0 to pi/2"),
        ("--floor nan", "not a finite number"),
        ("--floor 0.3", "floor must be a height below the reference pose, 0.15 m, got 0.3"),
        ("--floor low", "expected a number"),
        ("--lowest 5 --highest 1", "0 <= lowest <= highest"),
        ("--lowest -1", "0 <= lowest <= highest"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_for_is_told(asked: str, words: str, tmp_path: Path) -> None:
    given = f"crosscheck plan demobot_cogiro --rows 12 {asked} --out {tmp_path / 'p'}"
    assert words in " ".join(refused_in_a_line(given).split())
    assert not (tmp_path / "p").exists()


# without its floor, which is a height along z
COGIRO = replace(load_robot("demobot_cogiro"), floor=None)


@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_vertical"])
def test_candidates_of_a_robot_with_z_down_are_those_of_the_same_one_with_z_up(name: str) -> None:
    robot = replace(load_robot(name), floor=None)
    other, turn = turned(robot, [np.pi, 0.0, 0.0])
    own, there = (candidate_poses(Room.of(one)) for one in (robot, other))
    np.testing.assert_allclose(there[:, :3], own[:, :3] @ turn.T, atol=1e-12)


@pytest.mark.parametrize("rotvec", [[np.pi, 0.0, 0.0], [0.0, 0.5, 0.2]])
def test_candidates_are_as_far_below_and_above_home_whichever_way_that_is(
    rotvec: list[float],
) -> None:
    other, _turn = turned(COGIRO, rotvec)
    heights = [
        (candidate_poses(Room.of(robot))[:, :3] - robot.reference_pose[:3]) @ robot.up
        for robot in (COGIRO, other)
    ]
    np.testing.assert_allclose(*(np.unique(some.round(9)) for some in heights), atol=1e-9)


@pytest.mark.parametrize("way", WAYS)
def test_poses_of_robots_on_joints_stay_in_the_box_that_was_asked_for(way: str) -> None:
    """A hinge beside the origin, or before the slides, carried half of them out of it."""
    planar = load_robot("planar_vertical")
    middle, half = planar.reference_pose[:3], np.array([0.02, 1.0, 0.02])
    box = np.array([middle - half, middle + half])
    room = Room.of(rejointed(planar, way), box=box, tilt=0.2)
    place = candidate_poses(room)[:, :3]
    assert len(place) > 30 and np.all((place >= box[0]) & (place <= box[1]))
