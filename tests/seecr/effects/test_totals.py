"""What a person who measures would find."""

from __future__ import annotations

from seecr.effects.base import Total


def test_a_number_is_possible_between_its_limits_and_not_at_them() -> None:
    def possible(value: float) -> bool:
        return Total(value, 1.0, "kg", lower=0.5, upper=2.0).possible

    assert [possible(value) for value in (0.5, 0.51, 1.99, 2.0)] == [False, True, True, False]


def test_without_limits_every_number_is_possible_but_none_that_is_not() -> None:
    assert Total(-1e30, 1.0, "kg").possible and not Total(float("nan"), 1.0, "kg").possible
