"""A user's MJCF prepared for settling: compiled, checked, and reduced to springs and gravity.

What would hide or shift the equilibrium that statics predicts is switched off: contacts, joint and
tendon limits, dry friction (with it a platform rests anywhere in a band), and damping (which shifts
no equilibrium, but delays it).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path

import mujoco
import numpy as np

from seecr.description.mjcf import hindrances, not_mjcf, quiet_mujoco
from seecr.errors import InputFileError

_DISABLE = (
    mujoco.mjtDisableBit.mjDSBL_AUTORESET,  # else a diverging run restarts silently
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,  # contacts, limits, dry friction
    mujoco.mjtDisableBit.mjDSBL_CONTACT,  # skips the search for contacts
    mujoco.mjtDisableBit.mjDSBL_DAMPER,
    mujoco.mjtDisableBit.mjDSBL_SENSOR,
)


@quiet_mujoco()
def compile_model(source: str | Path | mujoco.MjModel) -> mujoco.MjModel:
    """Compile a file, or copy a model, so that the result may be changed."""
    if isinstance(source, mujoco.MjModel):
        return copy(source)
    path = Path(source)
    if not path.is_file():
        raise InputFileError(f"{path}: no such file; expected an MJCF model of the robot")
    other = not_mjcf(path)
    if other:
        raise InputFileError(f"{path}: {other}")
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputFileError(f"{path}: MuJoCo cannot read this as MJCF: {reason}") from None


def platform_of(model: mujoco.MjModel, name: str) -> int:
    """Number of the only moving body."""
    moving = np.flatnonzero(model.body_jntnum > 0)
    if len(moving) != 1:
        raise InputFileError(
            f"{name}: {len(moving)} moving bodies; expected one platform with a free "
            "joint or with slide and hinge joints"
        )
    return int(moving[0])


def check_cables(model: mujoco.MjModel, body: int, where: str) -> None:
    """Check that the tendons are straight cables from the world to the platform."""
    if model.ntendon == 0:
        raise InputFileError(f"{where}: no cables; expected one <spatial> tendon per cable")
    for i in range(model.ntendon):
        name = model.tendon(i).name or f"cable{i + 1}"
        first = model.tendon_adr[i]
        kinds = model.wrap_type[first : first + model.tendon_num[i]]
        if list(kinds) != 2 * [int(mujoco.mjtWrap.mjWRAP_SITE)]:
            raise InputFileError(f"{where}: tendon {name}: expected exactly two sites")
        sites = model.wrap_objid[first : first + 2]
        if np.sum(model.site_bodyid[sites] == body) != 1:
            raise InputFileError(
                f"{where}: tendon {name}: expected one site on the platform and one on the world"
            )
        if np.any(model.tendon_stiffnesspoly[i] != 0.0):
            raise InputFileError(
                f"{where}: tendon {name}: expected one stiffness [N/m], got a polynomial"
            )


def ignored_in(model: mujoco.MjModel, platform: int) -> tuple[str, ...]:
    """Names of features present that would hide, shift or delay the equilibrium."""
    damped = model.dof_damping.any() or model.tendon_damping.any()
    return (*hindrances(model, platform), *(("damping",) if damped else ()))


def switch_off(model: mujoco.MjModel) -> None:
    """Leave springs, gravity and inertia only."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    model.opt.disableflags |= sum(int(flag) for flag in _DISABLE)
    model.opt.tolerance = 1e-8  # relative, of the solve for the implicit step
    model.opt.iterations = 100
    model.opt.enableflags = int(mujoco.mjtEnableBit.mjENBL_ENERGY)


def ignored_note(name: str | Path, ignored: Sequence[str]) -> str:
    """A sentence about what is :func:`ignored_in` a file."""
    return (
        f"{name}: switched off here: {', '.join(ignored)}; only springs and gravity act on the "
        "platform, as in the statics"
    )


def change_mass_unit(model: mujoco.MjModel, mass_unit: float) -> None:
    """Change the unit of mass [kg] of everything with mass, and of what MuJoCo derives from it."""
    for array in (
        model.body_mass,
        model.body_inertia,
        model.dof_armature,
        model.tendon_armature,
        model.tendon_stiffness,
        model.jnt_stiffness,
    ):
        array /= mass_unit
    model.opt.density /= mass_unit
    model.opt.viscosity /= mass_unit
    mujoco.mj_setConst(model, mujoco.MjData(model))
