"""Where sequences end that converge slowly, or swing."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.inverse.aitken import damped, to_their_limit


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


def test_changes_get_smaller_where_the_last_did_not() -> None:
    part, before = np.array([1.0, 0.6, 0.4, 0.15]), np.ones(4)
    size = np.array([0.99, 0.5, 0.9, 2.0])
    assert damped(part, size, before) == pytest.approx([0.5, 0.66, 0.44, 0.1])
    assert damped(part, np.full(4, 0.1), before).max() == 1.0


def test_changes_are_whole_where_all_of_the_last_would_have_been_right() -> None:
    """A tenth made of each leaves nine tenths, round after round, and no error falls until the
    cable slips.
    """
    part = np.array([0.5, 0.1, 0.1])
    assert damped(part, np.array([0.5, 0.9, 1.0]), np.ones(3)).tolist() == [1.0, 1.0, 0.1]
    assert damped(part, np.ones(3), np.full(3, np.inf)) == pytest.approx(1.1 * part)


def test_damped_changes_end_a_cycle() -> None:
    """x -> 2 - x goes to and fro for ever."""
    x, part, before = np.array([0.0]), np.ones(1), np.array([np.inf])
    for _ in range(20):
        error = np.abs(x - 1.0)
        part = damped(part, error, before)
        x, before = x + part * (2.0 - 2.0 * x), error
    assert x == pytest.approx(1.0, abs=1e-6)
