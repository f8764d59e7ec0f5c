"""With few rows and noise that nobody stated, correlated noise is not called an effect."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.diagnosis.verdict import _may_be_noise
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.reasons import DiagnosisVerdict, Unfit
from crosscheck.measurements.data import Measurements, Sigma
from seecr.prediction.experiment import Experiment

ROBOT = seecr.load_robot(seecr.model_path("planar_vertical"))
NOISE_M = 1e-4


def drifting(rows: int) -> Measurements:
    """Two runs with noise that is correlated by 0.8 from row to row."""
    random, run = np.random.default_rng(1), np.repeat(np.arange(2), rows // 2)
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
    return replace(data, position=position, position_mask=np.ones(3, dtype=bool))


@pytest.mark.slow
def test_structure_in_few_rows_may_be_noise_that_nobody_stated() -> None:
    some = ["drum_eccentricity"]
    data = drifting(20)
    found = crosscheck.diagnose(ROBOT, data, only=some)
    assert found.verdict is DiagnosisVerdict.NO_VERDICT
    assert found.refusal is not None and found.refusal.unfit is Unfit.STRUCTURE_OR_NOISE
    assert "only 20 rows" in found.sentence and "stay at one pose" in found.measure_next[0]
    assert not found.missing and found.converged
    stated = replace(data, sigma=Sigma(position_m=0.1 * NOISE_M))
    assert crosscheck.diagnose(ROBOT, stated, only=some).verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    more = crosscheck.diagnose(ROBOT, drifting(140), only=some)
    assert more.verdict is not DiagnosisVerdict.NO_VERDICT


@pytest.mark.parametrize(
    "verdict, after_m, foretold_m, may_be",
    [
        (DiagnosisVerdict.EFFECTS_FOUND, 1.5e-4, None, True),
        (DiagnosisVerdict.EFFECTS_FOUND, 0.5e-4, None, False),  # no noise falls to a quarter
        (DiagnosisVerdict.UNKNOWN_EFFECT, 2.0e-4, None, True),
        (DiagnosisVerdict.UNKNOWN_EFFECT, 2.0e-4, 1.5e-4, True),
        (DiagnosisVerdict.NO_EFFECT_MISSING, 2.0e-4, None, False),
        # nothing is listed, but noise could not be foretold
        (DiagnosisVerdict.MANY_EFFECTS, 2.0e-4, 0.5e-4, False),
    ],
)
def test_a_name_in_few_rows_has_to_remove_most_of_the_error(
    verdict: DiagnosisVerdict, after_m: float, foretold_m: float | None, may_be: bool
) -> None:
    """Of 16 null sets of 20 or 36 rows three had a name: many parameters absorb such noise."""
    read = {"orientation_rms_rad": None, "tension_rms_N": None}
    together = SimpleNamespace(held_out={"position_rms_m": foretold_m, **read})
    found = SimpleNamespace(
        verdict=verdict, missing=("exit_point_error",),
        chances=SimpleNamespace(together=together) if foretold_m else None,
        before={"position_rms_m": 2e-4, **read}, after={"position_rms_m": after_m, **read},
    )  # fmt: skip
    data = drifting(20)
    every = np.ones(20, dtype=bool)
    assert _may_be_noise(found, Problem(ROBOT, data, data.sigma, every)) is may_be  # type: ignore[arg-type]
    stated = replace(data, sigma=Sigma(position_m=NOISE_M))
    assert not _may_be_noise(found, Problem(ROBOT, stated, stated.sigma, every))  # type: ignore[arg-type]
