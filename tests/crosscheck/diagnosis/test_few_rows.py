"""With few rows and noise that nobody stated, correlated noise is not called an effect."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.fit.reasons import DiagnosisVerdict, Unfit
from crosscheck.measurements.data import Measurements, Sigma
from seecr.prediction.experiment import Experiment

ROBOT = seecr.load_robot(seecr.model_path("planar_vertical"))
NOISE_M = 1e-4


def drifting(rows: int, seed: int = 1) -> Measurements:
    """Two runs with noise that is correlated by 0.8 from row to row."""
    random, run = np.random.default_rng(seed), np.repeat(np.arange(2), rows // 2)
    pose = np.tile(ROBOT.reference_pose, (rows, 1))
    pose[:, 0] += 0.05 * np.sin(np.linspace(0.0, 9.0, rows))
    pose[:, 2] += 0.03 * np.cos(np.linspace(0.0, 7.0, rows))
    data = Measurements(
        Path("few.csv"), ROBOT.n_cables, np.char.add("run ", run.astype(str)),
        command_pose=pose, t_s=np.arange(rows, dtype=float),
    )  # fmt: skip
    noise = random.standard_normal((rows, 3))
    for k in range(1, rows):
        noise[k] = 0.8 * noise[k - 1] + np.sqrt(1.0 - 0.8**2) * noise[k]
    read = Experiment(ROBOT, data.as_commands(ROBOT)).predict().readings
    position = read.position + NOISE_M * (noise - noise.mean(axis=0)) * [1.0, 0.0, 1.0]
    return replace(data, position=position)


SOME = ["drum_eccentricity"]


def test_structure_in_few_rows_may_be_noise_that_nobody_stated() -> None:
    found = crosscheck.diagnose(ROBOT, drifting(20), only=SOME)
    assert found.verdict is DiagnosisVerdict.NO_VERDICT
    assert found.refusal is not None and found.refusal.unfit is Unfit.STRUCTURE_OR_NOISE
    assert "only 20 rows" in found.sentence and "stay at one pose" in found.measure_next[0]
    assert not found.missing and found.converged


@pytest.mark.slow
def test_correlated_noise_of_a_stated_size_is_an_effect_as_rarely_as_was_promised() -> None:
    """Names are given from 95 % on. Of 24 such noises, one imitates a drum that is not round."""
    said = [
        crosscheck.diagnose(
            ROBOT, replace(drifting(20, seed), sigma=Sigma(position_m=NOISE_M)), only=SOME
        ).verdict
        for seed in range(12)
    ]
    assert said.count(DiagnosisVerdict.NO_EFFECT_MISSING) >= 11
    more = crosscheck.diagnose(ROBOT, drifting(140), only=SOME)
    assert more.verdict is not DiagnosisVerdict.NO_VERDICT
