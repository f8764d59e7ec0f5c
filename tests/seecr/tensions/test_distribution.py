"""Tensions nearest to wanted ones: against SciPy's own solvers, and with proofs where none are."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

from seecr import InputError, load_robot
from seecr.compiled.tensions import least_beyond
from seecr.tensions.distribution import (
    can_balance,
    distribute,
    innermost,
    nearly_balanced,
    tension_limits,
    wanted_tensions,
    why_not_held,
    without_span,
)

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


@pytest.mark.parametrize("aim", [np.linspace(0.2, 1.5, 8), np.zeros(8), np.ones(8)])
def test_no_tensions_are_nearer(aim: np.ndarray) -> None:
    """Also where all cables start at a limit: the search must not go too far then."""
    matrix, load = problems(6, 8)
    tensions, found = distribute(matrix, load, aim, np.zeros(8), np.full(8, 2.0))
    for i in np.flatnonzero(found)[:12]:
        # the farthest that balanced tensions within limits go from there towards the wanted ones
        away = aim - tensions[i]
        far = linprog(-away, A_eq=matrix[i], b_eq=load[i], bounds=(0.0, 2.0), method="highs")
        assert -far.fun - away @ tensions[i] < 1e-8


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
    robot = load_robot("demobot_cogiro")
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


LINE = np.array([[[1.0, -1.0]]])  # two cables that pull a body along a line, one each way
ONE = np.ones(1)


@pytest.mark.parametrize(
    ("load", "high", "inside", "tensions"),
    [
        (0.0, 11.0, 5.0, (6.0, 6.0)), (2.0, 11.0, 4.0, (7.0, 5.0)), (10.0, 11.0, 0.0, (11.0, 1.0)),
        (20.0, 11.0, -5.0, None), (2.0, np.inf, np.inf, (np.nan, np.nan)),
    ],
)  # fmt: skip
def test_on_a_line_both_cables_are_as_far_from_their_limits(
    load: float, high: float, inside: float, tensions: tuple[float, float] | None
) -> None:
    low, most = np.ones((1, 2)), np.full((1, 2), high)
    margins, found = innermost(LINE, np.array([[load]]), low, most, ONE)
    assert margins[0] == pytest.approx(inside, abs=1e-12)
    assert tensions is None or found[0] == pytest.approx(tensions, nan_ok=True)


def test_on_a_line_one_cable_at_its_limit_leaves_the_rest_to_the_other() -> None:
    for load, high, nearest in ((2.0, 9.0, (6.0, 4.0)), (2.0, 5.5, (5.5, 3.5)), (5.6, 5.5, None)):
        given = np.full(2, 5.0), np.zeros(2), np.array([high, 9.0])
        tensions, found = distribute(LINE, np.array([[load]]), *given)
        assert found[0] == (nearest is not None)
        assert nearest is None or tensions[0] == pytest.approx(nearest)


@pytest.mark.parametrize("spare", [0, 1, 2])
@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.2, np.inf), (0.2, 1.5), (1.0, 0.5)])
def test_what_can_be_balanced_has_a_margin(spare: int, low: float, high: float) -> None:
    matrix, load = problems(2, 2 + spare, 300)
    n, _d, m = matrix.shape
    ends = np.full((n, m), low), np.full((n, m), high), np.ones(n)
    held = can_balance(matrix, load, *ends)
    np.testing.assert_array_equal(held, innermost(matrix, load, *ends)[0] >= -1e-9)
    assert held.sum() < n and held.any() == (low <= high)


@pytest.mark.parametrize("spare", [0, 1, 2])
@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.2, np.inf), (0.2, 1.5)])
def test_limits_are_exceeded_by_no_more_than_a_linear_program_says(
    spare: int, low: float, high: float
) -> None:
    """Unknowns of the program: tensions, and how far they are below and above the limits."""
    matrices, loads = problems(3, m := 3 + spare, 20)
    eye, none, pulls, most = np.eye(m), np.zeros((m, m)), np.empty(m), 0.0
    for matrix, load in zip(matrices, loads, strict=True):
        ends = np.full(m, low), np.full(m, high)
        assert least_beyond(matrix, load, *ends, pulls)
        ours = np.sum(np.maximum(low - pulls, 0.0) + np.maximum(pulls - high, 0.0))
        program = linprog(
            np.repeat([0.0, 1.0], [m, 2 * m]),
            A_ub=np.block([[-eye, -eye, none], [eye, none, -eye]]),
            b_ub=np.r_[-ends[0], np.minimum(ends[1], 1e6)],
            A_eq=np.hstack([matrix, np.zeros((3, 2 * m))]), b_eq=load,
            bounds=[(None, None)] * m + [(0.0, None)] * 2 * m, method="highs",
        )  # fmt: skip
        assert ours == pytest.approx(program.fun, rel=1e-7, abs=1e-9)
        most = max(most, ours)
    assert most > 0.1


# --- Sentences that say why a pose cannot be held


def test_a_load_that_no_pull_can_balance_is_told_as_such() -> None:
    """Two cables in a plane cannot take a torque out of nothing, however they pull."""
    matrix, load = np.array([[1.0, -1.0], [1.0, 1.0], [0.0, 0.0]]), np.array([0.0, 1.0, 0.5])
    names, low, high = ["a", "b"], np.zeros(2), np.full(2, np.inf)
    assert why_not_held(matrix, load, low, high, names).startswith("no pulls of the cables")
    short = why_not_held(matrix, np.array([0.0, 2.0, 0.0]), low, np.array([0.5, 9.0]), names)
    assert short == "cable a would have to pull 1 N, more than 0.5 N"
    less = why_not_held(matrix, np.array([0.0, 2.0, 0.0]), np.array([1.5, 0.0]), high, names)
    assert less == "cable a would have to pull 1 N, less than 1.5 N"
    large = why_not_held(matrix, np.array([0.0, 2e4, 0.0]), low, np.array([6000.0, 9e4]), names)
    assert large == "cable a would have to pull 10000 N, more than 6000 N"


def test_where_only_the_upper_limit_is_in_the_way_no_cable_is_said_to_push() -> None:
    """Two shallow cables from above and one from below: less is exceeded if the latter pushes."""
    matrix, load = np.array([[-1.0, 1.0, 0.0], [0.1, 0.1, -1.0]]), np.array([0.0, 50.0])
    high, names = np.full(3, 60.0), ["a", "b", "c"]
    said = [
        why_not_held(matrix, load, np.array([1.0, 1.0, low]), high, names) for low in (0.0, 1.0)
    ]
    for one, pull in zip(said, (250, 255), strict=True):
        parts = [f"cable {k} would have to pull {pull} N, more than 60 N" for k in "ab"]
        assert sorted(one.split("; ")) == parts
    above = why_not_held(matrix, np.array([0.0, -50.0]), np.ones(3), np.full(3, 9.0), names)
    assert "push" not in above and "cable c would have to pull" in above


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e4])
def test_the_lower_limit_is_told_whatever_its_size(size: float) -> None:
    """Three cables from above, on a point: nothing pulls against them."""
    up = np.array([[2.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    low, high, names = np.full(3, size), np.full(3, np.inf), ["a", "b", "c"]
    said = why_not_held(up, np.zeros(2), low, high, names)
    assert said.startswith(
        "without a load all cables could be slack, but not with the lower limit: cable"
    )
    assert said.count(f"{size:.3g} N" if size < 1e3 else f"{size:.0f} N") >= 2
    nothing = why_not_held(up, np.zeros(2), 0.0 * low, high, names)
    assert nothing.startswith("tensions at their limits would balance")
    loaded = why_not_held(up, np.array([0.0, size]), low, high, names)
    assert loaded.startswith("cable") and "without a load" not in loaded


def test_of_several_cables_one_is_named() -> None:
    gone, pulleys = np.array([False, True, True]), np.zeros(3, bool)
    assert without_span(gone, pulleys, ["a", "b", "c"]) == (
        "cable b would have no length, its anchor point at its exit point, nor would 1 more cable"
    )


def test_it_is_told_what_a_cable_weighs() -> None:
    matrix, load, names = np.array([[1.0, 1.0]]), np.array([5.0]), ["a", "b"]
    low, high = np.array([4.0, 4.0]), np.array([9.0, 9.0])
    push = why_not_held(matrix, np.array([-3.0]), low, high, names)
    assert re.fullmatch(
        "cable [ab] would have to push with 7 N to keep the others at 4 N or more", push
    )
    free = why_not_held(matrix, np.array([-3.0]), 0.0 * low, high, names)
    assert free in ("cable a would have to push with 3 N", "cable b would have to push with 3 N")
    less = why_not_held(matrix, load, low, high, names, np.array([4.0, 3.0]))
    assert less == "cable a would have to pull 1 N, less than the 4 N that it weighs"
    heavy = why_not_held(matrix, load, low, np.array([9.0, 2.0]), names, low)
    assert heavy == "cable b weighs 4 N, more than the 2 N it may pull"
    just = why_not_held(matrix, np.array([8.0]), low, high, names)
    assert just.startswith("tensions at their limits would balance the load")
