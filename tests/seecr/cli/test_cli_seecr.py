"""The seecr command: arguments, files, statuses; what it computes is tested elsewhere."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from called import BARE, as_json, drawn_bare, ran, refused_in_a_line
from robots import turned

from seecr import InputError, load_robot
from seecr.cli import COMMANDS
from seecr.cli.arguments import axes_of, robot_at
from seecr.columns.commands import read_commands
from seecr.columns.plausible import scalar_last
from seecr.folders import MANIFEST, staged
from seecr.workspace.grid import own_directions

COGIRO, PARALLEL = "demobot_cogiro", "demobot_parallel"
PLACE = "0.17 0.25 0.1"
WAY = "--line 0.17 0 0.2 0.63 0 0.2"
POSES = "cmd_x_m,cmd_y_m,cmd_z_m\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands write into."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names_in(folder: str) -> set[str]:
    """Files of results; the list of them in the folder is not counted."""
    return {file.name for file in Path(folder).iterdir()} - {MANIFEST}


def read(path: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(Path(path).read_text())
    return document


def model(path: str, **effects: str) -> str:
    """The option with a model of these effects and the values of their parameters."""
    cells = [f'[[effect]]\nname = "{name}"\nparameters = {{ {v} }}' for name, v in effects.items()]
    Path(path).write_text("\n".join(cells))
    return f"--model {path}"


def test_every_command_has_help_with_examples() -> None:
    text = ran("seecr").stdout
    for name, (_, line) in COMMANDS.items():
        assert f"  {name} " in text and line in " ".join(text.split())
        said = ran(f"seecr {name} --help", 0).stdout
        assert f"seecr {name} " in said and "None" not in said  # of a number without ends: x<=None


@pytest.mark.slow
@pytest.mark.parametrize("words", ["pose {} 0.4 0.25 0.2", "sweep {} p.csv", "correct {} p.csv"])
def test_a_bar_is_told_what_is_done(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As that of maps, which tests of its own look at."""
    said: list[tuple[str, int]] = []

    @contextmanager
    def bar(text: str, total: int) -> Iterator[Any]:
        yield lambda steps, now: said.append((now, steps))

    for module in ("progress", "sweep"):
        monkeypatch.setattr(f"seecr.cli.{module}.progress_bar", bar)
    Path("p.csv").write_text(f"{POSES}0.4,0.25,0.2\n0.45,0.25,0.2\n")
    sweeps = words.startswith("sweep")
    ran(f"seecr {words.format(COGIRO)} {BARE if sweeps else ''}", 0)
    assert said[-1][0] in ("solved", "corrected")
    assert sum(steps for _, steps in said) == (2 if sweeps else 100)


# --- pose ------------------------------------------------------------------------------------


def test_a_pose_tells_its_zone_the_papers_points_and_all_tilts_of_a_bar() -> None:
    got = as_json("seecr pose planar_vertical --alone 0.17 0 0.2")
    assert (got["slack_cables"], got["slack"]) == (2, ["cable2", "cable3"])
    assert got["midline_point"] == "V" and got["bar"] is None
    assert got["beside_weight_m"] == pytest.approx(-0.01703, abs=1e-5)
    bar = "seecr pose planar_two_cable --alone 0.3 0 0.5"
    got = as_json(bar)
    assert got["midline_point"] is None and "beside_weight_m" not in got
    rest, command = got["bar"]["at_rest"], got["bar"]["at_command"]
    assert [one["stable"] for one in rest] == [one["stable"] for one in command] == [True, False]
    assert [one["here"] for one in rest] == [True, False] and not command[0]["here"]
    assert rest[0]["pose"] == pytest.approx(got["pose"], abs=1e-9)
    assert rest[0]["tensions_N"] == pytest.approx(got["tensions_N"], abs=1e-9)
    # figure 3's number
    assert np.degrees(command[0]["theta_rad"]) == pytest.approx(-30.90, abs=5e-3)
    text = ran(bar).output
    assert "is in balance at 2 tilts (positive: the second cable's end is up):" in text
    assert "\n  tilt -22.6039 deg: stable, tensions 2.902 and 1.964 N, as it rests here\n" in text
    assert "\n  tilt +158.7076 deg: not stable, tensions 3.406 and 2.333 N\n" in text
    assert "tilt " not in ran("seecr pose planar_vertical --alone 0.4 0 0.2").output


def test_pose_prints_and_writes() -> None:
    result = ran(f"seecr pose {PARALLEL} {PLACE} --cable fishing --out out", 0)
    assert "turned by 26.53 deg" in result.stdout
    document = read("out/pose.json")
    assert document["exit_status"] == 0 and len(document["tensions_N"]) == 8
    said = as_json(f"seecr pose {PARALLEL} {PLACE} --cable 300")
    assert {**said, "made": None} == {**document, "made": None}
    assert as_json("seecr pose planar_two_cable -0.1 0 5e-1")["command"][:3] == [-0.1, 0.0, 0.5]


def test_pose_says_that_a_history_leaves_no_other_equilibria() -> None:
    """It had said nothing of them, neither that there are none nor that none were sought."""
    plain = f"seecr pose {COGIRO} 0.3 0.25 0.1"
    told = model(
        "m.toml", hysteresis="amplitude_N = 0.05, stretch_m = 0.001", pulley_radius="radius_m=0.01"
    )
    said = (
        "other equilibria are not sought: with hysteresis, what the cables did before decides "
        "where the platform rests"
    )
    assert said in ran(f"{plain} {told}", 0).stdout.splitlines()
    document = as_json(f"{plain} {told}")
    assert document["equilibria"] is None and said in document["notes"]
    assert said not in ran(f"{plain} {told} --alone").stdout, "nobody asked"
    assert "not sought" not in ran(plain).stdout


def test_where_there_is_no_answer_no_others_are_spoken_of() -> None:
    """At an exit point itself a cable would have no length."""
    robot = load_robot("camera")
    place = " ".join(map(str, robot.exit_points[0] - robot.anchor_points[0]))
    result = ran(f"seecr pose camera {place}", 3)
    assert "no answer: a cable would have no length" in result.output
    assert "other stable equilibrium" not in result.output


@pytest.mark.parametrize("cable", ["0.001", "1e12"])
def test_the_ends_of_what_a_cable_may_have_are_in(cable: str) -> None:
    assert robot_at(Path(COGIRO), cable).ea[0] == float(cable)


TURNED = "quaternions are scalar first: 0 0 0 1 turns the platform by 180 deg about z from its "


@pytest.mark.parametrize(
    "words",
    [
        f"pose {COGIRO} {PLACE} 0 0 0 1 --alone",
        f"sweep {COGIRO} --line {PLACE} 0.2 0.2 0.15 --turned 0 0 0 1 {BARE}",
        f"export {COGIRO} there.xml {PLACE} 0 0 0 1 --model m.toml",
    ],
)
def test_a_scalar_that_seems_to_be_last_is_noted(words: str) -> None:
    """The identity with its scalar last had been half a turn without a word."""
    model("m.toml", pulley_radius="radius_m = 0.001")
    said = ran(f"seecr {words}").stdout
    assert f"{TURNED}reference pose; if the scalar is last there, write 1 0 0 0" in said
    assert "scalar first" not in ran(f"seecr pose {COGIRO} {PLACE} 1 0 0 0 --alone").stdout


def test_scalars_are_last_where_that_turns_less_than_a_right_angle_and_in_all_rows() -> None:
    robot = load_robot(COGIRO)
    tilted = [0.0, 0.0, np.sin(0.3), np.cos(0.3)]
    (said,) = scalar_last(robot, [tilted, [0.0, 0.0, 0.0, 1.0]])
    assert "0 0 0.2955 0.9553 turns the platform by 180 deg from its" in said
    half = [0.0, 0.0, np.sin(0.4), np.cos(0.4)]  # 46 degrees
    assert scalar_last(robot, [half]) == scalar_last(robot, [tilted, [1.0, 0.0, 0.0, 0.0]]) == ()
    assert scalar_last(robot, [[0.0, 1.0, 0.0, 0.0]]) == scalar_last(robot, []) == ()
    # a turn about x is none that the hinge of a planar robot can make
    assert scalar_last(load_robot("planar_horizontal"), [[0.05, 0.0, 0.0, 0.998749]]) == ()


# --- sweep -----------------------------------------------------------------------------------


def test_a_sweep_tells_the_zones_of_slack_cables_and_the_papers_points() -> None:
    """Figs 7, 9 and 11 of the paper, from the command line alone."""
    lines = drawn_bare(f"seecr sweep planar_vertical {WAY}").splitlines()
    at = lines.index(next(x for x in lines if x.startswith("zones of slack cables on the way")))
    assert lines[at + 1] == "  x 170.000 to 285.143 mm, 115.143 mm wide: 2 slack: cable2 cable3"
    assert lines[at + 2] == "  x 285.143 to 296.235 mm, 11.093 mm wide: 1 slack: cable3"
    assert [x.split(": ")[1] for x in lines[at + 3 : at + 6]] == ["0 slack", "1 slack", "2 slack"]
    assert lines[at + 6].startswith(
        "point V goes from x z 175.64 138.04 to x z 624.36 138.04 mm; on the way it is between "
        "-17.80 and +17.80 mm beside the line of the weight"
    )
    document = read("seecr-sweep/sweep.json")
    zones = document["zones"]
    assert [zone["slack_cables"] for zone in zones] == [2, 1, 0, 1, 2]
    assert zones[0]["slack"] == ["cable2", "cable3"]
    assert zones[0]["from"][0] == 0.17 and zones[0]["to"] == zones[1]["from"]
    assert zones[0]["width_m"] == pytest.approx(0.115143, abs=1e-6)
    assert 0.0 < zones[0]["to_within_m"] <= 5e-7 and zones[0]["from_within_m"] == 0.0
    first = document["rows"][0]
    assert document["midline_point"] == "V"
    assert first["beside_weight_m"] == pytest.approx(-0.01703, abs=1e-5)
    names, cells = (
        x.split(",") for x in Path("seecr-sweep/sweep.csv").read_text().splitlines()[:2]
    )
    cell = dict(zip(names, cells, strict=True))
    assert float(cell["midlines_x_m"]) == first["midlines_meet_m"][0]
    assert float(cell["beside_weight_m"]) == first["beside_weight_m"]

    level = drawn_bare(f"seecr sweep planar_horizontal {WAY}")
    assert "on the whole way 0 slack\npoint H goes from x z 169.97 217.82 to " in level
    assert " mm, +0.00 mm beside the line of the weight" in level
    assert "pose 11, 0.3101 mm and 0 deg" in level  # and no rotation of 9.5e-18 deg
    followed = drawn_bare(f"seecr sweep planar_vertical --follow {WAY}").splitlines()
    zoned = [x for x in followed if x.startswith("zones") or " mm wide: " in x]
    assert lines[at : at + 6] == zoned
    document = as_json(f"seecr sweep {PARALLEL} --line {PLACE} 0.63 0.25 0.1 {BARE}")
    assert [zone["slack_cables"] for zone in document["zones"]] == [4, 2, 0, 2, 4]
    assert [round(1e3 * zone["width_m"], 1) for zone in document["zones"][:2]] == [141.3, 15.5]
    assert document["midline_point"] is None and "beside_weight_m" not in document["rows"][0]


def test_a_sweep_says_how_exact_hysteresis_is_where_cables_go_slack() -> None:
    told = model("m.toml", hysteresis="amplitude_N = 0.05, stretch_m = 0.0002")
    sweep = f"seecr sweep {{}} --line {PLACE} 0.63 0.25 0.2 --count 4 {BARE}"
    (said,) = [note for note in as_json(f"{sweep.format(PARALLEL)} {told}")["notes"]
               if note.startswith("Hysteresis and friction turn round where")]  # fmt: skip
    found = re.search(r"off by (\S+) mm and (\S+) deg, by what half the steps change", said)
    assert found and 1e-7 < float(found[1]) < 0.01 and 1e-7 < float(found[2]) < 0.01
    for plain in (sweep.format(PARALLEL), f"{sweep.format(COGIRO)} {told}"):  # no cable goes slack
        assert "half the steps" not in json.dumps(as_json(plain)["notes"])


def test_a_sweep_of_a_bar_is_compared_with_the_manifold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figs 3 and 4 of the paper."""
    line = "seecr sweep planar_two_cable --line 0.2 0 0.5 0.5 0 0.5 --count 3"
    bar = drawn_bare(line)
    assert "the bar is tilted by -34.86 to +0.00 deg" in bar
    assert "to rest where it was commanded to it would tilt by -49.61 to +0.00 deg" in bar
    assert "manifold_at_command_rad" in Path("seecr-sweep/sweep.csv").read_text()
    first = read("seecr-sweep/sweep.json")["rows"][0]
    assert first["tilt_rad"] == pytest.approx(-first["rotation_rad"][1], abs=1e-12)
    assert first["manifold_there_rad"] == pytest.approx(first["tilt_rad"], abs=1e-9)
    Path("len.csv").write_text("length_1_m,length_2_m\n0.6,0.7\n")
    out = drawn_bare("seecr sweep planar_two_cable len.csv")
    assert "the bar is tilted by" in out and "where it was commanded to" not in out
    monkeypatch.setattr("seecr.cli.sweep._MOST_TILTS", 2)
    many = drawn_bare(line)
    assert "Tilts of the manifold are not computed: more than 2 poses." in many
    assert "the bar is tilted" not in many


def test_columns_of_a_grid_are_ways_of_their_own_and_many_zones_are_counted() -> None:
    grid = f"seecr sweep {PARALLEL} --grid 0.17:0.63:{{}} 0.25 0.1:0.2:3"
    text = drawn_bare(grid.format(8))
    zones = read("seecr-sweep/sweep.json")["zones"]
    assert {zone["run"] for zone in zones} == set(range(8)) and len(zones) == 10
    assert text.count(" mm wide: ") == 10
    text = drawn_bare(grid.format(16))
    zones = read("seecr-sweep/sweep.json")["zones"]
    assert f"{len(zones)} zones of slack cables, with their widths, in sweep.json" in text
    assert " mm wide: " not in text
    one = drawn_bare(f"seecr sweep {PARALLEL} --grid 0.2 0.25 0.1")
    assert read("seecr-sweep/sweep.json")["zones"] is None
    assert "zones" not in one and "whole way" not in one


def test_too_many_changes_are_said_and_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("seecr.cli.sweep._MOST_CHANGES", 3)
    text = drawn_bare(f"seecr sweep planar_vertical {WAY}")
    assert "Zones of slack cables are not computed: more than 3 poses differ from the one" in text
    assert read("seecr-sweep/sweep.json")["zones"] is None


@pytest.mark.slow
def test_sweep_writes_its_files() -> None:
    grid = "--grid 0.3:0.5:3 0.25 0.1:0.2:2 --turned 1 0 0 0"
    document = as_json(f"seecr sweep {COGIRO} {grid} --out out")
    assert [row["command"][2] for row in document["rows"]] == [0.1, 0.2] * 3
    assert names_in("out") == {"sweep.json", "sweep.csv", "sweep.png", "sweep.rrd"}
    assert read("out/sweep.json") == document
    said = drawn_bare(f"seecr sweep {COGIRO} out/sweep.csv --out again", 0)
    assert "6 of 6 poses at rest" in said
    assert names_in("again") == {"sweep.json", "sweep.csv"}
    rows = read("again/sweep.json")["rows"]
    assert rows == [{"line": k, **row} for k, row in enumerate(document["rows"], start=2)]
    assert "Poses are counted from 0" in document["notes"][0]
    assert re.search("largest deviation from the command: line [2-7], ", said)


def test_an_older_result_in_the_same_folder_goes_and_nothing_else() -> None:
    Path("poses.csv").write_text("cmd_x_m,cmd_z_m\n0.4,0.15\n")
    Path("out/sweep.png").mkdir(parents=True)
    with staged("out") as older:
        for name in ("sweep.svg", "map.rrd"):
            (older / name).write_text("old")
    for name in ("sweep.rrd", "mine.png", "sweep.txt"):
        Path("out", name).write_text("the user's")
    drawn_bare("seecr sweep planar_vertical none.csv --out out", 2)
    assert Path("out/sweep.svg").is_file()
    drawn_bare("seecr sweep planar_vertical poses.csv --out out", 0)
    kept = {"sweep.png", "sweep.rrd", "map.rrd", "mine.png", "sweep.txt"}
    assert names_in("out") == {"sweep.json", "sweep.csv"} | kept


def test_a_search_tells_its_evaluations_when_it_is_asked_for() -> None:
    line = f"seecr sweep {PARALLEL} --line {PLACE} 0.63 0.25 0.1 --count 5"
    assert "evaluations" not in drawn_bare(line)
    most = []
    for method in ("newton", "fsolve", "least_squares"):
        found = as_json(f"{line} {BARE} --method {method}")
        each = [row["iterations"] for row in found["rows"]]
        search = found["search"]
        assert search["method"] == method and search["seconds_per_pose"] > 0.0
        told = search["fewest"], search["median"], search["most"]
        assert told == (min(each), np.median(each), max(each))
        most.append(search["most"])
    assert most == sorted(set(most))
    said = drawn_bare(f"{line} --method fsolve")
    per_pose = r"fsolve: \d+ to \d+ evaluations of the equations per pose, [\d.]+ the median; .* ms"
    assert re.search(per_pose, said)
    gave_up = drawn_bare(f"{line} --method fsolve --cable 25000")
    assert re.search(r"The search \(fsolve\) gave up at \d of 5 poses, where the platform", gave_up)
    assert "free to move" not in gave_up
    balance = re.search(r"forces balance to (\S+) of the load", gave_up)
    assert balance is not None and float(balance[1]) < 1e-9
    alone = "--method needs every command to be solved by itself; got it together with"
    assert f"{alone} --follow" in drawn_bare(f"{line} --method newton --follow", 2)
    history = model("m.toml", backlash="gap_m = 0.001")
    said = drawn_bare(f"{line} --method newton {history}", 2)
    assert f"{alone} a model with history" in said


def test_incomplete_wanted_poses_are_read_again_as_they_were_stated() -> None:
    """Files that ``crosscheck compare`` read were refused."""
    robot, names = load_robot("planar_vertical"), [f"length_{i}_m" for i in range(1, 5)]
    x = float(robot.reference_pose[0]) + 0.05
    lengths = ",".join(map(repr, robot.rest_lengths.tolist()))
    Path("given.csv").write_text(
        f"want_x_m,want_z_m,{','.join(names)}\n{x!r},,{lengths}\n,,{lengths}\n"
    )
    said = as_json(f"seecr sweep planar_vertical given.csv {BARE}")
    assert any("no deviations are given" in note for note in said["notes"])
    assert [row["deviation_m"] for row in said["rows"]] == [None, None]
    assert [row["wanted"][0] for row in said["rows"]] == [x, None]
    first, again = (read_commands(Path(p), robot) for p in ("given.csv", "seecr-sweep/sweep.csv"))
    np.testing.assert_array_equal(again.wanted, first.wanted)
    np.testing.assert_array_equal(again.commands.pose, first.commands.pose)


def test_told_lengths_and_loads_are_read_again_as_they_were_given() -> None:
    """They were read as absolute: 17 mm off, without a word."""
    robot = load_robot("planar_vertical")
    row = ",".join(map(repr, robot.commanded_lengths(robot.reference_pose[None])[0].tolist()))
    names = ",".join(f"length_{i}_m" for i in range(1, 5))
    Path("given.csv").write_text(f"{names},payload_kg,force_x_N\n{row},0.05,0.1\n")
    Path("given.toml").write_text('lengths = "told"\nstart = "first_row"\n')
    drawn_bare(
        f"seecr sweep planar_vertical {model('m.toml', drum_gain='gain = 0.01')} given.csv", 0
    )
    paths = Path("given.csv"), Path("seecr-sweep/sweep.csv")
    first, again = (read_commands(path, robot).commands for path in paths)
    assert again.told and first.told and again.stands is not None and again.stands.all()
    assert first.loads is not None and again.loads is not None
    np.testing.assert_array_equal(again.lengths, first.lengths)
    np.testing.assert_array_equal(again.loads.mass, first.loads.mass)
    np.testing.assert_array_equal(again.loads.wrench, first.loads.wrench)
    # of an older list that was told nothing is left beside one that is not
    drawn_bare("seecr sweep planar_vertical --line 0.4 0 0.2 0.5 0 0.2", 0)
    assert not Path("seecr-sweep/sweep.toml").exists()


def test_answers_beyond_the_data_of_a_model_are_told() -> None:
    told = model("m.toml", pulley_radius="radius_m = 0.01")
    with Path("m.toml").open("a") as file:
        file.write("\n[fitted_to]\nposition_m = [[0.3, 0.2, 0.1], [0.5, 0.3, 0.2]]\n")
        file.write("tension_N = [0.2, 1.5]\n")
    Path("poses.csv").write_text(f"{POSES}0.4,0.25,0.15\n0.17,0.25,0.1\n")
    beyond = "beyond the data that the model was fitted to"
    for words, said in (
        (f"pose {COGIRO} {PLACE} --alone", f"{beyond}: up to"),
        (f"sweep {COGIRO} poses.csv {BARE}", f"{beyond} at 1 of 2 poses"),
        (f"correct {COGIRO} poses.csv", f"{beyond} at 1 of 2 poses"),
        (
            f"map {COGIRO} --grid 0.1:0.7:3 0.25 0.15 --no-elastic {BARE}",
            f"{beyond}: 2 poses of those that can be held are up to 200 mm outside",
        ),
    ):
        assert said in ran(f"seecr {words} {told}").output
        assert any(said in note for note in as_json(f"seecr {words} {told}")["notes"])
    assert beyond not in ran(f"seecr pose {COGIRO} 0.4 0.25 0.15 --alone {told}").output


# --- correct ---------------------------------------------------------------------------------


def test_wanted_tensions_are_an_aim() -> None:
    place = load_robot("ipanema").reference_pose[:3]
    Path("poses.csv").write_text("{}{},{},{}\n".format(POSES, *place))
    words = "seecr correct ipanema poses.csv --lowest 1 --aim"
    pulls = [
        np.mean(as_json(f"{words} {aim}")["rows"][0]["tensions_N"])
        for aim in ("minimum", "900", ",".join(8 * ["900"]))
    ]
    assert pulls[0] < 0.8 * pulls[1] and pulls[1] == pytest.approx(pulls[2])
    for wrong in ("most", "1,2", "nan"):
        expected = "expected safe, minimum, middle, or tensions [N]: one, or 8 with commas"
        assert f"--aim {wrong}: {expected}" in refused_in_a_line(f"{words} {wrong}")


@pytest.mark.slow
def test_correct_writes_commands_that_every_command_reads() -> None:
    places = [[0.4, 0.25, 0.1], [0.45, 0.2, 0.15]]
    Path("poses.csv").write_text(f"run,{POSES}a,0.4,0.25,0.1\nb,0.45,0.2,0.15\n")
    told = model("m.toml", stiffness="factor = 0.2", length_scale="factor = 0.01")
    words = f"seecr correct {COGIRO} poses.csv {told} --lowest 0.2"
    document = as_json(f"{words} --out out")
    assert document["reached"] == document["poses"] == 2
    again = f"seecr sweep {COGIRO} out/corrected.csv {told}"
    said = drawn_bare(again)
    assert "deviations are from the wanted poses" in said and "largest deviation from" in said
    rows = as_json(f"{again} {BARE}")["rows"]
    assert [row["run"] for row in rows] == ["a", "b"]
    for row, wanted in zip(rows, places, strict=True):
        assert row["pose"][:3] == pytest.approx(wanted, abs=1e-12)
        assert row["wanted"][:3] == wanted and row["command"] is None
        assert row["deviation_m"] == pytest.approx([0.0] * 3, abs=1e-12)
        assert min(row["tensions_N"]) > 0.2 - 1e-9
    lost = ran(f"{words} --lowest 0 --highest 0.4 --out lost", 3)
    assert "2 cannot be held with tensions within the limits:" in lost.stdout


@pytest.mark.slow
def test_a_rope_of_the_catalogue_is_held_against_its_breaking_load() -> None:
    """A steel rope of 3 mm was told to pull 18.8 kN, without a word; it breaks at 5.3 kN."""
    Path("poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,1.5\n")
    words = f"seecr correct {COGIRO} poses.csv --cable"
    told = ran(f"{words} 'steel 7x19 3mm'").stdout
    assert "pulls 18810 N" in told and "enough to break ropes of steel 7x19 (1.4 %)" in told
    assert "a new steel 7x19 3mm breaks at 5289 N: cables pull up to 356 % of it" in told
    assert " breaks at 5289 N" not in ran(f"{words} vectran").stdout


def test_a_correction_without_answers_leaves_no_list_of_commands() -> None:
    Path("poses.csv").write_text(f"{POSES}0.4,0.25,0.1\n")
    words = f"seecr correct {COGIRO} poses.csv --out out"
    ran(words, 0)
    assert names_in("out") == {"corrected.csv", "corrected.toml", "correction.json"}
    # the older list is none of this result
    lost = ran(f"{words} --highest 0.01", 3)
    assert names_in("out") == {"correction.json"}
    (row,) = read("out/correction.json")["rows"]
    assert "more than 0.01 N" in row["why_not"]
    # nothing can be swept: the workspace is named
    assert lost.stdout.splitlines()[-1] == f"next: seecr map {COGIRO}"


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "status"), [("5,0,0.2\n", 3), ("5,0,0.2\n0.4,0.25,0.1\n", 0)])
def test_a_correction_of_which_nothing_is_reached_is_no_success(rows: str, status: int) -> None:
    """The nearest poses are written all the same; of some beside others that are, it is one."""
    Path("poses.csv").write_text(POSES + rows)
    assert "cannot be held" in ran(f"seecr correct {COGIRO} poses.csv --out out", status).stdout
    assert read("out/correction.json")["exit_status"] == status
    assert len(Path("out/corrected.csv").read_text().splitlines()) == 1 + rows.count("\n")


# --- map -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_map_writes_its_files_or_says_why_not() -> None:
    grid = f"seecr map {COGIRO} --grid 0.3:0.5:3 0.2:0.3:2 0.1 --out out"
    assert as_json(grid)["feasible"] == 6
    assert names_in("out") == {"map.json", "map.npz", "map.png", "map.rrd"}
    edge = ran("seecr map planar_vertical --edge 0.001 --no-elastic --no-recording --out out", 0)
    places = read("out/map.json")["edge"]["places"]
    assert f"edge, to within 0.001 m: {places} points" in edge.output and places > 20
    assert "region: x 0.04 to 0.76 m, y 0 m, z 0.018 to 0.486 m, down to the floor" in edge.output
    assert np.load("out/map.npz")["edge"].shape == (places, 7)
    endless = refused_in_a_line(f"seecr map {COGIRO} --edge nan")
    assert "'--edge': nan is not a finite number" in endless
    none = ran(f"{grid} --edge 0.001 --no-elastic --no-recording", 0).output
    assert "no edge was found: all poses of the grid can be held" in none
    assert "no figure" not in none
    line = ran(f"seecr map {COGIRO} --grid 0.3:0.5:3 0.2 0.1 --no-recording").output
    assert "no figure: the grid has more than one value along fewer than two axes" in line
    soft = drawn_bare(f"{grid} --cable 0.001", 3)
    assert "elastic robot: at rest at 0 of 6 commands" in soft
    assert read("out/map.json")["exit_status"] == 3
    lost = refused_in_a_line(f"{grid.removesuffix('out')}lost --lowest 90")
    assert "no pose of the grid can be held: no tensions from 90 to inf N" in lost
    # with few cables it is asked whether the platform stays, too, and balance alone is no lie
    few = refused_in_a_line("seecr map planar_two_cable --grid 0.3:0.5:2 0 2:3:2 --out lost")
    assert "balance the load so that the platform stays at any of 4 poses" in few
    assert not Path("lost").exists()


def test_a_grid_far_from_the_origin_is_checked_along_its_own_axes() -> None:
    """A sweep of an oblique robot had been checked as if it were a map."""
    robot = turned(load_robot("planar_vertical"), [0.0, 0.0, np.radians(30.0)])[0]
    away = robot.reference_pose + np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot = replace(robot, reference_pose=away, exit_points=robot.exit_points + away[:3])
    directions = own_directions(robot)
    assert directions is not None
    place = away[:3]
    assert np.concatenate(axes_of([str(one) for one in place], robot)) == pytest.approx(place)
    texts = [str(one) for one in directions @ place]
    assert len(axes_of(texts, robot, directions)) == 3
    with pytest.raises(InputError, match="expected metres, in the range of"):
        axes_of(texts, robot)


# --- export ----------------------------------------------------------------------------------


def test_export_writes_into_a_folder() -> None:
    said = ran(f"seecr export {COGIRO} there.xml --out new", 0).output
    assert Path("new/there.xml").exists() and "seecr pose new/there.xml" in said
    ran(f"seecr export {COGIRO} newer/there.xml", 0)
    assert Path("newer/there.xml").exists()
    # and makes none where there is nothing to write
    Path("none.toml").write_text("abc")
    ran(f"seecr export {COGIRO} there.xml --out other --model none.toml", 2)
    assert not Path("other").exists()
    assert "cannot be written: " in refused_in_a_line(f"seecr export {COGIRO} new/there.xml/o.xml")


def test_export_writes_a_description_and_what_mujoco_alone_reads() -> None:
    robot = load_robot(COGIRO)
    told = model("m.toml", pulley_radius="radius_m = 0.01", stiffness="factor = 1.1")
    result = ran(f"seecr export {COGIRO} out.xml 0.3 0.2 0.15 {told}", 0)
    assert result.stdout.splitlines()[1:] == [
        "out.xml contains stiffness",
        "out-mujoco.xml, for MuJoCo alone, also contains pulley_radius",
        "next: seecr pose out.xml 0.3 0.2 0.15",
    ]  # fmt: skip
    turn = "0.3 0.2 0.15 0.8 0 0 -0.6"
    there = ran(f"seecr export {COGIRO} out.xml {turn} {told}").stdout
    assert there.splitlines()[-1] == f"next: seecr pose out.xml {turn}"
    np.testing.assert_allclose(load_robot("out.xml").ea, 1.1 * robot.ea)
    assert 'type="cylinder"' in Path("out-mujoco.xml").read_text()
    said = as_json(f"seecr export {COGIRO} plain.xml")
    assert said["files"] == ["plain.xml"] and said["nowhere"] == {}
    assert said["rest_lengths_m"] == pytest.approx(robot.rest_lengths)


def test_export_tells_of_the_model_and_of_an_earlier_file_also_as_json() -> None:
    told = model("m.toml", pulley_radius="radius_m = 0.01")
    said = as_json(f"seecr export {COGIRO} out.xml {told}")
    assert said["exit_status"] == 0 and len(said["files"]) == 2
    assert said["notes"] == ["m.toml does not say which robot it was made for"]
    alone = Path("out-mujoco.xml")
    assert alone.exists()
    later = as_json(f"seecr export {COGIRO} out.xml")
    note = "out-mujoco.xml of an earlier export removed: now no such file is needed"
    assert later["files"] == ["out.xml"] and later["notes"] == [note]
    assert not alone.exists()
    alone.write_text("<mujoco><!-- for MuJoCo alone, by hand --></mujoco>")
    note = "out-mujoco.xml is of no export: it stays, though no such file is needed now"
    assert note in ran(f"seecr export {COGIRO} out.xml").stdout.splitlines() and alone.exists()


def test_a_pose_at_which_cables_give_way_is_exported_without_their_law() -> None:
    told = model("soft.toml", nonlinear_elasticity="quadratic = 0.0, cubic = -4.29e5")
    found = ran(f"seecr export {PARALLEL} soft.xml 0.17 0.25 0.2 {told}", 0).output
    assert "not in any file: nonlinear_elasticity; at this pose" in " ".join(found.split())
    assert Path("soft.xml").exists() and not Path("soft-mujoco.xml").exists()
