"""Commands on joints: coordinates that these determine, and digits that were rounded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from seecr import load_robot
from seecr.columns.commands import CommandFile, read_commands
from seecr.description.joints import off_joints
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import quat_from_rxyz

TILT = np.radians(12.0)
UP = f"0 {np.sin(TILT)} {np.cos(TILT)}"
SLIDES = f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="{UP}"/>'
HINGE = '<joint type="hinge" axis="0 0.6 0.8" pos="0 0 -0.5"/>'


def robot_on(folder: Path, joints: str) -> Robot:
    """A platform of four cables in a plane that leans by 12 degrees, or on other joints."""
    corners = [(x, np.sin(TILT) * z, np.cos(TILT) * z) for x in (-1.5, 1.5) for z in (0.0, 2.4)]
    places = "".join(
        f'<site name="A{k}" pos="{x} {y} {z}"/>' for k, (x, y, z) in enumerate(corners)
    )
    anchors = "".join(f'<site name="B{k}"/>' for k in range(4))
    cables = "".join(
        f'<spatial name="c{k}" springlength="0 1.9" stiffness="10000"><site site="A{k}"/>'
        f'<site site="B{k}"/></spatial>' for k in range(4)
    )  # fmt: skip
    home = f"0 {1.2 * np.sin(TILT)} {1.2 * np.cos(TILT)}"
    path = folder / "robot.xml"
    path.write_text(
        f'<mujoco><worldbody>{places}<body name="platform" pos="{home}">{joints}<inertial '
        f'pos="0 0 0" mass="9" diaginertia="1 1 1"/>{anchors}</body></worldbody>'
        f"<tendon>{cables}</tendon></mujoco>"
    )
    return load_robot(path)


def read(folder: Path, robot: Robot, *lines: str) -> CommandFile:
    path = folder / "poses.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_commands(path, robot)


ON_IT = [(x, float(np.tan(TILT) * z), z) for x, z in ((0.0, 1.1738), (0.4, 1.5), (-0.6, 0.7))]


def test_what_the_joints_determine_may_be_left_out(tmp_path: Path) -> None:
    robot = robot_on(tmp_path, SLIDES)
    found = read(tmp_path, robot, "cmd_x_m,cmd_z_m", *(f"{x},{z}" for x, _y, z in ON_IT))
    assert found.commands.pose[:, :3] == pytest.approx(np.array(ON_IT), abs=1e-12)
    assert "No cmd_y: the joints determine it." in found.notes
    # y and z say the same, x nothing of them
    found = read(tmp_path, robot, "cmd_x_m,cmd_y_m", *(f"{x},{y!r}" for x, y, _z in ON_IT))
    assert found.commands.pose[:, :3] == pytest.approx(np.array(ON_IT), abs=1e-9)
    with pytest.raises(InputFileError, match="expected cmd_x_m cmd_y_m cmd_z_m, cmd_x_m missing"):
        read(tmp_path, robot, "cmd_y_m,cmd_z_m", *(f"{y!r},{z}" for _x, y, z in ON_IT))


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_rounded_poses_are_projected(tmp_path: Path, digits: int) -> None:
    robot = robot_on(tmp_path, SLIDES)
    rows = [",".join(f"{1e3 * v:.{digits}f}" for v in place) for place in ON_IT]
    found = read(tmp_path, robot, "cmd_x_mm,cmd_y_mm,cmd_z_mm", *rows)
    assert off_joints(robot, found.commands.pose) is None
    off = np.abs(found.commands.pose[:, :3] - ON_IT).max()
    assert off < 10.0**-digits * 1e-3
    assert found.commands.pose[:, 1] == pytest.approx(
        np.tan(TILT) * found.commands.pose[:, 2], abs=1e-12
    )
    assert sum("are rounded: those that the joints reach are up to" in n
               for n in found.notes) == 1  # fmt: skip


def test_beyond_the_digits_the_distance_is_told(tmp_path: Path) -> None:
    robot = robot_on(tmp_path, SLIDES)
    with pytest.raises(InputFileError) as caught:
        read(tmp_path, robot, "cmd_x_mm,cmd_y_mm,cmd_z_mm", "0,249.5,1173.8", "0,249.0,1173.8")
    said = str(caught.value)
    # 0.499 mm too far forward leave 0.499 cos 12 = 0.488 mm to the plane, 0.477 of them in y
    assert "line 3: the joints of robot" in said and "off by 0.000477 m in y" in said
    assert "rounding of its digits explains 5e-05 m; expected" in said
    # whole metres explain no more than a thousandth of the frame
    with pytest.raises(InputFileError, match=r"line 2: .*off by 0\.203 m in y"):
        read(tmp_path, robot, "cmd_x_m,cmd_y_m,cmd_z_m", "0,0,1")


def test_rounded_turns_are_projected(tmp_path: Path) -> None:
    """A hinge about (0 0.6 0.8): angles and quaternions to a few digits are near its turns."""
    robot = robot_on(tmp_path, HINGE)
    half, axis = np.radians(10.0) / 2, np.array([0.0, 0.6, 0.8])
    quat = np.array([np.cos(half), *(np.sin(half) * axis)])
    turned = quat_of_places(robot, quat)
    row = ",".join(f"{v:.4f}" for v in (*turned, *quat))
    head = "cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz"
    pose = read(tmp_path, robot, head, row).commands.pose
    assert off_joints(robot, pose) is None
    assert pose[0] == pytest.approx([*turned, *quat], abs=2e-4)
    with pytest.raises(InputFileError, match="cannot reach the commanded pose: it is off by"):
        wrong = quat_from_rxyz(np.radians([0.5, 6.0, 8.0]))
        read(tmp_path, robot, head, ",".join(f"{v:.4f}" for v in (*turned, *wrong)))
    # the position alone says how far the hinge is turned
    found = read(tmp_path, robot, head[:23], ",".join(f"{v:.9f}" for v in turned))
    assert found.commands.pose[0, 3:] == pytest.approx(quat, abs=1e-7)
    assert "No commanded orientation: the joints determine it." in found.notes


def quat_of_places(robot: Robot, quat: np.ndarray) -> np.ndarray:
    """Where the origin goes that a hinge 0.5 m below it turns by a quaternion (Rodrigues)."""
    arm = np.array([0.0, 0.0, 0.5])
    turned = arm + 2 * np.cross(quat[1:], np.cross(quat[1:], arm) + quat[0] * arm)
    return robot.reference_pose[:3] - arm + turned
