"""Files of other programs: rows of cells, plain logs, exports of Motive and of Nexus."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.cli.importing import command
from crosscheck.importing.capture import read_motive, read_vicon, rotations
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.logs import FileRows, unit_quaternions
from crosscheck.importing.poses import read_poses
from crosscheck.importing.take import READERS
from seecr.errors import InputError, InputFileError


def rows_of(folder: Path, text: str) -> FileRows:
    path = folder / "export.csv"
    path.write_text(text, encoding="utf-8")
    return FileRows.of(path, "expected an export")


def test_decimal_commas_are_points_where_cells_end_with_semicolons(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, "Frame;x;y\n1;-2,5e3;0,5\n")
    assert rows.cells[:2] == [["Frame", "x", "y"], ["1", "-2.5e3", "0.5"]]


def test_a_quote_without_its_end_does_not_swallow_lines(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, 'a,5" wide,c\n1,2,3\n')
    assert rows.cells[1] == ["1", "2", "3"]


def test_a_body_that_was_not_seen_has_no_orientation(tmp_path: Path) -> None:
    def refuse(text: str, row: int) -> InputFileError:
        return InputFileError(f"row {row}: {text}")

    found = unit_quaternions(np.array([[0.0, 0, 0, 0], [1.004, 0, 0, 0]]), refuse)
    np.testing.assert_array_equal(found, [[np.nan] * 4, [1.0, 0, 0, 0]])
    with pytest.raises(InputFileError, match="row 1: expected a quaternion of length 1, got 2"):
        unit_quaternions(np.array([[1.0, 0, 0, 0], [2.0, 0, 0, 0]]), refuse)


def log(folder: Path, *lines: str) -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "head",
    [
        "t_s,x_mm,y_mm,z_mm",
        "time [s],tx [mm],ty [mm],tz [mm]",
        "t,pos_x (mm),y_mm,z_mm",
        "Time [s],Pos X (mm),Pos Y (mm),Pos Z (mm)",
    ],
)
def test_units_are_read_from_names(tmp_path: Path, head: str) -> None:
    found = read_poses(log(tmp_path, head, "0,1,2,3", "0.5,4,5,6"))
    place, quat = found.bodies["log"]
    assert place == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]) * 1e-3) and quat is None
    assert found.t_s.tolist() == [0.0, 0.5] and found.line.tolist() == [2, 3]


def test_a_unit_is_stated_where_names_have_none(tmp_path: Path) -> None:
    path = log(tmp_path, "t,x,y,z", "0,1,2,3")
    assert read_poses(path, "mm").bodies["log"][0] == pytest.approx(np.array([[1, 2, 3]]) * 1e-3)
    with pytest.raises(InputFileError, match="expected a unit in the name of column x"):
        read_poses(path)
    with pytest.raises(InputError, match=r"the columns of log\.csv state their own"):
        read_poses(log(tmp_path, "t,x_m,y_m,z_m", "0,1,2,3"), "mm")


def test_columns_that_are_not_read_are_said(tmp_path: Path) -> None:
    """All orientations were lost without a word."""
    path = log(tmp_path, "t_s,x_mm,y_mm,z_mm,Roll [deg],Yaw [deg]", "0,1,2,3,4,5")
    (note,) = read_poses(path).notes
    assert note.startswith("Columns Roll [deg] Yaw [deg] are not used, because roll, pitch and")
    turned = log(tmp_path, "t_s,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg,frame", "0,1,2,3,4,5,6,7")
    assert read_poses(turned).notes == ("Not used: frame.",)
    both = log(tmp_path, "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz,rx_deg", "0,1,2,3,1,0,0,0,9")
    assert read_poses(both).notes == ("Not used: rx_deg.",)
    assert read_poses(log(tmp_path, "t_s,x_mm,y_mm,z_mm", "0,1,2,3")).notes == ()
    with pytest.raises(InputFileError, match="got no x, y, z among t_s, North, East; rename them"):
        read_poses(log(tmp_path, "t_s,North,East", "0,1,2"))


def test_numbers_that_stand_for_not_seen_are_refused(tmp_path: Path) -> None:
    rows = [f"{k},-9999,-9999,-9999" if k % 2 else f"{k},1,2,3" for k in range(8)]
    path = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *rows)
    with pytest.raises(InputFileError, match=r"line 3, column x_mm: expected a position, got -99"):
        read_poses(path)
    once = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *rows[:2], "8,1,2,3")
    assert read_poses(once).bodies["log"][0][1, 0] == pytest.approx(-9.999)
    high = log(tmp_path, "t_s,x_mm,y_mm,z_mm", *(f"{k},1,2,999" for k in range(8)))
    assert read_poses(high).bodies["log"][0][3, 2] == pytest.approx(0.999), "a height"


def test_three_angles_turn_about_moving_axes(tmp_path: Path) -> None:
    """Rx(90) Ry(90): z of the body goes to x of the base."""
    head = "t_s,x_m,y_m,z_m,rx_deg,ry_deg,rz_deg"
    _place, quat = read_poses(log(tmp_path, head, "0,0,0,0,90,90,0", "1,0,0,0,,,")).bodies["log"]
    assert quat is not None and quat[0] == pytest.approx([0.5, 0.5, 0.5, 0.5])
    assert np.isnan(quat[1]).all()


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("t_s,x_m,y_m", "got no z"),
        ("t_s,x_m,y_m,z_m,x_mm", "column x_mm: says the same as x_m; expected only one of the two"),
        ("x_m,y_m,z_m", "expected columns of times such as t_s, got x_m, y_m, z_m; rename"),
        ("t_s,x_m,y_m,z_m,qw,qx,qy", "expected all of qw, qx, qy, qz or none, got no qz"),
    ],
)
def test_columns_that_are_no_poses_are_refused(tmp_path: Path, head: str, said: str) -> None:
    cells = ",".join("1" for _ in head.split(","))
    with pytest.raises(InputFileError, match=said):
        read_poses(log(tmp_path, head, cells))


def test_positions_of_exactly_nothing_are_not_seen_unless_others_are_near(tmp_path: Path) -> None:
    head = "t_s,x_m,y_m,z_m,qw,qx,qy,qz"
    rows = ["0,3,2,1,1,0,0,0", "1,0,0,0,1,0,0,0", "2,3.5,2,1,1,0,0,0"]
    read = read_poses(log(tmp_path, head, *rows))
    assert read.body(None).seen.all()
    found = read.seen_only()
    assert found.body(None).seen.tolist() == [True, False, True]
    assert found.notes == ("positions of exactly 0 0 0 count as not seen: log in 1 row",)
    near = read_poses(log(tmp_path, head, *rows, "3,0.01,0,0,1,0,0,0")).seen_only()
    assert near.body(None).seen.all() and near.notes == ()
    marked = replace(read, bodies={}, markers={"m": read.bodies["log"][0]}).seen_only()
    assert np.isnan(marked.marker("m")[:, 0]).tolist() == [False, True, False]


_BODY, _MARKER = 7, 3
MOTIVE = "\n".join(
    [
        "Format Version,1.23,Length Units,Centimeters,Rotation Type,Quaternion,"
        "Total Exported Frames,2",
        "",
        ",Type" + _BODY * ",Rigid Body" + _MARKER * ",Marker",
        ",Name" + _BODY * ",box" + _MARKER * ",box:1",
        ",ID" + _BODY * ",1" + _MARKER * ",2",
        "," + 4 * ",Rotation" + 6 * ",Position",
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z",
        "0,0.5,0,0,0.6,0.8,100,200,300,1,2,3",
        "1,0.6,,,,,,,,4,5,6",
        "",
    ]
)


def motive(folder: Path, text: str = MOTIVE) -> Path:
    path = folder / "take.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_bodies_and_markers_are_read_in_metres_with_the_scalar_first(tmp_path: Path) -> None:
    found = read_motive(motive(tmp_path))
    assert found.t_s.tolist() == [0.5, 0.6] and found.up == "y"
    place, quat = found.bodies["box"]
    np.testing.assert_allclose(place, [[1.0, 2.0, 3.0], [np.nan] * 3])
    assert quat is not None
    np.testing.assert_allclose(quat, [[0.8, 0.0, 0.0, 0.6], [np.nan] * 4])
    assert found.markers["box:1"] == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]) * 0.01)


def test_y_up_becomes_z_up_for_positions_and_orientations(tmp_path: Path) -> None:
    place, quat = read_motive(motive(tmp_path)).upright().bodies["box"]
    assert place[0] == pytest.approx([1.0, -3.0, 2.0]) and quat is not None
    # Motive's z is minus y where Z is up
    assert quat[0] == pytest.approx([0.8, 0.0, -0.6, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Time (Seconds)", "Clock", "expected a column Time"),
        ("1,0.6", "1,0.5", "are two recordings in one"),
    ],
)
def test_what_is_no_export_to_be_trusted_is_refused(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises(InputFileError) as error:
        read_motive(motive(tmp_path, MOTIVE.replace(old, new)))
    assert said in str(error.value)


NEXUS = """Segments
100
,,box:box
Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ
,,deg,deg,deg,mm,mm,mm
11,0,0,0,90,1,2,3
12,0,0,0,,,,

Trajectories
100
,,box:one,,,box:two
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
11,0,10,20,30,40,50,60
12,0,11,21,31,41,51,61
"""


def nexus(folder: Path, text: str) -> Path:
    path = folder / "nexus.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_segments_and_markers_are_read_in_metres(tmp_path: Path) -> None:
    found = read_vicon(nexus(tmp_path, NEXUS), "xyz")
    assert found.t_s == pytest.approx([0.11, 0.12])
    place, quat = found.bodies["box:box"]
    np.testing.assert_allclose(place, [[1e-3, 2e-3, 3e-3], [np.nan] * 3])
    assert quat is not None and quat[0] == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5])
    assert found.markers["box:two"][1] == pytest.approx([0.041, 0.051, 0.061])


def test_blocks_of_other_frames_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="expected the frames of the first block again"):
        read_vicon(nexus(tmp_path, NEXUS.replace("12,0,11", "13,0,11")), "xyz")


def test_orders_of_angles_take_each_from_its_own_axis() -> None:
    """Capitals turn with the body, small letters do not; columns are RX, RY, RZ in any order."""
    angles = np.array([[0.1, 0.2, 0.3]])
    about = [
        Rotation.from_rotvec(angle * axis) for angle, axis in zip(angles[0], np.eye(3), strict=True)
    ]
    x, y, z = about
    for order, expected in {"xyz": z * y * x, "XYZ": x * y * z, "zxy": y * x * z}.items():
        found = Rotation.from_quat(rotations(angles, order)[0], scalar_first=True)
        assert (found * expected.inv()).magnitude() < 1e-12
    turn = Rotation.from_quat(rotations(angles, "vector"), scalar_first=True)
    assert turn.as_rotvec() == pytest.approx(angles)


EULER = """Format Version,1.23,Take Name,a,Export Frame Rate,20.0,Rotation Type,{order},Length Units,Meters,Coordinate Space,Global

,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body
,Name,deck,deck,deck,deck,deck,deck
,ID,"9E20","9E20","9E20","9E20","9E20","9E20"
,,Rotation,Rotation,Rotation,Position,Position,Position
Frame,{time},{axes},X,Y,Z
0,{t0},{first},0.1,0.2,0.3
4,{t1},,,,,,
"""  # noqa: E501


def euler_take(folder: Path, order: str, axes: str = "XYZ", time: str = "Time (Seconds)") -> Path:
    """Angles of 10, 20 and 40 degrees about X, Y and Z; in the second frame it was not seen."""
    angles = dict(zip("XYZ", ("10", "20", "40"), strict=True))
    path = folder / "take.csv"
    t0, t1 = ("0.0", "0.2") if time.startswith("Time (") else ("15:26:46:00", "15:26:46:04")
    path.write_text(
        EULER.format(order=order, time=time, t0=t0, t1=t1, axes=",".join(axes),
                     first=",".join(angles[axis] for axis in axes))
    )  # fmt: skip
    return path


def turn_about(axis: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    out = np.eye(3)
    out[i, i], out[j, j], out[i, j], out[j, i] = c, c, -s, s
    return out


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
@pytest.mark.parametrize("axes", ["XYZ", "ZYX"])
def test_motives_euler_angles_turn_about_moving_axes(tmp_path: Path, order: str, axes: str) -> None:
    """The matrix is the product in the order of the header's letters, whatever the columns'."""
    ((_place, quat),) = read_motive(euler_take(tmp_path, order, axes)).bodies.values()
    angle = {"X": 10.0, "Y": 20.0, "Z": 40.0}
    expected = np.linalg.multi_dot([turn_about(axis, angle[axis]) for axis in order])
    found = Rotation.from_quat(quat[0], scalar_first=True).as_matrix()
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.isnan(quat[1]).all()


def test_frames_over_their_rate_are_times_where_there_is_none(tmp_path: Path) -> None:
    export = read_motive(euler_take(tmp_path, "XYZ", time="TimeCode"))
    assert export.t_s.tolist() == [0.0, 0.2]


PAGE = (Path(__file__).resolve().parents[3] / "docs" / "import.md").read_text(encoding="utf-8")
SAMPLES = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)


def test_every_option_and_format_is_on_the_page():
    options = [p.opts[0] for p in command.params if isinstance(p, click.Option)]
    assert [name for name in options if name not in PAGE and name not in ("--json",)] == []
    assert all(f"`{form}`" in PAGE for form in READERS)


@pytest.mark.parametrize(("form", "sample"), list(zip(("motive", "vicon"), SAMPLES, strict=True)))
def test_samples_of_the_page_are_read(form, sample, tmp_path):
    file = tmp_path / "sample.csv"
    file.write_text(sample)
    export = READERS[form](file, ImportChoices(rotation="vector")).upright()
    ((position, quat),) = export.bodies.values()
    assert position[1] == pytest.approx([0.2, 0.25, 0.1])
    assert quat[1] == pytest.approx([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("order", ["XYX", "Angles", "XY"])
def test_an_unknown_type_of_rotation_is_refused(tmp_path: Path, order: str) -> None:
    said = f"line 1: .*such as XYZ, got '{order}' with 3 columns of rotations; export it again"
    with pytest.raises(InputFileError, match=said):
        read_motive(euler_take(tmp_path, order))
