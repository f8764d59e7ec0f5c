"""A planar robot from its numbers: where it rests, by seecr and by MuJoCo.

    python examples/planar_robot.py

The two share the robot's description and no physics: seecr goes down the energy to a certified
minimum, MuJoCo lets the platform fall into its cables and waits until it stands still.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

import seecr

EXIT = np.array([[0.0, 2.0], [0.0, 1.7], [3.0, 2.0], [3.0, 1.7]])  # x, z [m]
ANCHOR = np.array([[-0.15, -0.15], [-0.15, 0.15], [0.15, -0.15], [0.15, 0.15]])
HOME, MASS, EA = np.array([1.5, 0.8]), 5.0, 20_000.0  # [m], [kg], [N]


def mjcf() -> str:
    """The robot as MJCF: joints for x, z and tilt, one spatial tendon per cable."""
    lengths = np.linalg.norm(HOME + ANCHOR - EXIT, axis=1)
    exits, anchors, cables = "", "", ""
    for i, ((ax, az), (bx, bz), length) in enumerate(
        zip(EXIT, ANCHOR, lengths.tolist(), strict=True), 1
    ):
        exits += f'<site name="A{i}" pos="{ax} 0 {az}"/>'
        anchors += f'<site name="B{i}" pos="{bx} 0 {bz}"/>'
        ends = f'<site site="A{i}"/><site site="B{i}"/>'
        spring = f'springlength="0 {length!r}" stiffness="{EA / length!r}"'
        cables += f'<spatial name="cable{i}" {spring}>{ends}</spatial>'
    return f"""<mujoco model="facade"><worldbody>{exits}
      <body name="platform" pos="{HOME[0]} 0 {HOME[1]}">
        <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
        <joint type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="{MASS}" diaginertia="0.05 0.08 0.05"/>{anchors}
      </body></worldbody><tendon>{cables}</tendon></mujoco>"""


def settle(model: mujoco.MjModel, rest_lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where MuJoCo brings the platform to rest on cables of these lengths (m,): x, z [m]."""
    model.tendon_stiffness[:] = EA / rest_lengths
    model.tendon_lengthspring[:, 1] = rest_lengths
    model.dof_damping[:] = 0.3 * np.sqrt(model.tendon_stiffness.sum() * MASS)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=5_000)
    return HOME + data.qpos[:2]


def main() -> float:
    """Print both answers along a line; the largest difference [m]."""
    poses = np.zeros((5, 7))
    poses[:, 0], poses[:, 2], poses[:, 3] = np.linspace(0.7, 2.3, 5), 0.6, 1.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "facade.xml"
        path.write_text(mjcf(), encoding="utf-8")
        solution = seecr.solve(seecr.load_robot(path), poses)
        model = mujoco.MjModel.from_xml_path(str(path))
    settled = np.array([settle(model, lengths) for lengths in solution.rest_lengths])
    apart = np.linalg.norm(settled - solution.pose[:, [0, 2]], axis=1)
    for i, (x, _, z) in enumerate(1e3 * solution.deviation[:, :3]):
        print(
            f"x {poses[i, 0]:.1f} m: off by {x:+.3f}, {z:+.3f} mm; "
            f"MuJoCo {1e9 * apart[i]:.1f} nm away"
        )
    assert solution.converged.all()
    return float(apart.max())


if __name__ == "__main__":
    main()
