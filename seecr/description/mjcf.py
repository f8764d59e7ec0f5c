"""Robots from MJCF, given by path or name: MuJoCo compiles, and only its numbers are used."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from seecr.description.bodies import (
    Platform,
    body_name,
    check_other_forces,
    joints_of,
    load_of,
    platform_of,
    reference_of,
)
from seecr.description.findings import Findings
from seecr.description.mjcf_text import MjcfText
from seecr.description.passive import Kinds, kinds_of
from seecr.description.robot import ABSURD, Joint, Robot
from seecr.description.tendons import TendonCable, cables_of, tendon_name
from seecr.errors import InputError, RobotError, SeecrError, printable
from seecr.files import no_text, path_of, read_bytes
from seecr.pose import Array

if TYPE_CHECKING:
    import mujoco


# What an MJCF has that may hold or stop a platform beside its cables: statics leave it out.
#
# Damping is none of it: it delays a rest, and shifts none.

# MuJoCo's mjtDisableBit: all constraints, dry friction, limits, contacts, springs.
_CONSTRAINT, _FRICTIONLOSS, _LIMIT, _CONTACT, _SPRING = 1, 4, 8, 16, 32
# A pair of excluded bodies is one number, the first body's in its upper half.
_UPPER = 16


def unsupported_features(
    model: mujoco.MjModel, platform: int, loose: Iterable[int] = ()
) -> tuple[str, ...]:
    """Names of what may hold or stop the platform beside its cables, such as "contacts".

    Args:
        model: as compiled; what its flags switch off does not count.
        platform: index of the platform's body; what is welded to it is a part of it.
        loose: indices of moving bodies that are no part of the robot, and whose joints do not
            count.
    """
    off = int(model.opt.disableflags)
    if off & _CONSTRAINT:
        return ()
    joints = ~np.isin(model.body_rootid[model.jnt_bodyid], list(loose))
    freedoms = joints[model.dof_jntid]
    found = {
        "joint limits": not off & _LIMIT and model.jnt_limited[joints].any(),
        "tendon limits": not off & _LIMIT and model.tendon_limited.any(),
        "dry friction": not off & _FRICTIONLOSS
        and (model.dof_frictionloss[freedoms].any() or model.tendon_frictionloss.any()),
        "contacts": not off & _CONTACT and _may_touch(model, platform),
    }
    return tuple(what for what, there in found.items() if there)


def _may_touch(model: mujoco.MjModel, platform: int) -> bool:
    """Whether a geom of the platform may touch one of its surroundings."""
    own = model.body_weldid[model.geom_bodyid] == platform
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


# What comes with the package: the paper's robots as MJCF files, and its two cables.

CABLES: dict[str, float] = {"vectran": 3000.0, "fishing": 300.0}
"""k_c = E S [N] of the paper's two cables (eq 10), by name.

The paper gives no number, only that the fishing line is "approximately 10 times" softer than
the Vectran (section IV). The fishing line, 0.4 mm of nylon at 1.5 to 3 GPa, has 190 to 380 N:
300 N is taken, and ten times that for the 0.7 mm Vectran. Fit them where it matters.
"""

_HERE = Path(__file__).resolve().parents[1]
# inside the package if installed from a wheel, beside it in a checkout or an editable install
_PLACES = (_HERE / "models", _HERE.parent / "models")


def model_names() -> tuple[str, ...]:
    """Names of the shipped robots, in alphabetical order.

    Returns:
        the names, as :func:`seecr.load_robot` takes them.

    Example:
        ``seecr.model_names()``
    """
    files = (file for place in _PLACES for file in place.glob("*/*.xml"))
    return tuple(sorted({file.stem for file in files if file.stem == file.parent.name}))


def model_path(name: str) -> Path:
    """The MJCF file of a shipped robot.

    Args:
        name: as in ``models/<name>/<name>.xml``, for example ``"demobot_cogiro"``.

    Returns:
        its path.

    Raises:
        InputError: there is no robot of that name; the message lists the names, nearest first.

    Example:
        ``seecr.model_path("demobot_cogiro")``
    """
    if str(name) in model_names():
        files = (place / name / f"{name}.xml" for place in _PLACES)
        return next(file for file in files if file.is_file())
    raise InputError(f"shipped robot {name!r}: expected one of {_names_near(str(name))}")


def robot_file(given: str | Path) -> Path:
    """The MJCF file for a path, or for the name of a shipped robot if there is no such file.

    Raises:
        InputError: neither, and without a file extension; the message lists the names, nearest
            first.
    """
    path = path_of(given, "an MJCF file, or the name of a shipped robot")
    if path.is_file() or path.suffix:
        return path
    if str(given) in model_names():
        return model_path(str(given))
    if path.exists() or path.name != str(given):
        return path
    raise InputError(
        f"{given}: neither a file nor a shipped robot; expected an MJCF file or one of "
        f"{_names_near(str(given))}"
    )


def is_shipped(path: Path) -> bool:
    """Whether a file is that of a shipped robot, as :func:`model_path` gives it."""
    return path.parent.parent in _PLACES and path.stem == path.parent.name and path.is_file()


def _names_near(name: str) -> str:
    known = model_names()
    nearest = difflib.get_close_matches(name, known, n=max(1, len(known)))
    names = ", ".join([*nearest, *(k for k in known if k not in nearest)])
    return names or "none: the models folder is missing"


# An attribute whose numbers include a nan: MuJoCo would warn and write a log before refusing it.
_NO_NUMBER = re.compile(
    rb"""\b(?!name\b)\w+\s*=\s*["'](?:[-+.\deE\s]*\s)?[-+]?nan\b[-+.\deE\sna]*["']""", re.IGNORECASE
)
# Characters of a name that still fit a line of a table.
_LONGEST = 100
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


def load_robot(path: str | Path, passive: Iterable[str] = ()) -> Robot:
    """Read the cable robot in an MJCF file.

    Cables hold one moving body, free or on slides, hinges and balls, with all that is welded to it.
    Each cable is a spatial tendon through two sites, one fixed to the world (the exit point A_i)
    and one on the body (the anchor point B_i), with ``springlength="0 l0"`` and a stiffness. Mass,
    centre of mass and gravity are those of the compiled model. ``Robot.notes`` tells what is left
    out or read otherwise than written, see docs/formats.md. Lines that no winch drives are declared
    in the file, see :mod:`seecr.description.passive`.

    Args:
        path: the MJCF file, or the name of a shipped robot.
        passive: names of further lines that no winch drives.

    Returns:
        the robot as numbers, SI.

    Raises:
        InputError: neither a file nor a shipped robot.
        RobotError: the file is missing, MuJoCo cannot compile it, or it is not such a robot;
            the message names the file and each element that is to be changed.

    Example:
        ``seecr.load_robot("robot.xml")``
    """
    path = robot_file(path)
    if is_shipped(path) and not passive:
        return _read_once(path, path.stat().st_mtime_ns)
    return _read(path, passive)


@lru_cache
def _read_once(path: Path, _written: int) -> Robot:
    """A shipped robot, as long as its file stays: to compile it takes longer than to solve poses.

    A file of the user's own may include others, which may change.
    """
    return _read(path)


def _read(path: Path, passive: Iterable[str] | str = ()) -> Robot:
    return read_file(path, passive).robot()


def read_file(given: str | Path, passive: Iterable[str] | str = ()) -> Reading:
    """What of a robot's file is a robot, with objections and notes; see :func:`read_model`.

    Raises:
        InputError: neither a file nor a shipped robot.
        RobotError: the file is missing, or MuJoCo cannot compile it.
    """
    path = robot_file(given)
    return read_model(_compile(path), path, passive)


@dataclass
class Reading:
    """What was found in a file: a robot if there are no objections to it.

    Attributes:
        model: as MuJoCo compiled it. path: of the file.
        found: objections and notes.
        platform: its bodies. cables: without those that are objected to.
        text: the XML. kinds: of all tendons, passive or driven.
    """

    model: mujoco.MjModel
    path: Path
    found: Findings
    platform: Platform
    cables: list[TendonCable]
    joints: tuple[Joint, ...]
    text: MjcfText
    kinds: Kinds

    def robot(self) -> Robot:
        """The robot.

        Raises:
            RobotError: with all objections to the file.
        """
        self.found.check()
        model, cables = self.model, self.cables
        mass, centre, inertia = load_of(model, self.platform)
        reference_pose = reference_of(model, self.platform)
        robot = _robot(
            self.path,
            name=_model_name(model, self.path),
            exit_points=np.array([cable.exit for cable in cables]),
            anchor_points=np.array([cable.anchor for cable in cables]),
            ea=np.array([cable.ea for cable in cables]),
            rest_lengths=np.array([cable.rest for cable in cables]),
            mass=mass,
            centre_of_mass=centre,
            gravity=_gravity(model),
            reference_pose=reference_pose,
            inertia=inertia,
            joints=self.joints,
            cable_names=tuple(cable.name for cable in cables),
            source=self.path,
            left_out=unsupported_features(model, self.platform.body, self.platform.loose),
            falls=np.array([cable.falls for cable in cables]),
            driven=np.array([cable.driven for cable in cables]),
            pushes=np.array([cable.pushes for cable in cables]),
            constant_tension_N=np.array([cable.constant_tension_N for cable in cables]),
            floor=_floor(model, reference_pose[2]),
        )
        _check_sizes(robot, body_name(model, self.platform.body), self.found)
        self.found.check()
        return replace(robot, read=self.found.notes)


@quiet_mujoco()
def read_model(model: mujoco.MjModel, path: Path, passive: Iterable[str] | str = ()) -> Reading:
    """What of a compiled model is a robot, with objections and notes.

    Args:
        model: as compiled. path: of its file. passive: names of further lines without a winch.

    Raises:
        RobotError: nothing moves, so that there is nothing else to look at.
    """
    found, text = Findings(path), MjcfText(path)
    if model.opt.disableflags & _SPRING:
        found.refuse(
            "", "", "the flag spring is disabled; expected springs, the cables are springs",
            fixable=True,
        )  # fmt: skip
    platform = platform_of(model, found)
    check_other_forces(model, platform, found)
    joints = joints_of(model, platform, found)
    kinds, faults = kinds_of(model, cable_names(model), text, passive)
    for fault in faults:
        found.refuse("", "", fault)
    cables = cables_of(model, platform, text, kinds, found)
    if not cables and not found.objections:
        found.refuse(
            "", "", "no cables; expected one <spatial> tendon per cable, through two sites"
        )
    return Reading(model, path, found, platform, cables, joints, text, kinds)


def cable_names(model: mujoco.MjModel) -> list[str]:
    """The names of the tendons, or those by their numbers."""
    return [tendon_name(model, i) for i in range(model.ntendon)]


def _robot(path: Path, **numbers: Any) -> Robot:
    """The robot with these numbers; errors about them name the file."""
    try:
        return Robot(**numbers)
    except SeecrError as error:
        raise RobotError(f"{path}: {error}") from None


def _check_sizes(robot: Robot, body: str, found: Findings) -> None:
    """Object to rest lengths and a platform of another order than the frame."""
    most = ABSURD * robot.reach
    frame = f"expected metres, of the size of the frame, {robot.reach:.3g} m across"
    cables = zip(robot.cable_names, robot.rest_lengths, robot.reference_lengths, strict=True)
    for name, length, straight in cables:
        if length > most:
            found.refuse("tendon", name, f"has rest length {{}} m; {frame}", f"{length:g}")
        if length < _LEAST * straight:
            found.refuse(
                "tendon", name, f"has rest length {length:g} m, but its sites are "
                f"{straight:.3g} m apart at the reference pose; expected both in metres",
            )  # fmt: skip
    for name, anchor in zip(robot.cable_names, robot.anchor_points, strict=True):
        away = float(np.linalg.norm(anchor))
        if away > most:
            found.refuse(
                "tendon", name, f"is anchored {away:g} m from the origin of body {body}; {frame}"
            )
    away = float(np.linalg.norm(robot.centre_of_mass - robot.anchor_points, axis=1).min())
    if away > most:
        found.refuse(
            "body", body, f"has its centre of mass {away:g} m from its anchor points; {frame}"
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
    """Check that names are UTF-8, which MuJoCo checks only when they are used, and can be shown."""
    for name in model.names.split(b"\0"):
        try:
            name.decode("utf-8")
        except UnicodeDecodeError:
            raise RobotError(
                f"{path}: the name {name.decode('utf-8', 'replace')!r} is not UTF-8; expected a "
                "file in UTF-8: save it again as that"
            ) from None
        if printable(shown := name.decode(), _LONGEST) != shown:
            raise RobotError(
                f"{path}: the name {printable(shown, _LONGEST)} cannot be shown; expected at most "
                f"{_LONGEST} characters, none of them a control character"
            )


def _model_name(model: mujoco.MjModel, path: Path) -> str:
    name = model.names[: model.names.index(b"\0")].decode()
    return path.stem if name in ("", "MuJoCo Model") else name


def _gravity(model: mujoco.MjModel) -> Array:
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        return np.zeros(3)
    return np.array(model.opt.gravity)


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


# Robots as callers give them: loaded, or as a path or name to load from.

GivenRobot: TypeAlias = Robot | str | Path
"""A robot, the path of its MJCF, or the name of a shipped one."""


def robot_of(given: GivenRobot) -> Robot:
    """The robot, loaded if a path or name is given.

    Raises:
        RobotError: there is no such file, or it holds no cable robot.
        InputError: neither a robot nor a path or name.
    """
    if isinstance(given, Robot):
        return given
    if isinstance(given, str | Path):
        return load_robot(given)
    raise InputError(
        "expected a robot, the path of its MJCF or the name of a shipped one, got "
        f"{type(given).__name__}"
    )
