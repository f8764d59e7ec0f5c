"""A file of another robot, in another unit, filled in, or of a run that stopped, is noticed."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from called import refused, run
from effect_cases import random_term
from made_data import measured, soft_cogiro, soft_xml, term
from scipy.spatial.transform import Rotation

import crosscheck
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Unfit
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements, together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.prepare import prepare
from crosscheck.preparation.suspect import CONVENTIONS, misread_orientations, stuck_doubts
from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, catalogue
from seecr.effects.base import Readings
from seecr.errors import InputFileError
from seecr.pose import (
    Array,
    quat_from_rotvec,
    quat_from_rxyz,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)
from seecr.prediction.experiment import Experiment

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
    for number in np.unique(data.run_index):
        rows = np.flatnonzero(data.run_index == number)
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


# Orientations of another convention are no robot's effects; a true robot is never accused

NOISE = 3.5e-4


def tilting(terms: tuple[Term, ...] = (), deg: float = 4.0, rows: int = 40, seed: int = 0):
    """Readings at poses in no order, each of which is commanded to tilt by up to ``deg``."""
    rng = np.random.default_rng(seed)
    pose = np.tile(COGIRO.reference_pose, (rows, 1))
    pose[:, :3] += rng.uniform(-1.0, 1.0, (rows, 3)) * np.array([0.15, 0.1, 0.08])
    pose[:, 3:] = quat_from_rotvec(np.radians(deg) * rng.uniform(-1.0, 1.0, (rows, 3)))
    found = Experiment(COGIRO, Commands(pose)).predict(Terms(terms).effects)
    assert found.solved.all()
    return Measurements(
        path=Path("measured.csv"),
        n_cables=COGIRO.n_cables,
        run=np.full(rows, "a"),
        command_pose=pose,
        position=found.readings.position + 3e-5 * rng.standard_normal((rows, 3)),
        quat_wxyz=quat_multiply(
            quat_from_rotvec(NOISE * rng.standard_normal((rows, 3))), found.readings.quat_wxyz
        ),
        sigma=Sigma(position_m=3e-5, orientation_rad=NOISE),
    )


def as_angles(angles: Array) -> Array:
    """Quaternions of columns rx ry rz [rad], as files are read, by SciPy."""
    return np.asarray(Rotation.from_euler("XYZ", angles).as_quat(scalar_first=True))


SCALAR_LAST, INVERTED, BOTH, NEGATED, VECTOR, *ORDERS, YAW_FIRST, YAW_FIRST_FIXED = CONVENTIONS

ZYX = ORDERS[-1]


def written_as(quat: Array, convention: str) -> Array:
    """What is read of a file that was written by another convention."""
    turn = Rotation.from_quat(quat, scalar_first=True)
    others = {
        SCALAR_LAST: lambda: np.roll(quat, -1, axis=1),
        INVERTED: lambda: np.asarray(turn.inv().as_quat(scalar_first=True)),
        BOTH: lambda: np.roll(turn.inv().as_quat(scalar_first=True), -1, axis=1),
        NEGATED: lambda: as_angles(-turn.as_euler("XYZ")),
        VECTOR: lambda: as_angles(turn.as_rotvec()),
        YAW_FIRST: lambda: as_angles(turn.as_euler("ZYX")),
        YAW_FIRST_FIXED: lambda: as_angles(turn.as_euler("XYZ")[:, ::-1]),
    }
    if convention in others:
        return others[convention]()
    axes = "".join(re.findall(r"R([xyz])\(", convention)).upper()
    return as_angles(turn.as_euler(axes)[:, [axes.index(axis) for axis in "XYZ"]])


OR_TILTS = "is that how they are written, or does the platform tilt to the other side?"


@dataclass
class Found:
    """What a note or a refusal says: angles [rad], and the convention."""

    here: float
    there: float
    convention: str
    certain: bool
    or_tilts: bool


def said_of(problem: Problem, readings: Readings) -> Found | None:
    """What is said about the orientations of some data beside what a model expects."""
    asked, refusal = misread_orientations(problem, readings)
    said = asked[0] if asked else str(refusal)
    match = re.search(r"are (\S+) deg from .* expects, and (?:only )?(\S+) deg if (.*?): ", said)
    if match is None:
        assert not asked and refusal is None
        return None
    here, there = np.radians([float(match[1]), float(match[2])])
    return Found(here, there, match[3], refusal is not None, said.endswith(OR_TILTS))


def found_in(data: Measurements, robot: Robot = COGIRO) -> Found | None:
    """The same beside the plain model."""
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    return said_of(problem, problem.experiment.predict(Terms().effects).readings)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("deg", [4.0, 20.0])
def test_orientations_of_another_convention_are_known(convention: str, deg: float) -> None:
    data = tilting(deg=deg)
    assert data.quat_wxyz is not None
    found = found_in(replace(data, quat_wxyz=written_as(data.quat_wxyz, convention)))
    assert found is not None and found.convention == convention and found.certain
    assert found.there < 3.0 * NOISE and found.here > 1.5 * found.there


@pytest.mark.parametrize("convention", [ZYX, SCALAR_LAST])
def test_outliers_and_an_effect_do_not_hide_it(convention: str) -> None:
    data = tilting(
        (
            term(
                COGIRO,
                "platform_mass",
                added_kg=0.1 * COGIRO.mass,
            ),
        ),
        deg=15.0,
    )
    assert data.quat_wxyz is not None
    quat = written_as(data.quat_wxyz, convention)
    quat[::10] = quat_multiply(quat_from_rotvec(np.array([0.5, -0.3, 0.1])), quat[::10])
    found = found_in(replace(data, quat_wxyz=quat))
    assert found is not None and found.convention == convention


def test_where_conventions_hardly_differ_it_is_asked_and_no_more() -> None:
    data = tilting(deg=3.2)
    assert data.quat_wxyz is not None
    odd = replace(data, quat_wxyz=written_as(data.quat_wxyz, VECTOR))
    ready = prepare(COGIRO, odd, Terms())
    assert ready.refusal is None
    (note,) = (note for note in ready.notes if note.endswith("is that how they are written?"))
    assert "deg if the three angles are a rotation vector: is that how" in note
    assert not any("are written?" in note for note in prepare(COGIRO, data, Terms()).notes)


@pytest.mark.parametrize("deg", [0.0, 4.0, 15.0])
@pytest.mark.parametrize("name", sorted(catalogue()))
def test_no_effect_is_taken_for_a_convention(name: str, deg: float) -> None:
    """Also one ten times its expected size, of which a verdict will speak."""
    still = tilting(deg=deg)
    assert still.command_pose is not None
    experiment = Experiment(COGIRO, Commands(still.command_pose))
    for part, seed in ((1.0, 1), (10.0, 2)):
        effect = random_term(np.random.default_rng(seed), experiment, name, part)
        if experiment.predict(Terms((effect,)).effects).solved.all():
            assert found_in(tilting((effect,), deg=deg)) is None


def test_inverted_rotations_of_level_commands_are_asked_and_no_more() -> None:
    """A platform that tilts to the other side turns alike, which no orientation can tell."""
    data = tilting((term(COGIRO, "drum_gain", gain_3=0.02),), deg=0.0)
    expected = Experiment(COGIRO, Commands(data.command_pose)).predict(
        Terms((term(COGIRO, "drum_gain", gain_3=0.02),)).effects
    )
    odd = replace(data, quat_wxyz=written_as(data.quat_wxyz, INVERTED))
    problem = Problem(COGIRO, odd, odd.sigma, np.ones(odd.n_rows, dtype=bool))
    said = said_of(problem, expected.readings)
    assert said is not None and said.convention == INVERTED
    assert said.or_tilts and not said.certain


def test_a_target_that_is_turned_over_is_no_convention() -> None:
    """Half a turn about z looks like the scalar at the other end, but not as it tilts."""
    data = tilting()
    assert data.quat_wxyz is not None
    over = quat_multiply(data.quat_wxyz, np.array([0.0, 0.0, 0.0, 1.0]))
    assert found_in(replace(data, quat_wxyz=over)) is None


def test_no_verdict_is_passed_on_them(tmp_path: Path, unpaged: None) -> None:
    xml, file, model = tmp_path / "robot.xml", tmp_path / "measured.csv", tmp_path / "model.toml"
    xml.write_text(soft_xml(), encoding="utf-8")
    data = tilting(deg=10.0)
    assert data.quat_wxyz is not None
    write_measurements(file, replace(data, quat_wxyz=written_as(data.quat_wxyz, ZYX)))
    said = refused("add", "stiffness", xml, file, "--model", model)
    assert "if the angles are those of R = Rz(rz) Ry(ry) Rx(rx)" in said and not model.exists()
    done = run("diagnose", xml, file, "--no-recording", "--out", tmp_path / "out")
    assert done.exit_code == 0 and "no_verdict: The measured orientations" in done.output
    assert "measure next: write how the platform is turned as seen from the base" in done.output


def test_compare_says_so_too_and_of_several_files_which() -> None:
    data = tilting()
    assert data.quat_wxyz is not None
    odd = replace(data, quat_wxyz=written_as(data.quat_wxyz, INVERTED))
    both = together([replace(data, path=Path("own.csv")), replace(odd, path=Path("odd.csv"))])
    refusal = prepare(COGIRO, both, Terms()).refusal
    assert refusal is not None and refusal.unfit is Unfit.OTHER_CONVENTION
    found = crosscheck.compare(COGIRO, both)
    said = found.sentence
    assert str(found.refusal) in said and str(found.refusal) not in found.notes
    assert said.startswith("No verdict: the measured orientations of odd.csv are ")
    assert "deg if every rotation is inverted: they seem to be written by another conv" in said
    assert "look random" not in said
    assert prepare(COGIRO, measured(COGIRO, points=4), Terms()).refusal is None


def seen_as(read: Array, expected: Array, told: Array) -> str | None:
    """What is said of orientations beside those that a model expects and those commanded."""
    pose = np.tile(COGIRO.reference_pose, (len(read), 1))
    pose[:, 3:] = told
    data = replace(tilting(rows=len(read)), command_pose=pose, quat_wxyz=read)
    problem = Problem(COGIRO, data, data.sigma, np.ones(len(read), dtype=bool))
    readings = replace(problem.experiment.predict(()).readings, quat_wxyz=expected)
    found = said_of(problem, readings)
    return None if found is None or found.or_tilts else found.convention


def test_inverted_rotations_are_seen_though_the_platform_rests_far_from_its_commands() -> None:
    """It rested 9 to 17 degrees off, and 18 degrees were diagnosed as something unknown."""
    rng = np.random.default_rng(5)
    told = quat_from_rotvec(0.15 * rng.uniform(-1.0, 1.0, (40, 3)))
    expected = quat_multiply(told, quat_from_rotvec(0.2 * rng.uniform(-1.0, 1.0, (40, 3))))
    read = written_as(
        quat_multiply(quat_from_rotvec(NOISE * rng.standard_normal((40, 3))), expected),
        INVERTED,
    )
    assert seen_as(read, expected, told) == INVERTED


@pytest.mark.parametrize("commanded", [0.0, 0.15])
def test_a_tilt_to_the_other_side_is_no_convention(commanded: float) -> None:
    """A centre of mass on the wrong side of a level platform inverts every rotation."""
    rng = np.random.default_rng(6)
    told = quat_from_rotvec(commanded * rng.uniform(-1.0, 1.0, (40, 3)))
    tilt = rng.uniform(-0.1, 0.1, (40, 3))
    expected = quat_multiply(told, quat_from_rotvec(tilt))
    read = quat_multiply(told, quat_from_rotvec(-tilt))
    assert seen_as(read, expected, told) is None
