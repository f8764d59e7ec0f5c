"""Something unknown that varies in time, beside all effects, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term

from crosscheck.calibration.joint_fit.all_effects import fit_all_effects
from crosscheck.calibration.unknown.beside import UnknownOdds, unknown_beside
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.given import considered
from crosscheck.measurements.data import Measurements
from seecr.effects import Terms
from seecr.pose import Array, quat_from_rotvec, quat_multiply

pytestmark = pytest.mark.slow

ROBOT = soft_cogiro()
# What looks like something that changes in time, so that the tests do not take long.
FEW = ["exit_point_error", "cable_length_offset", "tracker_frame", "pulley_radius", "hysteresis"]


def moving_exit_point() -> Measurements:
    """The third exit point settles by 4 mm over the session."""
    data = measured(ROBOT)
    ends = [measured(ROBOT, [term(ROBOT, "exit_point_error", **{"error_3_z_m": z})]) for z in (
        0.0, -0.004,
    )]  # fmt: skip
    time = np.linspace(0.0, 1.0, data.n_rows)[:, None]
    turn = _turned(ends[1].quat_wxyz, ends[0].quat_wxyz) * time
    return replace(
        data,
        position=ends[0].position + time * (ends[1].position - ends[0].position),
        quat_wxyz=quat_multiply(quat_from_rotvec(turn), ends[0].quat_wxyz),
    )


def lagging(part: float) -> Measurements:
    """Readings that are so far from the present pose to that of the row before."""
    data = measured(ROBOT, [term(ROBOT, "pulley_radius", radius_m=0.004)])
    assert data.quat_wxyz is not None
    follows = np.append(False, data.run[1:] == data.run[:-1])[1:, None]
    place, quat = data.position.copy(), data.quat_wxyz.copy()
    place[1:] -= part * follows * (data.position[1:] - data.position[:-1])
    back = -part * follows * _turned(data.quat_wxyz[1:], data.quat_wxyz[:-1])
    quat[1:] = quat_multiply(quat_from_rotvec(back), quat[1:])
    return replace(data, position=place, quat_wxyz=quat)


def homed_anew() -> Measurements:
    """Before each run, to a millimetre."""
    data = measured(ROBOT)
    assert data.quat_wxyz is not None
    random = np.random.default_rng(5)
    place, quat = data.position.copy(), data.quat_wxyz.copy()
    for run in np.unique(data.run):
        off = {f"offset_{k}_m": 1e-3 * random.standard_normal() for k in range(1, 9)}
        there, own = measured(ROBOT, [term(ROBOT, "cable_length_offset", **off)]), data.run == run
        assert there.quat_wxyz is not None
        place[own], quat[own] = there.position[own], there.quat_wxyz[own]
    return replace(data, position=place, quat_wxyz=quat)


def _turned(now: Array | None, before: Array | None) -> Array:
    """(n, 3) small rotation vectors from quaternions to others."""
    assert now is not None and before is not None
    conjugate = before * np.array([1.0, -1.0, -1.0, -1.0])
    return np.asarray(2.0 * quat_multiply(now, conjugate)[:, 1:])


def beside(data: Measurements) -> UnknownOdds:
    """What varies beside the few effects, all fitted at once."""
    ready = prepare(ROBOT, data, Terms(), considered(FEW))
    whole = fit_all_effects(ready.problem, Terms())
    return unknown_beside(whole.setting, whole.joint)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        pytest.param(moving_exit_point, Varying.EXIT_POINTS_MOVE, id="settles"),
        pytest.param(homed_anew, Varying.LENGTHS_BY_RUN, id="homed anew"),
        pytest.param(lambda: lagging(0.02), Varying.LAG, id="lags"),
    ],
)
def test_what_changes_in_time_is_seen_and_told(
    data: Callable[[], Measurements], what: Varying
) -> None:
    found = beside(data())
    assert found.is_there and found.likeliest is what
    others = [odds for other, odds in found.each.items() if other is not what]
    assert found.each[what] > max(others) + 10.0


def test_of_noise_nothing_is_said() -> None:
    """Nor of noise that goes together along a run, which looks like a drift."""
    assert UnknownOdds(4.9, {Varying.LAG: 5.5}).likeliest is None
    white = beside(measured(ROBOT))
    random = np.random.default_rng(3)
    assert SIGMA.position_m is not None
    data = measured(ROBOT, sigma=replace(SIGMA, position_m=1e-9))
    drawn = random.standard_normal(data.position.shape)
    for k in range(1, len(drawn)):
        if data.run[k] == data.run[k - 1]:
            drawn[k] = 0.8 * drawn[k - 1] + 0.6 * drawn[k]
    noisy = replace(data, sigma=SIGMA, position=data.position + SIGMA.position_m * drawn)
    for found in (white, beside(noisy)):
        assert not found.is_there and found.likeliest is None
        assert max(found.each.values()) < 5.0


def test_a_smooth_field_is_not_told_as_something_in_time() -> None:
    there = UnknownOdds(20.0, {Varying.READINGS: 21.0, Varying.LAG: 9.0})
    assert there.is_there and there.likeliest is None


def test_the_diagnosis_says_what_it_looks_like_and_what_to_do() -> None:
    found = diagnose(ROBOT, moving_exit_point(), only=FEW)
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and not found.missing
    assert "It looks like exit points that move over the session." in found.sentence
    assert any(Varying.EXIT_POINTS_MOVE.advice in line for line in found.measure_next)
    assert found.chances is not None
    assert found.chances.as_json()["unknown"]["seen_in"] == Varying.EXIT_POINTS_MOVE


def test_an_effect_that_imitates_what_lags_is_not_named() -> None:
    found = diagnose(ROBOT, lagging(0.02), only=[*FEW, "backlash"])
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert "readings that lag behind the last step" in found.sentence
    assert {"backlash", "hysteresis"}.isdisjoint(one.effect for one in found.missing)
