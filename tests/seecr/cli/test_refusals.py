"""What a user may get wrong at the seecr command: one sentence, status 2, nothing written."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from seecr.cli import main
from seecr.description.mjcf import load_robot, model_path

CSV = "run,cmd_x_m,cmd_y_m,cmd_z_m\na,0.4,0.25,0.1\n"
ROBOT = "planar_vertical"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("pose demobot_parallel 400 250 100",
         "X: expected metres, in the range of demobot_parallel's frame, 0.834 m across, got 400"),
        ("pose demobot_parallel 0.4 0.25 nan", "Z: expected metres, in the range of"),
        ("pose demobot_parallel 1e300 0 1", "got 1e+300"),
        ("pose demobot_parallel 0.4 0.25 0.1 --cable 1e300",
         "--cable: expected vectran, fishing or k_c from 0.001 to 1e+12 N, got '1e300'"),
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
        ("sweep demobot_parallel far.csv --out o",
         "far.csv: line 2, column cmd_x_m: far outside the robot: expected numbers of the size of "
         "its frame, 0.834 m across, got 400 m; are these really m?"),
        ("sweep demobot_parallel far_mm.csv --out o",
         "far_mm.csv: line 2, column cmd_z_mm: far outside the robot: expected numbers of the size "
         "of its frame, 0.834 m across, got 60000 mm; are these really mm? Name the column by its "
         "unit, such as cmd_z_um"),
        ("sweep demobot_parallel huge.csv --out o",
         "huge.csv: line 2, column cmd_x_m: expected a number in every row, got '1e300', "
         "which is too large; numbers go from -1e30 to 1e30"),
        ("sweep demobot_parallel --line 0.4 0.25 0.1 0.4 250 0.1 --out o", "Y: expected metres"),
        ("sweep demobot_parallel --grid 0:inf:3 0.25 0.1 --out o", "got '0:inf:3'"),
        ("sweep demobot_parallel --grid 0:1:100000 0:1:100000 0.1 --out o",
         "--grid: expected at most 1e+07 poses, got 1.0e+10"),
        ("sweep demobot_parallel --grid 0:1:99999999999999 0 0.1 --out o", "at most 1e+07 poses"),
        ("sweep demobot_parallel --line 0.1 0.2 0.1 0.4 0.2 0.1 --count 100000000 --out o",
         "--count: expected at most 1e+07 poses, got 1.0e+08"),
        ("sweep demobot_parallel here.csv --turned 1 0 0 0 --out o",
         "--turned applies to --line and --grid; commands of a file are turned by columns such as "
         "cmd_rx_deg; leave it out, or add them to here.csv"),
        ("sweep demobot_parallel --line 0.3 0.2 0.1 0.4 0.2 0.1 --turned 1 1 0 0 --out o",
         "--turned: expected a unit quaternion, scalar first, got one of norm 1.414"),
        ("map demobot_parallel --turned 0.97 0 0.2 0 --out o",
         "--turned: expected a unit quaternion, scalar first, got one of norm 0.9904"),
        ("map demobot_parallel --grid 200:300:3 0.25 0.1 --out o", "X: expected metres"),
        ("map demobot_parallel --lowest 50 --highest 1 --out o",
         "lowest at most 1e+30, got lowest 50 and highest 1"),
        ("map demobot_parallel --wrench nan 0 0 0 0 0 --out o",
         "wrenches [N, N m] holds numbers that are not finite"),
        ("map demobot_parallel --wrench 1e300 0 0 0 0 0 --out o",
         "wrenches [N, N m] holds numbers that are not finite, or beyond 1e+30"),
        ("map demobot_parallel --lowest 1e300 --out o",
         "0 <= lowest <= highest [N], lowest at most 1e+30, got lowest 1e+300 and highest inf"),
        ("correct demobot_parallel here.csv --lowest 1e300 --out o", "lowest at most 1e+30"),
        ("correct demobot_parallel told.csv --out o",
         "told.csv: contains rest lengths; expected the wanted poses, such as cmd_x_m"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model empty.xml",
         "empty.xml: is empty; expected a model as crosscheck add writes it"),
        ("pose long.xml 0.4 0.25 0.1", "long.xml: tendon cable1 has rest length 1e+06 m; expected "
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
        ("sweep demobot_parallel here.csv --count 5 --out o",
         "--count applies to --line, got it together with here.csv, which sets the number of "
         "poses; leave it out"),
        ("sweep demobot_parallel --grid 0:1:3 0.2 0.1 --count 5 --out o",
         "--count applies to --line, got it together with --grid"),
        ("sweep demobot_parallel metres.csv --out o",
         "metres.csv: line 2, column cmd_x_mm: expected numbers of the size of the "
         "robot's frame, 0.834 m across, got at most 0.4 mm; are these really mm? Name the "
         "column by its unit, such as cmd_x_m"),
        ("sweep demobot_parallel lengths.csv --out o",
         "lengths.csv: line 2, column length_1_mm: expected numbers of the size of the robot's "
         "frame, 0.834 m across, got at most 0.5 mm; are these really mm?"),
        ("correct demobot_parallel here.csv --lowest 5 --aim 1 --out o", "aim must lie between "
         "lowest and highest tension, for cable number 1 5 to inf N, got 1 N"),
        ("correct demobot_parallel here.csv --highest 5 --aim 1,9 --out o", "aim"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model odd.toml",
         "odd.toml: line 2: [robot] mass_kg: expected a number, got 'heavy'; leave it out"),
        ("pose demobot_parallel 0.4 0.25 0.1 --model two.toml",
         "two.toml: line 4: effect stiffness is listed twice; expected it once"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
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
    result = CliRunner().invoke(main, words.split())
    assert result.exit_code == 2 and result.stdout == ""
    assert said in result.stderr and result.stderr.count("\n") == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_platform_that_falls_is_told_without_vibrations() -> None:
    """Its pose is unknown, and so are mass matrix and frequencies there."""
    result = CliRunner().invoke(
        main, ["pose", ROBOT, "0.4", "0", "0.3", "--cable", "0.01", "--alone"]
    )
    assert result.exit_code == 3
    assert "no equilibrium found" in result.stdout and "natural frequencies" not in result.stdout


@pytest.mark.parametrize("words", ["pose demobot_parallel", "sweep demobot_parallel --count 1"])
def test_a_platform_that_is_free_to_move_is_not_at_rest(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had said "0 of 1 pose at rest" and ended with status 0."""
    monkeypatch.chdir(tmp_path)
    verb, robot, *more = words.split()
    place = ["3", "3", "3"]
    quiet = ["--line", *place, *place, "--figure", "none", "--no-recording", "--out", "o"]
    given = quiet if verb == "sweep" else [*place, "--alone"]
    result = CliRunner().invoke(main, [verb, robot, *more, *given])
    assert result.exit_code == 3, result.output
    assert "free to move along at least one direction" in result.stdout
    where = "1 of 1 command outside the frame: up to 4.74 m from the reference position, and the"
    assert f"{where} frame is 0.834 m across" in result.stdout


def test_commands_outside_the_frame_are_counted(tmp_path: Path) -> None:
    line = ["--line", "0.4", "0.25", "0.1", "1.4", "0.25", "0.1", "--count", "3"]
    quiet = ["--figure", "none", "--no-recording", "--out", str(tmp_path)]
    said = CliRunner().invoke(main, ["sweep", "demobot_parallel", *line, *quiet]).stdout
    assert "1 of 3 commands outside the frame: up to 1" in said
    inside = [*line[:4], "0.5", *line[5:]]
    assert (
        "the frame"
        not in CliRunner().invoke(main, ["sweep", "demobot_parallel", *inside, *quiet]).stdout
    )


@pytest.mark.parametrize("verb", ["map", "sweep"])
def test_a_grid_may_begin_below_zero(verb: str, tmp_path: Path) -> None:
    """The origin of many halls is in the middle of the floor; it was taken for an option."""
    grid = ("--grid", "-1:1:2", "-.5:0.5:2", "2")
    quiet = ("--figure", "none", "--no-recording", "--out", str(tmp_path / "o"))
    result = CliRunner().invoke(main, [verb, "cogiro_large", *grid, *quiet])
    assert result.exit_code == 0 and "4" in result.stdout, result.output
    wrong = CliRunner().invoke(main, [verb, "cogiro_large", "-x:1:2", *quiet])
    assert wrong.exit_code == 2 and "No such option '-x:1:2'" in wrong.output


@pytest.mark.slow
def test_a_map_of_a_point_mass_on_a_free_joint_names_the_cure(tmp_path: Path) -> None:
    text = model_path("camera").read_text()
    loose = re.sub(r'(<joint [^>]*type="slide"[^>]*/>\s*)+', "<freejoint/>", text)
    assert loose.count("<freejoint/>") == 1 and "slide" not in loose.split("<body", 1)[1]
    (tmp_path / "loose.xml").write_text(loose)
    x, y, z = map(str, load_robot(tmp_path / "loose.xml").reference_pose[:3])
    words = ["map", str(tmp_path / "loose.xml"), "--grid", x, y, z, "--no-elastic"]
    result = CliRunner().invoke(main, [*words, "--out", str(tmp_path / "o")])
    assert result.exit_code == 2 and result.stderr.count("\n") == 1, result.output
    assert "give it three slide joints instead of the free joint" in result.stderr
    assert "wider limits" not in result.stderr


@pytest.mark.parametrize(
    ("words", "read", "lost"),
    [
        ("correct planar_vertical {} --highest 0.01", "corrected.csv", "corrected.csv"),
        ("correct planar_vertical {}", "corrected.txt", "corrected.toml"),
        ("sweep planar_vertical {}", "sweep.txt", "sweep.toml"),
    ],
)
def test_no_command_removes_what_it_reads(tmp_path: Path, words: str, read: str, lost: str) -> None:
    """Files that only some results have were removed, though the user's commands were in them."""
    poses = tmp_path / read
    poses.write_text("cmd_x_m,cmd_z_m\n0.4,0.3\n")
    poses.with_suffix(".toml").write_text('start = "first_row"\n')
    before = sorted(tmp_path.iterdir())
    got = CliRunner().invoke(main, [*words.format(poses).split(), "--out", str(tmp_path)])
    assert got.exit_code == 2 and f"{lost}: would be overwritten, but was read" in got.output
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("command", "own"), [("sweep", "sweep.csv"), ("correct", "corrected.csv")])
def test_files_that_no_older_result_made_are_not_replaced(
    tmp_path: Path, command: str, own: str
) -> None:
    poses, out = tmp_path / "poses.csv", tmp_path / "out"
    poses.write_text("cmd_x_m,cmd_z_m\n0.4,0.3\n")
    out.mkdir()
    (out / own).write_text("mine\n")
    words = [command, "planar_vertical", str(poses), "--out", str(out)]
    got = CliRunner().invoke(main, words)
    assert got.exit_code == 2 and got.stderr.count("\n") == 1
    assert f"{out / own}: would be overwritten, but is not part of an older result" in got.stderr
    assert [path.name for path in out.iterdir()] == [own] and (out / own).read_text() == "mine\n"
    (out / own).unlink()
    for _again in range(2):
        assert CliRunner().invoke(main, words).exit_code == 0
