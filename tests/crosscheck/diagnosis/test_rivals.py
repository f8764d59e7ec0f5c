"""Effects that could stand in for a listed one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_data import COGIRO, measured, term

from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.verdict import diagnose
from seecr.description.mjcf import load_robot

pytestmark = pytest.mark.slow


def test_equals_of_a_second_effect_are_looked_for_beside_the_first() -> None:
    """Beside the plain model its equal may not even be solved: that says nothing of it here."""
    robot = load_robot(COGIRO)
    hidden = [
        term(robot, "pulley_radius", radius_m=0.01),
        term(robot, "platform_mass", added_kg=0.1),
    ]
    few = (*(one.name for one in hidden), "stiffness", "centre_of_mass", "cable_length_offset")
    told: list[str] = []
    data = measured(robot, hidden, points=8, seed=1)
    search = diagnose(robot, data, only=few, progress=lambda text, _part: told.append(text)).search
    assert search is not None
    assert len(search.found) == 2 and search.found[0] == "pulley_radius"
    second = search.found[1]
    equal = {"stiffness": "platform_mass", "platform_mass": "stiffness"}[second]
    # which takes a while, so that it is said
    for name in search.found:
        assert f"looking for effects that could replace {name}" in told
    first, *others = search.steps
    unsolved = tuple(replace(c, fit=None) if c.name == equal else c for c in first.candidates)
    spoiled = replace(search, steps=(replace(first, candidates=unsolved), *others))
    assert equal in [rival.name for rival in rivals_of(spoiled, second)]
