"""Measurements from arrays and data frames are those of the same file."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow
import pytest

import crosscheck
import seecr
from crosscheck import Measurements, Sigma, load_measurements, write_measurements
from seecr.errors import InputError

ROBOT = seecr.load_robot("demobot_parallel")
PLACES = np.array([[0.3, 0.25, 0.1], [0.4, 0.25, 0.1], [0.5, 0.25, 0.1], [0.3, 0.3, 0.12]])
SOLUTION = seecr.solve(ROBOT, PLACES)
READ = {
    "positions": SOLUTION.pose[:, :3],
    "quaternions": SOLUTION.pose[:, 3:],
    "tensions": np.where(SOLUTION.tensions > 1.0, SOLUTION.tensions, np.nan),
}


def made() -> Measurements:
    return Measurements.from_arrays(
        ROBOT, commands=PLACES, **READ, runs=["a", "a", "b", "b"], times=[0, 1, 2, 3],
        payloads=[0, 0, 0.1, 0.1], temperatures=np.full(4, 20.0), sigma="0.1mm",
    )  # fmt: skip


def test_arrays_are_read_as_their_file(tmp_path) -> None:
    data = made()
    write_measurements(tmp_path / "m.csv", data)
    same = load_measurements(tmp_path / "m.csv", ROBOT)
    assert len(data) == 4 == data.n_rows
    for name in ("command_pose", "position", "quat_wxyz", "tensions", "t_s", "temperature_C"):
        assert np.allclose(getattr(data, name), getattr(same, name), atol=1e-8, equal_nan=True)
    assert data.runs == same.runs == ("a", "b")
    assert data.sigma == same.sigma == Sigma(position_m=1e-4)
    assert data.loads.mass.tolist() == [0, 0, 0.1, 0.1]
    assert repr(data).startswith("arrays: 4 rows in 2 runs, positions, orientations, tensions")
    assert np.array_equal(data.position, READ["positions"])  # no digit is lost


def test_frames_are_read_as_their_file() -> None:
    data = made()
    for frame in (data.to_frame(), dict(data.columns()), Pandas(dict(data.columns()))):
        if isinstance(frame, dict):
            frame = pyarrow.table(frame)
        same = Measurements.from_frame(ROBOT, frame, sigma=2e-4)
        assert np.array_equal(same.position, data.position)
        assert np.array_equal(same.tensions, data.tensions, equal_nan=True)
        assert same.sigma == Sigma(position_m=2e-4)
    foreign = pyarrow.table({"a": [0.3], "b": [0.25], "c": [0.1], "px": [0.31]})
    names = {"a": "cmd_x_m", "b": "cmd_y_m", "c": "cmd_z_m", "px": "meas_x_m"}
    assert Measurements.from_frame(ROBOT, foreign, columns=names).position[0, 0] == 0.31


class Pandas:
    """What pandas and Polars have: names, and columns that list their values."""

    def __init__(self, columns: dict[str, list[Any]]) -> None:
        self.columns = list(columns)
        self._columns = columns

    def __getitem__(self, name: str) -> Any:
        return np.array([np.nan if v is None else v for v in self._columns[name]])


REFUSED: dict[str, tuple[Callable[[], Any], list[str]]] = {
    "shapes": (
        lambda: Measurements.from_arrays(ROBOT, commands=PLACES[:, :2], tensions=PLACES),
        [r"commands: expected \(n, 3\) or \(n, 7\), got \(4, 2\)",
         r"tensions: expected \(n, 8\), got \(4, 3\)"],
    ),
    "lengths": (
        lambda: Measurements.from_arrays(ROBOT, commands=PLACES, positions=PLACES[:3]),
        ["expected as many rows in all arrays, got .*'meas_z_m': 3"],
    ),
    "rows": (
        lambda: Measurements.from_arrays(
            ROBOT, commands=np.where(PLACES == 0.4, np.nan, PLACES),
            temperatures=[20, 20, 400, np.nan], positions=PLACES,
        ),
        ["arrays: row 3, column temperature_C: .*empty", "arrays: row 1, column cmd_x_m: .*empty"],
    ),
    "nothing": (lambda: Measurements.from_arrays(ROBOT), ["arrays: expected one row"]),
    "words": (lambda: Measurements.from_arrays(ROBOT, commands="x"), ["commands: expected number"]),
    "array as frame": (
        lambda: Measurements.from_frame(ROBOT, PLACES), ["data frame .* got ndarray; arrays go"]
    ),
    "sigma": (
        lambda: Measurements.from_arrays(ROBOT, commands=PLACES, sigma="0.1 bananas"),
        ["sigma: expected a number with its unit .*'bananas'"],
    ),
    "negative sigma": (
        lambda: Measurements.from_arrays(ROBOT, commands=PLACES, sigma=-1.0),
        ["position_m: expected a number above zero, got -1.0"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_mistakes_are_told_together(name: str) -> None:
    call, expected = REFUSED[name]
    with pytest.raises(seecr.SeecrError) as caught:
        call()
    assert isinstance(caught.value, InputError | crosscheck.CrosscheckError)
    lines = str(caught.value).split("\n")
    assert len(lines) == len(expected)
    for line, said in zip(lines, expected, strict=True):
        assert re.search(said, line), line


def test_sigma_is_an_argument_of_what_compares() -> None:
    data = made()
    assert crosscheck.compare(ROBOT, data).as_json()["sigma"].position_m == 1e-4
    for sigma in (3e-4, "0.3mm", Sigma(position_m=3e-4)):
        used = crosscheck.compare(ROBOT, data, sigma=sigma).as_json()["sigma"]
        assert used.position_m == pytest.approx(3e-4)
    assert data.sigma == Sigma(position_m=1e-4)


def test_positions_are_poses_turned_as_the_reference() -> None:
    whole = np.column_stack([PLACES, np.tile(ROBOT.reference_pose[3:], (4, 1))])
    assert np.array_equal(SOLUTION.command, whole)
    assert np.array_equal(seecr.solve(ROBOT, whole).pose, SOLUTION.pose)
    found = seecr.correct(ROBOT, PLACES)
    assert np.array_equal(found.lengths, seecr.correct(ROBOT, whole).lengths)
    assert np.array_equal(ROBOT.commanded_lengths(PLACES), ROBOT.commanded_lengths(whole))
    with pytest.raises(InputError, match=r"poses must be \(n, 7\)"):
        seecr.solve(ROBOT, PLACES[:, :2])
