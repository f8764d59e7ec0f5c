"""An exit point that yields differently upwards: in series with its cable, else not at all."""

from __future__ import annotations

import numpy as np
import pytest
from from_python import from_python

from seecr.compiled.yielding import lift_slope, soften

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
