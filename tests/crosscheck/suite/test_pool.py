"""Processes that run cases several at a time."""

from __future__ import annotations

import signal

import pytest

from crosscheck.errors import CrosscheckError
from crosscheck.suite.pool import Pool

pytestmark = pytest.mark.slow

# Other processes import functions by name; those of a test's own module they would not find.
DOUBLE = (2).__mul__


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_items(jobs):
    told: list[int] = []
    with Pool(jobs) as pool:
        assert pool.run(DOUBLE, [3, 1, 2], [2, 0, 1], told.append) == [6, 2, 4]
    assert sorted(told) == [2, 4, 6]


def test_a_process_that_is_killed_is_told_with_what_to_do():
    with (
        Pool(2) as pool,
        pytest.raises(CrosscheckError, match=r"of 2 processes was killed.*try --jobs 1"),
    ):
        pool.run(signal.raise_signal, [signal.SIGKILL] * 2, [0, 1], lambda result: None)
