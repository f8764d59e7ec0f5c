"""What is added is worth it, is something, and came from a fit that ended."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, measured, soft_cogiro, term
from made_diagnoses import POINTS, SIGMA, readings, robot
from scipy import stats

import crosscheck
import crosscheck.add.fit
from crosscheck.add import add_effect, add_effects, weigh
from crosscheck.add.weigh import Addition, distance_from_nothing, is_nothing
from crosscheck.comparison.residuals import compare
from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.inference import fit as fit_module
from crosscheck.inference.fit import Data, fit
from crosscheck.model.fitted import Fitted
from crosscheck.preparation.prepare import prepare
from crosscheck.show.models import why_not
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Term, Terms
from seecr.errors import InputError
from seecr.prediction.model import new_model
from seecr.prediction.uncertainty import covariance_of, spread_of


@pytest.mark.slow
def test_an_effect_that_is_nothing_is_not_worth_adding() -> None:
    found = add_effect(robot(), readings(), "tracker_scale")
    assert found.is_nothing and found.from_nothing < 1.0 and not found.pays
    assert "standard errors from null" in why_not(found)
    sure = add_effect(robot(), readings(radius_m=0.01), "pulley_radius")
    # and the model keeps how well it is known
    known = covariance_of(sure.model)
    assert known is not None and np.sqrt(known[0, 0]) == pytest.approx(sure.own.stderr[0], rel=1e-6)
    assert not sure.is_nothing and sure.from_nothing > 50.0 and sure.pays


@pytest.mark.slow
def test_autocorrelated_noise_is_no_effect_that_is_missing(shared_data: Path) -> None:
    """Once 50 ± 5 mm came of it where 50.0 ± 0.3 was known, with advice to look for more."""
    folder = shared_data / "labs" / "B04"
    found = add_effect(folder / "robot.xml", folder / "measured.csv", "pulley_radius")
    assert not found.whiteness.is_noise and found.is_noise and found.pays
    assert found.coloured is not None and 0.7 < found.coloured.rho["position"] < 0.9
    error = float(found.own.stderr[0])
    assert 1e-4 < error < 1e-3 and abs(found.own.term.vector[0] - 0.05) < 3.0 * error
    assert not found.warnings
    # and what is only noise explains less than white noise of its size would let it
    null = shared_data / "labs" / "B01"
    found = add_effect(null / "robot.xml", null / "measured.csv", "stiffness")
    assert found.is_noise and found.p > 1e-4


@pytest.mark.slow
def test_smooth_noise_of_unstated_size_is_as_open_as_in_a_comparison() -> None:
    """It was noise here, with the advice to compare, where compare saw what may be missing."""
    cogiro = load_robot(COGIRO)
    data = measured(cogiro, points=12, seed=5)
    noise = np.random.default_rng(3).normal(size=(data.n_rows, 3))
    for k in range(1, len(noise)):
        noise[k] = 0.9 * noise[k - 1] + np.sqrt(1.0 - 0.9**2) * noise[k]
    data = replace(
        data, position=data.position + 1.2e-4 * noise, sigma=replace(data.sigma, position_m=None)
    )
    found = add_effect(cogiro, data, "platform_mass")
    assert compare(cogiro, data, found.model).is_open
    assert found.is_open and not found.is_noise and found.as_json()["is_open"]


@pytest.mark.slow
def test_errors_cover_what_another_missing_effect_does_to_a_value(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The tilt of the frame is missing: the centre of mass takes a part of it."""
    parallel = load_robot(model_path("demobot_parallel"))
    shift = {"shift_x_m": 0.00836, "shift_y_m": -0.00296, "shift_z_m": 0.01097}
    centre = Term.of(parallel, "centre_of_mass", **shift)
    tilt = Term.of(parallel, "gravity_tilt", tilt_x_rad=0.0089, tilt_y_rad=0.0062)
    data = measured(parallel, [centre, tilt], points=4)
    alone = add_effect(parallel, data, "centre_of_mass")
    off = np.abs(alone.own.term.vector - centre.vector) / alone.own.stderr
    assert alone.pays and not alone.whiteness.is_noise and np.all(off < 2.0)
    widened = (
        "the standard errors include by how much another missing effect may shift these values"
    )
    assert any(widened in warning for warning in alone.warnings)
    monkeypatch.setattr(weigh, "MATTERS", 1.0)
    blind = add_effect(parallel, data, "centre_of_mass")
    assert np.max(np.abs(blind.own.term.vector - centre.vector) / blind.own.stderr) > 5.0
    assert not any(widened in warning for warning in blind.warnings)


@pytest.mark.slow
def test_errors_are_those_of_a_diagnosis() -> None:
    """2720 ± 200 mm of a diagnosis were 2723.3 ± 5.4 mm here: what may be missing beside it counts.

    The platform is heavier by so little that the data leave it open.
    """
    soft = soft_cogiro()
    hidden = [term(soft, "centre_of_mass", shift_x_m=0.01)]
    hidden.append(term(soft, "platform_mass", added_kg=0.002))
    data = measured(soft, hidden, points=4, seed=1)
    found = crosscheck.diagnose(soft, data)
    (listed,) = found.missing
    added = add_effect(soft, data, listed.term)
    last = found.path.last.fit
    alone = last.stderr[last.terms.part("centre_of_mass")]
    assert listed.stderr[0] > 1.4 * alone[0]  # the errors of the fit alone are too small
    assert added.own.stderr == pytest.approx(listed.stderr, rel=0.1)
    assert added.is_noise and any(" may be missing as well: the" in w for w in added.warnings)


@pytest.fixture
def one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fits of a single step."""
    short = partial(fit_module._settle, steps=1)
    monkeypatch.setattr(fit_module, "_settle", short)
    monkeypatch.setattr(crosscheck.add.fit, "fit", partial(fit, rounds=1))


def far_from_10_mm() -> Term:
    return Term.of(robot(), "pulley_radius", radius_m=0.05)


@pytest.mark.usefixtures("one_step")
def test_a_fit_knows_that_it_came_to_no_end() -> None:
    ready = prepare(robot(), readings(radius_m=0.01), Terms())
    data = Data.of(ready.problem, Terms())
    assert not fit(data, data.state(Terms([far_from_10_mm()])), rounds=1).settled


@pytest.mark.usefixtures("one_step")
def test_a_fit_that_did_not_end_is_never_a_number() -> None:
    with pytest.raises(UnsolvedError, match="did not converge; nothing was added") as e:
        add_effects(robot(), readings(radius_m=0.01), [far_from_10_mm()])
    assert e.value.exit_status == 3


def test_several_effects_are_added_together() -> None:
    hidden = [
        Term.of(robot(), "pulley_radius", radius_m=0.01),
        Term.of(robot(), "stiffness", factor=1.3),
    ]
    data = measured(robot(), hidden, points=POINTS, sigma=SIGMA, tensions=True)
    near = [one.with_vector(1.1 * one.vector) for one in hidden]
    found = add_effects(robot(), data, near)
    assert found.pays and found.names == ("pulley_radius", "stiffness")
    for one, truth in zip(found.fitted, Terms(hidden), strict=True):
        assert abs(one.term.vector[0] - truth.vector[0]) < 4.0 * one.stderr[0]
    named = add_effects(robot(), data, ["stiffness", near[0]])  # by name, and with its value
    assert named.names == ("pulley_radius", "stiffness")
    for one in found.terms:
        assert named.terms[one.name].vector == pytest.approx(one.vector, rel=1e-3)
    assert add_effects(robot(), data, found).terms.names == found.terms.names  # of a result
    with pytest.raises(CrosscheckError, match="expected at least one effect to add, got none"):
        add_effects(robot(), data, [])
    with pytest.raises(InputError, match=r"no effect 'stifness'.*first: stiffness"):
        add_effects(robot(), data, "stifness")


@pytest.mark.slow
def test_what_a_planar_robot_cannot_feel_does_not_keep_its_model_from_errors() -> None:
    """A force across its plane is never seen: the model once kept no covariance for that."""
    planar = load_robot(model_path("planar_vertical"))
    pulls = {"force_x_N": 0.3, "force_z_N": -0.2, "moment_y_Nm": 0.004}
    hidden = Term.of(planar, "external_wrench", **pulls)
    found = add_effect(planar, measured(planar, [hidden]), "external_wrench")
    covariance = covariance_of(found.model)
    assert found.pays and covariance is not None
    unseen = ~np.isfinite(found.own.stderr)
    assert unseen.tolist() == [False, True, False, True, False, True]
    error = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(error[unseen], found.own.term.layout.scale[unseen])
    np.testing.assert_allclose(error[~unseen], found.own.stderr[~unseen], rtol=1e-2)
    spread = spread_of(planar, planar.reference_pose[None], found.model)
    assert spread is not None and spread.position.max() < 1e-3


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


# What an addition is worth, and which of its effects is the added one

ROBOT = load_robot("demobot_cogiro")

WHITE = Whiteness(1.0, 1, 0.3, 1.0, 0.0, 0.0, 0.0, 0.0)


def fitted(name: str, **values: float) -> Fitted:
    term = Term.of(ROBOT, name, **values)
    size = len(term.layout)
    return Fitted(term, np.full(size, 1e-4), np.zeros(size, dtype=bool))


def addition(**changes: Any) -> Addition:
    effects = (fitted("pulley_radius", radius_m=0.01), fitted("stiffness", factor=1.2))
    rms: Any = {"position_m": 1e-3}
    given: dict[str, Any] = {
        "names": ("stiffness", "creep"), "fitted": effects, "before": rms, "after": rms,
        "held_out_before": rms, "held_out": rms, "fall": (1.0, 0.1), "p": 0.5, "predicts": True,
        "from_nothing": 9.0, "is_nothing": False, "whiteness": WHITE, "coloured": None,
        "warnings": ("odd",), "notes": ("said",), "model": new_model(ROBOT),
    }  # fmt: skip
    return Addition(**(given | changes))


@pytest.mark.parametrize("predicts", [False, True])
@pytest.mark.parametrize("is_nothing", [False, True])
def test_what_predicts_better_pays_unless_it_is_nothing(predicts: bool, is_nothing: bool) -> None:
    found = addition(predicts=predicts, is_nothing=is_nothing)
    assert found.pays == (predicts and not is_nothing)
    worth = "improves" if predicts else "does not improve"
    assert found.lines()[0].startswith(f"stiffness + creep {worth} the prediction of test runs")
    nothing = "stiffness + creep is 9 standard errors from null"
    assert (f"{nothing}: it is not worth adding" in found.lines()) == is_nothing
    assert found.why_not.startswith(nothing if is_nothing else "what stiffness + creep explains")


def test_several_values_are_nothing_where_noise_alone_may_bring_them() -> None:
    """Of 1.5 standard errors of eight values it said "no more than its standard errors"."""
    found = addition(names=("drum_gain",), is_nothing=True, from_nothing=1.54,
                     fitted=(fitted("drum_gain", gain_1=1e-4),))  # fmt: skip
    assert found.why_not == (
        "drum_gain is no further from null than noise alone may bring 8 values "
        "(1.5 standard errors, all together)"
    )


def test_a_fit_that_cannot_be_solved_adds_nothing() -> None:
    """Its chi2 is infinite, and the model written from it could not be read again."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=1.3)])
    huge = term(ROBOT, "external_wrench", force_z_N=1e9)
    with pytest.raises(UnsolvedError, match="external_wrench: some rows could not be solved at"):
        add_effects(ROBOT, data, [huge])


def test_what_a_tracker_throws_far_off_is_left_out_neighbours_as_well() -> None:
    """From one row in twenty on all were kept: the model was "3.8 times the noise" off."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=1.3)])
    rng, off = np.random.default_rng(1), np.zeros(data.n_rows, dtype=bool)
    off[rng.choice(data.n_rows, data.n_rows // 16, replace=False)] = True
    off[20:22] = True
    assert data.position is not None and SIGMA.position_m is not None
    far = 15.0 * SIGMA.position_m * rng.standard_normal((data.n_rows, 3))
    far += np.sign(far) * 8.0 * SIGMA.position_m
    # and of three neighbours those that are seen without the one that is farthest off
    off[40:43], far[[40, 42]], far[41] = True, 9.0 * SIGMA.position_m, 60.0 * SIGMA.position_m
    thrown = replace(data, position=data.position + off[:, None] * far)
    found = add_effect(ROBOT, thrown, "stiffness")
    clean = add_effect(ROBOT, data, "stiffness")
    assert any("outliers, given little weight" in note for note in found.notes)
    own, other = found.own, clean.own
    assert own.term.vector == pytest.approx(other.term.vector, abs=2.0 * float(other.stderr[0]))
    assert own.stderr[0] < 2.0 * other.stderr[0] and found.whiteness.is_noise
