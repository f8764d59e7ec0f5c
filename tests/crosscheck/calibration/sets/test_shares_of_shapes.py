"""What looking for a shape costs, of an effect whose shapes may be 1, 2 or 4 s."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from rectangle import RECTANGLE

from crosscheck.calibration.joint_fit.linearised import Linear
from crosscheck.calibration.sets.shapes import log_shares
from seecr.effects import Effect, Term, Terms, layout_of
from seecr.effects.base import parameter
from seecr.effects.setup import Setup
from seecr.pose import Array

ROOT = np.sqrt(2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class Fading(Effect):
    """An error that fades; only its time constant is a shape, which has a plausible size of 3 s."""

    name: ClassVar[str] = "fading"
    size: float = parameter("m", 0.1)
    time: float = parameter("s", 3.0, null=1.0, shape=True)

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        return [{"time": 4.0}, {"time": 1.0}, {"time": 2.0}, {"time": 1.0}]


@dataclass(frozen=True, eq=False)
class OneShape(Fading):
    """One whose time constant is the same wherever a search starts."""

    name: ClassVar[str] = "one_shape"

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        return [{"time": 2.0}]


@dataclass(frozen=True, eq=False)
class Shapeless(Effect):
    """One without a shape."""

    name: ClassVar[str] = "shapeless"
    size: float = parameter("m", 0.1)


def shares(x: Array, width: Array, *effects: Effect) -> dict[str, float]:
    """Of a fit with these columns (N, p) and prior widths (p,)."""
    layouts = [layout_of(type(effect), RECTANGLE) for effect in effects]
    vectors = [list(vars(effect).values()) for effect in effects]
    terms = Terms(Term(a, np.array(b)) for a, b in zip(layouts, vectors, strict=True))
    state = SimpleNamespace(prediction=SimpleNamespace(setup=None))
    joint: Any = SimpleNamespace(terms=terms, state=state)
    return log_shares(joint, Linear(x, np.zeros(len(x)), width))


@pytest.mark.parametrize(("time", "apart"), [
    (0.5, 1.0),  # before the first gap, which is its own
    (1.5, 1.0),  # the middle of the first gap
    (2.25, 1.5),  # half way to the middle of the second
    (3.0, 2.0),
    (9.0, 2.0),
])  # fmt: skip
def test_a_share_is_the_standard_error_over_the_gap_and_the_number_of_shapes(
    time: float, apart: float
) -> None:
    """Of the time, z has the standard error 1/sqrt(40^2 + 1/0.1^2), and the time three times it."""
    x = np.diag([7.0, 40.0])
    error = 3.0 / np.sqrt(40.0**2 + 0.1**-2)
    found = shares(x, np.array([10.0, 0.1]), Fading(0.2, time))
    assert found == {"fading": pytest.approx(np.log(ROOT * error / (3.0 * apart)))}


def test_what_goes_together_with_the_size_is_less_certain() -> None:
    """The standard error is that of the whole covariance: its columns are not at right angles."""
    x = np.array([[30.0, 24.0], [0.0, 18.0]])
    a, b, d = 30.0**2 + 0.25, 30.0 * 24.0, 24.0**2 + 18.0**2 + 0.25
    error = 3.0 * np.sqrt(a / (a * d - b**2))
    found = shares(x, np.array([2.0, 2.0]), Fading(0.2, 1.5))
    assert found["fading"] == pytest.approx(np.log(ROOT * error / 3.0))


def test_a_shape_that_the_data_do_not_show_costs_nothing() -> None:
    found = shares(np.diag([7.0, 0.01]), np.array([10.0, 10.0]), Fading(0.2, 1.5))
    assert found == {"fading": 0.0}


def test_a_shape_that_stays_costs_nothing() -> None:
    found = shares(np.diag([7.0, 0.0]), np.array([10.0, 0.0]), Fading(0.2, 1.5))
    assert found == {"fading": 0.0}


def test_a_single_shape_is_not_chosen() -> None:
    found = shares(np.diag([7.0, 40.0]), np.array([10.0, 10.0]), OneShape(0.2, 2.0))
    assert found == {"one_shape": 0.0}


def test_without_shapes_there_are_no_shares() -> None:
    assert shares(np.diag([7.0]), np.array([10.0]), Shapeless(0.2)) == {}


def test_beside_others_a_share_has_the_error_of_its_own_shape() -> None:
    """Also where a parameter of the effect before it stays, and is left out of the covariance."""
    x = np.diag([7.0, 0.0, 60.0, 40.0])
    width = np.array([10.0, 0.0, np.inf, np.inf])
    found = shares(x, width, OneShape(0.1, 2.0), Fading(0.2, 1.5))
    share = np.log(ROOT * 3.0 / 40.0 / 3.0)
    assert found == {"one_shape": 0.0, "fading": pytest.approx(share)}
