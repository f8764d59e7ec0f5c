"""The ordered collection of effects with values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import seecr
from seecr.effects import Apart, Own, apart

ROBOT = seecr.load_robot("demobot_cogiro")
NAMES = ("drum_gain", "pulley_radius", "tracker_target")  # 8, 1 and 6 parameters


def term(name: str, part: float = 0.5) -> seecr.Term:
    layout = seecr.layout_of(seecr.effect_named(name), ROBOT)
    return seecr.Term(layout, layout.null + part * layout.scale)


def some(*names: str) -> seecr.Terms:
    return seecr.Terms(term(name) for name in names or NAMES)


@pytest.mark.parametrize("seed", range(5))
def test_the_order_is_the_catalogues_whatever_it_is_made_from(seed: int) -> None:
    every = list(seecr.catalogue())
    mixed = np.random.default_rng(seed).permutation(every).tolist()
    assert some(*mixed).names == tuple(every)
    assert seecr.Terms(some(*mixed)).names == tuple(every)


def test_effects_of_ones_own_that_are_not_in_the_catalogue_come_last() -> None:
    own = seecr.Term(seecr.layout_of(Unlisted, ROBOT), np.zeros(0))
    assert seecr.Terms([own, term("tension_scale")]).names == ("tension_scale", "unlisted")
    assert seecr.Terms([own])  # of no parameter, and still a term


class Unlisted(seecr.Effect):
    name = "unlisted"


def test_an_effect_is_there_once() -> None:
    with pytest.raises(seecr.InputError, match="pulley_radius is among the terms twice"):
        some("pulley_radius", "drum_gain", "pulley_radius")


def test_parameters_count_through_all_terms() -> None:
    terms = some()
    assert len(terms) == 15 and [t.name for t in terms] == list(NAMES)
    assert [terms.part(name) for name in NAMES] == [slice(0, 8), slice(8, 9), slice(9, 15)]
    for one in terms:
        part = terms.part(one.name)
        for name in ("null", "scale", "lower", "upper"):
            assert np.array_equal(getattr(terms, name)[part], getattr(one.layout, name))
        assert np.array_equal(terms.vector[part], one.vector)
        assert np.flatnonzero(terms.own(one.name)).tolist() == list(range(15))[part]
        assert {effect for effect, _key in terms.labels[part]} == {one.name}
    assert terms.labels[3] == ("drum_gain", "gain_4")
    assert not terms.own("creep").any() and "creep" not in terms and "drum_gain" in terms


def test_sizes_count_from_null_in_plausible_sizes() -> None:
    assert some().sizes == pytest.approx(np.full(15, 0.5))
    assert term("stiffness", -0.25).sizes == pytest.approx([-0.25])  # whose null is 1


def test_other_values_are_another_collection() -> None:
    terms = some()
    values = np.arange(15.0)
    other = terms.with_vector(values)
    assert np.array_equal(other.vector, values) and other.names == terms.names
    assert np.array_equal(other["tracker_target"].vector, values[9:])
    values[:] = 0.0
    assert other.vector[3] == 3.0 and terms.sizes == pytest.approx(np.full(15, 0.5))
    with pytest.raises(seecr.InputError, match=r"values must be \(15,\), got \(14,\)"):
        terms.with_vector(np.zeros(14))
    with pytest.raises(ValueError, match="read-only"):
        terms.vector[0] = 1.0


def test_terms_come_and_go_by_name() -> None:
    terms = some()
    assert terms.without("pulley_radius").names == ("drum_gain", "tracker_target")
    assert terms.without("creep").names == terms.names
    assert terms.only(["tracker_target", "drum_gain"]).names == ("drum_gain", "tracker_target")
    wider = terms.with_term(term("pulley_radius", 2.0))
    assert wider.names == NAMES and wider["pulley_radius"].sizes == pytest.approx([2.0])
    assert terms.with_term(term("stiffness")).names == (*NAMES[:2], "stiffness", NAMES[2])
    with pytest.raises(KeyError, match=r"creep is not among drum_gain, pulley_radius, tracker"):
        terms.part("creep")


def test_a_term_without_a_layout_is_refused() -> None:
    with pytest.raises(
        seecr.InputError, match="expected an effect's layout and its values, got 'creep'"
    ):
        seecr.Term("creep", np.zeros(2))  # type: ignore[arg-type]


def test_values_that_no_robot_has_are_refused() -> None:
    with pytest.raises(seecr.InputError, match=r"platform_mass: added_kg: -10 is out of bounds"):
        seecr.Term.of(ROBOT, "platform_mass", added_kg=-10.0)
    with pytest.raises(
        seecr.InputError, match=r"added_kg: expected one number, got an array of sh"
    ):
        seecr.Term.of(ROBOT, "platform_mass", added_kg=np.array([0.1, 0.2]))
    mass = seecr.Term.of(ROBOT, "platform_mass", added_kg=0.01)
    with pytest.raises(seecr.InputError, match=r"added_kg: 1e\+09 is out of bounds"):
        mass.measured(added_kg=(1e9, 1.0))


def test_what_is_fixed_is_all_of_an_effect_or_what_is_named() -> None:
    gains = seecr.Term.of(ROBOT, "drum_gain", gain_3=0.002)
    assert gains.fixed().knowledge.fixed.all() and not gains.knowledge.fixed.any()
    some = gains.fixed("gain_2").fixed("gain_5")
    assert np.flatnonzero(some.knowledge.fixed).tolist() == [1, 4]
    assert some.with_vector(np.zeros(8)).knowledge is some.knowledge
    assert some.vector[2] == 0.002


def test_what_is_measured_begins_at_what_was_found() -> None:
    gains = seecr.Term.of(ROBOT, "drum_gain", gain_3=0.002)
    known = gains.measured(gain_2=(0.001, 1e-4)).measured(gain_4=(-0.001, 2e-4))
    assert known.vector.tolist() == [0.0, 0.001, 0.002, -0.001, *[0.0] * 4]
    assert np.flatnonzero(known.knowledge.measured).tolist() == [1, 3]
    assert known.knowledge.stderr[[1, 3]].tolist() == [1e-4, 2e-4]
    assert gains.vector[1] == 0.0 and not gains.knowledge.measured.any()


@pytest.mark.parametrize("error", [0.0, -1.0, np.inf, np.nan])
def test_a_measurement_has_an_error(error: float) -> None:
    with pytest.raises(
        seecr.InputError, match="drum_gain: gain_2: expected a standard error above 0"
    ):
        seecr.Term.of(ROBOT, "drum_gain").measured(gain_2=(0.001, error))


def test_the_only_parameter_that_there_is_is_the_nearest() -> None:
    with pytest.raises(seecr.InputError, match=r"no parameter radius; the nearest is radius_m$"):
        seecr.Term.of(ROBOT, "pulley_radius", radius=0.01)


def test_a_parameter_that_there_is_not_is_answered_with_the_nearest() -> None:
    words = "^effect tracker_frame: no parameter shift_w_m; the nearest are shift_[xyz]_m, "
    frame = seecr.Term.of(ROBOT, "tracker_frame")
    for ask in (
        lambda: seecr.Term.of(ROBOT, "tracker_frame", shift_w_m=0.0),
        lambda: frame.fixed("shift_w_m"),
        lambda: frame.measured(shift_w_m=(0.0, 1.0)),
    ):
        with pytest.raises(seecr.InputError, match=words):
            ask()


def test_a_robot_cannot_have_less_than_a_twentieth_of_its_mass() -> None:
    added = np.array([-0.949, -0.951]) * ROBOT.mass
    possible = [
        seecr.Term.of(ROBOT, "platform_mass", added_kg=one).is_possible(ROBOT) for one in added
    ]
    assert possible == [True, False]


# --- Effects with values of their own for each file or run, laid out one after the other


BASE = seecr.layout_of("cable_length_offset", "demobot_cogiro")
DAYS = apart(BASE, "file", ("monday", "tuesday"), BASE.null + 0.001)


def test_parameters_of_a_part_stand_together_under_its_name() -> None:
    assert len(DAYS) == 16 and DAYS.part("tuesday") == slice(8, 16)
    assert DAYS.names[8] == f"tuesday: {BASE.names[0]}"
    assert [group.tolist() for group in DAYS.cable_by_cable] == [list(range(8)), list(range(8, 16))]
    assert list(DAYS.groups) == ["monday: offset_m", "tuesday: offset_m"]


def test_each_part_is_the_effect_with_its_values_and_others_are_the_rest() -> None:
    found = DAYS.build(np.arange(16.0))
    assert isinstance(found, Apart)
    assert found.at("tuesday").offset == pytest.approx(np.arange(8.0, 16.0))  # type: ignore[attr-defined]
    assert found.at("friday").offset == pytest.approx(np.full(8, 0.001))  # type: ignore[attr-defined]
    robot = seecr.load_robot("demobot_cogiro")
    totals = found.totals(robot)
    assert totals["monday: offset_2_m"].value == pytest.approx(robot.rest_lengths[1] + 1.0)


def test_values_are_per_file_or_per_run() -> None:
    with pytest.raises(seecr.InputError, match="are per 'file' or 'run', got 'day'"):
        Own("day", {})


# --- Effects by name


def test_a_layout_is_found_by_name_and_by_class() -> None:
    by_name = seecr.layout_of("backlash", "demobot_cogiro")
    assert by_name.effect is seecr.effect_named("backlash")
    assert by_name.names == seecr.layout_of(by_name.effect, "demobot_cogiro").names


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("backlsh", "no effect 'backlsh'; known, nearest first: backlash, "),
        (
            "lab/robot.xml",
            "expected the name of an effect, such as pulley_radius, got 'lab/robot.xml', which "
            "looks like a file's name$",
        ),
        (["backlash"], "expected the name of an effect, got \\['backlash'\\]"),
        (float, "expected the name of an effect, or its class, got <class 'float'>"),
    ],
)
def test_what_is_no_effect_is_refused(given: Any, said: str) -> None:
    with pytest.raises(seecr.InputError, match=said):
        seecr.layout_of(given, "demobot_cogiro")
