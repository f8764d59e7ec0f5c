"""The fast periodogram is SciPy's, and needs no matrix of rows by frequencies."""

import tracemalloc

import numpy as np
import pytest
from scipy import signal

from crosscheck.comparison.quantities import periodogram

SPAN = 100.0


def uneven(n: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    t = np.sort(random.uniform(0.0, SPAN, n)) + 7.0
    values = np.sin(2.0 * np.pi * 0.31 * t) + 0.3 * random.standard_normal(n)
    return t, values - values.mean()


def test_power_is_that_of_the_slow_sum() -> None:
    t, values = uneven(400)
    step, count = 0.25 / SPAN, 600
    fast = periodogram(t, values, step, count)
    slow = signal.lombscargle(t, values, 2.0 * np.pi * step * np.arange(1, count + 1))
    assert np.argmax(fast) == np.argmax(slow)
    # what spreading over two cells costs at the shortest period
    assert fast == pytest.approx(slow, rel=0.04, abs=1e-3 * slow.max())


def test_memory_grows_with_rows_and_frequencies_and_not_with_their_product() -> None:
    t, values = uneven(15_000)
    tracemalloc.start()
    periodogram(t, values, 0.25 / SPAN, 20_000)
    _now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6  # the product would be 2.4e9 bytes
