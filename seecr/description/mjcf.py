"""Read a robot from MJCF: MuJoCo compiles the model, and only its numbers are used."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from seecr.counted import counted
from seecr.description.hindrances import hindrances
from seecr.description.robot import ABSURD, Joint, Robot
from seecr.description.shipped import is_shipped, robot_file
from seecr.errors import RobotError, SeecrError
from seecr.files import no_text, read_bytes
from seecr.pose import Array, quat_rotate, quat_to_matrix

if TYPE_CHECKING:
    import mujoco

# An attribute whose numbers include a nan: MuJoCo would warn and write a log before refusing it.
_NO_NUMBER = re.compile(
    rb"""\b(?!name\b)\w+\s*=\s*["'](?:[-+.\deE\s]*\s)?[-+]?nan\b[-+.\deE\sna]*["']""", re.IGNORECASE
)
# No cable is stretched to a hundred times its rest length.
_LEAST = 0.01
# A plane is level if the cosine of its tilt is so near to one: 0.08 degrees.
_LEVEL = 1e-6
_EXPECTED = "expected the robot as MJCF, XML that begins with <mujoco"

_quiet_lock = Lock()
_quiet_depth = 0


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the working folder; statuses report instead.

    Also a decorator, ``@quiet_mujoco()``. A handler of the user's own stays.
    """
    import mujoco

    global _quiet_depth
    with _quiet_lock:
        _quiet_depth += 1
        if _quiet_depth == 1 and mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        with _quiet_lock:
            _quiet_depth -= 1
            if _quiet_depth == 0 and mujoco.get_mju_user_warning() is _ignore:
                mujoco.set_mju_user_warning(None)


def _ignore(message: str) -> None:
    """Discard a warning of MuJoCo's."""


def load_robot(path: str | Path) -> Robot:
    """Read the cable robot in an MJCF file.

    The file has one moving body with a free joint or with slide and hinge joints. Each cable is a
    spatial tendon through two sites, one fixed to the world (the exit point A_i) and one on the
    body (the anchor point B_i), with ``springlength="0 l0"`` and a stiffness. Mass, centre of mass
    and gravity are those of the compiled model. Limits of joints and tendons, dry friction and
    contacts are left out, as ``Robot.notes`` tells; so is damping, which shifts no equilibrium.

    Args:
        path: the MJCF file, or the name of a shipped robot.

    Raises:
        InputError: neither a file nor a shipped robot.
        RobotError: the file is missing, MuJoCo cannot compile it, or it is not such a robot;
            the message names the file and the element.
    """
    path = robot_file(path)
    if is_shipped(path):
        return _read_once(path, path.stat().st_mtime_ns)
    return _read(path)


@lru_cache
def _read_once(path: Path, _written: int) -> Robot:
    """A shipped robot, as long as its file stays: to compile it takes longer than to solve poses.

    A file of the user's own may include others, which may change.
    """
    return _read(path)


def _read(path: Path) -> Robot:
    model = _compile(path)
    body = _moving_body(model, path)
    _refuse_other_forces(model, body, path)
    cables = [_read_cable(model, body, i, path) for i in range(model.ntendon)]
    if not cables:
        raise RobotError(
            f"{path}: no cables; expected one <spatial> tendon per cable, through two sites"
        )
    exit_points, anchor_points, ea, rest_lengths, names = zip(*cables, strict=True)
    reference_pose = np.concatenate([model.body_pos[body], model.body_quat[body]])
    joints = _read_joints(model, body, path)
    if not joints:
        first = model.jnt_qposadr[model.body_jntadr[body]]
        reference_pose = model.qpos0[first : first + 7].copy()
    robot = _robot(
        path,
        name=_model_name(model, path),
        exit_points=np.array(exit_points),
        anchor_points=np.array(anchor_points),
        ea=np.array(ea),
        rest_lengths=np.array(rest_lengths),
        mass=float(model.body_mass[body]),
        centre_of_mass=model.body_ipos[body].copy(),
        gravity=_gravity(model),
        reference_pose=reference_pose,
        inertia=_inertia(model, body),
        joints=joints,
        cable_names=tuple(names),
        source=path,
        left_out=hindrances(model, body),
        floor=_floor(model, reference_pose[2]),
    )
    _check_sizes(robot, _body_name(model, body), path)
    return robot


def _robot(path: Path, **numbers: Any) -> Robot:
    """The robot with these numbers; errors about them name the file."""
    try:
        return Robot(**numbers)
    except SeecrError as error:
        raise RobotError(f"{path}: {error}") from None


def _check_sizes(robot: Robot, body: str, path: Path) -> None:
    """Check that neither rest lengths nor the platform are of another order than the frame."""
    most = ABSURD * robot.reach
    frame = f"expected metres, of the size of the frame, {robot.reach:.3g} m across"
    cables = zip(robot.cable_names, robot.rest_lengths, robot.reference_lengths, strict=True)
    for name, length, straight in cables:
        if length > most:
            raise RobotError(f"{path}: tendon {name} has rest length {length:g} m; {frame}")
        if length < _LEAST * straight:
            raise RobotError(
                f"{path}: tendon {name} has rest length {length:g} m, but its sites are "
                f"{straight:.3g} m apart at the reference pose; expected both in metres"
            )
    for name, anchor in zip(robot.cable_names, robot.anchor_points, strict=True):
        away = float(np.linalg.norm(anchor))
        if away > most:
            raise RobotError(
                f"{path}: tendon {name} is anchored {away:g} m from the origin of body {body}; "
                f"{frame}"
            )
    away = float(np.linalg.norm(robot.centre_of_mass - robot.anchor_points, axis=1).min())
    if away > most:
        raise RobotError(
            f"{path}: body {body} has its centre of mass {away:g} m from its anchor points; {frame}"
        )


def _compile(path: Path) -> mujoco.MjModel:
    if not path.exists():
        raise RobotError(f"{path}: no such file; expected an MJCF model of the robot")
    if path.is_dir():
        raise RobotError(f"{path}: is a folder; expected an MJCF file")
    other = not_mjcf(path)
    if other:
        raise RobotError(f"{path}: {other}")
    import mujoco

    try:
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise RobotError(f"{path}: MuJoCo cannot read this as MJCF: {reason}") from None
    _check_names(model, path)
    return model


def not_mjcf(path: Path) -> str:
    """What a file is if it is not XML (MuJoCo's own message would be a parser's); else ""."""
    data = read_bytes(path, _EXPECTED)
    begins = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    kind = no_text(data)
    if kind and not kind.startswith("UTF-16"):
        return f"is {kind}; {_EXPECTED}"
    if not begins:
        return f"is empty; {_EXPECTED}"
    holds = _NO_NUMBER.search(data)
    if holds:
        number = data.count(b"\n", 0, holds.start()) + 1
        return f"line {number}: holds {holds[0].decode()}; expected numbers"
    if kind or begins.startswith(b"<"):
        return ""
    line = begins.splitlines()[0][:40].decode("utf-8", "replace")
    return f"begins with {line!r}, which is not XML; {_EXPECTED}; the robot's file comes first"


def _check_names(model: mujoco.MjModel, path: Path) -> None:
    """Check that names are UTF-8: MuJoCo keeps bytes, and decodes names only when they are used."""
    for name in model.names.split(b"\0"):
        try:
            name.decode("utf-8")
        except UnicodeDecodeError:
            raise RobotError(
                f"{path}: the name {name.decode('utf-8', 'replace')!r} is not UTF-8; expected a "
                "file in UTF-8: save it again as that"
            ) from None


def _model_name(model: mujoco.MjModel, path: Path) -> str:
    name = model.names[: model.names.index(b"\0")].decode()
    return path.stem if name in ("", "MuJoCo Model") else name


def _body_name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"number {body}"


def _moving_body(model: mujoco.MjModel, path: Path) -> int:
    moving = np.flatnonzero(model.body_jntnum > 0)
    if len(moving) == 0:
        raise RobotError(
            f"{path}: no moving body; expected one body with a free joint or with slide and "
            "hinge joints"
        )
    if len(moving) > 1:
        names = " and ".join(_body_name(model, int(b)) for b in moving)
        raise RobotError(f"{path}: {len(moving)} moving bodies ({names}); expected one platform")
    body = int(moving[0])
    if model.body_parentid[body] != 0:
        raise RobotError(
            f"{path}: the platform {_body_name(model, body)} is inside another body; expected it "
            "directly in the worldbody"
        )
    welded = [b for b in range(model.nbody) if b != body and model.body_weldid[b] == body]
    if welded:
        raise RobotError(
            f"{path}: body {_body_name(model, welded[0])} is fixed to the platform; expected its "
            "sites and mass in the platform's own body"
        )
    if model.nu or model.neq:
        kind = "actuator" if model.nu else "equality constraint"
        raise RobotError(f"{path}: has an {kind}; expected passive cables and one platform only")
    return body


def _refuse_other_forces(model: mujoco.MjModel, body: int, path: Path) -> None:
    """Refuse what would change the equilibrium but is not read here."""
    import mujoco

    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING:
        raise RobotError(
            f"{path}: the flag spring is disabled; expected springs, the cables are springs"
        )
    if model.body_gravcomp[body] != 0:
        raise RobotError(
            f"{path}: body {_body_name(model, body)} has gravcomp "
            f"{model.body_gravcomp[body]:g}; expected none, the cables carry the weight"
        )
    if np.any(model.opt.wind) and (model.opt.density > 0 or model.opt.viscosity > 0):
        raise RobotError(
            f"{path}: the option wind pushes the platform; expected none, and the push as an "
            "effect: external_wrench"
        )
    curved = np.flatnonzero(np.any(model.tendon_stiffnesspoly, axis=1))
    if len(curved):
        name = model.tendon(int(curved[0])).name or f"cable{curved[0] + 1}"
        raise RobotError(
            f"{path}: tendon {name} has a polynomial stiffness; expected one number [N/m]"
        )


def _gravity(model: mujoco.MjModel) -> Array:
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        return np.zeros(3)
    return np.array(model.opt.gravity)


def _inertia(model: mujoco.MjModel, body: int) -> Array:
    """Inertia (3, 3) [kg m^2] about the centre of mass, in the body's frame."""
    axes = quat_to_matrix(model.body_iquat[body])
    return np.asarray(axes @ np.diag(model.body_inertia[body]) @ axes.T)


def _floor(model: mujoco.MjModel, below: float) -> float | None:
    """z [m] of the highest static plane that is level and not above ``below``; None without one."""
    import mujoco

    still = model.body_weldid[model.geom_bodyid] == 0
    planes = np.flatnonzero(still & (model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    level = data.geom_xmat[planes, 8] > 1.0 - _LEVEL  # z of the plane's normal
    heights = data.geom_xpos[planes[level], 2]
    return max((float(z) for z in heights if z <= below), default=None)


def _read_joints(model: mujoco.MjModel, body: int, path: Path) -> tuple[Joint, ...]:
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    kinds = {2: "slide", 3: "hinge"}
    joints = []
    position, quat = model.body_pos[body], model.body_quat[body]
    for j in range(first, first + count):
        name = model.joint(j).name or f"joint{j - first + 1}"
        # a free joint may have a spring, too, and a spring may have no linear part
        if model.jnt_stiffness[j] != 0 or np.any(model.jnt_stiffnesspoly[j]):
            raise RobotError(
                f"{path}: joint {name} has a spring; expected cables to carry the load"
            )
        kind = kinds.get(int(model.jnt_type[j]))
        if kind is None:
            if count == 1 and model.jnt_type[j] == 0:
                return ()
            raise RobotError(
                f"{path}: joint {name} is a ball joint or a free joint beside others; expected "
                "one free joint, or slide and hinge joints"
            )
        joints.append(
            Joint(
                kind=kind,
                name=name,
                axis=quat_rotate(quat, model.jnt_axis[j]),
                point=position + quat_rotate(quat, model.jnt_pos[j]),
            )
        )
    return tuple(joints)


def _read_cable(
    model: mujoco.MjModel, body: int, i: int, path: Path
) -> tuple[Array, Array, float, float, str]:
    tendon = model.tendon(i)
    name = tendon.name or f"cable{i + 1}"
    exit_site, anchor_site = _cable_sites(model, body, i, name, path)
    low, high = model.tendon_lengthspring[i]
    if low != 0 or high <= 0:
        raise RobotError(
            f'{path}: tendon {name} has springlength "{low:g} {high:g}"; expected two values, '
            '"0 l0" with the rest length l0 [m], so that the cable pulls and never pushes'
        )
    stiffness = float(model.tendon_stiffness[i])
    if not stiffness > 0:
        raise RobotError(
            f"{path}: tendon {name} has stiffness {stiffness:g}; expected a positive number [N/m]"
        )
    exit_point = _site_in_world(model, exit_site)
    anchor_point = model.site_pos[anchor_site].copy()
    return exit_point, anchor_point, stiffness * float(high), float(high), name


def _cable_sites(
    model: mujoco.MjModel, body: int, i: int, name: str, path: Path
) -> tuple[int, int]:
    import mujoco

    first, count = int(model.tendon_adr[i]), int(model.tendon_num[i])
    wraps = slice(first, first + count)
    if count != 2 or np.any(model.wrap_type[wraps] != int(mujoco.mjtWrap.mjWRAP_SITE)):
        raise RobotError(
            f"{path}: tendon {name} has {counted(count, 'path element')} or something other "
            "than sites; expected exactly two sites, exit point and anchor point"
        )
    sites = [int(s) for s in model.wrap_objid[wraps]]
    on_body = [int(model.site_bodyid[s]) == body for s in sites]
    if on_body == [False, True]:
        return sites[0], sites[1]
    if on_body == [True, False]:
        return sites[1], sites[0]
    where = "the platform" if on_body[0] else "the world"
    raise RobotError(
        f"{path}: tendon {name} has both sites on {where}; expected one on the world (exit point) "
        "and one on the platform (anchor point)"
    )


def _site_in_world(model: mujoco.MjModel, site: int) -> Array:
    position = model.site_pos[site].copy()
    body = int(model.site_bodyid[site])
    while body != 0:
        position = model.body_pos[body] + quat_rotate(model.body_quat[body], position)
        body = int(model.body_parentid[body])
    return np.asarray(position)
