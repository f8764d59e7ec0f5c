"""The mass matrix: kinetic energy of motions whose velocities are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from three_cables import THREE

import seecr
from seecr.commands import Commands
from seecr.effects.setup import plain_setup
from seecr.pose import Array, quat_from_rotvec, quat_rotate
from seecr.statics.solution import mass_matrices
from seecr.statics.tables import assemble

ASIDE = np.array([0.1, -0.2, 0.3])
FREE = replace(
    seecr.load_robot("demobot_cogiro"), mass=2.0, centre_of_mass=ASIDE,
    inertia=np.diag([0.01, 0.02, 0.04]), joints=(),
)  # fmt: skip


def matrix(robot: seecr.Robot, pose: Array) -> Array:
    tables = assemble(plain_setup(robot, Commands(pose[None])))
    return mass_matrices(robot, tables, pose[None])[0]


def turned() -> Array:
    pose = FREE.reference_pose.copy()
    pose[3:] = quat_from_rotvec(np.array([[0.4, -0.7, 0.2]]))[0]
    return pose


def test_the_kinetic_energy_is_that_of_the_centre_of_mass_and_of_the_turning() -> None:
    rng, pose = np.random.default_rng(0), turned()
    for speed, spin in rng.standard_normal((5, 2, 3)):
        lever = quat_rotate(pose[3:], ASIDE)
        back = pose[3:] * [1.0, -1.0, -1.0, -1.0]
        own = quat_rotate(back, spin)
        moved = speed + np.cross(spin, lever)
        energy = 0.5 * 2.0 * moved @ moved + 0.5 * own @ FREE.inertia @ own
        motion = np.concatenate([speed, spin])
        assert 0.5 * motion @ matrix(FREE, pose) @ motion == pytest.approx(energy)


def test_a_platform_on_joints_has_the_mass_of_its_slides_and_turns_about_its_hinge() -> None:
    found = matrix(THREE, THREE.reference_pose)
    assert found == pytest.approx(np.diag([2.0, 2.0, 0.01]), abs=1e-12)


def test_without_gravity_the_mass_is_that_of_the_description() -> None:
    floating = replace(FREE, gravity=np.zeros(3))
    assert matrix(floating, turned()) == pytest.approx(matrix(FREE, turned()))


def test_an_inertia_that_nobody_knows_is_not_made_up() -> None:
    with pytest.raises(seecr.InputError, match="its inertia is not known"):
        matrix(replace(FREE, inertia=np.zeros((3, 3))), turned())
