"""Commanded lengths: an equilibrium that the search missed is not taken for an effect."""

from pathlib import Path

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Measurements, Sigma

ROBOT = seecr.load_robot(seecr.model_path("ipanema"))
NOISE = Sigma(position_m=2e-4, orientation_rad=1e-3)


def by_lengths(rows: int = 40) -> Measurements:
    """A fully constrained robot all over its hall, without any effect, commanded in lengths."""
    random, run = np.random.default_rng(7), np.repeat(np.arange(4), rows // 4)
    pose = np.tile(ROBOT.reference_pose, (rows, 1))
    half = 0.35 * np.ptp(ROBOT.exit_points, axis=0)
    pose[:, :3] += random.uniform(-1.0, 1.0, (rows, 3)) * half
    at = seecr.solve(ROBOT, pose)
    home = np.tile(ROBOT.reference_pose, (rows, 1))
    fallen = seecr.solve(ROBOT, rest_lengths=at.rest_lengths, start=home)
    off = np.linalg.norm(fallen.pose[:, :3] - at.pose[:, :3], axis=1)
    assert np.sum(off > 0.1) >= 2  # from the reference pose, downhill, some rest twisted
    assert NOISE.position_m is not None
    read = at.pose[:, :3] + NOISE.position_m * random.standard_normal((rows, 3))
    return Measurements(
        Path("lengths.csv"), ROBOT.n_cables, np.char.add("run ", run.astype(str)),
        command_lengths=at.rest_lengths, t_s=np.arange(rows, dtype=float), sigma=NOISE,
        position=read,
    )  # fmt: skip


@pytest.mark.slow
def test_no_friction_and_no_creep_are_named_for_a_rest_that_was_missed() -> None:
    found = crosscheck.diagnose(ROBOT, by_lengths(), only=["creep", "exit_friction", "drum_gain"])
    assert found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    assert found.missing == ()
    assert found.before["position_rms_m"] == pytest.approx(2e-4, rel=0.2)
