"""Quantities as people type them."""

from __future__ import annotations

import math

import pytest

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import EXAMPLE, SI, parse_quantity


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("position", "0.5mm", 0.0005),
        ("position", " 3 µm ", 3e-6),
        ("orientation", "180°", math.pi),
        ("orientation", "1e1 mrad", 0.01),
        ("tension", "2kN", 2000.0),
        ("length", "0.1 cm", 0.001),
    ],
)
def test_quantities_with_their_unit(kind: str, text: str, value: float) -> None:
    assert parse_quantity("--x", kind, text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("kind", list(SI))
def test_the_example_of_each_kind_is_one(kind: str) -> None:
    assert parse_quantity("--x", kind, EXAMPLE[kind]) > 0


def test_a_unit_of_another_kind_is_refused() -> None:
    with pytest.raises(CrosscheckError) as error:
        parse_quantity("--x", "tension", "1mm")
    expected = "--x: expected a number with its unit (N, mN, kN) such as 1N, got unit 'mm' in '1mm'"
    assert str(error.value) == expected
