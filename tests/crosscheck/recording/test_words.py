"""Numbers of a pose and of an instant, as people read them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.recording import words

HOME = np.array([0.1, -0.2, 0.3, 1.0, 0.0, 0.0, 0.0])
TURN = Rotation.from_euler("XYZ", [10.0, -20.0, 30.0], degrees=True)  # about moving axes


def posed(turn: Rotation, by: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    return np.concatenate([HOME[:3] + by, turn.as_quat(scalar_first=True)])


def test_places_are_millimetres_and_angles_degrees_about_moving_axes() -> None:
    assert words.position(HOME) == "x 100.00, y -200.00, z 300.00 mm"
    assert words.orientation(posed(TURN)) == "rx 10.00, ry -20.00, rz 30.00°"
    assert words.orientation(np.array([*HOME[:3], 1.0, -0.0, -0.0, -0.0])) == (
        "rx 0.00, ry 0.00, rz 0.00°"
    )


def test_from_its_command_a_pose_is_displaced_with_a_sign_and_turned_without() -> None:
    moved = posed(TURN, (0.001, -0.002, 0.0))
    assert words.shift(moved, HOME) == "dx +1.00, dy -2.00, dz +0.00 mm"
    far = posed(TURN, (3.0, 0.0, 0.0))
    assert words.turn(moved, HOME) == words.turn(far, HOME)
    assert words.turn(far, HOME) == f"{np.degrees(TURN.magnitude()):.2f}°"
    assert words.turn(posed(TURN * TURN), posed(TURN)) == words.turn(moved, HOME)


@pytest.mark.parametrize("say", [words.shift, words.turn])
def test_without_a_pose_there_is_no_answer(say) -> None:  # type: ignore[no-untyped-def]
    assert say(np.full(7, np.nan), HOME) == "no answer"


def test_a_number_that_there_is_not_is_a_dash() -> None:
    assert words.number(0.0012345, "J") == "0.00123 J" and words.number(np.nan, "J") == "–"
    assert words.number(np.inf, "J") == "–" and words.number(1.23456, "N", 5) == "1.2346 N"


def test_a_table_has_a_head_of_its_own_or_its_first_row() -> None:
    rows = [("a", "b"), ("1", "2")]
    assert words.table(rows) == "| a | b |\n| --- | --- |\n| 1 | 2 |"
    assert words.table(rows[1:], ("a", "b")) == words.table(rows)


def test_of_one_pose_it_is_not_said_which_of_how_many() -> None:
    assert words.pose_heading(0, 1) == "## Pose 0"
    assert words.pose_heading(2, 5) == "## Pose 2 (of 0 to 4)"


def test_an_instant_is_in_millimetres_and_degrees() -> None:
    text = words.instant(0.25, 1e-3, np.array([0.002, np.pi / 180.0]), "cable1")
    assert text.splitlines()[0] == "## Settling, 0.250 s"
    assert [line.split(" | ")[1] for line in text.splitlines()[1:] if "---" not in line] == [
        "2 mm |", "1 ° |", "0.001 J |", "cable1 |",
    ]  # fmt: skip


def test_settling_is_told_of_where_it_is_shown_and_numbers_where_there_are_any() -> None:
    rows = [("position", "1 mm", "0", "2 mm")]
    whole = words.read_me("a", "b", 1, 7, rows, ["one"], lines=False, along="x_mm")
    bare = words.read_me("a", "b", 2, None, [], [])
    assert "lets go of the platform at command 7," in whole and "settling_time" not in bare
    assert "`x_mm` goes through the 1 command." in whole and "the 2 commands." in bare
    assert "## Findings\n- one\n" in whole and "## Findings" not in bare
    assert "No pose could be compared" in bare and "| position | 1 mm | 0 | 2 mm |" in whole
    assert "Crosses are SEECR" in whole and "Lines are SEECR" in bare
