"""How far values are from nothing."""

from __future__ import annotations

import numpy as np
import pytest
from made_diagnoses import robot
from scipy import stats

from crosscheck.fit.effects.nothing import distance_from_nothing, is_nothing
from seecr.effects import Term, Terms

EVERY = np.ones(4, dtype=bool)


def offsets(*values: float) -> Terms:
    numbers = {f"offset_{k + 1}_m": value for k, value in enumerate(values)}
    return Terms([Term.of(robot(), "cable_length_offset", **numbers)])


def test_the_distance_from_nothing_counts_how_errors_go_together() -> None:
    terms = offsets(1e-3, 1e-3, 0.0, 0.0)
    apart = np.diag([1e-6, 1e-6, 1e-6, 1e-6])
    assert distance_from_nothing(terms, apart, EVERY) == (pytest.approx(2.0**0.5), 4)
    together = apart.copy()
    together[0, 1] = together[1, 0] = 0.9e-6
    # both up is what errors that go together do by themselves: chi2 = 2/(1 + 0.9)
    expected = (2.0 / 1.9) ** 0.5
    assert distance_from_nothing(terms, together, EVERY) == (pytest.approx(expected), 4)


def test_what_is_not_seen_shapes_or_is_fixed_is_no_distance() -> None:
    terms = offsets(1e-3, 5e-3, 0.0, 0.0)
    unseen = np.diag([1e-6, np.inf, 1e-6, 1e-6])
    assert distance_from_nothing(terms, unseen, EVERY) == (pytest.approx(1.0), 3)
    assert distance_from_nothing(terms, np.diag([np.inf] * 4), EVERY) == (0.0, 1)
    fixed = Terms([terms["cable_length_offset"].fixed()])
    assert distance_from_nothing(fixed, np.zeros((4, 4)), EVERY) == (np.inf, 0)
    creep = Terms([Term.of(robot(), "creep", amount=0.0, time_s=500.0)])
    far = np.diag([0.01, 1.0])
    assert distance_from_nothing(creep, far, np.ones(2, dtype=bool)) == (0.0, 1)


def test_within_one_standard_error_is_as_likely_for_several_values_as_for_one() -> None:
    assert is_nothing(0.99, 1) and not is_nothing(1.01, 1)
    for count in (3, 24):
        limit = float(np.sqrt(stats.chi2.ppf(stats.chi2.cdf(1.0, 1), count)))
        assert is_nothing(0.999 * limit, count) and not is_nothing(1.001 * limit, count)
    assert not is_nothing(np.inf, 0)
