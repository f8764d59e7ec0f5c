"""Tables of points: what is read, in every unit, and all faults at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from seecr.errors import SeecrError
from seecr.importing.points_table import read_points

HEAD = "name,exit_x_m,exit_y_m,exit_z_m,anchor_x_mm,anchor_y_cm,anchor_z_m"
ROWS = ["a,0,0,3,-300,-20,0.1", "b,6,0,3,300,-20,0.1", "c,3,4,3,0,20,-0.1"]


def table(folder: Path, *lines: str) -> Path:
    path = folder / "points.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(SeecrError) as caught:
        read_points(path)
    text = str(caught.value)
    assert all(line.startswith(f"{path}: ") for line in text.split("\n"))
    return text.replace(f"{path}: ", "")


def test_every_number_of_a_table(tmp_path: Path) -> None:
    draft = read_points(
        table(tmp_path, "# a hall", f"{HEAD},ea_kN,colour", *(f"{r},300,red" for r in ROWS))
    )
    np.testing.assert_array_equal(draft.exit_points, [[0, 0, 3], [6, 0, 3], [3, 4, 3]])
    np.testing.assert_array_equal(
        draft.anchor_points, [[-0.3, -0.2, 0.1], [0.3, -0.2, 0.1], [0, 0.2, -0.1]]
    )
    assert draft.cable_names == ("a", "b", "c") and draft.ea.tolist() == [3e5] * 3
    assert np.isnan(draft.stiffness).all() and draft.mass is None
    assert draft.notes == ("columns not used: colour",)


def test_cables_may_differ_in_what_is_known(tmp_path: Path) -> None:
    """E S of one, the stiffness of another: k l0 = E S with the lengths at the reference pose."""
    path = table(
        tmp_path,
        f"{HEAD},ea_N,stiffness_N_mm",
        f"{ROWS[0]},2e5,",
        f"{ROWS[1]},,100",
        f"{ROWS[2]},,",
    )
    draft = read_points(path)
    with pytest.raises(
        SeecrError, match=r"does not say the platform's mass; .*nor how far c stretch"
    ):
        draft.robot()
    full = draft.with_options(mass="2500g", at=(3, 2, 1))
    with pytest.raises(SeecrError, match="does not say how far c stretch; give E S or a rope"):
        full.robot()
    with_all = read_points(
        table(
            tmp_path,
            f"{HEAD},ea_N,stiffness_N_mm",
            f"{ROWS[0]},2e5,",
            f"{ROWS[1]},,100",
            f"{ROWS[2]},,3",
        )
    ).with_options(mass="2500g", at=(3, 2, 1))
    robot, _notes = with_all.robot()
    anchors = np.array([[2.7, 1.8, 1.1], [3.3, 1.8, 1.1], [3, 2.2, 0.9]])
    lengths = np.linalg.norm(np.array([[0, 0, 3], [6, 0, 3], [3, 4, 3]]) - anchors, axis=1)
    np.testing.assert_allclose(robot.ea, [2e5, 1e5 * lengths[1], 3e3 * lengths[2]])
    assert robot.mass == 2.5


def test_without_anchor_points_it_is_a_point_mass(tmp_path: Path) -> None:
    path = table(tmp_path, "exit_x_m;exit_y_m;exit_z_m", "0;0;2,5", "1;0;2,5", "0;1;2,5")
    robot, notes = read_points(path).with_options(mass="1kg", ea="1e4").robot()
    assert [joint.kind for joint in robot.joints] == ["slide"] * 3
    assert any("point mass" in note for note in notes)
    assert robot.exit_points[0, 2] == 2.5


def test_all_faults_of_a_table_are_told_at_once(tmp_path: Path) -> None:
    path = table(
        tmp_path, "name,exit_x_m,exit_y,exit_z_ft,anchor_x_m,anchor_z_m,ea_N,stiffness_N_m",
        "a,0,0,3,0,0,-1,5", "a,zero,0,3,0,0,1,2", ",1_0,,3,0,nan,,",
    )  # fmt: skip
    text = refusal(path)
    for told in (
        "line 1, column exit_y: missing unit; expected exit_y_m or exit_y_cm or exit_y_mm",
        "line 1, column exit_z_ft: unknown unit 'ft'",
        "line 1: expected a table of points, one row a cable: exit_x_m exit_y_m exit_z_m ",
        "anchor_x_m anchor_y_m anchor_z_m; anchor_y_m missing",
        "line 3, column exit_x_m: expected a number in every row, got 'zero'",
        "line 4, column exit_x_m: expected a number in every row, got '1_0'",
        "line 4, column exit_y: expected a number in every row, got an empty cell",
        "line 4, column anchor_z_m: expected a number in every row, got 'nan'",
        "line 2, column ea_N: expected a number above zero, got '-1'",
        "line 2: has E S and a stiffness; expected one of the two",
        "line 3, column name: expected a name of its own, got 'a' again",
        "line 4, column name: expected a name of its own, got an empty cell",
    ):
        assert told in text
    assert "line 3: has E S and a stiffness" in text


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ([HEAD], "has a header but no rows"),
        ([HEAD, "a,0,0"], "expected 7 cells as in the header (line 1), got 3 cells"),
        (["<mujoco/>"], "looks like XML"),
        (["exit_x_m,exit_x_mm,exit_y_m,exit_z_m", "0,0,0,0"], "column exit_x_mm: repeats exit_x"),
        (["cmd_x_m,cmd_y_m", "1,2"], "exit_x_m exit_y_m exit_z_m missing, got cmd_x_m cmd_y_m"),
    ],
)
def test_what_is_no_table_of_points_is_told(tmp_path: Path, lines: list[str], told: str) -> None:
    assert told in refusal(table(tmp_path, *lines))
