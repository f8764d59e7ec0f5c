"""Commands and loads are read from a CSV; what is wrong with one is said with line and column."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from robots import RECTANGLE

from crosscheck.measurements.read import load_commands
from seecr.columns.commands import CommandFile, known_loads, read_commands
from seecr.columns.plausible import check_commands
from seecr.description.joints import off_joints
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import Array, quat_from_rxyz

ROBOT = load_robot("demobot_cogiro")

LENGTHS = ",".join(f"length_{i}_mm" for i in range(1, 9))


def written(folder: Path, text: str) -> Path:
    path = folder / "poses.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_poses_in_any_unit_order_and_separator(tmp_path: Path) -> None:
    names = "note;cmd_z_mm;cmd_x_m;cmd_y_cm;cmd_ry_deg;cmd_rx_deg;cmd_rz_rad;t_s"
    text = f"# a note\n{names}\nabc;100;0,4;25;90;0;0;1,5\n"
    read = read_commands(written(tmp_path, text), ROBOT)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(read.commands.pose, [[0.4, 0.25, 0.1, half, 0, half, 0]], atol=1e-15)
    assert read.commands.time is not None and read.commands.time.tolist() == [1.5]
    assert read.commands.lengths is None and read.wanted is None


def test_lengths_with_the_poses_they_are_for(tmp_path: Path) -> None:
    text = f"run,want_x_m,want_y_m,want_z_m,{LENGTHS}\n" + "\n".join(
        f"{run},0.3,0.2,0.1," + ",".join(["500"] * 8) for run in "aab"
    )
    read = read_commands(written(tmp_path, text), ROBOT)
    assert read.commands.lengths is not None
    np.testing.assert_array_equal(read.commands.lengths, np.full((3, 8), 0.5))
    np.testing.assert_array_equal(read.commands.pose[:, :3], [[0.3, 0.2, 0.1]] * 3)
    assert read.run == ("a", "a", "b") and read.commands.starts.tolist() == [True, False, True]


@pytest.mark.parametrize("cells", ["0.3,", ","])
def test_any_part_of_a_wanted_pose_may_be_missing(tmp_path: Path, cells: str) -> None:
    """As in measurements, which ``compare`` reads: their files were refused here."""
    lengths = ",".join(["500"] * 8)
    text = f"want_x_m,want_y_m,{LENGTHS}\n0.4,0.25,{lengths}\n{cells},{lengths}\n"
    path = written(tmp_path, text)
    read = read_commands(path, ROBOT)
    assert "no deviations are given" in " ".join(read.notes)
    assert read.wanted is not None and np.isnan(read.wanted[:, 2:]).all()
    begun = load_commands(path, ROBOT).as_commands(ROBOT).pose
    np.testing.assert_array_equal(read.commands.pose, begun)
    np.testing.assert_array_equal(read.commands.pose[0, :3], [0.4, 0.25, ROBOT.reference_pose[2]])


def test_what_commanded_poses_were_for_does_not_count(tmp_path: Path) -> None:
    text = "want_x_m,want_y_m,cmd_x_m,cmd_y_m,cmd_z_m\n,0.1,0.3,0.2,0.1\n"
    read = read_commands(written(tmp_path, text), ROBOT)
    assert read.wanted is None and not any("want" in note for note in read.notes)
    np.testing.assert_array_equal(read.commands.pose[:, :3], [[0.3, 0.2, 0.1]])


def test_a_planar_robot_needs_no_third_coordinate(tmp_path: Path) -> None:
    planar = load_robot("planar_vertical")
    read = read_commands(written(tmp_path, "cmd_x_m,cmd_z_m\n0.3,0.2\n"), planar)
    np.testing.assert_array_equal(read.commands.pose, [[0.3, 0, 0.2, 1, 0, 0, 0]])


def test_the_toml_beside_says_what_lengths_mean_and_where_runs_start(tmp_path: Path) -> None:
    path = written(tmp_path, f"{LENGTHS}\n" + ",".join(["500"] * 8))
    assert not read_commands(path, ROBOT).commands.told
    beside = path.with_suffix(".toml")
    beside.write_text('lengths = "told"\nstart = "first_row"\n')
    commands = read_commands(path, ROBOT).commands
    assert commands.told and commands.starts_here.tolist() == [True]
    beside.write_text('start = "anywhere"\n')
    with pytest.raises(InputFileError, match='line 1: start must be "reference" or "first_row"'):
        read_commands(path, ROBOT)


# What is wrong with columns and cells is held by the tests of what reads measurements, which is
# the same reader; these are of commands alone.
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "line 1: no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or length_1"),
        ("cmd_x_m,cmd_y_m\n1,2\n", "incomplete commanded pose columns: expected cmd_x_m cmd_y_m "
         "cmd_z_m, cmd_z_m missing"),
        (f"want_qw,want_qx,{LENGTHS}\n1,0," + ",".join(["500"] * 8),
         "incomplete quaternion columns: expected all four or none, want_qy want_qz missing"),
        ("want_qw,want_rx_deg,cmd_x_m\n1,0,0\n",
         "the orientation is given twice, as want_qw and as want_rx_d"),
        ("cmd_x_m,cmd_y_m,cmd_z_m\n1,2,nan\n", "line 2, column cmd_z_m: expected a number in "
         "every row, got 'nan'"),
        (f"{LENGTHS}\n" + ",".join(["-1"] * 8), "column length_1_mm: expected a length above zero"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputFileError) as error:
        read_commands(path, ROBOT)
    assert str(error.value).startswith(f"{path}: ") and words in str(error.value)


# --- Commands on joints: coordinates that these determine, and digits that were rounded


TILT = np.radians(12.0)
UP = f"0 {np.sin(TILT)} {np.cos(TILT)}"
SLIDES = f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="{UP}"/>'
HINGE = '<joint type="hinge" axis="0 0.6 0.8" pos="0 0 -0.5"/>'


def robot_on(folder: Path, joints: str) -> Robot:
    """A platform of four cables in a plane that leans by 12 degrees, or on other joints."""
    corners = [(x, np.sin(TILT) * z, np.cos(TILT) * z) for x in (-1.5, 1.5) for z in (0.0, 2.4)]
    places = "".join(
        f'<site name="A{k}" pos="{x} {y} {z}"/>' for k, (x, y, z) in enumerate(corners)
    )
    anchors = "".join(f'<site name="B{k}"/>' for k in range(4))
    cables = "".join(
        f'<spatial name="c{k}" springlength="0 1.9" stiffness="10000"><site site="A{k}"/>'
        f'<site site="B{k}"/></spatial>' for k in range(4)
    )  # fmt: skip
    home = f"0 {1.2 * np.sin(TILT)} {1.2 * np.cos(TILT)}"
    path = folder / "robot.xml"
    path.write_text(
        f'<mujoco><worldbody>{places}<body name="platform" pos="{home}">{joints}<inertial '
        f'pos="0 0 0" mass="9" diaginertia="1 1 1"/>{anchors}</body></worldbody>'
        f"<tendon>{cables}</tendon></mujoco>"
    )
    return load_robot(path)


def read(folder: Path, robot: Robot, *lines: str) -> CommandFile:
    path = folder / "poses.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_commands(path, robot)


ON_IT = [(x, float(np.tan(TILT) * z), z) for x, z in ((0.0, 1.1738), (0.4, 1.5), (-0.6, 0.7))]


def test_what_the_joints_determine_may_be_left_out(tmp_path: Path) -> None:
    robot = robot_on(tmp_path, SLIDES)
    found = read(tmp_path, robot, "cmd_x_m,cmd_z_m", *(f"{x},{z}" for x, _y, z in ON_IT))
    assert found.commands.pose[:, :3] == pytest.approx(np.array(ON_IT), abs=1e-12)
    assert "No cmd_y: the joints determine it." in found.notes
    # y and z say the same, x nothing of them
    found = read(tmp_path, robot, "cmd_x_m,cmd_y_m", *(f"{x},{y!r}" for x, y, _z in ON_IT))
    assert found.commands.pose[:, :3] == pytest.approx(np.array(ON_IT), abs=1e-9)
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_y_m cmd_z_m, cmd_x_m missing"):
        read(tmp_path, robot, "cmd_y_m,cmd_z_m", *(f"{y!r},{z}" for _x, y, z in ON_IT))


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_rounded_poses_are_projected(tmp_path: Path, digits: int) -> None:
    robot = robot_on(tmp_path, SLIDES)
    rows = [",".join(f"{1e3 * v:.{digits}f}" for v in place) for place in ON_IT]
    found = read(tmp_path, robot, "cmd_x_mm,cmd_y_mm,cmd_z_mm", *rows)
    assert off_joints(robot, found.commands.pose) is None
    off = np.abs(found.commands.pose[:, :3] - ON_IT).max()
    assert off < 10.0**-digits * 1e-3
    assert found.commands.pose[:, 1] == pytest.approx(
        np.tan(TILT) * found.commands.pose[:, 2], abs=1e-12
    )
    assert sum("are rounded: those that the joints reach are up to" in n
               for n in found.notes) == 1  # fmt: skip


def test_beyond_the_digits_the_distance_is_told(tmp_path: Path) -> None:
    robot = robot_on(tmp_path, SLIDES)
    with pytest.raises(InputFileError) as caught:
        read(tmp_path, robot, "cmd_x_mm,cmd_y_mm,cmd_z_mm", "0,249.5,1173.8", "0,249.0,1173.8")
    said = str(caught.value)
    # 0.499 mm too far forward leave 0.499 cos 12 = 0.488 mm to the plane, 0.477 of them in y
    assert "line 3: the joints of robot" in said and "off by 0.000477 m in y" in said
    assert "rounding of its digits explains 5e-05 m; expected" in said
    # whole metres explain no more than a thousandth of the frame
    with pytest.raises(InputFileError, match=r"line 2: .*off by 0\.203 m in y"):
        read(tmp_path, robot, "cmd_x_m,cmd_y_m,cmd_z_m", "0,0,1")


def test_rounded_turns_are_projected(tmp_path: Path) -> None:
    """A hinge about (0 0.6 0.8): angles and quaternions to a few digits are near its turns."""
    robot = robot_on(tmp_path, HINGE)
    half, axis = np.radians(10.0) / 2, np.array([0.0, 0.6, 0.8])
    quat = np.array([np.cos(half), *(np.sin(half) * axis)])
    turned = quat_of_places(robot, quat)
    row = ",".join(f"{v:.4f}" for v in (*turned, *quat))
    head = "cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz"
    pose = read(tmp_path, robot, head, row).commands.pose
    assert off_joints(robot, pose) is None
    assert pose[0] == pytest.approx([*turned, *quat], abs=2e-4)
    with pytest.raises(InputFileError, match="cannot reach the commanded pose: it is off by"):
        wrong = quat_from_rxyz(np.radians([0.5, 6.0, 8.0]))
        read(tmp_path, robot, head, ",".join(f"{v:.4f}" for v in (*turned, *wrong)))
    # the position alone says how far the hinge is turned
    found = read(tmp_path, robot, head[:23], ",".join(f"{v:.9f}" for v in turned))
    assert found.commands.pose[0, 3:] == pytest.approx(quat, abs=1e-7)
    assert "No commanded orientation: the joints determine it." in found.notes


def quat_of_places(robot: Robot, quat: np.ndarray) -> np.ndarray:
    """Where the origin goes that a hinge 0.5 m below it turns by a quaternion (Rodrigues)."""
    arm = np.array([0.0, 0.0, 0.5])
    turned = arm + 2 * np.cross(quat[1:], np.cross(quat[1:], arm) + quat[0] * arm)
    return robot.reference_pose[:3] - arm + turned


# --- Commands that are in another unit, or for another robot


HOME = RECTANGLE.reference_pose


def at(*places: tuple[float, float, float]) -> Array:
    """Poses (n, 7) at places, not turned."""
    return np.concatenate([np.array(places), np.tile(HOME[3:], (len(places), 1))], axis=1)


def check_places(unit: str, *places: tuple[float, float, float], per_metre: float = 1.0) -> None:
    """Check a file with these places in this unit."""
    header = ",".join(f"cmd_{axis}_{unit}" for axis in "xyz")
    rows = [",".join(f"{per_metre * value:.10g}" for value in place) for place in places]
    check_commands(columns_of(header, *rows), RECTANGLE, at(*places), None)


def check_lengths(unit: str, per_metre: float, *lengths: float) -> None:
    """Check a file with rows of four equal lengths."""
    header = ",".join(f"length_{i}_{unit}" for i in range(1, 5))
    rows = [",".join([f"{per_metre * length:.10g}"] * 4) for length in lengths]
    table = np.repeat(np.array(lengths)[:, None], 4, axis=1)
    check_commands(columns_of(header, *rows), RECTANGLE, None, table)


def test_commands_in_the_robot_pass_in_any_unit() -> None:
    for unit, per_metre in {"m": 1.0, "cm": 100.0, "mm": 1000.0}.items():
        check_places(unit, (1.5, 2.0, -1.5), (0.5, 3.0, -1.0), per_metre=per_metre)
        check_lengths(unit, per_metre, 2.5, 2.6)


def test_a_command_ten_frames_away_is_refused_and_not_one_just_inside() -> None:
    """The frame is 5 m across, and its middle at x = 1.5 m."""
    check_places("m", (51.4, 2.0, -1.5))
    with pytest.raises(InputFileError, match=r"line 3, column cmd_x_m: .* got 51\.6 m; are these"):
        check_places("m", (51.4, 2.0, -1.5), (51.6, 2.0, -1.5))
    with pytest.raises(InputFileError, match=r"column cmd_y_m: .* 5 m across, got -48\.1 m"):
        check_places("m", (1.5, -48.1, -1.5))
    with pytest.raises(InputFileError, match=r"line 2, column length_1_m: .* got 50\.1 m"):
        check_lengths("m", 1.0, 50.1)


@pytest.mark.parametrize(("unit", "per_metre", "hint"), [
    ("m", 1.0, r"really m\? Name the column by its unit, such as cmd_z_mm$"),
    ("cm", 100.0, r"really cm\? Name the column by its unit, such as cmd_z_mm$"),
    ("mm", 1e3, r"really mm\? Name the column by its unit, such as cmd_z_um$"),
    ("um", 1e6, r"really um\?$"),
])  # fmt: skip
def test_the_likeliest_smaller_unit_is_proposed(unit: str, per_metre: float, hint: str) -> None:
    with pytest.raises(InputFileError, match=hint):
        check_places(unit, (1.5, 2.0, 1500.0), per_metre=per_metre)


@pytest.mark.parametrize(("name", "cell"), [
    ("cmd_x_mm", "1.5"),
    ("cmd_x_mm", "6.4"),
    ("cmd_x_cm", "1.5"),
    ("cmd_x_cm", "4.9"),
])  # fmt: skip
def test_metres_under_the_name_of_a_smaller_unit_are_refused(name: str, cell: str) -> None:
    """1.5 mm is at the origin, where no command is; 1.5 m is in the middle of the robot."""
    unit = name[-2:]
    said = rf"line 2, column {name}: .* at most {cell} {unit}; are .* such as cmd_x_m$"
    poses = at((float(cell) / {"mm": 1000.0, "cm": 100.0}[unit], 2.0, -1.5))
    with pytest.raises(InputFileError, match=said):
        check_commands(columns_of(name, cell), RECTANGLE, poses, None)


def test_short_lengths_are_metres_too() -> None:
    said = r"column length_1_mm: .* at most 2\.5 mm; .* such as length_1_m$"
    with pytest.raises(InputFileError, match=said):
        check_lengths("mm", 1000.0, 2.5e-3)


@pytest.mark.parametrize(("name", "cells", "middle"), [
    ("cmd_x_cm", ("1.5", "5.1"), 1.5),  # 5.1 cm is more than a hundredth of the frame
    ("cmd_x_mm", ("1.5", "6.6"), 1.5),  # 6.6 m would be outside
    ("cmd_x_mm", ("0", "0"), 1.5),  # nothing is nothing in every unit
    ("cmd_x_mm", ("1.5", "2"), 0.4),  # the robot's middle is near its origin
])  # fmt: skip
def test_small_numbers_that_may_be_right_pass(
    name: str, cells: tuple[str, str], middle: float
) -> None:
    home = HOME.copy()
    home[0] = middle
    robot = replace(RECTANGLE, reference_pose=home)
    columns = columns_of(name, *cells)
    poses = at(*((value, 2.0, -1.5) for value in columns.numbers("cmd_x").tolist()))
    check_commands(columns, robot, poses, None)


def test_a_robot_that_most_commands_are_outside_of_is_another() -> None:
    """Half of them are 6 m away; of three commands nobody can tell."""
    inside, outside = (1.5, 2.0, -1.5), (1.5, 2.0, 4.5)
    check_places("m", outside, outside, outside)
    check_places("m", outside, outside, inside, inside, inside)
    said = r"most commands are outside the frame of robot rectangle: half of them are 6 m or more"
    with pytest.raises(InputFileError, match=said):
        check_places("m", inside, outside, outside, outside)


# --- Known loads from columns: which number acts where, and what no robot carries


# A twentieth of E S of all four cables, and ten times the platform's weight.
MOST = 0.05 * 4 * 1000.0


def test_each_column_acts_along_its_own_axis() -> None:
    columns = columns_of(
        "moment_z_Nm,force_y_N,payload_kg,moment_x_Nm,force_x_kN", "6,2,0.5,4,0.001", n_cables=4
    )
    loads = known_loads(columns, RECTANGLE)
    assert loads is not None and loads.mass.tolist() == [0.5]
    assert loads.wrench.tolist() == [[1.0, 2.0, 0.0, 4.0, 0.0, 6.0]]


def test_forces_that_are_all_zero_are_no_loads_but_a_payload_of_nothing_is_one() -> None:
    assert known_loads(columns_of("force_x_N,moment_y_Nm", "0,0", "0,0"), RECTANGLE) is None
    assert known_loads(columns_of("payload_kg", "0"), RECTANGLE) is not None


# 10 m/s^2 of gravity, and 5 m from corner to corner
@pytest.mark.parametrize(
    ("name", "most"),
    [("payload_kg", MOST / 10.0), ("force_z_N", MOST), ("moment_y_Nm", MOST * 5.0)],
)
def test_the_most_is_what_would_strain_all_cables_by_a_twentieth(name: str, most: float) -> None:
    assert known_loads(columns_of(name, f"{most}"), RECTANGLE) is not None
    said = re.escape(f"at most {most:.3g} ")
    with pytest.raises(InputFileError, match=f"line 3, column {name}: .*{said}"):
        known_loads(columns_of(name, "0", f"{1.001 * most}"), RECTANGLE)


def test_soft_cables_carry_what_they_carry_already() -> None:
    """Of a heavy platform, or their own tension, ten times; a twentieth of E S would be less."""
    heavy = replace(RECTANGLE, mass=50.0)
    assert known_loads(columns_of("payload_kg", "500"), heavy) is not None
    with pytest.raises(InputFileError, match="at most 500 kg"):
        known_loads(columns_of("payload_kg", "501"), heavy)
    tight = replace(RECTANGLE, rest_lengths=np.full(4, 2.0))
    assert known_loads(columns_of("force_x_N", "-10000"), tight) is not None
    with pytest.raises(InputFileError, match="at most 1e"):
        known_loads(columns_of("force_x_N", "-10001"), tight)


@pytest.mark.parametrize(
    ("name", "cell", "guess"),
    [
        ("payload_kg", "300", r"got 300 kg; is it in g\? Name the column payload_g$"),
        ("payload_g", "300000", r"got 300 kg; check it$"),
        ("force_z_kN", "-0.3", r"got -300 N; is it in N\? Name the column force_z_N$"),
    ],
)
def test_the_unit_that_a_load_may_be_in_is_named(name: str, cell: str, guess: str) -> None:
    """300 g were taken for 300 kg, and cables stretched by a quarter without a word."""
    with pytest.raises(InputFileError, match=f"line 3, column {name}: .*{guess}"):
        known_loads(columns_of(name, "0", cell), RECTANGLE)


def test_a_payload_of_many_times_the_platform_is_noted() -> None:
    stiff = replace(RECTANGLE, ea=np.full(4, 1e6))
    for name, cell, notes in [
        ("payload_kg", "10.1", ["Column payload_kg is up to 10.1 kg, 5.05 times the mass of the "
                                "platform: if it is in g, name it payload_g."]),
        ("payload_kg", "9.9", []), ("payload_g", "10100", []),
    ]:  # fmt: skip
        columns = columns_of(name, "0", cell)
        assert known_loads(columns, stiff) is not None
        assert [note for note in columns.notes if "mass" in note] == notes


def test_without_gravity_a_payload_weighs_nothing() -> None:
    floating = replace(RECTANGLE, gravity=np.zeros(3))
    assert known_loads(columns_of("payload_kg", "1e6"), floating) is not None


def test_a_payload_may_take_mass_away_but_not_all_of_it() -> None:
    loads = known_loads(columns_of("payload_kg", "-1.999"), RECTANGLE)
    assert loads is not None and loads.mass.tolist() == [-1.999]
    with pytest.raises(InputFileError, match=r"some of its 2 kg, got -2 kg"):
        known_loads(columns_of("payload_kg", "-2"), RECTANGLE)


def test_a_centre_is_as_far_from_the_nearest_anchor_point_as_the_frame_is_large() -> None:
    names = "payload_kg,payload_x_m,payload_y_m,payload_z_m"
    assert known_loads(columns_of(names, "1,5.29,0.4,0"), RECTANGLE) is not None
    with pytest.raises(InputFileError, match=r"column payload_x_m: .* 5\.01 m from its anchor"):
        known_loads(columns_of(names, "1,5.31,0.4,0"), RECTANGLE)
