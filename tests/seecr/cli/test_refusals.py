"""What a user may get wrong at the seecr command: one sentence, status 2, nothing written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from called import BARE, drawn_bare, ran, refused_in_a_line
from click.testing import CliRunner

from crosscheck.cli import main as crosscheck
from seecr import load_robot, model_path
from seecr.cli import main as seecr
from seecr.errors import RobotError

CSV = "run,cmd_x_m,cmd_y_m,cmd_z_m\na,0.4,0.25,0.1\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands write into a folder of the test."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("pose demobot_parallel 400 250 100",
         "X: expected metres, in the range of demobot_parallel's frame, 0.834 m across, got 400"),
        ("pose nobot 0 0 1",
         "nobot: neither a file nor a shipped robot; expected an MJCF file or one of"),
        ("pose no.xml 0 0 1", "no.xml: no such file; expected an MJCF model"),
        ("pose demobot_cogiro 1 2", "expected X Y Z or X Y Z QW QX QY QZ, got 2"),
        ("pose demobot_cogiro 0.2 0.2 0.1 --modle a", "Did you mean"),
        ("pose demobot_cogiro 0.2 0.2 0.1 --cable -1", "--cable: expected vectran, fishing"),
        ("pose demobot_cogiro 0.2 0.2 0.1 --model no.toml", "no.toml: no such file"),
        ("pose planar_vertical 0.4 0.1 0.2", "its joints cannot reach"),
        ("sweep demobot_cogiro", "expected one of POSES.csv, --line, --grid; got none"),
        ("sweep demobot_cogiro no.csv", "no.csv: no such file; expected a CSV file in UTF"),
        ("sweep demobot_cogiro --grid 0:1 0 0", "--grid: expected FIRST:LAST:"),
        ("sweep demobot_cogiro --grid 0:1:0 0 0", "a count above zero"),
        ("map cogiro_large -x:1:2", "No such option"),
        # click took the options after it for its values, and then complained of "out"
        ("map demobot_cogiro --grid 21 --parts --out out",
         "--grid: expected X Y Z, got --parts (see seecr map --help)"),
        ("map demobot_cogiro --model --out out", "--model: expected M.toml, got --out"),
        ("pose demobot_parallel 0.4 0.25 nan", "Z: expected metres, in the range of"),
        ("pose demobot_parallel 1e300 0 1", "got 1e+300"),
        ("pose demobot_parallel 0.4 0.25 0.1 --cable 1e300",
         "--cable: expected vectran, fishing, E S from 0.001 to 1e+12 N, or a rope such as "
         "'steel 7x19 3mm', got '1e300'"),
        ("pose demobot_parallel 0.4 0.25 0.1 1 1 0 0",
         "QW QX QY QZ: expected a unit quaternion, scalar first, got one of norm 1.414"),
        ("pose here.csv 0 0 0", "here.csv: begins with 'run,cmd_x_m,cmd_y_m,cmd_z_m', which is "
         "not XML; expected the robot as MJCF, XML that begins with <mujoco; the robot's file "
         "comes first"),
        ("pose picture.xml 0 0 0", "picture.xml: is a PNG picture; expected the robot as MJCF"),
        ("pose empty.xml 0 0 0", "empty.xml: is empty; expected the robot as MJCF"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model noise.toml",
         "noise.toml: is not a model, it has sigma; expected a model as crosscheck add writes it"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model here.csv",
         "; expected a model as crosscheck add writes it"),
        ("sweep demobot_parallel far.csv",
         "far.csv: line 2, column cmd_x_m: far outside the robot: expected numbers of the size of "
         "its frame, 0.834 m across, got 400 m; are these really m?"),
        ("sweep demobot_parallel far_mm.csv",
         "far_mm.csv: line 2, column cmd_z_mm: far outside the robot: expected numbers of the size "
         "of its frame, 0.834 m across, got 60000 mm; are these really mm? Name the column by its "
         "unit, such as cmd_z_um"),
        ("sweep demobot_parallel huge.csv",
         "huge.csv: line 2, column cmd_x_m: expected a number in every row, got '1e300', "
         "which is too large; numbers go from -1e30 to 1e30"),
        ("sweep demobot_parallel --line 0.4 0.25 0.1 0.4 250 0.1", "Y: expected metres"),
        ("sweep demobot_parallel --grid 0:inf:3 0.25 0.1", "got '0:inf:3'"),
        ("sweep demobot_parallel --grid 0:1:100000 0:1:100000 0.1",
         "--grid: expected at most 1e+07 poses, got 1.0e+10"),
        ("sweep demobot_parallel --grid 0:1:99999999999999 0 0.1", "at most 1e+07 poses"),
        ("sweep demobot_parallel --line 0.1 0.2 0.1 0.4 0.2 0.1 --count 100000000",
         "--count: expected at most 1e+07 poses, got 1.0e+08"),
        ("sweep demobot_parallel here.csv --turned 1 0 0 0",
         "--turned applies to --line and --grid; commands of a file are turned by columns such as "
         "cmd_rx_deg; leave it out, or add them to here.csv"),
        ("sweep demobot_parallel --line 0.3 0.2 0.1 0.4 0.2 0.1 --turned 1 1 0 0",
         "--turned: expected a unit quaternion, scalar first, got one of norm 1.414"),
        ("map demobot_parallel --turned 0.97 0 0.2 0",
         "--turned: expected a unit quaternion, scalar first, got one of norm 0.9904"),
        ("map demobot_parallel --grid 200:300:3 0.25 0.1", "X: expected metres"),
        ("map demobot_parallel --lowest 50 --highest 1",
         "lowest at most 1e+30, got lowest 50 and highest 1"),
        ("map demobot_parallel --wrench nan 0 0 0 0 0",
         "wrenches [N, N m] holds numbers that are not finite"),
        ("map demobot_parallel --wrench 1e300 0 0 0 0 0",
         "wrenches [N, N m] holds numbers that are not finite, or beyond 1e+30"),
        ("map demobot_parallel --lowest 1e300",
         "0 <= lowest <= highest [N], lowest at most 1e+30, got lowest 1e+300 and highest inf"),
        ("correct demobot_parallel here.csv --lowest 1e300", "lowest at most 1e+30"),
        ("correct demobot_parallel told.csv",
         "told.csv: contains rest lengths; expected the wanted poses, such as cmd_x_m"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model empty.xml",
         "empty.xml: is empty; expected a model as crosscheck add writes it"),
        ("pose long.xml 0.4 0.25 0.1", "long.xml: each of the tendons cable1, cable2, cable3, "
         "cable4, cable5, cable6, cable7 and cable8 has rest length 1e+06 m; expected "
         "metres, of the size of the frame, 0.834 m across"),
        ("pose stiff.xml 0.4 0.25 0.1",
         "stiffness x rest length of cable1 holds a number that is not finite, or beyond 1e+30"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model a.toml --model=b.toml",
         "--model: expected once, got 2 times; leave out all but one (see seecr pose --help)"),
        ("sweep demobot_parallel told.csv --out o --out p --out q", "--out: expected once, got 3 "),
        ("export demobot_parallel out.csv",
         "out.csv: expected the name of an MJCF file to write, such as out.xml"),
        ("export own.xml own.xml",
         "own.xml: is the robot's own file; expected another file to write"),
        ("export own.xml out.xml nan 0 1", "X: expected metres"),
        ("export own-mujoco.xml own.xml",
         "own-mujoco.xml: is the robot's own file; expected another file to write"),
        ("export own.xml out.xml 0.4 0.25 0.1", "X Y Z is the pose for out-mujoco.xml, and the "
         "model's effects need no such file; leave it out"),
        ("sweep demobot_parallel here.csv --count 5",
         "--count applies to --line, got it together with here.csv, which sets the number of "
         "poses; leave it out"),
        ("sweep demobot_parallel --grid 0:1:3 0.2 0.1 --count 5",
         "--count applies to --line, got it together with --grid"),
        ("sweep demobot_parallel metres.csv",
         "metres.csv: line 2, column cmd_x_mm: expected numbers of the size of the "
         "robot's frame, 0.834 m across, got at most 0.4 mm; are these really mm? Name the "
         "column by its unit, such as cmd_x_m"),
        ("sweep demobot_parallel lengths.csv",
         "lengths.csv: line 2, column length_1_mm: expected numbers of the size of the robot's "
         "frame, 0.834 m across, got at most 0.5 mm; are these really mm?"),
        ("correct demobot_parallel here.csv --lowest 5 --aim 1", "aim must lie between "
         "lowest and highest tension, for cable number 1 5 to inf N, got 1 N"),
        ("correct demobot_parallel here.csv --highest 5 --aim 1,9", "aim"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model odd.toml",
         "odd.toml: line 2: [robot] mass_kg: expected a number, got 'heavy'; leave it out"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model two.toml",
         "two.toml: line 4: effect stiffness is listed twice; expected it once"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(tmp_path: Path, words: str, said: str) -> None:
    (tmp_path / "here.csv").write_text(CSV)
    (tmp_path / "far.csv").write_text(CSV.replace("0.4", "400"))
    far_mm = CSV.replace("_m", "_mm").splitlines()[0] + "\nup,400,250,60000\n"
    (tmp_path / "far_mm.csv").write_text(far_mm)
    names = ",".join(f"length_{i}_m" for i in range(1, 9))
    (tmp_path / "told.csv").write_text(f"{names}\n{','.join(['0.5'] * 8)}\n")
    (tmp_path / "lengths.csv").write_text((tmp_path / "told.csv").read_text().replace("_m", "_mm"))
    (tmp_path / "metres.csv").write_text("cmd_x_mm,cmd_y_mm,cmd_z_mm\n0.4,250,100\n")
    (tmp_path / "odd.toml").write_text('[robot]\nmass_kg = "heavy"\n')
    (tmp_path / "two.toml").write_text(
        '[[effect]]\nname = "stiffness"\n[[effect]]\nname = "stiffness"\n'
    )
    (tmp_path / "huge.csv").write_text(CSV.replace("0.4", "1e300"))
    (tmp_path / "picture.xml").write_bytes(b"\x89PNG\r\n\x1a\n\0")
    (tmp_path / "empty.xml").write_text(" \n")
    (tmp_path / "noise.toml").write_text('[sigma]\nposition_m = "0.1mm"\n')
    own = model_path("demobot_parallel").read_text()
    (tmp_path / "own.xml").write_text(own)
    (tmp_path / "own-mujoco.xml").write_text(own)
    (tmp_path / "long.xml").write_text(re.sub('springlength="[^"]*"', 'springlength="0 1e6"', own))
    (tmp_path / "stiff.xml").write_text(re.sub('stiffness="[^"]*"', 'stiffness="1e300"', own))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert said in refused_in_a_line(f"seecr {words}")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_platform_that_falls_is_told_without_vibrations() -> None:
    """Its pose is unknown, and so are mass matrix and frequencies there."""
    said = ran("seecr pose planar_vertical 0.4 0 0.3 --cable 0.01 --alone", 3).stdout
    assert "no equilibrium found" in said and "natural frequencies" not in said


@pytest.mark.parametrize(
    "words", ["pose {} 3 3 3 --alone", f"sweep {{}} --count 1 --line 3 3 3 3 3 3 {BARE}"]
)
def test_a_platform_that_is_free_to_move_is_not_at_rest(words: str) -> None:
    """It had said "0 of 1 pose at rest" and ended with status 0."""
    said = ran(f"seecr {words.format('demobot_parallel')}", 3).stdout
    assert "free to move along at least one direction" in said
    where = "1 of 1 command outside the frame: up to 4.74 m from the reference position, and the"
    assert f"{where} frame is 0.834 m across" in said


def test_commands_outside_the_frame_are_counted() -> None:
    line = "seecr sweep demobot_parallel --count 3 --line 0.4 0.25 0.1"
    assert "1 of 3 commands outside the frame: up to 1" in drawn_bare(f"{line} 1.4 0.25 0.1")
    assert "the frame" not in drawn_bare(f"{line} 0.5 0.25 0.1")


@pytest.mark.parametrize("verb", ["map", "sweep"])
def test_a_grid_may_begin_below_zero(verb: str) -> None:
    """The origin of many halls is in the middle of the floor; it was taken for an option."""
    assert "4" in drawn_bare(f"seecr {verb} cogiro_large --grid -1:1:2 -.5:0.5:2 2", 0)


@pytest.mark.slow
def test_a_map_of_a_point_mass_on_a_free_joint_names_the_cure() -> None:
    text = model_path("camera").read_text()
    loose = re.sub(r'(<joint [^>]*type="slide"[^>]*/>\s*)+', "<freejoint/>", text)
    assert loose.count("<freejoint/>") == 1 and "slide" not in loose.split("<body", 1)[1]
    Path("loose.xml").write_text(loose)
    x, y, z = load_robot("loose.xml").reference_pose[:3]
    said = refused_in_a_line(f"seecr map loose.xml --grid {x} {y} {z} --no-elastic")
    assert "give it three slide joints instead of the free joint" in said
    assert "wider limits" not in said


@pytest.mark.parametrize(
    ("words", "read", "lost"),
    [
        ("correct planar_vertical {} --highest 0.01", "corrected.csv", "corrected.csv"),
        ("correct planar_vertical {}", "corrected.txt", "corrected.toml"),
        ("sweep planar_vertical {}", "sweep.txt", "sweep.toml"),
    ],
)
def test_no_command_removes_what_it_reads(words: str, read: str, lost: str) -> None:
    """Files that only some results have were removed, though the user's commands were in them."""
    Path(read).write_text("cmd_x_m,cmd_z_m\n0.4,0.3\n")
    Path(read).with_suffix(".toml").write_text('start = "first_row"\n')
    before = sorted(Path().iterdir())
    said = refused_in_a_line(f"seecr {words.format(read)} --out .")
    assert f"{lost}: would be overwritten, but was read" in said
    assert sorted(Path().iterdir()) == before


@pytest.mark.parametrize(("command", "own"), [("sweep", "sweep.csv"), ("correct", "corrected.csv")])
def test_files_that_no_older_result_made_are_not_replaced(command: str, own: str) -> None:
    Path("poses.csv").write_text("cmd_x_m,cmd_z_m\n0.4,0.3\n")
    mine = Path("out", own)
    mine.parent.mkdir()
    mine.write_text("mine\n")
    words = f"seecr {command} planar_vertical poses.csv --out out"
    said = refused_in_a_line(words)
    assert f"{mine}: would be overwritten, but no command wrote it" in said
    assert list(mine.parent.iterdir()) == [mine] and mine.read_text() == "mine\n"
    mine.unlink()
    for _again in range(2):
        ran(words, 0)


# --- Statuses: what nobody foresaw has one of its own, and is neither a failed gate nor bad input


@pytest.mark.parametrize("error", [ZeroDivisionError("by \x1b[31mnothing"), MemoryError()])
def test_a_defect_is_a_sentence_and_status_70(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fails(*_arguments: object) -> None:
        raise error

    monkeypatch.setattr("seecr.cli.arguments.robot_at", fails)
    words = ["pose", "demobot_parallel", "0.4", "0.25", "0.1"]
    done = CliRunner().invoke(seecr, words)
    assert done.exit_code == 70 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("seecr: a defect of seecr 0.") and type(error).__name__ in line
    assert "please report it" in line and "Traceback" not in line and "\x1b" not in line
    shown = CliRunner().invoke(seecr, [*words, "--debug"])
    assert shown.exit_code == 70 and "Traceback" in shown.stderr and "robot_at" in shown.stderr


def test_debug_changes_nothing_of_what_works() -> None:
    words = ["pose", "planar_vertical", "0.4", "0", "0.2"]
    plain, debug = (CliRunner().invoke(seecr, [*words, *more]) for more in ([], ["--debug"]))
    assert plain.exit_code == debug.exit_code == 0
    assert plain.stdout == debug.stdout


@pytest.mark.slow
def test_a_setting_that_numba_refuses_is_no_failed_gate(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_NUM_THREADS": "0"}
    words = [sys.executable, "-m", "seecr", "pose", "planar_vertical", "0.4", "0", "0.2"]
    done = subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 70
    assert b"NUMBA_NUM_THREADS" in done.stderr or b"threads" in done.stderr


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a device of Unix")
@pytest.mark.parametrize("command", ["robot", "data"])
def test_a_device_is_no_file(command: str, tmp_path: Path) -> None:
    robot = model_path("planar_vertical") if command == "data" else "/dev/zero"
    words = ["compare", str(robot), "/dev/zero", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(crosscheck, words)
    assert done.exit_code == 2 and "/dev/zero: is a device; expected" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["&#27;[31mred", "a&#7;b", "n" * 100_000])
def test_a_name_that_cannot_be_shown_is_refused_and_not_echoed(name: str, tmp_path: Path) -> None:
    robot = tmp_path / "robot.xml"
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    robot.write_text(text.replace('model="planar_vertical"', f'model="{name}"'))
    with pytest.raises(RobotError, match="cannot be shown; expected at most 100 char") as refused:
        load_robot(robot)
    said = str(refused.value)
    assert said.isprintable() and len(said) < 300 + len(str(robot))
