"""Setups as effects leave them: what is shared between them nobody writes into."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from effect_cases import experiment_of, random_effect

from seecr.effects import Effect, catalogue
from seecr.effects.edits import Edits
from seecr.effects.setup import _FEW_POSES, QUANTITIES, Setup, _kept_lengths, plain_setup


def plain() -> Setup:
    experiment = experiment_of("demobot_cogiro")
    return plain_setup(experiment.robot, experiment.commands)


def numbers(setup: Setup) -> dict[str, Any]:
    return {name: np.array(getattr(setup, name)) for name in QUANTITIES}


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in QUANTITIES)


@dataclass(frozen=True, eq=False)
class InPlace(Effect):
    """An effect of somebody's own, that writes into the arrays it finds."""

    def edit_setup(self, setup: Setup) -> None:
        setup.extra_length += 1e-3
        setup.laws.append(lambda strain: 0.0 * strain)


@dataclass(frozen=True, eq=False)
class Counted(Effect):
    """One that is counted."""

    calls: list[str]
    name_: str

    def edit_setup(self, setup: Setup) -> None:
        self.calls.append(self.name_)
        setup.mass = setup.mass + 1.0


@pytest.mark.parametrize("name", catalogue())
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


def test_effects_before_the_one_that_differs_edit_once() -> None:
    calls: list[str] = []
    a, b, c = (Counted(calls, name) for name in "abc")
    setup = plain()
    edits = Edits(setup)
    assert edits.by([a, b]).mass == setup.mass + 2.0
    assert edits.by([a, c]).mass == setup.mass + 2.0
    assert edits.by([a]).mass == setup.mass + 1.0
    assert edits.by([a, c, b]).mass == setup.mass + 3.0
    assert edits.by([]).mass == setup.mass
    assert calls == ["a", "b", "c", "c", "b"]


def test_effects_before_and_beside_one_that_is_shifted_stay_as_they_were() -> None:
    calls: list[str] = []
    a, b, c, x, y = (Counted(calls, name) for name in "abcxy")
    edits = Edits(plain())
    for effects in ([a, b, c], [a, x, c], [a, b, y], [a, b, c], [a, x, c, b]):
        expected = plain().mass + len(effects)
        assert edits.by(effects).mass == expected
    assert calls == ["a", "b", "c", "x", "c", "y", "x", "c", "b"]


@dataclass(frozen=True, eq=False)
class Adding(Effect):
    """One that makes the platform heavier."""

    added: float

    def edit_setup(self, setup: Setup) -> None:
        setup.mass = setup.mass + self.added


@pytest.mark.slow
def test_threads_may_ask_at_once() -> None:
    """Derivatives along a way ask for each parameter's setup in threads of their own."""
    base = plain()
    edits = Edits(base)
    pairs = [(Adding(float(k)), Adding(0.01 * k)) for k in range(8)]
    wrong: list[float] = []

    def ask(first: int) -> None:
        for k in range(4_000):
            one, other = pairs[(first + k) % 8], pairs[k % 8]
            found = edits.by([one[0], other[1]]).mass - base.mass
            if abs(found - one[0].added - other[1].added) > 1e-9:
                wrong.append(found)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(ask, range(4)))
    finally:
        sys.setswitchinterval(before)
    assert not wrong


def test_straight_lengths_are_kept_of_few_poses_only() -> None:
    """Those of a map of a million would fill gigabytes."""
    setup = plain()
    poses = np.tile(setup.robot.reference_pose, (_FEW_POSES + 1, 1))
    poses[:, 0] += np.linspace(0.0, 0.01, len(poses))
    few = setup.geometric_lengths(poses[:-1])
    assert setup.geometric_lengths(poses[:-1].copy()) is few
    kept = _kept_lengths.cache_info()
    many = setup.geometric_lengths(poses)
    assert np.array_equal(many[:-1], few) and _kept_lengths.cache_info() == kept
