"""What may be missing: which effects and forms data can show, and how probable sets are."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import comb, exp, log

import numpy as np
import pytest
from made_data import measured
from made_diagnoses import SIGMA, robot

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Why
from crosscheck.inference.catalogue import Catalogue, candidates, input_lacking, log_choices
from crosscheck.inference.fields import Varying
from crosscheck.inference.fit import Data
from crosscheck.inference.priors import ANEW, UNKNOWN
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import together
from seecr.effects import Terms, layout_of


@cache
def readings() -> Measurements:
    return measured(robot(), points=3, sigma=SIGMA, tensions=True)


def problem(data: Measurements, use: np.ndarray | None = None) -> Problem:
    return Problem(robot(), data, SIGMA, np.ones(data.n_rows, bool) if use is None else use)


def catalogue(one: Problem) -> Catalogue:
    return Catalogue.of(Data.of(one, Terms()), Terms())


@pytest.mark.parametrize("of", [1, 4, 9])
def test_all_numbers_of_effects_are_equally_probable_and_all_sets_of_one_number(of: int) -> None:
    for count in range(of + 1):
        assert exp(log_choices(count, of)) == pytest.approx(1.0 / ((of + 1) * comb(of, count)))


def test_a_field_and_a_form_have_their_share_of_a_sets_probability() -> None:
    one = replace(
        catalogue(problem(readings())),
        kinds={"~0": Varying.LAG, "~1": Varying.FORCE, "~2": Varying.FORCE},
    )
    n = len(one.effects)
    assert n == len({k.partition("@")[0] for k in one.members})
    plain = one.log_prior(frozenset(["stiffness", "platform_mass"]))
    assert plain == pytest.approx(log_choices(2, n))
    for key, share in (("~0", 2), ("~2", 4)):
        assert one.log_prior(frozenset(["stiffness", "platform_mass", key])) == pytest.approx(
            plain + UNKNOWN - log(share)
        )
    form = frozenset(["stiffness", "cable_length_offset@file"])
    expected = log_choices(2, n) + ANEW
    assert catalogue(problem(two_files())).log_prior(form) == pytest.approx(expected)


def test_an_effect_needs_the_column_that_it_depends_on() -> None:
    data = readings()
    warm = np.linspace(20.0, 25.0, data.n_rows)

    def why(name: str, **changes: object) -> Why | None:
        reason = input_lacking(replace(data, **changes), layout_of(name, robot()))
        return None if reason is None else reason.why

    assert why("thermal_expansion") is Why.NEEDS_TEMPERATURE
    assert why("thermal_expansion", temperature_C=warm) is None
    assert why("thermal_expansion", temperature_C=0 * warm) is Why.CONSTANT_TEMPERATURE
    assert why("stiffness", temperature_C=0 * warm) is None
    assert why("creep") is None and why("creep", t_s=None) is Why.NEEDS_TIME
    assert why("creep", t_s=0.0 * warm) is Why.NEEDS_TIME
    assert why("tension_scale") is None
    assert why("tension_scale", tensions=np.full_like(data.tensions, np.nan)) is Why.NEEDS_TENSIONS
    assert why("initial_pose_error") is None
    lengths = {"command_pose": None, "command_lengths": np.ones((data.n_rows, robot().n_cables))}
    assert why("initial_pose_error", **lengths) is Why.NEEDS_POSES
    assert why("stiffness", **lengths, t_s=None) is None


@pytest.mark.parametrize(("rows", "fits"), [(12, True), (11, False)])
def test_an_effect_may_have_as_many_parameters_as_there_are_rows(rows: int, fits: bool) -> None:
    """Errors of the planar robot's exit points are twelve."""
    use = np.arange(readings().n_rows) < rows
    whys = {layout.name: why for layout, why in candidates(problem(readings(), use))}
    assert (whys["exit_point_error"] is None) == fits and whys["stiffness"] is None
    if not fits:
        reason = whys["exit_point_error"]
        assert reason is not None and reason.why is Why.TOO_MANY_PARAMETERS
    one = problem(readings(), use & (np.arange(len(use)) < 1)).considering(frozenset(["stiffness"]))
    reasons = {layout.name: why for layout, why in candidates(one)}
    assert (alone := reasons["stiffness"]) is not None and alone.why is Why.TOO_MANY_PARAMETERS
    assert (other := reasons["backlash"]) is not None and other.why is Why.EXCLUDED


def test_an_excluded_effect_is_no_candidate() -> None:
    one = problem(readings()).considering(frozenset(["stiffness"]))
    found = catalogue(one)
    assert list(found.members) == ["stiffness"] and not found.members["stiffness"].waits
    waiting = {k for k, m in catalogue(problem(readings())).members.items() if m.waits}
    assert waiting == {
        "drum_eccentricity", "backlash", "cable_weight", "hysteresis", "creep", "exit_friction",
    }  # fmt: skip


def two_files() -> Measurements:
    return together([
        replace(measured(robot(), points=3, sigma=SIGMA, seed=k, tensions=True),
                path=readings().path.with_name(f"{k}.csv")) for k in (0, 1)
    ])  # fmt: skip


def test_forms_need_five_rows_in_each_of_several_parts() -> None:
    """Eight runs of three rows are too short; two files are not."""
    data = two_files()

    def forms(use: np.ndarray, of: Measurements = data) -> set[str]:
        return {k for k in catalogue(problem(of, use)).members if "@" in k}

    row = np.arange(data.n_rows)
    by_file = {k for k in forms(row >= 0) if k.endswith("@file")}
    assert by_file == {
        f"{k}@file" for k in (
            "cable_length_offset", "initial_pose_error", "exit_point_error", "anchor_point_error",
            "platform_mass", "centre_of_mass", "external_wrench", "tracker_frame", "tracker_target",
        )
    }  # fmt: skip
    half = data.n_rows // 2
    ends = np.minimum(row % half, half) // 1
    assert forms(ends < 5) >= {"platform_mass@file"}
    assert not forms(ends < 4) and not forms(row < half, data) & {"platform_mass@file"}
    # a run is a file where each file has one: those are not there twice
    single = replace(data, run=np.where(row < half, "a", "b").astype(data.run.dtype))
    assert not {k for k in forms(row >= 0, single) if k.endswith("@run")}
    thirds = (row * 3 // data.n_rows).astype(str)
    three = replace(readings(), run=thirds[::2].astype(readings().run.dtype))
    assert {k for k in forms(np.ones(readings().n_rows, bool), three)} == {
        f"{k}@run" for k in ("cable_length_offset", "initial_pose_error", "tracker_frame",
                             "exit_point_error")
    }  # fmt: skip
