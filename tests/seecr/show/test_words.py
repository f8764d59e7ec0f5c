"""A pose in words."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

import seecr
from seecr.description.mjcf import model_path
from seecr.effects import Term
from seecr.equilibrium.saddles import Barrier
from seecr.pose import quat_from_rotvec
from seecr.prediction.uncertainty import Spread
from seecr.show.batch_words import span_lines, sweep_lines
from seecr.show.pose_words import (
    SAGS,
    cable_lines,
    direction_words,
    other_lines,
    pose_lines,
    stiffness_lines,
)
from seecr.workspace.spans import SlackSpan

PARALLEL = seecr.load_robot("demobot_parallel")
AT_HOME = seecr.solve(PARALLEL, [PARALLEL.reference_pose])


def test_rounding_is_no_turn() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    found = seecr.solve(robot, [robot.reference_pose])
    rounding = np.array([[1e-17, 0.0, -2e-4, 1e-19, 2e-19, 0.0]])
    text = "\n".join(pose_lines(replace(found, deviation=rounding)))
    assert re.search(r"\(0\.2 mm\), turned by 0 deg \(", text), text


def test_angles_that_are_nothing_have_no_sign() -> None:
    """A platform on stiff cables was turned by "-0.000 deg"."""
    robot = replace(seecr.load_robot("demobot_cogiro"), ea=np.full(8, 1e7))
    lines = list(pose_lines(seecr.solve(robot, [0.4, 0.25, 0.2, 1.0, 0.0, 0.0, 0.0])))
    assert not re.search(r"-0\.0*(?![0-9])", "\n".join(lines))


def test_a_large_robot_off_by_many_metres_has_no_exponent() -> None:
    found = seecr.solve(seecr.load_robot("camera"), [[200.0, 30.0, 10.0, 1, 0, 0, 0]])
    text = "\n".join([*pose_lines(found), str(found)])
    assert text.count("125032 mm") == 2 and "e+0" not in text, text


def test_a_stiff_robot_has_no_exponent() -> None:
    """A stiffness was 7.035e+05 N/m, and a frequency 1.102e+04 Hz."""
    robot = seecr.load_robot("planar_vertical")
    for stiffer, number in ((1e3, r" [1-9]\d{5} N/m"), (1e6, r", \d{5}, \d{5} Hz")):
        stiff = seecr.solve(replace(robot, ea=stiffer * robot.ea), [robot.reference_pose])
        text = "\n".join(stiffness_lines(stiff))
        assert re.search(number, text), text


def test_a_platform_that_hangs_twisted_is_told_so() -> None:
    """It may rest where no way leads from the reference pose."""
    robot = seecr.load_robot("ipanema")
    text = "\n".join(pose_lines(seecr.solve(robot, [[0.0, 0, 0, 1, 0, 0, 0]])))
    assert "hangs twisted, more than a right angle from its command" in text
    assert "twisted" not in "\n".join(pose_lines(seecr.solve(robot, [robot.reference_pose])))


def test_what_has_no_energy_gets_no_number() -> None:
    """A moment from outside has no energy: no nan is said, here or of what is between two rests."""
    robot = PARALLEL
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    tilted = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    free = seecr.solve(robot, tilted, others=True)
    assert free.others is not None
    way = [Barrier(np.nan, np.nan, tilted, False, False, "a moment has none")]
    rests = replace(free.others[0], energy=np.full(1, np.nan))
    line, why = other_lines(free, rests, way)
    assert line.startswith("could also rest 15.7") and "nan" not in line
    assert line.endswith("; reachable") and why == "no barrier can be given: a moment has none"
    assert way[0].words == f"reachable; {why}"
    (line,) = other_lines(free, free.others[0])
    assert " mJ, slack:" in line
    # a hall's energies are told in joules; a way that ends at its top takes nothing back
    hall = replace(free.others[0], energy=free.energy + 428.0)
    steep = Barrier(428.0, 1e-13, tilted, False, True)
    (line,) = other_lines(free, hall, [steep])
    assert ", +428 J, slack:" in line
    assert line.endswith("; twisted, at most 428 J to get there, next to nothing back")


def test_joints_move_along_slides_and_turn_about_hinges() -> None:
    """Names that MuJoCo gives to joints without any say nothing, and no hinge is moved along."""
    robot = seecr.load_robot("planar_vertical")
    slides, hinges = robot.joints[:2], robot.joints[2:]
    unnamed = replace(robot, joints=tuple(
        replace(joint, name=f"joint{k}") for k, joint in enumerate((*slides, *hinges))
    ))  # fmt: skip
    both = np.array([1.0, 0.0, 0.0, 0.0, 1.0 / robot.length, 0.0])
    assert direction_words(unnamed, both) == "move along x, turn about y"
    sloping = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert direction_words(unnamed, sloping) == "move along x and z"
    askew = replace(slides[0], axis=np.array([0.6, 0.0, 0.8]), name="ramp")
    ramp = replace(robot, joints=(askew, *robot.joints[1:]))
    up = np.array([-0.6, 0.0, -0.8, 0.0, 0.0, 0.0])
    assert direction_words(ramp, up) == "move along joint ramp"
    assert direction_words(ramp, sloping) == "move along x and z"


def test_other_equilibria_are_told_apart() -> None:
    """Several as far away had been lines of the same words."""
    robot, found = PARALLEL, AT_HOME
    turned = np.tile(robot.reference_pose, (2, 1))
    turned[:, 0] += [0.1, -0.1]
    lines = list(other_lines(found, replace(seecr.solve(robot, turned), energy=np.zeros(2))))
    assert len(set(lines)) == 2 and all(" mm, turned " in line for line in lines)


def test_why_there_are_no_barriers_is_said_once() -> None:
    """Every line of three had ended with the same 25 words."""
    robot, found = PARALLEL, AT_HOME
    turned = np.tile(robot.reference_pose, (3, 1))
    turned[:, 0] += [0.1, -0.1, 0.05]
    rests = seecr.solve(robot, turned)
    none = [Barrier(np.nan, np.nan, pose, False, k == 1, "a reason") for k, pose in
            enumerate(turned)]  # fmt: skip
    *lines, why = other_lines(found, rests, none)
    assert [line.split("; ")[-1] for line in lines] == ["reachable", "twisted", "reachable"]
    assert why == "no barrier can be given: a reason"
    known = Barrier(0.1, 0.2, turned[0], True, False)
    *lines, why = other_lines(found, rests, [none[0], known, none[2]])
    assert lines[1].endswith("reachable, 100 mJ to get there, 200 mJ back")
    assert "a reason" not in "".join(lines) and why.endswith(": a reason")


def test_the_furthest_is_so_by_position_and_orientation_at_once() -> None:
    """Where positions are right but for rounding, rounding had said which turned most."""
    robot = PARALLEL
    found = seecr.solve(robot, np.tile(robot.reference_pose, (2, 1)))
    off = np.array([[0.0, 0.0, 0.0, 0.0, 0.6, 0.0], [1e-15, 0.0, 0.0, 0.0, 0.1, 0.0]])
    line = replace(found, deviation=off).lines()[1]
    assert line.startswith("largest deviation from the command: pose 0, ") and "34.38 deg" in line


def test_the_largest_position_error_is_told_beside_the_largest_rotation() -> None:
    """The pose that was turned most had hidden the one that was 30 mm off."""
    robot = PARALLEL
    found = seecr.solve(robot, np.tile(robot.reference_pose, (3, 1)))
    off = np.zeros((3, 6))
    off[0, 0], off[1, 4], off[2, 0] = 0.03, 0.6, 0.01
    line = replace(found, deviation=off).lines()[1]
    assert line == (
        "largest deviation from the command: pose 0, 30 mm (0 deg); largest rotation: pose 1, "
        "34.38 deg"
    )
    off[0, 4] = 0.7
    line = replace(found, deviation=off).lines()[1]
    assert line == "largest deviation from the command: pose 0, 30 mm and 40.11 deg"


def test_what_slack_means_is_said_where_cables_have_weight() -> None:
    """On a large robot cables that pull with 180 kN are longer than the straight line."""
    robot = seecr.load_robot("cogiro_large")
    sag = seecr.load_model(model_path("cogiro_large").with_name("sag.toml"), robot)
    pose = np.array([6.0, 4.0, 1.5, 1.0, 0.0, 0.0, 0.0])
    heavy, light = seecr.solve(robot, pose, effects=sag), seecr.solve(robot, pose)
    assert heavy.slack.any() and list(cable_lines(heavy))[-1] == SAGS
    assert SAGS in sweep_lines(heavy)
    assert SAGS not in [*cable_lines(light), *sweep_lines(light)]


def test_a_pose_has_one_kind_of_minus() -> None:
    """Numbers with errors had a typographic one, the others beside them a hyphen."""
    robot = seecr.load_robot("cogiro_large")
    found = seecr.solve(robot, np.array([-3.0, -2.0, 1.5, 1.0, 0.0, 0.0, 0.0]))
    off = np.full((1, 3), 1e-3)
    spread = Spread(off, off, np.full((1, 8), 0.1), np.full((1, 6), 1e-3))
    text = "\n".join(pose_lines(found, spread=spread))
    assert "-" in text and "−" not in text


def test_ways_without_slack_cables_are_no_zones_of_them() -> None:
    """Fifteen zones of slack cables, it said of a grid on which none was slack."""
    pose = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    ways = [SlackSpan(k, (), (0.0, 1.0), pose, pose, 0.1, 0.0, (0.0, 0.0)) for k in range(15)]
    assert list(span_lines(ways)) == ["on all 15 ways no cable is slack"]
    ways[3] = replace(ways[3], slack=("c1",))
    assert list(span_lines(ways)) == ["15 zones of slack cables, with their widths, in sweep.json"]


def test_runs_of_one_pose_are_no_zones() -> None:
    """Sixty runs of one row each were 60 zones of slack cables, with their widths."""
    pose = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    points = [SlackSpan(k, ("c1",), (k, k), pose, pose, 0.0, 0.0, (0.0, 0.0)) for k in range(60)]
    assert list(span_lines(points)) == []
    there = pose + np.array([0.1, 0, 0, 0, 0, 0, 0])
    way = SlackSpan(60, ("c1",), (60.0, 61.0), pose, there, 0.1, 0.0, (0.0, 0.0))
    assert list(span_lines([*points, way])) == [
        "zones of slack cables on the way:",
        "  x 0.000 to 100.000 mm, 100.000 mm wide: 1 slack: c1",
    ]
    free = replace(way, slack=())
    assert list(span_lines([*points, free])) == ["on the only way no cable is slack"]


def test_frequencies_say_that_cables_have_no_inertia_where_that_matters() -> None:
    robot, pose = seecr.load_robot("camera"), [[52.5, 34.0, 10.0, 1, 0, 0, 0]]
    heavy, light = (
        seecr.solve(robot, pose, effects=[Term.of(robot, "cable_weight", weight_N_per_m=weight)])
        for weight in (0.5, 0.005)
    )
    cables = 0.5 * float(heavy.rest_lengths.sum()) / robot.weight
    said = [line for line in pose_lines(heavy) if "of the platform alone" in line]
    assert said == [
        f"  of the platform alone: cables weigh {100.0 * cables:.3g} % of what it does, and lower "
        "the frequencies by their inertia"
    ]
    assert not any("of the platform alone" in line for line in pose_lines(light))


def test_in_a_plane_the_turn_is_one_angle() -> None:
    """A bar upside down was turned by rx ry rz 180, -11.66, 180 deg."""
    robot = seecr.load_robot("planar_vertical")
    over = np.array([*robot.reference_pose[:3], *quat_from_rotvec(np.radians([0.0, 168.34, 0.0]))])
    found = replace(seecr.solve(robot, [robot.reference_pose]), pose=over[None])
    text = "\n".join(pose_lines(found))
    assert " mm, turned about y by 168.340 deg\n" in text and "rx" not in text
    down = replace(robot.joints[2], axis=np.array([0.0, -1.0, 0.0]))
    other = replace(found, robot=replace(robot, joints=(*robot.joints[:2], down)))
    assert "turned about y by 168.340 deg" in "\n".join(pose_lines(other))
    askew = replace(robot.joints[2], axis=np.array([0.6, 0.8, 0.0]), name="tilt")
    leaning = np.array([*over[:3], *quat_from_rotvec(np.radians(-30.0) * askew.axis)])
    robot = replace(robot, joints=(*robot.joints[:2], askew))
    lean = replace(found, robot=robot, pose=leaning[None])
    assert "turned about tilt by -30.000 deg" in "\n".join(pose_lines(lean))
    turned = np.radians([[0.0, 0.02, 0.0]])
    seen = np.concatenate([np.zeros((1, 3)), turned], axis=1)
    spread = Spread(np.zeros((1, 3)), turned, np.ones((1, 4)), seen)
    assert "turned about y by 168.340 deg" in "\n".join(pose_lines(found, spread))


def test_three_other_equilibria_are_listed_twisted_ones_last() -> None:
    """Ten lines of twisted ones had stood between the pose and what to do next."""
    robot, found = PARALLEL, AT_HOME
    turned = np.tile(robot.reference_pose, (5, 1))
    turned[:, 0] += [0.1, 0.11, 0.12, 0.13, 0.14]
    rests = replace(seecr.solve(robot, turned), energy=np.zeros(5))
    pose = rests.pose.copy()
    pose[:2, 3:] = [0.0, 0.0, 0.0, 1.0]
    *lines, more = other_lines(found, replace(rests, pose=pose))
    away = np.linalg.norm(pose[2:, :3] - found.pose[0, :3], axis=1)
    for line, metres in zip(lines, away, strict=True):
        assert line.startswith(f"could also rest {1e3 * metres:.4g} mm and ")
    assert more == "and at 2 more places, all of them with --json"
    assert len(list(other_lines(found, replace(rests, pose=pose).rows([0, 2, 3])))) == 3
