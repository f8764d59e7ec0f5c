"""Curves that lie on each other, and what they are called."""

from __future__ import annotations

import numpy as np

from seecr.curves import alike, joined


def lines(*ends: tuple[float, float]) -> np.ndarray:
    """Straight lines over 50 times from their first values to their last ones."""
    return np.stack([np.linspace(*pair, 50) for pair in ends], axis=1)


def test_curves_that_lie_on_each_other_have_one_name() -> None:
    one = lines((0.0, 1.0), (2.0, 3.0), (0.0, 1.0))
    assert alike([one]) == [[0, 2], [1]]
    assert alike([one, lines((0.0, 1.0), (2.0, 3.0), (0.0, 2.0))]) == [[0], [1], [2]]
    assert joined(["cable1", "cable3"]) == "cable1, 3"
    assert joined(["left", "right"]) == "left, right"
    assert joined(["a1", "b1"]) == "a1, b1" and joined(["rope"]) == "rope"
