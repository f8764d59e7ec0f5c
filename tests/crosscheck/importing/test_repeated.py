"""Revisited poses tell what repeats; without them dwells tell a lower bound."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.importing.align import as_they_are, unturned
from crosscheck.importing.case import repeated
from crosscheck.measurements.data import Measurements, Sigma
from seecr.pose import quat_from_rotvec, quat_multiply, rotvec_from_quat

SCATTER = Sigma(position_m=6e-6, orientation_rad=1e-5)


def visits(runs: int, poses: int = 30) -> Measurements:
    """Poses visited in each of several runs, off by 0.02 mm and 0.1 mrad in each visit anew."""
    rng = np.random.default_rng(3)
    place = rng.uniform(-1.0, 1.0, (poses, 3))
    turn = quat_from_rotvec(rng.uniform(-0.3, 0.3, (poses, 3)))
    pose = np.tile(np.column_stack([place, turn]), (runs, 1))
    n = len(pose)
    shake = quat_from_rotvec(rng.normal(0.0, 1e-4, (n, 3)))
    return Measurements(
        Path("m.csv"), 4, np.repeat([f"r{k}" for k in range(runs)], poses), command_pose=pose,
        position=pose[:, :3] + 0.01 + rng.normal(0.0, 2e-5, (n, 3)),
        quat_wxyz=quat_multiply(shake, pose[:, 3:]),
    )  # fmt: skip


def test_revisited_poses_tell_what_repeats() -> None:
    sigma, source, said = repeated(visits(runs=5), SCATTER)
    # 120 further visits of three coordinates: known to 1 / sqrt(720), 4 %
    assert sigma.position_m == pytest.approx(2e-5, rel=0.12)
    assert sigma.orientation_rad == pytest.approx(1e-4, rel=0.12)
    assert source == "revisited"
    assert said.startswith("revisited poses (120 further visits) repeat to 0.02 mm and 0.005")


def test_poses_visited_once_tell_a_lower_bound() -> None:
    sigma, source, said = repeated(visits(runs=1), SCATTER)
    assert (sigma, source) == (SCATTER, "dwell_scatter")
    assert "the true noise may be larger" in said


def test_the_larger_noise_is_stated() -> None:
    sigma, source, _said = repeated(visits(runs=2), Sigma(position_m=1e-3))
    assert sigma.position_m == 1e-3 and source == "revisited"


def test_what_depends_on_the_way_there_is_no_noise() -> None:
    """Backlash: a pose that is reached from both sides is two poses."""
    data = visits(runs=6)
    back = np.arange(data.n_rows).reshape(6, -1)
    back[1::2] = back[1::2, ::-1]  # every second run goes back
    order = back.ravel()
    turned = data.rows(order)
    turned = replace(turned, run=np.sort(turned.run))
    backwards = np.repeat([False, True] * 3, 30)
    off = replace(turned, position=turned.position + 1e-3 * backwards[:, None])
    sigma, source, _said = repeated(off, SCATTER)
    assert source == "revisited" and sigma.position_m == pytest.approx(2e-5, rel=0.12)


def test_a_platform_that_turns_while_commands_do_not_is_asked_about() -> None:
    data = visits(runs=1)
    level = data.command_pose.copy()
    level[:, 3:] = [1.0, 0.0, 0.0, 0.0]
    (said,) = unturned(as_they_are(None), data.position, data.quat_wxyz, level)
    # turns of less than 0.5 rad are nearly vectors
    vectors = rotvec_from_quat(data.quat_wxyz)
    off = np.linalg.norm(vectors - vectors.mean(axis=0), axis=1)
    turned = float(said.partition("turns by ")[2].partition(" deg")[0])
    assert turned == pytest.approx(np.degrees(np.sqrt(np.mean(off**2))), rel=0.02)
    assert "is the orientation missing in the log of commands? Add cmd_qw" in said
    assert unturned(as_they_are(None), data.position, data.quat_wxyz, data.command_pose) == []
    assert unturned(as_they_are(None), data.position, None, level) == []
