"""What callers give to planning: limits, boxes, kinds of readings, commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import crosscheck
from crosscheck.measurements.data import Sigma
from crosscheck.planning.design import box_given, limits_given
from crosscheck.planning.planned import kinds_of
from seecr.errors import InputError

ROBOT = "planar_vertical"
NONE = np.zeros((0, 7))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: box_given([[1, 2], [3, 4]]), r"box must be \(2, 3\) \[m\], .* got \(2, 2\)"),
        (lambda: box_given([[0, 2, 0], [1, 1, 1]]), "lowest position first, got y from 2 to 1 m"),
        (lambda: limits_given(5), "limits must be two numbers, .* got 5"),
        (lambda: limits_given((5, 1)), "0 <= lowest <= highest .* got 5 and 1"),
        (lambda: limits_given((np.nan, 1)), "0 <= lowest <= highest .* got nan and 1"),
        (lambda: limits_given((np.inf, np.inf)), "lowest finite, got inf and inf"),
        (lambda: crosscheck.choose_poses(ROBOT, 6, box=[[1, 2], [3, 4]]), "box must be"),
        (lambda: crosscheck.choose_poses(ROBOT, 6, limits=5), "limits must be"),
        (lambda: crosscheck.make_plan(ROBOT, NONE), "there are no commands; expected one or more"),
        (lambda: crosscheck.make_plan(ROBOT, NONE, limits=5), "limits must be"),
        (lambda: crosscheck.make_plan(ROBOT, NONE, box=[1, 2]), "box must be"),
        (lambda: crosscheck.make_twin(ROBOT, 1, poses=NONE), "there are no commands"),
        (lambda: crosscheck.run_suite("planar-*", jobs=0), "jobs: .* from 1 on, got 0"),
    ],
)
def test_what_cannot_be_planned_with_is_told_in_one_line(
    call: Callable[[], Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as told:
        call()
    assert "\n" not in str(told.value)


def test_boxes_and_limits_are_taken_as_they_are() -> None:
    box = [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]
    found = box_given(box)
    assert found is not None and found.tolist() == box and box_given(None) is None
    assert limits_given((0.0, np.inf)) == (0.0, np.inf)


def test_one_kind_of_reading_stands_for_itself() -> None:
    assert kinds_of("position", Sigma()) == kinds_of(["position"], Sigma()) == ("position",)
    with pytest.raises(crosscheck.CrosscheckError, match=r"^reads: expected some of .* 'colour'"):
        crosscheck.make_plan(ROBOT, np.array([0.5, 0, 0.5, 1, 0, 0, 0]), reads="colour")
