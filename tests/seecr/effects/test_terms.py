"""The ordered collection of effects with values."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import pytest
from effect_cases import experiment_of, random_effect

import seecr
from seecr.commands import turning
from seecr.compiled.columns import N_COLUMNS, N_LOAD
from seecr.effects import Apart, Own, apart
from seecr.effects.edits import Edits
from seecr.effects.setup import QUANTITIES, History, plain_setup
from seecr.statics.tables import assemble

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


# --- Quantities that effects edit: declared once, and used


@pytest.fixture(scope="module")
def commands() -> seecr.Commands:
    poses = np.tile(ROBOT.reference_pose, (5, 1))
    poses[:, 0] += [0.0, 0.05, 0.1, 0.02, -0.05]
    return turning(ROBOT, seecr.Commands(poses))


def test_every_number_of_a_setup_is_declared() -> None:
    others = {item.name for item in fields(seecr.Setup)} - set(QUANTITIES)
    assert others == {"robot", "commands", "laws"}
    assert all(item.what for item in QUANTITIES.values())


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_plain_setup_has_the_plain_value_in_the_shape_declared(
    name: str, commands: seecr.Commands
) -> None:
    item, value = QUANTITIES[name], np.asarray(getattr(plain_setup(ROBOT, commands), name))
    assert value.shape == item.shape_of(ROBOT, 5)
    plain = getattr(ROBOT, item.plain) if isinstance(item.plain, str) else item.plain
    assert np.array_equal(value, np.broadcast_to(plain, value.shape))


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_quantity_reaches_the_statics(name: str, commands: seecr.Commands) -> None:
    """In the tables; in the rest lengths alone where it says so."""
    plain, edited = plain_setup(ROBOT, commands), plain_setup(ROBOT, commands)
    value = np.asarray(getattr(edited, name), float)
    setattr(edited, name, value + 1e-3 * (1.0 + np.arange(value.size).reshape(value.shape)))
    before, after = assemble(plain), assemble(edited)
    cables = np.any(before.cables != after.cables, axis=(0, 1))
    load = np.any(before.load != after.load, axis=0)
    assert cables.any() or load.any()
    same = np.array_equal(plain.rest_lengths(), edited.rest_lengths())
    if QUANTITIES[name].paid_out:
        assert not same and not load.any()
    if QUANTITIES[name].column is not None:
        assert cables[QUANTITIES[name].column]


@pytest.mark.parametrize("name", QUANTITIES)
def test_rows_depend_on_the_rows_before_where_a_quantity_says_so(
    name: str, commands: seecr.Commands
) -> None:
    setup = plain_setup(ROBOT, commands)
    assert not setup.has_history
    setattr(setup, name, np.asarray(getattr(setup, name), float) + 1e-3)
    assert setup.has_history == (QUANTITIES[name].history is History.GIVES)
    assert seecr.Experiment(ROBOT, commands).setup([]).has_history is False


@pytest.mark.parametrize("place, width", [("column", N_COLUMNS), ("entry", N_LOAD)])
def test_no_two_quantities_are_written_to_one_place(place: str, width: int) -> None:
    taken = np.zeros(width, dtype=int)
    for item in QUANTITIES.values():
        first = getattr(item, place)
        if first is not None:
            shape = item.shape_of(ROBOT, 5)
            long = shape[-1] if item.shape[-1] not in ("cables", "rows") else 1
            taken[first : first + long] += 1
    assert taken.max() == 1


def test_a_wrench_is_one_for_all_rows_or_one_for_each(commands: seecr.Commands) -> None:
    wrench = np.arange(6.0)
    assert np.array_equal(plain_setup(ROBOT, commands, wrench).wrench, np.tile(wrench, (5, 1)))
    with pytest.raises(seecr.InputError, match=r"wrench must be \(6,\) or \(5, 6\), got \(3,\)"):
        plain_setup(ROBOT, commands, np.zeros(3))


# --- Setups as effects leave them: what is shared between them nobody writes into


def plain() -> seecr.Setup:
    experiment = experiment_of("demobot_cogiro")
    return plain_setup(experiment.robot, experiment.commands)


def numbers(setup: seecr.Setup) -> dict[str, Any]:
    return {name: np.array(getattr(setup, name)) for name in QUANTITIES}


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in QUANTITIES)


@dataclass(frozen=True, eq=False)
class InPlace(seecr.Effect):
    """An effect of somebody's own, that writes into the arrays it finds."""

    def edit_setup(self, setup: seecr.Setup) -> None:
        setup.extra_length += 1e-3
        setup.laws.append(lambda strain: 0.0 * strain)


@pytest.mark.parametrize("name", seecr.catalogue())
def test_an_effect_leaves_the_setup_that_it_was_made_from(name: str) -> None:
    setup, effect = plain(), random_effect(experiment_of("demobot_cogiro"), name)
    before, edits = numbers(setup), Edits(setup)
    first, after = edits.by([effect]), numbers(edits.by([effect]))
    edits.by([effect, effect])
    assert same(numbers(setup), before)
    assert same(numbers(first), after)


def test_an_effect_that_writes_in_place_writes_into_arrays_of_its_own() -> None:
    setup = plain()
    before = numbers(setup)
    once, twice = Edits(setup).by([InPlace()]), Edits(setup).by([InPlace(), InPlace()])
    assert same(numbers(setup), before) and setup.laws == []
    assert np.allclose(once.extra_length, setup.extra_length + 1e-3)
    assert np.allclose(twice.extra_length, setup.extra_length + 2e-3)
    assert (len(once.laws), len(twice.laws)) == (1, 2)


def test_what_was_kept_of_other_effects_changes_no_edit() -> None:
    edits, base = Edits(plain()), plain().mass
    a, b, c, x, y = (seecr.effect_named("platform_mass")(2.0**-k) for k in range(5))
    for effects in (
        [a, b], [a, c], [a], [a, c, b], [], [a, b, c], [a, x, c], [a, b, y], [a, b, c], [a, x, c, b]
    ):  # fmt: skip
        assert edits.by(effects).mass == pytest.approx(base + sum(one.added for one in effects))


@pytest.mark.slow
def test_threads_may_ask_for_edits_at_once() -> None:
    """Derivatives along a way ask for each parameter's setup in threads of their own."""
    base, heavier = plain(), seecr.effect_named("platform_mass")
    edits, wrong = Edits(base), []
    pairs = [(heavier(0.1 * k), heavier(0.001 * k)) for k in range(8)]

    def ask(first: int) -> None:
        for k in range(4_000):
            one, other = pairs[(first + k) % 8][0], pairs[k % 8][1]
            found = edits.by([one, other]).mass - base.mass
            if abs(found - one.added - other.added) > 1e-9:
                wrong.append(found)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, range(4)))
    sys.setswitchinterval(before)
    assert not wrong
