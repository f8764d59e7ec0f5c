"""What is no limits, no comparison, no terms: told in one sentence with its name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.comparison.limits import Limits
from seecr.prediction.experiment import Experiment

ROBOT = seecr.load_robot("planar_vertical")
COMMANDS = seecr.Commands(np.tile(ROBOT.reference_pose, (2, 1)))
EXPERIMENT = Experiment(ROBOT, COMMANDS)
MASS = seecr.Terms([seecr.Term(seecr.layout_of("platform_mass", ROBOT), [0.1])])
ODD = [None, 1, "x", [], {}, np.ones(3), object()]


@pytest.mark.parametrize("odd", ODD, ids=lambda one: type(one).__name__)
def test_arguments_of_other_kinds_are_told(odd: Any) -> None:
    with pytest.raises(seecr.InputError, match=r"^limits: expected a crosscheck.Limits, .* got "):
        crosscheck.exceeded(odd, odd)
    with pytest.raises(
        seecr.InputError, match=r"^found: expected a crosscheck.Comparison, .* got "
    ):
        crosscheck.exceeded(Limits(max_position=1.0), odd)
    at = EXPERIMENT.predict(MASS.effects)
    for arguments, name in (
        ((odd, MASS, at), "experiment: expected a seecr.Experiment"),
        ((EXPERIMENT, odd, at), "terms: expected a seecr.Terms"),
        ((EXPERIMENT, MASS, odd), "at: expected a seecr.Prediction"),
    ):
        with pytest.raises(seecr.InputError, match=f"^{name}, .* got {type(odd).__name__}"):
            seecr.sensitivities(*arguments)


@pytest.mark.parametrize("columns", [[1], [-1], [0.5], ["a"], 0, [[0]], None])
def test_columns_are_indices_of_parameters(columns: Any) -> None:
    at = EXPERIMENT.predict(MASS.effects)
    with pytest.raises(seecr.InputError, match=r"^columns: expected "):
        seecr.sensitivities(EXPERIMENT, MASS, at, columns)
    assert seecr.sensitivities(EXPERIMENT, MASS, at, [0]).shape[2] == 1


def test_a_prediction_for_other_commands_is_told() -> None:
    at = Experiment(ROBOT, COMMANDS.rows(np.arange(1))).predict(MASS.effects)
    with pytest.raises(seecr.InputError, match="at: expected a prediction for 2 commands, got 1"):
        seecr.sensitivities(EXPERIMENT, MASS, at)
