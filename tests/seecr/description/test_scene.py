"""The MJCF tree, by what MuJoCo makes of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from rectangle import RECTANGLE
from scipy.spatial.transform import Rotation

from seecr.description.mjcf_text import cable, numbers_text, plain_text, scene, text_of
from seecr.description.robot import Joint, Robot

TURN = Rotation.from_rotvec([0.3, -0.5, 0.8])
# A body whose axes are not those of its frame; no plate is as flat as to break the triangle rule.
INERTIA = np.array([[0.5, 0.02, -0.03], [0.02, 0.6, 0.04], [-0.03, 0.04, 0.7]])


def turned(**changes: object) -> Robot:
    """The robot with its platform turned at the reference pose."""
    pose = RECTANGLE.reference_pose.copy()
    pose[3:] = TURN.as_quat(scalar_first=True)
    return replace(RECTANGLE, reference_pose=pose, inertia=INERTIA, **changes)


def loaded(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_numbers_keep_all_digits_and_zero_has_no_sign() -> None:
    values = [0.1 + 0.2, -1e-300, np.pi, np.nextafter(1.0, 2.0)]
    text = numbers_text(values, -0.0)
    assert [float(word) for word in text.split()] == [*values, 0.0] and text.endswith(" 0.0")


def test_two_dashes_in_a_remark_do_not_end_it() -> None:
    root = ET.fromstring(plain_text(RECTANGLE, "made with --figure none -->"))
    assert root.tag == "mujoco" and root.find("worldbody") is not None


def test_of_unknown_inertia_a_body_gets_that_of_its_mass_at_its_length() -> None:
    model, _data = loaded(plain_text(RECTANGLE, "a test"))
    np.testing.assert_allclose(model.body_inertia[1], np.full(3, 2.0 * 0.5**2))


def test_joints_are_in_the_base_frame_however_the_platform_is_turned() -> None:
    point, axis = np.array([1.0, 2.5, -1.0]), np.array([0.6, 0.0, 0.8])
    robot = turned(
        joints=(Joint("slide", "along", axis, point), Joint("hinge", "about", axis, point))
    )
    model, data = loaded(plain_text(robot, "a test"))
    assert model.jnt_type.tolist() == [mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE]
    np.testing.assert_allclose(data.xaxis, [axis, axis], atol=1e-12)
    np.testing.assert_allclose(data.xanchor[1], point, atol=1e-12)


@pytest.mark.parametrize(("rest", "force"), [(1.0, 300.0 * 1.0), (2.5, 0.0)])
def test_a_cable_pulls_by_its_stretch_and_never_pushes(rest: float, force: float) -> None:
    """Of 2 m between its ends, with 300 N/m."""
    root, world, body = scene(RECTANGLE, "a test")
    ET.SubElement(world, "site", name="here", pos=numbers_text([0.0, 0.0, 0.0]))
    ET.SubElement(body, "site", name="there", pos=numbers_text([-1.5, -2.0, -0.5]))
    tendons = ET.SubElement(root, "tendon")
    path = [("site", {"site": "here"}), ("site", {"site": "there"})]
    cable(tendons, "one", path, rest, [300.0], 0.01)
    _model, data = loaded(text_of(root))
    assert data.ten_length[0] == pytest.approx(2.0)
    pull = np.linalg.norm(data.qfrc_spring[:3])
    assert pull == pytest.approx(force, abs=1e-9)
