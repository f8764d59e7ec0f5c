"""Where plain MuJoCo brings the one platform of a file to rest, as the file is written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

_STEPS, _STILL = 400_000, 1e-11


@dataclass
class Rest:
    """Pose (7,) of a body at rest, and tensions (m,) [N] of the spatial tendons."""

    pose: np.ndarray
    tensions: np.ndarray


def rest_of(path: Path, body: str, without: tuple[str, ...] = (), *, one_way: bool = False) -> Rest:
    """Rest from the reference pose, by damped steps; contacts and limits are off.

    Args:
        path: the MJCF. body: name of the platform. without: bodies to delete, and all actuators if
            "actuators" is among them. one_way: whether springs never push, however written.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    for key in list(spec.keys):
        spec.delete(key)
    for name in without:
        for one in list(spec.actuators) if name == "actuators" else [spec.body(name)]:
            spec.delete(one)
    model = spec.compile()
    if one_way:
        model.tendon_lengthspring[:, 0] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.timestep = 1e-3
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # twice the damping of a mass on all springs, so that little swings for long
    stiff = float(np.sum(model.tendon_stiffness))
    mass = float(model.body_mass.sum())
    model.dof_damping[:] = np.where(model.dof_M0 < 0.2 * mass, 0.02, 0.15) * np.sqrt(stiff * mass)
    for _ in range(_STEPS):
        mujoco.mj_step(model, data)
        if np.abs(data.qvel).max() < _STILL and np.abs(data.qacc).max() < 1e3 * _STILL:
            break
    else:
        raise AssertionError(f"MuJoCo does not come to rest: {np.abs(data.qvel).max()}")
    where = model.body(body).id
    low, high = model.tendon_lengthspring.T
    stretch = np.maximum(data.ten_length - high, 0.0) + np.minimum(data.ten_length - low, 0.0)
    pose = np.concatenate([data.xpos[where], data.xquat[where]])
    return Rest(pose, model.tendon_stiffness * stretch)
