"""Parameters shifted up and down."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import robot_of

from seecr.effects import Term, Terms
from seecr.prediction.sensitivity import blocks_of_cables, positions, shifted

ROBOT = robot_of("demobot_cogiro")
TERMS = Terms(
    [
        Term.of(ROBOT, "drum_gain", gain_2=0.003),
        Term.of(ROBOT, "pulley_radius"),
        Term.of(ROBOT, "hysteresis", amplitude_N=1.0),
    ]
)


def test_a_parameter_moves_by_as_much_up_as_down_and_no_other_moves() -> None:
    gain = TERMS["drum_gain"]
    shift = shifted(TERMS, gain, 1)
    assert shift.plus["drum_gain"].vector[1] > 0.003 > shift.minus["drum_gain"].vector[1]
    assert shift.apart == pytest.approx(2e-4 * gain.layout.scale[1], rel=1e-9)
    same = np.arange(8) != 1
    assert np.array_equal(shift.plus["drum_gain"].vector[same], gain.vector[same])
    assert np.array_equal(shift.minus["pulley_radius"].vector, TERMS["pulley_radius"].vector)
    assert shift.physical and not shift.sensing


def test_at_a_bound_it_moves_inwards_alone() -> None:
    radius = TERMS["pulley_radius"]
    shift = shifted(TERMS, radius, 0)
    assert shift.minus["pulley_radius"].vector[0] == 0.0 == radius.layout.lower[0]
    assert shift.plus["pulley_radius"].vector[0] == pytest.approx(1e-5 * radius.layout.scale[0])


def test_a_shape_moves_by_a_part_of_itself() -> None:
    term = TERMS["hysteresis"]
    k = int(np.flatnonzero(term.layout.shape)[0])
    assert shifted(TERMS, term, k).apart == pytest.approx(2e-5 * term.vector[k])


def test_several_of_one_effect_move_together() -> None:
    shift = shifted(TERMS, TERMS["drum_gain"], np.array([0, 1]))
    assert shift.apart.shape == (2,)
    moved = shift.plus["drum_gain"].vector != TERMS["drum_gain"].vector
    assert np.flatnonzero(moved).tolist() == [0, 1]


def test_what_each_cable_has_of_its_own_goes_together_if_all_of_it_is_wanted() -> None:
    wanted = positions(TERMS, list(range(len(TERMS))))
    assert [term.name for term, _k in wanted[:9]] == ["drum_gain"] * 8 + ["pulley_radius"]
    ((term, group),) = blocks_of_cables(TERMS, wanted)
    assert term is TERMS["drum_gain"] and group.tolist() == list(range(8))
    assert blocks_of_cables(TERMS, wanted[1:]) == []
