"""The evidence against a numerical integral over the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from linear_toy import LinearToy, toy
from scipy import integrate, special, stats

from crosscheck.fit.effects.evidence import _averaged, evidence, p_value
from crosscheck.fit.effects.gauss_newton import Fit

# Standard deviations of the prior, in plausible sizes, that the evidence is averaged over.
LAMBDAS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)


def small(name: str, z: float, scale: float = 0.1) -> tuple[LinearToy, Fit]:
    """A toy of one effect, each plausible size of which moves readings by a tenth of sigma."""
    made = toy({name: z / scale}, (name,), seed=3)
    made.columns[name][:] *= scale
    made = LinearToy(made.problem, made.columns, made.table)
    return made, made.fit(made.problem, made.terms(name))


def log_integral(found: Fit, lambdas: Sequence[float] = LAMBDAS) -> float:
    """ln of the mean over lambda of the likelihood integrated over the prior, by quadrature."""
    x = found.jacobian
    y = found.state.white + x @ found.terms.sizes
    best = np.linalg.lstsq(x, y, rcond=None)[0]
    floor = float(np.sum((y - x @ best) ** 2))
    spread = np.sqrt(np.diag(np.linalg.inv(x.T @ x)))

    def value(*z: float) -> float:
        # over the largest likelihood, which is put back below
        off = y - x @ np.array(z)
        prior = np.exp(-0.5 * np.dot(z, z) / width**2) / (np.sqrt(2.0 * np.pi) * width) ** len(z)
        return float(np.exp(-0.5 * (off @ off - floor)) * prior)

    total = 0.0
    for width in lambdas:
        ranges = []
        for k in range(len(best)):
            # the product of likelihood and prior is narrow about where either is
            middle = best[k] / (1.0 + (spread[k] / width) ** 2)
            ranges.append((middle - 12.0 * spread[k], middle + 12.0 * spread[k]))
        total += integrate.nquad(value, ranges, opts={"epsrel": 1e-9, "epsabs": 0.0})[0]
    return float(np.log(total / len(lambdas)) - 0.5 * floor)


@pytest.mark.parametrize("size", [0.0, 0.5, 3.0])
def test_of_one_parameter(size: float) -> None:
    _made, found = small("tracker_scale", size)
    expected = log_integral(found)
    assert evidence(found).log == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("size", [0.0, 3.0])
def test_of_values_that_belong_to_the_data(size: float) -> None:
    """One width: that they would fit into a narrower one is no merit of the model."""
    _made, found = small("tracker_scale", size)
    expected = log_integral(found, LAMBDAS[-1:])
    assert evidence(found, ("tracker_scale",)).log == pytest.approx(expected, abs=1e-4)


def test_beside_values_that_belong_to_the_data_others_are_averaged_as_ever() -> None:
    made = toy({"tracker_scale": 2.0, "platform_mass": 3.0}, ("tracker_scale", "platform_mass"))
    found = made.fit(made.problem, made.terms("tracker_scale", "platform_mass"))
    flat, both = evidence(found, ("tracker_scale",)), evidence(found)
    alone = [evidence(found, names).log for names in (("platform_mass",), found.terms.names)]
    assert flat.log != pytest.approx(both.log, abs=0.1) and flat.chi2 == both.chi2
    # each group is averaged beside the others at their best widths: what it gains adds up
    assert flat.log - alone[1] == pytest.approx(both.log - alone[0], abs=0.2)


@pytest.mark.slow
def test_of_two_parameters_that_go_together() -> None:
    made, _ = small("gravity_tilt", 0.8)
    columns = made.columns["gravity_tilt"]
    columns[..., 1] = 0.8 * columns[..., 0] + 0.6 * columns[..., 1]
    found = made.fit(made.problem, made.terms("gravity_tilt"))
    assert found.jacobian.shape[1] == 2
    assert evidence(found).log == pytest.approx(log_integral(found), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(9.0, 0.2), (0.2, 0.2), (9.0, 9.0)])
def test_effects_have_each_their_own_width(sizes: tuple[float, float]) -> None:
    """Beside a large effect a small one is not charged for the range of the large one.

    Against the mean over all pairs of widths, by determinants of the readings' covariance.
    """
    names = ("tracker_scale", "gravity_tilt")
    made = toy(dict(zip(names, sizes, strict=True)), names, seed=3)
    found = made.fit(made.problem, made.terms(*names))
    x = found.jacobian
    y = found.state.white + x @ found.terms.sizes
    own = [found.terms.own(name) for name in names]
    logs = []
    for a in LAMBDAS:
        for b in LAMBDAS:
            width = np.where(own[0], a, b)
            covariance = np.eye(len(y)) + (x * width**2) @ x.T
            sign, log_det = np.linalg.slogdet(covariance)
            assert sign > 0
            logs.append(-0.5 * float(y @ np.linalg.solve(covariance, y)) - 0.5 * log_det)
    exact = float(special.logsumexp(logs) - np.log(len(logs)))
    assert evidence(found).log == pytest.approx(exact, abs=0.1)


@pytest.mark.slow
def test_widths_of_effects_that_go_together_are_found_beside_each_other() -> None:
    """Against the mean over all pairs of widths; without looking again it is off by up to 2.3."""
    rng, off = np.random.default_rng(0), []
    for _ in range(300):
        p, q = rng.integers(1, 7, 2)
        own = np.arange(p + q) < p
        x, share = rng.standard_normal((60, p + q)), rng.uniform(0.0, 0.99)
        for k in range(q):
            x[:, p + k] = share * x[:, k % p] + np.sqrt(1.0 - share**2) * x[:, p + k]
        x *= rng.choice([1.0, 10.0, 100.0])
        sizes = [rng.standard_normal(n) * rng.choice([0.0, 0.01, 0.1, 1.0, 5.0]) for n in (p, q)]
        y = x @ np.concatenate(sizes) + rng.standard_normal(60)
        normal, gradient = x.T @ x, x.T @ y
        pairs = np.array([np.where(own, a, b) for a in LAMBDAS for b in LAMBDAS])
        inside = np.eye(p + q) + pairs[:, :, None] * normal * pairs[:, None, :]
        scaled = pairs * gradient
        best = np.linalg.solve(inside, scaled[..., None])[..., 0]
        logs = 0.5 * np.sum(scaled * best, axis=1) - 0.5 * np.linalg.slogdet(inside)[1]
        exact = float(special.logsumexp(logs) - np.log(len(pairs)))
        none = own & ~own
        off.append(abs(_averaged(normal, gradient, [own, ~own], none, none) - exact))
    assert max(off) < 0.6


def test_it_does_not_depend_on_where_the_fit_stopped() -> None:
    """Residuals and values belong together: y = r + X z is the same."""
    made, found = small("tracker_scale", 2.0)
    short = found.terms.with_vector(0.5 * found.terms.vector + 0.5 * found.terms.null)
    early = replace(found, state=made.state(made.problem, short))
    assert evidence(early).log == pytest.approx(evidence(found).log, abs=1e-8)


def test_what_the_data_do_not_see_costs_and_gains_nothing() -> None:
    made, plain = small("tracker_scale", 1.0)
    blind = replace(plain, derive=lambda: np.zeros_like(plain.jacobian))
    assert evidence(blind).log == pytest.approx(-0.5 * plain.chi2)
    assert evidence(blind).parameters == 0
    assert evidence(plain).parameters == 1
    assert evidence(made.base).log == pytest.approx(-0.5 * made.base.chi2)


def test_a_parameter_on_its_bound_is_left_out_of_the_formula() -> None:
    _made, plain = small("tracker_scale", 1.0)
    stopped = replace(plain, at_bound=np.ones(1, dtype=bool))
    assert evidence(stopped).log == pytest.approx(-0.5 * plain.chi2)


@pytest.mark.slow
def test_chances_of_a_fall_of_chi2_are_uniform_under_noise() -> None:
    """Linear fits of as many directions to noise alone."""
    rng = np.random.default_rng(1)
    x = np.linalg.qr(rng.standard_normal((60, 3)))[0]
    falls = np.sum((rng.standard_normal((3000, 60)) @ x) ** 2, axis=1)
    chances = [p_value(float(fall), 3, False) for fall in falls]
    assert stats.kstest(chances, "uniform").pvalue > 0.01
    # one that cannot be negative explains nothing in every other case
    signed = rng.standard_normal(3000)
    one_sided = [p_value(float(s * max(s, 0.0)), 1, True) for s in signed]
    low = np.array([p for p in one_sided if p < 0.5])
    assert stats.kstest(2.0 * low, "uniform").pvalue > 0.01
    assert one_sided.count(1.0) / 3000 == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize(("seen", "least", "most"), [(0.03, -0.1, 0.1), (3.0, -7.0, -4.0)])
def test_what_cannot_be_negative_and_is_nothing_is_charged(
    seen: float, least: float, most: float
) -> None:
    """Against the integral over half a Gaussian of friction, and over the cable's length."""
    names = ("exit_friction",)
    made = toy({}, names, seed=4)
    columns = made.columns["exit_friction"] * [seen, 0.1]
    table = made.table + columns @ [-0.02, 5.0]
    made = LinearToy(made.problem, {"exit_friction": columns}, table)
    null = made.terms(*names)
    x, y = columns[made.problem.counted], made.state(made.problem, null).white
    # the best length without friction
    length = float(x[:, 1] @ y / (x[:, 1] @ x[:, 1]))
    best = null.with_vector(null.scale * [0.0, length])
    state = made.state(made.problem, best)
    found = replace(
        made.fit(made.problem, null), state=state, derive=lambda: x,
        at_bound=np.array([True, False]),
    )  # fmt: skip

    def value(length: float, friction: float, width: float) -> float:
        off = y - x @ [friction, length]
        prior = 2.0 * np.exp(-0.5 * (friction**2 + length**2) / width**2)
        return float(np.exp(-0.5 * (off @ off - state.chi2)) * prior / (2.0 * np.pi * width**2))

    error = 1.0 / np.sqrt(np.sum(x**2, axis=0))
    total = 0.0
    for width in LAMBDAS:
        middle = best.sizes[1] / (1.0 + (error[1] / width) ** 2)
        spread = 12.0 / np.hypot(1.0 / error, 1.0 / width)
        total += integrate.dblquad(
            value, 0.0, spread[0], middle - spread[1], middle + spread[1], (width,), epsabs=0.0
        )[0]
    expected = float(np.log(total / len(LAMBDAS)) - 0.5 * state.chi2)
    assert evidence(found).log == pytest.approx(expected, abs=1e-3)
    one = replace(found, derive=lambda: x * [0.0, 1.0])
    assert least < evidence(found).log - evidence(one).log < most
