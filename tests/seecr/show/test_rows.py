"""Rows, words, figure and recording of a sweep say what the solution says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recordings import Readback

from seecr.columns.commands import CommandFile, read_commands
from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.files import json_pieces, json_text, write_text
from seecr.inverse.correction import correct
from seecr.show.batch_words import chance_lines, sweep_lines
from seecr.show.files import SweepRows, corrected_csv, corrected_toml, toml_beside
from seecr.show.pose_words import at_rest, cable_lines, pose_lines
from seecr.show.sweep_figure import sweep_figure
from seecr.show.sweep_recording import write_sweep_recording
from seecr.statics.solution import Solution, Status

POSES = [[x, 0.25, 0.1, 1, 0, 0, 0] for x in (0.17, 0.3, 0.4)]


@pytest.fixture(scope="module")
def sweep() -> Solution:
    return solve(load_robot("demobot_parallel"), POSES)


def test_rows_are_the_solution(sweep: Solution) -> None:
    rows = json.loads(json_text({"rows": SweepRows(sweep)}))["rows"]
    np.testing.assert_array_equal([row["pose"] for row in rows], sweep.pose)
    np.testing.assert_array_equal([row["command"] for row in rows], POSES)
    away = [[*row["deviation_m"], *row["rotation_rad"]] for row in rows]
    np.testing.assert_array_equal(away, sweep.deviation)
    assert rows[0]["slack"] == ["cable2", "cable4", "cable5", "cable7"]
    assert [row["status"] for row in rows] == ["converged"] * 3


def test_rows_are_written_piece_by_piece_as_they_are_whole(sweep: Solution) -> None:
    rows = SweepRows(sweep)
    document = {"made": {"on": ["a day"]}, "odd": "two\nlines", "none": [], "rows": rows.as_json()}
    pieces = list(json_pieces({**document, "rows": rows.records()}))
    assert "".join(pieces) == json_text(document) + "\n"
    assert max(map(len, pieces)) < 2 * len(json_text(rows.as_json()[0]))
    assert "".join(json_pieces({"rows": iter(())})) == json_text({"rows": []}) + "\n"


def test_the_csv_is_read_again_as_commands(sweep: Solution, tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    write_text(path, SweepRows(sweep).csv_lines())
    np.testing.assert_array_equal(read_commands(path, sweep.robot).commands.pose, POSES)
    lengths = sweep.rest_lengths
    write_text(path, SweepRows(sweep, lengths).csv_lines())
    again = read_commands(path, sweep.robot).commands.lengths
    np.testing.assert_array_equal(np.asarray(again), lengths)


def test_runs_with_odd_names_keep_their_rows(sweep: Solution, tmp_path: Path) -> None:
    """Rows of a run called #1 were comments, so that the file lost them, or had no rows at all."""
    path, runs = tmp_path / "sweep.csv", ["#1", "2, back", 'the "3rd"']
    write_text(path, SweepRows(sweep, more={"run": runs}).csv_lines())
    assert list(read_commands(path, sweep.robot).run) == runs


@pytest.mark.slow
def test_rows_of_a_file_are_told_by_their_lines(tmp_path: Path) -> None:
    robot = load_robot("planar_vertical")
    path = tmp_path / "poses.csv"
    path.write_text("# mine\ncmd_x_m,cmd_z_m\n0.4,0.15\n\n0.5,0.25\n0.9,0.25\n")
    commands = read_commands(path, robot).commands
    found, wanted = solve(robot, commands), correct(robot, commands)
    assert found.lines()[1].startswith("largest deviation from the command: line 6, ")
    assert found.rows([2, 1]).lines()[1].startswith("largest deviation from the command: line 6, ")
    lost = replace(found, status=np.array([Status.FALLING] * 3, dtype=object))
    assert lost.lines()[1].startswith("lines 3, 5, 6: no equilibrium found")
    assert any(line.startswith("  line 6: cable1 would have to push") for line in wanted.lines())
    assert [row["line"] for row in wanted.as_json()["rows"]] == [3, 5, 6]
    assert [row["line"] for row in SweepRows(found).as_json()] == [3, 5, 6]
    # without a file they count as they do in Python
    assert "command: pose 2, " in solve(robot, commands.pose).lines()[1]
    assert "line" not in SweepRows(solve(robot, commands.pose)).as_json()[0]


def test_chances_of_poses_reached_are_told_apart_from_those_of_the_nearest() -> None:
    """The nearest poses lie at the limits: they were counted as if another aim could help there."""
    robot = load_robot("planar_vertical")
    poses = [[0.4, 0, 0.15, 1, 0, 0, 0], [0.42, 0, 0.25, 1, 0, 0, 0], [0.9, 0, 0.25, 1, 0, 0, 0]]
    wanted = correct(robot, poses)
    assert wanted.reached.tolist() == [True, True, False]
    chances = np.array([0.9, 0.2, 0.07])
    said, aim, near = chance_lines(wanted, chances, minimum=True)
    assert said.endswith("of at least 0.20, lowest at pose 1; below 0.95 at 2 of the 2 reached")
    assert "; --aim middle keeps away" in aim and "leaves a choice" in aim
    assert near.startswith("at the nearest poses") and "of at least 0.07, lowest at pose 2" in near
    # without a highest tension there is no middle: the advice alone ended in an error
    assert (
        "--aim middle with --highest keeps" in list(chance_lines(wanted, chances, True, False))[1]
    )
    hung = replace(wanted, robot=replace(robot, joints=()))  # four cables, six degrees of freedom
    assert not any("--aim" in line for line in chance_lines(hung, chances, minimum=True))


def test_a_chance_is_never_told_as_certain() -> None:
    robot = load_robot("planar_vertical")
    wanted = correct(robot, [[x, 0, 0.2, 1, 0, 0, 0] for x in (0.39, 0.4, 0.41)])
    assert wanted.reached.all()
    (sure,) = chance_lines(wanted, np.array([1.0, 0.9951, 1.0]), minimum=True)
    assert "with a probability above 0.99, lowest at pose 1; below 0.95 at 0 of 3" in sure
    (nearly,) = chance_lines(wanted, np.array([1.0, 0.9949, 1.0]))
    assert "of at least 0.99, lowest" in nearly
    assert not list(chance_lines(wanted, None))


def test_words_of_a_pose(sweep: Solution) -> None:
    text = "\n".join([*pose_lines(sweep), *cable_lines(sweep)])
    assert "rests at x y z 204.136, 250.000, 92.110 mm, turned rx ry rz 0.000, 26.428, 0" in text
    assert "off its command by +34.1357, +0.0000, -7.8905 mm (35.04 mm)" in text
    assert "\ncable2       0.0000         0.420631  slack\n" in text
    assert "poses by number of slack cables: 1 with 0, 2 with 4" in sweep_lines(sweep)


def test_a_pose_without_rest_has_no_numbers(sweep: Solution) -> None:
    status = np.array([Status.FALLING] * 3, dtype=object)
    lost = replace(sweep, pose=np.full((3, 7), np.nan), status=status)
    assert list(pose_lines(lost)) == [f"demobot_parallel: {Status.FALLING.value}"]
    assert at_rest(sweep) and not at_rest(lost)
    assert SweepRows(lost).as_json()[0]["status"] is Status.FALLING
    assert ",,,,,,," in "".join(SweepRows(lost).csv_lines())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_figure_is_written(sweep: Solution, tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"sweep.{kind}"
    sweep_figure(path, sweep)
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG" if kind == "png" else b"<?xml")
    if kind == "svg":
        for words in (b"commanded x [mm]", b"tension [N]", b"cable2, cable4"):
            assert words in data
        assert b">about x, about z<" in data, "one curve for what would hide the other"
        sweep_figure(path, sweep, wanted=True)
        assert b"wanted x [mm]" in path.read_bytes()


def test_the_recording_holds_the_numbers(sweep: Solution, tmp_path: Path) -> None:
    path = tmp_path / "sweep.rrd"
    write_sweep_recording(sweep, path)
    back = Readback(path)
    assert back.column("/plot/tension/cable1", "pose") == list(range(len(sweep)))
    np.testing.assert_array_equal(back.scalars("/plot/tension/cable1"), sweep.tensions[:, 0])
    names = back.static("/plot/tension/cable2", "SeriesLines:names")
    assert names == ["cable2, 4, 5, 7"], "one curve for tensions that are the same"
    np.testing.assert_allclose(
        back.scalars("/plot/deviation/dx"), 1e3 * sweep.deviation[:, 0], atol=1e-9
    )


VERTICAL = load_robot("planar_vertical")
WRENCH = np.arange(18.0).reshape(3, 6) / 70.0
SOME_AT_ITS_OWN = np.array([[0.1, 0.2, -0.3], [np.nan] * 3, [0.0, 0.05, 0.0]])
"""Where payloads hang: the second at the platform's own centre of mass."""


@pytest.fixture(scope="module")
def of_a_correction() -> Any:
    """What is written of a correction, whose lengths are those of the description."""
    poses = np.tile(VERTICAL.reference_pose, (3, 1))
    lengths = np.tile(VERTICAL.rest_lengths, (3, 1))
    return SimpleNamespace(
        robot=VERTICAL,
        wanted=poses,
        lengths=lengths,
        found=np.ones(3, bool),
        solution=solve(VERTICAL, poses),
    )


@pytest.mark.parametrize("centre", [None, SOME_AT_ITS_OWN, np.nan_to_num(SOME_AT_ITS_OWN)])
@pytest.mark.parametrize("kind", ["sweep", "corrected"])
def test_loads_are_read_as_they_were(
    tmp_path: Path, of_a_correction: Any, kind: str, centre: np.ndarray | None
) -> None:
    loads = Loads.of(3, mass=np.array([0.1, 0.2, 0.0]), centre=centre, wrench=WRENCH)
    wanted = CommandFile(Commands(of_a_correction.wanted, loads=loads), None, ("a",) * 3, ())
    path = tmp_path / "written.csv"
    if kind == "sweep":
        write_text(path, SweepRows(of_a_correction.solution, loads=loads).csv_lines())
    else:
        path.write_text(corrected_csv(of_a_correction, wanted))
        path.with_suffix(".toml").write_text(corrected_toml(wanted))
    assert "nan" not in path.read_text()
    again = read_commands(path, VERTICAL).commands.loads
    assert again is not None
    for name in ("mass", "centre", "wrench"):
        np.testing.assert_array_equal(getattr(again, name), getattr(loads, name))


@pytest.mark.parametrize("stands", [None, np.ones(3, bool)])
@pytest.mark.parametrize("told", [False, True])
def test_what_lengths_mean_and_where_runs_begin_are_read_as_they_were(
    tmp_path: Path, of_a_correction: Any, told: bool, stands: np.ndarray | None
) -> None:
    commands = Commands(of_a_correction.wanted, of_a_correction.lengths, told=told, stands=stands)
    path = tmp_path / "written.csv"
    path.write_text(
        "".join(SweepRows(of_a_correction.solution, of_a_correction.lengths).csv_lines())
    )
    text = toml_beside(told, commands)
    path.with_suffix(".toml").write_text(text)
    again = read_commands(path, VERTICAL).commands
    assert again.told == told
    np.testing.assert_array_equal(again.starts_here, commands.starts_here)
    assert bool(text) == (told or stands is not None)


def test_json_of_long_arrays_in_pieces_is_that_of_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("seecr.files._ROWS", 7)
    table = np.arange(69.0).reshape(23, 3)
    table[3, 1] = np.nan
    document = {
        "rows": {"error": table, "line": table[:, 0], "names": np.array(["a\nb"] * 8), "none": {}},
        "few": table[:2], "text": "x", "no": (),
    }  # fmt: skip
    pieces = list(json_pieces(document))
    assert "".join(pieces) == json_text(document) + "\n"
    assert max(map(len, pieces)) < len(json_text(table)) // 2
