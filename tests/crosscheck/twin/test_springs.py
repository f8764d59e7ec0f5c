"""Laws of cables that MuJoCo has no tendon for, against their closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crosscheck.twin.build import Cable, Springs
from crosscheck.twin.robot import TrueRobot, true_robot
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import effect_named

EA, REST = 300.0, 0.8


def true(name: str = "", **values: float) -> TrueRobot:
    robot = load_robot(model_path("demobot_parallel"))
    return true_robot(robot, [effect_named(name)(**values)] if name else [])


def cable(name: str = "", **values: float) -> Cable:
    """A cable in the middle of a run."""
    made = Cable(true(name, **values), EA, rest=REST)
    made.fresh = False
    return made


def test_a_plain_cable_touches_its_own_spring():
    rest, stiffness = cable().tangent(REST * 1.004)
    assert rest == pytest.approx(REST, rel=1e-12)
    assert stiffness == pytest.approx(EA / REST, rel=1e-12)


@pytest.mark.parametrize("strain", [1e-4, 3e-3, 2e-2])
def test_the_tangent_touches_a_stiffening_law(strain):
    one = cable("nonlinear_elasticity", quadratic=4.0, cubic=30.0)
    rest, stiffness = one.tangent(REST * (1.0 + strain))
    tension = EA * (strain + 4.0 * strain**2 + 30.0 * strain**3)
    slope = EA * (1.0 + 8.0 * strain + 90.0 * strain**2) / REST
    assert stiffness == pytest.approx(slope, rel=1e-10)
    assert stiffness * (REST * (1.0 + strain) - rest) == pytest.approx(tension, rel=1e-9)


def test_a_slack_cable_takes_up_at_its_rest_length():
    rest, stiffness = cable().tangent(0.9 * REST)
    assert rest == pytest.approx(REST, rel=1e-12)
    assert stiffness == pytest.approx(EA / REST, rel=1e-6)


def test_hysteresis_is_dahls_law():
    one = cable("hysteresis", amplitude=0.2, stretch=1e-3)
    tension, slope, part = one.tension(5e-3)
    expected = 0.2 * (1.0 - math.exp(-REST * 5e-3 / 1e-3))
    assert part == pytest.approx(expected, rel=1e-12)
    assert tension == pytest.approx(EA * 5e-3 + expected, rel=1e-12)
    ahead, behind = one.tension(5e-3 + 1e-7)[0], one.tension(5e-3 - 1e-7)[0]
    assert slope == pytest.approx((ahead - behind) / 2e-7, rel=1e-6)


def test_friction_holds_the_tension_behind_the_exit_point_within_the_capstans_grip():
    one = cable("exit_friction", friction=0.1, length=0.5)
    grip = math.exp(0.1)
    one.winch_tension = 2.0
    assert one.behind(2.0) == (2.0, 0.0)  # it sticks
    assert one.behind(3.0)[0] == pytest.approx(3.0 / grip)
    assert one.behind(1.0)[0] == pytest.approx(1.0 * grip)


def test_springs_meet_halfway():
    robot = true()
    lengths = robot.robot.rest_lengths
    short, long = Springs.plain(lengths, robot), Springs.plain(1.1 * lengths, robot)
    middle = short.halfway(long)
    np.testing.assert_allclose(middle.rest, 1.05 * lengths, rtol=1e-15)
    np.testing.assert_allclose(middle.stiffness, 0.5 * (short.stiffness + long.stiffness))
    np.testing.assert_allclose(short.stiffness * lengths, robot.ea, rtol=1e-15)
    assert np.all(short.poly == 0.0)
