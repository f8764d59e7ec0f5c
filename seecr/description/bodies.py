"""Which of an MJCF's bodies is the platform, what moves with it, and which joints it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.description.findings import Findings, listed
from seecr.description.robot import Joint
from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate, quat_to_matrix

if TYPE_CHECKING:
    import mujoco

# MuJoCo's mjtJoint and mjtWrap.
_FREE, _BALL, _SLIDE, _HINGE = range(4)
_SITE = 3
# MuJoCo's mjtEq: connect and weld, which are between two bodies or two sites, and mjtObj.
_BETWEEN, _OBJECT_SITE = (0, 1), 6
# Axes of slides span space if the volume between them is above rounding.
_INDEPENDENT = 1e-6
# Hinges of a ball, in rows. Three hinges lose a freedom where the first and the last are parallel,
# in two of all the directions that the last can have. A quarter turn about an axis of the base
# frame is such a place for axes along it; robots are drawn so, and rest there. These axes are along
# nothing that anybody draws: a turn of 1 rad about (1, 2, 3).
_BALL_AXES = quat_to_matrix(quat_from_rotvec(np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)))


@dataclass(frozen=True)
class Platform:
    """The body that cables hold, with all that is welded to it.

    Attributes:
        body: number of the body that has the joints.
        whole: (nbody,) whether a body is it, or welded to it.
        loose: numbers of bodies that move and that no cable touches.
    """

    body: int
    whole: NDArray[np.bool_]
    loose: tuple[int, ...]


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Its name, or its number."""
    return model.body(body).name or f"number {body}"


def pose_within(model: mujoco.MjModel, body: int, top: int = 0) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) of a body in the frame of one that it is inside of.

    They are those at the reference pose, and exact where a body is directly in the other.
    """
    position, quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    while body != top:
        position = model.body_pos[body] + quat_rotate(model.body_quat[body], position)
        quat = quat_multiply(model.body_quat[body], quat)
        body = int(model.body_parentid[body])
    return position, quat


def site_within(model: mujoco.MjModel, site: int, top: int = 0) -> Array:
    """Position (3,) of a site in the frame of a body that it is on, or inside of."""
    position = model.site_pos[site].copy()
    body = int(model.site_bodyid[site])
    while body != top:
        position = model.body_pos[body] + quat_rotate(model.body_quat[body], position)
        body = int(model.body_parentid[body])
    return np.asarray(position)


def platform_of(model: mujoco.MjModel, found: Findings) -> Platform:
    """The one moving body that cables hold.

    Bodies without joints of their own count as the body that they are welded to. A body that no
    cable touches is left out, with a note.

    Raises:
        RobotError: nothing moves.
    """
    moving = [int(b) for b in np.flatnonzero(model.body_jntnum > 0)]
    if not moving:
        found.refuse(
            "", "", "no moving body; expected one body with a free joint or with slide and hinge "
            "joints",
        )  # fmt: skip
        found.check()
    ends = [int(model.body_weldid[b]) for b in _cabled(model)]
    # of several the one with most cables is looked at, so that its faults are told as well
    held = sorted({b for b in ends if b in moving}, key=lambda b: (-ends.count(b), b))
    body = held[0] if held else moving[0]
    beside = [b for b in moving if b != body]
    chain = [b for b in beside if _inside(model, b, body) or _inside(model, body, b)]
    others = sorted({*held[1:], *chain})
    if others:
        names = listed(body_name(model, b) for b in sorted([body, *others]))
        found.refuse(
            "", "", f"{len(others) + 1} moving bodies hang together ({names}); expected one "
            "platform, and cables between it and the world: remove the joints of what is to move "
            "with it, and leave out other bodies with their cables",
        )  # fmt: skip
    loose = [b for b in beside if b not in others]
    loose = [b for b in loose if not any(_inside(model, b, other) for other in loose if other != b)]
    for b in loose:
        found.note("body", body_name(model, b), "is left out: no cable touches it")
    return Platform(body, model.body_weldid == body, tuple(loose))


def _cabled(model: mujoco.MjModel) -> list[int]:
    """Numbers of the bodies that sites of spatial tendons are on, as often as there are."""
    sites = model.wrap_objid[model.wrap_type == _SITE]
    return [int(model.site_bodyid[site]) for site in sites]


def _inside(model: mujoco.MjModel, body: int, other: int) -> bool:
    """Whether a body is inside another."""
    while body not in (0, other):
        body = int(model.body_parentid[body])
    return body == other


def is_loose(model: mujoco.MjModel, platform: Platform, body: int) -> bool:
    """Whether a body is left out: a loose one, or inside one."""
    return any(_inside(model, body, b) for b in platform.loose)


def load_of(model: mujoco.MjModel, platform: Platform) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass (3,) [m], and inertia (3, 3) [kg m^2] about it, of the whole.

    They are in the platform's frame. The parallel axis theorem (Steiner) adds the bodies up.
    """
    parts = []
    for b in np.flatnonzero(platform.whole):
        position, quat = pose_within(model, int(b), platform.body)
        axes = quat_to_matrix(quat_multiply(quat, model.body_iquat[b]))
        centre = position + quat_rotate(quat, model.body_ipos[b])
        parts.append((float(model.body_mass[b]), centre, axes, model.body_inertia[b]))
    heavy = [part for part in parts if part[0] > 0.0] or parts[:1]
    mass = sum(part[0] for part in heavy)
    if len(heavy) == 1:
        # a single body keeps its numbers to the last digit
        _mass, centre, axes, own = heavy[0]
        return mass, np.asarray(centre).copy(), np.asarray(axes @ np.diag(own) @ axes.T)
    centre = np.asarray(sum(part[0] * part[1] for part in heavy) / mass)
    inertia = np.zeros((3, 3))
    for weight, place, axes, own in heavy:
        arm = place - centre
        inertia += axes @ np.diag(own) @ axes.T
        inertia += weight * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


def reference_of(model: mujoco.MjModel, platform: Platform) -> Array:
    """Pose (7,) of the platform in the world where MuJoCo starts."""
    first = model.body_jntadr[platform.body]
    if model.jnt_type[first] == _FREE:
        start = model.jnt_qposadr[first]
        return np.asarray(model.qpos0[start : start + 7].copy())
    return np.concatenate(pose_within(model, platform.body))


def joints_of(model: mujoco.MjModel, platform: Platform, found: Findings) -> tuple[Joint, ...]:
    """Slides and hinges, from the outside in; none for a platform that is free.

    A ball is three hinges about its centre, see :attr:`Joint.ball`. With three slides that reach
    every place it moves the platform as a free joint does.
    """
    body = platform.body
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    position, quat = pose_within(model, body)
    joints: list[Joint] = []
    for j in range(first, first + count):
        name = model.joint(j).name or f"joint{j - first + 1}"
        # a free joint may have a spring, too, and a spring may have no linear part
        if model.jnt_stiffness[j] != 0 or np.any(model.jnt_stiffnesspoly[j]):
            found.refuse(
                "joint", name, "has a spring; expected cables to carry the load: leave it out"
            )
        kind = int(model.jnt_type[j])
        if kind == _FREE:
            continue
        point = position + quat_rotate(quat, model.jnt_pos[j])
        if kind == _BALL:
            axes = zip("xyz", _BALL_AXES, strict=True)
            joints += [Joint("hinge", f"{name}_{a}", axis, point, ball=True) for a, axis in axes]
            continue
        axis = quat_rotate(quat, model.jnt_axis[j])
        joints.append(Joint("slide" if kind == _SLIDE else "hinge", name, axis, point))
    slides = np.array([joint.axis for joint in joints if joint.kind == "slide"])
    anywhere = len(slides) == 3 and abs(np.linalg.det(slides)) > _INDEPENDENT
    return () if anywhere and any(joint.ball for joint in joints) else tuple(joints)


def check_other_forces(model: mujoco.MjModel, platform: Platform, found: Findings) -> None:
    """Object to what would hold or push the platform and is not read; note what is left out."""
    for b in np.flatnonzero(platform.whole & (model.body_gravcomp != 0)):
        found.refuse(
            "body", body_name(model, int(b)),
            f"has gravcomp {model.body_gravcomp[b]:g}; expected none, the cables carry the weight: "
            "leave it out",
        )  # fmt: skip
    if np.any(model.opt.wind) and (model.opt.density > 0 or model.opt.viscosity > 0):
        found.refuse(
            "", "", "the option wind pushes the platform; expected none, and the push as an "
            "effect: external_wrench",
        )  # fmt: skip
    for e in range(model.neq):
        if not _holds(model, platform, e):
            continue
        name = model.equality(e).name or f"number {e + 1}"
        if model.eq_active0[e]:
            found.refuse(
                "equality constraint", name,
                "holds the platform beside its cables; expected none: leave it out; statics have "
                "cables and joints alone",
                fixable=True,
            )  # fmt: skip
        else:
            found.note("equality constraint", name, "is left out: it is not active")
    if model.nkey:
        names = [model.key(k).name or f"number {k + 1}" for k in range(model.nkey)]
        word = "keyframe" if model.nkey == 1 else "keyframes"
        found.note(
            "", "", f"{word} {listed(names)} left out: winches are zeroed where the bodies are "
            "written (qpos0), which is the reference pose",
        )  # fmt: skip


def _holds(model: mujoco.MjModel, platform: Platform, e: int) -> bool:
    """Whether an equality constraint is about other bodies than loose ones and the world's."""
    if model.eq_type[e] not in _BETWEEN:
        return True
    ends = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
    if model.eq_objtype[e] == _OBJECT_SITE:
        ends = [int(model.site_bodyid[site]) for site in ends]
    return any(platform.whole[end] for end in ends if end >= 0)


def actuator_words(model: mujoco.MjModel, numbers: NDArray[np.intp]) -> str:
    """Some actuators in words, such as "4 actuators (m1, m2, m3 and m4)"."""
    names = [model.actuator(int(k)).name or f"number {k + 1}" for k in numbers]
    return f"{counted(len(names), 'actuator')} ({listed(names)})"
