"""Evidence of sets in linear models: against integrals and whole covariances."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy import integrate, special, stats

from crosscheck.inference.about import widths_for
from crosscheck.inference.evidence import (
    Linear,
    MemberColumns,
    averaged,
    best_widths,
    log_evidence,
    log_gain,
)
from seecr.description.mjcf import load_robot
from seecr.effects import effect_named, layout_of

WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Five effects of three columns each, of which the first and the third are there."""
    rng = np.random.default_rng(seed)
    x, z = rng.normal(size=(60, 15)), np.zeros(15)
    z[:3], z[6:9] = 1.5, -2.0
    return x, x @ z + rng.normal(size=60)


def toy(seed: int = 0) -> Linear:
    """Their normal equations."""
    own = np.arange(15).reshape(5, 3)
    return Linear.of(*drawn(seed), {f"e{k}": MemberColumns(own[k], WIDTHS) for k in range(5)})


def direct(names: dict[str, float]) -> float:
    """ln N(y; 0, 1 + X W X^T), the constant left out."""
    (x, y), whole = drawn(0), np.eye(60)
    for name, width in names.items():
        own = x[:, int(name[1:]) * 3 : int(name[1:]) * 3 + 3]
        whole = whole + width**2 * own @ own.T
    return float(-0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1]))


@pytest.mark.parametrize("count", [0, 1, 3, 5])
def test_evidence_of_a_set_is_that_of_its_whole_covariance(count: int) -> None:
    linear = toy()
    for names in combinations(list(linear.groups), count):
        chosen = {name: (0.3, 1.0, 3.0)[k % 3] for k, name in enumerate(names)}
        assert linear.solved(chosen).log_evidence == pytest.approx(direct(chosen))


def test_what_a_member_or_another_is_worth_is_the_difference_of_two_sets() -> None:
    linear = toy()
    chosen = {"e0": 1.0, "e2": 3.0}
    solved = linear.solved(chosen)
    for name in list(linear.groups):
        rest = {n: w for n, w in chosen.items() if n != name}
        for width, gain in zip(WIDTHS, solved.gains(name), strict=True):
            more = linear.solved({**rest, name: width}).log_evidence
            assert gain == pytest.approx(more - linear.solved(rest).log_evidence, abs=1e-8)


def test_gain_of_half_a_gaussian_is_the_integral_over_it() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=40), rng.normal(size=40) * 0.5
    for sign in (1.0, -1.0):
        shifted = y + sign * 0.4 * x

        def likelihood(z: float, y: np.ndarray = shifted) -> float:
            ratio = np.exp(-0.5 * np.sum((y - x * z) ** 2) + 0.5 * np.sum(y**2))
            return float(ratio * 2.0 * stats.norm.pdf(z, scale=0.7))

        whole, _ = integrate.quad(likelihood, 0.0, 6.0, limit=200)
        normal, gradient = np.array([[x @ x]]), np.array([x @ shifted])
        found = log_gain(normal, gradient, [0.7], True)
        assert found == pytest.approx(np.log(whole), abs=1e-6)


def test_a_group_that_cannot_be_negative_is_the_integral_over_its_positive_part() -> None:
    """Two parameters, one of which wants to be negative; exact where they do not interfere."""
    rng = np.random.default_rng(4)
    x = np.linalg.qr(rng.normal(size=(40, 2)))[0] * np.array([3.0, 2.0])
    y = x @ np.array([0.8, -0.4]) + 0.3 * rng.normal(size=40)

    def likelihood(b: float, a: float) -> float:
        ratio = np.exp(-0.5 * np.sum((y - x @ [a, b]) ** 2) + 0.5 * np.sum(y**2))
        return float(ratio * np.prod(2.0 * stats.norm.pdf([a, b], scale=0.7)))

    whole, _ = integrate.dblquad(likelihood, 0.0, 5.0, 0.0, 5.0)
    found = log_gain(x.T @ x, x.T @ y, [0.7], [True, True])
    assert found == pytest.approx(np.log(whole), abs=1e-6)
    group = MemberColumns(np.arange(2), WIDTHS, np.array([True, True]))
    linear = Linear.of(x, y, {"both": group})
    more = linear.solved({"both": 0.7}).log_evidence - linear.solved({}).log_evidence
    assert more == pytest.approx(np.log(whole), abs=1e-6)
    half = log_gain(x.T @ x, x.T @ y, [0.7], [True, False])
    assert half > found, "the other may be negative, as it wants to be"


def bounded(seed: int) -> Linear:
    """Three effects of two columns that resemble one another; some cannot be negative."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(30, 6)) + 2.0 * rng.normal(size=(30, 1))
    y = x @ np.array([0.5, 0.2, 0.4, 0.0, 0.1, 0.3]) + rng.normal(size=30)
    sides = {"e0": (False, False), "e1": (True, False), "e2": (True, True)}
    return Linear.of(x, y, {
        name: MemberColumns(np.array([2 * k, 2 * k + 1]), WIDTHS, np.array(side))
        for k, (name, side) in enumerate(sides.items())
    })  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_what_a_width_costs_the_other_members_is_counted(seed: int) -> None:
    linear, chosen = bounded(seed), {"e0": 1.0, "e1": 0.3, "e2": 3.0}
    solved = linear.solved(chosen)
    for name in list(linear.groups):
        whole = [linear.solved({**chosen, name: w}).log_evidence for w in WIDTHS]
        found = solved.gains(name)
        assert found - found[0] == pytest.approx(np.subtract(whole, whole[0]), abs=1e-8)


def test_no_member_is_replaced_by_others_that_would_have_to_be_negative() -> None:
    """Small stiffnesses had been explained by a frame that yields the wrong way."""
    rng = np.random.default_rng(0)
    yields = rng.normal(size=(60, 2))
    stiff = np.column_stack(
        [-(yields @ [1.0, 1.5]) + 0.02 * rng.normal(size=60), *rng.normal(size=(3, 60))]
    )
    x = 30.0 * np.column_stack([stiff, yields])
    y = x[:, 0] * 0.3 + rng.normal(size=60)
    groups = {"stiffness": MemberColumns(np.arange(4), WIDTHS)}
    chosen = {"stiffness": 1.0, "frame": 1.0}
    free = {**groups, "frame": MemberColumns(np.array([4, 5]), WIDTHS)}
    assert best_widths(Linear.of(x, y, free), chosen).chosen["stiffness"] == WIDTHS[0]
    held = {**groups, "frame": MemberColumns(np.array([4, 5]), WIDTHS, np.array([True, True]))}
    assert best_widths(Linear.of(x, y, held), chosen).chosen["stiffness"] > WIDTHS[0]


def test_evidence_of_one_effect_is_a_mean_over_its_widths() -> None:
    linear = toy()
    each = [linear.solved({"e0": float(w)}).log_evidence for w in WIDTHS]
    mean = special.logsumexp(each) - np.log(len(each))
    best = best_widths(linear, {"e0": 1.0})
    assert log_evidence(best) == pytest.approx(mean)
    assert linear.solved({}).gain("e0") == pytest.approx(mean - linear.solved({}).log_evidence)
    assert averaged(np.array(each)) == pytest.approx(mean)


def test_the_best_widths_are_the_best_of_all() -> None:
    linear = toy(3)
    found = best_widths(linear, {"e0": 1.0, "e1": 1.0, "e2": 1.0})
    every = [
        ({"e0": a, "e1": b, "e2": c}, linear.solved({"e0": a, "e1": b, "e2": c}).log_evidence)
        for a in WIDTHS for b in WIDTHS for c in WIDTHS
    ]  # fmt: skip
    assert found.chosen == max(every, key=lambda item: item[1])[0]


def test_a_price_keeps_a_width_that_is_nearly_as_good() -> None:
    linear = toy(3)
    assert best_widths(linear, {"e1": 1.0}, price=1e6).chosen == {"e1": 1.0}


def test_what_is_left_to_gain_is_the_ln_posterior_lost_elsewhere() -> None:
    linear, chosen = toy(), {"e1": 0.3, "e4": 3.0}
    solved = linear.solved(chosen)
    z = np.random.default_rng(2).normal(size=15)

    def log_posterior(values: np.ndarray) -> float:
        normal = linear.normal[np.ix_(solved.columns, solved.columns)]
        away = linear.gradient[solved.columns] @ values - 0.5 * values @ normal @ values
        return float(away - 0.5 * np.sum((values / solved.width) ** 2))

    lost = log_posterior(solved.values) - log_posterior(z[solved.columns])
    assert solved.left_to_gain(z) == pytest.approx(lost)


@pytest.mark.parametrize("size", [0.3, 0.42, 0.56, 0.75, 1.0])
def test_what_one_effect_is_needs_no_other_that_acts_like_it(size: float) -> None:
    """Errors of exit points were shared with anchor points, which made up for a missing width."""
    rng = np.random.default_rng(2)
    x = 30.0 * rng.normal(size=(200, 24))
    y = x @ (size * np.sqrt(24.0 / 23.0) * stats.zscore(rng.normal(size=24))) + rng.normal(size=200)
    widths = widths_for(layout_of(effect_named("exit_point_error"), load_robot("demobot_cogiro")))
    parts = {f"e{k}": MemberColumns(np.arange(24 * k, 24 * k + 24), widths) for k in range(2)}
    linear = Linear.of(np.concatenate([x, x], axis=1), y, parts)
    one, both = (
        log_evidence(best_widths(linear, dict.fromkeys(names, 1.0)))
        for names in (["e0"], ["e0", "e1"])
    )
    assert both < one
