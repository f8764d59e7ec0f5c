"""An exit point that yields differently upwards: in series with its cable, else not at all."""

from __future__ import annotations

import numpy as np
import pytest
from from_python import from_python
from one_cable import UP as ABOVE
from one_cable import cable, in_direction, pull

from seecr.compiled.cable_law import lift_slope, soften

softer, slope = from_python(soften), from_python(lift_slope)
UP = np.array([0.0, 0.6, 0.8])


@pytest.mark.parametrize("more", [3e-3, -1e-3, 0.0])
def test_the_compliance_upwards_is_in_series(more: float) -> None:
    """K^-1 grows by (c_up - c) z z^T."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((3, 3))
    stiffness, gradient = 40.0 * (root @ root.T + np.eye(3)), rng.standard_normal(3)
    series = np.linalg.inv(np.linalg.inv(stiffness) + more * np.outer(UP, UP))
    moved = series @ np.linalg.solve(stiffness, gradient)
    softer(more, UP, stiffness, gradient, np.empty(3))
    assert stiffness == pytest.approx(series, rel=1e-9)
    assert gradient == pytest.approx(moved, rel=1e-9)


def test_a_cable_across_the_vertical_does_not_lift_its_exit_point() -> None:
    across = np.array([1.0, 0.0, 0.0])
    assert slope(5.0, UP, 100.0 * np.outer(across, across)) == 1.0
    assert slope(5.0, UP, 100.0 * np.outer(UP, UP)) == pytest.approx(501.0)


@pytest.mark.parametrize("law", [{}, {"QUADRATIC": -218.0, "CUBIC": 25278.0}, {"QUADRATIC": -40.0}])
@pytest.mark.parametrize("series", [{}, {"WINCH_SIDE": 4.5}, {"RADIUS": 0.03}])
def test_the_lift_is_found_also_about_kinks(
    law: dict[str, float], series: dict[str, float]
) -> None:
    """Newton steps went to and fro about the kink of a cable that is lifted till it is slack.

    After fifty of them the force was that of no lift, and rows that can be held had stalled.
    """
    rng, lifts = np.random.default_rng(2), []
    for more in 10.0 ** rng.uniform(-4.0, -2.0, 60):
        anchor = in_direction(rng.uniform(20.0, 89.0), 2.0 + rng.uniform(-0.01, 0.08))
        here = pull(cable(**law, **series, LIFT=more), anchor)
        lifts.append(-more * (ABOVE @ here.force))
        there = pull(cable(**law, **series), anchor, -lifts[-1] * ABOVE)
        assert here.ok
        assert here.force == pytest.approx(there.force, rel=1e-9, abs=1e-9)
    assert min(lifts) < -0.03
