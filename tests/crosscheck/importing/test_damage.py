"""What is typically wrong with recordings is said in one sentence: where, what, what to do."""

from __future__ import annotations

import re
from dataclasses import replace

import made_recordings as made_of
import numpy as np
import pytest
from called import refused
from made_data import soft_cogiro, soft_xml

from crosscheck.importing import import_case
from crosscheck.importing.choices import ImportChoices
from seecr.description.mjcf import load_robot, model_path
from seecr.errors import SeecrError

ROBOT = soft_cogiro()
POINTS = tuple(f"platform:points{i}" for i in (1, 2, 3))


@pytest.fixture(scope="module")
def made():
    return made_of.recording(ROBOT)


@pytest.fixture(scope="module")
def files(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    return {
        "motive": made_of.motive_csv(folder / "take.csv", made),
        "vicon": made_of.vicon_csv(folder / "trial.csv", made),
        "poses": made_of.poses_csv(folder / "log.csv", made),
        "commands": made_of.commands_csv(folder / "commands.csv", made),
    }


def lines_of(path):
    return path.read_text().splitlines()


def cell(lines, row, column, text):
    """The line of a file, counted from 1, with another cell, counted from 1."""
    cells = lines[row - 1].split(",")
    cells[column - 1] = text
    lines[row - 1] = ",".join(cells)
    return lines


DAMAGE = {
    "a cut row": (
        "motive", lambda x: [*x[:500], x[500][:40]],
        r"line 501: expected 22 cells .*, got \d; it is the last line: is the file cut off\? Export"
    ),
    "a short row": (
        "motive", lambda x: [*x[:500], x[500][:40], *x[501:]],
        r"line 501: expected 22 cells as in the row of labels \(line 7\), got \d$"
    ),
    "cut between rows": (
        "motive", lambda x: x[:500],
        r"line 500: expected 2425 frames as the first line says, got 493; is the file cut off\?"
    ),
    "no number": (
        "motive", lambda x: cell(x, 30, 7, "occluded"),
        r"line 30, column X: expected a number, got 'occluded'; export the file again"
    ),
    "a number without end": (
        "motive", lambda x: cell(x, 30, 7, "1e400"),
        r"line 30, column X: expected a number, got '1e400'; export the file again"
    ),
    "times that jump back": (
        "motive", lambda x: [*x[:107], *x[57:]],
        r"line 108, column Time \(Seconds\): expected times that increase after 1.98 s, got 1 s;"
    ),
    "Euler angles": (
        "motive", lambda x: [x[0].replace("Quaternion", "XYZ"), *x[1:]],
        r"line 1: expected Rotation Type Quaternion, or an order of Euler angles such as XYZ, got "
        r"'XYZ' with 4 columns of rotations; export it again"
    ),
    "inches": (
        "motive", lambda x: [x[0].replace("Meters", "Inches"), *x[1:]],
        r"line 1: expected Length Units Meters, Centimeters or Millimeters, got 'Inches'; export"
    ),
    "a local frame": (
        "motive", lambda x: [x[0].replace("Global", "Local"), *x[1:]],
        r"line 1: expected Coordinate Space Global, got 'Local'; export it again in global"
    ),
    "no header": ("motive", lambda x: x[7:], r"line 1: begins with '0'; expected a CSV export of"),
    "labels cut off": ("motive", lambda x: x[:4], r"no row of labels that begins with Frame; is "),
    "nothing but labels": ("motive", lambda x: x[:7], r"line 7: has labels but no rows of frames"),
    "nothing": ("motive", lambda x: [""], r"take.csv: is empty; expected a CSV export of Motive"),
    "Vicon's header": (
        "motive", lambda x: ["Segments", "100", *x[7:]],
        r"line 1: begins with 'Segments'; .* this is an export of Vicon: crosscheck import vicon"
    ),
    "Motive's header": (
        "vicon", lambda x: ["Format Version,1.23,Take Name,a"],
        r"line 1: begins with 'Format Version'; .* export of Motive: crosscheck import motive"
    ),
    "a log": (
        "vicon", lambda x: ["t_s,meas_x_m", "0,1"],
        r"line 1: begins with 't_s'; .* these are columns of a log: crosscheck import poses"
    ),
    "angles of unknown meaning": (
        "vicon", lambda x: x,
        r"line 14: three numbers of a rotation can mean several things; expected --rotation vector"
    ),
    "no rate": (
        "vicon", lambda x: ["" if k == 11 else y for k, y in enumerate(x)],
        r"line 12: expected the rate of the block in Hz, got ''"
    ),
    "no unit": (
        "vicon", lambda x: [y.replace("mm", "") if k > 12 else y for k, y in enumerate(x)],
        r"line 15, column TX: expected a unit of length under the labels"
    ),
    "frames that jump back": (
        "vicon", lambda x: cell(x, 40, 1, "3"),
        r"line 40, column Frame: expected times that increase after 0.48 s, got 0.06 s"
    ),
    "a quaternion of another length": (
        "poses", lambda x: cell(x, 9, 1 + x[0].split(",").index("qw"), "1000"),
        r"line 9, column qw: expected a quaternion of length 1, got 1e\+03; export it again"
    ),
    "a cell without end": (
        "motive", lambda x: [*x[:200], "1" * 140_000, *x[201:]],
        r"line 201: cannot be split into cells: field larger than field limit"
    ),
    "nanoseconds": (
        "poses", lambda x: [x[0].replace("time_s", "time_ns"), *x[1:]],
        "line 1, column time_ns: unknown unit 'ns'; expected t_s or t_ms"
    ),
    "spaces between numbers without names": (
        "poses", lambda x: ["# t x y z qw qx qy qz", *(y.replace(",", " ") for y in x[1:])],
        r"line 2: expected a row of names, and cells separated by commas, semicolons or tabs, got"
    ),
    "a log that jumps back": (
        "poses", lambda x: cell(x, 30, 1, "0.1"),
        r"line 30, column time_s: expected times that increase after 0.54 s, got 0.1 s; are two"
    ),
    "a dwell of one sample": (
        "poses", lambda x: [x[0], *x[1::50]],
        r"line 3: expected at least 5 samples in the shortest dwell, 0.5 s, got one every 1 s; log "
        r"faster, give --rest-for 5 or longer, or, if each row is"
    ),
    "nothing at rest": (
        "poses", lambda x: [x[0], *(f"{0.02 * k:.2f},{0.01 * k:.4f},0,0,1,0,0,0"
                                    for k in range(500))],
        r"nothing rests for 0.5 s: in its slowest tenth the body moves at 500 mm/s or less, and"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_said_in_a_sentence(name, files, tmp_path):
    form, harm, expected = DAMAGE[name]
    broken = tmp_path / files[form].name
    broken.write_text("\n".join(harm(lines_of(files[form]))) + "\n")
    with pytest.raises(SeecrError) as caught:
        import_case(form, [broken], ROBOT, [files["commands"]])
    assert re.search(expected, str(caught.value)), caught.value
    assert "\n" not in str(caught.value)


def test_mixed_ends_of_lines_and_a_mark_at_the_beginning_do_no_harm(files, tmp_path):
    ends = ("\n", "\r\n", "\r")
    mixed = tmp_path / "mixed.csv"
    lines = lines_of(files["motive"])
    text = "\ufeff" + "".join(line + ends[k % 3] for k, line in enumerate(lines))
    mixed.write_text(text, encoding="utf-8", newline="")
    found = [
        import_case("motive", [file], ROBOT, [files["commands"]]).measured
        for file in (mixed, files["motive"])
    ]
    assert np.array_equal(found[0].position, found[1].position)


def wrong(files, form="poses", commands=None, robot=ROBOT, **choices):
    with pytest.raises(SeecrError) as caught:
        import_case(
            form, [files[form]], robot, [commands or files["commands"]], ImportChoices(**choices)
        )
    return str(caught.value)


@pytest.mark.slow
def test_frames_that_cannot_be_aligned(files, made, tmp_path):
    lines = lines_of(files["commands"])
    line, short = tmp_path / "line.csv", tmp_path / "short.csv"
    line.write_text("\n".join([lines[0], *lines[1:4]]) + "\n")
    rows = int(made_of.RATE * made.sent_s[3])
    short.write_text("\n".join(lines_of(files["poses"])[:rows]) + "\n")
    message = wrong({"poses": short}, commands=line)
    assert "the commanded positions of the dwells lie on one line" in message
    # a robot that sags bends them, which is its error and shows no turn about the line
    bent = replace(made, position=made.position + 0.002 * np.sin(20.0 * made.position[:, :1]))
    sagging = made_of.poses_csv(tmp_path / "bent.csv", bent)
    assert "of the dwells lie on one line" in wrong({"poses": sagging}, commands=line)
    about = cell(lines_of(line), 3, 4, str(made.truth.command_pose[1, 1] + 1e-3))
    line.write_text("\n".join(about) + "\n")
    assert "on one line, or so close to one that" in wrong({"poses": sagging}, commands=line)
    # the commands of another recording: the same poses in another order
    other = tmp_path / "other.csv"
    head = [row.split(",")[:2] for row in lines[1:]]
    order = np.random.default_rng(0).permutation(len(head))
    poses = [lines[1:][k].split(",")[2:] for k in order]
    rows = [",".join([*a, *b]) for a, b in zip(head, poses, strict=True)]
    other.write_text("\n".join([lines[0], *rows]) + "\n")
    message = wrong(files, commands=other)
    assert message.startswith(
        f"{files['poses']} with {other}: the frames cannot be aligned: errors of "
    )
    assert "do their clocks agree (--clock)?" in wrong(files, clock=2.0)
    assert "expected these times to overlap; give with --clock how" in wrong(files, clock=900.0)
    two = {"0,0,0": np.zeros(3), "1,0,0": np.ones(3)}
    assert "cannot be aligned by 2 points" in wrong(files, points=two)
    three = {"0,0,0": np.zeros(3), "1,0,0": np.array([1.0, 0, 0]), "0,1,0": np.array([0, 2.0, 0])}
    assert re.search(
        r"point .* is 2 m from where the other points put it", wrong(files, points=three)
    )


def test_files_of_different_robots(files, tmp_path):
    lengths = tmp_path / "lengths.csv"
    lengths.write_text("t_s,length_1_m,length_2_m\n0,1,1\n2,1,1.1\n")
    assert "lengths.csv" in wrong(files, commands=lengths)
    other = load_robot(model_path("planar_vertical"))
    assert "are these the commands of another robot?" in wrong(files, robot=other)
    takes, logs = [files["motive"], files["motive"]], [files["commands"]]
    with pytest.raises(SeecrError, match="2 command logs, one for each recording, got 1; give"):
        import_case("motive", takes, ROBOT, logs)
    with pytest.raises(SeecrError, match="1 command log, one for each recording, got 2; give"):
        import_case("motive", takes[:1], ROBOT, logs * 2)


def test_a_named_point_that_is_never_seen(made, tmp_path, files):
    """Its position was no number, and the frames' alignment ended in another library's error."""
    lost = made.markers.copy()
    lost[:, 2] = np.nan
    vicon = made_of.vicon_csv(tmp_path / "trial.csv", replace(made, markers=lost))
    points = dict(zip(POINTS, np.eye(3), strict=True))
    message = wrong({**files, "vicon": vicon}, "vicon", rotation="vector", points=points)
    assert message == (
        f"{vicon}: never sees marker {POINTS[2]}; expected its position in at least one row; name "
        "another with --point"
    )


def test_bodies_and_markers_that_are_not_there(files):
    assert "has no rigid body 'drone'; expected one of" in wrong(files, "motive", body="drone")
    message = wrong(files, "vicon", markers=("platform:points1", "pl:1", "x"))
    assert "has no marker 'pl:1'; expected one of those it has, nearest first: " in message
    message = wrong(files, "vicon", markers=POINTS[:2], rotation="vector")
    assert "expected three markers or more that are seen at once, got 2 names" in message


@pytest.mark.parametrize(
    ("option", "text", "expected"),
    [
        ("--point", "a=1,2", r"--point a=1,2: expected 3 numbers such as 0.1,0,2.5, got '1,2'"),
        ("--target", "here", r"--target: expected 3 numbers such as 0.1,0,2.5, got 'here'"),
        ("--rest-speed", "1mm", r"--rest-speed: expected a speed such as 1mm/s, got '1mm'"),
    ],
)
def test_options_that_say_something_else(option, text, expected, files, tmp_path):
    xml = tmp_path / "robot.xml"
    xml.write_text(soft_xml(), encoding="utf-8")
    given = ["--robot", xml, "--commands", files["commands"], option, text]
    assert re.search(expected, refused("import", "poses", files["poses"], *given))


def test_the_command_line_says_it_in_one_line_and_writes_nothing(files, tmp_path):
    xml, out = tmp_path / "robot.xml", tmp_path / "case"
    xml.write_text(soft_xml(), encoding="utf-8")
    message = refused(
        "import", "vicon", files["motive"], "--robot", xml, "--commands", files["commands"],
        "--out", out,
    )  # fmt: skip
    assert "crosscheck import motive" in message and not out.exists()


@pytest.mark.parametrize(
    ("form", "given", "said"),
    [
        ("motive", {"aligned": True, "points": {"a": np.zeros(3)}}, "--aligned and --point: exp"),
        ("motive", {"body": "platform", "markers": POINTS}, "--body and --markers: expected one"),
        ("motive", {"shape": {"a": np.zeros(3)}}, "--shape without --markers: expected the names"),
        ("motive", {"rotation": "vector"}, "--rotation with motive: expected it with vicon only:"),
        ("vicon", {"unit": "mm"}, "--unit with vicon: expected it with poses only"),
        ("vicon", {"rotation": "foo"}, "--rotation: expected vector, or the order of Euler angles"),
        ("vicon", {"rotation": "xxy"}, "got 'xxy'"),
    ],
)  # fmt: skip
def test_what_is_said_and_has_no_use(files, form, given, said):
    assert said in wrong(files, form, **given)
