"""Trajectories are followed from rest to rest, and jumps are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.settle.settler import Settler
from seecr import Commands, InputError, Robot, Term, load_robot, model_path, solve
from seecr.pose import Array, pose_difference, quat_from_rotvec
from seecr.show.batch_words import jump_lines
from seecr.show.files import SweepRows

pytestmark = pytest.mark.slow


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


def test_what_does_not_go_with_following_is_refused() -> None:
    robot = parallel()
    with pytest.raises(InputError, match="expected no other method and no start"):
        solve(robot, robot.reference_pose, follow=True, method="fsolve")
    friction = [Term.of(robot, "hysteresis", amplitude_N=0.1)]
    with pytest.raises(InputError, match="solved along the path; leave follow out"):
        solve(robot, robot.reference_pose, follow=True, effects=friction)
