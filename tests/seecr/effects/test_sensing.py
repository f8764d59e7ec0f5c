"""What sensors report, by quarter turns: nothing has to be computed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr.effects import layout_of
from seecr.effects.base import Effect, Readings
from seecr.effects.sensing import TensionScale, TrackerFrame, TrackerScale, TrackerTarget
from seecr.pose import Array

HALF = np.sqrt(0.5)
ABOUT_X, ABOUT_Z = np.array([np.pi / 2, 0.0, 0.0]), np.array([0.0, 0.0, np.pi / 2])
LEVEL, ON_X, ON_Z = ([1.0, 0, 0, 0], [HALF, HALF, 0, 0], [HALF, 0, 0, HALF])
NOTHING = np.zeros(3)
# not needed by what sensors report
SETUP: Any = None


def read(effect: Effect, position: list[float], quat: list[float]) -> tuple[Array, Array]:
    """What is reported of a platform at a position with an orientation."""
    readings = Readings(np.array([position]), np.array([quat]), np.array([[3.0, 5.0]]))
    effect.edit_readings(readings, SETUP)
    return readings.position[0], readings.quat_wxyz[0]


def test_a_turned_frame_turns_positions_about_the_base_and_then_shifts() -> None:
    place, turn = read(TrackerFrame(np.array([10.0, 0, 0]), ABOUT_Z), [1, 2, 3], LEVEL)
    assert place == pytest.approx([8.0, 1.0, 3.0])
    assert turn == pytest.approx(ON_Z)


def test_a_turned_frame_turns_before_the_platform_does() -> None:
    """About z after x: x goes to y, y to z, z to x."""
    _place, turn = read(TrackerFrame(NOTHING, ABOUT_Z), [0, 0, 0], ON_X)
    assert turn == pytest.approx([0.5, 0.5, 0.5, 0.5])


def test_a_target_is_carried_and_turned_by_the_platform() -> None:
    """A metre along the platform's x is one along y; about its own x follows about z."""
    place, turn = read(TrackerTarget(np.array([1.0, 0, 0]), ABOUT_X), [1, 2, 3], ON_Z)
    assert place == pytest.approx([1.0, 3.0, 3.0])
    assert turn == pytest.approx([0.5, 0.5, 0.5, 0.5])


def test_a_target_does_not_turn_its_own_shift() -> None:
    place, _turn = read(TrackerTarget(np.array([1.0, 0, 0]), ABOUT_Z), [0, 0, 0], LEVEL)
    assert place == pytest.approx([1.0, 0.0, 0.0])


def test_a_turned_frame_sees_the_target_where_it_was_carried_to() -> None:
    """Target first: (1, 0, 0) ahead of (1, 0, 0) is (2, 0, 0), which is seen at (0, 2, 0)."""
    readings = Readings(np.array([[1.0, 0, 0]]), np.array([LEVEL]), np.zeros((1, 2)))
    for effect in (
        TrackerTarget(np.array([1.0, 0, 0]), NOTHING),
        TrackerFrame(NOTHING, ABOUT_Z),
    ):
        effect.edit_readings(readings, SETUP)
    assert readings.position[0] == pytest.approx([0.0, 2.0, 0.0])


def test_a_tracker_scales_positions_from_its_origin_and_nothing_else() -> None:
    place, turn = read(TrackerScale(1.5), [1, -2, 4], ON_X)
    assert place.tolist() == [1.5, -3.0, 6.0] and turn.tolist() == ON_X


def test_load_cells_scale_tensions_and_nothing_else() -> None:
    readings = Readings(np.array([[1.0, 2, 3]]), np.array([ON_X]), np.array([[3.0, 5.0]]))
    TensionScale(2.0).edit_readings(readings, SETUP)
    assert readings.tensions.tolist() == [[6.0, 10.0]]
    assert (
        readings.position.tolist() == [[1.0, 2.0, 3.0]] and readings.quat_wxyz[0].tolist() == ON_X
    )


@pytest.mark.parametrize("effect", [
    TrackerFrame(NOTHING, NOTHING), TrackerFrame(np.array([1.0, 0, 0]), NOTHING),
    TrackerTarget(NOTHING, NOTHING), TrackerTarget(np.array([1.0, 0, 0]), NOTHING),
])  # fmt: skip
def test_without_a_turn_orientations_keep_every_bit(effect: Effect) -> None:
    quat = [0.1, 0.2, 0.3, 0.4]  # of no norm in particular: a multiplication would change bits
    assert read(effect, [1, 2, 3], quat)[1].tolist() == quat


def test_what_was_read_is_not_written_over() -> None:
    """The arrays of the readings may be those of the solved poses."""
    position, tensions = np.array([[1.0, 2.0, 3.0]]), np.array([[4.0]])
    readings = Readings(position, np.array([LEVEL]), tensions)
    for effect in (
        TrackerFrame(np.ones(3), ABOUT_Z), TrackerTarget(np.ones(3), ABOUT_X),
        TrackerScale(2.0), TensionScale(2.0),
    ):  # fmt: skip
        effect.edit_readings(readings, SETUP)
    assert position.tolist() == [[1.0, 2.0, 3.0]] and tensions.tolist() == [[4.0]]


def test_plausible_shifts_are_a_two_hundredth_of_a_cable() -> None:
    """Cables are 2.5 m long."""
    for effect in (TrackerFrame, TrackerTarget):
        scale = layout_of(effect, RECTANGLE).scale
        assert scale == pytest.approx([0.0125] * 3 + [0.005] * 3)
