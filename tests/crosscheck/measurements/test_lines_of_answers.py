"""What is solved or corrected for measurements names the lines of their file."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import load_measurements
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.inverse.correction import correct

ROBOT = load_robot("demobot_cogiro")
CSV = """# a comment
cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m
0.4,0.25,0.1,0.4
0.4,0.25,0.6,0.4
0.3,0.25,0.12,0.3
"""


@pytest.fixture
def measured(tmp_path: Path) -> Measurements:
    path = tmp_path / "measured.csv"
    path.write_text(CSV)
    return load_measurements(path, ROBOT)


def test_an_answer_names_lines(measured: Measurements) -> None:
    found = solve(ROBOT, measured)
    assert found.place(1) == "line 4"
    assert "from the command: line 4, " in str(found)
    assert solve(ROBOT, measured.rows([2])).place(0) == "line 5"


def test_a_correction_names_lines(measured: Measurements) -> None:
    found = correct(ROBOT, measured, lowest=0.1, highest=2.0)
    assert not found.held[1] and found.held[0]
    assert "  line 4: " in str(found) and "pose 1" not in str(found)
    assert [row["line"] for row in found.as_json()["rows"]] == [3, 4, 5]


def test_of_several_files_a_line_alone_would_name_no_row(
    measured: Measurements, tmp_path: Path
) -> None:
    other = tmp_path / "tuesday.csv"
    other.write_text(CSV)
    both = load_measurements([measured.path, other], ROBOT)
    assert solve(ROBOT, both).place(4) == "pose 4"
