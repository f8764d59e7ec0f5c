"""Comparisons: the numbers in the tables, what errors go with, limits."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from scipy import stats

import seecr
from crosscheck.comparison.associations import SIGNIFICANT, Association, f_test, labelled
from crosscheck.comparison.noise import Coloured, underestimation
from crosscheck.comparison.quantities import (
    EVERYWHERE,
    STILL,
    QuantityKind,
    cable_errors,
    independent_part,
)
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import error_size_words, misfit_sentence, noise_sentence
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot, model_path
from seecr.files import json_text
from seecr.pose import pose_add, pose_difference, quat_from_rotvec, quat_multiply, rotvec_from_quat


@pytest.fixture(scope="module")
def robot():
    return soft_cogiro()


@pytest.fixture(scope="module")
def data(robot):
    return measured(robot, [term(robot, "stiffness", factor=1.4)])


@pytest.fixture(scope="module")
def off(robot, data):
    return compare(robot, data)


def test_the_true_model_leaves_noise(robot, data):
    found = compare(robot, data, [term(robot, "stiffness", factor=1.4)])
    assert found.is_noise and found.converged
    assert found.sentence.startswith("Model and data agree: the residuals are noise")
    assert found.rms["position_rms_m"] == pytest.approx(SIGMA.position_m, rel=0.15)
    assert all(a.p > SIGNIFICANT for a in found.associations)


def test_coordinates_are_measured_less_predicted(robot, data, off):
    rest = off.state.prediction.pose
    reading = np.concatenate([data.position, data.quat_wxyz], axis=1)
    error = pose_difference(reading, rest)
    z = next(c for c in off.coordinates if c.name == "z")
    assert z.bias == pytest.approx(error[:, 2].mean(), rel=1e-9)
    assert z.rms == pytest.approx(np.sqrt((error[:, 2] ** 2).mean()), rel=1e-9)
    worst = int(np.argmax(np.abs(error[:, 2])))
    assert z.max == pytest.approx(error[worst, 2]) and z.line == data.line[worst]
    turn = next(c for c in off.coordinates if c.name == "rotation about y")
    assert turn.rms == pytest.approx(np.sqrt((error[:, 4] ** 2).mean()), rel=1e-9)


def test_stiffer_cables_hold_the_platform_higher(off):
    assert not off.is_noise
    assert off.sentence.startswith("The model misses something")
    z = next(c for c in off.coordinates if c.name == "z")
    assert z.bias > 3e-4
    assert {r.name for r in off.runs} == set(off.problem.data.runs)


def test_groups_hold_every_row_once(off):
    n = off.problem.data.n_rows
    for groups in (off.runs, off.directions, off.regions):
        assert sum(g.rows for g in groups) == n
    power = sum(g.rows * g.rms["position_rms_m"] ** 2 for g in off.runs)
    assert np.sqrt(power / n) == pytest.approx(off.rms["position_rms_m"], rel=1e-9)
    assert len(off.regions) > 2 and all("x " in g.name for g in off.regions)


def test_direction_of_travel_is_the_commanded_one(robot, off):
    way, data = off.way, off.problem.data
    forward = np.flatnonzero(data.run == "along_low_fwd")
    assert set(way.direction[forward]) == {"+x", "-x"}
    assert np.all(way.direction[forward][1:] == "+x")
    assert way.direction[forward[0]] == "-x"  # from the reference pose to where the run starts
    step = np.linalg.norm(np.diff(data.command_pose[forward, :3], axis=0), axis=1)
    assert way.speed[forward][1:] == pytest.approx(step / 2.0)
    assert np.isnan(way.speed[forward[0]])
    still = measured(robot, points=8).rows([3, 3])
    assert compare(robot, still).way.direction[1] == STILL


def test_the_worst_row_is_named(robot, data):
    position = data.position.copy()
    position[20, 1] += 0.01
    found = compare(robot, replace(data, position=position))
    assert found.worst[0].row == 20 and found.worst[0].line == data.line[20]
    assert found.worst[0].errors["y [m]"] == pytest.approx(0.01, rel=0.1)
    assert found.worst[0].run == data.run[20]
    assert any(f"line {data.line[20]}: possible outliers" in note for note in found.notes)


FOLLOWS = {
    "time": lambda data: 4e-6 * data.t_s[:, None] * np.array([0.0, 0.0, 1.0]),
    "direction of travel": None,
    "commanded y": lambda data: (
        0.003 * (data.command_pose[:, 1:2] - 0.25) * np.array([1.0, 0.0, 0.0])
    ),
    EVERYWHERE: lambda data: np.full((len(data.run), 3), 2e-4),
}


@pytest.mark.parametrize("against", FOLLOWS)
def test_errors_are_traced_to_what_they_follow(robot, against):
    plain = measured(robot)
    if against == "direction of travel":
        sign = np.array([1.0 if d[0] == "+" else -1.0 for d in compare(robot, plain).way.direction])
        error = 3e-4 * sign[:, None] * np.array([0.0, 0.0, 1.0])
    else:
        error = FOLLOWS[against](plain)
    found = compare(robot, replace(plain, position=plain.position + error))
    first = next(a for a in found.associations if a.against == against)
    # runs follow each other in time: which run it is can be as good an answer as the time
    assert first.share > 0.9 * found.associations[0].share
    assert first.p < 1e-6 and first.share > 0.15
    means = [b.mean for b in first.bins]
    assert max(np.abs(means)) == pytest.approx(np.abs(error).max(), rel=0.5)
    assert sum(b.rows for b in first.bins) == plain.n_rows
    if against == "time":  # bins follow one another, from the first row to the last
        ends = [float(end) for b in first.bins for end in re.findall(r"[\d.]+", b.label)]
        assert len(ends) == 12 and ends == sorted(ends) and ends[0] == 0.0
        assert ends[-1] == pytest.approx(np.ptp(plain.t_s), rel=1e-3)


def test_bins_hold_as_many_rows_each_in_whatever_order_they_are(robot):
    """Against the quantiles of NumPy, for poses in no order."""
    rng, n = np.random.default_rng(5), 120
    pose = np.tile(robot.reference_pose, (n, 1))
    pose[:, :3] += rng.uniform(-0.05, 0.05, (n, 3))
    rest = seecr.solve(robot, pose).pose
    off = np.zeros((n, 3))
    off[:, 2] = 0.02 * (pose[:, 0] - pose[:, 0].mean())
    data = Measurements(
        Path("random.csv"), robot.n_cables, np.full(n, "all"), command_pose=pose,
        position=rest[:, :3] + off + rng.normal(0.0, 1e-5, (n, 3)), sigma=Sigma(position_m=1e-5),
    )  # fmt: skip
    found = compare(robot, data)
    bins = next(a for a in found.associations if a.against == "commanded x").bins
    x, edges = pose[:, 0], np.quantile(pose[:, 0], np.arange(1, 6) / 6)
    place = np.searchsorted(edges, x, side="right")
    error = found.state.raw[:, 2]
    assert [b.rows for b in bins] == [20] * 6
    assert [b.mean for b in bins] == pytest.approx([error[place == k].mean() for k in range(6)])
    for k, one in enumerate(bins):
        ends = [float(end) for end in re.findall(r"[\d.]+", one.label)]
        assert ends == pytest.approx([x[place == k].min(), x[place == k].max()], rel=2e-3)


@pytest.mark.slow
def test_noise_goes_with_nothing(robot):
    firsts = [compare(robot, measured(robot, seed=s)).associations[0].p for s in range(20)]
    assert np.sum(np.array(firsts) < 0.05) <= 3
    assert min(firsts) > 1e-4


def test_rounding_goes_with_nothing(robot, data):
    """Readings that differ by rounding alone, with a constant offset of many times the noise."""
    same = data.rows([0] * 12)
    shift = np.linspace(3e-4, 3e-4 * (1 + 1e-15), 12)[:, None]
    found = compare(robot, replace(same, position=same.position + shift))
    assert found.problem.use.all() and not found.is_noise
    assert [a.against for a in found.associations if a.significant] == [EVERYWHERE]
    # the same rows with errors of two sizes
    shift = np.where(np.arange(12) == 0, 4e-4, 3e-4)[:, None]
    found = compare(robot, replace(same, position=same.position + shift))
    assert "direction of travel" in [a.against for a in found.associations if a.significant]


def test_a_longer_cable_shows_as_that_cable(robot):
    plain = compare(robot, measured(robot))
    offset = {"offset_3_m": 1e-3}
    found = compare(robot, measured(robot, [term(robot, "cable_length_offset", **offset)]))
    errors, noise = cable_errors(found.problem, found.state.raw, found.state.prediction)
    mean = errors.mean(axis=0)
    assert int(np.argmax(mean)) == 2 and mean[2] > 5 * noise[:, 2].mean()
    assert any(a.against == "the cable" and a.p < 1e-6 for a in found.associations)
    assert 0.1 < independent_part(plain.problem, plain.state.prediction) < 0.8


def test_half_of_the_readings_will_do(robot, data):
    blank = np.full_like(data.position, np.nan)
    angles = replace(data, position=blank)
    found = compare(robot, angles)
    assert found.rms["position_rms_m"] is None
    assert found.rms["orientation_rms_rad"] > 0
    assert [c.name for c in found.coordinates] == [f"rotation about {a}" for a in "xyz"]
    assert np.isnan(found.errors_of("position")).all()
    only_z = data.position.copy()
    only_z[:, :2] = np.nan
    found = compare(robot, replace(data, position=only_z, quat_wxyz=None))
    assert [c.name for c in found.coordinates] == ["z"]


def test_tensions_are_compared(robot):
    noisy = replace(SIGMA, tension_N=0.01)
    data = measured(robot, [term(robot, "tension_scale", factor=1.1)], sigma=noisy, tensions=True)
    found = compare(robot, data)
    assert found.rms["tension_rms_N"] > 0.05
    assert sum(c.unit == "N" for c in found.coordinates) == robot.n_cables
    assert found.errors_of("tension").max() > 0.1
    assert f"tension_of_{robot.cable_names[0]}_N" in found.to_frame().column_names


def test_noise_nobody_stated_is_estimated_and_said_so(robot, data):
    found = compare(robot, replace(data, sigma=Sigma()), [term(robot, "stiffness", factor=1.4)])
    assert any("position_m is not stated: estimated" in note for note in found.notes)
    assert found.floor["position_rms_m"] == pytest.approx(SIGMA.position_m, rel=0.4)


def test_a_planar_robot_is_compared(tmp_path):
    robot = load_robot(model_path("planar_vertical"))
    data = measured(robot, [term(robot, "platform_mass", added_kg=0.2 * robot.mass)])
    found = compare(robot, data)
    assert not found.is_noise and found.converged
    json_text(found.as_json())


def slack_robot(robot):
    """No gravity, and far more cable than it takes: nothing holds the platform."""
    return replace(robot, gravity=np.zeros(3), rest_lengths=robot.rest_lengths + 1.0)


def test_rows_with_every_cable_slack_are_named_and_nothing_is_made_up(robot, data):
    found = compare(slack_robot(robot), data)
    assert not found.converged and len(found.unsolved) == data.n_rows
    assert "every cable is slack" in found.unsolved[0].why
    assert found.sentence.startswith("Nothing could be compared: ")
    assert found.rms["position_rms_m"] is None and found.worst == ()
    assert not found.is_noise
    json_text(found.as_json())


def test_everything_is_json(off):
    text = json_text(off.as_json())
    assert "NaN" not in text and '"structured": true' in text


def test_a_pose_error_is_that_of_its_cables(robot, off):
    """dl = -u . (dt + dw x R b): against nominal lengths of the shifted pose, to first order."""
    problem, prediction = off.problem, off.state.prediction
    change = np.array([1e-6, -2e-6, 1.5e-6, 3e-6, -1e-6, 2e-6])
    raw = np.full_like(off.state.raw, np.nan)
    raw[:, :6] = change
    errors, _ = cable_errors(problem, raw, prediction)
    moved = pose_add(prediction.pose, np.tile(change, (len(raw), 1)))
    longer = robot.nominal_lengths(moved) - robot.nominal_lengths(prediction.pose)
    assert errors == pytest.approx(longer, abs=1e-10)


def test_tables_name_their_units(capsys: pytest.CaptureFixture[str]) -> None:
    """A bare "[mm]" is a style to the terminal's library, and vanishes."""
    from crosscheck.show.blocks import rms_table
    from crosscheck.show.texts import print_blocks

    rms = {"position_rms_m": 1e-3, "orientation_rms_rad": 1e-3, "tension_rms_N": 2.0}
    print_blocks([rms_table([("[all] rows", rms, "")])])
    heads, row = capsys.readouterr().out.splitlines()[1:]
    assert heads.split() == ["rms", "error", "[mm]", "[deg]", "[N]"]
    assert row.split() == ["[all]", "rows", "1", "0.0573", "2"]


def test_a_comparison_shows_itself(off):
    lines = str(off).splitlines()
    assert (
        lines[0]
        == f"measured.csv: {off.problem.data.n_rows} of {off.problem.data.n_rows} rows compared"
    )
    assert lines[1].startswith("position ") and lines[-1] == off.sentence
    rows = off.records()
    assert [row["line"] for row in rows] == off.problem.data.line.tolist()
    read = [*(f"{axis}_m" for axis in "xyz"), *(f"rotation_about_{axis}_rad" for axis in "xyz")]
    assert off.to_frame().column_names == ["line", "run", *read]  # nobody measured tensions
    assert [row["z_m"] for row in rows] == off.state.raw[:, 2].tolist()
    assert off.to_frame().num_rows == len(rows) and "<table>" in off._repr_html_()


def test_p_values_of_associations_are_those_of_the_f_distribution() -> None:
    between, within = np.array([3.0, 40.0, 1.0, 1.0]), np.array([50.0, 60.0, 1.0, 0.0])
    won, lost = np.array([2, 5, 0, 3]), np.array([90, 30, 7, 0])
    p = f_test(between, won, within, lost)
    expected = stats.f.sf((between[:2] / won[:2]) / (within[:2] / lost[:2]), won[:2], lost[:2])
    assert p == pytest.approx([*expected, 1.0, 1.0])
    # rows that are identical vary within no bin
    assert f_test(between[:1], won[:1], 0.0 * within[:1], lost[:1]) == 0.0


def test_p_values_are_corrected_for_all_that_was_tried(robot):
    """Of positions alone three readings were tried, beside all together, and each quantity."""
    plain = measured(robot)
    late = np.isin(plain.run, plain.runs[1:])
    shift = 4e-5 * late[:, None] * np.array([0.0, 0.0, 1.0])
    data = replace(plain, position=plain.position + shift, quat_wxyz=None)
    found = compare(robot, data)
    run = next(a for a in found.associations if a.against == "the run")
    errors = found.state.raw[:, :3]
    groups = [errors[data.run == name] for name in data.runs]
    each = stats.f_oneway(*groups).pvalue
    # of all three, sums of squares and degrees of freedom add up: noise is the same along each axis
    within = sum(((one - one.mean(axis=0)) ** 2).sum() for one in groups)
    between = ((errors - errors.mean(axis=0)) ** 2).sum() - within
    k, n = len(groups) - 1, len(errors)
    whole = stats.f.sf(between / (3 * k) / (within / (3 * (n - k - 1))), 3 * k, 3 * (n - k - 1))
    assert run.p == pytest.approx(len(found.associations) * 2.0 * min(whole, 3 * each.min()))
    assert 1e-12 < run.p < 0.5
    # and the share is what is left of the variance, with the freedoms that each has: adjusted R^2
    left = (within / (n - k - 1)) / ((between + within) / (n - 1))
    assert run.share == pytest.approx(1.0 - left)
    assert [b.rows for b in run.bins] == [np.sum(data.run == b.label) for b in run.bins]
    column = "xyz".index(run.strongest)
    assert column == int(np.argmin(each)) and run.unit == "m"
    means = [errors[data.run == b.label, column].mean() for b in run.bins]
    assert [b.mean for b in run.bins] == pytest.approx(means)


def test_groups_of_numbers_have_no_sign_at_zero() -> None:
    assert labelled(-0.0, 0.25, "m") == "0 to 0.25 m"
    assert labelled(0.4, 0.4, "m") == "0.4 m" and labelled(2.0, 2.0, "") == "2"


# What a comparison concludes is no kinder than its tables

ROBOT = soft_cogiro()

LOOSE = Whiteness(900.0, 100, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0)

FOLLOWS_SENTENCE = Association(
    QuantityKind.PLACE, "commanded x", "readings", 0.33, 1e-6, "x", "m", bins=()
)  # fmt: skip


def test_errors_that_depend_on_something_do_not_look_random() -> None:
    """Of inverted rotations it said so beside tables that explained a third of them."""
    said = misfit_sentence(LOOSE, {"position": 2.5}, "stated", [FOLLOWS_SENTENCE])
    assert said == (
        "The model misses something: the errors are 3 times the noise; commanded x explains 33 % "
        "of their variance."
    )
    chance = replace(FOLLOWS_SENTENCE, p=0.5)
    assert misfit_sentence(LOOSE, {"position": 2.5}, "stated", [chance]) == (
        "The residuals look random, but the errors are 3 times the noise: either it is stated too "
        "small, or many small effects are missing."
    )
    constant = replace(FOLLOWS_SENTENCE, kind=QuantityKind.EVERYWHERE)
    assert misfit_sentence(LOOSE, {"position": 2.5}, "stated", [constant]).endswith(
        "33 % of their mean square is a constant offset."
    )


def test_gross_errors_are_not_many_small_effects() -> None:
    gross = replace(LOOSE, scale=2410.0)
    said = misfit_sentence(gross, {"position": 1.03, "orientation": 3410.0}, "stated", [])
    assert said == (
        "The model misses something, or the noise is stated 3.41e+03 times too small: the errors "
        "of orientation are 3.41e+03 times the noise (those of position are noise), and depend on "
        "nothing that was tested."
    )


def test_kinds_of_readings_are_told_apart_if_only_some_are_off() -> None:
    assert error_size_words(3.0, {"position": 4.0, "orientation": 2.0}) == (
        "the errors are 3 times the noise"
    )
    assert error_size_words(1.2, {"position": 1.3}) == "the errors are 1.2 times the noise"
    assert error_size_words(9.0, {"position": 4.0, "orientation": 1.0, "tension": 15.0}) == (
        "the errors of position and tension are 4 and 15 times the noise (those of orientation are "
        "noise)"
    )


def test_noise_that_depends_on_something_says_so() -> None:
    white = replace(LOOSE, p=0.5, scale=1.01)
    assert noise_sentence(white, "stated", []) == (
        "Model and data agree: the residuals are noise (1.01 times the stated noise)."
    )
    assert noise_sentence(white, "stated", [FOLLOWS_SENTENCE]).endswith(
        "the residuals are noise (1.01 times the stated noise), but commanded x explains 33 % of "
        "their variance."
    )


def test_the_comparison_tells_how_many_times_the_noise_each_kind_is() -> None:
    data = measured(ROBOT)
    assert data.quat_wxyz is not None
    rng = np.random.default_rng(3)
    loud = quat_from_rotvec(30.0 * 3.5e-4 * rng.standard_normal((data.n_rows, 3)))
    found = compare(ROBOT, replace(data, quat_wxyz=quat_multiply(loud, data.quat_wxyz)))
    assert found.times_noise["position"] == pytest.approx(1.0, abs=0.15)
    assert found.times_noise["orientation"] == pytest.approx(30.0, rel=0.15)
    assert (
        found.sentence.startswith("The model misses something, or the noise is stated ")
        and "(those of position are noise), and depend on nothing that was tested" in found.sentence
    )
    assert found.as_json()["residual"]["times_noise"] == found.times_noise


def test_what_varies_smoothly_with_the_tilt_is_no_noise_that_was_estimatedunderestimation() -> None:
    """Angles in another order were "3.46 times the assumed noise", and agreed."""
    rng = np.random.default_rng(0)
    data = measured(ROBOT).rows(np.arange(60))
    pose = np.tile(ROBOT.reference_pose, (60, 1))
    pose[:, :3] += rng.uniform(-1.0, 1.0, (60, 3)) * np.array([0.15, 0.1, 0.08])
    pose[:, 3:] = quat_from_rotvec(np.radians(5.0) * rng.uniform(-1.0, 1.0, (60, 3)))
    plain = compare(ROBOT, replace(data, command_pose=pose, run=np.full(60, "a")))
    rest = plain.state.prediction.pose
    x, y, z = rotvec_from_quat(pose[:, 3:]).T
    bent = 0.6 * np.stack([-y * z, x * z, -x * y], axis=1)
    turn = quat_from_rotvec(bent + SIGMA.orientation_rad * rng.standard_normal((60, 3)))
    found = compare(ROBOT, replace(
        data, command_pose=pose, run=np.full(60, "a"), sigma=Sigma(),
        position=rest[:, :3] + SIGMA.position_m * rng.standard_normal((60, 3)),
        quat_wxyz=quat_multiply(turn, rest[:, 3:]),
    ))  # fmt: skip
    assert found.refusal is None and found.times_noise["orientation"] > 2.0
    assert not found.is_noise
    assert "(those of position are noise)" in found.sentence


def test_estimates_from_differences_areunderestimation_if_neighbours_are_alike() -> None:
    rho, rows = 0.8, 200_000
    noise = np.random.default_rng(1).standard_normal(rows)
    for k in range(1, rows):
        noise[k] = rho * noise[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
    part = np.std(np.diff(noise, n=3)) / np.sqrt(20.0)
    assert 1.0 / part == pytest.approx(underestimation(False, rho), rel=0.02)
    assert underestimation(False, 0.0) == underestimation(True, 0.8) == 1.0


def test_outliers_have_one_count_in_a_sentence() -> None:
    """It said "noise (...; 8 outliers). 6 outliers (lines ...) left out of this."."""
    found = compare(ROBOT, measured(ROBOT))
    coloured = Coloured({"position": 0.99}, {"position": 0.0}, 8)
    some = np.arange(found.problem.data.n_rows) < 2
    agree = "Model and data agree: the residuals are noise (position 0.99 times the assumed noise"
    for outliers, further, end in (
        (some, 8, "). 10 outliers left out of this, or given little weight."),
        (some, 0, "). 2 outliers (lines 2, 3) left out of this."),
        (some & ~some, 8, "; 8 outliers)."),
    ):
        noise = replace(coloured, outliers=further)
        said = replace(found, whiteness=LOOSE, coloured=noise, outliers=outliers).sentence
        assert said == f"{agree}{end}"
