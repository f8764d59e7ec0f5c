"""What no single cell shows: where units, orders and rows are odd, and where they are just not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_columns import columns_of
from rectangle import RECTANGLE

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.plausible import check_readings, twice
from crosscheck.measurements.read import load_measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.errors import InputFileError
from seecr.pose import quat_from_rotvec, quat_multiply

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


def test_a_mirrored_axis_is_noted_when_a_file_is_read(tmp_path: Path) -> None:
    rows = [f"{x},{y},0.15,{x},{-y},0.15" for x in (0.3, 0.4, 0.5) for y in (0.2, 0.25, 0.3)]
    head = "cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m,meas_y_m,meas_z_m"
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    notes = load_measurements(tmp_path / "a.csv", load_robot("demobot_cogiro")).notes
    assert sum("meas_y_m goes against the commands along y" in note for note in notes) == 1


@pytest.mark.parametrize(("power", "unit"), [(1, "mm"), (-1, "m")])
def test_readings_that_spread_a_hundred_times_as_far_are_in_another_unit(
    power: int, unit: str
) -> None:
    told = poses(x=WAY, y=WAY)
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


def test_rows_that_are_the_same_are_listed_up_to_eight() -> None:
    told, run = np.tile(HOME, (12, 1)), np.full(12, "a")
    data = Measurements(Path("a.csv"), 4, run, command_pose=told, position=np.zeros((12, 3)))
    (note,) = twice(data)
    assert "9 as 2" in note and "10 as 2 and 3 more" in note
    other = replace(data, position=np.arange(36.0).reshape(12, 3))
    assert twice(other) == []


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
