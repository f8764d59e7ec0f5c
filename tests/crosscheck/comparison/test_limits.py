"""Limits: which field is on what, and that each one can be exceeded alone."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from made_data import measured, soft_cogiro

from crosscheck.comparison.limits import RULES, Limits, Rule, exceeded, option
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import KINDS


@pytest.fixture(scope="module")
def found() -> Comparison:
    robot = soft_cogiro()
    return compare(robot, measured(robot))


def test_each_field_of_the_limits_has_its_rule() -> None:
    assert tuple(RULES) == tuple(field.name for field in fields(Limits))
    assert list(RULES.values()) == [Rule(k, worst) for worst in (False, True) for k in KINDS]
    assert option("max_position_worst") == "--max-position-worst"


@pytest.mark.parametrize("name", ["max_position", "max_orientation_worst"])
def test_a_limit_just_below_is_exceeded_and_one_just_above_holds(
    found: Comparison, name: str
) -> None:
    rule = RULES[name]
    sizes = found.errors_of(rule.kind.name)
    value = float(np.nanmax(sizes)) if rule.worst else found.rms[rule.kind.key]
    assert value is not None and exceeded(Limits(**{name: 1.001 * value}), found) == []
    (item,) = exceeded(Limits(**{name: 0.999 * value}), found)
    assert (item.name, item.value) == (name, value)
    assert item.words.startswith(rule.words)
    worst = int(np.nanargmax(sizes))
    assert f"worst at line {found.problem.data.line[worst]}, " in item.words


def test_a_limit_on_what_was_not_read_is_refused(found: Comparison) -> None:
    with pytest.raises(CrosscheckError, match=r"--max-tension-worst: .* has no tension readings"):
        exceeded(Limits(max_tension_worst=1.0), found)
