"""Noise that goes together is noise; what only looks like it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured

from crosscheck.comparison.noise import Coloured
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot
from seecr.files import plain
from seecr.pose import Array

ROBOT = load_robot(COGIRO)
POINTS = 12


def data_of(change: Array) -> Measurements:
    data = measured(ROBOT, points=POINTS, seed=5)
    return replace(data, position=data.position + change)


def compared(change: Array) -> Comparison:
    return compare(ROBOT, data_of(change))


def rows() -> int:
    return measured(ROBOT, points=POINTS, seed=5).n_rows


def drifting(rho: float, size: float) -> Array:
    """AR(1) noise along all rows; that of the readings is added to it."""
    rng = np.random.default_rng(3)
    out = rng.normal(size=(rows(), 3))
    for k in range(1, len(out)):
        out[k] = rho * out[k - 1] + np.sqrt(1 - rho**2) * out[k]
    return size * out


def test_noise_that_goes_together_is_noise_and_is_told() -> None:
    found = compared(drifting(0.9, 0.8 * SIGMA.position_m))
    assert found.whiteness is not None and found.whiteness.structured
    assert found.is_noise
    assert found.coloured is not None and found.coloured.rho["position"] > 0.2
    assert "with a correlation of" in found.sentence
    assert plain(found.as_json())["coloured_noise"]["rho"]["position"] > 0.2


def test_the_same_several_times_larger_than_stated_is_not() -> None:
    found = compared(drifting(0.9, 4.0 * SIGMA.position_m))
    assert not found.is_noise and found.coloured is None


@pytest.mark.slow
def test_a_few_rows_far_off_are_noise_unless_they_lie_side_by_side() -> None:
    apart, together = np.zeros((rows(), 3)), np.zeros((rows(), 3))
    apart[5::23] += 40 * SIGMA.position_m
    together[40 : 40 + len(apart[5::23])] += 40 * SIGMA.position_m
    found = compared(apart)
    assert found.is_noise and found.outliers[5::23].all()
    assert found.sentence.endswith("left out of this.")
    assert not compared(together).is_noise


def test_white_noise_needs_no_colour() -> None:
    found = compared(np.zeros((rows(), 3)))
    assert found.is_noise and found.coloured is None


def test_noise_in_words_tells_what_is_more_than_its_size() -> None:
    noise = Coloured({"position": 1.25, "tension": 0.5}, {"position": 0.051, "tension": 0.05}, 1)
    assert noise.words == (
        "position 1.25 times the assumed noise, with a correlation of 0.05 from row to row, "
        "tension 0.50 times the assumed noise; 1 outlier"
    )
    assert replace(noise, outliers=0).words.endswith("tension 0.50 times the assumed noise")


def test_smooth_noise_of_unstated_size_may_as_well_be_something_missing() -> None:
    """Cables that sag were "noise, 2.59 times the assumed", where diagnose saw structure."""
    data = data_of(drifting(0.9, 4.0 * SIGMA.position_m))
    found = compare(ROBOT, replace(data, sigma=replace(data.sigma, position_m=None)))
    assert found.coloured is not None and found.coloured.scale["position"] > 1.5
    assert found.is_open and not found.is_noise
    assert found.sentence.startswith("The residuals may be noise (position ")
    assert found.sentence.endswith("that varies as smoothly: state the noise.")
    assert plain(found.as_json())["is_open"] is True
    white = compare(ROBOT, replace(data_of(np.zeros((rows(), 3))), sigma=Sigma()))
    assert white.is_noise and not white.is_open


def test_hardly_any_readings_are_no_noise_of_a_kind() -> None:
    """Noise 1.48 times the stated one is told of 60 readings; 57 do not show what kind it is."""
    larger = drifting(0.0, 1.2 * SIGMA.position_m)
    for count, shown in ((19, False), (20, True)):
        data = data_of(larger).rows(slice(50, 50 + count))
        data = replace(data, quat_wxyz=None, tensions=np.full_like(data.tensions, np.nan))
        found = compare(ROBOT, data)
        assert found.whiteness is not None and not found.whiteness.is_noise
        assert found.problem.n_readings == 3 * count
        assert (found.coloured is not None) == shown
