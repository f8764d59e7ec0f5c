"""Published files of other people, from the command line: headers, sheets, copies, planes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from called import as_json, ran
from sources import ROOT

from crosscheck.importing.capture import read_motive

SIMULATOR = "t=t_s,p*=meas_*_m,q*=meas_q*,p*_ref=cmd_*_m"


@pytest.fixture
def public(shared_data: Path) -> Path:
    return shared_data / "public"


def test_foreign_headers_on_every_command_that_reads_rows(public: Path, tmp_path: Path) -> None:
    folder = public / "23-simulator-csv"
    robot, table = folder / "robot.xml", folder / "timeseries.csv"
    words = f"{robot} {table} --columns '{SIMULATOR},T*=tension_*_N' --out {tmp_path / 'out'}"
    found = as_json(f"crosscheck compare {words} --no-recording")
    assert found["rows"]["all"] == 12 and found["sigma"]["tension_N"] is not None
    turns = "rotation about x, rotation about y, rotation about z: not counted as readings"
    assert any(turns in note for note in found["notes"])
    swept = as_json(f"seecr sweep {words} --figure none --no-recording")
    assert swept["rows"][0]["command"][:3] == [-0.5, -0.3, 0.95]
    # and what it says next holds it too
    done = ran(f"crosscheck compare {words} --no-recording", 0)
    assert done.stdout.splitlines()[-1].endswith(f"--columns '{SIMULATOR},T*=tension_*_N'")
    # said for one command alone
    refused = ran(f"crosscheck compare {robot} {table} --out {tmp_path / 'out'}", 2)
    said = "column t: missing unit; expected t_s or t_ms; or say it, such as --columns t=t_s"
    assert said in refused.stderr


def test_all_faults_of_all_files_end_with_2_and_leave_nothing(public: Path, tmp_path: Path) -> None:
    folder = public / "15-wall-plotter"
    text = (folder / "measured.csv").read_text()
    (tmp_path / "one.csv").write_text(text.replace("cmd_x_mm", "cmd_x").replace("z_mm", "z_in"))
    (tmp_path / "two.csv").write_text(text.replace("-155.16", "#DIV/0!").replace(",-900.0", ",", 1))
    words = " ".join(str(tmp_path / f"{name}.csv") for name in ("one", "two"))
    out = tmp_path / "out"
    done = ran(f"crosscheck compare {folder / 'robot.xml'} {words} --out {out}", 2)
    lines = done.stderr.splitlines()
    assert all(line.startswith("crosscheck: ") for line in lines)
    places = [line.split(": ")[1:3] for line in lines]
    assert [(Path(file).name, place) for file, place in places] == [
        ("one.csv", "line 1, column cmd_x"), ("one.csv", "line 1, column cmd_z_in"),
        ("one.csv", "line 1, column meas_z_in"), ("two.csv", "line 22, column cmd_z_mm"),
        ("two.csv", "line 5, column meas_x_mm"),
    ]  # fmt: skip
    assert done.stdout == "" and not out.exists()


def test_a_sheet_is_compared_as_its_csv(public: Path, tmp_path: Path) -> None:
    folder = public / "15-wall-plotter"
    book = openpyxl.Workbook()
    book.active.title = "monday"
    for line in (folder / "measured.csv").read_text().splitlines():
        cells = [cell if cell[0] not in "-0123456789" else float(cell) for cell in line.split(",")]
        book.active.append(cells)
    book.active.append(["Mean", None, None, 1.0, 2.0])
    book.save(tmp_path / "book.xlsx")
    (tmp_path / "book.toml").write_text((folder / "measured.toml").read_text())
    rest = f"--no-recording --out {tmp_path / 'out'}"
    ours = as_json(f"crosscheck compare {folder / 'robot.xml'} {tmp_path}/book.xlsx:monday {rest}")
    theirs = as_json(f"crosscheck compare {folder / 'robot.xml'} {folder / 'measured.csv'} {rest}")
    assert ours["rms"] == theirs["rms"] and ours["sigma"] == theirs["sigma"]
    assert "Left out: row 32 (Mean), computed from the other rows." in ours["notes"]
    assert set(ours["made"]["sha256"]) >= {"book.xlsx", "book.toml"}


def test_a_leaning_plane_is_as_its_own_frame(public: Path, tmp_path: Path) -> None:
    """board_frame.xml has the same plane upright, and a gravity that leans."""
    folder, lean = public / "18-easel", np.radians(12.0)
    rest = f"--figure none --no-recording --out {tmp_path / 'out'}"
    rows = [(0.0, 1.1738), (0.4, 1.5), (-0.6, 0.7)]
    upright = "\n".join(f"{x},{z / np.cos(lean)}" for x, z in rows)
    (tmp_path / "upright.csv").write_text(f"cmd_x_m,cmd_z_m\n{upright}\n")
    right = as_json(f"seecr sweep {folder}/board_frame.xml {tmp_path}/upright.csv {rest}")["rows"]
    # digits of the plane in robot.xml are 1e-9; those of the rounded file are 0.1 mm
    for name, far in (("poses_xz.csv", 1e-7), ("poses_xyz_rounded.csv", 5e-5)):
        found = as_json(f"seecr sweep {folder}/robot.xml {folder}/{name} {rest}")["rows"]
        for one, other in zip(found, right, strict=True):
            x, _y, up = other["pose"][:3]
            expected = [x, np.sin(lean) * up, np.cos(lean) * up]
            assert one["pose"][:3] == pytest.approx(expected, abs=far)
            assert one["tensions_N"] == pytest.approx(other["tensions_N"], abs=1e4 * far)


def test_copied_rows_of_another_payload_are_named(public: Path, tmp_path: Path) -> None:
    folder = public / "22-payload-grid"
    files = f"{folder}/load_0.csv {folder}/load_25_part_copied.csv"
    out = tmp_path / "out"
    ran(f"crosscheck compare {folder}/robot.xml {files} --no-recording --out {out}", 0)
    notes = json.loads((out / "comparison.json").read_text())["notes"]
    (said,) = [note for note in notes if "Repeated readings" in note]
    first, second = ((folder / f"{name}.csv").read_text().splitlines()
                     for name in ("load_0", "load_25_part_copied"))  # fmt: skip
    read = [",".join(line.split(",")[3:6]) for line in first]
    same = [k + 1 for k, line in enumerate(second[1:], 1) if ",".join(line.split(",")[3:6]) in read]
    assert f"load_25_part_copied.csv lines {', '.join(map(str, same))} have those of" in said


def test_motives_angles_are_those_of_its_quaternions(public: Path) -> None:
    folder = public / "29-motive-timecode"
    takes = [read_motive(folder / f"take_{name}.csv").bodies["deck"]
             for name in ("123_euler", "125_parent_mm", "124_timecode_cm")]  # fmt: skip
    (place, quat), (other, right), (third, again) = takes
    assert np.allclose(place, other, atol=1e-6) and np.allclose(third, other, atol=1e-6)
    assert np.allclose(quat, right, atol=1e-6) and np.allclose(again, right, atol=1e-6)


LINES = "each of the tendons rope1, rope2, rope3 and rope4"


@pytest.mark.parametrize(
    ("file", "status", "told"),
    [
        ("01-position-actuators/robot.xml", 2,
         [f"{LINES} has stiffness 0 and an actuator alone", "l0 would be 1.50997 m"]),
        ("02-limited-tendons/robot.xml", 2,
         [f"{LINES} is a rope that cannot stretch (range up to 1.5133 m)", 'stiffness="E S / l0"']),
        ("05-child-bodies/tool_on_hinge.xml", 2, ["(ee and tool)", "remove the joints of what is"]),
        ("07-wrapped-exit/guide_sites.xml", 2, ["winch_side_length", "--fix OUT.xml writes"]),
        ("07-wrapped-exit/robot.xml", 2, ["pulley_radius", "--fix OUT.xml writes"]),
        ("10-one-lug/robot.xml", 3, ["give it three slide joints", "free to turn about z"]),
        ("12-two-bodies/between_bodies.xml", 2,
         ["2 objections", "(ee and lower)", "hang1 and hang2"]),
    ],
)  # fmt: skip
def test_what_is_no_cable_robot_is_told_with_its_remedy(
    file: str, status: int, told: list[str], public: Path
) -> None:
    said = ran(f"seecr pose {public / file} 0 0 0.8 --alone", status).output
    assert all(one in said for one in told), said


def test_a_link_on_one_hinge_rests_at_two_angles(public: Path) -> None:
    """Stiffness about the hinge: the second derivative of the energy of two springs and weight."""

    def energy(turn: float) -> float:
        across, up = np.sin(turn), np.cos(turn)
        springs = 0.0
        for side in (-1.0, 1.0):
            anchor = [0.03 * side * up + 0.3 * across, 0.3 * up - 0.03 * side * across]
            stretch = np.hypot(anchor[0] - 0.4 * side, anchor[1] - 0.1) - 0.4198
            springs += 0.5 * 3000.0 * max(stretch, 0.0) ** 2
        return float(springs + 0.8 * 9.81 * 0.25 * up)

    step = 1e-4
    expected = (energy(step) - 2.0 * energy(0.0) + energy(-step)) / step**2
    said = as_json(f"seecr pose {public}/30-hinged-link/robot.xml 0 0 0")
    assert said["pose"][:4] == pytest.approx([0, 0, 0, 1], abs=1e-9)
    text = ran(f"seecr pose {public}/30-hinged-link/robot.xml 0 0 0 --alone", 0).output
    assert f"{expected:.1f} N m/rad" in text
    turned = [abs(one["pose"][5]) for one in said["equilibria"]]
    assert sorted(turned) == pytest.approx([0.0, 1.0], abs=1e-9)


def test_the_page_of_problems_has_what_is_here(public: Path) -> None:
    page = (ROOT / "docs" / "published.md").read_text(encoding="utf-8")
    band = f"{public}/11-passive-springs/band.xml"
    said = as_json(f"seecr pose {band} 0.6 0 1.5 --alone --passive band")
    off = 1e3 * np.linalg.norm(said["deviation_m"])
    assert f"{said['tensions_N'][2]:.1f} N, {off:.2f} mm off" in page
    motors = as_json(f"seecr pose {public}/01-position-actuators/springs_and_motors.xml 0 0 0.8")
    assert f"{-1e3 * motors['deviation_m'][2]:.2f} mm low, {motors['tensions_N'][0]:.3f} N" in page
