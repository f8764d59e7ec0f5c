"""Every stable equilibrium of a command is found, by energy, and what is between two of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import seecr
from seecr import InputError, Robot, Status, Term, equilibria, load_robot, solve
from seecr.description.joints import pose_of_values
from seecr.equilibrium.following import evaluated, moved
from seecr.equilibrium.saddles import strings
from seecr.equilibrium.search import elsewhere, starts_about
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply, transform_points
from seecr.show.pose_words import other_lines, softest_words
from seecr.statics.tables import take

# To one of this command's rests only few starts lead.
HARD = np.array([0.308667, 0.214797, 0.14935, 0.996763, -0.037391, -0.069476, 0.015419])


def commands_of(robot: Robot, n: int, random: np.random.Generator) -> Array:
    """Poses (n, 7) about the reference pose, tilted up to 40 degrees."""
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, :3] += 0.25 * np.ptp(robot.exit_points, axis=0) * random.uniform(-1, 1, (n, 3))
    axes = random.normal(size=(n, 3))
    turns = np.deg2rad(random.uniform(0, 40, (n, 1)))
    axes *= turns / np.linalg.norm(axes, axis=1, keepdims=True)
    poses[:, 3:] = quat_multiply(quat_from_rotvec(axes), poses[:, 3:])
    return poses


def rests_of_starts(robot: Robot, pose: Array, n: int, random: np.random.Generator) -> Array:
    """The different rests (k, 7) to which n starts near a command lead, turned in every way."""
    starts = np.tile(pose, (n, 1))
    size = 0.49 * np.max(np.ptp(robot.exit_points, axis=0))
    starts[:, :3] += random.uniform(-size, size, (n, 3))
    starts[:, 3:] = quat_from_rotvec(random.uniform(-np.pi, np.pi, (n, 3)))
    many = solve(robot, np.tile(pose, (n, 1)), start=starts)
    left, rests = many.pose[many.converged], []
    while len(left):
        rests.append(left[0])
        left = left[~same(robot, left, left[0])]
    return np.array(rests)


def same(robot: Robot, poses: Array, one: Array) -> Array:
    apart = pose_difference(poses, one) * np.repeat([1.0, robot.length], 3)
    return np.linalg.norm(apart, axis=1) < 1e-5 * robot.length


@pytest.mark.slow
@pytest.mark.parametrize("starts", [1500, pytest.param(3000, marks=pytest.mark.sweep)])
def test_what_thousands_of_starts_find_is_found(starts: int) -> None:
    """All but one in a hundred: there are rests to which one start in 40,000 leads."""
    there, lost = 0, []
    for name in ("demobot_off_centre", "demobot_cogiro", "cogiro_large", "demobot_parallel"):
        robot, random = load_robot(name), np.random.default_rng(7)
        for pose in [*commands_of(robot, 5, random), HARD]:
            found = equilibria(robot, pose)
            assert found.converged.all() and np.all(np.diff(found.energy) >= 0)
            rests = rests_of_starts(robot, pose, starts, random)
            there += len(rests)
            lost += [(name, r) for r in rests if not same(robot, found.pose, r).any()]
    assert there > 90 and len(lost) <= 0.01 * there


def test_search_goes_on_while_starts_lead_where_no_other_did() -> None:
    robot = load_robot("demobot_off_centre")
    found = equilibria(robot, HARD)
    np.testing.assert_allclose(found.pose[-1, :3], [0.31089, 0.17045, 0.19257], atol=1e-5)
    assert found.energy[-1] - found.energy[0] == pytest.approx(0.228, abs=0.001)
    assert len(equilibria(robot, HARD, most=256)) <= len(found) == 3


def test_the_tilted_command_with_two_rests() -> None:
    robot = load_robot("demobot_parallel")
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    pose = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    found = equilibria(robot, pose)
    np.testing.assert_allclose(found.energy, [-0.01533, -0.01372], atol=1e-5)
    apart = pose_difference(found.pose[:1], found.pose[1:])[0]
    assert 1e3 * np.linalg.norm(apart[:3]) == pytest.approx(15.7, abs=0.1)
    own = solve(robot, pose)
    (line,) = other_lines(own, found)
    assert line.startswith("could also rest 15.7") and "slack: cable2 cable3 cable5 cable7" in line


def test_where_it_drifts_to_without_resistance_is_no_other_equilibrium() -> None:
    """Two cables are tight, and the platform can turn until a third one is: that is one rest."""
    robot = load_robot("demobot_parallel")
    pose = np.array([0.1, 0.1, 0.1, 1.0, 0.0, 0.0, 0.0])
    own, found = solve(robot, pose, others=True), equilibria(robot, pose)
    assert own.status[0] is Status.SINGULAR and own.others is not None
    assert found.converged.any(), "where the third cable holds it"
    assert len(own.others[0]) == 0 and list(elsewhere(own, found)) == []
    assert list(other_lines(own, found)) == ["no other stable equilibrium was found"]
    # as far away, but uphill
    up = np.array([[0.0, 0.0, 0.01, 0.0, 0.0, 0.0]])
    hill = replace(found, pose=moved(robot, found.pose, up))
    assert list(elsewhere(own, hill)) == list(np.flatnonzero(found.converged))


def test_solve_tells_the_others() -> None:
    robot = load_robot("demobot_parallel")
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    tilted = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    found = solve(robot, [tilted, robot.reference_pose], others=True)
    assert found.others is not None
    first, second = found.others
    assert len(first) == 1 and len(second) == 0
    assert first.energy[0] == pytest.approx(-0.01533, abs=1e-5)
    np.testing.assert_array_equal(first.command[0], found.command[0])
    assert solve(robot, tilted).others is None and found.rows([1]).others == (second,)
    # under a force that holds it the other way round, with the same lengths
    pushed = solve(robot, tilted, others=True, wrench=[0, 0, 0, 0, 0.05, 0])
    assert pushed.others is not None and len(pushed.others) == 1
    hysteresis = [Term.of(robot, "hysteresis", amplitude_N=0.1)]
    with pytest.raises(InputError, match="expected no other method, no start, no others"):
        solve(robot, tilted, effects=hysteresis, others=True)
    with pytest.raises(InputError, match="lead to one rest along their way"):
        equilibria(robot, tilted, effects=hysteresis)


def test_a_robot_with_one_rest_says_so() -> None:
    robot = load_robot("planar_vertical")
    found = equilibria(robot, robot.reference_pose)
    assert len(found) == 1
    own = solve(robot, robot.reference_pose)
    assert list(other_lines(own, found)) == ["no other stable equilibrium was found"]
    assert softest_words(own).startswith("move along ")
    free = load_robot("demobot_parallel")
    assert softest_words(solve(free, free.reference_pose)).startswith(("turn about", "move along"))


def test_several_poses_are_refused() -> None:
    robot = load_robot("demobot_cogiro")
    with pytest.raises(InputError, match=r"equilibria needs one commanded pose \(7,\), got 2"):
        equilibria(robot, np.tile(robot.reference_pose, (2, 1)))


def test_on_joints_starts_lie_about_the_command() -> None:
    robot = load_robot("planar_two_cable")
    command = pose_of_values(robot, np.array([[0.3, -0.1, 0.2]]))[0]
    assert np.allclose(starts_about(robot, command[0], np.full((1, 4), 0.5)), command)


# --- What is between two equilibria: a saddle from which either side leads to one of them


@cache
def tilted() -> tuple[seecr.Robot, np.ndarray, seecr.Solution, seecr.Solution, seecr.Solution]:
    """A robot, a command with two rests, its own, both by energy, and the other one."""
    robot = seecr.load_robot("demobot_parallel")
    pose = np.array([0.351, 0.216, 0.109, 0.943, 0.163, -0.288, -0.038])
    pose[3:] /= np.linalg.norm(pose[3:])
    own, every = seecr.solve(robot, pose), seecr.equilibria(robot, pose)
    return robot, pose, own, every, every.rows(elsewhere(own, every))


@pytest.mark.slow
def test_the_pass_between_the_two_rests_of_the_tilted_command() -> None:
    robot, pose, own, every, other = tilted()
    (way,) = seecr.barriers(own, other)
    assert way.exact and not way.twisted
    assert way.energy == pytest.approx(6.80e-5, rel=1e-3)
    # of all equilibria one is the rest itself
    assert sorted(w.energy for w in seecr.barriers(own, every)) == [0.0, way.energy]
    assert way.back - way.energy == pytest.approx(own.energy[0] - other.energy[0], rel=1e-9)
    # a saddle: balanced, one direction falls, and leads to one rest on either side
    there = evaluated(robot, own.tables, way.pose[None])
    values, vectors = np.linalg.eigh(there.hessian[0])
    assert there.residual[0] < 1e-9 and values[0] < 0.0 < values[1]
    sides = [
        moved(robot, way.pose[None], s * 1e-3 * robot.length * vectors[:, :1].T) for s in (1, -1)
    ]
    ends = [seecr.solve(robot, pose, start=side).pose[0] for side in sides]
    for rest in (own.pose[0], other.pose[0]):
        assert min(np.abs(pose_difference(end, rest)).max() for end in ends) < 1e-7
    # no way found by chance is lower: straight ones by way of poses near the pass
    parts = np.linspace(0.0, 1.0, 41)[:, None]
    random = np.random.default_rng(0)
    many = take(own.tables, np.zeros(len(parts), int))
    for _ in range(20):
        by = moved(robot, way.pose[None], 0.2 * robot.length * random.normal(size=(1, 6)))[0]
        highest = -np.inf
        for end in (own.pose[0], other.pose[0]):
            step = parts * pose_difference(by, end)
            on = np.tile(end, (len(parts), 1))
            on = moved(robot, on, step * np.where(robot.hinges, robot.length, 1.0))
            highest = max(highest, float(evaluated(robot, many, on).energy.max()))
        assert highest - own.energy[0] >= way.energy
    (line,) = other_lines(own, every, [way])
    assert line.endswith("; reachable, 0.068 mJ to get there, 1.68 mJ back")


@pytest.mark.slow
def test_mirrored_rests_are_twisted_and_as_far_up() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    pose = robot.reference_pose
    turned = np.array(
        [[0.4, 0.25, 0.15, *quat_from_rotvec(np.array([s, 0.0, 0.0]))] for s in (2, -2)]
    )
    own, others = seecr.solve(robot, pose), seecr.solve(robot, np.tile(pose, (2, 1)), start=turned)
    assert others.converged.all()
    one, two = seecr.barriers(own, others)
    assert one.twisted and two.twisted and one.energy == pytest.approx(two.energy, rel=1e-6)
    assert one.energy > others.energy[0] - own.energy[0] > 0.01


def energy_by_hand(own: seecr.Solution, pose: np.ndarray, moment: float) -> float:
    """Of a platform in the x-z plane: springs, weight, and a moment about y times the turn."""
    robot, rest = own.robot, own.rest_lengths[0]
    spans = np.linalg.norm(transform_points(pose[None], robot.anchor_points)[0] - EXITS, axis=1)
    stretch = np.maximum(spans - rest, 0.0)
    turned = pose_difference(pose, robot.reference_pose)[4]
    from_command = turned - pose_difference(own.command[0], robot.reference_pose)[4]
    lifted = pose[2] - own.command[0, 2]
    springs = float(np.sum(0.5 * robot.ea / rest * stretch**2))
    return springs + robot.weight * lifted - moment * from_command


PLANAR = seecr.load_robot("planar_horizontal")
EXITS = PLANAR.exit_points
LEANING = np.array([0.6, 0.0, 0.4, 0.9, 0.0, np.sqrt(0.19), 0.0])


@cache
def barrier_without_a_moment() -> tuple[seecr.Barrier, float]:
    """The same barrier if nothing acts, and the turn [rad] to its top."""
    own, every = seecr.solve(PLANAR, LEANING), seecr.equilibria(PLANAR, LEANING)
    (way,) = seecr.barriers(own, every.rows(elsewhere(own, every)))
    return way, float(pose_difference(way.pose, own.pose[0])[4])


@pytest.mark.slow
@pytest.mark.parametrize("moment", [0.02, -0.05])
def test_under_a_moment_a_planar_platform_has_energies_and_barriers(moment: float) -> None:
    """They were nan once: on one hinge the work of a moment depends on the turn alone."""
    acting = [seecr.Term.of(PLANAR, "external_wrench", moment_y_Nm=moment)]
    own, every = (
        seecr.solve(PLANAR, LEANING, effects=acting),
        seecr.equilibria(PLANAR, LEANING, effects=acting),
    )
    (way,) = seecr.barriers(own, every.rows(elsewhere(own, every)))
    own_energy, there, top = (
        energy_by_hand(own, pose, moment) for pose in (own.pose[0], every.pose[-1], way.pose)
    )
    assert every.energy[-1] == pytest.approx(there, rel=1e-9)
    assert way.exact and way.why_not == ""
    assert way.energy == pytest.approx(top - own_energy, rel=1e-9)
    assert way.back == pytest.approx(top - there, rel=1e-9)
    # a saddle of that energy: level in all directions, and one of them falls
    steps = np.eye(3) * 1e-5
    around = [
        [energy_by_hand(own, moved(PLANAR, way.pose[None], s * d[None])[0], moment) for d in steps]
        for s in (1, -1)
    ]
    assert np.abs(np.subtract(*around)).max() / 2e-5 < 1e-4 * PLANAR.weight
    # more or less of it by what the moment does on the turn from rest to saddle, nearly
    plain, turn = barrier_without_a_moment()
    assert way.energy - plain.energy == pytest.approx(-moment * turn, rel=0.02)


@pytest.mark.slow
def test_full_turns_under_a_moment_are_not_counted() -> None:
    acting = [seecr.Term.of(PLANAR, "external_wrench", moment_y_Nm=0.02)]
    starts = np.tile(LEANING, (24, 1))
    for k, angle in enumerate(np.linspace(-3.1, 3.1, 24)):
        starts[k, 3:] = quat_from_rotvec(np.array([0.0, angle, 0.0]))
    found = seecr.solve(PLANAR, np.tile(LEANING, (24, 1)), start=starts, effects=acting)
    assert found.converged.sum() > 12
    turned = found.evaluation.values[:, 2] / PLANAR.length
    assert np.abs(turned).max() > 2.0
    for k in np.flatnonzero(found.converged):
        by_hand = energy_by_hand(found.rows([k]), found.pose[k], 0.02)
        assert found.energy[k] == pytest.approx(by_hand, rel=1e-7)


def test_the_work_of_a_moment_that_depends_on_the_way_is_said_in_words() -> None:
    robot, pose, *_rests = tilted()
    for acting, why in (
        (
            [seecr.Term.of(robot, "external_wrench", moment_y_Nm=1e-4)],
            "what a moment does on a platform",
        ),
        ([seecr.Term.of(robot, "hysteresis", amplitude_N=0.1)], "what its cables take"),
    ):
        own = seecr.solve(robot, pose, effects=acting)
        (way,) = seecr.barriers(own, own)
        assert np.isnan(way.energy) and way.why_not.startswith(why)
        assert way.words == f"reachable; no barrier can be given: {way.why_not}"
        assert way.as_json()["why_not"] == way.why_not


def test_equilibria_of_something_else_are_refused() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    own, other = (
        seecr.solve(robot, robot.reference_pose),
        seecr.solve(robot, [0.5, 0.25, 0.1, 1, 0, 0, 0]),
    )
    with pytest.raises(
        seecr.InputError, match="expected equilibria of one command, got other rest"
    ):
        seecr.barriers(own, other)


@pytest.mark.slow
def test_no_barrier_is_lower_than_one_of_its_ends() -> None:
    """A saddle between two other equilibria gave a way back of -794 J, and was called exact."""
    robot = seecr.load_robot("cogiro_large")
    model = seecr.load_model(seecr.model_path("cogiro_large").with_name("sag.toml"), robot)
    pose = np.array([3.0, 2.0, 1.5, 1.0, 0.0, 0.0, 0.0])
    own, every = (
        seecr.solve(robot, pose, effects=model),
        seecr.equilibria(robot, pose, effects=model),
    )
    (way,) = seecr.barriers(own, every.rows([-1]))
    assert way.energy > 0.0 and way.back > 0.0
    assert way.back == pytest.approx(way.energy + own.energy[0] - every.energy[-1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["demobot_cogiro", pytest.param("ipanema", marks=pytest.mark.sweep), "cogiro_large"]
)
def test_barriers_of_random_commands_are_as_high_as_both_ends(name: str) -> None:
    robot, random = seecr.load_robot(name), np.random.default_rng(5)
    low, high = robot.exit_points.min(axis=0), robot.exit_points.max(axis=0)
    seen = 0
    for _ in range(4):
        place = low + (0.15 + 0.7 * random.random(3)) * (high - low)
        pose = np.concatenate([place, quat_from_rotvec(0.3 * random.normal(size=3))])
        own, every = seecr.solve(robot, pose), seecr.equilibria(robot, pose, most=512)
        if not own.converged[0]:
            continue
        others = every.rows(elsewhere(own, every))
        for way, energy in zip(seecr.barriers(own, others), others.energy, strict=True):
            seen += 1
            assert way.energy >= 0.0 and way.back >= 0.0
            top = evaluated(robot, own.tables, way.pose[None])
            assert way.energy >= top.energy[0] - own.energy[0] >= -1e-6 * abs(energy)
            assert not way.exact or top.residual[0] < 1e-9
    assert seen > 0


@pytest.mark.parametrize("name", ["demobot_cogiro", "ipanema"])
def test_a_path_settles_where_it_is_steep_and_its_sides_are_soft(name: str) -> None:
    robot = seecr.load_robot(name)
    place = robot.exit_points.min(axis=0) + 0.45 * np.ptp(robot.exit_points, axis=0)
    pose = np.concatenate([place, robot.reference_pose[3:]])[None]
    own, every = seecr.solve(robot, pose), seecr.equilibria(robot, pose)
    _, settled = strings(own, every.rows(elsewhere(own, every)), 0.5)
    assert len(settled) > 0 and settled.all()


@pytest.mark.slow
def test_a_saddle_that_joins_other_equilibria_is_not_called_the_top(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its highest point is reported instead, an upper bound, if both sides lead to the first."""
    robot = seecr.load_robot("demobot_cogiro")
    turned = np.array([[0.4, 0.25, 0.15, *quat_from_rotvec(np.array([2.0, 0.0, 0.0]))]])
    pose = robot.reference_pose
    own, other = seecr.solve(robot, pose), seecr.solve(robot, pose, start=turned)
    (way,) = seecr.barriers(own, other)
    monkeypatch.setattr("seecr.equilibrium.saddles.beside", lambda *_: (own.pose, own.pose))
    (bound,) = seecr.barriers(own, other)
    assert way.exact and not bound.exact and bound.energy >= way.energy * (1.0 - 1e-6)
    assert bound.words.startswith("twisted, at most ")
