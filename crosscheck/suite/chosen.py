"""Cases as callers give them: cases, names of shipped ones, robots."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

from crosscheck.given import GivenRobot
from crosscheck.suite.cases import Case, select, shipped_cases, user_cases
from crosscheck.suite.effects import GROUP, PREFIX, EffectCase, shipped_effect_cases
from seecr.description.mjcf import model_names
from seecr.errors import InputError

__all__ = ["GivenCase", "chosen_cases", "every_shipped", "select", "shipped_like"]

GivenCase: TypeAlias = Case | EffectCase | GivenRobot
"""A case, the name of shipped ones or a pattern such as "cogiro-*", a robot or its MJCF."""


def chosen_cases(
    given: GivenCase | Iterable[GivenCase] | None, seed: int
) -> list[Case | EffectCase]:
    """The chosen cases. A robot stands for a sweep and random poses; None for all shipped cases.

    Raises:
        CrosscheckError: a name or pattern that no shipped case has; the message names the nearest.
        InputError: no case, one without poses, or something else.
    """
    shipped = every_shipped(seed)
    if given is None:
        return shipped
    every = [given] if isinstance(given, GivenCase) else given
    if not isinstance(every, Iterable):
        raise _no_case(given)
    found: list[Case | EffectCase] = []
    for one in every:
        found += [case for case in _cases_of(one, shipped, seed) if case not in found]
    if not found:
        raise InputError("expected at least one case to run, got none; without any all are run")
    empty = [case.name for case in found if len(case) == 0]
    if empty:
        raise InputError(f"case {empty[0]} has no poses; expected at least one")
    return found


def every_shipped(seed: int) -> list[Case | EffectCase]:
    """All shipped cases, and after them the effects."""
    return [*shipped_cases(seed), *shipped_effect_cases(seed)]


def shipped_like(
    every: Sequence[Case | EffectCase], patterns: Sequence[str], option: str = ""
) -> list[Case | EffectCase]:
    """Those that match any of the patterns; the group's name stands for all its effects."""
    return select(every, [f"{PREFIX}*" if name == GROUP else name for name in patterns], option)


def _cases_of(
    given: GivenCase, shipped: Sequence[Case | EffectCase], seed: int
) -> Sequence[Case | EffectCase]:
    if isinstance(given, Case | EffectCase):
        return [given]
    if isinstance(given, str) and not _is_robot(given):
        return shipped_like(shipped, [given])
    if isinstance(given, GivenRobot):
        return user_cases(given, seed=seed)
    raise _no_case(given)


def _no_case(got: object) -> InputError:
    return InputError(
        "expected cases, names of shipped ones, robots or their MJCF, got " + type(got).__name__
    )


def _is_robot(name: str) -> bool:
    """Whether a word is a robot's file or the name of a shipped one, and not of a case."""
    path = Path(name)
    return name in model_names() or path.suffix.lower() == ".xml" or path.is_file()
