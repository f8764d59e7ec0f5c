"""What the cables carry: how effects add up, and what no platform can be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr import Commands, Effect, Readings, Setup, layout_of
from seecr.effects.base import Total
from seecr.effects.geometry import FrameCompliance
from seecr.effects.load import CentreOfMass, PlatformMass
from seecr.effects.sensing import TensionScale, TrackerFrame, TrackerScale, TrackerTarget
from seecr.effects.setup import plain_setup
from seecr.pose import Array


def setup_of(rows: int = 2) -> Setup:
    return plain_setup(RECTANGLE, Commands(np.tile(RECTANGLE.reference_pose, (rows, 1))))


@pytest.mark.parametrize(("added", "mass"), [
    (0.5, 2.5), (-0.5, 1.5), (-1.998, 0.002), (-1.9999, 0.002), (-50.0, 0.002),
])  # fmt: skip
def test_a_platform_keeps_a_thousandth_of_its_two_kilograms(added: float, mass: float) -> None:
    setup = setup_of()
    PlatformMass(added).edit_setup(setup)
    assert setup.mass == pytest.approx(mass, rel=1e-12)
    PlatformMass(0.25).edit_setup(setup)
    assert setup.mass == pytest.approx(mass + 0.25, rel=1e-12)


def test_a_scale_shows_the_whole_mass_of_which_a_twentieth_is_the_least() -> None:
    total = PlatformMass(0.5).totals(RECTANGLE)["mass"]
    assert (total.value, total.nominal, total.unit) == (2.5, 2.0, "kg")
    assert PlatformMass(-1.89).totals(RECTANGLE)["mass"].possible
    assert not PlatformMass(-1.91).totals(RECTANGLE)["mass"].possible


@pytest.mark.parametrize(("axis", "least", "most"), [
    ("x", -1.3, 1.3),
    ("y", -1.4, 1.4),
    ("z", -1.0, 1.0),
])  # fmt: skip
def test_a_centre_is_at_most_two_lengths_outside_of_the_anchor_points(
    axis: str, least: float, most: float
) -> None:
    """They are at +-0.3 m and +-0.4 m, and the robot's length is 0.5 m."""
    direction = np.eye(3)["xyz".index(axis)]
    for value, possible in {
        least + 0.01: True, most - 0.01: True, least - 0.01: False, most + 0.01: False,
    }.items():  # fmt: skip
        totals = CentreOfMass(value * direction).totals(RECTANGLE)
        assert {key: total.possible for key, total in totals.items()} == {
            **dict.fromkeys("xyz", True), axis: possible,
        }  # fmt: skip


def test_a_search_never_takes_the_whole_platform_away() -> None:
    assert layout_of(PlatformMass, RECTANGLE).lower == pytest.approx([-1.98])


# --- What a person who measures would find


def test_a_number_is_possible_between_its_limits_and_not_at_them() -> None:
    def possible(value: float) -> bool:
        return Total(value, 1.0, "kg", lower=0.5, upper=2.0).possible

    assert [possible(value) for value in (0.5, 0.51, 1.99, 2.0)] == [False, True, True, False]


def test_without_limits_every_number_is_possible_but_none_that_is_not() -> None:
    assert Total(-1e30, 1.0, "kg").possible and not Total(float("nan"), 1.0, "kg").possible


# --- A frame that yields: sideways and upwards are two compliances, kept as one and a differenc


def test_a_compliance_of_old_files_is_that_of_both_directions() -> None:
    layout = layout_of(FrameCompliance, RECTANGLE)
    assert FrameCompliance.renamed["compliance_m_per_N"] == layout.names


# --- What sensors report, by quarter turns: nothing has to be computed


ABOUT_X, ABOUT_Z = np.array([np.pi / 2, 0.0, 0.0]), np.array([0.0, 0.0, np.pi / 2])
LEVEL = [1.0, 0, 0, 0]
NOTHING = np.zeros(3)
# not needed by what sensors report
SETUP: Any = None


def read(effect: Effect, position: list[float], quat: list[float]) -> tuple[Array, Array]:
    """What is reported of a platform at a position with an orientation."""
    readings = Readings(np.array([position]), np.array([quat]), np.array([[3.0, 5.0]]))
    effect.edit_readings(readings, SETUP)
    return readings.position[0], readings.quat_wxyz[0]


def test_a_turned_frame_sees_the_target_where_it_was_carried_to() -> None:
    """Target first: (1, 0, 0) ahead of (1, 0, 0) is (2, 0, 0), which is seen at (0, 2, 0)."""
    readings = Readings(np.array([[1.0, 0, 0]]), np.array([LEVEL]), np.zeros((1, 2)))
    for effect in (TrackerTarget(np.array([1.0, 0, 0]), NOTHING), TrackerFrame(NOTHING, ABOUT_Z)):
        effect.edit_readings(readings, SETUP)
    assert readings.position[0] == pytest.approx([0.0, 2.0, 0.0])


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
