"""A fit and its score against the whole covariance of the readings."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, robot
from noise_covariance import covariance
from scipy import integrate, special

from crosscheck.fit.problem import Problem
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.evidence import averaged
from crosscheck.inference.fields import Varying
from crosscheck.inference.fit import Data, Fit, fit, without_rows
from crosscheck.inference.hypothesis import scored, wider
from crosscheck.inference.noise import Noise, NoisePrior
from crosscheck.inference.priors import FIELD_WIDTHS, WIDTHS
from seecr.effects import Term, Terms, layout_of
from seecr.effects.base import Knowledge
from seecr.pose import Array

NAMES = ("stiffness", "length_scale", "platform_mass")


@cache
def data_of(radius_m: float = 0.0, factor: float = 0.9) -> Data:
    hidden = [term(robot(), "stiffness", factor=factor)]
    hidden += [term(robot(), "pulley_radius", radius_m=radius_m)] if radius_m else []
    data = measured(robot(), hidden, points=3, sigma=SIGMA, tensions=True)
    problem = Problem(robot(), data, SIGMA, np.ones(data.n_rows, dtype=bool))
    return Data.of(problem, Terms())


def at_null(*names: str) -> Terms:
    layouts = [layout_of(name, robot()) for name in names]
    return Terms(Term(one, one.null) for one in layouts)


@cache
def fitted(*names: str) -> Fit:
    data = data_of()
    return fit(data, data.state(at_null(*(names or NAMES))))


def measured_apart(terms: Terms) -> Terms:
    """The first of them known from elsewhere, to a hundredth of its expected size."""
    first, *others = terms
    scale, null = first.layout.scale, first.layout.null
    apart = Knowledge(np.array([False]), null + 0.2 * scale, 0.01 * scale)
    return Terms([replace(first, knowledge=apart), *others])


def known_power(found: Fit, z: Array) -> float:
    """Of what was measured apart: ((z_known - z)/s)^2."""
    return float(((0.2 - z[0]) / 0.01) ** 2) if has_known(found) else 0.0


def has_known(found: Fit) -> bool:
    return bool(np.isfinite(found.terms.knowledge.value[0]))


def field_of(data: Data) -> Array:
    """Two columns that differ from row to row and from channel to channel."""
    random = np.random.default_rng(7)
    return random.normal(size=(data.problem.n_readings, 2)) * [2.0, 0.5]


def whole(found: Fit) -> Array:
    """(N, N) covariance of the readings, their noise and the field."""
    own = covariance(found.data.chain, found.noise, found.weight)
    return own if found.field is None else own + found.field @ found.field.T


def objective(found: Fit, z: Array, inverse: Array) -> float:
    """-2 ln of likelihood and prior at values z, but for a constant, solved anew."""
    layouts = [t.layout for t in found.terms]
    null, scale = (np.concatenate([getattr(one, k) for one in layouts]) for k in ("null", "scale"))
    left = found.data.state(found.terms.with_vector(null + z * scale)).white
    prior = float(np.sum((z / found.width) ** 2)) + known_power(found, z)
    return float(left @ inverse @ left) + prior


def curvature(found: Fit, inverse: Array) -> Array:
    """Half the second derivative of the objective where the model is linear, by differences."""
    layouts = [t.layout for t in found.terms]
    null, scale = (np.concatenate([getattr(one, k) for one in layouts]) for k in ("null", "scale"))

    def white(z: Array) -> Array:
        return found.data.state(found.terms.with_vector(null + z * scale)).white

    step = 1e-4 * np.eye(len(found.z))
    x = np.stack([(white(found.z + s) - white(found.z - s)) / 2e-4 for s in step], axis=1)
    known = np.where((np.arange(len(step)) == 0) & has_known(found), 0.01**-2.0, 0.0)
    return np.asarray(x.T @ inverse @ x + np.diag(found.width**-2.0 + known))


CASES = pytest.mark.parametrize("beside", ["nothing", "a field", "what is known"])


def fitted_beside(beside: str) -> Fit:
    data, terms = data_of(), at_null(*NAMES)
    terms = measured_apart(terms) if beside == "what is known" else terms
    return fit(data, data.state(terms), field=field_of(data) if beside == "a field" else None)


@CASES
def test_a_fit_ends_where_the_objective_is_least_and_knows_how_sharply(beside: str) -> None:
    found = fitted_beside(beside)
    assert has_known(found) == (beside == "what is known")
    inverse = np.linalg.inv(whole(found))
    half = curvature(found, inverse)
    assert found.settled and not found.at_bound.any() and found.free.all()
    np.testing.assert_allclose(found.spread, np.linalg.inv(half), rtol=0.02)
    least = objective(found, found.z, inverse)
    error = np.sqrt(np.diag(found.spread))
    for k in range(len(found.z)):
        for by in (-0.3, 0.3):
            z = found.z.copy()
            z[k] += by * error[k]
            more = objective(found, z, inverse) - least
            # a fit ends once a step gains less than a hundredth
            assert more == pytest.approx((by * error[k]) ** 2 * half[k, k], rel=0.1, abs=0.03)
    scale = found.terms.scale
    np.testing.assert_allclose(found.stderr, error * scale)
    np.testing.assert_allclose(found.correlation, found.spread / np.outer(error, error), atol=1e-12)
    assert found.seen.all()


def test_the_field_takes_its_most_probable_part_of_a_residual() -> None:
    data = data_of()
    field = field_of(data)
    found = fit(data, data.state(at_null("stiffness")), field=field)
    noise, r = covariance(data.chain, found.noise, found.weight), found.state.white
    precise = np.linalg.inv(noise)
    most = np.linalg.solve(np.eye(2) + field.T @ precise @ field, field.T @ precise @ r)
    np.testing.assert_allclose(found.left, r - field @ most, atol=1e-8)
    both = np.linalg.inv(whole(found))
    assert found.metric.power(r) == pytest.approx(r @ both @ r)
    normal, gradient = found.metric.normal(found.jacobian, r)
    np.testing.assert_allclose(normal, found.jacobian.T @ both @ found.jacobian)
    np.testing.assert_allclose(gradient, found.jacobian.T @ both @ r, atol=1e-6)


@CASES
def test_the_noise_of_a_fit_is_the_likeliest_with_its_effects_integrated_out(beside: str) -> None:
    found = fitted_beside(beside)
    data, x, field = found.data, found.jacobian, found.field
    width, middle = found.width.copy(), np.zeros(len(found.z))
    if has_known(found):  # the prior and what is known make a narrower one
        width[0] = (width[0] ** -2.0 + 0.01**-2.0) ** -0.5
        middle[0] = 0.2 * (width[0] / 0.01) ** 2
    y = found.state.white + x @ (found.z - middle)
    wide = (x * width**2) @ x.T + (0.0 if field is None else field @ field.T)

    def likelihood(noise: Noise) -> float:
        every = wide + covariance(data.chain, noise, found.weight)
        return float(-0.5 * (y @ np.linalg.solve(every, y) + np.linalg.slogdet(every)[1]))

    best = likelihood(found.noise)
    for kind in (0, 1, 2):
        for by in (-0.2, 0.2):
            scale, rho = found.noise.scale.copy(), found.noise.rho.copy()
            scale[kind] *= np.exp(by)
            rho[kind] = np.clip(rho[kind] + 1.5 * by, 0.0, 0.97)
            assert likelihood(Noise(scale, found.noise.rho)) < best
            assert likelihood(Noise(found.noise.scale, rho)) < best + 0.01


def test_without_rows_a_fit_is_that_of_the_others() -> None:
    """Also where the row before is absent, which then foretells nothing."""
    whole_fit = fitted(*NAMES)
    found = replace(whole_fit, noise=Noise(whole_fit.noise.scale, np.array([0.5, 0.0, 0.3])))
    row = found.data.problem.row_of
    absent = (row % 3 == 1) | (row > row.max() // 2)
    state = without_rows(found, absent)
    some = np.flatnonzero(~absent)
    before = [-1 if k >= 0 and absent[k] else k for k in found.data.chain.before]
    own = covariance(replace(found.data.chain, before=before), found.noise, found.weight)
    inverse = np.zeros_like(own)
    inverse[np.ix_(some, some)] = np.linalg.inv(own[np.ix_(some, some)])
    at = replace(found, state=state)

    def of(z: Array) -> float:
        return objective(at, z, inverse)

    step = 0.01 * np.sqrt(np.diag(found.spread)) * np.eye(len(at.z))
    slope = [(of(at.z + s) - of(at.z - s)) / (2.0 * np.abs(s).max()) for s in step]
    best = of(at.z - 0.5 * np.linalg.solve(curvature(at, inverse), slope))
    # a fit ends once a step gains less than a thousandth
    assert of(at.z) < best + 2e-3 * best < of(found.z) - 0.5, "the other rows had a say"


def test_a_fit_begins_with_noise_as_large_as_the_median_residual() -> None:
    data = data_of(factor=0.6)
    begun = fit(data, data.state(Terms()), rounds=0)
    for kind in (0, 1, 2):
        size = np.median(np.abs(begun.state.white[data.chain.kind == kind])) / 0.6745
        assert begun.noise.scale[kind] == pytest.approx(max(1.0, size))
    assert begun.noise.scale.max() > 2.0 and not begun.noise.rho.any()


def test_a_value_that_would_have_to_be_negative_stays_on_its_bound() -> None:
    data = data_of(factor=1.1)
    found = fit(data, data.state(at_null("winch_side_length")))
    assert found.z.tolist() == [0.0] and found.at_bound.tolist() == [True]
    assert not found.free.any() and not found.seen.any()
    # the readings pull it to the other side
    inverse = np.linalg.inv(whole(found))
    x, r = found.jacobian[:, 0], found.state.white
    assert x @ inverse @ r < 0.0
    # by itself it would have this error
    alone = 1.0 / np.sqrt(x @ inverse @ x)
    assert found.stderr[0] == pytest.approx(alone * found.terms.scale[0])
    blind = replace(found, width=np.array([alone / 0.99]))
    assert np.isinf(blind.stderr[0])


def test_what_the_readings_do_not_show_has_no_error() -> None:
    found = fitted(*NAMES)
    x = found.jacobian.copy()
    x[:, 1] = 0.0
    blind = replace(found, jacobian=x)
    assert blind.seen.tolist() == [True, False, True]
    assert np.isinf(blind.stderr).tolist() == [False, True, False]
    assert blind.covariance[1, [0, 2]].tolist() == [0.0, 0.0]
    assert blind.correlation[1].tolist() == [0.0, 1.0, 0.0]
    idle = blind.with_idle(blind.covariance)
    assert idle[1, 1] == pytest.approx(found.terms.scale[1] ** 2)
    np.testing.assert_array_equal(idle[[0, 2]][:, [0, 2]], blind.covariance[[0, 2]][:, [0, 2]])
    x[0, 1] = 2e-5  # it moves one
    assert np.isinf(replace(blind, jacobian=x).with_idle(blind.covariance)[1, 1])


# --- scores ---------------------------------------------------------------------------------------


def expected_score(found: Fit, every: Catalogue, gains: float, y: Array, wide: Array) -> float:
    """ln N(y; 0, wide + noise), of noise without weights, and all the priors."""
    cov = wide + covariance(found.data.chain, found.noise, found.weight)
    out = -0.5 * (y @ np.linalg.solve(cov, y) + np.linalg.slogdet(cov)[1])
    out -= 0.5 * np.sum(np.log(found.weight))
    out += found.log_outliers + NoisePrior.of(found.data.problem).log(found.noise) + gains
    return float(out) + every.log_prior(frozenset(t.name for t in found.terms))


def catalogue(data: Data) -> Catalogue:
    return Catalogue.of(replace(data, problem=data.problem.considering(frozenset(
        (*NAMES, "winch_side_length")))), Terms())  # fmt: skip


def test_the_score_of_an_effect_is_its_evidence_averaged_over_widths() -> None:
    found = fitted("stiffness")
    every, x = catalogue(found.data), found.jacobian
    y = found.state.white + x @ found.z
    each = [
        expected_score(found, every, 0.0, y, w**2 * x @ x.T - 0.0 * np.eye(len(y))) for w in WIDTHS
    ]
    one = scored(every, frozenset(["stiffness"]), found, {})
    assert one.score == pytest.approx(averaged(np.array(each)), abs=0.02)
    assert one.widths == {"stiffness": WIDTHS[int(np.argmax(each))]} and one.wanted is None
    none = fitted_none()
    nothing = scored(every, frozenset(), none, {})
    plain = expected_score(none, every, 0.0, none.state.white, np.zeros((len(y), len(y))))
    assert nothing.score == pytest.approx(plain, abs=1e-6)


@cache
def fitted_none() -> Fit:
    data = data_of()
    return fit(data, data.state(Terms()))


@pytest.mark.parametrize("beside", [False, True])
def test_a_value_that_is_stopped_at_zero_costs_what_it_might_have_been(beside: bool) -> None:
    """Its half of a Gaussian as prior, with the readings' pull away from the bound.

    Cable behind the exit point does nearly what a softer cable does, which leaves a pull of -17 in
    place of 292.
    """
    data = data_of(factor=0.9 if beside else 1.1)
    names = ("winch_side_length", "stiffness") if beside else ("winch_side_length",)
    found = fit(data, data.state(at_null(*names)))
    place = [t.name for t in found.terms].index("winch_side_length")
    assert found.at_bound.tolist()[place]
    every = catalogue(data)
    one = scored(every, frozenset(names), found, {})
    n, x = data.problem.n_readings, found.jacobian[:, place]
    y, wide = found.state.white + found.jacobian @ found.z, np.zeros((n, n))
    gains = 0.0
    if beside:
        soft = found.jacobian[:, 1 - place]
        wide = one.widths["stiffness"] ** 2 * np.outer(soft, soft)
        each = [expected_score(found, every, 0.0, y, w**2 * np.outer(soft, soft)) for w in WIDTHS]
        gains += averaged(np.array(each)) - expected_score(found, every, 0.0, y, wide)
    inverse = np.linalg.inv(wide + covariance(data.chain, found.noise, found.weight))
    p, a = x @ inverse @ x, min(x @ inverse @ y, 0.0)

    def half(width: float) -> float:
        def density(z: float) -> float:
            log = -0.5 * p * z * z + a * z - 0.5 * (z / width) ** 2
            return float(np.exp(log) * 2.0 / (np.sqrt(2.0 * np.pi) * width))

        most = 12.0 / np.sqrt(p + width**-2.0)
        return float(np.log(integrate.quad(density, 0.0, most, limit=200)[0]))

    stopped = float(special.logsumexp([half(w) for w in WIDTHS]) - np.log(len(WIDTHS)))
    assert stopped < -0.5
    assert one.score == pytest.approx(
        expected_score(found, every, gains + stopped, y, wide), abs=0.03
    )


def test_a_field_scores_its_evidence_averaged_over_widths() -> None:
    data = data_of()
    field, key = field_of(data), frozenset(["~0"])
    every = replace(catalogue(data), fields={"~0": field}, kinds={"~0": Varying.LAG})
    found = fit(data, data.state(Terms()), field=3.0 * field)
    one = scored(every, key, found, {"~0": 3.0})
    y = found.state.white
    each = [expected_score(found, every, 0.0, y, w**2 * field @ field.T) for w in FIELD_WIDTHS]
    assert one.field == "~0" and one.possible
    odds = every.log_prior(key) - every.log_prior(frozenset())
    assert one.score == pytest.approx(averaged(np.array(each)) + odds, abs=1e-6)


def test_what_a_fit_left_to_gain_is_taken_from_its_score() -> None:
    """Half the square of how far off it ended, in units of its errors."""
    found = fitted("stiffness")
    every, key = catalogue(found.data), frozenset(["stiffness"])
    best = scored(every, key, found, {})
    assert best.possible and best.field is None
    error = float(found.stderr[0])
    off = found.terms.with_vector(found.terms.vector + 1.5 * error)
    moved = replace(found, state=found.data.state(off))
    lost = best.score - scored(every, key, moved, {}).score
    assert lost == pytest.approx(0.5 * 1.5**2, abs=0.15)


def test_no_width_of_greatest_evidence_is_below_an_expected_size() -> None:
    """Values of a third of one: the best width is 0.3, and 1 the least that is taken."""
    found = fitted("stiffness")
    every = catalogue(found.data)
    one = scored(every, frozenset(["stiffness"]), found, {})
    assert wider(every, one) == {"stiffness": 1.0} and one.widths["stiffness"] < 1.0
