"""What may be taken for noise and what may not."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.calibration.colour import Colour
from crosscheck.calibration.strange import too_large

POSITION = np.array([0])


def noise(scale: float, rho: float) -> Colour:
    return Colour(np.array([scale, 1.0, 1.0]), np.array([rho, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("scale", "rho", "is_noise"),
    [
        (1.0, 0.0, True),
        (1.0, 0.8, True),  # of the stated size: a tracker is smooth in time
        (2.0, 0.0, True),  # white, and stated too small
        (2.0, 0.8, False),
        (4.0, 0.0, False),
    ],
)
def test_stated_noise_may_be_coloured_or_larger_but_not_both(
    scale: float, rho: float, is_noise: bool
) -> None:
    assert too_large(noise(scale, rho), POSITION, ["position"]) is not is_noise


@pytest.mark.parametrize(
    ("scale", "rho", "is_noise"), [(2.7, 0.8, True), (2.7, 0.95, False), (6.0, 0.5, False)]
)
def test_estimated_noise_may_be_larger_where_it_goes_together(
    scale: float, rho: float, is_noise: bool
) -> None:
    # differences of neighbours show 0.36 of AR(1) noise that goes together by 0.8
    assert too_large(noise(scale, rho), POSITION, []) is not is_noise


def test_kinds_that_were_not_read_do_not_count() -> None:
    colour = Colour(np.array([1.0, 9.0, 1.0]), np.zeros(3))
    assert not too_large(colour, POSITION, ["position", "orientation"])
