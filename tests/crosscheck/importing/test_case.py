"""Recordings as one case: their clocks, and what is said of the noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.importing import case
from crosscheck.measurements.data import Measurements, Sigma

POSES = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (2, 1))


def part(name: str, t_s: list[float]) -> Measurements:
    return Measurements(
        path=Path(f"{name}.csv"), n_cables=4, run=np.array(["a", "a"]), command_pose=POSES,
        t_s=np.array(t_s), position=np.full((2, 3), t_s[0]),
    )  # fmt: skip


def take(unit: str, **values: list[float]) -> Any:
    """A recording whose dwells have these numbers in one unit; the last dwell is not used."""
    dwells = SimpleNamespace(**{f"{what}_{unit}": np.array(one) for what, one in values.items()})
    other = "rad" if unit == "m" else "m"
    for what, one in values.items():
        setattr(dwells, f"{what}_{other}", np.array(one) * 0.0 + (what == "step"))
    return SimpleNamespace(dwells=dwells, used=np.arange(len(values["error"]) - 1))


def test_each_recording_begins_a_minute_after_the_one_before_and_is_its_own_run() -> None:
    first, second = part("one", [5.0, 9.0]), part("two", [100.0, 103.5])
    whole = case._one([first, second])
    assert whole.t_s is not None and whole.t_s.tolist() == [5.0, 9.0, 69.0, 72.5]
    assert len(whole.runs) == 2 and whole.files == () and not whole.file.any()
    np.testing.assert_array_equal(whole.position[:, 0], [5.0, 5.0, 100.0, 100.0])
    assert case._one([first]) is first


def test_the_noise_of_means_is_their_rms_over_all_recordings() -> None:
    some = [
        take("m", error=[3e-5, 9.0], scatter=[1e-4, 9.0], step=[1e-6, 1e-9]),
        take("m", error=[4e-5, 9.0], scatter=[1e-4, 9.0], step=[1e-6, 1e-9]),
    ]
    sigma = case._sigma(some, [np.array([0.3, 0.0, np.nan]), np.array([0.4])])
    assert sigma.position_m == pytest.approx(np.sqrt(12.5) * 1e-5, rel=5e-3)
    assert sigma.tension_N == pytest.approx(np.sqrt(0.125), rel=5e-3)
    assert sigma.orientation_rad is None


@pytest.mark.parametrize(("scatter", "stated"), [(0.49e-6, False), (0.51e-6, True)])
def test_a_scatter_below_half_of_the_last_digit_shows_no_noise(
    scatter: float, stated: bool
) -> None:
    some = [take("m", error=[1e-6, 0.0], scatter=[scatter, 0.0], step=[1e-6, 1.0])]
    assert (case._sigma(some, [np.zeros(0)]).position_m is not None) == stated


def test_what_noise_is_not_stated_is_said_of_what_was_read() -> None:
    data = replace(part("one", [0.0, 1.0]), sigma=Sigma(1e-4, None, 0.5))
    assert case._noise(data).endswith("of each dwell: position 0.1 mm, tension 0.5 N")
    turned = replace(data, quat_wxyz=POSES[:, 3:], sigma=Sigma())
    assert "dwell: none; position and orientation not stated: within" in case._noise(turned)
    known = replace(turned, sigma=Sigma(1e-4, np.radians(0.02)))
    assert case._noise(known).endswith("position 0.1 mm, orientation 0.02 deg")
