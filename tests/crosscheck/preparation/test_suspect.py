"""A file of another robot, in another unit, filled in, or of a run that stopped, is noticed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, refused, soft_cogiro

import crosscheck
from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements, together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.prepare import prepare
from crosscheck.preparation.suspect import stuck_doubts
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.errors import InputFileError
from seecr.pose import (
    Array,
    quat_from_rotvec,
    quat_from_rxyz,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)

COGIRO, PLANAR = soft_cogiro(), load_robot(model_path("planar_vertical"))


@pytest.fixture(scope="module")
def cogiro():
    return measured(COGIRO, points=3, sigma=Sigma(3e-5, 3.5e-4, 0.05), tensions=True)


def notes(robot, data):
    return " ".join(crosscheck.compare(robot, data).notes)


def test_commands_off_the_joints_of_a_planar_robot(tmp_path):
    data = tmp_path / "measured.csv"
    write_measurements(data, measured(COGIRO, points=3))
    with pytest.raises(InputFileError, match=(
        r"measured.csv: line \d+: the joints of robot .* cannot reach the commanded pose: it is "
        r"off by .*; expected a pose that they can reach; are these the commands of another robot\?"
    )):  # fmt: skip
        load_measurements(data, PLANAR)
    said = refused("compare", model_path("planar_vertical"), data, "--out", tmp_path / "out")
    assert "are these the commands of another robot?" in said and not (tmp_path / "out").exists()


def test_positions_that_do_not_follow_the_commands(cogiro, tmp_path):
    file = tmp_path / "measured.csv"
    swapped = replace(cogiro, position=cogiro.position[:, [1, 0, 2]], tensions=None)
    for data, odd in ((cogiro, False), (swapped, True)):
        write_measurements(file, data)
        said = " ".join(load_measurements(file, COGIRO).notes)
        assert ("The measured positions do not follow the commands: they are" in said) is odd
        told = " m if meas_x and meas_y are exchanged. Are axes exchanged, is this the file"
        assert (told in said) is odd
    write_measurements(file, replace(swapped, free=("tracker_frame",)))
    assert "do not follow" not in " ".join(load_measurements(file, COGIRO).notes)


def test_a_model_worse_than_the_commands(cogiro):
    assert "the commands themselves are only" not in notes(COGIRO, cogiro)
    obeyed = replace(cogiro, position=cogiro.command_pose[:, :3] + 1e-5, tensions=None)
    assert "the commands themselves are only 0.0100 mm from them (rms)" in notes(COGIRO, obeyed)
    assert "the commands themselves" not in notes(COGIRO, obeyed.rows(slice(3)))


def test_of_several_files_the_one_of_another_robot_is_named(cogiro):
    odd = replace(cogiro, position=cogiro.command_pose[:, :3] + 1e-5, tensions=None)
    both = together([replace(cogiro, path=Path("own.csv")), replace(odd, path=Path("odd.csv"))])
    said = [
        note for note in crosscheck.compare(COGIRO, both).notes if "commands themselves" in note
    ]
    assert len(said) == 1 and said[0].startswith("odd.csv: The model is ")


def test_rotations_in_radians_that_are_called_degrees(cogiro):
    assert "Rotations change" not in notes(COGIRO, cogiro)
    turned = rotvec_from_quat(cogiro.quat_wxyz) * np.pi / 180.0
    # as read beside the target's own orientation, which says nothing of the unit
    target = quat_from_rotvec(np.array([0.3, 0.0, 0.2]))
    read = quat_multiply(quat_from_rotvec(turned), target)
    data = replace(cogiro, quat_wxyz=read, tensions=None)
    assert "are these radians in columns of degrees" in notes(COGIRO, data)
    angles = replace(cogiro, quat_wxyz=None, angles_rad=turned * [1, np.nan, 1], tensions=None)
    assert "are these radians in columns of degrees" in notes(COGIRO, angles)
    still = replace(COGIRO, ea=1e4 * COGIRO.ea)  # whose platform hardly turns
    level = cogiro.rows(cogiro.run != "loop")
    assert "Rotations change" not in notes(still, replace(level, position=level.command_pose[:, :3],
        quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (level.n_rows, 1)), tensions=None))  # fmt: skip


NOT_COUNTED = (
    "{}: not counted as readings, because the file has the same number in every row where the "
    "model expects changes; leave the cells empty where nothing was read"
)


@pytest.mark.parametrize(
    ("filled", "names"),
    [
        (
            lambda data: replace(data, quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (data.n_rows, 1))),
            "rotation about x, rotation about y, rotation about z",
        ),
        (lambda data: replace(data, tensions=0.0 * data.tensions),
         ", ".join(f"tension_{k}" for k in range(1, 9))),
        (lambda data: replace(data, tensions=np.where(np.arange(8) == 2, 7.5, data.tensions)),
         "tension_3"),
        (lambda data: replace(data, position=np.where(np.arange(3) == 2, 0.1, data.position)), "z"),
    ],
    ids=["orientation", "tensions", "one tension", "z"],
)  # fmt: skip
def test_a_constant_that_was_filled_in_is_no_reading(cogiro, filled, names):
    """No effect was missing, said the diagnosis, and a comparison of the same data the opposite."""
    spoilt = prepare(COGIRO, filled(cogiro), Terms())
    assert [n for n in spoilt.notes if "same number" in n] == [NOT_COUNTED.format(names)]
    assert not any("Rotations change" in n or "Tensions of" in n for n in spoilt.notes)
    blank = spoilt.problem.data
    assert spoilt.problem.n_readings == prepare(COGIRO, blank, Terms()).problem.n_readings
    whole = prepare(COGIRO, cogiro, Terms()).problem.n_readings
    assert spoilt.problem.n_readings == whole - (names.count(",") + 1) * cogiro.n_rows


def test_one_angle_of_three_that_was_filled_in_leaves_the_others(cogiro):
    angles = rxyz_from_quat(cogiro.quat_wxyz) * [1.0, 0.0, 1.0]
    ready = prepare(COGIRO, replace(cogiro, quat_wxyz=quat_from_rxyz(angles)), Terms())
    assert NOT_COUNTED.format("rotation about y") in ready.notes
    seen = ready.problem.counted[:, 3:6].any(axis=0)
    assert seen.tolist() == [True, False, True]
    np.testing.assert_allclose(ready.problem.data.angles_rad[:, 0], angles[:, 0], atol=1e-12)


def test_of_several_files_only_the_one_that_was_filled_in_loses_them(cogiro):
    level = np.tile([1.0, 0.0, 0.0, 0.0], (cogiro.n_rows, 1))
    parts = [replace(cogiro, path=Path("own.csv")),
             replace(cogiro, path=Path("level.csv"), quat_wxyz=level)]  # fmt: skip
    ready = prepare(COGIRO, together(parts), Terms())
    turned = ", ".join(f"rotation about {axis}" for axis in "xyz")
    assert [n for n in ready.notes if "same number" in n] == [
        f"level.csv: {NOT_COUNTED.format(turned)}"
    ]
    seen = ready.problem.counted[:, 3:6].all(axis=1)
    assert np.array_equal(seen, ready.problem.data.file == 0)


AGAIN = "not counted as readings, because the same number stands there again and again where the"
TENSIONS = ", ".join(f"tension_{k}" for k in range(1, 9))


@pytest.mark.parametrize(
    ("spoil", "names"),
    [
        (lambda d, some: replace(d, tensions=np.where(some, 0.0, d.tensions)), TENSIONS),
        (lambda d, some: replace(d, tensions=np.where(some, -1.0, d.tensions)), TENSIONS),
        (lambda d, some: replace(d, tensions=np.where(some, d.tensions[0], d.tensions)), TENSIONS),
        (lambda d, some: replace(d, quat_wxyz=np.where(some, [1.0, 0, 0, 0], d.quat_wxyz)),
         "rotation about x, rotation about y, rotation about z"),
        (lambda d, some: replace(d, position=np.where(some & [[True, False, True]], [9.0, 0, -1],
                                                      d.position)), "x, z"),
    ],
    ids=["0", "-1", "the last value", "no turn", "positions"],
)  # fmt: skip
def test_cells_that_were_filled_in_are_no_readings(cogiro, spoil, names):
    """In a third of the rows; the others count."""
    some = (np.arange(cogiro.n_rows) % 3 == 1)[:, None]
    ready = prepare(COGIRO, spoil(cogiro, some), Terms())
    (said,) = [note for note in ready.notes if "again and again" in note]
    assert said.startswith(f"{names}: lines ") and AGAIN in said
    width = names.count(",") + 1
    gone = prepare(COGIRO, cogiro, Terms()).problem.n_readings - ready.problem.n_readings
    assert 0 <= gone - width * int(some.sum()) <= width  # the value that was held, too


def test_coarse_readings_repeat_by_rounding(cogiro):
    """In steps of half the usual tension: as many of one number, nearly, as of the next."""
    step = 0.5 * float(np.sqrt(np.mean(cogiro.tensions**2)))
    coarse = replace(cogiro, tensions=np.round(cogiro.tensions / step) * step)
    assert not any("again and again" in n for n in prepare(COGIRO, coarse, Terms()).notes)


def test_numbers_that_may_well_stay_the_same_are_readings(cogiro):
    slack = np.where(np.arange(8) == 2, 0.0, cogiro.tensions)
    still = replace(COGIRO, ea=1e4 * COGIRO.ea)  # whose platform hardly turns
    level = replace(cogiro, quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (cogiro.n_rows, 1)))
    for robot, data in ((COGIRO, replace(cogiro, tensions=slack)),
                        (still, level.rows(cogiro.run != "loop"))):  # fmt: skip
        assert not any("same number" in note for note in prepare(robot, data, Terms()).notes)


@pytest.fixture(scope="module")
def data() -> Measurements:
    return measured(COGIRO, points=8)


def stops(data: Measurements, first: int, last: int) -> Measurements:
    position = data.position.copy()
    noise = np.random.default_rng(1).normal(size=(last - first, 3))
    position[first + 1 : last + 1] = position[first] + 3e-5 * noise
    return replace(data, position=position)


def stuck_notes(data: Measurements) -> list[str]:
    return [note for note in prepare(COGIRO, data, Terms()).notes if "tracker stop" in note]


@pytest.mark.parametrize("row", [0, -1], ids=["first run", "last run"])
def test_rows_after_a_crash_are_named(data: Measurements, row: int) -> None:
    run = np.flatnonzero(data.run == data.run[row])
    (note,) = stuck_notes(stops(data, run[2], run[-1]))
    at, first, last = data.line[[run[2], run[3], run[-1]]]
    assert note.startswith(
        f"Lines {first} to {last}, run {data.run[row]}: the position stays within"
    )
    assert f"of that at line {at}, where" in note


def test_so_many_are_counted_where_more_than_three_stop(data: Measurements) -> None:
    stopped = data
    for run in np.unique(data.run_index):
        rows = np.flatnonzero(data.run_index == run)
        stopped = stops(stopped, rows[2], rows[-1])
    assert len(stuck_notes(stopped)) == 3
    (count,) = [n for n in prepare(COGIRO, stopped, Terms()).notes if "also stays" in n]
    assert (
        count
        == f"The position also stays in {len(np.unique(data.run)) - 3} other parts of the data."
    )


def test_a_run_that_goes_on_has_no_such_note(data: Measurements) -> None:
    assert stuck_notes(data) == []
    lost = data.position.copy()
    lost[2:6] = np.nan
    assert stuck_notes(replace(data, position=lost)) == []


def stretches(read: Array, there: Array, spread: float = 1.0) -> list[str]:
    """Lines that are named where positions (n, 3) are read beside those that are predicted.

    A last row, in a run of its own, makes the predicted positions spread.
    """
    far = spread * np.array([[0.0, 0.0, 1.0]])
    read, there = (np.concatenate([table, table[:1] + far]) for table in (read, there))
    run = np.repeat(["a", "b"], [len(read) - 1, 1])
    pose = np.tile(COGIRO.reference_pose, (len(read), 1))
    data = Measurements(Path("a.csv"), 8, run, command_pose=pose, position=read)
    problem = Problem(COGIRO, data, Sigma(1e-4), np.ones(len(read), dtype=bool))
    return [note.partition(",")[0] for note in stuck_doubts(problem, there)]


def test_stretches_end_where_the_platform_moves_again() -> None:
    there = np.linspace(0.0, 1.0, 11)[:, None] * [1.0, 0.0, 0.0]
    read = there.copy()
    assert stretches(read, there) == []
    read[3:8] = read[3]
    assert stretches(read, there) == ["Lines 6 to 9"]
    # far less than the whole way is no standstill that could be told from backlash
    assert stretches(read, there, 6.0) == []
    # and begin where commands leave the place, and end where they are back: those rows are right
    back = np.repeat([0.0, 1.0, 0.0], 4)[:, None] * [1.0, 0.0, 0.0]
    assert stretches(np.zeros_like(back), back) == ["Lines 6 to 9"]
    # readings of one place under one command
    assert stretches(np.repeat(there, 5, axis=0), np.repeat(there, 5, axis=0)) == []
