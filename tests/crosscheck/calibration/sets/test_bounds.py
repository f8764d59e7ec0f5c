"""What parameters cost that cannot be negative and are nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from crosscheck.calibration.joint_fit.linearised import Linear
from crosscheck.calibration.sets.bounds import log_absent
from crosscheck.calibration.sets.equals import parameters_counted
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import Term, Terms, effect_named, layout_of

LAYOUT = layout_of(effect_named("exit_friction"), load_robot(model_path("demobot_cogiro")))
SETTING: Any = SimpleNamespace(chain=None)


def fitted(friction: float, length: float, x: Any, y: Any) -> tuple[Any, Linear]:
    """A joint fit of friction and the cable behind it, and the linear model about it."""
    terms = Terms([Term(LAYOUT, LAYOUT.scale * [friction, length])])
    width = np.ones(2)
    joint: Any = SimpleNamespace(
        terms=terms, width=width, jacobian=x, whitened=lambda _chain, values: values
    )
    free = terms.vector > terms.lower
    return joint, Linear(x * free, y, width * free)


@pytest.mark.parametrize("seen", [0.01, 1.0])
def test_of_friction_beside_its_cable(seen: float) -> None:
    """Against the integral over half a Gaussian of the one and all of the other."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((40, 2)) * [seen, 0.5]
    y = x @ [-0.1, 2.0] + rng.standard_normal(40)
    width = 3.0
    joint, linear = fitted(0.0, 2.0, x, y)

    def value(length: float, friction: float, both: float) -> float:
        left = y - x @ [both * friction, length]
        size = (length**2 + friction**2) / width**2
        return float(np.exp(-0.5 * (left @ left - y @ y) - 0.5 * size))

    def mean(both: float) -> float:
        return float(integrate.dblquad(value, 0.0, 30.0, -30.0, 30.0, (both,), epsabs=0.0)[0])

    expected = np.log(mean(1.0) / mean(0.0))
    assert log_absent(SETTING, joint, linear, {"exit_friction": width}) == pytest.approx(
        expected, abs=1e-6
    )
    assert bool(expected < -1.0) is (seen == 1.0)


def test_what_a_fit_did_not_find_beyond_the_bound_is_no_evidence() -> None:
    """Cables without weight could earn 243, as if a weight were fitted that explains as much."""
    x = 10.0 * np.eye(3)[:, :2]
    joint, linear = fitted(0.0, 2.0, x, 20.0 * np.ones(3))  # friction of 2 is what is there
    assert log_absent(SETTING, joint, linear, {"exit_friction": 1.0}) < 0.0


def test_of_what_is_there_nothing_is_taken() -> None:
    x = np.eye(3)[:, :2]
    joint, linear = fitted(0.5, 2.0, x, np.ones(3))
    assert log_absent(SETTING, joint, linear, {"exit_friction": 1.0}) == 0.0


def test_an_effect_that_is_nothing_altogether_may_have_any_width() -> None:
    x = 10.0 * np.eye(3)[:, :2]
    joint, linear = fitted(0.0, 0.0, x, np.zeros(3))
    assert -6.0 < log_absent(SETTING, joint, linear, {}) < -0.5


@pytest.mark.parametrize(("name", "count"), [
    ("exit_friction", 1), ("winch_side_length", 1), ("frame_compliance", 2), ("drum_gain", 8),
])  # fmt: skip
def test_what_comes_with_another_is_no_excuse(name: str, count: int) -> None:
    """Of friction's two numbers one is the cable's; a gain a drum is eight all the same."""
    layout = layout_of(effect_named(name), load_robot(model_path("demobot_cogiro")))
    assert parameters_counted(layout) == count
