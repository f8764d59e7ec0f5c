"""Recordings of other programs, made with known truth, come out as that truth."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import made_recordings as made_of
import numpy as np
import pytest
from called import ran, refused_in_a_line, run
from made_data import soft_cogiro, soft_xml, term
from scipy.spatial.transform import Rotation

import crosscheck
from crosscheck.importing import import_case
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.logs import Logged
from crosscheck.importing.poses import aligning, body_of_markers
from crosscheck.measurements.dwells import mean_error
from seecr.errors import InputError, InputFileError
from seecr.pose import quat_rotate, rotvec_from_quat
from seecr.units import millimetres

pytestmark = pytest.mark.slow

ROBOT = soft_cogiro()
TRUE = [term(ROBOT, "pulley_radius", radius_m=0.01)]
POINTS = tuple(f"platform:points{i}" for i in (1, 2, 3, 4))
SHAPE = dict(zip(POINTS, made_of.MARKERS, strict=True))


@pytest.fixture(scope="module")
def made():
    return made_of.recording(ROBOT, TRUE)


@pytest.fixture(scope="module")
def home():
    return made_of.recording(ROBOT, TRUE, at_home=True)


@pytest.fixture
def commands(made, tmp_path):
    return made_of.commands_csv(tmp_path / "commands.csv", made)


def swallowed_nothing(found):
    """With the true model noise is left, of the size that is stated; without it is not."""
    measured = found.measured
    good = crosscheck.compare(ROBOT, measured, TRUE)
    assert good.is_noise and 0.85 < good.whiteness.scale < 1.2
    assert not crosscheck.compare(ROBOT, measured).is_noise
    assert set(measured.free) == {"tracker_frame", "tracker_target"}


def has_the_noise_of_means(found, made, samples=60):
    sigma = found.measured.sigma
    assert sigma.position_m == pytest.approx(made_of.NOISE_M / np.sqrt(samples), rel=0.3)
    assert found.measured.sigma_source == "dwell_scatter"
    assert found.measured.n_rows == made.truth.n_rows == int(found.measured.read.sum())


FORMATS = {
    "poses": ("poses", lambda p, m: made_of.poses_csv(p, m), ImportChoices()),
    "motive 1.22 in mm": (
        "motive", lambda p, m: made_of.motive_csv(p, m, version="1.22", unit="Millimeters"),
        ImportChoices(),
    ),
    "motive 1.24 in cm, hidden at times": (
        "motive",
        lambda p, m: made_of.motive_csv(p, m, version="1.24", unit="Centimeters", hidden=9),
        ImportChoices(body="platform"),
    ),
    "motive 1.25": (
        "motive", lambda p, m: made_of.motive_csv(p, m, version="1.25"), ImportChoices()
    ),
    "vicon, rotation vectors": (
        "vicon", lambda p, m: made_of.vicon_csv(p, m), ImportChoices(rotation="vector")
    ),
    "vicon, Euler angles, tabs": (
        "vicon", lambda p, m: made_of.vicon_csv(p, m, sep="\t", rotation="XYZ"),
        ImportChoices(rotation="XYZ"),
    ),
    "vicon, quaternions, semicolons": (
        "vicon", lambda p, m: made_of.vicon_csv(p, m, sep=";", rotation="quaternion"),
        ImportChoices(),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMATS)
def test_dwells_of_each_format_are_the_truth_but_for_noise(name, made, commands, tmp_path):
    form, write, choices = FORMATS[name]
    found = import_case(form, [write(tmp_path / "a.csv", made)], ROBOT, [commands], choices)
    swallowed_nothing(found)
    has_the_noise_of_means(found, made, samples=53 if "hidden" in name else 60)


def test_markers_make_the_body(made, commands, tmp_path):
    file = made_of.vicon_csv(tmp_path / "a.csv", made)
    by_shape = import_case(
        "vicon", [file], ROBOT, [commands],
        ImportChoices(markers=POINTS, shape=SHAPE),
    )  # fmt: skip
    # where they sit was said: only the tracker is free, and the body is the platform
    assert by_shape.measured.free == ("tracker_frame",)
    assert crosscheck.compare(ROBOT, by_shape.measured, TRUE).is_noise
    swallowed_nothing(
        import_case("vicon", [file], ROBOT, [commands], ImportChoices(markers=POINTS[:3]))
    )


@pytest.mark.parametrize("count", [3, 5])
def test_all_frames_are_aligned_as_scipy_aligns_one(count):
    rng = np.random.default_rng(count)
    here, there = rng.normal(size=(count, 3)), rng.normal(size=(20, count, 3))
    found = aligning(here, there)
    for turn, points in zip(found, there, strict=True):
        expected = Rotation.align_vectors(points, here)[0].as_matrix()
        assert turn == pytest.approx(expected, abs=1e-9)


def test_markers_that_swap_or_hide_are_frames_lost(made):
    export = Logged(None, made.t_s, np.arange(len(made.t_s)), {}, {})
    points = made.markers.copy()
    points[10, [0, 1]] = points[10, [1, 0]]
    points[20, :2] = np.nan
    points[30, 0] = np.nan  # three are left
    names = ["a", "b", "c", "d"]
    export = replace(export, markers=dict(zip(names, points.transpose(1, 0, 2), strict=True)))
    body, said = body_of_markers(export, names, made_of.MARKERS)
    assert np.flatnonzero(~body.seen).tolist() == [10, 20]
    assert said.endswith(f"2 of {len(points)} frames lost")


def test_poses_in_the_base_frame_stay_what_they_are(home, tmp_path):
    commands = made_of.commands_csv(tmp_path / "c.csv", home, clock=3.25)
    found = import_case(
        "poses", [made_of.poses_csv(tmp_path / "a.csv", home)], ROBOT, [commands],
        ImportChoices(aligned=True, clock=3.25),
    )  # fmt: skip
    data = found.measured
    assert data.free == () and data.stands.all()
    (said,) = [note for note in found.notes if "from the commands" in note]
    off = np.linalg.norm(data.position - data.command_pose[:, :3], axis=1)
    assert said.startswith(f"the readings are {millimetres(np.median(off), 3)} and ")
    assert np.abs(data.position - home.truth.position).max() < 5 * data.sigma.position_m
    off = rotvec_from_quat(
        np.concatenate([data.quat_wxyz[:, :1], -data.quat_wxyz[:, 1:]], axis=1)
    ) + rotvec_from_quat(home.truth.quat_wxyz)
    assert np.abs(off).max() < 6 * data.sigma.orientation_rad
    assert data.command_pose == pytest.approx(home.truth.command_pose, abs=1e-8)


def test_another_frame_than_the_base_frame_is_said_with_what_would_align_it(
    made, commands, tmp_path
):
    """A tracker turned by 34 degrees and 1.7 m away was used as it is without a word."""
    found = import_case(
        "poses", [made_of.poses_csv(tmp_path / "a.csv", made)], ROBOT, [commands],
        ImportChoices(aligned=True),
    )  # fmt: skip
    assert found.measured.free == ()
    off = next(note for note in found.notes if note.startswith("the readings are "))
    away = np.median(np.linalg.norm(
        found.measured.position - found.measured.command_pose[:, :3], axis=1
    ))  # fmt: skip
    assert off.startswith(f"the readings are {millimetres(away, 3)} and ") and away > 0.5
    (turned,) = [note for note in found.notes if "Without --aligned it is aligned" in note]
    shift = np.linalg.norm(made_of.SHIFT)
    got = re.match(r"turned by ([\d.]+) deg and moved by ([\d.]+) m they would be", turned)
    assert got is not None
    assert float(got[1]) == pytest.approx(np.degrees(0.6), abs=1.5)
    assert float(got[2]) == pytest.approx(shift, abs=0.1)


def test_frames_align_by_points_that_the_user_names(made, tmp_path):
    here = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.1], [0.0, 0.6, 0.2]])
    back = made_of.TURN * [1, -1, -1, -1]
    there = quat_rotate(back, here - made_of.SHIFT) + 1e-3 * np.eye(3)
    points = {",".join(map(str, a)): b for a, b in zip(there, here, strict=True)}
    commands = made_of.commands_csv(tmp_path / "c.csv", made, times=False)
    log = made_of.poses_csv(tmp_path / "a.csv", made)
    found = import_case("poses", [log], ROBOT, [commands], ImportChoices(points=points))
    assert found.measured.n_rows == 21  # three commands repeat the one before them
    assert np.linalg.norm(found.frames.shift - made_of.SHIFT) < 0.01
    assert np.linalg.norm(found.frames.target_shift - made_of.TARGET) < 0.01
    swallowed_nothing(found)


def test_recordings_are_a_case_folder_in_one_call(made, commands, tmp_path):
    log, robot = made_of.poses_csv(tmp_path / "a.csv", made), tmp_path / "robot.xml"
    robot.write_text(soft_xml(), encoding="utf-8")
    found = crosscheck.import_case("poses", log, robot, commands, out=tmp_path / "case")
    case = tmp_path / "case"
    again = crosscheck.load_measurements(case / "measured.csv", case / "robot.xml")
    assert again.n_rows == found.measured.n_rows
    sent = commands.rename(case / "measured.csv")
    kept = sent.read_bytes()
    with pytest.raises(InputFileError, match=r"measured\.csv: would be overwritten, but was"):
        crosscheck.import_case("poses", log, robot, sent, out=case)
    assert sent.read_bytes() == kept
    with pytest.raises(InputError, match=r"^form must be one of motive, vicon, poses, got 'csv'$"):
        crosscheck.import_case("csv", log, robot, sent)
    with pytest.raises(InputError, match=r"has different numbers from .*\.xml"):
        crosscheck.import_case("poses", log, ROBOT, sent, out=tmp_path / "other")


FOREIGN = "T=t_s,px=meas_x_m,py=meas_y_m,pz=meas_z_m,q_*=meas_q*,X=cmd_x_m,Y=cmd_y_m,Z=cmd_z_m"


def test_headers_of_other_programs_are_said_for_both_files(made, commands, tmp_path):
    """Some are in one of them, others in both; what is in none of them is refused."""
    robot, log = tmp_path / "robot.xml", tmp_path / "a.csv"
    robot.write_text(soft_xml(), encoding="utf-8")
    right = import_case("poses", made_of.poses_csv(log, made), robot, commands).measured
    made_of.poses_csv(log, made, labels="T,px,py,pz,q_w,q_x,q_y,q_z")
    sent = commands.read_text().replace("t_s,cmd_x_m,cmd_y_m,cmd_z_m", "T,X,Y,Z")
    commands.write_text(sent)
    words = f"crosscheck import poses {log} --robot {robot} --commands {commands}"
    ran(f"{words} --columns {FOREIGN} --out {tmp_path / 'case'}", 0)
    data = crosscheck.load_measurements(tmp_path / "case" / "measured.csv", robot)
    assert data.position == pytest.approx(right.position, abs=1e-8)
    assert data.command_pose == pytest.approx(right.command_pose, abs=1e-8)
    assert "the file has no column pw" in refused_in_a_line(f"{words} --columns {FOREIGN},pw=run")
    assert "; or say it, such as --columns T=t_s" in refused_in_a_line(words)


def test_positions_alone_and_level_commands(tmp_path):
    made = made_of.recording(ROBOT, TRUE, level=True)
    commands = made_of.commands_csv(tmp_path / "c.csv", made)
    log = made_of.poses_csv(tmp_path / "a.csv", made, turned=False)
    found = import_case("poses", [log], ROBOT, [commands])
    assert found.measured.quat_wxyz is None and found.measured.sigma.orientation_rad is None
    assert crosscheck.compare(ROBOT, found.measured, TRUE).is_noise


def test_what_commands_leave_open_and_orientations_leave_is_said(made, tmp_path):
    """A wrong order of Euler angles shows in what is left, commands that are not turned too."""
    commands = made_of.commands_csv(tmp_path / "c.csv", made)
    file = made_of.vicon_csv(tmp_path / "a.csv", made, rotation="XYZ")
    left = []
    for order in ("XYZ", "ZYX"):
        found = import_case("vicon", [file], ROBOT, [commands], ImportChoices(rotation=order))
        left.append(float(re.search(r"platform's: (\S+) deg rms remain", str(found))[1]))
        assert np.nanmin(found.measured.quat_wxyz[:, 0]) > 0.9
    assert left[0] < 0.7 * left[1]
    rows = [line.split(",")[:5] for line in commands.read_text().splitlines()]
    commands.write_text("\n".join(",".join([*row, "1"]) for row in rows).replace("z_m,1", "z_m,a"))
    notes = import_case("vicon", [file], ROBOT, [commands], ImportChoices(rotation="XYZ")).notes
    assert "c.csv: Not used: a." in notes
    assert "c.csv: No commanded orientation: that of the reference pose is used." in notes


def test_a_command_without_a_dwell_is_a_way_point(made, commands, tmp_path):
    log = made_of.poses_csv(tmp_path / "a.csv", made)
    lines = log.read_text().splitlines()
    lost = (made.t_s > made.sent_s[4]) & (made.t_s < made.sent_s[5])
    kept = [lines[0], *(line for line, out in zip(lines[1:], lost, strict=True) if not out)]
    log.write_text("\n".join(kept) + "\n")
    found = import_case("poses", [log], ROBOT, [commands])
    assert np.flatnonzero(~found.measured.read).tolist() == [4]
    assert any("1 held command without a dwell" in note for note in found.notes)


def test_a_dense_log_of_commands_with_tensions(made, tmp_path):
    """Set points on the way are left out; tensions are averaged over the dwell."""
    t = np.arange(0.0, made.t_s[-1], 0.1)
    number = np.clip(np.searchsorted(made.sent_s, t, side="right") - 1, 0, None)
    part = np.clip((t - made.sent_s[number]) / made_of.WAY_S, 0.0, 1.0)[:, None]
    pose = made.truth.command_pose
    told = pose[np.maximum(number - 1, 0)] * (1 - part) + pose[number] * part
    told[:, 3:] /= np.linalg.norm(told[:, 3:], axis=1, keepdims=True)
    wanted = [k for k in range(len(pose)) if k == 0 or np.any(pose[k] != pose[k - 1])]
    pull = np.searchsorted(wanted, number, side="right") + 0.1 * np.random.default_rng(
        0
    ).standard_normal(len(t))
    names = "t_s,cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz,tension_2_N"
    rows = [",".join(f"{v:.9f}" for v in [a, *b, c]) for a, b, c in zip(t, told, pull, strict=True)]
    dense = tmp_path / "dense.csv"
    dense.write_text("\n".join([names, *rows]) + "\n")
    log = made_of.poses_csv(tmp_path / "a.csv", made)
    found = import_case("poses", [log], ROBOT, [dense])
    data = found.measured
    assert data.command_pose == pytest.approx(pose[wanted], abs=1e-8)
    assert data.tensions[1:, 1] == pytest.approx(np.arange(2, len(wanted) + 1), abs=0.2)
    assert 0.01 < data.sigma.tension_N < 0.06
    assert any("set points between held commands left out" in note for note in found.notes)


def test_two_recordings_are_one_case(made, commands, tmp_path):
    logs = [made_of.poses_csv(tmp_path / f"{day}.csv", made) for day in ("monday", "tuesday")]
    data = import_case("poses", logs, ROBOT, [commands, commands]).measured
    assert data.n_rows == 2 * made.truth.n_rows
    assert data.run[0].startswith("monday.csv: ") and data.run[-1].startswith("tuesday.csv: ")
    assert np.all(np.diff(data.t_s) > 0.0)
    n = made.truth.n_rows
    assert data.t_s[n] == pytest.approx(data.t_s[n - 1] + 60.0)
    assert data.sigma.position_m == pytest.approx(made_of.NOISE_M / np.sqrt(60), rel=0.3)


def test_noise_that_goes_together_counts_for_less():
    rng = np.random.default_rng(1)
    white = rng.standard_normal((4000, 3))
    alike = np.repeat(rng.standard_normal((40, 3)), 100, axis=0)
    assert np.mean([mean_error(w) for w in np.split(white, 10)]) == pytest.approx(0.05, rel=0.2)
    # forty of one hundred that are the same: the error is that of forty, not of four thousand
    assert mean_error(alike) == pytest.approx(1 / np.sqrt(40), rel=0.5)


def test_zeros_in_a_log_stand_for_not_seen(tmp_path, made, commands):
    log = made_of.poses_csv(tmp_path / "log.csv", made)
    whole = import_case("poses", [log], ROBOT, [commands]).measured
    head, *lines = log.read_text().splitlines()
    gone = lines[len(lines) // 3].split(",")
    gone[1:4] = ["0", "0", "0"]
    lines[len(lines) // 3] = ",".join(gone)
    log.write_text("\n".join([head, *lines]))
    found = import_case("poses", [log], ROBOT, [commands])
    assert any("exactly 0 0 0 count as not seen" in note for note in found.notes)
    assert found.measured.position == pytest.approx(whole.position, abs=1e-4)


@pytest.mark.parametrize("flicker", [0.0, 1e-3], ids=["repeated", "last digit"])
@pytest.mark.parametrize("digits", [0, 1, 9])
def test_what_only_the_last_digit_shows_is_not_stated(tmp_path, flicker, digits):
    """1e-32 rad of an orientation that is repeated was written, and 1e-7 of one in 0.001 deg.

    Positions scatter by half their last digit where that is 0.1 mm; in whole mm they do not.
    """
    rng, rows, told = np.random.default_rng(0), [], []
    for k, place in enumerate(np.array([[0.3, 0.2, 0.1], [0.5, 0.2, 0.1], [0.4, 0.3, 0.15]])):
        quat = np.array([1.0, 0.013 * k, 0.007, 0.002])
        told.append([3.0 * k, *place])
        rows += [
            [
                3.0 * k + 0.05 * j,
                *np.round(1e3 * place + rng.normal(0.0, 0.05, 3), digits),
                *(quat + flicker * (j == 7) * np.eye(4)[1]),
            ]
            for j in range(40)
        ]
    log, commands = tmp_path / "log.csv", tmp_path / "commands.csv"
    heads = ("t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz", "t_s,cmd_x_m,cmd_y_m,cmd_z_m")
    for path, head, table in zip((log, commands), heads, (rows, told), strict=True):
        path.write_text("\n".join([head, *(",".join(map(str, row)) for row in table)]))
    found = import_case("poses", [log], ROBOT, [commands], ImportChoices(aligned=True))
    sigma = found.measured.sigma
    assert sigma.orientation_rad is None
    assert sigma.position_m is None if digits == 0 else 1e-6 < sigma.position_m < 1e-4
    hidden = "position and orientation" if digits == 0 else "mm; orientation"
    assert f"{hidden} not stated: within a dwell only the last digit changes" in " ".join(
        found.notes
    )


def test_the_command_writes_a_case_and_names_the_next_one(made, commands, tmp_path):
    xml, out = tmp_path / "robot.xml", tmp_path / "case"
    xml.write_text(soft_xml(), encoding="utf-8")
    take = made_of.motive_csv(tmp_path / "take.csv", made)
    done = run(
        "import", "motive", take, "--robot", xml, "--commands", commands, "--out", out, status=0
    )
    assert f"next: crosscheck compare {out / 'robot.xml'} {out / 'measured.csv'}" in done.stdout
    assert "24 dwells" in done.stdout and "rms remain" in done.stdout
    data = crosscheck.load_measurements(out / "measured.csv", ROBOT)
    assert set(data.free) == {"tracker_frame", "tracker_target"}
    assert data.sigma.position_m is not None
    assert len((out / "dwells.csv").read_text().splitlines()) == 25
    said = json.loads((out / "import.json").read_text())
    assert said["dwells"] == 24
    assert set(said["made"]["sha256"]) == {"robot.xml", "take.csv", commands.name}
    assert crosscheck.compare(out / "robot.xml", out / "measured.csv", TRUE).is_noise
