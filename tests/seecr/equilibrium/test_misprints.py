"""The paper's misprints (docs/misprints.md): what is taken is right, what is printed is not."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from seecr import load_robot, model_path
from seecr.pose import quat_from_rxyz, quat_to_matrix

ROOT = Path(__file__).resolve().parents[3]


def unbalanced(theta: float, exits: np.ndarray, place: np.ndarray, h: float) -> float:
    """Zero where two cable tensions can carry a bar of half length h, turned by theta [rad].

    The determinant of the three wrenches (force x, force y, torque) of the two cables and of the
    weight, in the paper's x-y plane with y upwards; written without its formulas.
    """
    ends = np.array([[-h, 0.0], [h, 0.0]]) @ np.array(
        [[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]]
    )
    unit = exits - (place + ends)
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    torque = ends[:, 0] * unit[:, 1] - ends[:, 1] * unit[:, 0]
    wrenches = np.array([[*unit[0], torque[0]], [*unit[1], torque[1]], [0.0, -1.0, 0.0]])
    return float(np.linalg.det(wrenches)) / h


def balanced_tilt(exits: np.ndarray, place: np.ndarray, h: float) -> float:
    return float(brentq(unbalanced, -1.2, 1.2, args=(exits, place, h), xtol=1e-14))


def equation_5(exits: np.ndarray, place: np.ndarray, *, numerator: str, denominator: str) -> float:
    (a1x, a1y), (a2x, a2y) = exits
    px, py = place
    a = (a1y - py) * (a2x - px) + (a2y - py) * (a1x - px)
    b = 2 * (a1x - px) * (a2x - px)
    root = np.sqrt(b**2 + a**2)  # eq 6
    sum_or_difference = a1x + a2x if numerator == "corrected" else a1x - a2x
    top = 2 * px**2 - 2 * px * sum_or_difference + 2 * a1x * a2x + root
    first = px * (a1y + a2y - 2 * py) if denominator == "corrected" else px * py * (a1y + a2y - 2)
    return float(2 * np.arctan(top / (first + py * (a1x + a2x) - a1x * a2y - a2x * a1y)))


EXITS = np.array([[0.1, 1.3], [1.2, 1.1]])  # nothing equal, nothing zero


@pytest.mark.parametrize("place", [(0.4, 0.6), (0.5, 0.2), (0.9, 0.7)])
def test_equation_5_as_printed_is_no_equilibrium(place: tuple[float, float]) -> None:
    here = np.array(place)
    truth = balanced_tilt(EXITS, here, 1e-6)
    taken = equation_5(EXITS, here, numerator="corrected", denominator="corrected")
    assert taken == pytest.approx(truth, abs=1e-5)
    for numerator, denominator in (("printed", "corrected"), ("corrected", "printed")):
        printed = equation_5(EXITS, here, numerator=numerator, denominator=denominator)
        assert abs(printed - truth) > np.deg2rad(1)


@pytest.mark.parametrize(("h", "degrees"), [(1e-6, -25.5), (0.1, -30.9)])
def test_two_cable_tilt_where_three_forces_meet(h: float, degrees: float) -> None:
    exits, place = np.array([[0.0, 0.5], [1.0, 0.5]]), np.array([0.3, 0.0])
    theta = balanced_tilt(exits, place, h)
    assert np.rad2deg(theta) == pytest.approx(degrees, abs=0.05)
    (x1, y1), (x2, y2) = exits - place
    s, c = np.sin(theta), np.cos(theta)
    terms = [-2 * x1 * x2 * s, h * s * c * (x1 - x2), c * (y1 * x2 + y2 * x1), h * c**2 * (y2 - y1)]
    assert sum(terms) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("h", [0.02, 0.1, 0.2])
def test_two_cable_tilt_with_exit_points_at_different_heights(h: float) -> None:
    place = np.array([0.5, 0.3])
    theta = balanced_tilt(EXITS, place, h)
    (x1, y1), (x2, y2) = EXITS - place
    s, c = np.sin(theta), np.cos(theta)
    terms = [-2 * x1 * x2 * s, h * s * c * (x1 - x2), c * (y1 * x2 + y2 * x1), h * c**2 * (y2 - y1)]
    assert sum(terms) == pytest.approx(0, abs=1e-12)
    assert abs(terms[3]) > 1e-4  # the last term is seen here


def test_step_4_guess_falls_by_the_mean_length() -> None:
    model = mujoco.MjModel.from_xml_path(str(model_path("demobot_cogiro")))
    data = mujoco.MjData(model)
    for _ in range(3000):
        mujoco.mj_step(model, data)
    fall = model.body("platform").pos[2] - data.body("platform").xpos[2]
    robot = load_robot("demobot_cogiro")
    vertical = robot.exit_points[:, 2] - (robot.reference_pose[2] + robot.anchor_points[:, 2])
    guess = robot.weight * vertical / robot.ea
    assert 0.3 < guess.mean() / fall < 3
    assert guess.sum() / fall > 10


def test_equation_8_turns_the_anchor_points_of_the_platform_frame() -> None:
    path = str(model_path("demobot_cogiro"))
    model, robot = mujoco.MjModel.from_xml_path(path), load_robot(path)
    data = mujoco.MjData(model)
    quat = quat_from_rxyz(np.array([0.3, -0.2, 0.5]))
    data.qpos[:] = [0.35, 0.28, 0.2, *quat]
    mujoco.mj_forward(model, data)
    assert robot.nominal_lengths(data.qpos[None])[0] == pytest.approx(data.ten_length, abs=1e-15)
    r = quat_to_matrix(quat)
    in_base = robot.anchor_points @ r.T  # what eq 8 as printed would turn a second time
    twice = np.linalg.norm(robot.exit_points - (data.qpos[:3] + in_base @ r.T), axis=1)
    assert np.max(np.abs(twice - data.ten_length)) > 0.005


def test_equilibrium_is_equation_3() -> None:
    model = mujoco.MjModel.from_xml_path(str(model_path("demobot_cogiro")))
    data = mujoco.MjData(model)
    for _ in range(3000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    exits = np.array([data.site(f"A{i + 1}").xpos for i in range(8)])
    anchors = np.array([data.site(f"B{i + 1}").xpos for i in range(8)])
    unit = (exits - anchors) / np.linalg.norm(exits - anchors, axis=1)[:, None]
    matrix = np.vstack([unit.T, np.cross(anchors - data.body("platform").xpos, unit).T])
    rest = model.tendon_lengthspring[:, 1]
    tension = np.maximum(0, 3000 * (data.ten_length - rest) / rest)  # eqs 10, 11
    load = np.array([0, 0, -0.4 * 9.81, 0, 0, 0])
    assert matrix @ tension + load == pytest.approx(np.zeros(6), abs=1e-5)  # at rest in MuJoCo
    assert np.linalg.norm(matrix @ tension) > 3.9  # without the load nothing balances


def test_angles_are_rx_then_ry_then_rz() -> None:
    rx, ry, rz = 0.3, -0.4, 0.9

    def about(axis: int, angle: float) -> np.ndarray:
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        r = np.eye(3)
        r[i, i] = r[j, j] = np.cos(angle)
        r[j, i], r[i, j] = np.sin(angle), -np.sin(angle)
        return r

    taken = quat_to_matrix(quat_from_rxyz(np.array([rx, ry, rz])))
    assert taken == pytest.approx(about(0, rx) @ about(1, ry) @ about(2, rz), abs=1e-15)
    assert np.max(np.abs(taken - about(2, rz) @ about(1, ry) @ about(0, rx))) > 0.1


def test_every_row_of_the_table_names_a_test_that_exists() -> None:
    text = (ROOT / "docs" / "misprints.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text)
    rows = [r for r in text.splitlines() if r.startswith("| ") and "`tests/" in r]
    tables = [r for r in text.splitlines() if r.startswith("| ")]
    assert len(rows) == len(tables) - 2 >= 14  # all but the two header rows
    for file, test in named:
        assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8"), f"{file}::{test}"
