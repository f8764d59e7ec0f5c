"""Small robots whose measurements are files of a few lines, and headers of such files."""

from __future__ import annotations

import numpy as np

FREE = '<freejoint name="free"/>'
PLANAR = """<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<joint name="tilt" type="hinge" axis="0 1 0"/>"""
SLIDE, HINGE = '<joint type="slide" axis="1 0 0"/>', '<joint type="hinge" axis="0 1 0"/>'
ARM = '<joint name="arm" type="hinge" axis="0 1 0" pos="0 0 1"/>'


def mjcf(joints: str, pose: str, n_cables: int = 4) -> str:
    """A platform on cables from the corners of a 2 m square, 1 m above."""
    sites, tendons, anchors = "", "", ""
    for i in range(n_cables):
        angle = 2 * np.pi * i / n_cables
        x, y = np.cos(angle), np.sin(angle)
        sites += f'<site name="A{i}" pos="{x} {y} 1"/>'
        anchors += f'<site name="B{i}" pos="{0.1 * x} {0.1 * y} 0"/>'
        ends = f'<site site="A{i}"/><site site="B{i}"/>'
        tendons += f'<spatial stiffness="1000" springlength="0 1.3">{ends}</spatial>'
    return f"""<mujoco model="small"><worldbody>{sites}<body name="platform" {pose}>{joints}
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>{anchors}</body></worldbody>
<tendon>{tendons}</tendon></mujoco>"""


CMD = "cmd_x_m,cmd_y_m,cmd_z_m"
POSE = CMD + ",meas_x_m"
QUAT = CMD + ",meas_qw,meas_qx,meas_qy,meas_qz"
LENGTHS = "length_1_m,length_2_m,length_3_m,length_4_m"
