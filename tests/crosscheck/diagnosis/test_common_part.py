"""What the values of all cables have in common, where another effect explains it as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import measured, term

from crosscheck.diagnosis.common_part import _in_its_place
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import Terms

pytestmark = pytest.mark.slow

SIGMA = Sigma(position_m=5e-3, orientation_rad=3.5e-4)
GAINS = np.array([0.009, 0.018, 0.012, 0.011])
EXITS, DRUMS, OFFSETS = "exit_point_error", "drum_gain", "cable_length_offset"


def diagnosed(gains: np.ndarray, only: tuple[str, ...], far: float = 0.015) -> Diagnosis:
    """Drums of other sizes, exit points and lengths that are off by ``far`` of the robot's size."""
    robot = load_robot(model_path("camera"))
    rng = np.random.default_rng(3)
    size = far * float(np.ptp(robot.exit_points))
    hidden = [term(robot, DRUMS, **{f"gain_{i + 1}": g for i, g in enumerate(gains)})]
    if EXITS in only:
        errors = {f"error_{i}_{a}_m": size * rng.normal() for i in range(1, 5) for a in "xyz"}
        hidden.append(term(robot, EXITS, **errors))
        offsets = {f"offset_{i}_m": size * rng.normal() for i in range(1, 5)}
        hidden.append(term(robot, OFFSETS, **offsets))
    data = measured(robot, hidden, points=18, sigma=SIGMA)
    return diagnose(robot, data, only=only)


def test_what_all_drums_share_may_be_the_trackers_scale_if_exit_points_may_be_elsewhere() -> None:
    found = diagnosed(GAINS, (DRUMS, EXITS, OFFSETS, "tracker_scale", "length_scale"))
    assert {one.effect for one in found.missing} == {DRUMS, EXITS, OFFSETS}
    # what the offsets share, a scale would only explain beside drums that are far too small
    assert [one.effect for one in found.missing if one.common is not None] == [DRUMS]
    drums = next(one for one in found.missing if one.effect == DRUMS)
    # a scale of all lengths is the same reading of the drums, and no other one
    assert drums.common is not None and drums.indistinguishable == ()
    (scale,) = drums.common.rivals
    assert scale.name == "tracker_scale"
    assert scale.vector[0] - 1.0 == pytest.approx(GAINS.mean(), abs=1e-3)
    assert drums.common.mean == pytest.approx(GAINS.mean(), abs=4 * drums.common.stderr)
    own = np.array(drums.stderr)
    assert 0.0 < drums.common.stderr < own.max()
    assert any(
        "drum_gain: what all cables have in common, 0.012" in note
        and "may as well be tracker_scale (factor = 1.01" in note
        for note in found.notes
    )
    assert any("drum_gain or tracker_scale: measure each drum" in a for a in found.measure_next)
    why = {row.effect: str(row.why_not) for row in found.candidates}
    assert why["tracker_scale"] == (
        "may be what all cables have in common of drum_gain, which is listed"
    )
    told = next(item for item in found.as_json()["missing"] if item["effect"] == DRUMS)
    assert told["common_part"]["indistinguishable"] == {
        "tracker_scale": {"factor": scale.vector[0]}
    }


@pytest.mark.parametrize(
    ("gains", "only", "far"),
    [
        # exit points that are where they should be tell a scale from drums
        (GAINS, (DRUMS, "tracker_scale"), 0.015),
        # with a scale they would all have to be off by the same part of the robot's size
        (GAINS, (DRUMS, EXITS, OFFSETS, "tracker_scale"), 0.0005),
        # these drums share nothing
        (GAINS - GAINS.mean(), (DRUMS, EXITS, OFFSETS, "tracker_scale"), 0.015),
    ],
    ids=["exit points known", "exit points nearly known", "nothing in common"],
)
def test_what_data_tell_apart_or_do_not_see_is_not_noted(
    gains: np.ndarray, only: tuple[str, ...], far: float
) -> None:
    found = diagnosed(gains, only, far)
    drums = next(one for one in found.missing if one.effect == DRUMS)
    assert drums.common is None and "common_part" not in drums.as_json()
    assert not any("in common" in note for note in found.notes)


@pytest.mark.parametrize(("left", "is_rival"), [(4.0, True), (12.0, False)])
def test_a_rival_that_data_tell_apart_is_none_however_plausible(
    left: float, is_rival: bool
) -> None:
    """Drums of thirty plausible sizes cost more than a scale, but readings say what it is."""
    robot = load_robot(model_path("planar_two_cable"))
    drums, scale = term(robot, DRUMS), term(robot, "tracker_scale")
    drums = drums.with_vector(drums.layout.null + 30.0 * drums.layout.scale)
    jacobian = np.eye(4)[:, :2]
    fit: Any = SimpleNamespace(terms=Terms([drums]), jacobian=jacobian)
    found: Any = SimpleNamespace(
        problem=SimpleNamespace(robot=robot),
        last=SimpleNamespace(whiteness=SimpleNamespace(inflation=1.0)),
    )
    signal = 30.0 * jacobian.sum(axis=1)
    column = 0.1 * (signal + left**0.5 * np.eye(4)[3])
    stays = np.eye(2) - 0.5
    rivals = list(_in_its_place(found, fit, signal, stays, scale, column))
    assert [one.name for one in rivals] == ["tracker_scale"] * is_rival
