"""Where MJCF can hold an effect follows from what the effect edits."""

from __future__ import annotations

import pytest

import seecr
from seecr.exported.export import LIFTED_SHEAVE, PAST, SENSED, WARM, Expressed, expressed

ROBOT = seecr.load_robot("demobot_cogiro")
SIZES = {
    "exit_point_error": 0.003, "platform_mass": 0.1, "stiffness": 1.1, "pulley_radius": 0.02,
    "cable_length_offset": 0.001, "drum_gain": 0.01, "tracker_frame": 0.01, "creep": 0.02,
    "backlash": 0.001, "drum_eccentricity": 0.001, "thermal_expansion": 1e-5,
}  # fmt: skip


def sorted_by(*names: str) -> Expressed:
    layouts = [seecr.layout_of(name, ROBOT) for name in names]
    return expressed(ROBOT, [
        layout.build(layout.null + SIZES[layout.name] * ~layout.shape) for layout in layouts
    ])  # fmt: skip


def test_a_description_holds_points_masses_and_stiffness() -> None:
    found = sorted_by("exit_point_error", "platform_mass", "stiffness")
    assert [e.name for e in found.plain] == ["exit_point_error", "platform_mass", "stiffness"]
    assert not found.bodies and not found.lengths and not found.nowhere


@pytest.mark.parametrize("name", ["cable_length_offset", "drum_gain", "drum_eccentricity"])
def test_what_winches_pay_out_is_in_the_rest_lengths_also_where_it_is_zero_at_home(
    name: str,
) -> None:
    assert [e.name for e in sorted_by(name).lengths] == [name]


def test_pulleys_need_bodies_of_their_own() -> None:
    assert [e.name for e in sorted_by("pulley_radius").bodies] == ["pulley_radius"]


def test_memories_temperatures_and_sensors_are_nowhere_with_the_reason() -> None:
    found = sorted_by("creep", "backlash", "thermal_expansion", "tracker_frame")
    assert [(e.name, why) for e, why in found.nowhere] == [
        ("creep", PAST), ("backlash", PAST), ("thermal_expansion", WARM), ("tracker_frame", SENSED),
    ]  # fmt: skip


def test_at_null_an_effect_needs_no_place() -> None:
    null = seecr.Term.of(ROBOT, "pulley_radius").effect()
    assert expressed(ROBOT, [null]) == Expressed((), (), (), ())


def test_a_frame_that_yields_unevenly_has_no_place_beside_pulleys() -> None:
    frame = seecr.Term.of(ROBOT, "frame_compliance", upwards_m_per_N=1e-5).effect()
    wheel = seecr.Term.of(ROBOT, "pulley_radius", radius_m=0.02).effect()
    assert expressed(ROBOT, [frame]).bodies == (frame,)
    found = expressed(ROBOT, [frame, wheel])
    assert found.bodies == (wheel,) and found.nowhere == ((frame, LIFTED_SHEAVE),)
