"""A platform on one joint, against closed forms: rests, barriers, stiffness in its own unit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from called import ran
from random_robots import KINDS, random_poses, random_robot, write_mjcf
from scipy.optimize import brentq, minimize_scalar

import seecr
from crosscheck.settle.settler import Settler
from seecr import load_robot, solve
from seecr.pose import pose_difference

# A link on a hinge along y at the origin: weight and two symmetric cables, in the plane x-z.
MASS, CENTRE, K, REST = 0.9, 0.22, 2500.0, 0.388
A, B = np.array([[-0.38, 0.12], [0.38, 0.12]]), np.array([[-0.04, 0.31], [0.04, 0.31]])
LINK = """<mujoco><worldbody><site name="a0" pos="-0.38 0 0.12"/><site name="a1" pos="0.38 0 0.12"/>
<body name="link" pos="{pos}"><joint name="elbow" type="{kind}" axis="{axis}" pos="{off}"/>
<inertial pos="{shift} 0 0.22" mass="0.9" diaginertia="0.02 0.03 0.01"/>
<site name="b0" pos="{b0} 0 0.31"/><site name="b1" pos="{b1} 0 0.31"/></body></worldbody><tendon>
<spatial name="left" springlength="0 0.388" stiffness="2500"><site site="a0"/><site site="b0"/>
</spatial><spatial name="right" springlength="0 0.388" stiffness="2500"><site site="a1"/>
<site site="b1"/></spatial></tendon></mujoco>"""


def link(path: Path, shift: float = 0.0, kind: str = "hinge", axis: str = "0 1 0") -> Path:
    """The link; its body's origin may be ``shift`` beside the hinge, which moves nothing."""
    b = [f"{-0.04 - shift}", f"{0.04 - shift}"]
    path.write_text(LINK.format(
        pos=f"{shift} 0 0", off=f"{-shift} 0 0", kind=kind, axis=axis, shift=-shift, b0=b[0],
        b1=b[1],
    ))  # fmt: skip
    return path


def energy(angle: float) -> float:
    """Energy [J] at an angle [rad] about y, which takes z to x."""
    c, s = np.cos(angle), np.sin(angle)
    ends = B @ np.array([[c, -s], [s, c]])
    stretch = np.maximum(np.linalg.norm(ends - A, axis=1) - REST, 0.0)
    return float(0.5 * K * np.sum(stretch**2) + MASS * 9.81 * CENTRE * c)


def curvature(angle: float, step: float = 1e-4) -> float:
    return (energy(angle + step) - 2.0 * energy(angle) + energy(angle - step)) / step**2


@pytest.mark.parametrize("shift", [0.0, 0.15, -0.4])
def test_rests_barrier_and_stiffness_of_a_hinged_link(shift: float, tmp_path: Path) -> None:
    path = link(tmp_path / "robot.xml", shift)
    robot = seecr.load_robot(path)
    home = robot.reference_pose
    grid = np.linspace(-np.pi, np.pi, 721)
    values = np.array([energy(angle) for angle in grid])
    lows = [g for g, a, v, b in zip(grid[1:-1], values, values[1:], values[2:], strict=False)
            if v < min(a, b)]  # fmt: skip
    found = seecr.equilibria(robot, home)
    assert len(lows) + 1 == len(found.pose) == 2  # the other one is upside down, at pi
    first = seecr.solve(robot, home)
    angle = minimize_scalar(energy, bounds=(-0.5, 0.5), method="bounded").x
    turned = 2.0 * np.arctan2(first.pose[0, 5], first.pose[0, 3])
    assert turned == pytest.approx(angle, abs=1e-5)
    stiff = curvature(turned)
    assert first.stiffness[0, 0, 0] == pytest.approx(stiff, rel=1e-5)
    inertia = 0.03 + MASS * CENTRE**2
    frequency = np.sqrt(stiff / inertia) / (2.0 * np.pi)
    assert first.frequencies[0] == pytest.approx([frequency], rel=1e-5)
    # the way to the other rest leads over the highest point on the lower side
    slope = lambda a: energy(a + 1e-6) - energy(a - 1e-6)  # noqa: E731
    top = brentq(slope, 1.0, 3.0)
    (barrier,) = seecr.barriers(first, found.rows([energy_ > first.energy[0] + 1.0
                                                   for energy_ in found.energy]))  # fmt: skip
    assert barrier.energy == pytest.approx(energy(top) - energy(angle), rel=1e-6)

    place = [str(value) for value in home[:3]]
    words = ran(f"seecr pose {path} {' '.join(place)}").stdout
    (line,) = [one for one in words.splitlines() if one.startswith("softest direction")]
    value = float(line.split("turn about y, ")[1].split(" N m/rad")[0])
    assert value == pytest.approx(stiff, rel=1e-3)
    assert "could also rest" in words and "180 deg, +" in words
    told = json.loads(ran(f"seecr pose {path} {' '.join(place)} --json").stdout)
    assert len(told["equilibria"]) == 2 and len(told["barriers"]) == 1


def test_a_slide_stays_in_newtons_per_metre(tmp_path: Path) -> None:
    path = link(tmp_path / "robot.xml", kind="slide", axis="0 0 1")
    words = ran(f"seecr pose {path} 0 0 0").stdout
    assert "softest direction: move along z, " in words and " N/m;" in words


def test_two_joints_and_a_ball_say_turns_in_their_unit(tmp_path: Path) -> None:
    path = link(tmp_path / "robot.xml", kind="ball")
    words = ran(f"seecr pose {path} 0 0 0").stdout
    (line,) = [one for one in words.splitlines() if one.startswith("softest direction")]
    assert line.startswith("softest direction: turn about ") and "N m/rad" in line


def test_a_map_and_a_sweep_of_one_hinge(tmp_path: Path) -> None:
    path = link(tmp_path / "robot.xml")
    out = ran(f"seecr map {path} --out {tmp_path / 'map'} --no-recording").stdout
    assert "turn about y, " in out and " N m/rad" in out and "N/m" not in out
    (tmp_path / "poses.csv").write_text("cmd_ry_deg\n0\n15\n-20\n")
    for word in ("sweep", "correct"):
        ran(f"seecr {word} {path} {tmp_path / 'poses.csv'} --out {tmp_path / word}", None)
    rows = json.loads((tmp_path / "sweep" / "sweep.json").read_text())["rows"]
    for row, angle in zip(rows, (0.0, 15.0, -20.0), strict=True):
        assert row["status"] == "converged"
        assert abs(2 * np.degrees(np.arctan2(row["pose"][5], row["pose"][3])) - angle) < 1.0


# --- SEECR against MuJoCo on robots that neither has seen: two physics, one description


SEEDS = range(5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", SEEDS)
def test_both_come_to_rest_at_the_same_place(kind: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(1000 + seed)
    path = write_mjcf(random_robot(rng, kind), tmp_path / "robot.xml")
    robot, settler = load_robot(path), Settler(path)
    poses = random_poses(rng, robot, 3)
    answer = solve(robot, poses)
    assert np.all(answer.converged)
    for i, pose in enumerate(poses):
        settled = settler.settle(pose, answer.rest_lengths[i])
        assert settled.settled, settled.status.value
        away = pose_difference(settled.pose, answer.pose[i])
        # what the unbalanced rest of either could move the softest direction by
        soft = answer.smallest_eigenvalue[i]
        slip = robot.weight * (settled.residual + answer.residual[i]) / soft
        assert np.linalg.norm(away[:3]) < 1e-8 * robot.length + 2 * slip
        assert np.linalg.norm(away[3:]) < 1e-7 + 2 * slip / robot.length
        pulls = settled.tensions - answer.tensions[i]
        assert np.abs(pulls).max() < 1e-6 * robot.weight
        barely = np.maximum(settled.tensions, answer.tensions[i]) < 1e-6 * robot.weight
        assert np.array_equal(settled.slack[~barely], answer.slack[i][~barely])


def test_a_cable_one_per_mille_stiffer_is_seen(tmp_path: Path) -> None:
    """The comparison above has teeth: so small a difference fails it."""
    rng = np.random.default_rng(1)
    robot = random_robot(rng)
    pose = random_poses(rng, robot, 1)
    answer = solve(robot, pose)
    taut = int(np.argmax(answer.tensions[0]))
    ea = robot.ea.copy()
    ea[taut] *= 1.001
    settler = Settler(write_mjcf(robot, tmp_path / "robot.xml"), ea=ea)
    settled = settler.settle(pose[0], answer.rest_lengths[0])
    away = pose_difference(settled.pose, answer.pose[0])
    assert np.linalg.norm(away[:3]) > 1e-6 * robot.length
