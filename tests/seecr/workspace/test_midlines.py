"""The paper's points V and H along sweeps, and for which robots there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from seecr.description.mjcf import load_robot, model_path
from seecr.equilibrium.solving import solve
from seecr.pose import transform_points
from seecr.workspace.bars import midline_points
from seecr.workspace.planar import midline_point

VERTICAL = load_robot(model_path("planar_vertical"))
HORIZONTAL = load_robot(model_path("planar_horizontal"))


def line(n: int) -> np.ndarray:
    poses = np.zeros((n, 7))
    poses[:, 0], poses[:, 2], poses[:, 3] = np.linspace(0.17, 0.63, n), 0.2, 1.0
    return poses


@pytest.mark.parametrize(("robot", "name"), [(VERTICAL, "V"), (HORIZONTAL, "H")])
def test_they_are_where_the_midlines_meet(robot: object, name: str) -> None:
    found = solve(robot, line(9))
    met = midline_points(found)
    assert met is not None and (met.name, met.axes) == (name, "xz")
    ends = transform_points(found.pose, found.robot.anchor_points)[..., [0, 2]]
    for k, point in enumerate(met.points):
        plain = midline_point(found.robot.exit_points[:, [0, 2]], ends[k])
        assert point[[0, 2]] == pytest.approx(plain, abs=1e-12) and point[1] == 0.0
        assert met.beside[k] == pytest.approx(point[0] - found.pose[k, 0], abs=1e-12)
    assert abs(met.beside[4]) < 1e-9
    assert (np.abs(met.beside).max() < 1e-9) == (name == "H")
    most = 1e3 * met.beside.max()
    far = f"; on the way it is between -{most:.2f} and +{most:.2f}" if name == "V" else ", +0.00"
    first, last = (f"x z {1e3 * x:.2f} {1e3 * z:.2f}" for x, _, z in met.points[[0, -1]])
    way = f"point {name} goes from {first} to {last} mm"
    assert str(met) == f"{way}{far} mm beside the line of the weight"
    (one,) = midline_points(solve(robot, line(1))).lines()
    assert one.startswith(f"point {name} is at {first} mm, ")


def test_a_centre_of_mass_that_is_off_counts() -> None:
    aside = replace(HORIZONTAL, centre_of_mass=np.array([0.004, 0.0, 0.0]))
    found = solve(aside, line(3))
    met = midline_points(found)
    assert met is not None
    centre = transform_points(found.pose, aside.centre_of_mass[None])[:, 0]
    assert met.beside == pytest.approx(met.points[:, 0] - centre[:, 0], abs=1e-12)
    assert np.abs(met.beside).max() > 1e-3


def test_other_robots_have_none() -> None:
    for name in ("demobot_parallel", "camera", "planar_two_cable"):
        robot = load_robot(model_path(name))
        assert midline_points(solve(robot, robot.reference_pose)) is None
    free = replace(VERTICAL, joints=())
    on_its_side = replace(VERTICAL, gravity=np.array([0.0, -9.81, 0.0]))
    askew = replace(VERTICAL, exit_points=VERTICAL.exit_points + np.eye(4, 3) * 1e-3)
    for other in (free, on_its_side, askew):
        assert midline_points(solve(other, VERTICAL.reference_pose)) is None
