"""Laboratories of the shared data: coloured noise, outliers, many effects at once, unknown ones.

They were made by a simulator that shares nothing with this project. What is found there is judged
by what it predicts on another trajectory. All eighteen: ``make sweep``.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck import calibrate, diagnose
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.least_squares.problem import Problem, rms_by_kind
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.read import load_measurements
from seecr.description.mjcf import load_robot
from seecr.effects import Terms, catalogue

# Nothing missing in heavy tails; one effect beside outliers, positions alone; a memory through
# slackness; three at once in heavy tails; a frame that yields; few rows. Four at once, in B08, and
# what no catalogue holds, in B12 (of twins in test_unknown_effects.py), take three times as long.
IN_CI = ("B03", "B05", "B06", "B10", "B17", "B18")
CASES = [
    pytest.param(name, marks=[] if name in IN_CI else [pytest.mark.sweep])
    for name in (f"B{k:02d}" for k in range(1, 19))
]
# Errors on another trajectory, in units of the noise; a true model has 1.
WORTH = 1.5
FEW_ROWS = 100

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("case", CASES)
def test_lab(case: str, shared_data: Path) -> None:
    folder = shared_data / "labs" / case
    answer = json.loads((folder.parent / "answers.json").read_text())[case]
    found = diagnose(folder / "robot.xml", folder / "measured.csv")
    hidden = set(answer["hidden"])
    unknown = any(name.startswith("unknown") for name in hidden)
    if hidden == {"null"}:
        assert found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    elif hidden == {"sink"}:
        assert found.verdict is DiagnosisVerdict.MANY_EFFECTS
        fitted = re.search(r"(\d+) effects together do", found.sentence)
        # those without inputs or use are not among them: "all 25" were 20
        assert fitted is not None and 10 < int(fitted[1]) < len(catalogue()) - 2
    elif unknown:
        assert found.verdict in (DiagnosisVerdict.UNKNOWN_EFFECT, DiagnosisVerdict.MANY_EFFECTS)
        assert {effect.effect for effect in found.missing} <= hidden
    else:
        assert found.verdict is DiagnosisVerdict.EFFECTS_FOUND
        listed_are(found, hidden)
    rows = load_measurements(folder / "measured.csv", load_robot(folder / "robot.xml")).n_rows
    if not unknown and rows >= FEW_ROWS:
        assert worst_on(folder, model_of(found, folder), answer) < WORTH


def listed_are(found: Diagnosis, hidden: set[str]) -> None:
    """Just the hidden effects are listed, each itself or as one that cannot be told from it."""
    assert len(found.missing) == len(hidden)
    for effect in found.missing:
        assert hidden & {effect.effect, *(rival.name for rival in effect.rivals)}
        assert effect.probability > 0.95


def model_of(found: Diagnosis, folder: Path) -> Terms:
    """What the diagnosis lists, or the calibration that it sends to."""
    if found.verdict is DiagnosisVerdict.MANY_EFFECTS:
        return calibrate(folder / "robot.xml", folder / "measured.csv").terms
    return found.terms


def worst_on(folder: Path, terms: Terms, answer: dict[str, Any]) -> float:
    """The largest rms error on the other trajectory, over that of the noise."""
    robot = load_robot(folder / "robot.xml")
    data = load_measurements(folder / "validation.csv", robot)
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(terms.effects))
    rms = rms_by_kind(problem, evaluate(problem, terms, factor).raw)
    noise = {"position_rms_m": "noise_pos_m", "orientation_rms_rad": "noise_rot_rad"}
    return max((rms[key] or 0.0) / answer[name] for key, name in noise.items())
