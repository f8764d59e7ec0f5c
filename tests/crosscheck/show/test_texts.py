"""Texts of recordings: Markdown, and the numbers of a pose and of an instant."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.show import suite
from crosscheck.show.blocks import Bold, Code, Items, Line, TextTable, section
from crosscheck.show.texts import markdown, pose_heading
from crosscheck.suite.verdicts import Verdict

HOME = np.array([0.1, -0.2, 0.3, 1.0, 0.0, 0.0, 0.0])
TURN = Rotation.from_euler("XYZ", [10.0, -20.0, 30.0], degrees=True)  # about moving axes


def posed(turn: Rotation, by: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    return np.concatenate([HOME[:3] + by, turn.as_quat(scalar_first=True)])


def test_a_table_has_heads_of_its_own_or_its_first_row() -> None:
    rows = [["a", "b"], ["1", "2"]]
    assert markdown([TextTable([], rows)]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"
    assert markdown([TextTable(rows[0], rows[1:])]) == markdown([TextTable([], rows)])
    assert markdown([TextTable(["n"], [[None]])]).endswith("| – |")


def test_blocks_stand_below_their_title_and_what_users_wrote_means_nothing() -> None:
    text = markdown([Line((Bold("Look."), " at *x* in ", Code("a_b"))), Items(["one", "two"])], "T")
    assert text == "# T\n**Look.** at \\*x\\* in `a_b`\n\n- one\n- two"
    assert markdown([section("S", Line("x"))]) == "## S\nx"


def test_of_one_pose_it_is_not_said_which_of_how_many() -> None:
    assert pose_heading(0, 1) == "## Pose 0"
    assert pose_heading(2, 5) == "## Pose 2 (of 0 to 4)"


def test_an_instant_is_in_millimetres_and_degrees() -> None:
    text = suite.instant_text(0.25, 1e-3, np.array([0.002, np.pi / 180.0]), "cable1")
    assert text.splitlines()[0] == "## Settling, 0.250 s"
    assert [line.split(" | ")[1] for line in text.splitlines()[1:] if "---" not in line] == [
        "2 mm |", "1 ° |", "0.001 J |", "cable1 |",
    ]  # fmt: skip


def guide(count: int, kind: str, watched: int | None, along: str, **some: Any) -> str:
    case = SimpleNamespace(kind=kind, name="a", poses=np.zeros((count, 7)))
    robot = SimpleNamespace(n_cables=8, mass=1.0, weight=9.81)
    verdict = np.array([Verdict.AGREES] * count, dtype=object)
    known: Any = SimpleNamespace(
        case=case, robot=robot, **{"worst": {}, "verdict": verdict, **some}
    )
    return suite.guide_text(known, along, watched)


def test_settling_is_told_of_where_it_is_shown_and_numbers_where_there_are_any() -> None:
    worst = {"position_m": SimpleNamespace(value=0.001, pose=0, allowed=0.002)}
    unsolved = np.array([Verdict.SEECR_UNSOLVED], dtype=object)
    whole = guide(1, "random", 7, "x_mm", worst=worst, verdict=unsolved)
    bare = guide(2, "sweep", None, "pose")
    assert "lets go of the platform at command 7," in whole and "settling_time" not in bare
    assert "`x_mm` goes through the 1 command." in whole and "the 2 commands." in bare
    assert "## Findings\n- pose 0: " in whole and "## Findings" not in bare
    assert "No pose could be compared" in bare and "| position | 0.001 m | 0 | 0.002 m |" in whole
    assert "Crosses are SEECR" in whole and "Lines are SEECR" in bare
