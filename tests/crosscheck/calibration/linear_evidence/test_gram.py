"""Evidence of sets of effects in linear models: against integrals and whole covariances."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy import integrate, special, stats

from crosscheck.calibration.linear_evidence.gram import (
    ColumnGroup,
    Gram,
    averaged,
    averaging,
    best_widths,
    gram_of,
)
from crosscheck.calibration.linear_evidence.priors import widths_for
from crosscheck.calibration.linear_evidence.worth import log_gain, log_gains
from crosscheck.calibration.sets.exact import widths_near
from seecr.description.mjcf import load_robot
from seecr.effects import effect_named, layout_of

WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])


def toy(seed: int = 0, groups: int = 5, size: int = 3, one_sided: bool = False) -> Gram:
    """Effects of a few columns each, of which the first and the third are there."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(60, groups * size))
    z = np.zeros(groups * size)
    z[:size], z[2 * size : 3 * size] = 1.5, -2.0
    y = x @ z + rng.normal(size=60)
    parts = {
        f"e{k}": ColumnGroup(np.arange(k * size, (k + 1) * size), WIDTHS, np.full(size, one_sided))
        for k in range(groups)
    }
    return gram_of(x, y, parts)


def direct(seed: int, names: dict[str, float], groups: int = 5, size: int = 3) -> float:
    """ln N(y; 0, 1 + X W X^T), the constant left out."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(60, groups * size))
    z = np.zeros(groups * size)
    z[:size], z[2 * size : 3 * size] = 1.5, -2.0
    y = x @ z + rng.normal(size=60)
    whole = np.eye(60)
    for name, width in names.items():
        own = x[:, int(name[1:]) * size : (int(name[1:]) + 1) * size]
        whole = whole + width**2 * own @ own.T
    return float(-0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1]))


@pytest.mark.parametrize("count", [0, 1, 3, 5])
def test_evidence_of_a_set_is_that_of_its_whole_covariance(count: int) -> None:
    gram = toy()
    for names in combinations(gram.names, count):
        chosen = {name: (0.3, 1.0, 3.0)[k % 3] for k, name in enumerate(names)}
        assert gram.solved(chosen).log_evidence == pytest.approx(direct(0, chosen))


def test_the_sets_solved_last_are_kept_and_no_more() -> None:
    gram = toy()
    first = gram.solved({"e0": 1.0, "e1": 1.0})
    assert gram.solved({"e0": 1.0, "e1": 1.0}) is first
    assert gram.solved({"e1": 1.0, "e0": 1.0}) is not first  # columns in another order
    for width in np.linspace(0.1, 2.0, 30):
        gram.solved({"e0": float(width)})
    assert len(gram._last) == 8 and gram.solved({"e0": 1.0, "e1": 1.0}) is not first


def test_what_a_member_or_another_is_worth_is_the_difference_of_two_sets() -> None:
    gram = toy()
    chosen = {"e0": 1.0, "e2": 3.0}
    solved = gram.solved(chosen)
    for name in gram.names:
        rest = {n: w for n, w in chosen.items() if n != name}
        for width, gain in zip(WIDTHS, solved.gains(name), strict=True):
            more = gram.solved({**rest, name: width}).log_evidence
            assert gain == pytest.approx(more - gram.solved(rest).log_evidence, abs=1e-8)


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
        found = log_gains(normal, gradient, np.array([0.7]), one_sided=True)[0]
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
    found = log_gains(x.T @ x, x.T @ y, np.array([0.7]), np.array([True, True]))[0]
    assert found == pytest.approx(np.log(whole), abs=1e-6)
    group = ColumnGroup(np.arange(2), WIDTHS, np.array([True, True]))
    gram = gram_of(x, y, {"both": group})
    more = gram.solved({"both": 0.7}).log_evidence - gram.solved({}).log_evidence
    assert more == pytest.approx(np.log(whole), abs=1e-6)
    half = log_gains(x.T @ x, x.T @ y, np.array([0.7]), np.array([True, False]))[0]
    assert half > found, "the other may be negative, as it wants to be"


def bounded(seed: int) -> Gram:
    """Three effects of two columns that resemble one another; some cannot be negative."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(30, 6)) + 2.0 * rng.normal(size=(30, 1))
    y = x @ np.array([0.5, 0.2, 0.4, 0.0, 0.1, 0.3]) + rng.normal(size=30)
    sides = {"e0": (False, False), "e1": (True, False), "e2": (True, True)}
    return gram_of(x, y, {
        name: ColumnGroup(np.array([2 * k, 2 * k + 1]), WIDTHS, np.array(side))
        for k, (name, side) in enumerate(sides.items())
    })  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_what_a_width_costs_the_other_members_is_counted(seed: int) -> None:
    gram, chosen = bounded(seed), {"e0": 1.0, "e1": 0.3, "e2": 3.0}
    solved = gram.solved(chosen)
    for name in gram.names:
        whole = [gram.solved({**chosen, name: w}).log_evidence for w in WIDTHS]
        found = solved.gains_of_member(name)
        assert found - found[0] == pytest.approx(np.subtract(whole, whole[0]), abs=1e-8)
        at = list(WIDTHS).index(chosen[name])
        mean = special.logsumexp(whole) - np.log(len(whole))
        assert averaging(solved, name) == pytest.approx(mean - whole[at], abs=1e-8)


def test_no_member_is_replaced_by_others_that_would_have_to_be_negative() -> None:
    """Small stiffnesses had been explained by a frame that yields the wrong way."""
    rng = np.random.default_rng(0)
    yields = rng.normal(size=(60, 2))
    stiff = np.column_stack(
        [-(yields @ [1.0, 1.5]) + 0.02 * rng.normal(size=60), *rng.normal(size=(3, 60))]
    )
    x = 30.0 * np.column_stack([stiff, yields])
    y = x[:, 0] * 0.3 + rng.normal(size=60)
    groups = {"stiffness": ColumnGroup(np.arange(4), WIDTHS)}
    chosen = {"stiffness": 1.0, "frame": 1.0}
    free = {**groups, "frame": ColumnGroup(np.array([4, 5]), WIDTHS)}
    assert best_widths(gram_of(x, y, free), chosen)["stiffness"] == WIDTHS[0]
    held = {**groups, "frame": ColumnGroup(np.array([4, 5]), WIDTHS, np.array([True, True]))}
    assert best_widths(gram_of(x, y, held), chosen)["stiffness"] > WIDTHS[0]


def test_averaging_over_the_width_is_a_mean_of_evidences() -> None:
    gram = toy()
    normal, gradient = gram.solved({}).beside("e0")
    gains = log_gains(normal, gradient, WIDTHS)
    widths = WIDTHS.tolist()
    mean = special.logsumexp(gains) - np.log(len(widths))
    assert log_gain(normal, gradient, widths) == pytest.approx(mean)
    best = best_widths(gram, {"e0": 1.0})
    assert averaged(gram, best) == pytest.approx(gram.solved({}).log_evidence + mean)


def test_the_best_widths_are_the_best_of_all() -> None:
    gram = toy(3)
    found = best_widths(gram, {"e0": 1.0, "e1": 1.0, "e2": 1.0})
    every = [
        ({"e0": a, "e1": b, "e2": c}, gram.solved({"e0": a, "e1": b, "e2": c}).log_evidence)
        for a in WIDTHS for b in WIDTHS for c in WIDTHS
    ]  # fmt: skip
    assert found == max(every, key=lambda item: item[1])[0]


def test_a_price_keeps_a_width_that_is_nearly_as_good() -> None:
    gram = toy(3)
    assert best_widths(gram, {"e1": 1.0}, price=1e6) == {"e1": 1.0}


def test_widths_are_not_chosen_for_what_a_linear_model_promises_far_from_the_fit() -> None:
    # the first parameter of a group does what another effect does, if that is a hundred times
    # larger than it was fitted: by then no derivative holds any more
    rng = np.random.default_rng(5)
    one, own = rng.normal(size=200), rng.normal(size=(200, 4))
    x = np.column_stack([one, own, 0.3 * one])
    groups = {
        "group": ColumnGroup(np.arange(5), WIDTHS),
        "imitates": ColumnGroup(np.array([5]), WIDTHS),
    }
    gram = gram_of(x, 3.0 * one, groups)
    fitted = {"group": 1.0, "imitates": 0.1}
    z = np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    promised = best_widths(gram, fitted)
    assert promised == {"group": 0.1, "imitates": 10.0}
    assert averaged(gram, promised) > averaged(gram, fitted) + 2.0
    assert widths_near(gram, fitted, z) == (fitted, promised)


def test_what_wider_priors_promise_is_no_evidence_before_it_is_fitted() -> None:
    """Cables of a thousandth of a newton counted 13 for the weight that they might have had."""
    gram = gram_of(
        np.tile(np.random.default_rng(2).normal(size=(200, 1)), (1, 4)),
        np.full(200, 0.0) + 3.0 * np.random.default_rng(2).normal(size=200),
        {f"e{k}": ColumnGroup(np.array([k]), WIDTHS) for k in range(4)},
    )
    best = best_widths(gram, dict.fromkeys(gram.names, 1.0))
    narrow = dict.fromkeys(gram.names, float(min(WIDTHS)))
    alone = [averaging(gram.solved(narrow), name) for name in narrow]
    assert min(alone) > 20.0
    assert averaged(gram, narrow) == pytest.approx(gram.solved(narrow).log_evidence)
    assert averaged(gram, narrow) < gram.solved(best).log_evidence
    assert averaged(gram, best) < gram.solved(best).log_evidence


def test_widths_are_chosen_if_the_values_stay_where_they_were_fitted() -> None:
    gram = toy()
    fitted = dict.fromkeys(gram.names, 10.0)
    solved = gram.solved(fitted)
    assert solved.left_to_gain(solved.values) == pytest.approx(0.0)
    best = best_widths(gram, fitted)
    assert widths_near(gram, fitted, solved.values) == (best, None) and best != fitted


def test_what_is_left_to_gain_is_the_ln_posterior_lost_elsewhere() -> None:
    gram, chosen = toy(), {"e1": 0.3, "e4": 3.0}
    solved = gram.solved(chosen)
    z = np.random.default_rng(2).normal(size=15)

    def log_posterior(values: np.ndarray) -> float:
        normal = gram.normal[np.ix_(solved.columns, solved.columns)]
        away = gram.gradient[solved.columns] @ values - 0.5 * values @ normal @ values
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
    parts = {f"e{k}": ColumnGroup(np.arange(24 * k, 24 * k + 24), widths) for k in range(2)}
    gram = gram_of(np.concatenate([x, x], axis=1), y, parts)
    one, both = (
        averaged(gram, best_widths(gram, dict.fromkeys(names, 1.0)))
        for names in (["e0"], ["e0", "e1"])
    )
    assert both < one
