"""What can be given to ``run_suite``; nothing that was not run is said to agree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case
from crosscheck.suite.run import chosen_cases
from crosscheck.suite.verdicts import Outcome

PLANAR = seecr.model_path("planar_vertical")


def names(given: Any) -> list[str]:
    return [case.name for case in chosen_cases(given, 0)]


@pytest.mark.slow
def test_cases_are_chosen_by_name_by_pattern_and_by_robot() -> None:
    assert names("planar-vertical") == names(["planar-vertical"]) == ["planar-vertical"]
    every = names("planar-vertical*")
    assert names(["planar-vertical", "planar-vert*"]) == every and len(every) > 1
    assert names(["effects"]) and all(name.startswith("effect-") for name in names("effects"))
    own = ["planar_vertical-sweep", "planar_vertical-random"]
    robot = seecr.load_robot(PLANAR)
    for given in (PLANAR, str(PLANAR), "planar_vertical", robot, [robot]):
        assert names(given) == own
    assert len(names(None)) > len(names("*-*")) - 1 > 50


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ([], seecr.InputError, r"^expected at least one case to run, got none"),
        (3, seecr.InputError, r"^expected cases, .* got int$"),
        ([None], seecr.InputError, r"^expected cases, .* got NoneType$"),
        ("planar-vertica", crosscheck.CrosscheckError, r"^planar-vertica: .* planar-vertical,"),
        ("gone.xml", seecr.RobotError, r"gone\.xml"),
        (
            [Case("none", PLANAR, PLANAR, None, "random", np.zeros((0, 7)))],
            seecr.InputError,
            r"^case none has no poses",
        ),
    ],
    ids=str,
)
def test_what_cannot_be_run_is_refused(given: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        crosscheck.run_suite(given)


def test_a_robot_that_is_not_its_file_is_refused() -> None:
    robot = seecr.load_robot(PLANAR)
    with pytest.raises(
        seecr.InputError, match=r"has different numbers from .*planar_vertical\.xml"
    ):
        crosscheck.run_suite(replace(robot, gravity=0.5 * robot.gravity))
    with pytest.raises(seecr.InputError, match="was not read from a file"):
        crosscheck.run_suite(replace(robot, source=None))


def test_nothing_does_not_agree() -> None:
    nothing = crosscheck.Run([], load_thresholds(), 0, 1, 0.0)
    assert nothing.outcome is Outcome.NOT_CONVERGED and str(nothing) == "Nothing was run."
