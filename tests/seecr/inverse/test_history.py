"""Rounds that find lengths to command where cables have a history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.holding.lengths import Held
from seecr.inverse import history
from seecr.inverse.history import REACHED, lengths_with_history

ROBOT = load_robot(model_path("demobot_cogiro"))
POSES = np.tile(ROBOT.reference_pose, (3, 1))


def played(
    monkeypatch: pytest.MonkeyPatch,
    errors: list[list[float]],
    has_history: bool = True,
    seen: list[np.ndarray] | None = None,
    change: Callable[[int], Any] = lambda _round: 1e-6,
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
        return replace(held, rest=held.rest + change(rounds[-1]))

    monkeypatch.setattr(
        history, "Experiment", lambda *_given: SimpleNamespace(predict=lambda e: predict(None, e))
    )
    told = [] if seen is None else seen
    monkeypatch.setattr(
        history,
        "told_lengths",
        lambda _robot, _commands, _effects, rest: (told.append(rest), rest)[1],
    )
    monkeypatch.setattr(history, "hold_again", hold_again)
    held = Held(np.ones((3, 8)), np.ones((3, 8)), np.array([True, True, False]))
    aim = np.ones((3, 8))
    found = lengths_with_history(ROBOT, Commands(POSES), (), held, (aim, aim, aim))
    return rounds, found


def test_the_round_that_misses_fewest_poses_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that were 0.1 mm off in one round were 1 mm off in the last."""
    far, near, one = [1e-3, 1e-3, 0.0], [2e-5, 3e-5, 1.0], [1e-3, 1e-8, np.nan]
    rounds, (told, prediction) = played(monkeypatch, [far, near, far, one, near, far])
    assert len(rounds) == history._ROUNDS
    assert prediction.number == 3
    assert told[0, 0] == pytest.approx(1.0 + 3e-6, abs=1e-6)


def test_of_as_many_missed_poses_the_nearest_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    rounds, found = played(monkeypatch, [[1e-3, 1e-3, 0.0], [2e-5, np.nan, 0.0], [3e-5, 2e-5, 0.0]])
    assert found[1].number == 2 and len(rounds) == history._ROUNDS


def test_late_rounds_change_less_the_rows_whose_changes_do_not_get_smaller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those of row 1 do: they are whole. Row 0: half, a quarter, ... a tenth."""
    told: list[np.ndarray] = []
    shrinks = [np.array([1.0, 0.66**k, 1.0])[:, None] * 1e-6 for k in range(history._ROUNDS)]
    played(monkeypatch, [[1e-3, 1e-3, 0.0]], seen=told, change=lambda k: shrinks[k])
    change = np.diff([rest[:2, 0] for rest in told], axis=0)
    made = change / np.array([one[:2, 0] for one in shrinks])[: len(change)]
    first = history._LATE + history._TURNS
    damped = made[first : first + history._TURNS]
    # the first of a turn knows of none before
    assert damped[:, 0] == pytest.approx([1.0, 0.5, 0.25, 0.125] + [0.1] * 10, rel=1e-4)
    assert damped[:, 1] == pytest.approx(1.0, rel=1e-2)
    assert np.all(made[history._LATE + 1 : first] > 0.9), "and not where tensions are as given"


def test_late_rounds_leave_what_is_before_the_first_missed_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And where they change less, all that is far after it, which depends on what comes of it."""
    told: list[np.ndarray] = []
    played(monkeypatch, [[0.1 * REACHED, 1e-3, 0.0]], seen=told)
    late = [rest[:, 0] for rest in told[history._LATE :]]
    assert np.ptp([rest[0] for rest in late]) == 0.0 < np.ptp([rest[1] for rest in late])
    monkeypatch.setattr(history, "_AHEAD", 1)
    told.clear()
    played(monkeypatch, [[1e-3, 1e-3, 0.0]], seen=told)
    first = history._LATE + history._TURNS
    turn = np.array([rest[:, 0] for rest in told[first : first + history._TURNS]])
    assert np.ptp(turn[:, 1]) == 0.0 < np.ptp(turn[:, 0])


def test_rounds_go_on_as_long_as_the_first_missed_pose_comes_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, two = [1e-3, 1e-3, 0.0], [0.1 * REACHED, 1e-3, 0.0]
    rounds, _found = played(monkeypatch, [*[one] * 70, two])
    assert len(rounds) == 70 + history._PATIENCE
    monkeypatch.setattr(history, "_MOST", 90)
    assert len(played(monkeypatch, [*[one] * 70, two])[0]) == 90
    assert len(played(monkeypatch, [one])[0]) == history._ROUNDS


@pytest.mark.parametrize(("has_history", "ends"), [(True, True), (False, False)])
def test_late_rounds_end_at_a_larger_error_where_there_is_a_history(
    monkeypatch: pytest.MonkeyPatch, has_history: bool, ends: bool
) -> None:
    """With 1e-10 one row that goes to and fro by nanometres kept 2,000 busy for 40 rounds."""
    small = [0.5e-7 * ROBOT.length, 0.0, 1.0]
    rounds, _found = played(monkeypatch, [small], has_history)
    assert len(rounds) == (history._LATE + 1 if ends else history._ROUNDS)


@pytest.mark.parametrize("length", [0.05, 1.0, 50.0])
@pytest.mark.parametrize("late", [False, True])
def test_rounds_never_end_before_poses_count_as_reached(length: float, late: bool) -> None:
    robot: Any = SimpleNamespace(length=length)
    assert history._enough(late, robot) * length < REACHED
