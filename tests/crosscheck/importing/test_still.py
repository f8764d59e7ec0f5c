"""A body that stands still while the robot moves is the wrong one, and that is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.dwells import find_dwells, sample_noise
from crosscheck.importing.logs import Logged, Stream
from crosscheck.importing.take import refuse_still
from crosscheck.measurements.data import Measurements
from seecr.errors import InputFileError

T_S = np.arange(0.0, 10.0, 0.02)
STEPS = np.repeat(np.arange(5.0), 100)[:, None] * [0.1, 0.0, 0.0]
NOISE = 1e-4 * np.random.default_rng(0).standard_normal((len(T_S), 3))
HERE = np.array([0.1, 0.02, 0.03])


def log(**commands: NDArray[np.float64]) -> Measurements:
    return Measurements(Path("cmd.csv"), 2, np.array(["a"] * 5), t_s=2.0 * np.arange(5), **commands)


def poses(step: float) -> NDArray[np.float64]:
    place = step * np.arange(5.0)[:, None] * [1.0, 0.0, 0.0]
    return np.concatenate([place, np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))], axis=1)


def refused(place: NDArray[np.float64], commands: Measurements, body: str | None = "base") -> None:
    bodies = {"platform": (STEPS + NOISE, None), "base": (place, None)}
    line = np.arange(len(T_S))
    export = Logged(Path("take.csv"), T_S, line, bodies, {})
    stream = Stream(export.path, T_S, line, place)
    refuse_still(stream, export, commands, ImportChoices(body=body))


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("told", [{"command_pose": poses(0.1)},
                                  {"command_lengths": 1.0 + poses(0.1)[:, :2]}])  # fmt: skip
def test_a_body_that_never_moves_is_named_and_so_are_the_others(
    noise: float, told: dict[str, NDArray[np.float64]]
) -> None:
    """Its speed was "0 mm/s or less" and rest "below 0 mm/s", which nobody understands."""
    within = r"0\.1\d" if noise else "0"
    expected = (
        rf"take.csv: the body base never moves: it stays within {within} mm \(rms\), while the "
        r"commands of cmd.csv move the platform; .* \(--body\)\? The file also has platform.$"
    )
    with pytest.raises(InputFileError, match=expected):
        refused(HERE + noise * NOISE, log(**told))


def test_a_body_that_moves_or_should_not_is_none() -> None:
    refused(STEPS + NOISE, log(command_pose=poses(0.1)))
    refused(1e-2 * STEPS + NOISE, log(command_pose=poses(0.1)))
    refused(HERE + NOISE, log(command_pose=poses(0.0)))
    refused(HERE + NOISE, log(command_pose=poses(1e-4)))


def test_a_reading_that_never_changes_is_a_rest() -> None:
    """Nothing was slower than not at all."""
    line = np.arange(len(T_S))
    dwells = find_dwells(Stream(Path("a"), T_S, line, np.tile(HERE, (len(T_S), 1))), np.zeros(0))
    assert len(dwells) == 1 and dwells.samples.tolist() == [len(T_S)]


def test_noise_is_known_where_no_three_samples_follow_each_other() -> None:
    """It was NaN, with a warning, and nothing moved."""
    place = NOISE.copy()
    place[1::2] = np.nan
    found = sample_noise(Stream(Path("take.csv"), T_S, np.arange(len(T_S)), place))
    assert found == pytest.approx(1e-4 * np.sqrt(3.0), rel=0.3)
