"""Quantities that effects edit: declared once, and used."""

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
from seecr.effects.edits import Edits
from seecr.effects.setup import QUANTITIES, History, plain_setup
from seecr.statics.tables import assemble


@pytest.fixture(scope="module")
def robot() -> seecr.Robot:
    return seecr.load_robot("demobot_cogiro")


@pytest.fixture(scope="module")
def commands(robot: seecr.Robot) -> seecr.Commands:
    poses = np.tile(robot.reference_pose, (5, 1))
    poses[:, 0] += [0.0, 0.05, 0.1, 0.02, -0.05]
    return turning(robot, seecr.Commands(poses))


def test_every_number_of_a_setup_is_declared() -> None:
    others = {item.name for item in fields(seecr.Setup)} - set(QUANTITIES)
    assert others == {"robot", "commands", "laws"}
    assert all(item.what for item in QUANTITIES.values())


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_plain_setup_has_the_plain_value_in_the_shape_declared(
    name: str, robot: seecr.Robot, commands: seecr.Commands
) -> None:
    item, value = QUANTITIES[name], np.asarray(getattr(plain_setup(robot, commands), name))
    assert value.shape == item.shape_of(robot, 5)
    plain = getattr(robot, item.plain) if isinstance(item.plain, str) else item.plain
    assert np.array_equal(value, np.broadcast_to(plain, value.shape))


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_quantity_reaches_the_statics(
    name: str, robot: seecr.Robot, commands: seecr.Commands
) -> None:
    """In the tables; in the rest lengths alone where it says so."""
    plain, edited = plain_setup(robot, commands), plain_setup(robot, commands)
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
    name: str, robot: seecr.Robot, commands: seecr.Commands
) -> None:
    setup = plain_setup(robot, commands)
    assert not setup.has_history
    setattr(setup, name, np.asarray(getattr(setup, name), float) + 1e-3)
    assert setup.has_history == (QUANTITIES[name].history is History.GIVES)
    assert seecr.Experiment(robot, commands).setup([]).has_history is False


@pytest.mark.parametrize("place, width", [("column", N_COLUMNS), ("entry", N_LOAD)])
def test_no_two_quantities_are_written_to_one_place(
    place: str, width: int, robot: seecr.Robot
) -> None:
    taken = np.zeros(width, dtype=int)
    for item in QUANTITIES.values():
        first = getattr(item, place)
        if first is not None:
            shape = item.shape_of(robot, 5)
            long = shape[-1] if item.shape[-1] not in ("cables", "rows") else 1
            taken[first : first + long] += 1
    assert taken.max() == 1


def test_a_wrench_is_one_for_all_rows_or_one_for_each(
    robot: seecr.Robot, commands: seecr.Commands
) -> None:
    wrench = np.arange(6.0)
    assert np.array_equal(plain_setup(robot, commands, wrench).wrench, np.tile(wrench, (5, 1)))
    with pytest.raises(seecr.InputError, match=r"wrench must be \(6,\) or \(5, 6\), got \(3,\)"):
        plain_setup(robot, commands, np.zeros(3))


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
