"""Files of measurements are read: units, orders, clocks, loads, missing readings and marks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from measured_csv import CMD, POSE

from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import commands_of, load_commands, load_measurements
from seecr.columns.csv import Table
from seecr.columns.known import know_columns
from seecr.commands import Loads
from seecr.description.joints import off_joints
from seecr.errors import InputError, InputFileError
from seecr.pose import (
    quat_from_rotvec,
    quat_from_rxyz,
    quat_multiply,
    quat_rotate,
    quat_to_matrix,
    rxyz_from_quat,
)

NO_TURN = "No commanded orientation: that of the reference pose is used."


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
    assert data.notes == (NO_TURN,)


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
    x, _, z = robots["arm"].reference_pose[:3]
    path = csv_file("run,cmd_x_m,cmd_z_m,meas_x_m", f"a,{x},{z},0.3")
    assert load_measurements(path, robots["arm"]).command_pose[0, 1] == 0.05
    with pytest.raises(InputFileError, match="line 2: the joints of robot small cannot reach"):
        load_measurements(csv_file("cmd_x_m,cmd_z_m,meas_x_m", f"{x},{z + 0.2},0"), robots["arm"])
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_z_m, cmd_z_m missing"):
        load_measurements(csv_file("cmd_x_m,meas_x_m", "0,0"), robots["arm"])


def test_sliding_robot_keeps_its_reference_orientation(csv_file, robots):
    data = load_measurements(csv_file("run,cmd_x_m,cmd_z_m,meas_x_m", "a,1,2,3"), robots["slides"])
    assert data.command_pose[0] == pytest.approx([1, 0.05, 2, 0.8, 0, 0.6, 0])
    # A body turned about the vertical takes its slides along: now it moves in y as well, as far as
    # x says.
    data = load_measurements(data.path, robots["yawed"])
    assert "No cmd_y: the joints determine it." in data.notes
    assert off_joints(robots["yawed"], data.command_pose) is None
    assert data.command_pose[0, [0, 2]] == pytest.approx([1, 2], abs=1e-12)
    assert abs(data.command_pose[0, 1] - 0.05) > 0.1


def test_a_hinge_turns_only_the_joints_after_it(csv_file, robots):
    path = csv_file("run,cmd_x_m,cmd_ry_deg,meas_x_m", "a,0.3,0,0.3")
    data = load_measurements(path, robots["slide then hinge"])
    assert data.command_pose[0] == pytest.approx([0.3, 0.05, 0, 1, 0, 0, 0])
    # the slide of a turned body: x and the angle tell how far it went, and so z
    data = load_measurements(
        csv_file("run,cmd_x_m,cmd_ry_deg,meas_x_m", "a,0.3,30,0.3"), robots["hinge then slide"]
    )
    assert off_joints(robots["hinge then slide"], data.command_pose) is None
    assert rxyz_from_quat(data.command_pose[0, 3:]) == pytest.approx([0, np.pi / 6, 0])
    assert data.command_pose[0, 0] == pytest.approx(0.3, abs=1e-12)


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
        "1 row has a command but no reading: a way point, which is not compared.",
    )
    more = csv_file(header, "a,0,0,0,1,1,0,0,0,", "a,0,0,0,,,,,,", "a,1,0,0,,,,,,")
    assert load_measurements(more, robot).notes[-1] == (
        "2 rows have a command but no reading: way points, which are not compared."
    )


def test_empty_quaternion_columns_are_not_measured(csv_file, robot):
    header = "run," + CMD + ",meas_x_m,meas_qw,meas_qx,meas_qy,meas_qz"
    data = load_measurements(csv_file(header, "a,0,0,0,1,,,,"), robot)
    assert data.quat_wxyz is None and not data.has_orientation
    assert data.notes[-1] == "Columns meas_qw to meas_qz are empty: not measured."


def test_any_part_of_a_pose_may_be_wanted(csv_file, robot, robots):
    head = f"{CMD},meas_x_m,want_x_mm,want_z_m,want_qw,want_qx,want_qy,want_qz"
    data = load_measurements(csv_file(head, "0,0,0,1,100,0.2,0,1,0,0", "0,0,0,1,,0.3,,,,"), robot)
    nan = np.nan
    np.testing.assert_array_equal(
        data.wanted, [[0.1, nan, 0.2, 0, 1, 0, 0], [nan, nan, 0.3, nan, nan, nan, nan]]
    )
    assert data.unused_columns == () and data.notes[-1] == NO_TURN
    assert load_measurements(csv_file(f"{POSE}", "0,0,0,1"), robot).wanted is None
    planar = csv_file(f"{POSE},want_ry_deg", "0,0.05,0,1,90")
    turned = load_measurements(planar, robots["planar"]).wanted
    np.testing.assert_allclose(turned[0, 3:], np.sqrt([0.5, 0, 0.5, 0]), atol=1e-15)
    with pytest.raises(InputFileError, match="incomplete wanted pose columns: expected want_rx"):
        load_measurements(csv_file(f"{POSE},want_rx_deg", "0,0,0,1,90"), robot)
    with pytest.raises(InputFileError, match="line 2, column want_qx: incomplete quaternion"):
        load_measurements(csv_file(head, "0,0,0,1,100,0.2,0,,0,0"), robot)


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
    data = load_measurements(csv_file("," + CMD + ",meas_x_m,,", "0,1,2,3,4,5,"), robot)
    assert data.unused_columns == ("(column 1, without a name)", "(column 6, without a name)")


def test_other_peoples_columns_pass_without_a_suggestion(csv_file, robot):
    names = "operator,meas_y_std_m,run_number,t_motor"
    data = load_measurements(csv_file(f"run,{CMD},meas_y_m,{names}", "a,0,0,0,1,x,x,x,x"), robot)
    assert data.unused_columns == tuple(names.split(","))
    assert not any("did you mean" in note for note in data.notes)


def test_rows_are_a_subset(csv_file, robot):
    lines = ["a,0,0,0,0,1,", "a,1,0,0,0,2,7", "b,0,0,0,0,3,"]
    data = load_measurements(csv_file(f"run,t_s,{CMD},meas_x_m,tension_1_N", *lines), robot)
    for index in ([0, 2], np.array([True, False, True]), slice(0, 3, 2)):
        part = data.rows(index)
        assert part.position[:, 0].tolist() == [1, 3]
        assert part.run.tolist() == ["a", "b"] and part.line.tolist() == [2, 4]
        assert part.command_pose.shape == (2, 7) and part.n_rows == 2
    assert data.rows([2]).runs == ("b",)
    assert data.rows([2]).run_index.tolist() == [0]


def test_commands_need_no_readings(csv_file, robot):
    path = csv_file("run," + CMD, "a,0,0,0")
    data = load_commands(path, robot)
    assert not (data.has_position or data.has_orientation or data.has_tension)
    assert not data.read.any() and data.notes == (NO_TURN,)
    with pytest.raises(InputFileError, match="line 1: no measurement; expected readings"):
        load_measurements(path, robot)


def test_measurements_show_themselves(csv_file, robot):
    data = load_measurements(
        csv_file(CMD + ",meas_x_mm,tension_2_N", "0,0,0,500,", "1,0,0,,3"), robot
    )
    assert str(data).splitlines()[0] == "measured.csv: 2 rows in 1 run, positions, tensions"
    assert [row["meas_x_m"] for row in data.records()] == [0.5, None]
    assert [row["tension_2_N"] for row in data.records()] == [None, 3.0]
    assert "meas_y_m" not in data.records()[0] and data.records()[1]["cmd_x_m"] == 1.0
    assert data.to_frame().num_rows == 2


def test_commands_that_were_made_are_as_if_read(csv_file, robot):
    """Commands of a correction had been refused as "expected numbers, got a Commands"."""
    read = load_commands(
        csv_file(f"run,t_s,temperature_C,{CMD}", "a,0,20,0,0,0", "a,9,21,1,0,0", "b,20,22,0,0,1"),
        robot,
    )
    made = read.as_commands(robot)
    same = commands_of(made, robot)
    np.testing.assert_array_equal(same.command_pose, read.command_pose)
    assert same.run_index.tolist() == [0, 0, 1] and same.t_s.tolist() == [0, 9, 20]
    assert same.temperature_C.tolist() == [20, 21, 22] and same.line.tolist() == [2, 3, 4]
    loads = Loads.of(3, mass=np.array([0.0, 0.5, 0.0]))
    assert commands_of(replace(made, loads=loads), robot).loads is loads
    stands = np.array([False, True, False])
    assert commands_of(replace(made, stands=stands), robot).stands.tolist() == stands.tolist()
    lengths = np.full((3, 4), 0.5)
    told = commands_of(replace(made, lengths=lengths, told=True), robot)
    assert told.told and told.command_pose is None and told.command_lengths.tolist()[0] == [0.5] * 4
    lengths[1] = np.nan  # a row without an answer
    lost = replace(made, lengths=lengths, told=True)
    words = r"of the commands: expected finite lengths, got nan; leave out rows for which a .*found"
    with pytest.raises(InputError, match=f"^line 3 {words}"):
        commands_of(lost, robot)
    with pytest.raises(InputError, match=f"^pose 1 {words}"):
        commands_of(replace(lost, line=None), robot)
    rest = commands_of(lost.rows(np.array([0, 2])), robot)
    assert rest.line.tolist() == [2, 4] and rest.command_lengths.tolist() == [[0.5] * 4] * 2
    with pytest.raises(InputError, match="commands of several clocks; expected those of one file"):
        commands_of(replace(made, clock=np.arange(3)), robot)


def test_cables_are_read_by_their_names_too(csv_file, robot):
    """Tensions by name were left out without a word, lengths were "no command"."""
    header = ["cable3", "cable1", "cable2", "cable4"]
    lengths = ",".join(f"length_{name}_mm" for name in header)
    path = csv_file(f"{lengths},tension_cable2_N,tension_4_N", "1303,1301,1302,1304,7,9")
    data = load_measurements(path, robot)
    assert data.command_lengths[0] == pytest.approx([1.301, 1.302, 1.303, 1.304])
    assert np.array_equal(data.tensions[0], [np.nan, 7.0, np.nan, 9.0], equal_nan=True)
    twice = csv_file(f"{CMD},tension_cable2_N,tension_2_N", "0,0,0,7,7")
    with pytest.raises(InputFileError, match="column tension_2_N: says the same as ten"):
        load_measurements(twice, robot)
    bare = csv_file(f"{CMD},tension_cable2_kg", "0,0,0,7")
    expected = "unknown unit 'kg'; expected tension_cable2_N or tension_cable2_kN"
    with pytest.raises(InputFileError, match=expected):
        load_measurements(bare, robot)


RUN = f"run,{POSE}"
M = 4


def test_semicolons_with_decimal_commas_and_tabs_read_as_commas_do(csv_file, robot):
    rows = [RUN, "a,0.5,-.25,1e-1,1.125", "a,1,2,3,"]
    plain = load_measurements(csv_file(*rows), robot)
    european = [row.replace(",", ";").replace(".", ",") for row in rows]
    tabs = [row.replace(",", "\t") for row in rows]
    for lines in (european, [row.replace(",", ";") for row in rows], tabs):
        other = load_measurements(csv_file(*lines), robot)
        assert np.array_equal(other.command_pose, plain.command_pose)
        assert np.array_equal(other.position, plain.position, equal_nan=True)
    commas = [row.replace(",", "\t").replace(".", ",") for row in rows]
    assert np.array_equal(
        load_measurements(csv_file(*commas), robot).command_pose, plain.command_pose
    )


def test_what_is_no_number_of_ours_says_nothing_of_decimal_commas(csv_file, robot):
    """A run called 1.5, or a version in a column that nobody reads."""
    rows = [f"{RUN};version".replace(",", ";"), "1.5;0,5;-,25;0,1;1,125;2.7"]
    found = load_measurements(csv_file(*rows), robot)
    np.testing.assert_allclose(found.command_pose[0, :3], [0.5, -0.25, 0.1])
    assert found.run.tolist() == ["1.5"] and found.position[0, 0] == 1.125
    with pytest.raises(InputFileError, match="decimal comma"):
        load_measurements(csv_file(rows[0], "1.5;0,5;-.25;0,1;1,125;2.7"), robot)


def test_units_of_every_kind(csv_file, robot):
    header = "run,t_ms,cmd_x_cm,cmd_y_um,cmd_z_m,meas_x_cm,tension_1_kN,payload_g,payload_x_mm"
    header += ",payload_y_m,payload_z_m,force_x_kN,moment_z_Nm"
    data = load_measurements(csv_file(header, "a,1500,2,3000,0,2.5,0.02,250,4,0,0,0.001,7"), robot)
    assert data.t_s == [1.5] and data.tensions[0, 0] == 20.0 and data.position[0, 0] == 0.025
    assert data.command_pose is not None and data.loads is not None
    assert data.command_pose[0, :3] == pytest.approx([0.02, 0.003, 0.0])
    assert data.loads.mass == [0.25] and data.loads.centre.tolist() == [[0.004, 0.0, 0.0]]
    assert data.loads.wrench.tolist() == [[1.0, 0, 0, 0, 0, 7.0]]


def test_nan_is_a_reading_that_was_not_made(csv_file, robot):
    header = f"run,{CMD},meas_x_m,meas_qw,meas_qx,meas_qy,meas_qz"
    data = load_measurements(
        csv_file(header, "a,0,0,0,nan,1,0,0,0", "a,0,0,1,2,NaN,nan,,NaN"), robot
    )
    assert np.isnan(data.position[0, 0]) and data.position[1, 0] == 2.0
    assert data.quat_wxyz is not None and np.isnan(data.quat_wxyz[1]).all()
    with pytest.raises(InputFileError, match=r"column cmd_x_m: .*in every row, got 'nan'"):
        load_measurements(csv_file(RUN, "a,nan,0,0,0"), robot)


def test_the_toml_says_what_lengths_mean_where_runs_start_and_noise_with_its_unit(csv_file, robot):
    header = ",".join(f"length_{i}_m" for i in range(1, M + 1)) + ",meas_x_m"
    toml = """lengths = "told"
start = "first_row"
comment = "mine"
[sigma]
position_m = "0.1mm"
orientation_rad = "0.02 deg"
length_m = 1e-4
[operator]
name = "x"
"""
    data = load_measurements(csv_file(header, "1,1,1,1,0", toml=toml), robot)
    assert data.told and not data.absolute and data.stands.tolist() == [True]
    stated = Sigma(0.1 / 1000, data.sigma.orientation_rad, None, 1e-4)
    assert data.sigma == stated and stated.orientation_rad == pytest.approx(np.deg2rad(0.02))
    plain = load_measurements(csv_file(header, "1,1,1,1,0"), robot)
    assert plain.absolute and not plain.stands.any()
    poses = load_measurements(csv_file(RUN, "a,0,0,0,0", toml='lengths = "told"'), robot)
    assert not poses.told and 'lengths = "told" has no effect here' in " ".join(poses.notes)


def test_payloads_without_a_centre_hang_at_the_platforms_own(csv_file, robot):
    rows = ["a,0,0,0,0,0.5,,,", "a,0,0,1,0,0.5,0.1,0.2,0.3"]
    data = load_measurements(
        csv_file(f"{RUN},payload_kg,payload_x_m,payload_y_m,payload_z_m", *rows), robot
    )
    assert data.loads is not None
    assert np.isnan(data.loads.centre[0]).all() and data.loads.centre[1].tolist() == [0.1, 0.2, 0.3]
    bare = load_measurements(csv_file(f"{RUN},payload_kg", "a,0,0,0,0,0.5"), robot)
    assert bare.loads is not None and np.isnan(bare.loads.centre).all()


def test_a_name_is_guessed_by_its_spelling_alone(csv_file, robot):
    names = "meas_roll_deg,meas_pitch_deg,tension_A_N,mes_y_m,operator"
    data = load_measurements(csv_file(f"{RUN},{names}", "a,0,0,0,0,1,2,3,4,x"), robot)
    notes = " ".join(data.notes)
    assert "Column 'mes_y_m' is not used; did you mean meas_y_m?" in notes
    assert notes.count("did you mean") == 1
    assert (
        "Columns meas_roll_deg meas_pitch_deg are not used, because roll, pitch and yaw have "
        "several conventions: here a rotation is meas_rx_deg meas_ry_deg meas_rz_deg with "
        "R = Rx(rx) Ry(ry) Rz(rz), or the quaternion meas_qw meas_qx meas_qy meas_qz." in notes
    )
    assert "Column tension_A_N is not used: the robot's cables are 1 (cable1), " in notes
    assert "Not used: operator." in notes
    with pytest.raises(InputFileError, match=r"no measurement; .*R = Rx\(rx\) Ry\(ry\) Rz\(rz\)"):
        load_measurements(csv_file(f"{CMD},meas_yaw_deg", "0,0,0,1"), robot)


def test_rows_given_twice_are_said(csv_file, robot):
    rows = ["a,0,0,0,1.5", "a,0,0,1,1.5", "b,0,0,0,1.5", "b,0,0,1,"]
    notes = load_measurements(csv_file(RUN, *rows, "c,0,0,1,"), robot).notes
    assert [note for note in notes if "twice" in note] == [
        "Identical rows: line 4 as 2; they count twice, so remove one of each pair if it was "
        "measured only once."
    ]


def test_millimetres_in_a_metre_column(csv_file, robot):
    with pytest.raises(
        InputFileError,
        match=r"line 3, column cmd_y_m: far outside the robot: expected numbers of the size of its "
        r"frame, .* m across, got 500 m; are these really m\? Name .* cmd_y_mm",
    ):
        load_measurements(csv_file(RUN, "a,0,0,0,0", "a,0,500,0,0"), robot)
    size = float(np.ptp(robot.exit_points, axis=0).max())
    notes = load_measurements(csv_file(RUN, f"a,{5 * size},0,0,0"), robot).notes
    assert any("Line 2: a command" in note and "check its unit" in note for note in notes)


def quaternions(prefix: str, quat: np.ndarray) -> list[str]:
    header = ",".join(f"{prefix}_q{c}" for c in "wxyz")
    return [header, *(",".join(f"{v:.12g}" for v in row) for row in quat)]


def test_a_quaternion_in_another_order(csv_file, robot):
    turn = quat_from_rotvec(np.random.default_rng(0).uniform(-0.2, 0.2, (5, 3)))
    right = quat_multiply(turn, np.tile(robot.reference_pose[3:], (5, 1)))
    for order, wrong in ((right, False), (np.roll(right, -1, axis=1), True)):
        lines = [
            f"{head},{quat}"
            for head, quat in zip(
                [RUN, *(f"a,0,0,{0.1 * k},0" for k in range(5))], quaternions("cmd", order),
                strict=True,
            )
        ]  # fmt: skip
        if wrong:
            with pytest.raises(InputFileError, match="column cmd_qw: every command turns the plat"):
                load_measurements(csv_file(*lines), robot)
        else:
            load_measurements(csv_file(*lines), robot)
        read = [line.replace("cmd_q", "meas_q") for line in lines]
        notes = " ".join(load_measurements(csv_file(*read), robot).notes)
        assert ("are meas_qw meas_qx meas_qy meas_qz in the right order?" in notes) == wrong


FORMATS = Path(__file__).resolve().parents[3] / "docs" / "formats.md"
REFERENCE = FORMATS.read_text(encoding="utf-8").partition("## Measurements")[2]


def block(language: str) -> str:
    return REFERENCE.partition(f"```{language}\n")[2].partition("```")[0]


def test_the_reference_s_examples_are_read(csv_file, robot):
    data = load_measurements(csv_file(block("text"), toml=block("toml")), robot)
    assert data.read.tolist() == [True, False, True] and data.stands.all()
    assert data.sigma.position_m == pytest.approx(3e-5) and data.sigma.length_m == 1e-4
    assert data.loads is not None and data.loads.mass.tolist() == [0.0, 0.0, 0.2]
    assert data.unused_columns == () and data.angle_mask.all()


def test_the_reference_s_columns_and_units_are_known():
    rows = [row.split("|") for row in REFERENCE.splitlines() if row.startswith("| `")]
    rows = [row for row in rows if len(row) == 5]  # those with units
    assert len(rows) == 14
    for _, columns, _, units, _ in rows:
        names = [name for name in re.findall(r"`([^`]+)`", columns) for name in name.split()]
        table = Table(Path("a.csv"), tuple(names), np.array([2]), 1, [["1"]] * len(names))
        if not {"cmd_qw", "cmd_rx_deg", "meas_qw", "want_qw", "length_1_m"} & set(names):
            assert know_columns(table, M).unused == ()
        for unit in re.findall(r"_(\w+)", units):
            quantity = names[0].rpartition("_")[0]
            column = Table(Path("a.csv"), (f"{quantity}_{unit}",), np.array([2]), 1, [["1"]])
            assert know_columns(column, M).known[quantity].unit.suffix == unit
