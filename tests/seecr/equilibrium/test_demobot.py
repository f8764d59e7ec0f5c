"""DemoBot in both configurations, as the paper has it and as its own steps reproduce it.

The numbers of the parallel configuration at the ends of the sweep are those of the plain steps
(plain_steps.py), which share no code with the solver, at either cable.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from plain_steps import Plain, plain_fsolve

from seecr import Robot, Status, load_robot, solve
from seecr.description.mjcf import CABLES

HEIGHTS = (0.1, 0.2)
ENDS = {0.1: (26.4, 26.6, 34.0, 34.5, -11.0, -7.5), 0.2: (21.7, 22.1, 22.6, 22.9, -9.0, -5.8)}


def demobot(name: str, ea: float) -> Robot:
    return replace(load_robot(f"demobot_{name}"), ea=np.full(8, float(ea)))


def sweep(z: float) -> np.ndarray:
    """The paper's trajectory: x from 0.17 to 0.63 m, unturned."""
    return np.array([[x, 0.25, z, 1, 0, 0, 0] for x in np.linspace(0.17, 0.63, 24)])


def plain(robot: Robot, poses: np.ndarray) -> list[Plain]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # MINPACK's, of slow progress
        return [plain_fsolve(robot, pose) for pose in poses]


@pytest.mark.slow
@pytest.mark.parametrize("z", HEIGHTS)
@pytest.mark.parametrize("cable", CABLES)
@pytest.mark.parametrize("name", ["cogiro", "parallel"])
def test_the_plain_steps_of_the_paper_end_where_newton_does(
    name: str, cable: str, z: float
) -> None:
    robot = demobot(name, CABLES[cable])
    found, answer = plain(robot, sweep(z)), solve(robot, sweep(z))
    assert answer.converged.all()
    ok = [p.ok for p in found]
    assert sum(ok) >= 23
    away = np.array([p.deviation for p in found])[ok] - answer.deviation[ok]
    # as near as fsolve comes by default: a relative step of 1.5e-8
    assert np.abs(away[:, :3]).max() < 1e-7 and np.abs(away[:, 3:]).max() < 1e-6


@pytest.mark.parametrize("z", HEIGHTS)
@pytest.mark.parametrize("cable", CABLES)
def test_cogiro_keeps_a_steady_rotation(cable: str, z: float) -> None:
    """Figs 10 and 12: an almost straight line; every cable is taut all along."""
    answer = solve(demobot("cogiro", CABLES[cable]), sweep(z))
    assert answer.converged.all() and not answer.slack.any()
    tilt = np.rad2deg(np.linalg.norm(answer.deviation[:, 3:], axis=1))
    assert tilt.max() < (0.3 if cable == "fishing" else 0.03)
    assert np.all(answer.deviation[:, 2] < 0)
    assert np.ptp(answer.deviation[:, 2]) < 0.7e-3


def test_the_softer_cable_hangs_ten_times_lower() -> None:
    """Fig 12a: the fishing line lies below the Vectran, here by the ratio of their E S."""
    soft, stiff = (solve(demobot("cogiro", k), sweep(0.1)).deviation[:, 2] for k in (300, 3000))
    assert soft / stiff == pytest.approx(np.full(24, 10.0), rel=0.02)


@pytest.mark.parametrize("z", HEIGHTS)
@pytest.mark.parametrize("ea", [300.0, 3000.0, 3e4, 3e5, 3e6])
def test_parallel_tilts_at_both_ends_nearly_whatever_the_cable(ea: float, z: float) -> None:
    answer = solve(demobot("parallel", ea), sweep(z))
    assert answer.converged.all()
    low, high, dx_low, dx_high, dz_low, dz_high = ENDS[z]
    for end, side in ((0, 1.0), (23, -1.0)):
        rx, ry, rz = np.rad2deg(answer.deviation[end, 3:])
        assert low < side * ry < high
        assert abs(rx) < 1e-6 and abs(rz) < 1e-6
        dx, dy, dz = 1e3 * answer.deviation[end, :3]
        assert dx_low < side * dx < dx_high  # it never reaches the commanded x (Fig 12)
        assert abs(dy) < 1e-6 and dz_low < dz < dz_high
        # of each pair one is left: the upper one on the near side, the lower one opposite
        upper = np.array([True, False] * 4)
        near = (np.arange(8) < 4) == (end == 0)
        assert np.array_equal(~answer.slack[end], upper == near)


# --- the paper's own solver --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("z", HEIGHTS)
def test_residual_calls_of_the_papers_fsolve(z: float) -> None:
    """Section III-F: 14 iterations at best; several hundred at the ends of the parallel one."""
    easy = plain(demobot("cogiro", 300.0), sweep(z))
    assert all(p.ok for p in easy) and {p.calls for p in easy} <= {13, 14}
    hard = plain(demobot("parallel", 3000.0), sweep(z))
    assert hard[0].calls > 200 and min(p.calls for p in hard) <= 14


@pytest.mark.parametrize("ea", [1e4, 1e5, 1e6])
@pytest.mark.parametrize("z", HEIGHTS)
def test_the_papers_fsolve_fails_at_the_ends_from_1e4_newton(ea: float, z: float) -> None:
    robot = demobot("parallel", ea)
    assert not plain(robot, sweep(z)[:1])[0].ok  # ier != 1
    assert solve(robot, sweep(z)[0]).converged[0]


@pytest.mark.parametrize("ea", [1e5, 1e6])
@pytest.mark.parametrize("z", HEIGHTS)
def test_our_fsolve_says_so_where_it_gives_up(ea: float, z: float) -> None:
    """Scaled torques and exact stretches help it beyond 1e4 N, not to 1e5 N."""
    answer = solve(demobot("parallel", ea), sweep(z)[[0, 23]], method="fsolve")
    assert list(answer.status) == [Status.GAVE_UP, Status.GAVE_UP]
    assert np.all(answer.residual > 1e-9) and not answer.converged.any()


@pytest.mark.parametrize("x", [0.19, 0.25, 0.35])
def test_fsolve_may_land_on_an_unstable_branch_and_newton_does_not(x: float) -> None:
    """Cogiro, started one 20 mm step off: balanced, more than 60 degrees turned, far too high."""
    robot = demobot("cogiro", 300.0)
    pose, start = [x, 0.25, 0.1, 1, 0, 0, 0], [[x - 0.02, 0.25, 0.1, 1, 0, 0, 0]]
    wrong = solve(robot, pose, start=start, method="fsolve")
    assert wrong.status[0] is Status.UNSTABLE and not wrong.converged[0]
    assert wrong.residual[0] < 1e-9 and wrong.smallest_eigenvalue[0] < -10
    assert wrong.deviation[0, 2] > 0.015 and np.linalg.norm(wrong.deviation[0, 3:]) > 1.0
    right = solve(robot, pose, start=start)
    assert right.converged[0]
    assert right.deviation == pytest.approx(solve(robot, pose).deviation, abs=1e-10)
    assert right.energy[0] < wrong.energy[0]
