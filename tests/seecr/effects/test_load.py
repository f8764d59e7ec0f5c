"""What the cables carry: how effects add up, and what no platform can be."""

from __future__ import annotations

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr.commands import Commands
from seecr.effects import layout_of
from seecr.effects.load import CentreOfMass, ExternalWrench, GravityTilt, PlatformMass
from seecr.effects.setup import Setup, plain_setup


def setup_of(rows: int = 2) -> Setup:
    return plain_setup(RECTANGLE, Commands(np.tile(RECTANGLE.reference_pose, (rows, 1))))


@pytest.mark.parametrize(("added", "mass"), [
    (0.5, 2.5), (-0.5, 1.5), (-1.998, 0.002), (-1.9999, 0.002), (-50.0, 0.002),
])  # fmt: skip
def test_a_platform_keeps_a_thousandth_of_its_two_kilograms(added: float, mass: float) -> None:
    setup = setup_of()
    PlatformMass(added).edit_setup(setup)
    assert setup.mass == pytest.approx(mass, rel=1e-12)


def test_masses_add_up() -> None:
    setup = setup_of()
    for added in (0.5, 0.25):
        PlatformMass(added).edit_setup(setup)
    assert setup.mass == 2.75


def test_a_scale_shows_the_whole_mass_of_which_a_twentieth_is_the_least() -> None:
    total = PlatformMass(0.5).totals(RECTANGLE)["mass"]
    assert (total.value, total.nominal, total.unit) == (2.5, 2.0, "kg")
    assert PlatformMass(-1.89).totals(RECTANGLE)["mass"].possible
    assert not PlatformMass(-1.91).totals(RECTANGLE)["mass"].possible


def test_the_centre_of_mass_is_told_in_the_platforms_frame() -> None:
    effect = CentreOfMass(np.array([0.01, -0.02, 0.03]))
    setup = setup_of()
    setup.centre_of_mass = np.array([0.1, 0.1, 0.1])
    effect.edit_setup(setup)
    assert setup.centre_of_mass == pytest.approx([0.11, 0.08, 0.13], rel=1e-15)
    assert [total.value for total in effect.totals(RECTANGLE).values()] == [0.01, -0.02, 0.03]
    assert [total.unit for total in effect.totals(RECTANGLE).values()] == ["m"] * 3


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


def test_a_constant_wrench_is_added_to_that_of_every_row() -> None:
    setup = setup_of(2)
    setup.wrench = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 2.0]])
    effect = ExternalWrench(force=np.array([0.5, 1.0, -1.0]), moment=np.array([0.0, 0.25, 1.0]))
    effect.edit_setup(setup)
    assert setup.wrench.tolist() == [[1.5, 1, -1, 0, 0.25, 1], [0.5, 1, -1, 0, 0.25, 3]]


@pytest.mark.parametrize(("tilt_x", "tilt_y", "down"), [
    (np.pi / 6, 0.0, [0.0, 5.0, -5.0 * np.sqrt(3.0)]),
    (0.0, np.pi / 6, [-5.0, 0.0, -5.0 * np.sqrt(3.0)]),
    # about the diagonal of x and y by 60 deg
    (np.pi / 3 / np.sqrt(2), np.pi / 3 / np.sqrt(2), [-2.5 * np.sqrt(6), 2.5 * np.sqrt(6), -5.0]),
])  # fmt: skip
def test_gravity_is_turned_about_the_axis_that_both_tilts_make(
    tilt_x: float, tilt_y: float, down: list[float]
) -> None:
    setup = setup_of()
    GravityTilt(tilt_x, tilt_y).edit_setup(setup)
    assert setup.gravity == pytest.approx(down, abs=1e-14)


def test_plausible_sizes_are_tenths_of_the_platform_and_hundredths_of_its_weight() -> None:
    """2 kg, 20 N and 0.5 m."""
    sizes = {
        effect: layout_of(effect, RECTANGLE).scale.tolist()
        for effect in (PlatformMass, CentreOfMass, ExternalWrench)
    }
    assert sizes[PlatformMass] == pytest.approx([0.2])
    assert sizes[CentreOfMass] == pytest.approx([0.05] * 3)
    assert sizes[ExternalWrench] == pytest.approx([0.6] * 3 + [0.3] * 3)


def test_a_search_never_takes_the_whole_platform_away() -> None:
    assert layout_of(PlatformMass, RECTANGLE).lower == pytest.approx([-1.98])
