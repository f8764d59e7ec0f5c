"""When an order of cables is the only one in which tensions balance the load, and when not."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.preparation.suspect_data.orders import reordered
from crosscheck.preparation.suspect_data.pulls import Pulls
from seecr.pose import Array

ROWS = np.ones(20, bool)


def pulls_of(
    measured: Array, expected: Array, sigma: float = 0.01, along: Sequence[int] = (0, 1, 2)
) -> Any:
    """Cables that pull in a plane, in other directions in each row; tensions (n, m).

    Args:
        along: number of each cable's direction: those with the same are parallel.
    """
    n, m = measured.shape
    turned = np.random.default_rng(0).normal(size=(n, 3))
    angle = (turned + np.array([0.0, 2.0, 4.0]))[:, along]
    matrix = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return SimpleNamespace(
        problem=SimpleNamespace(
            robot=SimpleNamespace(n_cables=m), sigma=SimpleNamespace(tension_N=sigma)
        ),
        matrix=matrix, measured=measured, expected=expected, whole=ROWS,
        held=lambda tensions: (matrix @ tensions[..., None])[..., 0],
    )  # fmt: skip


def tensions(*each: float) -> Array:
    """Of 20 rows, each cable's within a hundredth of a newton of one number."""
    return np.array(each) + 0.01 * np.random.default_rng(1).normal(size=(20, len(each)))


def test_the_order_that_balances_alone_is_found() -> None:
    true = tensions(2.0, 5.0, 9.0)
    found = reordered(pulls_of(true[:, [2, 1, 0]], true), ROWS)
    assert found is not None and found.cables == {0: 2, 2: 0}
    assert found.there == pytest.approx(0.01 * np.sqrt(3.0), rel=0.3) and found.here > 4.0


def test_of_two_orders_that_balance_alike_neither_is() -> None:
    """Two pairs of parallel cables, two of them with the same tension: either was exchanged."""
    true, pairs = tensions(5.0, 2.0, 9.0, 5.0), (0, 0, 1, 1)
    assert reordered(pulls_of(true[:, [2, 1, 0, 3]], true, along=pairs), ROWS) is None
    other = tensions(5.0, 2.0, 9.0, 7.0)
    found = reordered(pulls_of(other[:, [2, 1, 0, 3]], other, along=pairs), ROWS)
    assert found is not None and found.cables == {0: 2, 2: 0}


def test_what_is_less_than_the_noise_names_nothing() -> None:
    """The better order is so by luck: in the file's, as little is unbalanced as noise may leave."""
    true = tensions(2.0, 5.0, 9.0)
    wrong = true[:, [2, 1, 0]]
    assert reordered(pulls_of(wrong, true, sigma=1.0), ROWS) is not None
    assert reordered(pulls_of(wrong, true, sigma=3.0), ROWS) is None


def test_where_cables_pull_against_each_other_their_resultant_says_nothing() -> None:
    """Two rows: a load of a tenth of the tensions, and one of a hundredth."""
    robot = SimpleNamespace(n_cables=3, n_dof=2)
    problem: Any = SimpleNamespace(robot=robot)
    pulls = Pulls(problem, SimpleNamespace())  # type: ignore[arg-type]
    pulls.__dict__.update(
        matrix=np.tile([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]], (2, 1, 1)),
        read=np.ones((2, 3), bool),
        expected=np.array([[5.0, 5.0, 1.1], [5.0, 5.0, 0.1]]),
        measured=np.array([[5.0, 5.0, 2.2], [5.0, 5.0, 0.2]]),
    )
    carried = pulls.carried()
    assert carried[0] == pytest.approx(2.0) and np.isnan(carried[1])
