"""The seecr command: arguments, files, statuses; what it computes is tested elsewhere."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from seecr.cli import COMMANDS, main
from seecr.cli.arguments import robot_at
from seecr.columns.commands import read_commands
from seecr.columns.plausible import scalar_last
from seecr.description.mjcf import load_robot, model_path
from seecr.equilibrium.solving import solve
from seecr.pose import transform_points
from seecr.workspace.planar import midline_point

PLACE = ["0.17", "0.25", "0.1"]
# A figure and a recording take most of the time of a command: where nobody looks at them, none.
BARE = ("--figure", "none", "--no-recording")


def run(*args: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in args])


def unmade(document: dict[str, Any]) -> dict[str, Any]:
    """Without how it came about, which is the command's own."""
    return {key: value for key, value in document.items() if key != "made"}


@pytest.mark.parametrize("name", ["planar_vertical", "planar_horizontal"])
def test_the_papers_points_are_printed(name: str) -> None:
    got = run("pose", name, "--alone", *map(str, load_robot(model_path(name)).reference_pose[:3]))
    (line,) = [x for x in got.output.splitlines() if x.startswith("midlines")]
    found = solve(name, load_robot(model_path(name)).reference_pose)
    ends = transform_points(found.pose, found.robot.anchor_points)[0]
    point = 1e3 * midline_point(found.robot.exit_points[:, [0, 2]], ends[:, [0, 2]])
    letter = {"planar_vertical": "V", "planar_horizontal": "H"}[name]
    where = f"meet at x and z {point[0]:.2f} {point[1]:.2f} mm (the paper's {letter}), +0.00 mm"
    assert where in line
    assert "midlines" not in run("pose", "planar_two_cable", "--alone", "0.4", "0", "0.2").output


def test_a_sweep_tells_the_zones_of_slack_cables_and_the_papers_points(tmp_path: Path) -> None:
    """Figs 7, 9 and 11 of the paper, from the command line alone."""
    way = ("--line", "0.17", "0", "0.2", "0.63", "0", "0.2", *BARE, "--out", tmp_path / "v")
    got = run("sweep", "planar_vertical", *way)
    lines = got.output.splitlines()
    at = lines.index(next(x for x in lines if x.startswith("zones of slack cables on the way")))
    assert lines[at + 1] == "  x 170.000 to 285.143 mm, 115.143 mm wide: 2 slack: cable2 cable3"
    assert lines[at + 2] == "  x 285.143 to 296.235 mm, 11.093 mm wide: 1 slack: cable3"
    assert [x.split(": ")[1] for x in lines[at + 3 : at + 6]] == ["0 slack", "1 slack", "2 slack"]
    assert lines[at + 6].startswith(
        "point V goes from x z 175.64 138.04 to x z 624.36 138.04 mm; on the way it is between "
        "-17.80 and +17.80 mm beside the line of the weight"
    )
    document = json.loads((tmp_path / "v" / "sweep.json").read_text())
    zones = document["zones"]
    assert [zone["slack_cables"] for zone in zones] == [2, 1, 0, 1, 2]
    assert zones[0]["slack"] == ["cable2", "cable3"]
    assert zones[0]["from"][0] == 0.17 and zones[0]["to"] == zones[1]["from"]
    assert zones[0]["width_m"] == pytest.approx(0.115143, abs=1e-6)
    assert 0.0 < zones[0]["to_within_m"] <= 5e-7 and zones[0]["from_within_m"] == 0.0
    assert document["midline_point"] == "V"
    assert document["rows"][0]["beside_weight_m"] == pytest.approx(-0.01703, abs=1e-5)
    first = (tmp_path / "v" / "sweep.csv").read_text().splitlines()
    cell = dict(zip(first[0].split(","), first[1].split(","), strict=True))
    assert float(cell["midlines_x_m"]) == document["rows"][0]["midlines_meet_m"][0]
    assert float(cell["beside_weight_m"]) == document["rows"][0]["beside_weight_m"]

    level = run("sweep", "planar_horizontal", *way).output
    assert "on the whole way 0 slack\npoint H goes from x z 169.97 217.82 to " in level
    assert " mm, +0.00 mm beside the line of the weight" in level
    assert "pose 11, 0.3101 mm and 0 deg" in level  # and no rotation of 9.5e-18 deg
    followed = run("sweep", "planar_vertical", "--follow", *way).output
    assert lines[at : at + 6] == [
        x for x in followed.splitlines() if x.startswith("zones") or " mm wide: " in x
    ]
    eight = ("--line", *PLACE, "0.63", "0.25", "0.1", "--json", *BARE, "--out", tmp_path)
    document = json.loads(run("sweep", "demobot_parallel", *eight).stdout)
    assert [zone["slack_cables"] for zone in document["zones"]] == [4, 2, 0, 2, 4]
    assert [round(1e3 * zone["width_m"], 1) for zone in document["zones"][:2]] == [141.3, 15.5]
    assert document["midline_point"] is None and "beside_weight_m" not in document["rows"][0]


def test_a_sweep_of_a_bar_is_compared_with_the_manifold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Figs 3 and 4 of the paper."""
    ends = ("--line", "0.2", "0", "0.5", "0.5", "0", "0.5", "--count", "3")
    line = (*ends, *BARE, "--out", tmp_path / "v")
    bar = run("sweep", "planar_two_cable", *line).output
    assert "the bar is tilted by -34.86 to +0.00 deg" in bar
    assert "to rest where it was commanded to it would tilt by -49.61 to +0.00 deg" in bar
    assert "manifold_at_command_rad" in (tmp_path / "v" / "sweep.csv").read_text()
    first = json.loads((tmp_path / "v" / "sweep.json").read_text())["rows"][0]
    assert first["tilt_rad"] == pytest.approx(-first["rotation_rad"][1], abs=1e-12)
    assert first["manifold_there_rad"] == pytest.approx(first["tilt_rad"], abs=1e-9)
    (tmp_path / "len.csv").write_text("length_1_m,length_2_m\n0.6,0.7\n")
    told = ("sweep", "planar_two_cable", tmp_path / "len.csv", *BARE, "--out", tmp_path / "l")
    out = run(*told).output
    assert "the bar is tilted by" in out and "where it was commanded to" not in out
    monkeypatch.setattr("seecr.cli.sweep._MOST_TILTS", 2)
    many = run("sweep", "planar_two_cable", *line).output
    assert "Tilts of the manifold are not computed: more than 2 poses." in many
    assert "the bar is tilted" not in many


def test_columns_of_a_grid_are_ways_of_their_own_and_many_zones_are_counted(tmp_path: Path) -> None:
    grid = ("--grid", "0.17:0.63:8", "0.25", "0.1:0.2:3", *BARE, "--out", tmp_path)
    text = run("sweep", "demobot_parallel", *grid).output
    zones = json.loads((tmp_path / "sweep.json").read_text())["zones"]
    assert {zone["run"] for zone in zones} == set(range(8)) and len(zones) == 10
    assert text.count(" mm wide: ") == 10
    finer = ("--grid", "0.17:0.63:16", "0.25", "0.1:0.2:3", *BARE, "--out", tmp_path)
    text = run("sweep", "demobot_parallel", *finer).output
    zones = json.loads((tmp_path / "sweep.json").read_text())["zones"]
    assert f"{len(zones)} zones of slack cables, with their widths, in sweep.json" in text
    assert " mm wide: " not in text
    single = ("--grid", "0.2", "0.25", "0.1", *BARE, "--out", tmp_path)
    one = run("sweep", "demobot_parallel", *single)
    assert json.loads((tmp_path / "sweep.json").read_text())["zones"] is None
    assert "zones" not in one.output and "whole way" not in one.output


def test_too_many_changes_are_said_and_not_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("seecr.cli.sweep._MOST_CHANGES", 3)
    way = ("--line", "0.17", "0", "0.2", "0.63", "0", "0.2", *BARE, "--out", tmp_path)
    text = run("sweep", "planar_vertical", *way).output
    assert "Zones of slack cables are not computed: more than 3 poses differ from the one" in text
    assert json.loads((tmp_path / "sweep.json").read_text())["zones"] is None


def test_a_pose_tells_its_zone_the_papers_points_and_all_tilts_of_a_bar() -> None:
    got = json.loads(run("pose", "planar_vertical", "--alone", "0.17", "0", "0.2", "--json").stdout)
    assert (got["slack_cables"], got["slack"]) == (2, ["cable2", "cable3"])
    assert got["midline_point"] == "V" and got["bar"] is None
    assert got["beside_weight_m"] == pytest.approx(-0.01703, abs=1e-5)
    place = ("planar_two_cable", "--alone", "0.3", "0", "0.5")
    got = json.loads(run("pose", *place, "--json").stdout)
    assert got["midline_point"] is None and "beside_weight_m" not in got
    rest, command = got["bar"]["at_rest"], got["bar"]["at_command"]
    assert [one["stable"] for one in rest] == [one["stable"] for one in command] == [True, False]
    assert [one["here"] for one in rest] == [True, False] and not command[0]["here"]
    assert rest[0]["pose"] == pytest.approx(got["pose"], abs=1e-9)
    assert rest[0]["tensions_N"] == pytest.approx(got["tensions_N"], abs=1e-9)
    # figure 3's number
    assert np.degrees(command[0]["theta_rad"]) == pytest.approx(-30.90, abs=5e-3)
    text = run("pose", *place).output
    assert "is in balance at 2 tilts (positive: the second cable's end is up):" in text
    assert "\n  tilt -22.6039 deg: stable, tensions 2.902 and 1.964 N, as it rests here\n" in text
    assert "\n  tilt +158.7076 deg: not stable, tensions 3.406 and 2.333 N\n" in text
    assert "tilt " not in run("pose", "planar_vertical", "--alone", "0.4", "0", "0.2").output


def test_wanted_tensions_are_an_aim(tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    place = load_robot(model_path("ipanema")).reference_pose[:3]
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n{},{},{}\n".format(*place))
    args = ("correct", "ipanema", poses, "--lowest", "1", "--json", "--out", tmp_path / "out")
    pulls = [
        np.mean(json.loads(run(*args, "--aim", aim).stdout)["rows"][0]["tensions_N"])
        for aim in ("minimum", "900", ",".join(8 * ["900"]))
    ]
    assert pulls[0] < 0.8 * pulls[1] and pulls[1] == pytest.approx(pulls[2])
    for wrong in ("most", "1,2", "nan"):
        got = run(*args, "--aim", wrong)
        assert got.exit_code == 2
        assert (
            f"--aim {wrong}: expected minimum, middle, or tensions [N]: one, or 8 with commas" in
            got.output
        )  # fmt: skip


def test_export_writes_into_a_folder(tmp_path: Path) -> None:
    got = run("export", "demobot_cogiro", "there.xml", "--out", tmp_path / "new")
    assert got.exit_code == 0 and (tmp_path / "new" / "there.xml").exists(), got.output
    assert f"seecr pose {tmp_path}/new/there.xml" in got.output
    got = run("export", "demobot_cogiro", tmp_path / "newer" / "there.xml")
    assert got.exit_code == 0 and (tmp_path / "newer" / "there.xml").exists(), got.output
    # and makes none where there is nothing to write
    model = tmp_path / "none.toml"
    model.write_text("abc")
    args = ("demobot_cogiro", "there.xml", "--out", tmp_path / "other", "--model", model)
    assert run("export", *args).exit_code == 2 and not (tmp_path / "other").exists()


@pytest.mark.slow
@pytest.mark.parametrize("command", ["pose", "sweep", "correct"])
def test_a_bar_is_told_what_is_done(command: str, tmp_path: Path, monkeypatch: Any) -> None:
    """As that of maps, which tests of its own look at."""
    said: list[tuple[str, int]] = []

    @contextmanager
    def bar(text: str, total: int) -> Iterator[Any]:
        yield lambda steps, now: said.append((now, steps))

    for module in ("seecr.cli.options", "seecr.cli.sweep"):
        monkeypatch.setattr(f"{module}.progress_bar", bar)
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.2\n0.45,0.25,0.2\n")
    given = ("0.4", "0.25", "0.2") if command == "pose" else (poses, "--out", tmp_path / "out")
    given += BARE if command == "sweep" else ()
    got = run(command, "demobot_cogiro", *given)
    assert got.exit_code == 0, got.output
    assert said[-1][0] in ("solved", "corrected")
    assert sum(steps for _, steps in said) == (2 if command == "sweep" else 100)


def test_every_command_has_help_with_examples() -> None:
    text = run().stdout
    for name, (_, line) in COMMANDS.items():
        assert f"  {name} " in text and line in " ".join(text.split())
        assert f"seecr {name} " in run(name, "--help").stdout
        assert "None" not in run(name, "--help").stdout  # of a number without ends: x<=None


def test_pose_prints_and_writes(tmp_path: Path) -> None:
    result = run("pose", "demobot_parallel", *PLACE, "--cable", "fishing", "--out", tmp_path)
    assert result.exit_code == 0
    assert "turned by 26.53 deg" in result.stdout
    document = json.loads((tmp_path / "pose.json").read_text())
    assert document["exit_status"] == 0 and len(document["tensions_N"]) == 8
    said = run("pose", "demobot_parallel", *PLACE, "--cable", "300", "--json")
    assert unmade(json.loads(said.stdout)) == unmade(document)


def test_export_writes_a_description_and_what_mujoco_alone_reads(tmp_path: Path) -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    model = tmp_path / "model.toml"
    model.write_text(
        'format = 1\n[[effect]]\nname = "pulley_radius"\n[effect.parameters]\nradius_m = 0.01\n'
        '[[effect]]\nname = "stiffness"\n[effect.parameters]\nfactor = 1.1\n'
    )
    out = tmp_path / "out.xml"
    result = run("export", "demobot_cogiro", out, "0.3", "0.2", "0.15", "--model", model)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[1:] == [
        "out.xml contains stiffness",
        "out-mujoco.xml, for MuJoCo alone, also contains pulley_radius",
        f"next: seecr pose {out} 0.3 0.2 0.15",
    ]  # fmt: skip
    turned = ("0.3", "0.2", "0.15", "0.8", "0", "0", "-0.6")
    there = run("export", "demobot_cogiro", out, *turned, "--model", model)
    assert there.stdout.splitlines()[-1] == f"next: seecr pose {out} {' '.join(turned)}"
    np.testing.assert_allclose(load_robot(out).ea, 1.1 * robot.ea)
    assert 'type="cylinder"' in (tmp_path / "out-mujoco.xml").read_text()
    plain = run("export", "demobot_cogiro", tmp_path / "plain.xml", "--json")
    said = json.loads(plain.stdout)
    assert said["files"] == [str(tmp_path / "plain.xml")] and said["nowhere"] == {}
    assert said["rest_lengths_m"] == pytest.approx(robot.rest_lengths)
    nowhere = run("export", "demobot_cogiro", tmp_path / "plain.xml" / "out.xml")
    assert nowhere.exit_code == 2 and "out.xml: cannot be written: " in nowhere.stderr


def test_export_tells_of_the_model_and_of_an_earlier_file_also_as_json(tmp_path: Path) -> None:
    model, out = tmp_path / "model.toml", tmp_path / "out.xml"
    model.write_text('[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.01\n')
    said = json.loads(run("export", "demobot_cogiro", out, "--model", model, "--json").stdout)
    assert said["exit_status"] == 0 and len(said["files"]) == 2
    assert said["notes"] == [f"{model} does not say which robot it was made for"]
    alone = tmp_path / "out-mujoco.xml"
    assert alone.exists()
    later = json.loads(run("export", "demobot_cogiro", out, "--json").stdout)
    note = "out-mujoco.xml of an earlier export removed: now no such file is needed"
    assert later["files"] == [str(out)] and later["notes"] == [note]
    assert not alone.exists()
    alone.write_text("<mujoco><!-- for MuJoCo alone, by hand --></mujoco>")
    note = "out-mujoco.xml is of no export: it stays, though no such file is needed now"
    assert note in run("export", "demobot_cogiro", out).stdout.splitlines() and alone.exists()


def test_negative_numbers_are_coordinates() -> None:
    result = run("pose", "planar_two_cable", "-0.1", "0", "5e-1", "--json")
    assert json.loads(result.stdout)["command"][:3] == [-0.1, 0.0, 0.5]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (
            ["pose", "nobot", *PLACE],
            "nobot: neither a file nor a shipped robot; expected an MJCF file or one of",
        ),
        (["pose", "no.xml", *PLACE], "no.xml: no such file; expected an MJCF model"),
        (["pose", "demobot_cogiro", "1", "2"], "expected X Y Z or X Y Z QW QX QY QZ, got 2"),
        (
            ["pose", "demobot_cogiro", *PLACE, "--modle", "a"],
            "'--modle'. Did you mean '--model'?",
        ),
        (["pose", "demobot_cogiro", *PLACE, "--cable", "-1"], "--cable: expected vectran, fishing"),
        (["pose", "demobot_cogiro", *PLACE, "--model", "no.toml"], "no.toml: no such file"),
        (["pose", "planar_vertical", "0.4", "0.1", "0.2"], "its joints cannot reach"),
        (["sweep", "demobot_cogiro"], "expected one of POSES.csv, --line, --grid; got none"),
        (["sweep", "demobot_cogiro", "no.csv"], "no.csv: no such file; expected a CSV file in UTF"),
        (["sweep", "demobot_cogiro", "--grid", "0:1", "0", "0"], "--grid: expected FIRST:LAST:"),
        (["sweep", "demobot_cogiro", "--grid", "0:1:0", "0", "0"], "a count above zero"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*args)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and result.stderr.startswith("seecr: ")
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_sweep_writes_its_files(tmp_path: Path) -> None:
    out = tmp_path / "out"
    grid = ["--grid", "0.3:0.5:3", "0.25", "0.1:0.2:2", "--turned", "1", "0", "0", "0"]
    result = run("sweep", "demobot_cogiro", *grid, "--out", out, "--json")
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert [row["command"][2] for row in document["rows"]] == [0.1, 0.2] * 3
    names = {file.name for file in out.iterdir()}
    assert names == {"sweep.json", "sweep.csv", "sweep.png", "sweep.rrd"}
    assert json.loads((out / "sweep.json").read_text()) == document
    again = ["sweep", "demobot_cogiro", out / "sweep.csv", "--figure", "none", "--no-recording"]
    said = run(*again, "--out", out / "again")
    assert said.exit_code == 0
    assert "6 of 6 poses at rest" in said.stdout
    assert {file.name for file in (out / "again").iterdir()} == {"sweep.json", "sweep.csv"}
    rows = json.loads((out / "again" / "sweep.json").read_text())["rows"]
    assert rows == [{"line": k, **row} for k, row in enumerate(document["rows"], start=2)]
    assert "Poses are counted from 0" in document["notes"][0]
    assert re.search("largest deviation from the command: line [2-7], ", said.stdout)


def test_an_older_result_in_the_same_folder_goes_and_nothing_else(tmp_path: Path) -> None:
    poses, out = tmp_path / "poses.csv", tmp_path / "out"
    poses.write_text("cmd_x_m,cmd_z_m\n0.4,0.15\n")
    (out / "sweep.png").mkdir(parents=True)
    for name in ("sweep.svg", "sweep.rrd", "map.rrd", "mine.png", "sweep.txt"):
        (out / name).write_text("old")
    bare = ("--figure", "none", "--no-recording", "--out", out)
    assert run("sweep", "planar_vertical", tmp_path / "none.csv", *bare).exit_code == 2
    assert (out / "sweep.rrd").is_file()
    assert run("sweep", "planar_vertical", poses, *bare).exit_code == 0
    names = {file.name for file in out.iterdir()}
    assert names == {
        "sweep.json", "sweep.csv", "sweep.png", "map.rrd", "mine.png", "sweep.txt"
    }  # fmt: skip


@pytest.mark.slow
def test_correct_writes_commands_that_every_command_reads(tmp_path: Path) -> None:
    poses, model = tmp_path / "poses.csv", tmp_path / "model.toml"
    poses.write_text("run,cmd_x_m,cmd_y_m,cmd_z_m\na,0.4,0.25,0.1\nb,0.45,0.2,0.15\n")
    model.write_text(
        'format = 1\n[[effect]]\nname = "stiffness"\nparameters = { factor = 0.2 }\n'
        '[[effect]]\nname = "length_scale"\nparameters = { factor = 0.01 }\n'
    )
    args = ["correct", "demobot_cogiro", poses, "--model", model, "--lowest", "0.2"]
    result = run(*args, "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document["reached"] == document["poses"] == 2
    again = ["sweep", "demobot_cogiro", tmp_path / "out" / "corrected.csv", "--model", model]
    told = run(*again, "--figure", "none", "--no-recording", "--out", tmp_path).output
    assert "deviations are from the wanted poses" in told and "largest deviation from" in told
    said = run(*again, "--figure", "none", "--no-recording", "--out", tmp_path, "--json")
    rows = json.loads(said.stdout)["rows"]
    assert [row["run"] for row in rows] == ["a", "b"]
    for row, wanted in zip(rows, ([0.4, 0.25, 0.1], [0.45, 0.2, 0.15]), strict=True):
        assert row["pose"][:3] == pytest.approx(wanted, abs=1e-12)
        assert row["wanted"][:3] == wanted and row["command"] is None
        assert row["deviation_m"] == pytest.approx([0.0] * 3, abs=1e-12)
        assert min(row["tensions_N"]) > 0.2 - 1e-9
    lost = run(*args, "--lowest", "0", "--highest", "0.4", "--out", tmp_path / "lost")
    assert lost.exit_code == 3
    assert "2 cannot be held with tensions within the limits:" in lost.stdout


def test_pose_says_that_a_history_leaves_no_other_equilibria(tmp_path: Path) -> None:
    """It had said nothing of them, neither that there are none nor that none were sought."""
    model = tmp_path / "model.toml"
    model.write_text(
        '[[effect]]\nname = "hysteresis"\n'
        "parameters = { amplitude_N = 0.05, stretch_m = 0.001 }\n"
        '[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.01\n'
    )
    args = ["pose", "demobot_cogiro", "0.3", "0.25", "0.1", "--model", model]
    said = (
        "other equilibria are not sought: with hysteresis, what the cables did before decides "
        "where the platform rests"
    )
    told = run(*args)
    assert told.exit_code == 0 and said in told.stdout.splitlines()
    document = json.loads(run(*args, "--json").stdout)
    assert document["equilibria"] is None and said in document["notes"]
    assert said not in run(*args, "--alone").stdout, "nobody asked"
    assert "not sought" not in run(*args[:5]).stdout


@pytest.mark.slow
def test_map_writes_its_files_or_says_why_not(tmp_path: Path) -> None:
    out = tmp_path / "out"
    grid = ["--grid", "0.3:0.5:3", "0.2:0.3:2", "0.1"]
    result = run("map", "demobot_cogiro", *grid, "--out", out, "--json")
    assert result.exit_code == 0 and json.loads(result.stdout)["feasible"] == 6
    assert {file.name for file in out.iterdir()} == {"map.json", "map.npz", "map.png", "map.rrd"}
    quick = ("--no-recording", "--out", out)
    edge = run("map", "planar_vertical", "--edge", "0.001", "--no-elastic", *quick)
    places = json.loads((out / "map.json").read_text())["edge"]["places"]
    assert (
        edge.exit_code == 0
        and f"edge, to within 0.001 m: {places} points" in edge.output
        and places > 20
    )
    assert "region: x 0.04 to 0.76 m, y 0 m, z 0.018 to 0.486 m, down to the floor" in edge.output
    assert np.load(out / "map.npz")["edge"].shape == (places, 7)
    endless = run("map", "demobot_cogiro", "--edge", "nan", "--out", out)
    assert endless.exit_code == 2 and "'--edge': nan is not a finite number" in endless.output
    none = run("map", "demobot_cogiro", *grid, "--edge", "0.001", "--no-elastic", *quick)
    assert (
        none.exit_code == 0
        and "no edge was found: all poses of the grid can be held" in none.output
    )
    assert "no figure" not in none.output
    line = run("map", "demobot_cogiro", "--grid", "0.3:0.5:3", "0.2", "0.1", *quick)
    assert "no figure: the grid has more than one value along fewer than two axes" in line.output
    soft = run("map", "demobot_cogiro", *grid, "--cable", "0.001", *BARE, "--out", out)
    assert "elastic robot: at rest at 0 of 6 commands" in soft.output and soft.exit_code == 3
    assert json.loads((out / "map.json").read_text())["exit_status"] == 3
    lost = run("map", "demobot_cogiro", *grid, "--lowest", "90", "--out", tmp_path / "lost")
    assert lost.exit_code == 2 and not (tmp_path / "lost").exists()
    assert "no pose of the grid can be held: no tensions from 90 to inf N" in lost.stderr
    # with few cables it is asked whether the platform stays, too, and balance alone is no lie
    above = ["--grid", "0.3:0.5:2", "0", "2:3:2", "--out", tmp_path / "lost"]
    few = run("map", "planar_two_cable", *above)
    assert few.exit_code == 2
    assert "balance the load so that the platform stays at any of 4 poses" in few.stderr


@pytest.mark.slow
def test_a_correction_without_answers_leaves_no_list_of_commands(tmp_path: Path) -> None:
    poses, out = tmp_path / "poses.csv", tmp_path / "out"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.1\n")
    args = ["correct", "demobot_cogiro", poses, "--out", out]
    assert run(*args).exit_code == 0
    assert {file.name for file in out.iterdir()} == {
        "corrected.csv", "corrected.toml", "correction.json"
    }  # fmt: skip
    # the older list is none of this result
    assert run(*args, "--highest", "0.01").exit_code == 3
    assert {file.name for file in out.iterdir()} == {"correction.json"}
    (row,) = json.loads((out / "correction.json").read_text())["rows"]
    assert "more than 0.01 N" in row["why_not"]


@pytest.mark.slow
def test_a_correction_of_which_nothing_is_reached_is_no_success(tmp_path: Path) -> None:
    """The nearest poses are written all the same; of some beside others that are, it is one."""
    poses, out = tmp_path / "poses.csv", tmp_path / "out"
    for rows, status in (("5,0,0.2\n", 3), ("5,0,0.2\n0.4,0.25,0.1\n", 0)):
        poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n" + rows)
        got = run("correct", "demobot_cogiro", poses, "--out", out)
        assert got.exit_code == status and "cannot be held" in got.stdout, got.output
        document = json.loads((out / "correction.json").read_text())
        assert document["exit_status"] == status
        assert len((out / "corrected.csv").read_text().splitlines()) == 1 + rows.count("\n")


@pytest.mark.parametrize("cable", ["0.001", "1e12"])
def test_the_ends_of_what_a_cable_may_have_are_in(cable: str) -> None:
    assert robot_at(Path("demobot_cogiro"), cable).ea[0] == float(cable)


def test_answers_beyond_the_data_of_a_model_are_told(tmp_path: Path) -> None:
    model = tmp_path / "m.toml"
    model.write_text(
        '[[effect]]\nname = "pulley_radius"\nparameters = { radius_m = 0.01 }\n[fitted_to]\n'
        "position_m = [[0.3, 0.2, 0.1], [0.5, 0.3, 0.2]]\ntension_N = [0.2, 1.5]\n"
    )
    quiet = ("--model", model, "--out", tmp_path / "out")
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.15\n0.17,0.25,0.1\n")
    beyond = "beyond the data that the model was fitted to"
    robot = "demobot_cogiro"
    for args, words in (
        (("pose", robot, *PLACE, "--alone", *quiet), f"{beyond}: up to"),
        (("sweep", robot, poses, *quiet, *BARE), f"{beyond} at 1 of 2 poses"),
        (("correct", robot, poses, *quiet), f"{beyond} at 1 of 2 poses"),
        (
            ("map", robot, "--grid", "0.1:0.7:3", "0.25", "0.15", "--no-elastic", *quiet, *BARE),
            f"{beyond}: 2 poses of those that can be held are up to 200 mm outside",
        ),
    ):
        assert words in run(*args).output
        assert any(words in note for note in json.loads(run(*args, "--json").stdout)["notes"])
    assert beyond not in run("pose", robot, "0.4", "0.25", "0.15", "--alone", *quiet).output


def test_a_search_tells_its_evaluations_when_it_is_asked_for(tmp_path: Path) -> None:
    args = ("sweep", "demobot_parallel", "--line", *PLACE, "0.63", "0.25", "0.1", "--count", "5")
    bare = ("--figure", "none", "--no-recording", "--out", tmp_path / "out")
    assert "evaluations" not in run(*args, *bare).output
    counts = {}
    for method in ("newton", "fsolve", "least_squares"):
        found = json.loads(run(*args, *bare, "--method", method, "--json").stdout)
        each = [row["iterations"] for row in found["rows"]]
        search = found["search"]
        assert search["method"] == method and search["seconds_per_pose"] > 0.0
        told = search["fewest"], search["median"], search["most"]
        assert told == (min(each), np.median(each), max(each))
        counts[method] = search["most"]
    assert counts["newton"] < counts["fsolve"] < counts["least_squares"]
    line = run(*args, *bare, "--method", "fsolve").output
    assert re.search(
        r"fsolve: \d+ to \d+ evaluations of the equations per pose, [\d.]+ the median; .* ms",
        line,
    )
    gave_up = run(*args, *bare, "--method", "fsolve", "--cable", "25000").output
    assert re.search(r"The search \(fsolve\) gave up at \d of 5 poses, where the platform", gave_up)
    assert "free to move" not in gave_up
    balance = re.search(r"forces balance to (\S+) of the load", gave_up)
    assert balance is not None and float(balance[1]) < 1e-9
    together = run(*args, *bare, "--method", "newton", "--follow")
    assert together.exit_code == 2
    assert "--method needs every command to be solved by itself; got it together with --follow" in (
        together.output
    )
    model = tmp_path / "m.toml"
    model.write_text('[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_m = 0.001\n')
    remembered = run(*args, *bare, "--method", "newton", "--model", model)
    assert (
        remembered.exit_code == 2
        and "got it together with a model with history" in remembered.output
    )


def test_incomplete_wanted_poses_are_read_again_as_they_were_stated(tmp_path: Path) -> None:
    """Files that ``crosscheck compare`` read were refused."""
    robot, names = load_robot(model_path("planar_vertical")), [f"length_{i}_m" for i in range(1, 5)]
    x = float(robot.reference_pose[0]) + 0.05
    lengths = ",".join(repr(float(one)) for one in robot.rest_lengths)
    given, out = tmp_path / "given.csv", tmp_path / "out"
    given.write_text(f"want_x_m,want_z_m,{','.join(names)}\n{x!r},,{lengths}\n,,{lengths}\n")
    swept = run("sweep", "planar_vertical", given, *BARE, "--out", out, "--json")
    assert swept.exit_code == 0, swept.output
    said = json.loads(swept.stdout)
    assert any("no deviations are given" in note for note in said["notes"])
    assert [row["deviation_m"] for row in said["rows"]] == [None, None]
    assert [row["wanted"][0] for row in said["rows"]] == [x, None]
    first, again = (read_commands(path, robot) for path in (given, out / "sweep.csv"))
    np.testing.assert_array_equal(again.wanted, first.wanted)
    np.testing.assert_array_equal(again.commands.pose, first.commands.pose)


def test_told_lengths_and_loads_are_read_again_as_they_were_given(tmp_path: Path) -> None:
    """They were read as absolute: 17 mm off, without a word."""
    robot, names = load_robot(model_path("planar_vertical")), "length_1_m,length_2_m,length_3_m"
    given = tmp_path / "given.csv"
    row = ",".join(
        repr(float(one)) for one in robot.commanded_lengths(robot.reference_pose[None])[0]
    )
    given.write_text(f"{names},length_4_m,payload_kg,force_x_N\n{row},0.05,0.1\n")
    given.with_suffix(".toml").write_text('lengths = "told"\nstart = "first_row"\n')
    model = tmp_path / "model.toml"
    model.write_text(
        'format = 1\n[[effect]]\nname = "drum_gain"\n[effect.parameters]\ngain = 0.01\n'
    )
    out = tmp_path / "out"
    sweep = ["sweep", "planar_vertical", "--model", model, "--figure", "none", "--no-recording"]
    assert run(*sweep, given, "--out", out).exit_code == 0
    first, again = (read_commands(path, robot).commands for path in (given, out / "sweep.csv"))
    assert again.told and first.told and again.stands is not None and again.stands.all()
    assert first.loads is not None and again.loads is not None
    np.testing.assert_array_equal(again.lengths, first.lengths)
    np.testing.assert_array_equal(again.loads.mass, first.loads.mass)
    np.testing.assert_array_equal(again.loads.wrench, first.loads.wrench)
    # of an older list that was told nothing is left beside one that is not
    line = ["--line", "0.4", "0", "0.2", "0.5", "0", "0.2"]
    assert run("sweep", "planar_vertical", *line, *BARE, "--out", out).exit_code == 0
    assert not (out / "sweep.toml").exists()


def test_a_pose_at_which_cables_give_way_is_exported_without_their_law(tmp_path: Path) -> None:
    model = tmp_path / "soft.toml"
    model.write_text(
        'format = 1\n[robot]\nname = "demobot_parallel"\n[[effect]]\n'
        'name = "nonlinear_elasticity"\n'
        "[effect.parameters]\nquadratic = { value = 0.0 }\ncubic = { value = -4.29e5 }\n"
    )
    out = tmp_path / "soft.xml"
    found = run("export", "demobot_parallel", out, "0.17", "0.25", "0.2", "--model", model)
    assert found.exit_code == 0, found.output
    assert "not in any file: nonlinear_elasticity; at this pose" in " ".join(found.output.split())
    assert out.exists() and not (tmp_path / "soft-mujoco.xml").exists()


def test_where_there_is_no_answer_no_others_are_spoken_of() -> None:
    """At an exit point itself a cable would have no length."""
    robot = load_robot(model_path("camera"))
    place = [str(v) for v in robot.exit_points[0] - robot.anchor_points[0]]
    result = CliRunner().invoke(main, ["pose", "camera", *place])
    assert result.exit_code == 3 and "no answer: a cable would have no length" in result.output
    assert "other stable equilibrium" not in result.output


TURNED = "quaternions are scalar first: 0 0 0 1 turns the platform by 180 deg about z from its "


@pytest.mark.parametrize(
    "args",
    [
        ["pose", "demobot_cogiro", *PLACE, "0", "0", "0", "1", "--alone"],
        ["sweep", "demobot_cogiro", "--line", *PLACE, "0.2", "0.2", "0.15", "--turned", *"0001",
         "--no-recording", "--figure", "none"],
        ["export", "demobot_cogiro", "there.xml", *PLACE, *"0001", "--model", "m.toml"],
    ],
)  # fmt: skip
def test_a_scalar_that_seems_to_be_last_is_noted(
    args: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The identity with its scalar last had been half a turn without a word."""
    monkeypatch.chdir(tmp_path)
    model = '[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.001\n'
    (tmp_path / "m.toml").write_text(model)
    said = run(*args)
    assert f"{TURNED}reference pose; if the scalar is last there, write 1 0 0 0" in said.stdout
    assert "scalar first" not in run("pose", "demobot_cogiro", *PLACE, *"1000", "--alone").stdout


def test_scalars_are_last_where_that_turns_less_than_a_right_angle_and_in_all_rows() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    tilted = [0.0, 0.0, np.sin(0.3), np.cos(0.3)]
    (said,) = scalar_last(robot, [tilted, [0.0, 0.0, 0.0, 1.0]])
    assert "0 0 0.2955 0.9553 turns the platform by 180 deg from its" in said
    half = [0.0, 0.0, np.sin(0.4), np.cos(0.4)]  # 46 degrees
    assert scalar_last(robot, [half]) == scalar_last(robot, [tilted, [1.0, 0.0, 0.0, 0.0]]) == ()
    assert scalar_last(robot, [[0.0, 1.0, 0.0, 0.0]]) == scalar_last(robot, []) == ()
    # a turn about x is none that the hinge of a planar robot can make
    planar = load_robot(model_path("planar_horizontal"))
    assert scalar_last(planar, [[0.05, 0.0, 0.0, 0.998749]]) == ()
