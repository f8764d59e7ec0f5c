"""The nearest poses that can be held: against brute force, and held where they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import score_nearest
from random_robots import random_robot
from robots import WAYS, rejointed, slides

import seecr
from seecr.description.joints import freedoms, pose_of_values, values_of_pose
from seecr.effects.cable import CableWeight
from seecr.inverse.nearest import nearest
from seecr.inverse.nearest_problem import NearestProblem, PlatformMotion, Rows
from seecr.inverse.nearest_sqp import solve_sqp
from seecr.pose import Array, pose_difference, quat_from_rotvec, transform_points
from seecr.workspace.margins import balance_equations


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Brute force from a fifth of the starts that the script makes: here it finds the same."""
    for name, number in {"_SAMPLE": 30000, "_NEAR": 60, "_SEEDS": 8}.items():
        monkeypatch.setattr(score_nearest, name, number)


@pytest.mark.slow
@pytest.mark.usefixtures("few_starts")
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("cogiro_large", "far"),
        pytest.param("ipanema", "both", marks=pytest.mark.sweep),
        pytest.param("demobot_parallel", "turned", marks=pytest.mark.sweep),
    ],
)
def test_no_answer_is_farther_than_brute_force_finds(name: str, kind: str) -> None:
    robot, limits = seecr.load_robot(name), score_nearest.LIMITS[name]
    want = score_nearest.wanted_poses(robot, limits, kind, 6)
    found = seecr.correct(robot, want, **limits)
    assert found.found.all() and not found.held.any() and found.solution.converged.all()
    assert np.abs(pose_difference(found.solution.pose, found.aimed)).max() < 1e-8
    sample = score_nearest.held_sample(robot, limits)
    best = [score_nearest.Brute(robot, limits, one).nearest(sample, limits) for one in want]
    assert np.isfinite(best).sum() >= 3
    unit = np.repeat([1.0, robot.length], 3)
    ours = np.linalg.norm(pose_difference(found.aimed, want) * unit, axis=1)
    assert np.all(ours < 1.01 * np.array(best))


@pytest.mark.slow
@pytest.mark.parametrize(
    "away", [(9.0, 3.0, 2.0), pytest.param((-20.0, 10.0, 4.0), marks=pytest.mark.sweep)]
)
def test_with_cables_that_sag_the_platform_rests_there_within_limits(
    away: tuple[float, float, float],
) -> None:
    path = seecr.model_path("cogiro_large")
    robot = seecr.load_robot(path)
    sag = seecr.load_model(path.with_name("sag.toml"), robot)
    want = robot.reference_pose[None].copy()
    want[:, :3] += away
    found = seecr.correct(robot, want, effects=sag, highest=5000.0)
    assert found.found.all() and not found.held.any() and found.solution.converged.all()
    assert np.abs(pose_difference(found.solution.pose, found.aimed)).max() < 1e-6
    assert found.solution.tensions.max() < 5000.0 * (1.0 + 1e-9)
    # a tenth is what cables that are not slack but hang cost; brute force takes long with sag
    unit, plain = np.repeat([1.0, robot.length], 3), seecr.correct(robot, want, highest=5000.0)
    far, least = (
        np.linalg.norm(pose_difference(one.aimed, want) * unit, axis=1) for one in (found, plain)
    )
    assert np.all(far < 1.1 * least)


def test_just_below_the_exit_points_sagging_cables_have_a_nearest_pose_too() -> None:
    """Once none was found: by a linearised balance, level cables hold anything up."""
    path = seecr.model_path("cogiro_large")
    robot = seecr.load_robot(path)
    want = np.tile(robot.reference_pose, (2, 1))
    want[:, :3] = [[-3.72, -0.76, 5.382], [5.01, -1.31, 5.387]]
    found = seecr.correct(robot, want, effects=seecr.load_model(path.with_name("sag.toml"), robot))
    assert not found.held.any() and found.found.all() and found.stays.all()
    unit, plain = np.repeat([1.0, robot.length], 3), seecr.correct(robot, want)
    far, least = (
        np.linalg.norm(pose_difference(one.aimed, want) * unit, axis=1) for one in (found, plain)
    )
    assert np.all(far < 1.1 * least)


@pytest.mark.slow
@pytest.mark.usefixtures("few_starts")
def test_no_answer_with_cables_that_sag_is_farther_than_brute_force_finds() -> None:
    name, weight = "cogiro_large", score_nearest.WEIGHTS["cogiro_large"]
    robot, limits = seecr.load_robot(name), score_nearest.LIMITS[name]
    want = score_nearest.wanted_poses(robot, limits, "near", 2)
    found = seecr.correct(robot, want, effects=[CableWeight(weight)], **limits)
    assert found.stays.all() and found.settled.all() and not found.held.any()
    sample = score_nearest.held_sample(robot, limits)
    brute = [score_nearest.Brute(robot, limits, one, cable_weight=weight) for one in want]
    best = np.array([one.nearest(sample, limits) for one in brute])
    unit = np.repeat([1.0, robot.length], 3)
    ours = np.linalg.norm(pose_difference(found.aimed, want) * unit, axis=1)
    assert np.isfinite(best).all() and np.all(ours < 1.01 * best)
    # nor nearer, by other catenaries
    assert np.all(ours > 0.99 * best)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed", "row", "most"),
    [
        ("cogiro_large", 1, 9, 1.01 * 0.2009),
        ("cogiro_large", 2, 11, 1.01 * 0.3890),
        # the reference is not the nearest: what goes on at random comes to 0.064
        ("demobot_parallel", 2, 9, 0.9 * 0.0798),
    ],
)
def test_a_pose_beside_those_where_it_would_not_stay(
    name: str, seed: int, row: int, most: float
) -> None:
    # [m] by scripts/score_nearest.py, of 16 poses: all searches end nearer, at unstable ones
    robot, limits = seecr.load_robot(name), score_nearest.LIMITS[name]
    want = score_nearest.wanted_poses(robot, limits, "turned", row + 1, seed)[row:]
    found = seecr.correct(robot, want, **limits)
    assert found.stays.all()
    unit = np.repeat([1.0, robot.length], 3)
    assert np.linalg.norm(pose_difference(found.aimed, want) * unit) < most


@pytest.mark.slow
def test_positions_are_kept_where_any_turn_stays_there_and_given_up_where_none_does() -> None:
    robot, limits = seecr.load_robot("ipanema"), score_nearest.LIMITS["ipanema"]
    want = score_nearest.wanted_poses(robot, limits, "kept", 38)[[37, 26, 27]]
    found = seecr.correct(robot, want, prefer="position", **limits)
    moved = np.linalg.norm(found.aimed[:, :3] - want[:, :3], axis=1)
    assert found.stays.all()
    # of 20,000 turns of the first the platform stays in none
    assert moved[0] > 0.1 and np.all(moved[1:] < 1e-9)
    turned = np.linalg.norm(pose_difference(found.aimed, want)[:, 3:], axis=1) * robot.length
    # [m] by scripts/score_nearest.py; of the last's turns one in ten thousand is held
    assert turned[1] < 1.01 * 1.6018 and turned[2] < 1.01 * 1.3611


@pytest.mark.slow
def test_a_pose_from_which_the_platform_goes_elsewhere_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It comes to rest all the same, but not at what is aimed at."""
    name = "cogiro_large"
    robot, limits = seecr.load_robot(name), score_nearest.LIMITS[name]
    want = score_nearest.wanted_poses(robot, limits, "turned", 10, 1)[9:]
    every = lambda _self, _away, rows: np.ones(len(rows), dtype=bool)  # noqa: E731
    monkeypatch.setattr(NearestProblem, "rests", every)
    found = seecr.correct(robot, want, **limits)
    assert found.found.all() and found.solution.converged.all() and not found.stays.any()
    assert "1 where forces balance but the platform does not come to rest: pose " in str(found)


@pytest.mark.slow
def test_an_answer_that_is_no_local_minimum_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, want = seecr.load_robot("demobot_parallel"), np.array([1.2, 0.25, 0.1, 1, 0, 0, 0])
    found = seecr.correct(robot, want)
    assert found.found[0] and found.settled[0] and "nearer pose that can be held" not in str(found)
    monkeypatch.setattr("seecr.inverse.nearest.solve_sqp", lambda _problem, start: start)
    cut = seecr.correct(robot, want)
    assert cut.found[0] and not cut.settled[0]
    assert "1 of them: a nearer pose that can be held may exist: pose 0" in str(cut)


@pytest.mark.slow
def test_every_position_at_which_a_bar_can_rest_is_kept() -> None:
    """Two cables do not make up for a tilt that is nearly right: ends were lost to rounding."""
    bar = seecr.load_robot("planar_two_cable")
    half = 0.5 * float(np.linalg.norm(np.ptp(bar.anchor_points, axis=0)))
    places = [(0.7, 0.95), (0.3, 0.95), (0.8, 0.95), (0.2, 0.95), (0.0833333, 0.9166667)]
    for x, z in places:
        roots = [
            r for r in seecr.bar_equilibria(bar.exit_points[:, [0, 2]], [x, z], half) if r.stable
        ]
        found = seecr.correct(bar, [x, 0.0, z, 1.0, 0.0, 0.0, 0.0], prefer="position")
        assert len(roots) == 1 and found.stays.all()
        assert np.abs(found.solution.pose[0, :3] - [x, 0.0, z]).max() < 1e-9


def test_a_pose_so_far_away_that_rounding_is_longer_than_the_robot_has_a_nearest_one() -> None:
    """It was refused: turned poses about it ended in numbers that are none."""
    robot = seecr.load_robot("planar_vertical")
    pose = robot.reference_pose.copy()
    pose[0] = 1e20
    found = seecr.correct(robot, pose[None])
    assert not found.held[0] and found.stays[0]
    assert np.abs(found.aimed[0, :3] - robot.reference_pose[:3]).max() < 1.0


@pytest.mark.parametrize("name", ["planar_vertical", "planar_horizontal"])
def test_no_nearest_pose_is_at_a_winch(name: str) -> None:
    """A cable of 0.1 mm may pull any way: corrections had ended there, with lengths below zero."""
    robot = seecr.load_robot(name)
    wanted = np.tile(robot.reference_pose, (2, 1))
    wanted[:, [0, 2]] = [[0.05, 0.45], [0.09, 0.47]]
    found = seecr.correct(robot, wanted, lowest=0.2, highest=40.0)
    assert found.found.all() and found.stays.all() and not found.held.any()
    ends = transform_points(found.aimed, robot.anchor_points)
    spans = np.linalg.norm(ends - robot.exit_points, axis=2)
    least = 0.01 * robot.reference_lengths.min()
    assert np.all(spans.min(axis=1) > 0.999 * least) and np.all(found.lengths > 0.0)
    # and they are at that border, not elsewhere
    assert np.all(spans.min(axis=1) < 1.1 * least)


def test_where_a_cable_would_have_no_length_there_is_no_answer() -> None:
    """The winch pays out 50 mm more than it is told: it cannot be told less than nothing."""
    robot = seecr.load_robot("planar_vertical")
    offset = seecr.Term.of(robot, "cable_length_offset", offset_1_m=0.05)
    wanted = np.tile(robot.reference_pose, (2, 1))
    wanted[1, [0, 2]] = [0.12, 0.45]
    found = seecr.correct(robot, wanted, effects=[offset], lowest=0.2, highest=40.0)
    assert found.held.all() and found.found.tolist() == [True, False]
    assert np.isnan(found.lengths[1]).all() and found.reached.tolist() == [True, False]


def test_poses_searched_in_lots_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of thousands of poses only some are searched at once: all together took gigabytes."""
    robot = seecr.load_robot("demobot_parallel")
    wanted = np.zeros((7, 7))
    wanted[:, 0], wanted[:, 1], wanted[:, 2] = np.linspace(0.54, 0.62, 7), 0.25, 0.1
    wanted[:, 3] = 1.0
    whole = seecr.correct(robot, wanted)
    monkeypatch.setattr("seecr.inverse.nearest._AT_ONCE", 3)
    parts = seecr.correct(robot, wanted)
    unit = np.repeat([1.0, robot.length], 3)
    far = [np.linalg.norm(pose_difference(c.aimed, wanted) * unit, axis=1) for c in (whole, parts)]
    assert far[1] == pytest.approx(far[0], rel=1e-3) and not whole.held.any()
    assert parts.found.all() and parts.solution.converged.all()


# --- Searches for the nearest pose and where they start, on a slab whose nearest point is known


# A platform stays only to the right of this [m].
BORDER = 0.1


def begun(problem, x):  # type: ignore[no-untyped-def]
    """Searches from poses so far beside the wanted ones, half a metre too high."""
    return problem.start(
        np.stack([np.array(x, float), np.full(len(x), 0.5)], axis=1), np.arange(len(x))
    )


REACH = 0.25
"""Largest distance [m] from the reference pose, along x, at which tensions of up to 4 N hold."""

# Two cables pull along x, one each way, and one carries the weight of 1 N along z.
_MATRIX = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
_STIFF = 10.0


def slab(wanted_x: list[float], stays_from: float = -np.inf) -> NearestProblem:
    """A platform on two slides, held where |x - x0| <= REACH; stable only from some x on."""
    robot = slides()
    wanted = np.tile(robot.reference_pose, (len(wanted_x), 1))
    wanted[:, 0] += wanted_x

    def balance(poses: Array, rows: Rows, about: Array | None = None) -> tuple[Array, Array]:
        load = np.ones((len(poses), 2))
        load[:, 0] = _STIFF * (poses[:, 0] - robot.reference_pose[0])
        return np.tile(_MATRIX, (len(poses), 1, 1)), load

    def stays(poses: Array, rows: Rows) -> np.ndarray:
        return np.asarray(poses[:, 0] - robot.reference_pose[0] >= stays_from)

    limits = np.zeros(3), np.array([_STIFF * REACH, _STIFF * REACH, 2.0])
    return NearestProblem.within(robot, wanted, balance, stays, limits, np.ones(len(wanted)))


def test_a_search_ends_where_the_slab_ends_and_at_the_wanted_height() -> None:
    problem = slab([1.0, -3.0])
    found = solve_sqp(problem, begun(problem, [-0.9, 3.2]))
    assert found.left.max() < 1e-9
    assert found.away == pytest.approx(np.array([[-1.0 + REACH, 0], [3.0 - REACH, 0]]), abs=3e-6)


def test_the_nearest_of_all_is_stable_and_settled() -> None:
    problem = slab([1.0, 0.2])
    found = nearest(problem)
    assert found.found.all() and found.stable.all() and found.settled.all()
    x = found.poses[:, 0] - problem.robot.reference_pose[0]
    assert x == pytest.approx([REACH, 0.2], abs=1e-5)


def test_a_wanted_pose_that_does_not_stay_gets_the_nearest_that_does() -> None:
    found = nearest(slab([-0.3], stays_from=BORDER))
    assert found.stable.all()
    x = found.poses[0, 0] - slab([0.0]).robot.reference_pose[0]
    assert BORDER <= x < BORDER + 0.02


# --- Distances and directions are the platform's, whatever joints it is on


def motion_of(robot: seecr.Robot, values: Array, fix_position: bool = False) -> PlatformMotion:
    """Motions from the poses at joint values (n, d)."""
    return PlatformMotion.about(robot, *pose_of_values(robot, values), fix_position)


def arm() -> seecr.Robot:
    """A platform on three parallel hinges, which can turn about its origin by moving all three."""
    robot = seecr.load_robot("planar_vertical")
    home, y = robot.reference_pose[:3], np.array([0.0, 1.0, 0.0])
    places = home + np.array([[-0.5, 0.0, -0.2], [-0.2, 0.0, 0.2], [0.05, 0.0, 0.02]])
    hinges = tuple(seecr.Joint("hinge", f"h{k}", y, place) for k, place in enumerate(places))
    return replace(robot, joints=hinges)


def test_freedoms() -> None:
    robot = seecr.load_robot("planar_vertical")
    assert freedoms(seecr.load_robot("ipanema")) == (6, 3, 3)
    assert freedoms(robot) == freedoms(arm()) == (3, 1, 1)
    assert {freedoms(rejointed(robot, way)) for way in WAYS} == {(3, 1, 1)}
    slides, hinge = robot.joints[:2], replace(robot.joints[2], point=np.ones(3))
    assert freedoms(replace(robot, joints=slides)) == (2, 0, 0)
    assert freedoms(replace(robot, joints=(hinge,))) == (1, 0, 1)
    # two hinges about one axis move the platform in one way
    assert freedoms(replace(robot, joints=(hinge, hinge))) == (1, 0, 1)


@pytest.mark.parametrize("seed", range(6))
def test_distances_and_their_derivatives_are_those_of_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "jointed")
    metre = np.where(robot.hinges, robot.length, 1.0)
    wanted, away = 0.4 * rng.normal(size=(2, 2, robot.n_dof)) * metre
    motion, rows, step = motion_of(robot, wanted / metre), np.arange(2), 1e-6 * robot.length
    apart = pose_difference(pose_of_values(robot, (wanted + away) / metre)[0], motion.poses)
    apart *= np.repeat([1.0, robot.length], 3)
    np.testing.assert_allclose(motion.apart(away, rows), apart, atol=1e-13 * robot.length)
    at = motion.directions(away, rows)
    assert at.basis is not None and at.squares is not None
    for k, along in enumerate(np.eye(robot.n_dof)):
        ends = [
            motion.stepped(away, rows, at.basis, np.tile(by * along, (2, 1)))
            for by in (step, -step)
        ]
        halves = [0.5 * motion.far(end, rows) ** 2 for end in ends]
        rate = (halves[0] - halves[1]) / (2.0 * step)
        np.testing.assert_allclose(at.slope[:, k], rate, rtol=1e-5, atol=1e-7 * robot.length)
        # a step moves the platform by its length
        moved = pose_difference(*(pose_of_values(robot, (wanted + end) / metre)[0] for end in ends))
        moved = np.linalg.norm(moved * np.repeat([1.0, robot.length], 3), axis=1)
        np.testing.assert_allclose(moved, 2.0 * step, rtol=1e-6)


@pytest.mark.parametrize("prefer", ["pose", "position"])
@pytest.mark.parametrize("way", WAYS)
def test_the_nearest_pose_does_not_depend_on_the_joints(way: str, prefer: str) -> None:
    """It was the nearest in joint values: up to 62 times as far, and positions were not kept."""
    robot = seecr.load_robot("planar_vertical")
    other, tilts = rejointed(robot, way), np.array([0.5, -0.7, 0.35, 0.9])
    wanted = np.tile(robot.reference_pose, (4, 1))
    wanted[:, [0, 2]] += [[0.05, 0.02], [-0.1, 0.0], [0.12, -0.05], [0.0, 0.08]]
    wanted[:, 3:] = quat_from_rotvec(tilts[:, None] * [0.0, 1.0, 0.0])
    assert np.abs(values_of_pose(other, wanted)[0] - values_of_pose(robot, wanted)[0]).max() > 0.02
    limits = {"lowest": 0.5, "highest": 40.0, "prefer": prefer}
    mine, theirs = seecr.correct(other, wanted, **limits), seecr.correct(robot, wanted, **limits)
    assert not mine.held.any() and mine.stays.all() and mine.settled.all()
    metre = np.repeat([1.0, robot.length], 3)
    far = [np.linalg.norm(pose_difference(c.aimed, wanted) * metre, axis=1) for c in (mine, theirs)]
    np.testing.assert_allclose(far[0], far[1], rtol=1e-4)
    if prefer == "position":
        kept = np.abs(pose_difference(theirs.aimed, wanted)[:, :3]).max(axis=1) < 1e-9
        assert kept.any()
        assert np.abs(pose_difference(mine.aimed, wanted)[kept, :3]).max() < 1e-9


def test_a_turn_about_a_hinge_is_as_far_as_its_shorter_way() -> None:
    robot = seecr.load_robot("planar_vertical")
    values = np.array([[-0.26, 0.151, 2.588], [-0.251, 0.156, 3.326]])
    want, there = pose_of_values(robot, values)[0]
    problem = NearestProblem.within(
        robot, want[None], lambda poses, *_: balance_equations(robot, poses),
        lambda _, rows: np.ones(len(rows), dtype=bool), (np.zeros(4), np.zeros(4)), np.ones(1),
    )  # fmt: skip
    (away,) = problem.to(problem.coordinates(there[None]), np.zeros(1, dtype=np.intp))
    assert away == pytest.approx((values[1] - values[0]) * [1.0, 1.0, robot.length])


def test_a_part_of_a_problem_has_the_loads_of_its_own_rows() -> None:
    problem = slab([1.0, -2.0, 0.0])
    own = replace(
        problem, balance=lambda poses, rows, about=None: (rows, rows),
        stays=lambda poses, rows: rows, holds=lambda poses, rows: rows,
    )  # fmt: skip
    part, away, second = own.part(np.array([2, 0])), np.zeros((1, 2)), np.array([1])
    assert np.array_equal(part.wanted, problem.wanted[[2, 0]])
    assert part.at(away, second)[0].tolist() == part.rests(away, second).tolist() == [0]
    assert part.holds is not None and part.holds(away, second).tolist() == [0]
