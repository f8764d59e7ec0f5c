"""Where sequences end that converge slowly, or swing."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.inverse.aitken import to_their_limit


def test_changes_in_a_constant_ratio_end_at_their_limit() -> None:
    before = np.array([[2.0, -2.0, 2.0, 2.0, 0.0]])
    ratio = np.array([[0.95, -1.0, 0.0, 0.5, 0.0]])
    expected = before * np.array([[0.95 / 0.05, -0.5, 0.0, 1.0, 0.0]])
    assert to_their_limit(ratio * before, before) == pytest.approx(expected)


def test_what_grows_has_no_limit_and_what_swings_further_is_damped() -> None:
    before = np.array([1.0, 1.0, 1.0])
    assert to_their_limit(np.array([1.5, 0.995, -9.0]), before) == pytest.approx([1.5, 0.995, -3.0])
    # the first change of all has none before it
    assert to_their_limit(before, np.zeros(3)) == pytest.approx(before)
