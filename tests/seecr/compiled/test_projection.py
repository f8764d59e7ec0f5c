"""Tensions nearest to wanted ones: by hand on a line, else no others that balance are nearer."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from seecr.compiled.tensions import FOUND, NONE, project, project_batch

LINE = np.array([[1.0, -1.0]])


def nearest(load: float, high: tuple[float, float]) -> tuple[int, np.ndarray]:
    out = np.empty(2)
    aim, low = np.array([5.0, 5.0]), np.zeros(2)
    return project(LINE, np.array([load]), aim, low, np.array(high), out), out


def test_on_a_line_both_change_by_half_of_the_load() -> None:
    assert nearest(2.0, (9.0, 9.0))[1] == pytest.approx([6.0, 4.0])


def test_one_at_its_limit_leaves_the_rest_to_the_other() -> None:
    outcome, tensions = nearest(2.0, (5.5, 9.0))
    assert outcome == FOUND and tensions == pytest.approx([5.5, 3.5])


def test_a_load_beyond_the_limits_is_proven_to_be_so() -> None:
    assert nearest(5.6, (5.5, 9.0))[0] == NONE


@pytest.mark.parametrize("wanted", ["anything", "lowest", "middle"])
def test_no_balanced_change_within_limits_comes_nearer(wanted: str) -> None:
    """Also where all cables start at a limit: the search must not go too far then."""
    rng = np.random.default_rng(7)
    n, d, m = 40, 6, 8
    matrix, low, high = rng.standard_normal((n, d, m)), np.full((n, m), 2.0), np.full((n, m), 8.0)
    aim = {"anything": rng.uniform(0.0, 10.0, (n, m)), "lowest": low, "middle": 0.5 * (low + high)}[
        wanted
    ]
    load = np.einsum("ndm,nm->nd", matrix, rng.uniform(2.0, 8.0, (n, m)))
    out, outcome = np.empty((n, m)), np.empty(n, dtype=np.int64)
    project_batch(matrix, load, aim, low, high, out, outcome)
    assert np.all(outcome == FOUND) and np.all((out >= low) & (out <= high))
    assert np.einsum("ndm,nm->nd", matrix, out) == pytest.approx(load, abs=1e-10)
    for k in range(n):
        # the farthest that balanced tensions within limits go from there towards the wanted ones
        away = aim[k] - out[k]
        far = linprog(-away, A_eq=matrix[k], b_eq=load[k], bounds=(2.0, 8.0), method="highs")
        assert -far.fun - away @ out[k] < 1e-6
