"""Several files of one robot: runs, clocks, noise and loads keep apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from random_robots import random_robot

from crosscheck.fit.problem import Problem
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from crosscheck.model.write import provenance_of
from seecr.columns.commands import read_commands
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.equilibrium.solving import solve
from seecr.errors import InputFileError
from seecr.files import Made
from seecr.inverse.correction import correct
from seecr.pose import pose_difference, quat_from_rxyz

CMD = "run,t_s,cmd_x_m,cmd_y_m,cmd_z_m"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return random_robot(np.random.default_rng(1), cables=4)


def case(folder: Path, name: str, *lines: str, toml: str = "") -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".toml").write_text(toml)
    return path


def test_two_days_are_one_with_their_own_noise_clock_and_start(tmp_path: Path, robot: Robot):
    monday = case(
        tmp_path, "monday.csv", f"{CMD},meas_x_m,payload_kg", "a,5,0,0,0,0.1,0", "a,9,0,0,.1,.1,1",
        toml="[sigma]\nposition_m = '0.1mm'\nlength_m = 1e-3",
    )  # fmt: skip
    tuesday = case(
        tmp_path, "tuesday.csv", f"{CMD},meas_x_m,tension_2_N", "a,0,0,0,0,.3,7", "b,1,.1,0,.1,.3,",
        toml='start = "first_row"\n[sigma]\nposition_m = 3e-4\ntension_N = 2.0\n'
        'source = "dwell_scatter"',
    )  # fmt: skip
    data = load_measurements([monday, tuesday], robot)
    assert data.runs == ("monday.csv: a", "tuesday.csv: a", "tuesday.csv: b")
    assert data.path.name == "monday.csv + tuesday.csv"
    assert data.sigma == Sigma(1e-4, None, 2.0, 1e-3)
    assert data.sigma_source == "dwell_scatter", "a lower bound in one file is one for both"
    problem = Problem(robot, data, data.sigma, np.ones(4, dtype=bool))
    assert problem.reading_sigma[:, 0] == pytest.approx([1e-4, 1e-4, 3e-4, 3e-4])
    assert problem.reading_sigma[:, 7] == pytest.approx([2.0] * 4)
    assert problem.length_sigma[:2, 0] == pytest.approx([1e-3, 1e-3])
    assert np.all(problem.length_sigma[2:] < 1e-8)
    assert data.stands.tolist() == [False, False, True, True]
    assert data.loads is not None and data.loads.mass.tolist() == [0, 1, 0, 0]
    commands = data.as_commands(robot)
    assert commands.clock is not None and commands.clock.tolist() == [0, 0, 1, 1]
    assert data.places([1, 2]) == "monday.csv 3, tuesday.csv 2"
    assert "tuesday.csv without length_m: these lengths are taken as exact." in data.notes
    assert "monday.csv without tension_N: that of tuesday.csv is used." in data.notes
    quieter = load_measurements([monday, tuesday], robot, sigma=Sigma(2e-3))
    assert quieter.sigma_source == "stated"
    assert quieter.sigma.position_m == 2e-3 and np.all(quieter.sigma_ratio[:, 0] == 1.0)
    assert np.any(quieter.sigma_ratio[:, 3] != 1.0)


def test_rows_count_by_the_noise_of_their_own_file(tmp_path: Path, robot: Robot):
    rows = [f"a,{k},0.0{k},0,0,{0.001 + 0.01 * k}" for k in range(1, 5)]
    files = [
        case(tmp_path, f"{k}.csv", f"{CMD},meas_x_m", *rows, toml=f"[sigma]\nposition_m = {s}")
        for k, s in enumerate((1e-4, 1e-3))
    ]
    alone = [load_measurements(file, robot) for file in files]
    chi2 = []
    for data in (*alone, load_measurements(files, robot)):
        problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
        factor = problem.noise(problem.experiment.predict())
        chi2.append(evaluate(problem, Terms(), factor).chi2)
    assert chi2[2] == pytest.approx(chi2[0] + chi2[1], rel=1e-9)
    assert chi2[0] == pytest.approx(100 * chi2[1], rel=1e-9)
    again = load_measurements(files, robot).notes
    assert any("Identical rows: line 1.csv 2 as 0.csv 2" in n for n in again)


def test_orientations_meet_as_angles_where_one_file_has_only_these(tmp_path: Path, robot: Robot):
    angles = np.array([0.1, -0.2, 0.3])
    quat = ",".join(f"{v:.12f}" for v in quat_from_rxyz(angles))
    whole = case(tmp_path, "a.csv", f"{CMD},meas_qw,meas_qx,meas_qy,meas_qz", f"a,0,0,0,0,{quat}")
    part = case(tmp_path, "b.csv", f"{CMD},meas_rx_rad", "a,0,0,0,0,0.5")
    none = case(tmp_path, "c.csv", f"{CMD},meas_x_m", "a,0,0,0,0,0.5")
    data = load_measurements([whole, part], robot)
    read = [load_measurements(one, robot) for one in (whole, part)]
    assert load_measurements(read, robot).to_frame().equals(data.to_frame())
    assert data.quat_wxyz is None
    assert data.angles_rad[0] == pytest.approx(angles, abs=1e-9)
    assert data.angles_rad[1, 0] == 0.5 and np.isnan(data.angles_rad[1, 1:]).all()
    data = load_measurements([none, whole], robot)
    assert data.quat_wxyz is not None and np.isnan(data.quat_wxyz[0]).all()


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path, robot: Robot):
    files = [
        case(tmp_path, f"{day}/measured.csv", f"{CMD},meas_x_m", f"a,0,0,0,0,{k}.5")
        for k, day in enumerate(("mon", "tue"))
    ]
    assert load_measurements(files, robot).files == ("mon/measured.csv", "tue/measured.csv")


def test_files_that_do_not_go_together(tmp_path: Path, robot: Robot):
    poses = case(tmp_path, "a.csv", f"{CMD},meas_x_m", "a,0,0,0,0,0.5")
    header = ",".join(f"length_{i}_m" for i in range(1, 5)) + ",meas_x_m"
    told = case(tmp_path, "b.csv", header, "1,1,1,1,0", toml='lengths = "told"')
    lengths = case(tmp_path, "c.csv", header, "1,1,1,1,0")
    empty = case(tmp_path, "d.csv", CMD, "a,0,0,0,0")
    with pytest.raises(InputFileError, match=r"a\.csv: is given twice; expected each file once"):
        load_measurements([poses, poses.parent / "." / "a.csv"], robot)
    with pytest.raises(InputFileError, match=r"b\.csv: commands told lengths, .*a\.csv poses;"):
        load_measurements([poses, told], robot)
    with pytest.raises(
        InputFileError, match=r"c\.csv: commands absolute lengths, .*told lengths; exp"
    ):
        load_measurements([told, lengths], robot)
    with pytest.raises(InputFileError, match=r"d\.csv: line 1: no measurement"):
        load_measurements([poses, empty], robot)
    still = case(tmp_path, "e.csv", "run,cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m", "a,0,0,0,0.7")
    data = load_measurements([poses, still], robot)
    assert data.t_s is None and "e.csv without t_s: that of the others is not used." in data.notes


def test_files_of_one_name_are_all_named(tmp_path: Path, robot: Robot) -> None:
    """Of mon/m.csv and tue/m.csv a model said that its values were of m.csv."""
    for day in ("mon", "tue"):
        case(tmp_path / day, "m.csv", f"{CMD},meas_x_m", "a,5,0,0,0,0.1", "a,9,0,0,.1,.1")
    both = [tmp_path / day / "m.csv" for day in ("mon", "tue")]
    whole = load_measurements(both, robot)
    assert whole.name == "mon/m.csv + tue/m.csv"
    assert load_measurements(both[0], robot).name == "m.csv"
    assert provenance_of(whole.name, "crosscheck add").data == "mon/m.csv + tue/m.csv"
    hashes = Made.now("crosscheck add", both).files
    assert set(hashes) == {str(day.with_suffix(end)) for day in both for end in (".csv", ".toml")}
    assert set(Made.now("crosscheck add", both[:1]).files) == {"m.csv", "m.toml"}


# Measurements that are read and solved: shared data, lines of answers, wanted equilibria


@pytest.mark.parametrize("number", range(1, 13))
def test_shipped_twins_load(shared_data, number, tmp_path):
    folder = shared_data / "twins" / f"L{number:02d}"
    robot = load_robot(folder / "robot.xml")
    data = load_measurements(folder / "measured.csv", robot)
    assert data.n_rows == 144
    assert data.has_position and data.quat_wxyz is not None
    assert data.sigma.position_m and data.sigma.orientation_rad
    assert data.unused_columns == () and data.notes == ()
    # Written back, the header is the same and the numbers differ by rounding at most.
    write_measurements(tmp_path / "measured.csv", data)
    original = (folder / "measured.csv").read_text().partition("\n")[0]
    assert (tmp_path / "measured.csv").read_text().partition("\n")[0] == original
    again = load_measurements(tmp_path / "measured.csv", robot)
    measured = [np.concatenate([d.position, d.quat_wxyz], axis=1) for d in (data, again)]
    assert np.abs(pose_difference(*measured)).max() < 1e-8
    assert (tmp_path / "measured.toml").read_text() == (folder / "measured.toml").read_text()


def test_shipped_real_data_load(shared_data):
    folder = shared_data / "real" / "irma4u"
    data = load_measurements(folder / "measured.csv", load_robot(folder / "robot.xml"))
    assert (data.n_rows, data.has_position, data.tension_mask.all()) == (27, False, True)
    assert data.quat_wxyz.shape == (27, 4)
    assert data.sigma == Sigma(orientation_rad=0.009, tension_N=1.0, length_m=0.003)
    folder = shared_data / "real" / "hangprinter"
    data = load_measurements(folder / "measured.csv", load_robot(folder / "robot.xml"))
    assert (data.n_rows, data.has_position, data.has_orientation) == (41, True, False)
    assert data.command_lengths[0].tolist() == [1.597, 1.794996, 1.5825, 2.355]
    assert data.sigma == Sigma(position_m=0.001, length_m=0.001)


ROBOT = load_robot("demobot_cogiro")

THREE = """# a comment
cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m
0.4,0.25,0.1,0.4
0.4,0.25,0.6,0.4
0.3,0.25,0.12,0.3
"""


@pytest.fixture
def measured(tmp_path: Path) -> Measurements:
    path = tmp_path / "measured.csv"
    path.write_text(THREE)
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
    other.write_text(THREE)
    both = load_measurements([measured.path, other], ROBOT)
    assert solve(ROBOT, both).place(4) == "pose 4"


def test_measured_rows_start_where_their_lengths_were_to_lead(tmp_path: Path) -> None:
    """Once ``compare`` began at the reference pose, where ``seecr sweep`` began at the wanted."""
    level = solve(ROBOT, np.array([[0.4, 0.25, 0.2, 1, 0, 0, 0]]), others=True)
    assert level.others is not None
    rolled = level.others[0].pose[0]  # at rest with the same lengths
    lengths = np.tile(level.rest_lengths[0], (3, 1))
    wanted = np.stack([rolled, level.pose[0], np.r_[rolled[:2], np.nan, rolled[3:]]])
    names = [f"length_{i}_m" for i in range(1, 9)]
    names += [f"want_{k}" for k in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")] + ["meas_x_m"]
    rows = np.column_stack([lengths, wanted, np.full(3, 0.4)])
    csv = tmp_path / "rows.csv"
    text = "\n".join(",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in rows)
    csv.write_text(",".join(names) + "\n" + text + "\n")
    found = solve(ROBOT, load_measurements(csv, ROBOT))
    assert found.converged.all()
    away = pose_difference(found.pose, np.stack([rolled, level.pose[0], rolled]))
    assert np.abs(away).max() < 1e-6
    whole = tmp_path / "whole.csv"
    whole.write_text("\n".join(csv.read_text().splitlines()[:3]) + "\n")
    swept = solve(ROBOT, read_commands(whole, ROBOT).commands)
    assert np.abs(pose_difference(swept.pose, found.pose[:2])).max() < 1e-9
