"""Rounds that find lengths to command where cables have a history, and where sequences end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.inverse import lengths
from seecr.inverse.lengths import REACHED, damped, lengths_with_history, to_their_limit
from seecr.tensions.rest_lengths import Held

ROBOT = load_robot(model_path("demobot_cogiro"))
POSES = np.tile(ROBOT.reference_pose, (3, 1))


def played(
    monkeypatch: pytest.MonkeyPatch, errors: list[list[float]], has_history: bool = True
) -> tuple[list[int], Any]:
    """The rounds that were played and what was found, with these errors [m] of three poses."""
    rounds: list[int] = []

    def predict(_self: object, _effects: object) -> Any:
        pose = POSES.copy()
        pose[:, 2] += errors[min(len(rounds), len(errors) - 1)]
        rounds.append(len(rounds))
        setup = SimpleNamespace(laws=["of a user"])
        return SimpleNamespace(
            pose=pose, has_history=has_history, setup=setup, tables=None, number=rounds[-1]
        )

    def hold_again(_tables: object, held: Held, *_limits: object, follows: bool) -> Held:
        return replace(held, rest=held.rest + 1e-6)

    monkeypatch.setattr(
        lengths, "Experiment", lambda *_given: SimpleNamespace(predict=lambda e: predict(None, e))
    )
    monkeypatch.setattr(lengths, "commanded_lengths", lambda *given: given[-1])
    monkeypatch.setattr(lengths, "hold_again", hold_again)
    held = Held(np.ones((3, 8)), np.ones((3, 8)), np.array([True, True, False]))
    aim = np.ones((3, 8))
    found = lengths_with_history(ROBOT, Commands(POSES), (), held, (aim, aim, aim))
    return rounds, found


def test_the_round_that_misses_fewest_poses_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that were 0.1 mm off in one round were 1 mm off in the last."""
    far, near, one = [1e-3, 1e-3, 0.0], [2e-5, 3e-5, 1.0], [1e-3, 1e-8, np.nan]
    rounds, (told, prediction) = played(monkeypatch, [far, near, far, one, near, far])
    assert len(rounds) == lengths._ROUNDS
    assert prediction.number == 3
    assert told[0, 0] == pytest.approx(1.0 + 3e-6, abs=1e-6)


def test_of_as_many_missed_poses_the_nearest_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    rounds, found = played(monkeypatch, [[1e-3, 1e-3, 0.0], [2e-5, np.nan, 0.0], [3e-5, 2e-5, 0.0]])
    assert found[1].number == 2 and len(rounds) == lengths._ROUNDS


@pytest.mark.parametrize(("has_history", "ends"), [(True, True), (False, False)])
def test_late_rounds_end_at_a_larger_error_where_there_is_a_history(
    monkeypatch: pytest.MonkeyPatch, has_history: bool, ends: bool
) -> None:
    """With 1e-10 one row that goes to and fro by nanometres kept 2,000 busy for 40 rounds."""
    small = [0.5e-7 * ROBOT.length, 0.0, 1.0]
    rounds, _found = played(monkeypatch, [small], has_history)
    assert len(rounds) == (lengths._LATE + 1 if ends else lengths._ROUNDS)


@pytest.mark.parametrize("length", [0.05, 1.0, 50.0])
@pytest.mark.parametrize("late", [False, True])
def test_rounds_never_end_before_poses_count_as_reached(length: float, late: bool) -> None:
    robot: Any = SimpleNamespace(length=length)
    assert lengths._enough(late, robot) * length < REACHED


def test_changes_in_a_constant_ratio_end_at_their_limit() -> None:
    before = np.array([[2.0, -2.0, 2.0, 2.0, 0.0]])
    ratio = np.array([[0.95, -1.0, 0.0, 0.5, 0.0]])
    expected = before * np.array([[0.95 / 0.05, -0.5, 0.0, 1.0, 0.0]])
    assert to_their_limit(ratio * before, before) == pytest.approx(expected)


def test_what_grows_has_no_limit_and_what_swings_further_is_damped() -> None:
    before = np.array([1.0, 1.0, 1.0])
    assert to_their_limit(np.array([1.5, 0.995, -9.0]), before) == pytest.approx([1.5, 0.995, -3.0])
    # the first change of all has none before it
    assert to_their_limit(before, np.zeros(3)) == pytest.approx(before)


def test_changes_get_smaller_where_the_last_did_not() -> None:
    part, before = np.array([1.0, 0.6, 0.4, 0.15]), np.ones(4)
    size = np.array([0.99, 0.5, 0.9, 2.0])
    assert damped(part, size, before) == pytest.approx([0.5, 0.66, 0.44, 0.1])
    assert damped(part, np.full(4, 0.1), before).max() == 1.0


def test_changes_are_whole_where_all_of_the_last_would_have_been_right() -> None:
    """A tenth made of each leaves nine tenths, round after round, and no error falls until the
    cable slips.
    """
    part = np.array([0.5, 0.1, 0.1])
    assert damped(part, np.array([0.5, 0.9, 1.0]), np.ones(3)).tolist() == [1.0, 1.0, 0.1]
    assert damped(part, np.ones(3), np.full(3, np.inf)) == pytest.approx(1.1 * part)


def test_damped_changes_end_a_cycle() -> None:
    """x -> 2 - x goes to and fro for ever."""
    x, part, before = np.array([0.0]), np.ones(1), np.array([np.inf])
    for _ in range(20):
        error = np.abs(x - 1.0)
        part = damped(part, error, before)
        x, before = x + part * (2.0 - 2.0 * x), error
    assert x == pytest.approx(1.0, abs=1e-6)
