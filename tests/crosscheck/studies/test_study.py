"""Studies: what a table may ask for, what is computed again, what is refused, and the page."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from called import as_json, ran
from shown import Page

import crosscheck
import seecr
from crosscheck.studies import cases
from seecr.parallel import processes

G = 9.81


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    """A weight of 2 kg on a vertical cable of 1000 N, 2 m long at the reference pose."""
    robot = seecr.Robot.from_points([[0, 0, 3]], [0, 0, 0], mass=2, ea=1000, at=[0, 0, 1])
    robot.save(tmp_path / "pendulum.xml")
    return tmp_path / "pendulum.xml"


def hung(pendulum: Path, **cells: Any) -> dict[str, Any]:
    return {"robot": pendulum, "do": "map", "grid": "0 0 1:2:3", **cells}


def table(path: Path, rows: list[dict[str, Any]]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, dict.fromkeys(name for row in rows for name in row))
        writer.writeheader()
        writer.writerows(rows)
    return path


@pytest.mark.parametrize(
    ("cells", "mass", "ea", "length"),
    [
        ({}, 2.0, 1000.0, 2.0),
        ({"mass_kg": 1}, 1.0, 1000.0, 2.0),
        ({"mass_g": 500}, 0.5, 1000.0, 2.0),
        ({"ea_N": 500}, 2.0, 500.0, 2.0),
        ({"ea_1_kN": 4}, 2.0, 4000.0, 2.0),
        ({"exit_1_z_mm": 2500}, 2.0, 1000.0, 1.5),
        ({"anchor_1_z_m": 0.25}, 2.0, 1000.0, 1.75),
        ({"stiffness.factor": 0.5}, 2.0, 500.0, 2.0),
    ],
    ids=str,
)
def test_a_weight_on_a_cable_sags_as_hooke_says(
    pendulum: Path, cells: dict[str, Any], mass: float, ea: float, length: float
) -> None:
    """The lowest of the three poses has the longest cable: m g L / E S."""
    (row,) = crosscheck.study([hung(pendulum, **cells)]).rows
    assert row["poses"] == row["at_rest"] == 3
    assert row["deviation_max_m"] == pytest.approx(mass * G * length / ea, rel=1e-6)
    assert row["rotation_max_rad"] == 0.0


def test_a_cable_whose_point_moves_stays_as_taut_as_it_was(pendulum: Path, tmp_path: Path) -> None:
    """2 cm shorter than straight, of E S 1000 N: still 2 cm when it is half a metre shorter."""
    text = pendulum.read_text(encoding="utf-8")
    short = tmp_path / "short.xml"
    robot = seecr.load_robot(pendulum)
    spring = re.search(r'springlength="0.0 ([\d.]+)" stiffness="([\d.]+)"', text)
    assert spring is not None and float(spring[1]) == 2.0 and robot.ea[0] == 1000.0
    new = f'springlength="0 1.98" stiffness="{1000 / 1.98!r}"'
    short.write_text(text.replace(spring[0], new), encoding="utf-8")
    cells = {"grid": "0 0 1", "exit_1_z_m": 2.5}
    (row,) = crosscheck.study([hung(short, **cells)]).rows
    there = 1.48 * (1.0 + 2.0 * G / 1000.0)
    assert row["deviation_max_m"] == pytest.approx(abs(there - 1.5), rel=1e-5)


def test_limits_hold_at_all_poses_and_where_none_fails_to_rest(
    pendulum: Path, tmp_path: Path
) -> None:
    """Sags are 39.24 and 19.62 mm; with its cable paid in, a weight rests nowhere."""
    (tmp_path / "in.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0,0,3\n")
    none = {"robot": pendulum, "do": "sweep", "data": tmp_path / "in.csv"}
    rows = [hung(pendulum), hung(pendulum, mass_kg=1), none]
    within = crosscheck.Tolerance(position_m=0.03)
    found = crosscheck.study(rows, within=within)
    assert found.within[:2] == [False, True]
    assert found.rows[2]["at_rest"] == 0 and found.within[2] is False
    assert [row["within"] for row in found.records()] == found.within
    assert crosscheck.study(rows[:1]).within == [None]
    assert "within the limits: 1 of 3: 2" in str(found)


def test_a_second_call_computes_what_is_missing(pendulum: Path, tmp_path: Path) -> None:
    out, rows = tmp_path / "out", [hung(pendulum, mass_kg=mass) for mass in (1, 2, 3)]
    first = crosscheck.study(rows[:2], out=out)
    before = {path: path.stat().st_mtime_ns for path in (out / "parts").iterdir()}
    second = crosscheck.study(rows, out=out)
    assert (first.computed, second.computed) == (2, 1)
    assert second.records()[:2] == first.records()
    assert {path: path.stat().st_mtime_ns for path in before} == before
    # another way to write the same numbers, another name, another order
    same = [{**hung(pendulum, mass_kg="1e0"), "case": "light"}, rows[2]]
    assert crosscheck.study(same, out=out).computed == 0
    next(iter(before)).unlink()
    assert crosscheck.study(rows, out=out).computed == 1


def test_a_file_that_changed_is_computed_again(pendulum: Path, tmp_path: Path) -> None:
    out, poses = tmp_path / "out", tmp_path / "poses.csv"
    row = {"robot": pendulum, "do": "sweep", "data": poses}
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0,0,1\n0,0,2\n")
    (found,) = crosscheck.study([row], out=out).rows
    assert found["deviation_max_m"] == pytest.approx(2.0 * G * 2.0 / 1000.0, rel=1e-6)
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0,0,2\n")
    (found,) = crosscheck.study([row], out=out).rows
    assert found["deviation_max_m"] == pytest.approx(2.0 * G * 1.0 / 1000.0, rel=1e-6)
    pendulum.write_text(pendulum.read_text().replace('mass="2.0"', 'mass="1.0"'))
    assert seecr.load_robot(pendulum).mass == 1.0
    assert crosscheck.study([row], out=out).computed == 1


def test_another_version_computes_anew(
    pendulum: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crosscheck.study([hung(pendulum)], out=tmp_path / "out")
    for module in ("cases", "study"):
        monkeypatch.setattr(f"crosscheck.studies.{module}.full_version", lambda: "9.9")
    assert crosscheck.study([hung(pendulum)], out=tmp_path / "out").computed == 1
    # and a worker of another one is told
    answers = iter(["9.9", "9.8", "9.8"])
    monkeypatch.setattr("crosscheck.studies.study.full_version", lambda: next(answers))
    ((_, why),) = crosscheck.study([hung(pendulum)]).failed
    assert "a worker has seecr 9.8, and this is 9.9" in why


def test_a_part_has_all_rows_of_its_case(pendulum: Path, tmp_path: Path) -> None:
    crosscheck.study([hung(pendulum)], out=tmp_path / "out")
    (part,) = (tmp_path / "out" / "parts").iterdir()
    rows = pyarrow.parquet.read_table(part).to_pylist()
    assert [row["z_m"] for row in rows] == [1.0, 1.5, 2.0]
    sags = [-2.0 * G * length / 1000.0 for length in (2.0, 1.5, 1.0)]
    np.testing.assert_allclose([row["dz_m"] for row in rows], sags, rtol=1e-6)


@pytest.mark.slow
def test_twins_and_diagnoses_say_what_they_say_alone(tmp_path: Path) -> None:
    twin = crosscheck.make_twin(
        "demobot_cogiro", 5, effects=["pulley_radius"], points=4, out=tmp_path / "case"
    )
    alone = crosscheck.diagnose(twin.robot, tmp_path / "case" / "measured.csv")
    radius = {"robot": "demobot_cogiro", "pulley_radius.radius_m": 0.01}
    data = "case/measured.csv"
    rows = [
        {"robot": "demobot_cogiro", "do": "diagnose", "data": data},
        {**radius, "do": "twin", "seed": 5, "points": 4},
    ]
    found = crosscheck.study(table(tmp_path / "cases.csv", rows)).rows
    assert found[0]["missing"] == " ".join(one.effect for one in alone.missing) == "pulley_radius"
    assert found[0]["after_position_rms_m"] == alone.after["position_rms_m"]
    assert found[1]["hidden"] == "pulley_radius" and found[1]["found"] is True
    assert found[1]["verdict"] == "effects_found"


def test_a_case_that_fails_is_told_and_the_others_are_done(pendulum: Path, tmp_path: Path) -> None:
    bad, out = hung(pendulum, **{"backlash.gap_m": 0.001}), tmp_path / "out"
    found = crosscheck.study([hung(pendulum), bad], out=out)
    ((case, why),) = found.failed
    assert case == "2" and "a map's poses are in no order" in why
    assert found.rows[0]["at_rest"] == 3 and len(list((out / "parts").iterdir())) == 1


def test_a_defect_ends_its_case_alone_and_is_called_so(
    pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_args: Any, **_more: Any) -> None:
        raise KeyError("gone")

    monkeypatch.setattr("crosscheck.studies.study.workspace_map", broken)
    assert crosscheck.study([hung(pendulum)]).failed == [("1", "a defect, KeyError: 'gone'")]


FAULTS = [
    ({"exit_2_x_mm": 1}, "column exit_2_x_mm: expected a cable from 1 to 1"),
    ({"mass_kg": -1}, "column mass_kg: robot .*: expected a mass from 0"),
    ({"ea_N": "soft"}, "column ea_N: expected a number, got 'soft'"),
    ({"ea_N": "nan"}, "column ea_N: expected a number, got 'nan'"),
    ({"do": "mpa"}, "column do: expected map, sweep, diagnose, twin, got 'mpa'"),
    ({"do": ""}, "column do: expected map, sweep, diagnose, twin, got an empty cell"),
    ({"do": "diagnose", "grid": ""}, "column do: diagnose needs data, got an empty cell"),
    ({"seed": 3}, "column do: map takes no seed, got '3'"),
    ({"grid": "0:1:2"}, "column grid: expected a number, got '0:1:2'"),
    ({"grid": "0 0 1:2"}, r"column grid: each of X Y Z: expected FIRST:LAST:COUNT"),
    ({"robot": "nobody.xml"}, "column robot: nobody.xml: no such file"),
    ({"pulley_radius.radius_m": -1}, "column pulley_radius.radius_m: .* out of bounds"),
    ({"pulley_radius.size": 1}, "column pulley_radius.size: .*size"),
    ({"pully_radius.radius_m": 1}, "no effect 'pully_radius'.*nearest first: pulley_radius"),
    ({"model": "none.toml"}, "column model: none.toml: no such file"),
]


@pytest.mark.parametrize(("cells", "words"), FAULTS, ids=lambda one: str(one)[:30])
def test_each_mistake_of_a_table_is_told_where_it_is(
    pendulum: Path, tmp_path: Path, cells: dict[str, Any], words: str
) -> None:
    path = table(tmp_path / "cases.csv", [hung(pendulum), hung(pendulum, case="b", **cells)])
    with pytest.raises(seecr.InputFileError, match=words) as caught:
        crosscheck.study(path, out=tmp_path / "out")
    assert f"{path}: line 3, column " in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("exit_1_x_furlong", "unknown unit"),
        ("speed", "unknown column; expected case, robot, do"),
        ("exit_1_x", "unknown column"),
    ],
)
def test_unknown_columns_are_refused(pendulum: Path, name: str, words: str) -> None:
    with pytest.raises(seecr.InputFileError, match=f"column {name}: {words}"):
        crosscheck.study([hung(pendulum, **{name: 1})])


def test_all_mistakes_are_told_at_once(pendulum: Path, tmp_path: Path) -> None:
    rows = [hung(pendulum, case="a"), hung(pendulum, case="a"), hung(pendulum, do="no")]
    path = table(tmp_path / "cases.csv", rows)
    result = ran(f"crosscheck study {path} --out {tmp_path / 'out'}", 2)
    assert "line 3, column case: expected a name of its own, got 'a' again" in result.stderr
    assert "line 4, column do" in result.stderr and len(result.stderr.splitlines()) == 2


@pytest.mark.parametrize("odd", [None, 3, [], ["a"], [3]])
def test_what_is_no_table_is_refused(odd: Any) -> None:
    with pytest.raises(seecr.InputError, match="expected"):
        crosscheck.study(odd)


@pytest.fixture
def studied(pendulum: Path, tmp_path: Path) -> tuple[list[dict[str, Any]], Path, list[Path]]:
    rows = [hung(pendulum, mass_kg=mass) for mass in (1, 2)]
    crosscheck.study(rows, out=tmp_path / "out")
    return rows, tmp_path / "out", sorted((tmp_path / "out" / "parts").iterdir())


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_a_part_that_was_cut_is_told(studied: Any, share: float) -> None:
    rows, out, (part, other) = studied
    part.write_bytes(part.read_bytes()[: int(share * part.stat().st_size)])
    kept = other.read_bytes()
    with pytest.raises(seecr.InputFileError, match="is a damaged part of a study; remove it"):
        crosscheck.study(rows, out=out)
    assert other.read_bytes() == kept
    part.unlink()
    assert crosscheck.study(rows, out=out).computed == 1


def test_a_part_with_one_byte_changed_is_told(studied: Any) -> None:
    rows, out, (part, _) = studied
    data = part.read_bytes()
    for at in range(0, len(data), len(data) // 40):
        part.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
        with pytest.raises(seecr.InputFileError, match="is a damaged part of a study"):
            crosscheck.study(rows, out=out)
    part.write_bytes(data)
    assert crosscheck.study(rows, out=out).computed == 0


def test_a_part_of_another_study_is_told(studied: Any) -> None:
    rows, out, (part, other) = studied
    key, digest = (one.stem.partition("-") for one in (part, other))
    part.unlink()
    other.rename(other.with_stem(f"{key[0]}-{digest[2]}"))
    with pytest.raises(seecr.InputFileError, match="is a part of another study or case"):
        crosscheck.study(rows, out=out)


@pytest.mark.parametrize("name", ["map.json", "parts/notes.txt"])
def test_a_folder_of_something_else_is_told_and_left_alone(
    studied: Any, tmp_path: Path, name: str
) -> None:
    rows, *_ = studied
    other = tmp_path / "other" / name
    other.parent.mkdir(parents=True)
    other.write_text("mine")
    with pytest.raises(seecr.InputFileError, match=f"{name}: is not of a study"):
        crosscheck.study(rows, out=tmp_path / "other")
    path = table(tmp_path / "cases.csv", rows)
    assert ran(f"crosscheck study {path} --out {tmp_path / 'other'}", 2).stdout == ""
    assert [one for one in (tmp_path / "other").rglob("*") if one.is_file()] == [other]


def test_what_a_killed_study_left_is_removed(studied: Any) -> None:
    rows, out, parts = studied
    left = out / "parts" / ".0123456789abcdef.parquet.00000000.part"
    left.write_bytes(b"half")
    assert crosscheck.study(rows, out=out).computed == 0
    assert sorted((out / "parts").iterdir()) == parts


def test_two_studies_in_one_folder_wait_for_each_other(studied: Any) -> None:
    from seecr.folders import folder_lock

    rows, out, _ = studied
    told = pytest.raises(seecr.InputFileError, match="another study is at work there")
    with folder_lock(out / "parts"), told:
        crosscheck.study(rows, out=out)


@pytest.mark.slow
def test_the_command_writes_its_table_and_figure(studied: Any, tmp_path: Path) -> None:
    rows, out, _ = studied
    path = table(tmp_path / "cases.csv", rows)
    words = f"crosscheck study {path} --out {out} --within 30mm --within 1deg"
    said = as_json(words)
    assert [row["within"] for row in said["rows"]] == [True, False]
    with (out / "study.csv").open(encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    sags = [float(row["deviation_max_m"]) for row in written]
    np.testing.assert_allclose(sags, [0.01962, 0.03924], rtol=1e-6)
    assert json.loads((out / "study.json").read_text())["rows"] == said["rows"]
    assert (out / "study.png").read_bytes().startswith(b"\x89PNG")
    shown = ran(f"{words} --figure none", 0).stdout
    assert "within the limits: 1 of 2: 1" in shown and "39.2" in shown
    assert not (out / "study.png").exists()
    assert "got unit 'N'" in ran(f"crosscheck study {path} --within 1N", 2).stderr
    assert "got two" in ran(f"crosscheck study {path} --within 1mm --within 2mm", 2).stderr


def test_its_figure_has_a_dot_for_each_case_with_poses(pendulum: Path) -> None:
    rows = [hung(pendulum, mass_kg=mass) for mass in (1, 2)]
    found = crosscheck.study(rows, within=crosscheck.Tolerance(position_m=0.03))
    (axes,) = found.plot().axes
    (dots,) = axes.collections
    np.testing.assert_allclose(dots.get_offsets(), [[19.62, 0.0], [39.24, 0.0]], rtol=1e-6)
    assert not np.array_equal(*dots.get_facecolors()) and axes.get_xlabel().endswith("[mm]")
    (limit,) = axes.lines
    assert limit.get_xdata()[0] == 30.0


LAYOUTS = [
    {"robot": "demobot_cogiro", "do": "map", "grid": "7", "exit_1_x_mm": 80 + k} for k in range(6)
]


def parts_of(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "parts").iterdir()}


@pytest.mark.slow
def test_processes_find_what_this_one_finds_to_the_last_bit(tmp_path: Path) -> None:
    serial = crosscheck.study(LAYOUTS, out=tmp_path / "serial")
    with processes(2) as executor:
        spread = crosscheck.study(LAYOUTS, executor, out=tmp_path / "spread")
    assert spread.records() == serial.records()
    assert parts_of(tmp_path / "spread") == parts_of(tmp_path / "serial")


@pytest.mark.slow
def test_an_executor_that_dies_leaves_what_is_done(tmp_path: Path) -> None:
    pool = ProcessPoolExecutor(2, get_context("spawn"))
    with pool as executor:

        def kill(_done: int, name: str) -> None:
            if name:
                with suppress(ProcessLookupError):  # the one that was killed may still be listed
                    os.kill(next(iter(executor._processes)), signal.SIGKILL)

        words = r"ended before its work \(BrokenProcessPool\).*of 6 cases done and kept in"
        with pytest.raises(seecr.ExecutorError, match=words) as caught:
            crosscheck.study(LAYOUTS, executor, out=tmp_path, progress=kill)
    assert caught.value.exit_status == 3
    done = parts_of(tmp_path)
    assert 1 <= len(done) < 6
    again = crosscheck.study(LAYOUTS, out=tmp_path)
    assert again.computed == 6 - len(done)
    assert {name: data for name, data in parts_of(tmp_path).items() if name in done} == done


def test_of_a_single_case_all_is_told(tmp_path: Path) -> None:
    """Only columns in which cases differ were printed: of one case its name, and no result."""
    cases = tmp_path / "cases.csv"
    cases.write_text("robot,do,grid\nplanar_vertical,map,0.4 0 0.2\n")
    said = ran(f"crosscheck study {cases} --jobs 1 --out {tmp_path / 'out'}", 0).stdout
    assert "robot: planar_vertical\n" in said and "at rest: 1\ndeviation max [mm]: " in said


DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.mark.slow
def test_the_page_works_as_written(tmp_path: Path) -> None:
    page = Page(tmp_path)
    page.run((DOCS / "study.md").read_text(encoding="utf-8"))
    assert [command.split()[1] for command in page.commands] == ["study", "study", "map"]


def test_every_column_is_in_the_formats() -> None:
    text = (DOCS / "formats.md").read_text(encoding="utf-8").partition("## Cases: CSV")[2]
    assert [name for name in (*cases._HEAD, *cases._OPTIONS) if f"`{name}`" not in text] == []
    changes = ("mass_kg", "ea_N", "ea_3_N", "exit_2_x_mm", "anchor_2_x_mm")
    row = {"robot": "demobot_cogiro", "do": "map", "grid": 1, **dict.fromkeys(changes, 400)}
    row |= {"mass_kg": 1, "anchor_2_x_mm": 50, "pulley_radius.radius_m": 0.01}
    assert all(f"`{name}`" in text for name in (*changes, "pulley_radius.radius_m"))
    assert crosscheck.study([row]).rows[0]["poses"] == 1
