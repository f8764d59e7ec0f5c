"""Reading measurements: units, parts of a pose, and what is assumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_csv import CMD, POSE

from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import commands_of, load_commands, load_measurements
from seecr.commands import Loads
from seecr.errors import InputError, InputFileError
from seecr.pose import quat_from_rxyz, quat_rotate, quat_to_matrix

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
