"""MuJoCo's own stiffness and vibrations of a platform at rest."""

from __future__ import annotations

import mujoco
import numpy as np

from crosscheck.settle.newton import stiffness
from crosscheck.settle.settler import Settler
from seecr.pose import Array


def mujocos_modes(side: Settler, pose: Array, command: Array) -> tuple[Array, Array]:
    """Eigenvalues of the stiffness (d,) [N/m] and frequencies (d,) [Hz] at a pose, ascending.

    The stiffness is a finite difference of MuJoCo's forces, by translations and by rotations times
    the robot's length, or by joints; the mass matrix is MuJoCo's.
    """
    physics = side.physics
    physics.set_cables(side.paid_out(command[None])[0], side.ea)
    physics.set_load()
    physics.place(pose)
    mujoco.mj_forward(physics.model, physics.data)
    mass = np.zeros((physics.n_dof, physics.n_dof))
    mujoco.mj_fullM(physics.model, physics.data, mass)
    slope = stiffness(physics, physics.tensions() > 0.0)
    mass *= physics.mass_unit / np.outer(physics.metre, physics.metre)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, slope)).real)
    return np.linalg.eigvalsh(slope), np.sqrt(squares) / (2.0 * np.pi)
