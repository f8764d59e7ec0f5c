"""Evidence of sets of effects in linear models: against integrals and whole covariances."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy import integrate, special, stats

from crosscheck.calibration.gram import ColumnGroup, Gram, averaged, best_widths, gram_of
from crosscheck.calibration.worth import log_gain, log_gains

WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])


def toy(seed: int = 0, groups: int = 5, size: int = 3, one_sided: bool = False) -> Gram:
    """Effects of a few columns each, of which the first and the third are there."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(60, groups * size))
    z = np.zeros(groups * size)
    z[:size], z[2 * size : 3 * size] = 1.5, -2.0
    y = x @ z + rng.normal(size=60)
    parts = {
        f"e{k}": ColumnGroup(np.arange(k * size, (k + 1) * size), WIDTHS, one_sided)
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
