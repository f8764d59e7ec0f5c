"""Quantities that effects edit: declared once, and used."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from seecr.commands import Commands, turning
from seecr.compiled.columns import N_COLUMNS, N_LOAD
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects.setup import QUANTITIES, History, Setup, plain_setup
from seecr.errors import InputError
from seecr.prediction.experiment import Experiment
from seecr.statics.tables import assemble


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(model_path("demobot_cogiro"))


@pytest.fixture(scope="module")
def commands(robot: Robot) -> Commands:
    poses = np.tile(robot.reference_pose, (5, 1))
    poses[:, 0] += [0.0, 0.05, 0.1, 0.02, -0.05]
    return turning(robot, Commands(poses))


def test_every_number_of_a_setup_is_declared() -> None:
    others = {item.name for item in fields(Setup)} - set(QUANTITIES)
    assert others == {"robot", "commands", "laws"}
    assert all(item.what for item in QUANTITIES.values())


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_plain_setup_has_the_plain_value_in_the_shape_declared(
    name: str, robot: Robot, commands: Commands
) -> None:
    item, value = QUANTITIES[name], np.asarray(getattr(plain_setup(robot, commands), name))
    assert value.shape == item.shape_of(robot, 5)
    plain = getattr(robot, item.plain) if isinstance(item.plain, str) else item.plain
    assert np.array_equal(value, np.broadcast_to(plain, value.shape))


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_quantity_reaches_the_statics(name: str, robot: Robot, commands: Commands) -> None:
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
    name: str, robot: Robot, commands: Commands
) -> None:
    setup = plain_setup(robot, commands)
    assert not setup.has_history
    setattr(setup, name, np.asarray(getattr(setup, name), float) + 1e-3)
    assert setup.has_history == (QUANTITIES[name].history is History.GIVES)
    assert Experiment(robot, commands).setup([]).has_history is False


@pytest.mark.parametrize("place, width", [("column", N_COLUMNS), ("entry", N_LOAD)])
def test_no_two_quantities_are_written_to_one_place(place: str, width: int, robot: Robot) -> None:
    taken = np.zeros(width, dtype=int)
    for item in QUANTITIES.values():
        first = getattr(item, place)
        if first is not None:
            shape = item.shape_of(robot, 5)
            long = shape[-1] if item.shape[-1] not in ("cables", "rows") else 1
            taken[first : first + long] += 1
    assert taken.max() == 1


def test_a_wrench_is_one_for_all_rows_or_one_for_each(robot: Robot, commands: Commands) -> None:
    wrench = np.arange(6.0)
    assert np.array_equal(plain_setup(robot, commands, wrench).wrench, np.tile(wrench, (5, 1)))
    with pytest.raises(InputError, match=r"wrench must be \(6,\) or \(5, 6\), got \(3,\)"):
        plain_setup(robot, commands, np.zeros(3))
