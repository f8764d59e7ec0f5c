"""A file that belongs to another robot, or says another unit than it has, is noticed and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, refused, run, soft_cogiro, soft_xml

import crosscheck
from crosscheck.fit.reasons import Unfit
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import load_commands, load_measurements, together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.errors import InputFileError
from seecr.pose import (
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


def test_most_commands_outside_the_frame(tmp_path):
    file = tmp_path / "commands.csv"
    far = COGIRO.reference_pose[:3] + COGIRO.reach * np.array([0.9, 0.9, 0.0])
    lines = [",".join(f"{v:.4f}" for v in (*far[:2], far[2] + 0.01 * k)) for k in range(5)]
    file.write_text("\n".join(["cmd_x_m,cmd_y_m,cmd_z_m", *lines]) + "\n")
    with pytest.raises(InputFileError, match=r"most commands are outside the .*another robot"):
        load_commands(file, COGIRO)
    near = [",".join(f"{v:.4f}" for v in COGIRO.reference_pose[:3])] * 3
    file.write_text("\n".join(["cmd_x_m,cmd_y_m,cmd_z_m", *near, *lines[:3]]) + "\n")
    assert load_commands(file, COGIRO).n_rows == 6


def test_positions_that_do_not_follow_the_commands(cogiro, tmp_path):
    file = tmp_path / "measured.csv"
    swapped = replace(cogiro, position=cogiro.position[:, [1, 0, 2]], tensions=None)
    for data, odd in ((cogiro, False), (swapped, True)):
        write_measurements(file, data)
        said = " ".join(load_measurements(file, COGIRO).notes)
        assert ("The measured positions do not follow the commands: they are" in said) is odd
    write_measurements(file, replace(swapped, free=("tracker_frame",)))
    assert "do not follow" not in " ".join(load_measurements(file, COGIRO).notes)


def test_degrees_in_a_column_of_radians(tmp_path):
    file = tmp_path / "measured.csv"
    home = ",".join(f"{v:.4f}" for v in COGIRO.reference_pose[:3])
    for unit, odd in (("rad", True), ("deg", False)):
        rows = [f"{home},{angle}" for angle in (1.1, -0.9, 0.8, 1.3)]
        file.write_text("\n".join([f"cmd_x_m,cmd_y_m,cmd_z_m,meas_ry_{unit}", *rows]) + "\n")
        if odd:
            with pytest.raises(InputFileError, match="name the column meas_ry_deg"):
                load_measurements(file, COGIRO)
        else:
            assert load_measurements(file, COGIRO).n_rows == 4


def test_a_model_worse_than_the_commands(cogiro):
    assert "the commands themselves are only" not in notes(COGIRO, cogiro)
    obeyed = replace(cogiro, position=cogiro.command_pose[:, :3] + 1e-5, tensions=None)
    assert "the commands themselves are only 0.0100 mm from them (rms)" in notes(COGIRO, obeyed)


def test_of_several_files_the_one_of_another_robot_is_named(cogiro):
    odd = replace(cogiro, position=cogiro.command_pose[:, :3] + 1e-5, tensions=None)
    both = together([replace(cogiro, path=Path("own.csv")), replace(odd, path=Path("odd.csv"))])
    said = [
        note for note in crosscheck.compare(COGIRO, both).notes if "commands themselves" in note
    ]
    assert len(said) == 1 and said[0].startswith("odd.csv: The model is ")


@pytest.mark.slow
def test_newtons_in_a_column_of_kilonewtons(cogiro, tmp_path, unpaged):
    assert "Tensions of" not in notes(COGIRO, cogiro)
    assert "where the model expects" in notes(
        COGIRO, replace(cogiro, tensions=1e3 * cogiro.tensions)
    )
    xml, file = tmp_path / "robot.xml", tmp_path / "measured.csv"
    xml.write_text(soft_xml())
    write_measurements(file, replace(cogiro, tensions=1e3 * cogiro.tensions))
    done = run("diagnose", xml, file, "--only", "stiffness", "--no-recording",
               "--out", tmp_path / "out")  # fmt: skip
    assert done.stdout.count("note: Tensions of") == 1
    # whatever is fitted to them says so, from Python as well
    kilo = replace(cogiro, tensions=1e3 * cogiro.tensions)
    assert any("Tensions of" in note for note in prepare(COGIRO, kilo, Terms()).all_notes)


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


def test_numbers_that_may_well_stay_the_same_are_readings(cogiro):
    slack = np.where(np.arange(8) == 2, 0.0, cogiro.tensions)
    still = replace(COGIRO, ea=1e4 * COGIRO.ea)  # whose platform hardly turns
    level = replace(cogiro, quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (cogiro.n_rows, 1)))
    for robot, data in ((COGIRO, replace(cogiro, tensions=slack)),
                        (still, level.rows(cogiro.run != "loop"))):  # fmt: skip
        assert not any("same number" in note for note in prepare(robot, data, Terms()).notes)


def test_where_all_readings_are_the_same_that_is_said_instead(cogiro):
    same = {name: np.repeat(getattr(cogiro, name)[:1], cogiro.n_rows, axis=0)
            for name in ("position", "quat_wxyz", "tensions")}  # fmt: skip
    refusal = prepare(COGIRO, replace(cogiro, **same), Terms()).refusal
    assert refusal is not None and refusal.unfit is Unfit.FROZEN_READINGS


def test_axes_that_were_exchanged_are_named(cogiro, tmp_path):
    file = tmp_path / "measured.csv"
    write_measurements(file, replace(cogiro, position=cogiro.position[:, [1, 0, 2]]))
    (said,) = (n for n in load_measurements(file, COGIRO).notes if "do not follow" in n)
    assert " m if meas_x and meas_y are exchanged. Are axes exchanged, is this the file" in said
