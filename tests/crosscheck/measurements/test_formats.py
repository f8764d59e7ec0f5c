"""What strangers' files look like: marks, units, clocks, loads, way points, and what is odd."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from random_robots import random_robot

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_commands, load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.columns.csv import Table
from seecr.columns.known import know_columns
from seecr.commands import Loads
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import quat_from_rotvec, quat_multiply

CMD = "cmd_x_m,cmd_y_m,cmd_z_m"
POSE = f"run,{CMD},meas_x_m"
M = 4

Write = Callable[..., Path]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return random_robot(np.random.default_rng(1), cables=M)


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write lines, and a TOML beside them."""

    def to_files(*lines: str, toml: str = "") -> Path:
        path = tmp_path / "measured.csv"
        path.write_text("\n".join(lines) + "\n")
        path.with_suffix(".toml").write_text(toml)
        return path

    return to_files


def test_semicolons_with_decimal_commas_and_tabs_read_as_commas_do(write: Write, robot: Robot):
    rows = [POSE, "a,0.5,-.25,1e-1,1.125", "a,1,2,3,"]
    plain = load_measurements(write(*rows), robot)
    european = [row.replace(",", ";").replace(".", ",") for row in rows]
    tabs = [row.replace(",", "\t") for row in rows]
    for lines in (european, [row.replace(",", ";") for row in rows], tabs):
        other = load_measurements(write(*lines), robot)
        assert np.array_equal(other.command_pose, plain.command_pose)
        assert np.array_equal(other.position, plain.position, equal_nan=True)
    commas = [row.replace(",", "\t").replace(".", ",") for row in rows]
    assert np.array_equal(load_measurements(write(*commas), robot).command_pose, plain.command_pose)


def test_what_is_no_number_of_ours_says_nothing_of_decimal_commas(write: Write, robot: Robot):
    """A run called 1.5, or a version in a column that nobody reads."""
    rows = [f"{POSE};version".replace(",", ";"), "1.5;0,5;-,25;0,1;1,125;2.7"]
    found = load_measurements(write(*rows), robot)
    np.testing.assert_allclose(found.command_pose[0, :3], [0.5, -0.25, 0.1])
    assert found.run.tolist() == ["1.5"] and found.position[0, 0] == 1.125
    with pytest.raises(InputFileError, match="decimal comma"):
        load_measurements(write(rows[0], "1.5;0,5;-.25;0,1;1,125;2.7"), robot)


def test_units_of_every_kind(write: Write, robot: Robot):
    header = "run,t_ms,cmd_x_cm,cmd_y_um,cmd_z_m,meas_x_cm,tension_1_kN,payload_g,payload_x_mm"
    header += ",payload_y_m,payload_z_m,force_x_kN,moment_z_Nm"
    data = load_measurements(write(header, "a,1500,2,3000,0,2.5,0.02,250,4,0,0,0.001,7"), robot)
    assert data.t_s == [1.5] and data.tensions[0, 0] == 20.0 and data.position[0, 0] == 0.025
    assert data.command_pose is not None and data.loads is not None
    assert data.command_pose[0, :3] == pytest.approx([0.02, 0.003, 0.0])
    assert data.loads.mass == [0.25] and data.loads.centre.tolist() == [[0.004, 0.0, 0.0]]
    assert data.loads.wrench.tolist() == [[1.0, 0, 0, 0, 0, 7.0]]


def test_nan_is_a_reading_that_was_not_made(write: Write, robot: Robot):
    header = f"run,{CMD},meas_x_m,meas_qw,meas_qx,meas_qy,meas_qz"
    data = load_measurements(write(header, "a,0,0,0,nan,1,0,0,0", "a,0,0,1,2,NaN,nan,,NaN"), robot)
    assert np.isnan(data.position[0, 0]) and data.position[1, 0] == 2.0
    assert data.quat_wxyz is not None and np.isnan(data.quat_wxyz[1]).all()
    with pytest.raises(InputFileError, match=r"column cmd_x_m: .*in every row, got 'nan'"):
        load_measurements(write(POSE, "a,nan,0,0,0"), robot)


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_times_of_day_count_from_the_first_row(write: Write, robot: Robot, zone: str):
    times = [
        f"2024-02-28T23:59:50.5{zone}",
        f"2024-02-29 00:00:10{zone}",
        f"2024-02-29T01:00{zone}",
    ]
    data = load_measurements(
        write(f"t_s,{POSE}", *[f"{t},a,0,0,{k},0" for k, t in enumerate(times)]), robot
    )
    assert data.t_s == pytest.approx([0.0, 19.5, 3609.5])
    assert f"Column t_s holds times of day: counted from '{times[0]}'." in data.notes


def test_way_points_are_kept_and_lists_of_commands_have_none(write: Write, robot: Robot):
    data = load_measurements(write(POSE, "a,0,0,0,1", "a,0,0,1,", "a,0,1,0,2"), robot)
    assert data.read.tolist() == [True, False, True]
    assert data.notes[-1] == (
        "1 row has a command but no reading: a way point, which is not compared."
    )
    commands = load_commands(write(f"run,{CMD}", "a,0,0,0", "a,0,0,1"), robot)
    assert not commands.read.any() and commands.notes == (
        "No commanded orientation: that of the reference pose is used.",
    )


def test_the_toml_says_what_lengths_mean_where_runs_start_and_noise_with_its_unit(
    write: Write, robot: Robot
):
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
    data = load_measurements(write(header, "1,1,1,1,0", toml=toml), robot)
    assert data.told and not data.absolute and data.stands.tolist() == [True]
    stated = Sigma(0.1 / 1000, data.sigma.orientation_rad, None, 1e-4)
    assert data.sigma == stated and stated.orientation_rad == pytest.approx(np.deg2rad(0.02))
    plain = load_measurements(write(header, "1,1,1,1,0"), robot)
    assert plain.absolute and not plain.stands.any()
    poses = load_measurements(write(POSE, "a,0,0,0,0", toml='lengths = "told"'), robot)
    assert not poses.told and 'lengths = "told" has no effect here' in " ".join(poses.notes)


def test_payloads_without_a_centre_hang_at_the_platforms_own(write: Write, robot: Robot):
    rows = ["a,0,0,0,0,0.5,,,", "a,0,0,1,0,0.5,0.1,0.2,0.3"]
    data = load_measurements(
        write(f"{POSE},payload_kg,payload_x_m,payload_y_m,payload_z_m", *rows), robot
    )
    assert data.loads is not None
    assert np.isnan(data.loads.centre[0]).all() and data.loads.centre[1].tolist() == [0.1, 0.2, 0.3]
    bare = load_measurements(write(f"{POSE},payload_kg", "a,0,0,0,0,0.5"), robot)
    assert bare.loads is not None and np.isnan(bare.loads.centre).all()


def test_all_of_it_is_read_back_as_written(tmp_path: Path, robot: Robot):
    rng = np.random.default_rng(0)
    centre = np.array([[0.1, 0.2, 0.3], [np.nan] * 3, [0.0, 0.0, 0.1]])
    loads = Loads(np.array([0.5, 0.25, 0.0]), centre, np.outer([0.0, 1.0, 2.0], [1, 0, 2, 0, 0, 3]))
    data = Measurements(
        path=tmp_path / "measured.csv",
        n_cables=M,
        run=np.array(["a", "a", "b"]),
        command_lengths=rng.uniform(1, 2, (3, M)).round(6),
        told=True,
        loads=loads,
        stands=np.ones(3, dtype=bool),
        position=np.array([[1.0, 2, 3], [np.nan] * 3, [4, 5, 6]]),
        sigma=Sigma(position_m=1e-4),
    )
    write_measurements(data.path, data)
    again = load_measurements(data.path, robot)
    assert (again.told, again.stands.tolist()) == (True, [True] * 3)
    assert again.sigma == data.sigma and np.array_equal(again.command_lengths, data.command_lengths)
    assert again.loads is not None
    for name in ("mass", "centre", "wrench"):
        assert np.array_equal(getattr(again.loads, name), getattr(loads, name), equal_nan=True)
    assert data.rows([1]).loads.wrench.tolist() == [[1, 0, 2, 0, 0, 3]]


# ---------------------------------------------------------------- what is asked and said


def test_a_name_is_guessed_by_its_spelling_alone(write: Write, robot: Robot):
    names = "meas_roll_deg,meas_pitch_deg,tension_A_N,mes_y_m,operator"
    data = load_measurements(write(f"{POSE},{names}", "a,0,0,0,0,1,2,3,4,x"), robot)
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
        load_measurements(write(f"{CMD},meas_yaw_deg", "0,0,0,1"), robot)


def test_rows_given_twice_are_said(write: Write, robot: Robot):
    rows = ["a,0,0,0,1.5", "a,0,0,1,1.5", "b,0,0,0,1.5", "b,0,0,1,"]
    notes = load_measurements(write(POSE, *rows, "c,0,0,1,"), robot).notes
    assert [note for note in notes if "twice" in note] == [
        "Identical rows: line 4 as 2; they count twice, so remove one of each pair if it was "
        "measured only once."
    ]


def test_millimetres_in_a_metre_column(write: Write, robot: Robot):
    with pytest.raises(
        InputFileError,
        match=r"line 3, column cmd_y_m: far outside the robot: expected numbers of the size of its "
        r"frame, .* m across, got 500 m; are these really m\? Name .* cmd_y_mm",
    ):
        load_measurements(write(POSE, "a,0,0,0,0", "a,0,500,0,0"), robot)
    size = float(np.ptp(robot.exit_points, axis=0).max())
    notes = load_measurements(write(POSE, f"a,{5 * size},0,0,0"), robot).notes
    assert any("Line 2: a command" in note and "check its unit" in note for note in notes)
    rows = [f"a,{x},0,0,{1000 * x + 0.3}" for x in (0.0, 0.1, 0.2, 0.3)]
    with pytest.raises(
        InputFileError, match=r"column meas_x_m: positions were measured over .*_x_mm"
    ):
        load_measurements(write(POSE, *rows), robot)


def quaternions(prefix: str, quat: np.ndarray) -> list[str]:
    header = ",".join(f"{prefix}_q{c}" for c in "wxyz")
    return [header, *(",".join(f"{v:.12g}" for v in row) for row in quat)]


def test_a_quaternion_in_another_order(write: Write, robot: Robot):
    turn = quat_from_rotvec(np.random.default_rng(0).uniform(-0.2, 0.2, (5, 3)))
    right = quat_multiply(turn, np.tile(robot.reference_pose[3:], (5, 1)))
    for order, wrong in ((right, False), (np.roll(right, -1, axis=1), True)):
        lines = [
            f"{head},{quat}"
            for head, quat in zip(
                [POSE, *(f"a,0,0,{0.1 * k},0" for k in range(5))], quaternions("cmd", order),
                strict=True,
            )
        ]  # fmt: skip
        if wrong:
            with pytest.raises(InputFileError, match="column cmd_qw: every command turns the plat"):
                load_measurements(write(*lines), robot)
        else:
            load_measurements(write(*lines), robot)
        read = [line.replace("cmd_q", "meas_q") for line in lines]
        notes = " ".join(load_measurements(write(*read), robot).notes)
        assert ("are meas_qw meas_qx meas_qy meas_qz in the right order?" in notes) == wrong


LOADED = f"{POSE},payload_kg"
REFUSED = {
    "payload without unit": (
        [f"{POSE},payload", "a,0,0,0,0,1"],
        "line 1, column payload: missing unit; expected payload_kg or payload_g",
    ),
    "pounds": ([f"{POSE},payload_lb", "a,0,0,0,0,1"], "unknown unit 'lb'; expected payload_kg or"),
    "empty payload": (
        [LOADED, "a,0,0,0,0,1", "a,0,0,0,0,"],
        "line 3, column payload_kg: expected a number in every row, got an empty cell",
    ),
    "nan force": ([f"{POSE},force_x_N", "a,0,0,0,0,nan"], "line 2, column force_x_N: .*got 'nan'"),
    "negative platform": (
        [LOADED, "a,0,0,0,0,-1e6"],
        "line 2, column payload_kg: expected a payload that leaves the platform some of its .* kg",
    ),
    "half a centre": (
        [f"{LOADED},payload_x_m", "a,0,0,0,0,1,0"],
        "incomplete payload columns: expected .*, payload_y_m payload_z_m missing",
    ),
    "centre of nothing": (
        [f"{POSE},payload_x_m,payload_y_m,payload_z_m", "a,0,0,0,0,1,0,0"],
        "incomplete payload columns: expected .*, payload_kg missing",
    ),
    "centre half filled": (
        [f"{LOADED},payload_x_m,payload_y_m,payload_z_m", "a,0,0,0,0,1,0,,0"],
        "line 2, column payload_y_m: incomplete centre; expected all three cells filled or all",
    ),
    "centre in millimetres": (
        [
            f"{LOADED},payload_x_m,payload_y_m,payload_z_m",
            "a,0,0,0,0,1,0,0,0",
            "a,0,0,0,0,1,0,10,0",
        ],
        "line 3, column payload_y_m: expected the centre of a payload on the platform, in the "
        r"platform's frame, got one that is 9\.\d+ m from its anchor points, where the frame",
    ),
    "heavier than all cables bear": (
        [LOADED, "a,0,0,0,0,1e9"],
        r"line 2, column payload_kg: expected a load that the cables of this robot can carry, at "
        r"most [\d.e+]+ kg, got 1e\+09 kg; is it in g\? Name the column payload_g$",
    ),
    "a force of giganewtons": (
        [f"{POSE},force_z_kN", "a,0,0,0,0,-1e6"],
        r"line 2, column force_z_kN: expected a load .* at most [\d.e+]+ N, got "
        r"-1e\+09 N; is it in N\? Name",
    ),
    "moment in newtons": (
        [f"{POSE},moment_x_N", "a,0,0,0,0,1"],
        "column moment_x_N: unknown unit 'N'; expected moment_x_Nm",
    ),
    "no time of day": (
        [f"t_s,{POSE}", "2024-02-28T10:00:00,a,0,0,0,0", "noon,a,0,0,0,0"],
        "line 3, column t_s: expected a time in ISO 8601, as '2024-02-28T10:00:00' in the first "
        "row, got 'noon'",
    ),
    "time zone lost": (
        [f"t_s,{POSE}", "2024-02-28T10:00Z,a,0,0,0,0", "2024-02-28T11:00,a,0,0,0,0"],
        "line 3, column t_s: expected a time zone in every row or in none, got",
    ),
    "time of day falls": (
        [f"t_s,{POSE}", "2024-02-28T10:00,a,0,0,0,0", "2024-02-28T09:00,a,0,0,0,0"],
        "line 3, column t_s: rows out of time order: expected 2024-02-28T10:00 or later within run",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_mistakes_get_one_sentence_with_their_place(write: Write, robot: Robot, case: str):
    lines, expected = REFUSED[case]
    path = write(*lines)
    with pytest.raises(InputFileError, match=expected) as caught:
        load_measurements(path, robot)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert caught.value.exit_status == 2


# ---------------------------------------------------------------- the reference

REFERENCE = (Path(__file__).resolve().parents[3] / "docs" / "formats.md").read_text(
    encoding="utf-8"
)


def block(language: str) -> str:
    return REFERENCE.partition(f"```{language}\n")[2].partition("```")[0]


def test_the_reference_s_examples_are_read(write: Write, robot: Robot):
    data = load_measurements(write(block("text"), toml=block("toml")), robot)
    assert data.read.tolist() == [True, False, True] and data.stands.all()
    assert data.sigma.position_m == pytest.approx(3e-5) and data.sigma.length_m == 1e-4
    assert data.loads is not None and data.loads.mass.tolist() == [0.0, 0.0, 0.2]
    assert data.unused_columns == () and data.angle_mask.all()


def test_the_reference_s_columns_and_units_are_known():
    rows = [row.split("|") for row in REFERENCE.splitlines() if row.startswith("| `")]
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
