"""Lower equilibria beside those of many commands are told, and no others."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import BARE, as_json, drawn_bare, following, ran
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from seecr import (
    InputError,
    Robot,
    Term,
    equilibria,
    load_model,
    load_robot,
    lower_equilibria,
    model_path,
    solve,
)
from seecr.description.joints import pose_of_values
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply, transform_points

# Commanded here, the robot rests 15.7 mm and 26 deg from a lower equilibrium.
KNOWN = np.array([0.351, 0.216, 0.109, 0.943, 0.163, -0.288, -0.038])
KNOWN[3:] /= np.linalg.norm(KNOWN[3:])


def turned_commands(robot: Robot, n: int, random: np.random.Generator) -> Array:
    """Poses (n, 7) all over the frame, tilted up to 80 degrees."""
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, :3] += 0.35 * np.ptp(robot.exit_points, axis=0) * random.uniform(-1, 1, (n, 3))
    axes = random.normal(size=(n, 3))
    axes *= np.deg2rad(random.uniform(0, 80, (n, 1))) / np.linalg.norm(axes, axis=1, keepdims=True)
    poses[:, 3:] = quat_multiply(quat_from_rotvec(axes), poses[:, 3:])
    return poses


def turns(poses: Array, others: Array) -> Array:
    return np.linalg.norm(pose_difference(poses, others)[:, 3:], axis=1)


def energies(robot: Robot, lengths: Array, poses: Array) -> Array:
    """Energy (n,) [J] of springs and weight, by hand."""
    spans = transform_points(poses, robot.anchor_points) - robot.exit_points
    stretch = np.maximum(np.linalg.norm(spans, axis=2) - lengths, 0.0)
    centre = transform_points(poses, robot.centre_of_mass[None])[:, 0]
    return 0.5 * np.sum(robot.ea / lengths * stretch**2, 1) - robot.mass * centre @ robot.gravity


@pytest.mark.slow
def test_most_of_what_hundreds_of_starts_find_is_found_and_is_lower() -> None:
    there, missed = 0, 0
    for name in ("demobot_parallel", "demobot_cogiro", "cogiro_large", "ipanema"):
        robot, random = load_robot(name), np.random.default_rng(11)
        own = solve(robot, turned_commands(robot, 300, random))
        found, known = lower_equilibria(own), np.zeros(300, dtype=bool)
        at = own.pose[found.rows]
        assert found.found.converged.all() and found.found.verify().holds.all()
        assert np.all(turns(found.found.pose, at) < np.pi / 2)
        lengths = own.rest_lengths[found.rows]
        less = energies(robot, lengths, found.found.pose) - energies(robot, lengths, at)
        assert np.all(less < 0.0)
        np.testing.assert_allclose(found.energy, less, rtol=1e-6)
        rows, size = np.flatnonzero(own.converged), 0.5 * robot.length
        for _ in range(200):
            start = own.pose[rows].copy()
            start[:, :3] += random.uniform(-size, size, (len(rows), 3))
            start[:, 3:] = Rotation.random(len(rows), random).as_quat()[:, [3, 0, 1, 2]]
            end = solve(robot, own.command[rows], start=start)
            lower = end.converged & (end.energy < own.energy[rows] - 1e-6 * robot.weight * size)
            known[rows[lower & (turns(end.pose, own.pose[rows]) < np.pi / 2)]] = True
        there += int(known.sum())
        missed += int(np.sum(known[np.setdiff1d(np.arange(300), found.rows)]))
    assert there >= 35 and missed <= 0.1 * there


def test_sagging_cables_are_searched_as_straight_ones_and_solved_as_they_are() -> None:
    robot, random = load_robot("cogiro_large"), np.random.default_rng(11)
    model = load_model(model_path("cogiro_large").with_name("sag.toml"), robot)
    own = solve(robot, turned_commands(robot, 300, random), effects=model)
    found = lower_equilibria(own)
    rows = found.rows
    there = solve(robot, own.command[rows], effects=model, start=found.found.pose)
    np.testing.assert_allclose(there.pose, found.found.pose, atol=1e-8)
    assert np.all(there.converged) and np.all(there.energy < own.energy[rows] - 1e-3)
    assert np.all(turns(there.pose, own.pose[rows]) < np.pi / 2)
    known = np.zeros(300, dtype=bool)
    for _ in range(12):
        start = own.pose.copy()
        turn = quat_from_rotvec(1.3 * random.normal(size=(300, 3)))
        start[:, 3:] = quat_multiply(turn, start[:, 3:])
        end = solve(robot, own.command, effects=model, start=start)
        lower = end.converged & own.converged & (end.energy < own.energy - 1e-3)
        known |= lower & (turns(end.pose, own.pose) < np.pi / 2)
    assert known.sum() >= 7 and np.sum(known[rows]) >= known.sum() - 1


def test_the_known_one_moved_and_turned_with_its_robot() -> None:
    robot = load_robot("demobot_parallel")
    plain = lower_equilibria(solve(robot, [robot.reference_pose, KNOWN]))
    by, to = Rotation.from_rotvec([0.5, -1.1, 2.0]), np.array([3.0, -2.0, 0.7])

    def carried(poses: Array) -> Array:
        turn = by * Rotation.from_quat(poses[:, [4, 5, 6, 3]])
        return np.concatenate(
            [by.apply(poses[:, :3].copy()) + to, turn.as_quat()[:, [3, 0, 1, 2]]], 1
        )

    elsewhere = replace(
        robot, exit_points=by.apply(robot.exit_points.copy()) + to,
        gravity=by.apply(robot.gravity.copy()),
        reference_pose=carried(robot.reference_pose[None])[0],
    )  # fmt: skip
    commands = carried(np.array([robot.reference_pose, KNOWN]))
    there = lower_equilibria(solve(elsewhere, commands))
    searched = equilibria(robot, KNOWN)
    for one in (plain, there):
        assert one.sought == 2 and list(one.rows) == [1] and one.deepest == 0
        np.testing.assert_allclose(one.energy, [searched.energy[0] - searched.energy[1]], rtol=1e-6)
        assert one.barrier.energy == pytest.approx(6.80e-5, rel=1e-3)
    expected = carried(searched.pose[:1])
    np.testing.assert_allclose(pose_difference(there.found.pose, expected), 0.0, atol=1e-7)
    (line,) = there.lines()
    assert line == (
        "lower equilibria at 1 of 2 poses (a short search, which may miss some); the deepest at "
        "pose 1: could also rest 15.71 mm and 26.16 deg away, -1.612 mJ; reachable, 0.068 mJ to "
        "get there, 1.68 mJ back"
    )
    # the starts turn with the robot, so that all others are found or missed there as here
    poses = turned_commands(robot, 300, np.random.default_rng(11))
    here = lower_equilibria(solve(robot, poses)).rows
    assert len(here) > 8
    assert list(lower_equilibria(solve(elsewhere, carried(poses))).rows) == list(here)
    # from the lower one there is none
    assert len(lower_equilibria(plain.found).rows) == 0 and plain.records()[0]["row"] == 1


# A top-heavy link on a hinge along y between two cables that leave it some play: it leans on
# either of them. The energy is that of its angle alone.
LINK = """<mujoco><worldbody><site name="a0" pos="-0.38 0 0.12"/><site name="a1" pos="0.38 0 0.12"/>
<body name="link"><joint name="elbow" type="hinge" axis="0 1 0"/>
<inertial pos="0 0 0.22" mass="0.9" diaginertia="0.02 0.03 0.01"/>
<site name="b0" pos="-0.04 0 0.31"/><site name="b1" pos="0.04 0 0.31"/></body></worldbody><tendon>
<spatial name="left" springlength="0 {rest}" stiffness="{left}"><site site="a0"/><site site="b0"/>
</spatial><spatial name="right" springlength="0 0.45" stiffness="2500"><site site="a1"/>
<site site="b1"/></spatial></tendon></mujoco>"""


def leaning(rest: float, angle: float) -> float:
    """Energy [J] at an angle [rad] about y, which takes z to x."""
    c, s = np.cos(angle), np.sin(angle)
    ends = np.array([[-0.04, 0.31], [0.04, 0.31]]) @ np.array([[c, -s], [s, c]])
    spans = np.linalg.norm(ends - [[-0.38, 0.12], [0.38, 0.12]], axis=1)
    stretch = np.maximum(spans - [rest, 0.45], 0.0)
    return float(1250.0 * np.sum(stretch**2) + 0.9 * 9.81 * 0.22 * c)


@pytest.mark.parametrize("rest", [0.44, 0.45, 0.47])
def test_a_link_that_leans_on_either_of_two_cables(rest: float, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(LINK.format(rest=rest, left=2500))
    robot = load_robot(path)
    starts = pose_of_values(robot, np.deg2rad([[-15.0], [15.0]]))[0]
    own = solve(robot, np.tile(robot.reference_pose, (2, 1)), start=starts)
    sides = [
        minimize_scalar(lambda a: leaning(rest, a), bounds=ends, method="bounded").x
        for ends in ((-1.2, 0.0), (0.0, 1.2))
    ]
    hinge = 2.0 * np.arctan2(own.pose[:, 5], own.pose[:, 3])
    np.testing.assert_allclose(hinge, sides, atol=1e-5)
    assert 0.2 < hinge[1] - hinge[0] < np.pi / 2
    found = lower_equilibria(own)
    if rest == 0.45:  # both sides are alike but for rounding
        assert len(found.rows) == 0 and found.lines() == [] and found.sought == 2
        return
    # the left cable holds the link as it leans to the right, the lower the longer it is
    higher = 0 if rest > 0.45 else 1
    assert list(found.rows) == [higher]
    less = leaning(rest, sides[1 - higher]) - leaning(rest, sides[higher])
    assert found.energy[0] == pytest.approx(less, rel=1e-6) and less < -0.01
    top = minimize_scalar(lambda a: -leaning(rest, a), bounds=(-0.2, 0.2), method="bounded").x
    over = leaning(rest, top) - leaning(rest, sides[higher])
    assert found.barrier.energy == pytest.approx(over, rel=1e-6)


def test_a_robot_that_cannot_turn_has_none() -> None:
    """Its energy is convex."""
    robot, random = load_robot("camera"), np.random.default_rng(2)
    poses = np.tile(robot.reference_pose, (80, 1))
    poses[:, :3] += 0.2 * random.uniform(-1, 1, (80, 3))
    found = lower_equilibria(solve(robot, poses))
    assert not robot.turns and len(found.rows) == 0 and found.sought > 0


def test_twisted_ones_are_not_told() -> None:
    """Half a turn about the vertical away, ipanema has lower rests at the edge of its frame."""
    robot = load_robot("ipanema")
    own = solve(robot, turned_commands(robot, 300, np.random.default_rng(11)))
    found = lower_equilibria(own)
    seen = 0
    for turn in np.deg2rad([90.0, 180.0, 270.0]):
        start = own.pose.copy()
        start[:, 3:] = quat_multiply(quat_from_rotvec(np.array([0.0, 0.0, turn])), start[:, 3:])
        end = solve(robot, own.command, start=start)
        lower = end.converged & own.converged & (end.energy < own.energy - 1.0)
        seen += len(np.setdiff1d(np.flatnonzero(lower), found.rows))
    assert seen > 10
    assert np.all(turns(found.found.pose, own.pose[found.rows]) < np.pi / 2)


def test_with_history_none_is_sought_and_nothing_is_said() -> None:
    robot = load_robot("demobot_parallel")
    acting = [Term.of(robot, "hysteresis", amplitude_N=0.1)]
    found = lower_equilibria(solve(robot, KNOWN, effects=acting))
    assert found.sought == 0 and len(found.rows) == 0 and found.lines() == []
    with pytest.raises(InputError, match=r"lower_equilibria: expected a seecr\.Solution"):
        lower_equilibria(KNOWN)  # type: ignore[arg-type]


HEAD = "cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz"


def csv_of(path: Path, *poses: Array, more: str = "", value: str = "") -> Path:
    rows = [",".join([*(f"{x:.12g}" for x in pose)]) + value for pose in poses]
    path.write_text("\n".join([HEAD + more, *rows, ""]))
    return path


def test_a_sweep_tells_the_lower_one_and_looks_closer_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    level = load_robot("demobot_parallel").reference_pose
    csv_of(tmp_path / "poses.csv", level, KNOWN)
    result = ran(f"seecr sweep demobot_parallel poses.csv {BARE}", 0)
    (line,) = [one for one in result.stdout.splitlines() if "lower" in one]
    assert line.startswith("lower equilibria at 1 of 2 poses (a short search, which may miss some)")
    assert "at line 3: could also rest 15.71 mm and 26.16 deg away, -1.612 mJ; reachable" in line
    told = json.loads(Path("seecr-sweep/sweep.json").read_text())["lower"]
    (row,) = told["rows"]
    assert told["sought"] == 2 and told["deepest"] == row["row"] == 1
    assert row["energy_change_J"] == pytest.approx(-1.612e-3, rel=1e-3)
    assert told["barrier"]["energy_J"] == pytest.approx(6.8e-5, rel=1e-3)
    then = following(result)
    assert then.split()[1:4] == ["pose", "demobot_parallel", "0.351"]
    # one of those places that pose tells too
    closer = ran(then, 0).stdout
    assert "could also rest 15.71 mm and 26.16 deg away: at" in closer

    # pose cannot carry a payload: the way there tells
    csv_of(tmp_path / "loaded.csv", level, KNOWN, more=",payload_kg", value=",0.0001")
    then = following(ran(f"seecr sweep demobot_parallel loaded.csv {BARE}", 0))
    assert then.split()[1:] == ["sweep", "demobot_parallel", "loaded.csv", "--follow"]
    assert "lower equilibria" not in drawn_bare("seecr sweep demobot_parallel loaded.csv --follow")


def test_a_correction_tells_the_lower_one_and_follows_the_way_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    robot = load_robot("cogiro_large")
    edge = np.array([-6.5771, -4.8916, 1.5035, 0.9931, -0.0339, -0.106, 0.0364])
    edge[3:] /= np.linalg.norm(edge[3:])
    csv_of(tmp_path / "poses.csv", robot.reference_pose, edge)
    words = "seecr correct cogiro_large poses.csv --lowest 1 --highest 300"
    document = as_json(words, 3)
    assert document["lower"]["deepest"] == 1
    result = ran(words, 3)
    (line,) = [one for one in result.stdout.splitlines() if "lower equil" in one]
    assert "at 1 of 2 poses" in line and "at line 3: could also rest " in line
    assert result.stdout.splitlines()[-1].endswith(" seecr-correction/corrected.csv --follow")
    csv_of(tmp_path / "poses.csv", load_robot("demobot_cogiro").reference_pose)
    plain = ran("seecr correct demobot_cogiro poses.csv", 0).stdout
    assert "lower equil" not in plain and plain.endswith("seecr-correction/corrected.csv\n")
