"""Tensions nearest to wanted ones: against SciPy's own solvers, and with proofs where none are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear, minimize

from seecr.description.mjcf import load_robot, model_path
from seecr.errors import InputError
from seecr.tensions.distribution import distribute, nearly_balanced, tension_limits, wanted_tensions

SHAPES = [(6, 8), (3, 4), (6, 12), (2, 2)]


def problems(d: int, m: int, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Half of them with an answer at hand, some of it at the limits 0 and 2."""
    random = np.random.default_rng([d, m])
    matrix, load = random.normal(size=(n, d, m)), random.normal(size=(n, d))
    tension = random.uniform(0, 2, (n, m)) * (random.random((n, m)) < 0.7)
    load[::2] = np.einsum("ndm,nm->nd", matrix, tension)[::2]
    return matrix, load


@pytest.mark.parametrize(("d", "m"), SHAPES)
@pytest.mark.parametrize("high", [2.0, np.inf])
def test_there_are_tensions_where_highs_says_so(d: int, m: int, high: float) -> None:
    matrix, load = problems(d, m)
    tensions, found = distribute(matrix, load, np.ones(m), np.zeros(m), np.full(m, high))
    bounds = [(0.0, None if np.isinf(high) else high)] * m
    for i in range(len(load)):
        answer = linprog(np.zeros(m), A_eq=matrix[i], b_eq=load[i], bounds=bounds, method="highs")
        assert found[i] == (answer.status == 0), i
    left = np.einsum("ndm,nm->nd", matrix, tensions) - load
    assert np.abs(left[found]).max() < 1e-10
    assert tensions[found].min() >= 0.0 and tensions[found].max() <= high


def test_no_tensions_are_nearer() -> None:
    matrix, load = problems(6, 8)
    aim, high = np.linspace(0.2, 1.5, 8), np.full(8, 2.0)
    tensions, found = distribute(matrix, load, aim, np.zeros(8), high)
    for i in np.flatnonzero(found)[:12]:
        balance = {"type": "eq", "fun": lambda t, i=i: matrix[i] @ t - load[i]}
        best = minimize(
            lambda t: 0.5 * np.sum((t - aim) ** 2), np.ones(8), jac=lambda t: t - aim,
            constraints=balance, bounds=[(0, 2)] * 8, method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 300},
        )  # fmt: skip
        np.testing.assert_allclose(tensions[i], best.x, atol=1e-6)


def test_within_the_limits_the_middle_leads_to_the_closed_form() -> None:
    matrix, load = problems(6, 8)
    low, high = np.zeros(8), np.full(8, 2.0)
    middle = wanted_tensions("middle", low, high)
    left = load - np.einsum("ndm,m->nd", matrix, middle)
    closed = middle + np.einsum("nmd,nd->nm", np.linalg.pinv(matrix), left)
    within = ((closed > low) & (closed < high)).all(axis=1)
    tensions, found = distribute(matrix, load, middle, low, high)
    assert within.sum() > 10 and found[within].all()
    np.testing.assert_allclose(tensions[within], closed[within], atol=1e-10)


def test_tensions_many_times_the_load_are_found_too() -> None:
    # two nearly parallel cables against each other
    matrix = np.array([[[1.0, -1.0, 0.0], [1e-4, 1e-4, 1.0]]])
    load = np.array([[0.0, -1.0]])
    assert not distribute(matrix, load, np.zeros(3), np.zeros(3), np.full(3, np.inf))[1][0]
    tensions, found = distribute(matrix, -load, np.zeros(3), np.zeros(3), np.array([9e3, 9e3, 0]))
    assert found[0]
    np.testing.assert_allclose(tensions[0], [5e3, 5e3, 0], rtol=1e-9)


def test_limits_and_aims_that_mean_nothing_are_refused() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    for lowest, highest, words in (
        ([1, 2], 5, r"lowest must be one number or \(8,\)"),
        (2, 1, "0 <= lowest <= highest"),
        (-1, 1, "0 <= lowest <= highest"),
    ):
        with pytest.raises(InputError, match=words):
            tension_limits(robot, lowest, highest)
    low, high = tension_limits(robot, 0, np.inf)
    with pytest.raises(InputError, match="'middle' needs a highest tension"):
        wanted_tensions("middle", low, high)
    with pytest.raises(InputError, match="aim must be one of minimum, middle or tensions"):
        wanted_tensions("most", low, high)
    with pytest.raises(InputError, match=r"aim must be \(m,\) or \(n, m\) with m = 8"):
        wanted_tensions([1, 2], low, high)
    np.testing.assert_array_equal(wanted_tensions("middle", low, low + 4), np.full(8, 2.0))


@pytest.mark.parametrize("high", [np.inf, 0.6])
def test_few_cables_come_as_near_to_balance_as_least_squares(high: float) -> None:
    rng = np.random.default_rng(4)
    matrices, loads = rng.normal(size=(30, 3, 2)), rng.normal(size=(30, 3))
    low, most = np.full((30, 2), 0.1), np.full((30, 2), high)
    found = nearly_balanced(matrices, loads, low, most)
    assert np.all((found >= low) & (found <= most)) and np.any(found > low)
    left = np.einsum("ndm,nm->nd", matrices, found) - loads
    each = zip(matrices, loads, low, most, strict=True)
    theirs = [np.sqrt(2.0 * lsq_linear(a, b, ends).cost) for a, b, *ends in each]
    # of pulls that are nearly parallel, sixty sweeps are not enough
    size = np.linalg.norm(matrices, axis=1)
    apart = np.abs(np.sum(matrices[..., 0] * matrices[..., 1], axis=1)) < 0.9 * size.prod(axis=1)
    assert apart.sum() > 20
    assert np.linalg.norm(left, axis=1)[apart] == pytest.approx(np.array(theirs)[apart], rel=1e-6)
