"""A block and tackle on a winch beside a band that nothing drives: both at once.

Its twin by hand has no pulley: n lines between two points pull as one of n^2 times the stiffness
and 1/n of the rest length, with n times the tension of each.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import seecr

FILE = """<mujoco model="tackle">
  <custom><text name="passive" data="band"/>{texts}</custom>
  <worldbody>
    <site name="A1" pos="-1 0 2"/><site name="A2" pos="1 0 2"/><site name="A3" pos="0 0 0"/>
    <body name="platform" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1.5" diaginertia="0.1 0.1 0.1"/>
      <site name="B1"/><site name="B2"/><site name="B3"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="left" {left}</spatial>
    <spatial name="right" springlength="0 1.41421356" stiffness="8485.28137">
      <site site="A2"/><site site="B2"/></spatial>
    <spatial name="band" {band}</spatial>
  </tendon>
</mujoco>
"""
L0, K, BAND_L0, BAND_K = 2.0 * 1.41421356, 2121.3203425, 0.7, 30.0
FALLS = np.array([2.0, 1.0, 2.0])
POSES = np.array(
    [[x, 0.0, z, 1.0, 0.0, 0.0, 0.0] for x, z in ((0, 1.2), (0.3, 1.3), (-0.2, 0.9), (0, 1.97))]
)
ENDS = np.array([[-1.0, 2.0], [1.0, 2.0], [0.0, 0.0]])


def line(spring: tuple[float, float], k: int, times: int) -> str:
    """The rest of a tendon that runs so many times between its points."""
    way = [f'<site site="{"AB"[j % 2]}{k}"/>' for j in range(times + 1)]
    return f'springlength="0 {spring[0]}" stiffness="{spring[1]}">{"".join(way)}'


@pytest.fixture(name="both")
def fixture_both(tmp_path: Path) -> tuple[seecr.Robot, seecr.Robot]:
    """The robot with tackles, and the same by hand."""
    out = []
    for name, times in (("tackle", 2), ("hand", 1)):
        path, n = tmp_path / f"{name}.xml", 2 // times
        springs = [(rest / n, n**2 * k) for rest, k in ((L0, K), (BAND_L0, BAND_K))]
        left, band = (line(one, k, times) for one, k in zip(springs, (1, 3), strict=True))
        path.write_text(FILE.format(texts="", left=left, band=band))
        out.append(seecr.load_robot(path))
    return out[0], out[1]


def energy(x: np.ndarray, command: np.ndarray) -> float:
    """Of the file, as it is written: lengths of the lines, paid out for a command; J."""
    pairs = ((2.0, L0, K), (1.0, 1.41421356, 8485.28137), (2.0, BAND_L0, BAND_K))
    home, total = np.array([0.0, 1.0]), 9.81 * 1.5 * x[1]
    for k, (falls, rest, stiffness) in enumerate(pairs):
        now, told, there = (float(np.linalg.norm(p - ENDS[k])) for p in (x, command, home))
        paid = rest if k == 2 else rest + falls * (told - there)
        stretch = max(falls * now - paid, 0.0)
        total += 0.5 * stiffness * rest / paid * stretch**2
    return total


def test_it_rests_where_the_energy_is_least(both: tuple[seecr.Robot, seecr.Robot]) -> None:
    robot, _hand = both
    assert robot.falls.tolist() == FALLS.tolist() and robot.driven.tolist() == [True, True, False]
    found = seecr.solve(robot, POSES)
    for k, pose in enumerate(POSES):
        told = pose[[0, 2]]
        rest = minimize(energy, told, (told,), "Nelder-Mead", options={"xatol": 1e-10, "fatol": 0})
        assert found.pose[k, [0, 2]] == pytest.approx(rest.x, abs=1e-7)
    # the band's own line: k (2 l - l0)
    length = np.linalg.norm(found.pose[:, [0, 2]], axis=1)
    assert found.tensions[:, 2] == pytest.approx(BAND_K * (2.0 * length - BAND_L0), rel=1e-9)


def test_it_is_the_robot_by_hand_with_its_lines_tensions(
    both: tuple[seecr.Robot, seecr.Robot],
) -> None:
    one, two = (seecr.solve(each, POSES) for each in both)
    np.testing.assert_allclose(one.pose, two.pose, atol=1e-12)
    np.testing.assert_allclose(one.tensions * FALLS, two.tensions, rtol=1e-9)
    read, plain = (seecr.predict(each, POSES).readings.tensions for each in both)
    np.testing.assert_allclose(read * FALLS, plain, rtol=1e-9)


@pytest.mark.parametrize("whole", [False, True])
def test_limits_and_aims_are_of_the_driven_lines(
    whole: bool, both: tuple[seecr.Robot, seecr.Robot]
) -> None:
    """Given for them, or for all lines: those of the band mean nothing."""
    robot, hand = both
    low, high = np.array([10.0, 15.0]), np.array([200.0, 300.0])
    own = [np.append(one, 7e3) if whole else one for one in (low, high)]
    line = seecr.tension_margin(robot, POSES, lowest=own[0], highest=own[1])
    cable = seecr.tension_margin(hand, POSES, lowest=FALLS[:2] * low, highest=FALLS[:2] * high)
    np.testing.assert_allclose(line, cable, atol=1e-9)
    assert (line > 0.0).any() and not (line > 0.0).all()
    held = POSES[line > 0.0]
    found = seecr.correct(robot, held, lowest=own[0], highest=own[1], aim="middle")
    other = seecr.correct(
        hand, held, lowest=FALLS[:2] * low, highest=FALLS[:2] * high, aim="middle"
    )
    assert found.reached.all()
    np.testing.assert_allclose(found.lengths, other.lengths, atol=1e-9)
    np.testing.assert_allclose(found.lengths[:, 2], BAND_L0 / 2.0)
    pulls = found.solution.tensions[:, :2]
    assert np.all(pulls >= low - 1e-6) and np.all(pulls <= high + 1e-6)


def test_what_is_saved_is_read_again(both: tuple[seecr.Robot, seecr.Robot], tmp_path: Path) -> None:
    """A weight on a doubled line pulls the platform with twice the line's tension."""
    robot, _hand = both
    robot.save(tmp_path / "saved.xml")
    again = seecr.load_robot(tmp_path / "saved.xml")
    for name in ("ea", "rest_lengths", "falls", "driven", "pushes", "constant_tension_N"):
        np.testing.assert_allclose(getattr(again, name), getattr(robot, name), rtol=1e-12)
    path = tmp_path / "weight.xml"
    weight = '<text name="constant_tension" data="left=9N"/>'
    left, band = line((0.0, 0.0), 1, 2), line((BAND_L0, BAND_K), 3, 2)
    path.write_text(FILE.format(texts=weight, left=left, band=band))
    hung = seecr.load_robot(path)
    assert hung.constant_tension_N[0] == pytest.approx(18.0)
    found = seecr.solve(hung, hung.reference_pose)
    assert found.converged[0] and found.tensions[0, 0] == pytest.approx(9.0)
    note = "tendon left runs 2 times between its points: read as one cable of 2 times its constant"
    assert any(note in one and "winch" not in one for one in hung.notes)
    hung.save(tmp_path / "hung.xml")
    assert seecr.load_robot(tmp_path / "hung.xml").constant_tension_N[0] == pytest.approx(18.0)
    assert 'data="left=9.0N"' in (tmp_path / "hung.xml").read_text()
