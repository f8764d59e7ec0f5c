"""Readings that stand in another row too are named with both lines; chance is not accused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import measured
from scipy import stats

import crosscheck
from crosscheck.measurements.copied import repetitions
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import load_measurements
from seecr import load_robot

ROBOT = load_robot("demobot_parallel")
HEAD = "cmd_x_mm,cmd_y_mm,cmd_z_mm,meas_x_mm,meas_y_mm,meas_z_mm,payload_kg\n"


def grid(seed: int, payload: float, digits: int = 2, noise: float = 0.5) -> list[str]:
    rng = np.random.default_rng(seed)
    places = np.array([(x, y, 100) for x in (300, 400, 500) for y in (200, 220, 240, 260)])
    read = places + rng.normal(0.0, noise, places.shape)
    return [
        f"{x},{y},{z}," + ",".join(f"{v:.{digits}f}" for v in row) + f",{payload}"
        for (x, y, z), row in zip(places, read, strict=True)
    ]


def written(path: Path, rows: list[str]) -> Path:
    path.write_text(HEAD + "\n".join(rows) + "\n")
    return path


def said_of(*paths: Path) -> list[str]:
    notes = load_measurements(list(paths), ROBOT).notes
    return [note for note in notes if "Repeated readings" in note]


def test_rows_of_another_payload_are_named(tmp_path: Path) -> None:
    light, heavy = grid(0, 0.0), grid(1, 0.2)
    for row in (2, 7):
        heavy[row] = light[row].rsplit(",", 1)[0] + ",0.2"
    paths = written(tmp_path / "light.csv", light), written(tmp_path / "heavy.csv", heavy)
    (note,) = said_of(*paths)
    assert note.startswith(
        "Repeated readings: heavy.csv lines 4, 9 have those of light.csv lines 4, 9 to the last "
    )
    assert "copied from one file to the other?" in note
    assert said_of(paths[0]) == said_of(paths[1]) == []
    assert (
        said_of(written(tmp_path / "light.csv", light), written(tmp_path / "h.csv", grid(1, 0.2)))
        == []
    )


def test_rows_of_another_command_in_one_file_are_named(tmp_path: Path) -> None:
    rows = grid(0, 0.0)
    rows[5] = ",".join(rows[5].split(",")[:3] + rows[1].split(",")[3:])
    (note,) = said_of(written(tmp_path / "a.csv", rows))
    assert "Repeated readings: line 7 have those of line 3 to" in note
    assert "copied, or the tracker stood still?" in note


def test_whole_rows_are_told_as_before(tmp_path: Path) -> None:
    rows = grid(0, 0.0)
    path = written(tmp_path / "a.csv", [*rows, rows[3]])
    assert said_of(path) == []
    assert any("Identical rows" in note for note in load_measurements(path, ROBOT).notes)


def test_coarse_readings_repeat_by_chance(tmp_path: Path) -> None:
    """To whole millimetres with a noise of 0.2 mm most readings of two loads are equal."""
    light, heavy = grid(0, 0.0, 0, 0.2), grid(1, 0.2, 0, 0.2)
    same = sum(a.split(",")[3:6] == b.split(",")[3:6] for a, b in zip(light, heavy, strict=True))
    assert same > 3
    assert said_of(written(tmp_path / "a.csv", light), written(tmp_path / "b.csv", heavy)) == []


@pytest.mark.parametrize("seed", range(8))
def test_hundreds_of_rows_with_few_digits_accuse_nobody(seed: int) -> None:
    """Readings to 0.1 mm of two loads, with 0.2 mm of noise: one pair in 300 is equal by chance."""
    rng = np.random.default_rng(seed)
    place = np.tile(rng.uniform(0.2, 0.5, (300, 3)), (2, 1))
    pose = np.column_stack([place, np.tile([1.0, 0, 0, 0], (600, 1))])
    read = np.round(place + rng.normal(0.0, 2e-4, place.shape), 4)
    file = np.repeat([0, 1], 300)
    data = Measurements(Path("m"), 8, np.full(600, "a"), pose, position=read, file=file,
                        files=("a", "b"))  # fmt: skip
    assert not any(note.startswith("Repeated") for note in repetitions(data)[0])
    read[300:310] = read[:10]
    assert sum(note.startswith("Repeated") for note in repetitions(data)[0]) == 1


@pytest.mark.parametrize("often", [2, 3, 4, 5])
def test_so_many_copies_are_accused_as_chance_makes_in_one_file_of_a_thousand(often: int) -> None:
    """Each of 30 numbers stands in so many rows, so two rows share one with a known probability."""
    known, k = 30, np.arange(30 * often)
    value = 0.01 * np.arange(known)
    value[1] = 1e-5  # finely read: no step is coarse enough to repeat by itself
    x, y = value[k // often], value[(k // often + 7 * (k % often)) % known]
    base = np.column_stack([x, y, np.full(len(k), 0.1)])
    alike = (often - 1) / (len(k) - 1)
    accused = []
    for count in range(1, 30):
        read = np.concatenate([base, base[:count]])
        pose = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(read), 1))
        pose[:, 0] = np.arange(len(read))
        data = Measurements(Path("m"), 8, np.full(len(read), "a"), pose, position=read)
        expected = 0.5 * len(read) * (len(read) - 1) * alike**2
        accused.append(bool(repetitions(data)[1].any()))
        assert accused[-1] == (stats.poisson.sf(count - 1, expected) <= 1e-3), count
    assert {True, False} <= {*accused[2:]}


@pytest.mark.parametrize("steps", [3, 4, 6])
def test_of_commands_read_twice_chance_follows_from_the_noise_and_the_last_digit(
    steps: int,
) -> None:
    """Each of 30 places is read twice, so many last digits apart in x and in y."""
    digit, k = 1e-4, np.arange(30)
    first = np.column_stack([0.03 * k, 0.03 * (7 * k % 30), np.full(30, 0.1)])
    first[1, :2] = first[0, :2] + digit  # nothing lies nearer than that
    read = np.concatenate([first, first + steps * digit * np.array([1.0, 1.0, 0.0])])
    # the median size of a normal difference is 0.6745 standard deviations
    alike = digit * stats.norm.pdf(0.0) / (steps * digit / stats.norm.ppf(0.75))
    accused, expected = [], []
    for count in range(1, 8):
        pose = np.tile([0.0, 0, 0, 1, 0, 0, 0], (60 + count, 1))
        pose[:, 0] = [*k, *k, *range(100, 100 + count)]
        data = Measurements(Path("m"), 8, np.full(len(pose), "a"), pose,
                            position=np.concatenate([read, first[:count]]))  # fmt: skip
        accused.append(bool(repetitions(data)[1].any()))
        expected.append(bool(stats.poisson.sf(count - 1, 30 * alike**2) <= 1e-3))
    assert accused == expected and {*accused} == {True, False}


def test_rows_that_are_the_same_are_listed_up_to_eight() -> None:
    told = np.tile(ROBOT.reference_pose, (12, 1))
    data = Measurements(Path("a"), 8, np.full(12, "a"), told, position=np.zeros((12, 3)))
    (note,) = repetitions(data)[0]
    assert "9 as 2" in note and "10 as 2 and 3 more" in note
    assert repetitions(replace(data, position=np.arange(36.0).reshape(12, 3)))[0] == []
    assert repetitions(data, across=True)[0] == []


def test_copied_rows_are_said_first_and_once_and_none_counts(shared_data: Path) -> None:
    """They were 6 outliers, then 8 in the same sentence, and all counted as measured."""
    folder = shared_data / "public" / "22-payload-grid"
    files = [folder / name for name in ("load_0.csv", "load_25_part_copied.csv")]
    found = crosscheck.compare(folder / "robot.xml", files)
    assert found.notes[0].startswith(
        "Repeated readings: load_25_part_copied.csv lines 2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 32, "
    )
    assert "so none of them counts as long as others do" in found.notes[0]
    assert found.is_noise and "outlier" not in " ".join([found.sentence, *found.notes])
    assert int(found.problem.use.sum()) == 60


def test_a_tracker_that_froze_is_one_note() -> None:
    """In some rows, whose readings were "all counted" and "not counted"; and in all of them."""
    data = measured(ROBOT, points=4)
    for count in (12, data.n_rows):
        there = {"position": data.position.copy(), "quat_wxyz": data.quat_wxyz.copy()}
        for name in there:
            there[name][-count:] = there[name][-count]
        stopped = crosscheck.Measurements.from_arrays(
            ROBOT, commands=data.command_pose, positions=there["position"],
            quaternions=there["quat_wxyz"], runs=data.run.tolist(), sigma="0.03mm",
        )  # fmt: skip
        found = crosscheck.compare(ROBOT, stopped)
        odd = [n for n in found.notes if "eading" in n or "stop" in n or "follow" in n]
        if count == 12:
            assert [note[:18] for note in odd] == ["Repeated readings:"]
            assert int(found.problem.use.sum()) == data.n_rows - 12
        else:
            assert odd == []
            assert "all readings are the same although the commands differ" in found.sentence


def test_a_file_given_again_under_another_name_counts_and_is_said(tmp_path: Path) -> None:
    """Either reading is right for its command: none is left out."""
    light = grid(0, 0.0)
    files = [written(tmp_path / name, light) for name in ("a.csv", "b.csv")]
    data = load_measurements(files, ROBOT)
    assert not data.copied.any() and data.n_rows == 24
    assert "all count as measured here" in data.notes[0] and "b.csv lines 2, 3" in data.notes[0]
