"""MuJoCo's model of a true robot has each part that an effect asks for, and no other."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from crosscheck.twin.build import build, tail_of
from crosscheck.twin.robot import true_robot
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import effect_named


def built(name="", robot="demobot_parallel", segments=1, **values):
    effects = [effect_named(name)(**values)] if name else []
    true = true_robot(load_robot(model_path(robot)), effects)
    return true, *build(true, segments)


@pytest.mark.parametrize("robot", ["demobot_cogiro", "demobot_off_centre", "planar_vertical"])
def test_without_effects_it_is_the_robot_itself(robot):
    true, model, places = built(robot=robot)
    given = mujoco.MjModel.from_xml_path(str(model_path(robot)))
    assert (model.nv, model.ntendon) == (given.nv, given.ntendon)
    assert model.body_mass[places.platform] == given.body_mass.sum()
    np.testing.assert_array_equal(model.body_ipos[places.platform], true.centre_of_mass)
    np.testing.assert_allclose(model.site_pos[places.exits], true.exit_points, atol=1e-16)
    np.testing.assert_allclose(model.site_pos[places.anchors], true.anchor_points, atol=1e-16)
    np.testing.assert_array_equal(model.opt.gravity, given.opt.gravity)
    assert places.exit_dofs.size == places.slider_dofs.size == places.node_dofs.size == 0
    assert places.tail == 0.0


def test_chains_have_three_coordinates_per_mass():
    _, model, places = built("cable_weight", segments=4, weight=0.05)
    assert places.node_dofs.shape == (8, 3, 3)
    assert places.tendons.shape == (8, 4)
    assert model.nv == places.n_platform + 8 * 3 * 3
    # every coordinate belongs to one part
    assert len(np.unique(places.node_dofs)) == places.node_dofs.size


def test_an_elastic_cable_behind_the_exit_point_is_a_winch_on_a_spring():
    true, model, places = built("winch_side_length", length=0.6)
    assert places.slider_dofs.shape == (8, 1)
    joints = model.dof_jntid[places.slider_dofs[:, 0]]
    np.testing.assert_allclose(model.jnt_stiffness[joints], true.ea / 0.6, rtol=1e-12)
    assert places.tail == tail_of(true) > 0.0


def test_a_frame_that_yields_carries_the_exit_points_on_springs():
    _, model, places = built("frame_compliance", sideways=2e-5, upwards=5e-6)
    joints = model.dof_jntid[places.exit_dofs]
    assert places.exit_dofs.shape == (8, 3)
    expected = np.tile([5e4, 5e4, 2e5], (8, 1))
    np.testing.assert_allclose(np.sort(model.jnt_stiffness[joints], axis=1), expected, rtol=1e-9)


def test_pulleys_are_cylinders_that_the_cables_wrap():
    _, model, places = built("pulley_radius", radius=0.012)
    cylinders = model.geom_type == int(mujoco.mjtGeom.mjGEOM_CYLINDER)
    assert cylinders.sum() == 8
    np.testing.assert_array_equal(model.geom_size[cylinders, 0], 0.012)
    assert places.slider_dofs.size == 0
