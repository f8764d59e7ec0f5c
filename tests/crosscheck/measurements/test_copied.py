"""Readings that stand in another row too are named with both lines; chance is not accused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.copied import copied
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
    assert copied(data) == []
    read[300:310] = read[:10]
    assert len(copied(data)) == 1
