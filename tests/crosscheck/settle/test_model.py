"""A user's MJCF made ready for settling: what is refused, what is switched off and told."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from crosscheck.settle.physics import (
    Physics,
    change_mass_unit,
    check_cables,
    compile_model,
    ignored_in,
    ignored_note,
    platform_of,
)
from seecr.description.mjcf import load_robot, model_names, model_path, quiet_mujoco
from seecr.errors import InputFileError, RobotError

PLANAR = model_path("planar_vertical").read_text(encoding="utf-8")


def planar(old: str = "", new: str = "") -> mujoco.MjModel:
    assert PLANAR.count(old) >= 1
    return mujoco.MjModel.from_xml_string(PLANAR.replace(old, new, 1) if old else PLANAR)


SLIDE = '<joint name="x" type="slide"'


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        (SLIDE, f'{SLIDE} range="-1 1"', "joint limits"),
        ('width="0.0012"', 'width="0.0012" range="0 2" limited="true"', "tendon limits"),
        (SLIDE, f'{SLIDE} frictionloss="0.1"', "dry friction"),
        ('width="0.0012"', 'width="0.0012" frictionloss="0.1"', "dry friction"),
        (SLIDE, f'{SLIDE} damping="0.1"', "damping"),
        ('contype="0" conaffinity="0"', 'contype="1" conaffinity="1"', "contacts"),
    ],
)
def test_what_hinders_is_named_one_by_one(old, new, name):
    model = planar(old, new)
    assert ignored_in(model, platform_of(model, "r")) == (name,)
    assert Physics.of(planar(old, new)).ignored == (name,)


@pytest.mark.parametrize("name", model_names())
def test_nothing_hinders_a_shipped_robot(name):
    model = compile_model(model_path(name))
    assert ignored_in(model, platform_of(model, name)) == ()


def test_the_note_is_one_sentence_with_the_file_and_all_names():
    note = ignored_note(Path("my.xml"), ("damping", "contacts"))
    assert note.startswith("my.xml: switched off here: damping, contacts; ")
    assert "\n" not in note and not note.endswith(".")


def test_a_platform_and_its_cables_are_found_or_refused():
    model = planar()
    platform = platform_of(model, "r")
    assert model.body(platform).name == "platform"
    check_cables(model, platform, "r")
    with pytest.raises(InputFileError, match="r: tendon cable1: expected one site on the"):
        check_cables(model, 99, "r")
    still = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    with pytest.raises(InputFileError, match="r: 0 moving bodies; expected one platform"):
        platform_of(still, "r")
    with pytest.raises(InputFileError, match="expected one <spatial> tendon per cable"):
        check_cables(still, 1, "r")


def test_a_copy_is_ours_to_change():
    model = planar()
    copied = compile_model(model)
    copied.body_mass[:] *= 2.0
    assert np.all(model.body_mass[1:] * 2.0 == copied.body_mass[1:])


def test_another_unit_of_mass_moves_nothing():
    model = planar()
    lengths = [model.tendon_lengthspring.copy(), model.site_pos.copy()]
    mass, stiffness = model.body_mass.copy(), model.tendon_stiffness.copy()
    change_mass_unit(model, 0.25)
    np.testing.assert_array_equal(model.body_mass, 4.0 * mass)
    np.testing.assert_array_equal(model.tendon_stiffness, 4.0 * stiffness)
    np.testing.assert_array_equal(model.tendon_lengthspring, lengths[0])
    np.testing.assert_array_equal(model.site_pos, lengths[1])


def test_mujoco_is_quiet_inside_and_speaks_again_after():
    assert mujoco.get_mju_user_warning() is None
    with quiet_mujoco(), quiet_mujoco():
        assert mujoco.get_mju_user_warning() is not None
    assert mujoco.get_mju_user_warning() is None


def test_a_singular_platform_leaves_no_log(tmp_path, monkeypatch):
    """Its mass 1e6 m away makes MuJoCo warn wherever it is compiled, placed or settled."""
    monkeypatch.chdir(tmp_path)
    inertial = re.compile(r'<inertial pos="[^"]*"')
    Path("far.xml").write_text(inertial.sub('<inertial pos="0 0 1e6"', PLANAR), encoding="utf-8")
    with pytest.raises(RobotError, match="has its centre of mass 1e"):
        load_robot("far.xml")
    Physics.of("far.xml").update()
    assert [file.name for file in tmp_path.iterdir()] == ["far.xml"]


def test_without_a_load_residuals_are_relative_to_what_cables_pull() -> None:
    physics = Physics.of(model_path("planar_vertical"))
    physics.set_load(gravity=np.zeros(3))
    assert 0.0 < physics.force_scale < np.inf and 0.0 < physics.rounding() < 1e-6
    before = physics.force_scale
    physics.set_cables(0.9 * physics.rest_lengths, physics.stiffness * physics.rest_lengths)
    physics.place(physics.pose())
    assert physics.force_scale == pytest.approx(np.sum(physics.tensions())) != before
    physics.set_load()
    assert physics.force_scale == pytest.approx(physics.mass * 9.81)
