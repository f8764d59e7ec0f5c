"""Columns of what is unknown, against what they say in words."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest
from made_data import measured
from made_diagnoses import SIGMA, robot

from crosscheck.fit.problem import KINDS, Problem
from crosscheck.inference.fields import (
    Varying,
    detectable_size,
    fields_about,
    in_units_of_noise,
    per_channel,
    products,
    widening,
)
from crosscheck.inference.fit import Data, Fit, unfitted
from crosscheck.inference.priors import FIELD_WIDTHS, UNKNOWN
from seecr.effects import Terms
from seecr.pose import Array


@cache
def about() -> Fit:
    data = measured(robot(), points=3, sigma=SIGMA, tensions=True)
    problem = Problem(robot(), data, SIGMA, np.ones(data.n_rows, bool))
    return unfitted(Data.of(problem, Terms()), Terms())


@cache
def fields() -> tuple[tuple[Varying, Array], ...]:
    return tuple(fields_about(about()))


def of(kind: Varying) -> list[Array]:
    return [columns for one, columns in fields() if one is kind]


def spans(columns: Array, wanted: Array) -> bool:
    """Whether columns can be added up to each of the wanted ones."""
    left = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=1e-12)[0]
    return bool(np.linalg.norm(left) < 1e-7 * np.linalg.norm(wanted))


def near(columns: Array, wanted: Array) -> bool:
    """The same, to the error of differences."""
    left = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
    return bool(np.linalg.norm(left) < 1e-3 * np.linalg.norm(wanted))


def test_shapes_are_there_for_each_channel_and_products_for_each_pair() -> None:
    data, random = about().data, np.random.default_rng(0)
    shapes = random.normal(size=(data.problem.n_readings, 2))
    column = data.problem.column_of
    every = per_channel(data, shapes)
    assert every.shape[1] == 2 * len(np.unique(column))
    for n, channel in enumerate(np.unique(column)):
        own = column == channel
        np.testing.assert_array_equal(every[own, 2 * n : 2 * n + 2], shapes[own])
        assert not every[~own, 2 * n : 2 * n + 2].any()
    tension = per_channel(data, shapes, 2)
    assert tension.shape[1] == 2 * robot().n_cables and not tension[data.chain.kind != 2].any()
    a, b = random.normal(size=(5, 3)), random.normal(size=(5, 2))
    expected = np.stack([a[:, i] * b[:, j] for i in range(3) for j in range(2)], axis=1)
    np.testing.assert_array_equal(products(a, b), expected)


def test_units_of_noise_are_those_in_which_all_columns_move_a_reading_by_one() -> None:
    columns = np.random.default_rng(0).normal(size=(50, 3)) * [1.0, 5.0, 0.2]
    unit = in_units_of_noise(columns)
    assert np.sum(unit**2) / 50 == pytest.approx(1.0)
    np.testing.assert_allclose(unit * columns[0, 0] / unit[0, 0], columns)
    assert not in_units_of_noise(np.zeros((4, 2))).any()


def test_a_picture_may_widen_about_any_point_whose_axes_have_any_scale() -> None:
    """x + k |x - p|^2 (x - p): what it moves is a sum of the columns."""
    random = np.random.default_rng(1)
    place = random.uniform([0, 1, 2], [0.8, 1.4, 2.6], (30, 3))
    columns = widening(place).reshape(90, 16)
    for _ in range(3):
        off = place - random.uniform(0.0, 3.0, 3)
        wide = np.sum(off**2, axis=1)[:, None] * off
        assert spans(columns, wide.reshape(90, 1))
        assert spans(columns, (place @ random.normal(size=(3, 3))).reshape(90, 1))
    assert not spans(columns, (place**2).reshape(90, 1)), "not each axis by itself"
    assert np.linalg.matrix_rank(columns) == 16
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    size = np.abs(place - middle).max()
    np.testing.assert_allclose(widening(place)[:, 0, 3:6], (place - middle) / size)


def test_the_kinds_that_are_tried() -> None:
    """Of a robot whose positions, angles and tensions are read, with four cables."""
    assert Counter(kind.name for kind, _columns in fields()) == {
        "POSITION": 4, "ORIENTATION": 3, "TENSION": 3, "READINGS": 1, "SESSION": 1, "LAG": 1,
        "FORCE": 1, "SPRING": 1, "LENGTHS": 1, "ONE_CABLE": 4, "WINCHES": 2, "COUPLED": 2,
        "EXIT_POINTS_MOVE": 1, "LENGTHS_DRIFT": 1, "FORCE_DRIFTS": 1,
    }  # fmt: skip
    channel = {Varying.POSITION, Varying.ORIENTATION, Varying.TENSION, Varying.READINGS,
               Varying.SESSION}  # fmt: skip
    pictures = {id(columns) for columns in of(Varying.POSITION) if columns.shape[1] == 16}
    n = about().data.problem.n_readings
    for kind, columns in fields():
        if kind not in channel or id(columns) in pictures:
            assert np.sum(columns**2) / n == pytest.approx(1.0), kind


def test_smooth_fields_follow_a_cubic_of_the_place() -> None:
    fit = about()
    problem, place = fit.data.problem, fit.state.prediction.pose[:, :3]
    cubic = (place[:, 0] ** 2 * place[:, 2] - place[:, 2] ** 3 + 0.3)[problem.row_of]
    quartic = (place[:, 0] ** 4)[problem.row_of]
    for kind, name in enumerate(("POSITION", "ORIENTATION", "TENSION")):
        own = fit.data.chain.kind == kind
        smooth = [c for c in of(Varying[name]) if spans(c, (cubic * own)[:, None])]
        assert len(smooth) >= 2 and not any(spans(c, (quartic * own)[:, None]) for c in smooth[:2])
        assert all(not c[~own].any() for c in of(Varying[name]))
        a, b = (np.linalg.norm(c, axis=0) for c in smooth[:2])
        assert np.unique(np.round(b / a, 6)).tolist() == pytest.approx([0.027, 0.09, 0.3, 1.0])
    (every,) = of(Varying.READINGS)
    assert spans(every, cubic[:, None])


def test_what_goes_with_time_follows_the_clock() -> None:
    fit = about()
    problem = fit.data.problem
    time = problem.data.t_s[problem.row_of]
    (session,) = of(Varying.SESSION)
    own = problem.column_of == 2
    assert spans(session, ((time**3 - 40.0 * time) * own)[:, None])
    assert not session[fit.data.chain.kind != KINDS.index(KINDS[0])].any()
    (drift,) = of(Varying.LENGTHS_DRIFT)
    lengths = rates("cable_length_offset")
    late = ((time - 0.5 * (time.max() + time.min())) / (0.5 * np.ptp(time)))[:, None]
    assert near(drift, lengths * late) and near(drift, lengths * late**2)
    assert not near(drift, lengths)


def rates(name: str) -> Array:
    """(N, k) derivatives by differences of the solved model, in units of the noise."""
    from seecr.effects import Term, layout_of

    fit, layout, out = about(), layout_of(name, robot()), []
    for k in range(len(layout)):
        step = np.zeros(len(layout))
        step[k] = 1e-3 * layout.scale[k]
        ends = [
            fit.data.state(Terms([Term(layout, layout.null + by * step)])).white for by in (-1, 1)
        ]
        out.append((ends[0] - ends[1]) / 2e-3)
    return np.stack(out, axis=1)


def test_lengths_go_with_the_place_and_with_the_winches() -> None:
    fit = about()
    row, place = fit.data.problem.row_of, fit.state.prediction.pose[:, :3]
    lengths = rates("cable_length_offset")

    (linear,) = of(Varying.LENGTHS)
    assert near(linear, lengths * place[row, :1]) and near(linear, lengths)
    assert not near(linear, lengths[:, :1] * place[row, :1] ** 2)
    for k, bent in enumerate(of(Varying.ONE_CABLE)):
        x, z = (place[row, j] - 0.5 * (place[:, j].max() + place[:, j].min()) for j in (0, 2))
        assert near(bent, (lengths[:, k] * x * z)[:, None])
        assert not near(bent, lengths[:, [k]]) and not near(bent, (lengths[:, k - 1] * x)[:, None])
    turned = fit.state.prediction.setup.commanded_change[row]
    alike, own = of(Varying.WINCHES)
    assert alike.shape[1] == 3 and own.shape[1] == 12
    for power in (1, 2, 3):
        assert near(alike, np.sum(lengths * turned**power, axis=1, keepdims=True))
        assert near(own, lengths[:, [1]] * turned[:, [1]] ** power)
    beside, every = of(Varying.COUPLED)
    assert beside.shape[1] == 2 and every.shape[1] == 12
    before = sum(lengths[:, k] * turned[:, (k - 1) % 4] for k in range(4))
    after = sum(lengths[:, k] * turned[:, (k + 1) % 4] for k in range(4))
    assert near(beside, before[:, None]) and near(beside, after[:, None])
    alone = [near(every, (lengths[:, i] * turned[:, i])[:, None]) for i in range(4)]
    assert not all(alone), "what a winch does to its own cable is another kind"
    for i in range(4):
        others = [(lengths[:, i] * turned[:, j])[:, None] for j in range(4) if j != i]
        assert all(near(every, other) for other in others)


def test_forces_go_with_the_place() -> None:
    fit = about()
    row, place = fit.data.problem.row_of, fit.state.prediction.pose[:, :3]
    force = rates("external_wrench")[:, :3]
    (linear,), (spring,) = of(Varying.FORCE), of(Varying.SPRING)
    pulled = np.sum(force * (place[row] - [0.3, 0.0, 0.7]), axis=1, keepdims=True)
    for columns, wanted in ((linear, force[:, [2]] * place[row, :1]), (spring, pulled)):
        assert near(columns, wanted)


def test_a_lag_is_the_step_from_the_row_before_in_its_run() -> None:
    fit = about()
    problem = fit.data.problem
    (lag,) = of(Varying.LAG)
    run, x = problem.data.run_index, fit.state.prediction.pose[:, 0]
    step = np.where(np.append(True, run[1:] != run[:-1]), 0.0, np.append(0.0, x[:-1] - x[1:]))
    own = problem.column_of == 0
    found = lag[own, 0] / SIGMA.position_m
    ratio = found[step != 0.0] / step[step != 0.0]
    np.testing.assert_allclose(ratio, ratio[0])
    assert not found[step == 0.0].any()
    assert not lag[fit.data.chain.kind == 2].any()


def test_a_field_of_the_detectable_size_is_mostly_seen() -> None:
    """Drawn anew: of that size nine in ten have more evidence than the prior asks, and not below.

    Evidence is that of the whole covariance, averaged over the widths of a field.
    """
    fit = about()
    found = detectable_size(fit)
    assert found is not None
    problem, place = fit.data.problem, fit.state.prediction.pose[:, :3]
    x, z = (
        (one - 0.5 * (one.max() + one.min())) / (0.5 * np.ptp(one))
        for one in (place[:, 0], place[:, 2])
    )
    shapes = np.stack([x**i * z**j for i in range(4) for j in range(4 - i)], axis=1)
    field = per_channel(fit.data, shapes[problem.row_of])
    n, random = len(field), np.random.default_rng(5)
    covs = [np.eye(n) + w**2 * field @ field.T for w in FIELD_WIDTHS]
    inverses = [np.linalg.inv(c) - np.eye(n) for c in covs]
    volumes = [np.linalg.slogdet(c)[1] for c in covs]

    def seen(size: float) -> float:
        """The part of fields of this size, in units of the noise, that are seen."""
        count = 0
        for _ in range(300):
            one = field @ random.standard_normal(field.shape[1])
            y = size * one / np.sqrt(np.mean(one**2)) + random.standard_normal(n)
            each = [-0.5 * (y @ i @ y + v) for i, v in zip(inverses, volumes, strict=True)]
            count += np.logaddexp.reduce(each) - np.log(len(each)) > -UNKNOWN
        return count / 300

    position = found["position_rms_m"]
    assert position is not None
    size = position / SIGMA.position_m
    assert seen(1.15 * size) > 0.85 > 0.8 > seen(size / 1.3)
