"""What callers give to planning, the words of a plan, and which files of an older one go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crosscheck
from crosscheck.fit.reasons import Reason, Why
from crosscheck.measurements.data import Sigma
from crosscheck.planning.planned import Adding, kinds_of
from crosscheck.planning.proposer import Gain, Suggestion
from crosscheck.planning.result import Sight, Visible, alike, signal_words
from crosscheck.planning.room import box_given, limits_given
from crosscheck.planning.visibility import Signal
from crosscheck.planning.write import planned_files, slack_remark
from seecr.effects import layout_of
from seecr.errors import InputError

DRUMS = layout_of("drum_eccentricity", "demobot_cogiro")
SIGNAL = Signal(DRUMS, {}, np.ones((4, len(DRUMS))) * ~DRUMS.shape)
CLEAR = Visible(SIGNAL, 15.0, 0.5, 0.75, "", (), ())


def test_an_effect_that_shows_is_named_unless_something_looks_the_same() -> None:
    assert CLEAR.visible and CLEAR.named and alike(CLEAR) == ""
    for other in (replace(CLEAR, twins=("a",)), replace(CLEAR, confused=(("a", 1.0),))):
        assert other.visible and not other.named
    assert replace(CLEAR, factor=1.0).visible and not replace(CLEAR, factor=1.01).visible


def test_exact_twins_come_first_and_what_is_not_seen_is_said() -> None:
    confused = tuple((name, 1.0) for name in "bcdef")
    both = replace(CLEAR, twins=("a",), confused=confused)
    assert alike(both) == "a (exactly), b, c, d and 2 more"
    assert alike(replace(CLEAR, factor=2.0)) == "(not visible at an expected size)"
    assert alike(replace(both, factor=2.0)).startswith("a (exactly)")


def test_sizes_are_multiples_of_plausible_ones_without_what_gives_the_shape() -> None:
    sizes = CLEAR.sizes(0.5)
    assert list(sizes) == np.array(DRUMS.names)[~DRUMS.shape].tolist()
    assert list(sizes.values()) == [0.5 * one for one in DRUMS.scale[~DRUMS.shape]]
    seen = SIGNAL.columns.copy()
    seen[:, 1:] = 0.0
    assert list(replace(CLEAR, signal=replace(SIGNAL, columns=seen)).sizes(1.0)) == [DRUMS.names[0]]
    unseen = replace(SIGNAL, columns=0.0 * seen)
    assert replace(CLEAR, signal=unseen).sizes(0.5) == sizes


def test_without_a_way_to_tell_it_from_a_twin_no_size_is_promised() -> None:
    found = replace(CLEAR, twins=("a",), confused=(("b", 2.0),)).as_json()
    assert found["smallest_identifiable"] is None and found["best_imitator"] is None
    assert [one["effect"] for one in found["cannot_be_told_from"]] == ["a", "b"]
    assert [one["exact"] for one in found["cannot_be_told_from"]] == [True, False]
    assert CLEAR.as_json()["smallest_identifiable"] == CLEAR.sizes(0.75)


def test_what_is_needed_is_not_told_where_the_signal_is_as_large_now() -> None:
    """An equivalent by evidence "separates: 36 now, 15 needed" contradicted itself."""
    assert signal_words(Gain("a", "b", 0.1234, 2049.0, 15.0)) == "0.12 now, 2000 then, 15 needed"
    assert signal_words(Gain("a", "b", 36.0, 90.0, 15.0)) == "36 now, 90 then"


def test_what_cannot_be_told_apart_is_so_at_plausible_sizes() -> None:
    """Of two effects that it then told apart a diagnosis began with "could not distinguish"."""
    like = replace(CLEAR, confused=(("creep", 3.0),))
    assert Sight((like,), {}).lines()[-1] == (
        f"At an expected size the data could not distinguish {CLEAR.name} from creep."
    )


def test_what_has_more_parameters_than_rows_is_not_called_invisible() -> None:
    """It was listed by the same diagnosis: sets weigh it with expected sizes."""
    large = Reason(Why.TOO_MANY_PARAMETERS, parameters=36, rows=28)
    lacking = {"anchor_point_error": large, "tension_scale": Reason(Why.NEEDS_TENSIONS)}
    said, unseen, rest = Sight((CLEAR,), lacking).lines()
    assert said.startswith("In these data 1 of 3 effects")
    assert unseen == "Not visible: tension_scale (needs measured tensions)."
    assert rest.endswith("rest on expected sizes: anchor_point_error.")


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
        (lambda: crosscheck.make_plan(ROBOT, NONE, tilt=-1.0),
         r"tilt must be an angle .* got -1.0"),
        (lambda: crosscheck.make_plan(ROBOT, NONE, tilt="10deg"), "tilt: expected numbers, got"),
        (lambda: crosscheck.choose_poses(ROBOT, 6, floor=np.nan), "floor holds numbers"),
        (lambda: crosscheck.make_plan(ROBOT, NONE), "there are no commands; expected one or more"),
        (lambda: crosscheck.make_plan(ROBOT, NONE, box=[1, 2]), "box must be"),
        (lambda: crosscheck.make_twin(ROBOT, 1, poses=NONE), "there are no commands"),
        (lambda: crosscheck.run_suite("planar-*", jobs=0), "jobs: .* from 1 on, got 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_planned_with_is_told_in_one_line(
    call: Callable[[], Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as told:
        call()
    assert "\n" not in str(told.value)


def test_one_kind_of_reading_stands_for_itself() -> None:
    assert kinds_of("position", Sigma()) == kinds_of(["position"], Sigma()) == ("position",)
    with pytest.raises(crosscheck.CrosscheckError, match=r"^reads: expected some of .* 'colour'"):
        crosscheck.make_plan(ROBOT, np.array([0.5, 0, 0.5, 1, 0, 0, 0]), reads="colour")


OWN = {"poses.csv", "poses.toml"}


def test_files_of_every_addition_may_be_stale(tmp_path: Path) -> None:
    added = {f"add-{kind.value}.{end}" for kind in Adding for end in ("csv", "toml")}
    assert set(planned_files(tmp_path, None)["sometimes"]) == added | OWN
    assert set(planned_files(tmp_path, None)["names"]) > OWN
    given = tmp_path / ".." / tmp_path.name / "poses.csv"
    assert set(planned_files(tmp_path, given)["sometimes"]) == added


def test_lines_that_leave_cables_slack_are_remarked_in_the_file_itself() -> None:
    """Below the remark and the header, lines count from 3."""
    item = Suggestion(Adding.POSES, "", (), slack=((), ("a", "b"), (), ("c",)))
    assert slack_remark(item) == "cables are slack at line 4 (a b), line 6 (c)"
    assert slack_remark(Suggestion(Adding.POSES, "", (), slack=((), ()))) == ""


def test_what_a_diagnosis_lists_is_not_said_to_be_too_small() -> None:
    """Both were printed of one effect: "too small compared with the noise", "> 99 %"."""
    small = Visible(SIGNAL, 15.0, 1.5, 3.0, "", (), ())
    name = small.name
    before, after = Sight((small,), {}), Sight((small,), {}, found=(name,))
    assert "too small compared with the noise" in " ".join(before.lines())
    assert "0 of 1 effect would be visible" in before.lines()[0]
    assert after.hidden == () and "1 of 1 effect would be visible" in after.lines()[0]
    assert not any("too small" in line for line in after.lines())
    assert after.as_json()["visible"] == [name] and after.as_json()["not_visible"] == []
