"""Reading and writing measurements: units, parts of a pose, and one clear sentence a mistake."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_commands, load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.errors import InputFileError
from seecr.mjcf import load_robot
from seecr.pose import pose_difference, quat_from_rxyz, quat_rotate, quat_to_matrix
from seecr.robot import Robot

FREE = '<freejoint name="free"/>'
PLANAR = """<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<joint name="tilt" type="hinge" axis="0 1 0"/>"""
SLIDE, HINGE = '<joint type="slide" axis="1 0 0"/>', '<joint type="hinge" axis="0 1 0"/>'
ARM = '<joint name="arm" type="hinge" axis="0 1 0" pos="0 0 1"/>'


def mjcf(joints: str, pose: str, n_cables: int = 4) -> str:
    """A platform on cables from the corners of a 2 m square, 1 m above."""
    sites, tendons, anchors = "", "", ""
    for i in range(n_cables):
        angle = 2 * np.pi * i / n_cables
        x, y = np.cos(angle), np.sin(angle)
        sites += f'<site name="A{i}" pos="{x} {y} 1"/>'
        anchors += f'<site name="B{i}" pos="{0.1 * x} {0.1 * y} 0"/>'
        ends = f'<site site="A{i}"/><site site="B{i}"/>'
        tendons += f'<spatial stiffness="1000" springlength="0 1.3">{ends}</spatial>'
    return f"""<mujoco model="small"><worldbody>{sites}<body name="platform" {pose}>{joints}
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>{anchors}</body></worldbody>
<tendon>{tendons}</tendon></mujoco>"""


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    folder = tmp_path_factory.mktemp("robots")
    texts = {
        "free": mjcf(FREE, 'pos="0 0.05 0" quat="0.8 0 0 0.6"'),
        "planar": mjcf(PLANAR, 'pos="0 0.05 0"'),
        "slides": mjcf(PLANAR.partition("\n")[0], 'pos="0 0.05 0" quat="0.8 0 0.6 0"'),
        "yawed": mjcf(PLANAR.partition("\n")[0], 'pos="0 0.05 0" quat="0.8 0 0 0.6"'),
        "slide then hinge": mjcf(SLIDE + HINGE, 'pos="0 0.05 0"'),
        "hinge then slide": mjcf(HINGE + SLIDE, 'pos="0 0.05 0"'),
        "arm": mjcf(ARM, 'pos="0 0.05 0"'),
        "eight": mjcf(FREE, 'pos="0 0 0"', n_cables=8),
    }
    for name, text in texts.items():
        (folder / f"{name}.xml").write_text(text)
    return {name: load_robot(folder / f"{name}.xml") for name in texts}


@pytest.fixture(scope="module")
def robot(robots: dict[str, Robot]) -> Robot:
    return robots["free"]


@pytest.fixture
def csv_file(tmp_path: Path):
    """Write lines to ``measured.csv`` and give its path."""

    def write(*lines: str, end: str = "\n") -> Path:
        path = tmp_path / "measured.csv"
        path.write_bytes((end.join(lines) + end).encode())
        return path

    return write


CMD = "cmd_x_m,cmd_y_m,cmd_z_m"


# ---------------------------------------------------------------- what is read


def test_units_and_order_of_columns_are_free(csv_file, robot):
    path = csv_file(
        "temperature_C,meas_rz_deg,meas_ry_rad,meas_rx_deg,cmd_z_mm,cmd_y_m,cmd_x_mm,"
        "cmd_qw,cmd_qz,cmd_qx,cmd_qy,tension_3_N,meas_y_mm,t_s,run,remark",
        "21.5,90,0.1,-30,170,0.25,630,0.6,0.8,0,0,12.5,251.5,3.5,a,hello",
    )
    data = load_measurements(path, robot)
    assert data.command_pose.tolist() == [[0.63, 0.25, 0.17, 0.6, 0.0, 0.0, 0.8]]
    assert data.position_mask.tolist() == [False, True, False]
    assert data.position[0, 1] == 0.2515
    assert np.isnan(data.position[0, [0, 2]]).all()
    expected = quat_from_rxyz(np.array([-np.pi / 6, 0.1, np.pi / 2]))
    assert data.quat_wxyz[0] == pytest.approx(expected, abs=1e-15)
    assert not data.angle_mask.any() and np.isnan(data.angles_rad).all()
    assert data.tension_mask.tolist() == [False, False, True, False]
    assert data.tensions[0, 2] == 12.5
    assert (data.t_s[0], data.temperature_C[0], data.runs) == (3.5, 21.5, ("a",))
    assert data.unused_columns == ("remark",)
    assert data.notes == ("Not used: remark.",)
    assert data.sigma == Sigma()
    assert (data.n_rows, data.line.tolist(), data.n_cables) == (1, [2], 4)
    assert data.has_position and data.has_orientation and data.has_tension


def test_angles_are_rx_then_ry_then_rz(csv_file, robot):
    path = csv_file(CMD + ",cmd_rx_deg,cmd_ry_deg,cmd_rz_deg,meas_x_m", "0,0,0,90,0,90,0")
    quat = load_measurements(path, robot).command_pose[0, 3:]
    # Rx(90) Rz(90) takes x to y, then y to z; Rz(90) Rx(90) would leave it at y.
    assert quat_rotate(quat, np.array([1.0, 0, 0])) == pytest.approx([0, 0, 1], abs=1e-15)


def test_commanded_lengths_in_millimetres(csv_file, robot):
    path = csv_file("length_2_mm,length_1_m,length_4_m,length_3_m,meas_z_m", "1302,1.1,1.4,1.3,0.2")
    data = load_measurements(path, robot)
    assert data.command_lengths.tolist() == [[1.1, 1.302, 1.3, 1.4]]
    assert data.command_pose is None
    assert data.runs == ("all",)
    assert data.notes == ('No column run: all rows count as one run called "all".',)
    assert data.t_s is None and data.temperature_C is None and data.quat_wxyz is None


def test_missing_orientation_is_the_reference_and_said(csv_file, robot):
    data = load_measurements(csv_file("run," + CMD + ",meas_x_m", "a,0,1,2,3"), robot)
    assert data.command_pose[0] == pytest.approx([0, 1, 2, 0.8, 0, 0, 0.6])
    assert data.notes == ("No commanded orientation: that of the reference pose is used.",)


def test_planar_robot_needs_only_what_it_can_move(csv_file, robots):
    path = csv_file("run,cmd_x_m,cmd_z_m,cmd_ry_deg,meas_x_m", "a,0.3,0.2,90,0.3")
    data = load_measurements(path, robots["planar"])
    half = np.sqrt(0.5)
    assert data.command_pose[0] == pytest.approx([0.3, 0.05, 0.2, half, 0, half, 0])
    assert data.notes == (
        "No cmd_y: the robot cannot move there, the reference pose's value is used.",
        "No cmd_rx cmd_rz: the robot cannot move there, the reference pose's value is used.",
    )
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_z_m, cmd_x_m missing"):
        load_measurements(csv_file("cmd_z_m,meas_x_m", "0,0"), robots["planar"])


def test_robot_on_an_arm_needs_the_coordinates_the_arm_sweeps(csv_file, robots):
    path = csv_file("run,cmd_x_m,cmd_z_m,meas_x_m", "a,0.3,0.2,0.3")
    assert load_measurements(path, robots["arm"]).command_pose[0, 1] == 0.05
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_z_m, cmd_z_m missing"):
        load_measurements(csv_file("cmd_x_m,meas_x_m", "0,0"), robots["arm"])


def test_sliding_robot_keeps_its_reference_orientation(csv_file, robots):
    data = load_measurements(csv_file("run,cmd_x_m,cmd_z_m,meas_x_m", "a,1,2,3"), robots["slides"])
    assert data.command_pose[0] == pytest.approx([1, 0.05, 2, 0.8, 0, 0.6, 0])
    # A body turned about the vertical takes its slides along: now it moves in y as well.
    with pytest.raises(InputFileError, match="cmd_y_m missing"):
        load_measurements(data.path, robots["yawed"])


def test_a_hinge_turns_only_the_joints_after_it(csv_file, robots):
    path = csv_file("run,cmd_x_m,cmd_ry_deg,meas_x_m", "a,0.3,0,0.3")
    data = load_measurements(path, robots["slide then hinge"])
    assert data.command_pose[0] == pytest.approx([0.3, 0.05, 0, 1, 0, 0, 0])
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_z_m, cmd_z_m missing"):
        load_measurements(path, robots["hinge then slide"])


def test_two_angles_only_stay_angles(csv_file, robot):
    data = load_measurements(
        csv_file("run," + CMD + ",meas_rx_deg,meas_ry_deg", "a,0,0,0,90,45"), robot
    )
    assert data.quat_wxyz is None
    assert data.angle_mask.tolist() == [True, True, False]
    assert data.angles_rad[0, :2] == pytest.approx([np.pi / 2, np.pi / 4])
    assert data.has_orientation and not data.has_position and not data.has_tension


def test_three_angles_with_one_lost_stay_angles(csv_file, robot):
    header = "run," + CMD + ",meas_rx_rad,meas_ry_rad,meas_rz_rad"
    data = load_measurements(csv_file(header, "a,0,0,0,.1,.2,.3", "a,0,0,0,.1,,.3"), robot)
    assert data.quat_wxyz is None and data.angle_mask.all()
    assert np.array_equal(data.angles_rad, [[0.1, 0.2, 0.3], [0.1, np.nan, 0.3]], equal_nan=True)


def test_row_without_readings_is_kept_and_said(csv_file, robot):
    header = "run," + CMD + ",meas_x_m,meas_qw,meas_qx,meas_qy,meas_qz,tension_1_N"
    path = csv_file(header, "a,0,0,0,1,1,0,0,0,", "a,0,0,0,,,,,,", "a,0,0,0,2,,,,,")
    data = load_measurements(path, robot)
    assert np.array_equal(data.position[:, 0], [1, np.nan, 2], equal_nan=True)
    assert np.isnan(data.quat_wxyz[1:]).all() and not np.isnan(data.quat_wxyz[0]).any()
    assert not data.has_tension
    assert data.notes[1:] == (
        "Column tension_1_N is empty: not measured.",
        "1 row has a command but no reading: a way point, gone through and not compared.",
    )


def test_empty_quaternion_columns_are_not_measured(csv_file, robot):
    header = "run," + CMD + ",meas_x_m,meas_qw,meas_qx,meas_qy,meas_qz"
    data = load_measurements(csv_file(header, "a,0,0,0,1,,,,"), robot)
    assert data.quat_wxyz is None and not data.has_orientation
    assert data.notes[-1] == "Columns meas_qw to meas_qz are empty: not measured."


@pytest.mark.parametrize("sign", [1, -1])
def test_rounded_quaternions_become_unit(csv_file, robot, sign):
    quat = ",".join(str(sign * v) for v in (0.70711, 0.70711, 0, 0))
    path = csv_file(CMD + ",meas_qw,meas_qx,meas_qy,meas_qz", "0,0,0," + quat)
    measured = load_measurements(path, robot).quat_wxyz[0]
    assert np.linalg.norm(measured) == pytest.approx(1, abs=1e-15)
    turn = quat_to_matrix(measured)
    assert turn == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-15)


def test_byte_order_mark_crlf_comments_spaces_and_blank_lines(csv_file, robot):
    path = csv_file(
        "\ufeff# a tracker wrote this",
        "",
        ' run , "cmd_x_m",cmd_y_m ,cmd_z_m,meas_x_m',
        "  # in between, with commas, and words",
        "a, 1 ,2,3,4",
        "",
        '"b, c",1,2,3,5e0',
        end="\r\n",
    )
    data = load_measurements(path, robot)
    assert data.runs == ("a", "b, c")
    assert data.run_index.tolist() == [0, 1]
    assert data.line.tolist() == [5, 7]
    assert data.position[:, 0].tolist() == [4, 5]


def test_unnamed_column_is_unused(csv_file, robot):
    data = load_measurements(csv_file("," + CMD + ",meas_x_m,", "0,1,2,3,4,"), robot)
    assert data.unused_columns == ("(column 1, without a name)", "(column 6, without a name)")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("meas_X_m", "meas_x_m"),
        ("mes_z_m", "meas_z_m"),
        ("Time_s", "t_s"),
        ("TENSION_2_N", "tension_2_N"),
    ],
)
def test_misspelt_columns_are_unused_with_a_suggestion(csv_file, robot, name, meant):
    data = load_measurements(csv_file(f"run,{CMD},meas_y_m,{name}", "a,0,0,0,1,2"), robot)
    assert data.unused_columns == (name,)
    assert f"Column '{name}' is not used; did you mean {meant}?" in data.notes


def test_other_peoples_columns_pass_without_a_suggestion(csv_file, robot):
    names = "operator,meas_y_std_m,run_number,t_motor"
    data = load_measurements(csv_file(f"run,{CMD},meas_y_m,{names}", "a,0,0,0,1,x,x,x,x"), robot)
    assert data.unused_columns == tuple(names.split(","))
    assert not any("did you mean" in note for note in data.notes)


def test_time_may_start_again_in_the_next_run_and_rows_may_repeat(csv_file, robot):
    path = csv_file(f"run,t_s,{CMD},meas_x_m", *["a,5,0,0,0,1"] * 2, "b,0,0,0,0,1")
    assert load_measurements(path, robot).t_s.tolist() == [5, 5, 0]


def test_rows_are_a_subset_with_the_same_masks(csv_file, robot):
    lines = ["a,0,0,0,0,1,", "a,1,0,0,0,2,7", "b,0,0,0,0,3,"]
    data = load_measurements(csv_file(f"run,t_s,{CMD},meas_x_m,tension_1_N", *lines), robot)
    for index in ([0, 2], np.array([True, False, True]), slice(0, 3, 2)):
        part = data.rows(index)
        assert part.position[:, 0].tolist() == [1, 3]
        assert part.run.tolist() == ["a", "b"] and part.line.tolist() == [2, 4]
        assert part.tension_mask.tolist() == data.tension_mask.tolist()
        assert part.command_pose.shape == (2, 7) and part.n_rows == 2
    assert data.rows([2]).runs == ("b",)
    assert data.rows([2]).run_index.tolist() == [0]


def test_commands_need_no_readings(csv_file, robot):
    path = csv_file("run," + CMD, "a,0,0,0")
    data = load_commands(path, robot)
    assert not (data.has_position or data.has_orientation or data.has_tension)
    with pytest.raises(InputFileError, match="line 1: no measurement; expected readings"):
        load_measurements(path, robot)


@pytest.mark.slow
def test_hundred_thousand_rows_load_in_seconds(tmp_path, robot):
    n = 100_000
    rng = np.random.default_rng(1)
    pose = np.concatenate([rng.normal(size=(n, 3)), np.tile([1.0, 0, 0, 0], (n, 1))], axis=1)
    made = Measurements(
        path=tmp_path / "big.csv",
        n_cables=4,
        run=np.repeat([f"run {i}" for i in range(100)], n // 100),
        t_s=np.arange(n, dtype=float),
        command_pose=pose,
        position=pose[:, :3],
        quat_wxyz=pose[:, 3:],
    )
    write_measurements(made.path, made)
    began = time.process_time()
    assert load_measurements(made.path, robot).n_rows == n
    assert time.process_time() - began < 5.0


# ---------------------------------------------------------------- what is refused

POSE = CMD + ",meas_x_m"
QUAT = CMD + ",meas_qw,meas_qx,meas_qy,meas_qz"
LENGTHS = "length_1_m,length_2_m,length_3_m,length_4_m"

REFUSED = {
    "empty": ([""], "is empty; expected a CSV file in UTF-8 with a header row"),
    "comments only": (["# nothing", "#"], "is empty; expected a CSV file"),
    "header only": (["# x", POSE], "line 2: has a header but no rows; expected one row"),
    "json": (['{"run": [1, 2]}'], "line 1: looks like JSON; expected a CSV"),
    "toml": (["# sigma", "[sigma]", "a = 1"], "line 2: looks like JSON or TOML; expected a CSV"),
    "xml": (["<mujoco>", "</mujoco>"], "line 1: looks like XML, such as a robot's MJCF; expected"),
    "bars": (
        [POSE.replace(",", "|"), "0|0|0|0"],
        "line 1: expected commas, semicolons or tabs between cells, got bars",
    ),
    "marks of two kinds": (
        ["cmd_x_m;cmd_y_m,cmd_z_m;meas_x_m,run", "0;0,0;0,a"],
        "line 1: expected one kind of mark between the names, got as many of one as of another",
    ),
    "points and commas": (
        [POSE.replace(",", ";"), "0;0;0;0.5", "0;0;0;1,5"],
        "line 3, column meas_x_m: .*got a decimal comma in '1,5'; write 1.5",
    ),
    "no header": (
        ["0,0,0,1.5", "0,0,0,1.6"],
        "line 1: expected a header row with column names such as cmd_x_m, got the number '0'",
    ),
    "commented header": (
        ["#" + POSE, "0,0,0,1.5", "0,0,0,1.6"],
        "put the names in the first row, without a # before them",
    ),
    "open quote": (
        [POSE, "0,0,0,0", '"0,0,0,0', "0,0,0,0"],
        "line 3: cannot be split into cells: .*quotation mark",
    ),
    "no unit": (
        ["cmd_x,cmd_y_m,cmd_z_m,meas_x_m", "0,0,0,0"],
        "line 1, column cmd_x: missing unit; expected cmd_x_m, cmd_x_cm, cmd_x_mm or cmd_x_um",
    ),
    "inches": (
        ["cmd_x_in,cmd_y_m,cmd_z_m,meas_x_m", "0,0,0,0"],
        "line 1, column cmd_x_in: unknown unit 'in'; expected cmd_x_m, cmd_x_cm",
    ),
    "metres as angle": (
        [CMD + ",meas_rx_m", "0,0,0,0"],
        "column meas_rx_m: unknown unit 'm'; expected meas_rx_rad or meas_rx_deg",
    ),
    "small n": ([CMD + ",tension_1_n", "0,0,0,0"], "unknown unit 'n'; expected tension_1_N"),
    "minutes": (
        ["t_min," + POSE, "0,0,0,0,0"],
        "column t_min: unknown unit 'min'; expected t_s or t_ms",
    ),
    "time without unit": (["t," + POSE, "0,0,0,0,0"], "column t: missing unit; expected t_s"),
    "kelvin": (["temperature_K," + POSE, "0,0,0,0,0"], "unknown unit 'K'; expected temperature_C"),
    "quaternion unit": (
        [CMD + ",meas_qw_rad", "0,0,0,1"],
        "column meas_qw_rad: a quaternion has no unit, got 'rad'; expected meas_qw",
    ),
    "repeated": (
        [CMD + ",meas_x_m,meas_x_m", "0,0,0,0,0"],
        "line 1, column meas_x_m: repeated header, columns 4 and 5; expected each once",
    ),
    "repeated unused": (
        ["a,a," + POSE, "0,0,0,0,0,0"],
        "column a: repeated header, columns 1 and 2",
    ),
    "two units": (
        [CMD + ",meas_x_m,meas_x_mm", "0,0,0,0,0"],
        "column meas_x_mm: says the same as meas_x_m; expected one of the two",
    ),
    "orientation twice": (
        [QUAT + ",meas_rx_deg", "0,0,0,1,0,0,0,0"],
        "orientation twice, as meas_qw and as meas_rx_deg; expected one of the two ways",
    ),
    "commands twice": (
        [LENGTHS + "," + POSE, "1,1,1,1,0,0,0,0"],
        "commands twice, as cmd_x_m and as length_1_m; expected poses or lengths",
    ),
    "no command": (
        ["run,t_s,meas_x_m", "a,0,0"],
        "line 1: no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or "
        "length_1_m to length_4_m$",
    ),
    "misspelt command": (
        ["cmdx_m,cmdy_m,cmdz_m,meas_x_m", "0,0,0,0"],
        r"no command; .* \(Column 'cmdx_m' is not used; did you mean cmd_x_m\?; ",
    ),
    "no measurement": (
        ["run," + CMD, "a,0,0,0"],
        r"no measurement; expected readings in at least one column such as meas_x_m, "
        r".*tension_1_N$",
    ),
    "empty measurement": ([POSE, "0,0,0,"], "no measurement"),
    "misspelt measurement": (
        [CMD + ",measx_m", "0,0,0,0"],
        r"no measurement; .*\(Column 'measx_m' is not used; did you mean meas_x_m\?\)",
    ),
    "position half there": (
        ["cmd_x_m,cmd_z_m,meas_x_m", "0,0,0"],
        "line 1: commanded pose columns half there; expected cmd_x_m cmd_y_m "
        "cmd_z_m, cmd_y_m missing",
    ),
    "orientation without position": (
        ["cmd_rx_deg,cmd_ry_deg,cmd_rz_deg,meas_x_m", "0,0,0,0"],
        "cmd_x_m cmd_y_m cmd_z_m missing",
    ),
    "angles half there": (
        [CMD + ",cmd_rx_deg,meas_x_m", "0,0,0,0,0"],
        "commanded pose columns half there; expected cmd_rx_deg cmd_ry_deg "
        "cmd_rz_deg, cmd_ry_deg cmd_rz_deg missing",
    ),
    "commanded quaternion half there": (
        [CMD + ",cmd_qw,cmd_qx,meas_x_m", "0,0,0,1,0,0"],
        "quaternion columns half there; expected all four or none, cmd_qy cmd_qz missing",
    ),
    "measured quaternion half there": (
        [QUAT.removesuffix(",meas_qz"), "0,0,0,1,0,0"],
        "expected all four or none, meas_qz missing",
    ),
    "lengths half there": (
        ["length_1_m,length_2_m,length_3_m,meas_x_m", "1,1,1,0"],
        "length columns half there; expected all 4 cables of the robot, length_4_m missing",
    ),
    "misspelt half": (
        ["cmd_x_m,cmd_y_m,cmd_Z_m,meas_x_m", "0,0,0,0"],
        r"cmd_z_m missing \(Column 'cmd_Z_m' is not used; did you mean cmd_z_m\?\)",
    ),
    "cable nine": (
        [POSE + ",tension_9_N", "0,0,0,0,1"],
        "column tension_9_N: there is no cable 9; the robot has 4 cables, expected "
        "tension_1 to tension_4",
    ),
    "cable five": (
        [LENGTHS + ",length_5_mm,meas_x_m", "1,1,1,1,1,0"],
        "column length_5_mm: there is no cable 5; the robot has 4 cables",
    ),
    "cable zero": ([POSE + ",tension_0_N", "0,0,0,0,1"], "there is no cable 0"),
    "too few cells": (
        [POSE, "0,0,0,0", "0,0,0"],
        r"line 3: expected 4 cells as in the header \(line 1\), got 3 cells; .* cut off\?$",
    ),
    "too many cells": (
        [POSE, "0,0,0,0,5"],
        "line 2: expected 4 cells .* got 5 cells; a decimal comma splits a number in two",
    ),
    "word": (
        [POSE, "0,0,0,0", "0,0,zero,0"],
        "line 3, column cmd_z_m: expected a number in every row, got 'zero'",
    ),
    "unit in cell": (
        [POSE, "0,0,0,12.5 mm"],
        "line 2, column meas_x_m: .*got '12.5 mm'; a unit belongs in the column's name",
    ),
    "decimal comma": ([POSE, '0,0,0,"1,5"'], "got a decimal comma in '1,5'; write 1.5"),
    "underscore": ([POSE, "0,0,0,1_000"], "line 2, column meas_x_m: .*got '1_000'"),
    "NaN command": (
        [POSE, "0,NaN,0,0"],
        "line 2, column cmd_y_m: expected a number in every row, got 'NaN'",
    ),
    "not available": (
        [POSE, "0,0,0,0", "0,0,0,N/A"],
        "line 3, column meas_x_m: expected a number, or an empty cell where the "
        "reading is missing, got 'N/A'",
    ),
    "infinite": ([POSE, "0,0,0,-inf"], "line 2, column meas_x_m: .*got '-inf'"),
    "overflow": ([POSE, "0,0,0,1e999"], "line 2, column meas_x_m: .*got '1e999'"),
    "blank command": (
        [POSE, "0,0,,0"],
        "line 2, column cmd_z_m: expected a number in every row, got an empty "
        "cell; fill it or drop the row",
    ),
    "blank length": (
        [LENGTHS + ",meas_x_m", "1,1,1,1,0", "1,,1,1,0"],
        "line 3, column length_2_m: .*got an empty cell",
    ),
    "blank time": (["t_s," + POSE, ",0,0,0,0"], "line 2, column t_s: .*got an empty cell"),
    "blank temperature": (
        ["temperature_C," + POSE, "20,0,0,0,0", ",0,0,0,0"],
        "line 3, column temperature_C: .*got an empty cell",
    ),
    "blank run": (
        ["run," + POSE, "a,0,0,0,0", ",0,0,0,0"],
        "line 3, column run: expected the name of a run in every row, got an empty cell",
    ),
    "cold": (
        ["temperature_C," + POSE, "-300,0,0,0,0"],
        "line 2, column temperature_C: expected a temperature above -273.15 C, got -300 C",
    ),
    "length zero": (
        [LENGTHS + ",meas_x_m", "1,1,0,1,0"],
        "line 2, column length_3_m: expected a length above zero, got 0 m",
    ),
    "norm": (
        [QUAT, "0,0,0,1,0,0,0", "0,0,0,0.9,0,0,0"],
        "line 3, column meas_qw: expected a unit quaternion, scalar first, got 0.9 "
        "0 0 0 with norm 0.9;",
    ),
    "zero quaternion": ([QUAT, "0,0,0,0,0,0,0"], "line 2, column meas_qw: .* with norm 0;"),
    "quaternion cells half there": (
        [QUAT, "0,0,0,1,0,,0"],
        "line 2, column meas_qy: quaternion half there; expected all four cells "
        "filled or all four empty",
    ),
    "time falls": (
        ["run,t_s," + POSE, "a,0,0,0,0,0", "a,4.5,0,0,0,0", "a,3,0,0,0,0"],
        "line 4, column t_s: rows out of time order: expected 4.5 s or later within "
        "run 'a', got 3 s; sort the rows by time",
    ),
    "run comes back": (
        ["run," + POSE, "a,0,0,0,0", "b,0,0,0,0", "a,0,0,0,0"],
        "line 4, column run: rows out of time order: run 'a' ended at line 2 and "
        "comes back here; expected the rows of a run together",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_mistakes_get_one_sentence_with_their_place(csv_file, robot, case):
    lines, expected = REFUSED[case]
    path = csv_file(*lines)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert caught.value.exit_status == 2


def test_norm_tolerance_lies_between_rounding_and_mistake(csv_file, robot):
    load_measurements(csv_file(QUAT, "0,0,0,1.0009,0,0,0"), robot)
    with pytest.raises(InputFileError, match=r"with norm 1\.0011"):
        load_measurements(csv_file(QUAT, "0,0,0,1.0011,0,0,0"), robot)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"\x89PNG\r\n\x1a\n\0\0", "is a PNG picture; expected a CSV file in UTF-8"),
        (b"PK\x03\x04\x14\0", "is a zip archive or an Excel workbook; expected"),
        (b"%PDF-1.7\n", "is a PDF; expected"),
        (b"RRF2\0\0", "is a Rerun recording; expected"),
        ("run,cmd_x_m\n".encode("utf-16"), "is UTF-16 text; expected"),
        (b"\x01\x02\0\x03", "is a binary file; expected"),
        (
            b"run,meas_x_m\n# caf\xe9\na,0\n",
            r"line 2: byte 0xE9 \(number 19 of the file\) is not UTF-8; expected text in UTF-8",
        ),
        (b"PAR1 and then nothing", "cannot be read as Parquet"),
    ],
)
def test_files_of_another_kind(tmp_path, robot, content, expected):
    path = tmp_path / "measured.csv"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder(tmp_path, robot):
    with pytest.raises(InputFileError, match=r"nowhere\.csv: no such file; expected a CSV file"):
        load_measurements(tmp_path / "nowhere.csv", robot)
    with pytest.raises(InputFileError, match="is a folder; expected a CSV file"):
        load_measurements(tmp_path, robot)


# ---------------------------------------------------------------- noise


def test_sigma_beside_the_data_or_named(csv_file, robot, tmp_path):
    path = csv_file(POSE, "0,0,0,0")
    (tmp_path / "measured.toml").write_text("[sigma]\nposition_m = 3e-5\nlength_m = 1\n")
    (tmp_path / "other.toml").write_text("[sigma]\ntension_N = 2.5\n[mine]\nname = 'x'\n")
    assert load_measurements(path, robot).sigma == Sigma(position_m=3e-5, length_m=1.0)
    other = load_commands(path, robot, sigma_path=tmp_path / "other.toml")
    assert other.sigma == Sigma(tension_N=2.5)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[sigma]\nposition_m = \n", "measured.toml: is not TOML: .*line 2"),
        (
            "[sigma]\nposition_m = 0\n",
            r'line 2: position_m must be a positive number \[m\] or a text such as "0.5mm", got 0;',
        ),
        (
            "[sigma]\n\ntension_N = -1.5\n",
            r'line 3: tension_N must be a positive number \[N\] or a text such as "1N", got -1.5',
        ),
        (
            "[sigma]\nposition_m = '3 N'\n",
            "line 2: position_m: expected a number with its unit .m, cm, mm, .*got unit 'N'",
        ),
        ("lengths = 'tolled'\n", "line 1: lengths must be .absolute. or .told., got 'tolled'"),
        ("start = 3\n", "line 1: start must be .reference. or .first_row., got 3"),
        ("lenghts = 'told'\n", "line 1: unknown key lenghts; expected lengths$"),
        ("[sigma]\nposition_m = nan\n", "line 2: position_m must be .* got nan"),
        ("[sigma]\nlength_m = inf\n", "got inf"),
        ("[sigma]\nlength_m = true\n", "got True"),
        (
            "[sigma]\nposition_mm = 3\n",
            "line 2: unknown key position_mm in .sigma.; known are position_m, ",
        ),
        ("[sigma]\norient_rad = 3\n", "known are orientation_rad, .*position_m"),
        ("position_m = 3e-5\n", r"line 1: position_m stands outside \[sigma\]; put it under that"),
        ("[Sigmas]\nposition_m = 3e-5\n", r"line 1: unknown table \[Sigmas\]; expected \[sigma\]"),
        ("sigma = 3\n", r"line 1: sigma must be a table, \[sigma\]"),
    ],
)
def test_mistakes_in_sigma(csv_file, robot, tmp_path, text, expected):
    path = csv_file(POSE, "0,0,0,0")
    (tmp_path / "measured.toml").write_text(text)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    assert str(caught.value).startswith(f"{tmp_path / 'measured.toml'}: ")
    assert "\n" not in str(caught.value)


def test_named_sigma_must_exist_and_be_text(csv_file, robot, tmp_path):
    path = csv_file(POSE, "0,0,0,0")
    with pytest.raises(InputFileError, match=r"none\.toml: no such file; expected a TOML file"):
        load_measurements(path, robot, sigma_path=tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b"# \xe9\n")
    with pytest.raises(InputFileError, match=r"is not UTF-8 \(byte number 3\)"):
        load_measurements(path, robot, sigma_path=tmp_path / "latin.toml")


# ---------------------------------------------------------------- writing and Parquet


def everything(path: Path) -> Measurements:
    rng = np.random.default_rng(5)
    quat = rng.normal(size=(6, 4))
    tensions = np.full((6, 4), np.nan)
    tensions[:, 1] = rng.uniform(0, 9, 6)
    position = rng.normal(size=(6, 3))
    position[2] = np.nan
    return Measurements(
        path=path,
        n_cables=4,
        run=np.array(["#a"] * 3 + ['b, "c"'] * 3),
        t_s=np.arange(6.0),
        command_lengths=rng.uniform(1, 2, (6, 4)),
        position=position,
        quat_wxyz=quat / np.linalg.norm(quat, axis=1, keepdims=True),
        tensions=tensions,
        temperature_C=np.linspace(-5, 25, 6),
        sigma=Sigma(position_m=3e-5, length_m=0.1 + 0.2),
    )


def test_round_trip_through_a_file(tmp_path, robot):
    made = everything(tmp_path / "measured.csv")
    write_measurements(made.path, made)
    back = load_measurements(made.path, robot)
    for name in ("t_s", "command_lengths", "position", "quat_wxyz", "tensions", "temperature_C"):
        np.testing.assert_allclose(getattr(back, name), getattr(made, name), rtol=1e-8, atol=1e-9)
    assert back.run.tolist() == made.run.tolist()
    assert back.sigma == made.sigma
    assert back.tension_mask.tolist() == [False, True, False, False]
    assert back.command_pose is None and back.line.tolist() == [2, 3, 4, 5, 6, 7]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["measured.csv", "measured.toml"]


def test_partial_angles_round_trip(tmp_path, robot):
    pose = np.tile([0.1, 0, 0, 1.0, 0, 0, 0], (2, 1))
    angles = np.array([[0.1, np.nan, -0.0], [0.25, np.nan, np.nan]])
    made = Measurements(
        tmp_path / "m.csv", 4, np.array(["a", "a"]), command_pose=pose, angles_rad=angles
    )
    write_measurements(made.path, made)
    header = "run,cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz,meas_rx_rad,meas_rz_rad"
    rows = "a,0.1,0,0,1,0,0,0,0.1,0\na,0.1,0,0,1,0,0,0,0.25,\n"
    assert made.path.read_text() == f"{header}\n{rows}"
    assert np.array_equal(load_measurements(made.path, robot).angles_rad, angles, equal_nan=True)


def test_writing_again_leaves_no_old_sigma(tmp_path, robot):
    made = everything(tmp_path / "measured.csv")
    write_measurements(made.path, made)
    pose = np.tile([0.1, 0, 0, 1.0, 0, 0, 0], (1, 1))
    plain = Measurements(made.path, 4, np.array(["a"]), command_pose=pose, position=pose[:, :3])
    write_measurements(made.path, plain)
    assert load_measurements(made.path, robot).sigma == Sigma()


def test_unwritable_folder_leaves_nothing(tmp_path):
    made = everything(tmp_path / "nowhere" / "measured.csv")
    with pytest.raises(InputFileError, match=r"measured.csv: cannot be written: No such file"):
        write_measurements(made.path, made)
    (tmp_path / "measured.csv").mkdir()
    with pytest.raises(InputFileError, match="cannot be written: Is a directory"):
        write_measurements(tmp_path / "measured.csv", made)
    assert [p.name for p in tmp_path.iterdir()] == ["measured.csv"]


def test_half_of_the_commands_or_wrong_shapes_are_refused_in_code(tmp_path):
    with pytest.raises(ValueError, match="exactly one of command_pose and command_lengths"):
        Measurements(tmp_path, 4, np.array(["a"]))
    with pytest.raises(ValueError, match=r"command_lengths must be \(1, 4\), got \(1, 3\)"):
        Measurements(tmp_path, 4, np.array(["a"]), command_lengths=np.ones((1, 3)))


def parquet_file(path: Path, columns: dict[str, list]) -> Path:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(columns), path)
    return path


def test_parquet_has_the_same_columns(tmp_path, robot):
    columns = {
        "run": ["a", "a"],
        "cmd_x_mm": [1, 2],
        "cmd_y_m": [0.1, 0.2],
        "cmd_z_m": [0.1, 0.3],
        "meas_x_m": [None, 0.1 + 0.2],
        "remark": ["x", None],
    }
    data = load_measurements(parquet_file(tmp_path / "measured.parquet", columns), robot)
    assert data.command_pose[:, 0].tolist() == [0.001, 0.002]
    assert np.isnan(data.position[0, 0]) and data.position[1, 0] == 0.1 + 0.2
    assert data.unused_columns == ("remark",)
    assert data.line.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            {"meas_x_m": [0.0, float("inf")]},
            "measured.parquet: row 2, column meas_x_m: .*got 'inf'",
        ),
        ({"cmd_y_m": [None, 1.0]}, "row 1, column cmd_y_m: .*got an empty cell"),
        ({"cmd_y_in": [1.0, 1.0]}, "measured.parquet: column cmd_y_in: unknown unit 'in'"),
        ({"meas_x_m": ["1.5", "b"]}, "row 2, column meas_x_m: .*got 'b'"),
        ({"t_s": [2.0, 1.0]}, "row 2, column t_s: rows out of time order"),
        (
            {k: [] for k in ("cmd_x_m", "cmd_y_m", "cmd_z_m", "meas_x_m")},
            "has columns but no rows; expected one row per resting pose",
        ),
    ],
)
def test_mistakes_in_parquet(tmp_path, robot, change, expected):
    columns = {k: [0.5, 1.5] for k in ("cmd_x_m", "cmd_y_m", "cmd_z_m", "meas_x_m")} | change
    path = parquet_file(tmp_path / "measured.parquet", columns)
    with pytest.raises(InputFileError, match=expected):
        load_measurements(path, robot)


# ---------------------------------------------------------------- trial data


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


def test_lengths_for_another_robot(csv_file, robots):
    with pytest.raises(InputFileError, match="expected all 8 cables of the robot, length_5_m"):
        load_measurements(csv_file(LENGTHS + ",meas_x_m", "1,1,1,1,0"), robots["eight"])


def test_measurements_show_themselves(csv_file, robot):
    data = load_measurements(
        csv_file(CMD + ",meas_x_mm,tension_2_N", "0,0,0,500,", "1,0,0,,3"), robot
    )
    assert str(data).splitlines()[0] == "measured.csv: 2 rows in 1 run, positions, tensions"
    assert [row["meas_x_m"] for row in data.records()] == [0.5, None]
    assert [row["tension_2_N"] for row in data.records()] == [None, 3.0]
    assert "meas_y_m" not in data.records()[0] and data.records()[1]["cmd_x_m"] == 1.0
    assert data.to_frame().num_rows == 2
