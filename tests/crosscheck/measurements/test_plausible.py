"""What no single cell shows: units, orders and rows that are odd, numbers that nobody read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from robots import RECTANGLE

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.plausible import check_readings
from crosscheck.measurements.read import load_commands, load_measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import quat_from_rotvec, quat_from_rxyz, quat_multiply, rxyz_from_quat

HOME = RECTANGLE.reference_pose
# Five commands about the reference pose, with a spread of 0.1 m: the median distance.
WAY = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])


def poses(**along: np.ndarray) -> np.ndarray:
    out = np.tile(HOME, (5, 1))
    for axis, values in along.items():
        out[:, "xyz".index(axis)] += values
    return out


def notes_on(
    told: np.ndarray, unit: str = "m", free: tuple[str, ...] = (), **read: np.ndarray
) -> list[str]:
    """What is said of readings in SI units, such as ``position`` (n, 3), in columns of a unit."""
    tables = {
        "position": [f"meas_{axis}_{unit}" for axis in "xyz"],
        "quat_wxyz": ["meas_qw", "meas_qx", "meas_qy", "meas_qz"],
    }
    header = ",".join(name for table in read for name in tables[table])
    scale = {"m": 1.0, "mm": 1e3}[unit]
    values = np.hstack([scale * read[k] if k == "position" else read[k] for k in read])
    rows = [",".join("" if np.isnan(v) else f"{v:.12g}" for v in row) for row in values]
    run = np.full(len(told), "a")
    data = Measurements(Path("a.csv"), 4, run, command_pose=told, free=free, **read)  # type: ignore[arg-type]
    return check_readings(columns_of(header, *rows, n_cables=4), RECTANGLE, data)


def test_readings_that_run_against_the_commands_are_of_a_mirrored_axis() -> None:
    told = poses(x=WAY, y=WAY[[2, 0, 4, 1, 3]])
    mirrored = told[:, :3] * [1.0, -1.0, 1.0]
    (note,) = notes_on(told, "mm", position=mirrored)
    assert note.startswith("Column meas_y_mm goes against the commands along y: is its sign the")
    turned = told[:, :3] * [-1.0, -1.0, 1.0] + [0.3, 0.0, 0.0]
    (note,) = notes_on(told, position=turned)
    assert note.startswith(
        "Columns meas_x_m meas_y_m go against the commands along x and y: are their "
    )
    still = poses(x=WAY, y=0.01 * WAY)
    for pose, read in (
        (told, told[:, :3]),  # as it should be
        (told, told[:, :3] * [1.0, -0.4, 1.0]),  # not as far
        (told, mirrored + np.outer([0.1, -0.1, 0.0, -0.1, 0.1], [0.0, 1.0, 0.0])),  # hardly so
        (still, still[:, :3] * [1.0, -1.0, 1.0]),
    ):
        assert not any("against the commands" in note for note in notes_on(pose, position=read))
    assert notes_on(told, free=("tracker_frame",), position=mirrored) == []


@pytest.mark.parametrize("far", [1.0, 0.3])  # 0.3: no axis alone moves by so much
@pytest.mark.parametrize(("power", "unit"), [(1, "mm"), (-1, "m")])
def test_readings_that_spread_a_hundred_times_as_far_are_in_another_unit(
    power: int, unit: str, far: float
) -> None:
    told = poses(x=far * WAY, y=far * WAY)
    for times, odd in ((101.0, True), (99.0, False)):
        read = HOME[:3] + times**power * (told[:, :3] - HOME[:3])
        if odd:
            with pytest.raises(InputFileError, match=f"such as meas_x_{unit}$"):
                notes_on(told, position=read)
        else:
            notes_on(told, position=read)


def test_one_axis_in_another_unit_is_named_if_it_was_meant_to_move() -> None:
    told = poses(x=WAY, y=WAY)
    read = told[:, :3].copy()
    read[:, 1] = HOME[1] + 1e-3 * WAY
    with pytest.raises(InputFileError, match=r"column meas_y_m: positions were .*_m$"):
        notes_on(told, position=read)
    # a mean distance of 0.12 m, of which a frame of 5 m asks for 0.1
    still = poses(x=WAY, y=0.8 * WAY)
    read = still[:, :3].copy()
    read[:, 1] = HOME[1] + 1e-3 * WAY
    notes_on(still, position=read)


def test_few_readings_and_readings_that_stand_still_say_nothing_of_units() -> None:
    told = poses(x=WAY)
    some = HOME[:3] + 150.0 * (told[:, :3] - HOME[:3])
    with pytest.raises(InputFileError, match="such as meas_x_mm"):
        notes_on(told, position=some)
    some[3:] = np.nan
    notes_on(told, position=some)
    notes_on(told, position=np.tile(HOME[:3], (5, 1)))


def test_an_offset_is_odd_from_half_of_the_spread_and_a_twentieth_of_the_frame_on() -> None:
    for told, least in ((poses(x=WAY), 0.25), (poses(x=10 * WAY), 0.5)):
        for part, odd in ((0.99, False), (1.01, True)):
            notes = notes_on(told, position=told[:, :3] + [0.0, part * least, 0.0])
            assert bool(notes) == odd
    assert f"they are {1.01 * 0.5:.3g} m from them, which spread by 1 m. Are axes" in notes[0]


def test_a_platform_that_is_turned_in_either_order_is_not_told_to_be_in_another() -> None:
    told = poses(x=WAY)
    wobble = quat_from_rotvec(0.1 * np.random.default_rng(0).normal(size=(5, 3)))
    assert notes_on(told, quat_wxyz=wobble) == []
    (note,) = notes_on(told, quat_wxyz=np.roll(wobble, -1, axis=1))
    assert "if their last number is the scalar" in note
    # 120 degrees about (1, 1, 1) is (1, 1, 1, 1)/2, in whatever order
    third = quat_from_rotvec(np.full((5, 3), 2.0 * np.pi / 3.0 / 3**0.5))
    assert notes_on(told, quat_wxyz=quat_multiply(wobble, third)) == []


@pytest.mark.parametrize(("unit", "factor", "name"), [
    ("deg", np.pi / 180.0, "rad"), ("rad", 180.0 / np.pi, "deg"),
])  # fmt: skip
def test_angles_that_follow_the_commands_in_another_unit_are_refused(
    unit: str, factor: float, name: str
) -> None:
    told = poses(x=WAY)
    turned = np.zeros((5, 3))
    turned[:, 1] = [-0.1, 0.06, 0.0, -0.05, 0.09]
    told[:, 3:] = quat_from_rotvec(turned)
    size = 180.0 / np.pi if unit == "deg" else 1.0
    sway = np.array([0.01, -0.01, 0.0, 0.01, -0.01])  # where the platform really rests

    def check(read: np.ndarray, told: np.ndarray = told) -> None:
        columns = columns_of(f"meas_ry_{unit}", *(f"{v:.9f}" for v in read), n_cables=4)
        data = Measurements(Path("a.csv"), 4, np.full(5, "a"), command_pose=told)
        check_readings(columns, RECTANGLE, data)

    right = size * (turned[:, 1] + sway)
    check(right)
    with pytest.raises(InputFileError, match=rf"column meas_ry_{unit}: .*such as meas_ry_{name}$"):
        check(factor * right)
    check(factor * right[[1, 0, 4, 2, 3]])  # as small, but it does not follow the commands
    check(factor * (right + 0.1 * size * np.array([1, 1, -4, 1, 1])))  # nor does most of this
    check(factor * right, told=poses(x=WAY))  # which do not turn: nothing can be said


def test_positions_of_exactly_nothing_are_no_readings() -> None:
    told = poses(x=WAY)
    read = told[:, :3].copy()
    read[3] = 0.0
    with pytest.raises(InputFileError, match=(
        r"line 5, column meas_x_m: expected a position near its command, got exactly 0 0 0, "
        r"2.97 m from it; leave the cells empty"
    )):  # fmt: skip
        notes_on(told, position=read)
    read[3, 0] = 1e-6
    notes_on(told, position=read)
    there = told - np.array([*HOME[:3], 0, 0, 0, 0])  # where 0 0 0 is a place like any other
    notes_on(there, position=0.0 * read)


@pytest.mark.parametrize(
    ("read", "said"),
    [("0,0,0,0.{k}", "exactly 0 0 0"), ("{x},0.25,0.1,{r:.9f}", "are these really deg")],
)
def test_both_are_refused_when_a_file_is_read(tmp_path: Path, read: str, said: str) -> None:
    told = "cmd_x_m,cmd_y_m,cmd_z_m,cmd_rx_deg,cmd_ry_deg,cmd_rz_deg"
    head = f"{told},meas_x_m,meas_y_m,meas_z_m,meas_ry_deg"
    lines = []
    for k in range(8):
        x, turned = 0.3 + 0.02 * k, 0.5 * (k - 4) * (-1) ** k
        good = f"{x},0.25,0.1,{turned}"
        mistaken = read.format(k=k, x=x, r=np.radians(turned)) if "r:" in read or k == 3 else good
        lines.append(f"{x},0.25,0.1,0,{turned},0,{mistaken}")
    path = tmp_path / "measured.csv"
    path.write_text("\n".join([head, *lines]))
    with pytest.raises(InputFileError, match=said):
        load_measurements(path, load_robot(model_path("demobot_cogiro")))


REMEDY = "; leave the cells empty where nothing was read"


def refusal(name: str, *cells: str) -> str:
    """What is said of a column, "" if nothing is."""
    columns = columns_of(f"note,{name}", *(f"x,{c}" for c in cells))
    pose = np.tile(RECTANGLE.reference_pose, (len(cells), 1))
    data = Measurements(Path("a.csv"), 4, np.full(len(cells), "a"), command_pose=pose)
    try:
        check_readings(columns, RECTANGLE, data)
    except InputFileError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(("name", "inside", "outside"), [
    ("meas_x_m", "501.5", "501.6"),
    ("meas_x_m", "-498.5", "-498.6"),
    ("meas_y_mm", "-498000", "-498001"),
    ("meas_z_cm", "49850", "49851"),
    ("meas_rx_deg", "-3599", "-3601"),
    ("meas_rz_rad", "62.8", "62.9"),
])  # fmt: skip
def test_readings_are_within_a_hundred_frames_and_ten_turns(
    name: str, inside: str, outside: str
) -> None:
    """The frame is 5 m across, and its middle at (1.5, 2, -1.5) m."""
    assert refusal(name, "0", inside) == ""
    said = refusal(name, "0", inside, outside)
    assert f"line 4, column {name}: expected a reading " in said
    assert f"got {outside} {name.rpartition('_')[2]}; " in said and REMEDY[2:] in said


def test_only_of_positions_a_survey_is_said() -> None:
    assert refusal("meas_x_m", "-8000").endswith(
        f"within 500 m of the robot, got -8000 m{REMEDY}, and subtract a constant from coordinates "
        "in a survey's grid"
    )
    assert "got 1200 m; if it is in mm, name the column meas_x_mm; " in refusal("meas_x_m", "1200")
    assert "in mm" not in refusal("meas_x_mm", "1200000")
    assert refusal("meas_ry_rad", "600").endswith(f"of at most ten turns, got 600 rad{REMEDY}")


@pytest.mark.parametrize(("name", "cell"), [
    ("meas_x_mm", "999"), ("meas_x_mm", "-9999.0"), ("meas_rx_deg", "999"),
    ("tension_4_N", "99999"), ("tension_1_N", "-999"),
])  # fmt: skip
def test_only_nines_in_every_row_are_no_readings(name: str, cell: str) -> None:
    said = refusal(name, "", *[cell] * 2, "nan", *[cell] * 2)
    assert f"line 3, column {name}: expected readings, got {float(cell):g} in every row" in said


@pytest.mark.parametrize("cells", [
    ["999"] * 3,
    ["99"] * 4,
    ["99.9"] * 4,
    ["998"] * 4,
    ["9990"] * 4,
    ["999", "999", "999", "9999"],
    ["999", "-999", "999", "-999"],
    [""] * 4,
])  # fmt: skip
def test_other_numbers_may_be_readings(cells: list[str]) -> None:
    assert refusal("tension_2_N", *cells) == ""


def test_nines_count_in_the_unit_of_the_column() -> None:
    """9.99 m is nothing special, and 999 cm is."""
    assert refusal("meas_y_m", *["9.99"] * 4) == ""
    assert "got 999 in every row" in refusal("meas_y_cm", *["999"] * 4)


def test_other_columns_are_not_looked_at() -> None:
    assert "expected reading" not in refusal("cmd_x_m", *["99999"] * 4)
    assert refusal("t_s", *["99999"] * 4) == ""


COGIRO = load_robot("demobot_cogiro")
WHOLE = "meas_rx_rad,meas_ry_rad,meas_rz_rad"
TILTS = np.array([[1.0, -2.0, 0.5], [-1.5, 1.0, -2.0], [2.0, 2.5, 1.0], [0.0, -1.0, 3.0]])


def file_of(folder: Path, header: str, *rows: str) -> Path:
    path = folder / "a.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize("prefix", ["cmd", "meas"])
@pytest.mark.parametrize("angle", ["26.2376", "-90", "6.3"])
def test_more_than_a_turn_is_no_orientation_in_radians(
    tmp_path: Path, prefix: str, angle: str
) -> None:
    """They were a warning, 90 deg of noise and a model that "misses something"."""
    cmd, meas = ("0,0,0.1", angle) if prefix == "meas" else (f"0,0,{angle}", "0.1")
    path = file_of(
        tmp_path,
        "cmd_x_m,cmd_y_m,cmd_z_m,cmd_rx_rad,cmd_ry_rad,cmd_rz_rad,meas_rz_rad",
        "0.2,0.2,0.15,0,0,0.1,0.1",
        f"0.3,0.2,0.15,{cmd},{meas}",
    )
    expected = (
        f"line 3, column {prefix}_rz_rad: expected radians within one turn, at most 6.283, got "
        f"{angle}, as if in degrees; name the column {prefix}_rz_deg, or, if it counts turns, "
    )
    with pytest.raises(InputFileError, match=expected):
        load_measurements(path, COGIRO)


def test_degrees_and_a_whole_turn_may_be_as_large_as_they_are(tmp_path: Path) -> None:
    path = file_of(
        tmp_path,
        "cmd_x_m,cmd_y_m,cmd_z_m,cmd_rx_deg,cmd_ry_deg,cmd_rz_rad",
        "0.2,0.2,0.15,26,-9,6.2832",
    )
    assert load_commands(path, COGIRO).n_rows == 1


def read_as(
    angles: np.ndarray, told: np.ndarray | None = None, header: str = WHOLE, robot: Robot = COGIRO
) -> str:  # fmt: skip
    """What is said of angles (n, k), "" if nothing is."""
    rows = [",".join(f"{a:.9g}" for a in row) for row in angles]
    columns = columns_of(header, *rows, n_cables=robot.n_cables)
    pose = np.tile(robot.reference_pose, (len(rows), 1))
    if told is not None:
        pose[:, 3:] = told
    data = Measurements(Path("a.csv"), robot.n_cables, np.full(len(rows), "a"), command_pose=pose)
    try:
        check_readings(columns, robot, data)
    except InputFileError as error:
        return str(error)
    return ""


def test_tilts_of_some_degrees_are_no_radians() -> None:
    said = read_as(TILTS)
    assert "column meas_rz_rad: expected radians, got angles that scatter by 1.4 rad (rms)" in said
    assert said.endswith("follow them to 2.9 deg if they are degrees; name the column meas_rz_deg")
    assert read_as(np.radians(TILTS)) == ""
    assert read_as(TILTS[:3]) == ""  # too few to tell
    assert read_as(TILTS, header="meas_rx_deg,meas_ry_deg,meas_rz_deg") == ""
    assert "column meas_ry_rad" in read_as(TILTS[:, [1]], header="meas_ry_rad")
    # four cables, six degrees of freedom: it may tilt
    assert read_as(TILTS, robot=RECTANGLE) == ""


@pytest.mark.parametrize("turn", [[np.pi, 0.0, 0.0], [0.0, np.pi / 2.0, 0.0], [1.6, 0.0, -3.1]])
def test_a_body_turned_on_the_platform_reads_radians_all_the_same(turn: list[float]) -> None:
    """Its angles may be near half a turn, of either sign, or near that where two are one."""
    told = quat_from_rxyz(np.radians(TILTS))
    read = quat_multiply(told, np.tile(quat_from_rxyz(np.array(turn)), (4, 1)))
    assert read_as(rxyz_from_quat(read), told) == ""


def test_commanded_lengths_do_not_say_that_angles_are_degrees(tmp_path: Path) -> None:
    """A platform told to turn by 1.2 rad had its true angles refused: as degrees all are small."""
    robot = load_robot("planar_horizontal")
    lengths = robot.rest_lengths
    header = ",".join([*(f"length_{k}_m" for k in range(1, len(lengths) + 1)), "meas_ry_rad"])
    rows = [",".join(f"{one:.6f}" for one in (*lengths, angle)) for angle in (1.2, -1.1, 0.7, -0.9)]
    path = file_of(tmp_path, header, *rows)
    assert load_measurements(path, robot).n_rows == 4
