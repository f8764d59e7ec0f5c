"""Effects far below their expected sizes, which a good tracker sees all the same."""

from __future__ import annotations

import pytest
from made_data import COGIRO, measured, term
from made_diagnoses import SLOW

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.planning.design import make_plan
from crosscheck.planning.visibility import NAMED
from seecr.description.mjcf import load_robot

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "values"),
    [
        # hundredths of millimetres: few larger numbers of another effect once took their place
        (
            "initial_pose_error",
            {
                "position_x_m": 3.4e-5,
                "rotation_x_rad": 4.8e-5,
                "rotation_y_rad": -2.2e-5,
                "rotation_z_rad": -6.3e-5,
            },
        ),
        pytest.param(
            "cable_length_offset",
            {
                "offset_1_m": -1.7e-5,
                "offset_3_m": 5.2e-6,
                "offset_5_m": -5.4e-6,
                "offset_6_m": 2.1e-5,
                "offset_7_m": -1e-5,
                "offset_8_m": -4.5e-6,
            },
            marks=pytest.mark.sweep,
        ),
    ],
)
def test_many_small_numbers_are_not_taken_for_few_of_another_effect(name, values):
    robot = load_robot(COGIRO)
    data = measured(robot, [term(robot, name, **values)], points=12, seed=2)
    found = diagnose(robot, data, exclude=SLOW)
    assert found.verdict == "effects_found"
    (one,) = found.missing
    assert name in {one.effect, *(rival.name for rival in one.rivals)}


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("pulley_radius", "radius_m"),
        pytest.param("length_scale", "factor", marks=pytest.mark.sweep),
    ],
)
def test_what_a_plan_says_is_named_is_named(name, parameter):
    """Nine in ten of the curve in docs/diagnosis.md; two of which a test can see."""
    robot = load_robot(COGIRO)
    planned = make_plan(robot, measured(robot, points=12))
    seen = next(found for found in planned.effects if found.name == name)
    size = seen.as_json()["nine_in_ten_named"][parameter]
    assert size == pytest.approx(NAMED * seen.factor * seen.signal.layout.scale[0])
    data = measured(robot, [term(robot, name, **{parameter: size})], points=12, seed=5)
    (one,) = diagnose(robot, data, exclude=SLOW).missing
    assert name in {one.effect, *(rival.name for rival in one.rivals)}
