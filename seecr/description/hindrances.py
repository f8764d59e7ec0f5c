"""What an MJCF has that may hold or stop a platform beside its cables: statics leave it out.

Damping is none of it: it delays a rest, and shifts none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

# MuJoCo's mjtDisableBit: all constraints, dry friction, limits, contacts.
_CONSTRAINT, _FRICTIONLOSS, _LIMIT, _CONTACT = 1, 4, 8, 16
# A pair of excluded bodies is one number, the first body's in its upper half.
_UPPER = 16


def hindrances(model: mujoco.MjModel, platform: int) -> tuple[str, ...]:
    """Names of what may hold or stop the platform beside its cables, such as "contacts".

    Args:
        model: as compiled; what its flags switch off does not count.
        platform: index of the platform's body.
    """
    off = int(model.opt.disableflags)
    if off & _CONSTRAINT:
        return ()
    found = {
        "joint limits": not off & _LIMIT and model.jnt_limited.any(),
        "tendon limits": not off & _LIMIT and model.tendon_limited.any(),
        "dry friction": not off & _FRICTIONLOSS
        and (model.dof_frictionloss.any() or model.tendon_frictionloss.any()),
        "contacts": not off & _CONTACT and _may_touch(model, platform),
    }
    return tuple(what for what, there in found.items() if there)


def _may_touch(model: mujoco.MjModel, platform: int) -> bool:
    """Whether a geom of the platform may touch one of its surroundings."""
    own = model.geom_bodyid == platform
    # pairs that are listed touch, whatever their geoms and bodies say otherwise
    if np.any(own[model.pair_geom1] != own[model.pair_geom2]):
        return True
    kind, asks = model.geom_contype, model.geom_conaffinity
    mine, its = np.flatnonzero(own), np.flatnonzero(~own)
    touch = (kind[mine, None] & asks[its]) | (kind[its] & asks[mine, None])
    kept_apart = np.isin(its, _excluded(model, platform))
    return bool(np.any(touch[:, ~kept_apart]))


def _excluded(model: mujoco.MjModel, platform: int) -> np.ndarray:
    """Indices of the geoms of bodies that are excluded from contact with the platform."""
    first, second = model.exclude_signature >> _UPPER, model.exclude_signature % (1 << _UPPER)
    bodies = np.concatenate([second[first == platform], first[second == platform]])
    return np.flatnonzero(np.isin(model.geom_bodyid, bodies))
