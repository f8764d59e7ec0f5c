"""Orientations of another convention are no robot's effects; a true robot is never accused."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from effect_cases import random_term
from made_data import measured, refused, run, soft_cogiro, soft_xml, term
from scipy.spatial.transform import Rotation

import crosscheck
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Unfit
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.prepare import prepare
from crosscheck.preparation.suspect import CONVENTIONS, misread_orientations
from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, catalogue
from seecr.effects.base import Readings
from seecr.pose import Array, quat_from_rotvec, quat_multiply, rotvec_from_quat
from seecr.prediction.experiment import Experiment

COGIRO = soft_cogiro()
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
    data = tilting((term(COGIRO, "platform_mass", added_kg=0.1 * COGIRO.mass),), deg=15.0)
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


def test_a_platform_that_tilts_the_other_way_is_no_convention() -> None:
    """A drum is too large, not too small: all rotations are the opposite of those expected."""
    there, here = (term(COGIRO, "drum_gain", gain_3=x) for x in (0.02, -0.02))
    data = tilting((there,), deg=0.0)
    problem = Problem(COGIRO, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    expected = problem.experiment.predict(Terms((here,)).effects).readings
    read, wrong = rotvec_from_quat(data.quat_wxyz), rotvec_from_quat(expected.quat_wxyz)
    far, near = (np.median(np.linalg.norm(read - s * wrong, axis=1)) for s in (1.0, -1.0))
    assert far > 4.0 * near
    said = said_of(problem, expected)
    assert said is None or (said.or_tilts and not said.certain)


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
