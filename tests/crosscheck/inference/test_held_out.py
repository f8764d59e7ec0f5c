"""Blocks that are held out, and whether an effect pays on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, robot

from crosscheck.fit.problem import Problem
from crosscheck.inference.fit import Data, fit, unfitted, without_rows
from crosscheck.inference.held_out import (
    HeldOut,
    blocks_note,
    blocks_of,
    by_part,
    hold_out,
    improves,
    pays,
    rms_by_block,
)
from seecr.effects import Terms


def held(chi2: list[float], valid: bool = True) -> HeldOut:
    return HeldOut(np.zeros((0, 0)), np.array(chi2), np.ones(len(chi2)), {}, valid)


def test_a_fall_of_chi2_is_a_mean_over_blocks_with_its_standard_error() -> None:
    before, after = held([9.0, 7.0, 12.0]), held([5.0, 6.0, 5.0])
    mean, error = improves(before, after)
    assert mean == pytest.approx(4.0) and error == pytest.approx(3.0 / np.sqrt(3.0))
    assert improves(held([5.0]), held([2.0])) == (3.0, np.inf)


@pytest.mark.parametrize(("spread", "good"), [(1.9, True), (2.1, False)])
def test_an_effect_pays_if_chi2_falls_by_half_a_standard_error(spread: float, good: bool) -> None:
    """Of two blocks the standard error of the mean is half of their difference."""
    after = held([0.0, 0.0])
    assert pays(held([1.0 + spread, 1.0 - spread]), after) is good
    assert not pays(held([1.0 + spread, 1.0 - spread]), replace(after, valid=False))
    assert not pays(held([0.0, 0.0]), after) and not pays(held([-1.0, -1.0]), after)


def problem(runs: list[int] | None = None, use: int = 24) -> Problem:
    hidden = [term(robot(), "stiffness", factor=0.9)]
    data = measured(robot(), hidden, points=3, sigma=SIGMA)
    if runs is not None:
        data = replace(data, run=np.array(runs).astype(data.run.dtype))
    return Problem(robot(), data, SIGMA, np.arange(data.n_rows) < use)


def test_blocks_are_runs_or_stretches_of_time_where_runs_are_few() -> None:
    one = problem()
    runs = one.data.run_index
    assert [set(np.flatnonzero(b)) for b in blocks_of(one)] == [
        set(np.flatnonzero(runs == k)) for k in range(7)
    ]
    assert blocks_note(one) == []
    three, two = problem([0] * 8 + [1] * 8 + [2] * 8), problem([0] * 12 + [1] * 12)
    assert len(blocks_of(three)) == 3 and not blocks_note(three)
    assert [int(b.sum()) for b in blocks_of(two)] == [5, 5, 5, 5, 4]
    assert all(np.ptp(np.flatnonzero(b)) == b.sum() - 1 for b in blocks_of(two))
    words = "cross-validation leaves out {} of time instead of runs"
    assert blocks_note(two) == [f"only 2 runs: {words.format('5 blocks')}"]
    single = problem([0] * 24, use=6)
    assert blocks_note(single) == [f"a single run: {words.format('3 blocks')}"]
    assert [int(b.sum()) for b in blocks_of(problem([0] * 24, use=3))] == [2, 1]


def test_where_each_file_has_its_own_values_a_block_is_a_part_of_each() -> None:
    one = problem()
    group = (np.arange(24) >= 9).astype(int)  # three runs, and four
    blocks = blocks_of(by_part(unfitted(Data.of(one, Terms()), Terms()), group).data.problem)
    runs = one.data.run_index
    expected = [{0, 3}, {1, 4}, {2, 5}, {6}]
    assert [set(runs[b]) for b in blocks] == expected
    assert blocks_note(one.with_groups(group))[0].startswith("cross-validation leaves out a part")


def test_each_row_is_predicted_by_a_fit_without_its_block() -> None:
    one = problem()
    data = Data.of(one, Terms())
    plain = unfitted(data, Terms())
    stays = hold_out(plain)
    np.testing.assert_array_equal(stays.raw, plain.state.raw)
    assert stays.chi2.sum() == pytest.approx(float(np.sum(plain.state.white**2)))
    assert stays.readings.sum() == one.n_readings and stays.valid
    found = fit(data, data.state(Terms([term(robot(), "stiffness", factor=1.0)])))
    out = hold_out(found)
    for rows in blocks_of(one):
        alone = without_rows(found, rows[one.row_of])
        np.testing.assert_array_equal(out.raw[rows], alone.raw[rows])
    assert pays(stays, out) and out.valid
    each = rms_by_block(one, out, "position_rms_m")
    for size, rows in zip(each, blocks_of(one), strict=True):
        off = (out.raw * one.counted)[rows][:, one.counted.any(axis=0)][:, :3]
        assert size == pytest.approx(np.sqrt(np.mean(off**2)))
    assert np.isnan(rms_by_block(one, out, "tension_rms_N")).all()
