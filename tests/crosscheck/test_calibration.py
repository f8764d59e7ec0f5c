"""Everything at once: small errors everywhere, one effect, a tracker that stands askew."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration import Calibrated, calibrate
from crosscheck.fit.problem import Problem, rms_by_kind
from crosscheck.fit.registration import registered
from crosscheck.fit.state import State, evaluate
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.fit import Data, Metric, without_rows
from crosscheck.inference.held_out import blocks_of, hold_out
from crosscheck.inference.search import Search
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import together
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.pose import quat_from_rotvec, quat_multiply, quat_rotate

ROBOT = load_robot(COGIRO)
# The frame, what it could be taken for, and a mass beside soft cables.
FEW = (
    "tracker_frame", "tracker_target", "exit_point_error", "gravity_tilt", "length_scale",
    "stiffness", "platform_mass",
)  # fmt: skip


def hidden() -> list:
    """Small errors of many kinds."""
    rng = np.random.default_rng(0)
    exits = {f"error_{i}_{a}_m": 1e-3 * rng.normal() for i in range(1, 9) for a in "xyz"}
    return [
        term(ROBOT, "exit_point_error", **exits),
        term(ROBOT, "stiffness", factor=1.2),
        term(ROBOT, "pulley_radius", radius_m=0.004),
        term(ROBOT, "drum_gain", **{f"gain_{i}": 3e-3 * rng.normal() for i in range(1, 9)}),
    ]


def problem_of(data: Measurements) -> Problem:
    ready = prepare(ROBOT, data, Terms())
    assert ready.refusal is None
    return ready.problem


@cache
def small_errors() -> Measurements:
    """Of many kinds."""
    return measured(ROBOT, hidden(), points=14)


@cache
def calibrated() -> Calibrated:
    """From many small errors."""
    return calibrate(ROBOT, small_errors())


@pytest.mark.slow
def test_many_small_errors_are_fitted_together_and_predict_elsewhere() -> None:
    terms, found = hidden(), calibrated()
    before, after = (r["position_rms_m"] for r in (found.before, found.after))
    assert before is not None and after is not None and SIGMA.position_m is not None
    assert before > 20 * after
    assert after < 1.1 * SIGMA.position_m
    assert list(found.scale.values()) == pytest.approx([1.0, 1.0], abs=0.25)
    # other rows of the same robot, read without noise
    other = measured(ROBOT, terms, points=9, sigma=replace(SIGMA, position_m=1e-9), seed=5)
    elsewhere = Problem(ROBOT, other, SIGMA, np.ones(other.n_rows, dtype=bool))
    state = evaluate(elsewhere, found.terms, elsewhere.noise(elsewhere.experiment.predict()))
    assert np.sqrt(np.mean(state.raw[:, :3] ** 2)) < 1.5 * SIGMA.position_m
    left_out = found.held_out["position_rms_m"]
    assert left_out is not None and after < left_out < 2.0 * SIGMA.position_m


def test_what_is_left_out_of_the_model_does_nothing() -> None:
    """Of a mass beside soft cables the data know no more than before: it still carries much."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=0.3)], points=6, seed=1)
    found = calibrate(ROBOT, data, only=FEW)
    problem = problem_of(data)
    factor = problem.noise(problem.experiment.predict())
    rms = rms_by_kind(problem, evaluate(problem, found.terms, factor).raw)
    assert rms["position_rms_m"] == pytest.approx(found.after["position_rms_m"], rel=1e-3)
    mass = next(one for one in found.fitted if one.term.name == "platform_mass")
    assert mass.stderr > 0.98 * mass.term.layout.scale


def test_outliers_of_several_files_are_told_with_their_file() -> None:
    """Once "lines 5, 5", of which nobody knows the file; and a list without an end."""
    data = measured(ROBOT, (), points=6, seed=1)
    position = data.position.copy()
    position[[3, 3 + data.n_rows // 2]] += 0.05
    halves = np.array_split(np.arange(data.n_rows), 2)
    far = replace(data, position=position)
    parts = [replace(far.rows(h), line=np.arange(2, 2 + len(h))) for h in halves]
    names = (Path("monday.csv"), Path("tuesday.csv"))
    days = together([replace(part, path=p) for part, p in zip(parts, names, strict=True)])
    found = calibrate(ROBOT, days, only=("stiffness",))
    assert found.outliers == (5, 5)
    assert found.noise_lines()[-1].endswith(": lines monday.csv 5, tuesday.csv 5")
    assert found.as_json()["outlier_places"] == ["monday.csv 5", "tuesday.csv 5"]
    many = replace(found, outliers=(5,) * 20, outlier_places=("monday.csv 5",) * 20)
    assert many.noise_lines()[-1].endswith("monday.csv 5 and 12 more")


@pytest.mark.slow
def test_covariance_covers_what_the_data_see() -> None:
    found = calibrated()
    at = found.labels.index("pulley_radius.radius_m")
    error = float(np.sqrt(found.covariance[at, at]))
    assert 0.0 < error < 0.004
    assert abs(found.terms.vector[at] - 0.004) < 4.0 * error


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.05, 1.5])
def test_a_tracker_that_stands_askew_is_registered_first(angle: float) -> None:
    data = measured(ROBOT, (), points=8)
    turn = quat_from_rotvec(angle * np.array([0.6, -0.64, 0.48]))
    assert data.quat_wxyz is not None
    turned = replace(
        data,
        position=quat_rotate(turn, data.position) + np.array([1.0, -2.0, 0.5]),
        quat_wxyz=quat_multiply(turn, data.quat_wxyz),
    )
    problem = Problem(ROBOT, turned, SIGMA, np.ones(data.n_rows, dtype=bool))
    at = problem.experiment.predict()
    for seen in (problem, replace(problem, data=replace(turned, quat_wxyz=None))):
        frame = registered(seen, at)
        assert frame is not None
        assert frame.vector[3:] == pytest.approx(angle * np.array([0.6, -0.64, 0.48]), abs=2e-3)
    found = calibrate(ROBOT, turned, only=FEW)
    assert (found.after["position_rms_m"] or 1.0) < 1.1 * (SIGMA.position_m or 0.0)


@pytest.mark.slow
def test_what_is_left_on_runs_left_out_is_what_a_fit_without_them_predicts() -> None:
    """Straight lines from the fit to all of them told 10.6 mm of a real robot, not 2.1."""
    data = Data.of(problem_of(small_errors()), Terms())
    search = Search(data, Catalogue.of(data, Terms()))
    search.begin()
    whole = search.calibrated.fit
    held = hold_out(whole)
    bent = []
    for rows in blocks_of(data.problem):
        absent = rows[data.problem.row_of]
        state = without_rows(whole, absent)
        np.testing.assert_allclose(held.raw[rows], state.raw[rows], atol=1e-9)
        weight = np.where(absent, 0.0, whole.weight)
        metric = Metric(data.chain.without(absent), whole.noise, weight, None)

        def cost(at: State, metric: Metric = metric) -> float:
            return metric.power(at.white) + float(np.sum((at.terms.sizes / whole.width) ** 2))

        assert cost(state) < cost(whole.state)
        straight = whole.state.white - whole.jacobian @ (state.terms.sizes - whole.z)
        bent.append(np.sqrt(np.mean((state.white - straight)[absent] ** 2)))
    assert max(bent) > 0.5  # of the noise: there is a run where it matters


def test_poses_that_are_runs_of_their_own_may_be_outliers() -> None:
    """One in ten had made every such file something unknown."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=1.2)], points=14)
    far = np.arange(data.n_rows) % 10 == 3
    push = np.random.default_rng(1).normal(scale=20.0, size=(data.n_rows, 3))
    moved = data.position + np.where(far[:, None], push * SIGMA.position_m, 0.0)
    each = np.array([f"pose {k}" for k in range(data.n_rows)])
    found = calibrate(ROBOT, replace(data, position=moved, run=each), only=FEW)
    assert set(found.outliers) == set(data.line[far].tolist())
    left_out = found.held_out["position_rms_m"]
    assert left_out is not None and left_out < 1.5 * SIGMA.position_m


def test_what_acts_by_its_square_joins_where_its_derivative_says_nothing() -> None:
    """On a robot that only slides, the weight of its cables was left out whatever it was."""
    camera = load_robot(model_path("camera"))
    weight = 2.0 * term(camera, "cable_weight").layout.scale[0]
    data = measured(camera, [term(camera, "cable_weight", weight_N_per_m=weight)])
    found = calibrate(camera, data, only=["cable_weight"])
    (one,) = found.fitted
    assert one.term.vector[0] == pytest.approx(weight, rel=0.1)
    assert not calibrate(camera, measured(camera), only=["cable_weight"]).fitted
