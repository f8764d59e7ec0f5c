"""A user's MJCF prepared for settling: compiled, and reduced to springs and gravity.

What would hide or shift the equilibrium that statics predicts is switched off: contacts, joint
and tendon limits, dry friction (with it a platform rests anywhere in a band), and damping (which
shifts no equilibrium, but delays it).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco

from seecr.description.mjcf import Reading, unsupported_features

_DISABLE = (
    mujoco.mjtDisableBit.mjDSBL_AUTORESET,  # else a diverging run restarts silently
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,  # contacts, limits, dry friction
    mujoco.mjtDisableBit.mjDSBL_CONTACT,  # skips the search for contacts
    mujoco.mjtDisableBit.mjDSBL_DAMPER,
    mujoco.mjtDisableBit.mjDSBL_SENSOR,
    mujoco.mjtDisableBit.mjDSBL_ACTUATION,
)


def without_loose(found: Reading) -> mujoco.MjModel:
    """The model of a file without moving bodies that no cable touches, and what is about them."""
    if not found.platform.loose:
        return found.model
    spec = mujoco.MjSpec.from_file(str(found.path))
    beside = (spec.keys, spec.sensors, spec.equalities, spec.excludes, spec.pairs, spec.actuators)
    gone = [spec.bodies[body] for body in found.platform.loose]
    for one in [each for some in beside for each in some] + gone:
        spec.delete(one)
    return spec.compile()


def ignored_in(model: mujoco.MjModel, platform: int) -> tuple[str, ...]:
    """Names of features present that would hide, shift or delay the equilibrium."""
    damped = model.dof_damping.any() or model.tendon_damping.any()
    return (*unsupported_features(model, platform), *(("damping",) if damped else ()))


def springs_alone(model: mujoco.MjModel) -> None:
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
