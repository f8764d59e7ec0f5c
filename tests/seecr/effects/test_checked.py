"""What effects of other people leave is checked, and ours are trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from effect_cases import experiment_of

from seecr.effects import Effect
from seecr.effects.base import Readings
from seecr.effects.edits import edit_readings, edit_setup, is_built_in
from seecr.effects.load import PlatformMass
from seecr.effects.setup import Setup, plain_setup
from seecr.errors import InputError


def nothing(_: Any) -> None: ...


@dataclass(frozen=True, eq=False)
class Theirs(Effect):
    """An effect of somebody's own, that does as it is told."""

    name: ClassVar[str] = "theirs"
    place: ClassVar[str] = "load"

    setup: Callable[[Setup], None] = field(default=nothing)
    read: Callable[[Readings], None] = field(default=nothing)

    def edit_setup(self, setup: Setup) -> None:
        self.setup(setup)

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        self.read(readings)


def plain() -> Setup:
    experiment = experiment_of("demobot_cogiro")
    return plain_setup(experiment.robot, experiment.commands)


def readings(lost: int) -> Readings:
    """Of three rows; one had no equilibrium."""
    position = np.zeros((3, 3))
    position[lost] = np.nan
    return Readings(position, np.tile([1.0, 0, 0, 0], (3, 1)), np.ones((3, 8)))


def test_ours_are_known_by_their_folder() -> None:
    assert is_built_in(PlatformMass) and not is_built_in(Theirs)


def test_laws_that_were_there_before_are_not_theirs() -> None:
    setup = plain()
    setup.laws.append(lambda strain: strain[:, :2])  # of another shape
    edit_setup(Theirs(lambda s: s.laws.append(lambda strain: 2.0 * strain)), setup)
    first, second = (law(np.ones((3, 8))) for law in setup.laws)
    assert first.shape == (3, 2) and np.all(second == 2.0)


def test_rows_without_rest_may_stay_without_readings_and_others_may_not() -> None:
    def spoil(row: int) -> Theirs:
        return Theirs(read=lambda r: r.tensions.__setitem__(row, np.nan))

    setup = plain()
    edit_readings(spoil(1), readings(lost=1), setup)
    with pytest.raises(InputError, match=r"^effect theirs leaves readings\.tensions that is not"):
        edit_readings(spoil(0), readings(lost=1), setup)


def test_a_long_text_in_place_of_numbers_is_cut() -> None:
    def spoil(setup: Setup) -> None:
        setup.ea = "much " * 99  # type: ignore[assignment]

    with pytest.raises(InputError, match=r"leaves setup\.ea that is no number: 'much") as error:
        edit_setup(Theirs(spoil), plain())
    assert len(str(error.value)) < 150
