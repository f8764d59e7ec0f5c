"""How far another effect moves fitted values: the bias of an omitted variable, by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from linear_toy import toy

from crosscheck.fit.effects import systematic
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.systematic import moved_by_others, moved_together
from seecr.pose import Array

# Unit vectors: of the fitted effect, of one that shares a part of it, and of one that shares none.
FITTED, OTHER, APART = np.eye(8)[0], np.array([0.6, 0.8, 0, 0, 0, 0, 0, 0]), np.eye(8)[2]


def moved(white: Array, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Array:
    """Moves, in plausible sizes, of a fit to eight readings that leaves ``white``."""
    made = toy({}, ("pulley_radius", "stiffness", "platform_mass"))
    found = made.fit(made.problem, made.terms("pulley_radius"))
    found.state.prediction.setup = None
    columns = {"stiffness": 100.0 * OTHER[:, None], "platform_mass": 100.0 * APART[:, None]}

    def amplitude_columns(_problem: object, _fit: Fit, layout: Any, _start: Array) -> Array:
        return columns[layout.name] / layout.scale

    monkeypatch.setattr(systematic, "candidates_for", made.candidates)
    monkeypatch.setattr(systematic, "amplitude_columns", amplitude_columns)
    state = replace(found.state, white=white)
    fit: Any = SimpleNamespace(
        state=state, terms=found.terms, jacobian=100.0 * FITTED[:, None],
        at_bound=changes.get("at_bound", np.zeros(1, dtype=bool)),
    )  # fmt: skip
    return moved_by_others(made.problem, fit) / found.terms.scale


def test_what_is_left_along_another_effect_moves_the_value_by_what_they_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """0.8 left across the fitted one is one whole OTHER, of which 0.6 are along it."""
    assert moved(np.eye(8)[1] * 0.8, monkeypatch) == pytest.approx([0.006], rel=1e-3)


def test_an_effect_that_shares_nothing_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert moved(5.0 * APART, monkeypatch) == pytest.approx([0.0], abs=1e-12)


def test_one_that_explains_less_than_half_of_what_the_best_does_is_no_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left = 0.8 * np.eye(8)[1]
    assert moved(left + 1.0 * APART, monkeypatch) == pytest.approx([0.006], rel=1e-3)
    assert moved(left + 1.2 * APART, monkeypatch) == pytest.approx([0.0], abs=1e-12)


def test_values_on_a_bound_do_not_move(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = np.ones(1, dtype=bool)
    assert moved(0.8 * np.eye(8)[1], monkeypatch, at_bound=stopped) == 0.0


def test_what_moves_two_values_alike_leaves_their_difference_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A tracker seems lower on both days beside a platform that is too heavy, and by as much."""
    moves = {"a": (5.0, np.array([3.0, 3.0, 0.0])), "b": (4.0, np.array([-1.0, -1.0, 2.0]))}
    monkeypatch.setattr(systematic, "moves_by_effect", lambda _problem, _found: moves)
    found: Any = SimpleNamespace(terms=range(3))
    covariance = moved_together(SimpleNamespace(), found)  # type: ignore[arg-type]
    assert np.sqrt(np.diag(covariance)) == pytest.approx([3.0, 3.0, 2.0])
    assert np.array([1.0, -1.0, 0.0]) @ covariance == pytest.approx(np.zeros(3))
    assert covariance[0, 2] == pytest.approx(-3.0 * 2.0 / np.sqrt(10.0))
    assert np.linalg.eigvalsh(covariance).min() > -1e-12
