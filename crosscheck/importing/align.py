"""Approximate alignment of a tracker's frame, and of its body on the platform.

Logged is T_base_tracker^-1 T_platform T_target. Both unknown transforms are found from points that
the user names, or from the commands. In the latter case they have absorbed a part of the model's
error, and stay free in every later fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.fit.registration import turn_of_points
from crosscheck.importing.dwells import about_mean
from seecr.counted import counted
from seecr.pose import Array, quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat
from seecr.units import millimetres

LEFT, MOST = 0.2, 0.8
"""Largest residual relative to the spread of the commands, and the part of dwells within it."""
# Positions that spread so many times as far as the commands, or as little, are in another unit.
_UNITS = 8.0
# Readings that another frame brings so many times as near to the commands are in that one.
_NEARER = 3.0
# The same of named points, each of which must be within it.
_LEFT_OF_POINTS = 0.05
# Commands with smaller rotations about their mean do not show where the target is.
_TURNED = np.radians(3.0)
_ROUNDS = 10
_LEAST = 3
_ONE_LINE = (
    "the frames cannot be aligned: the commanded positions of the dwells lie on one line, or so "
    "close to one that the readings do not show the rotation about it; name three points with "
    "--point"
)
_NONE = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Frames:
    """Transform from poses in the tracker's frame to poses of the platform in the base frame.

    Attributes:
        turn, shift: base = turn * tracker + shift.
        target_turn, target_shift: of the body in the platform's frame.
        how: what was done, in words. free: effects that later fits leave free.
    """

    turn: Array
    shift: Array
    target_turn: Array
    target_shift: Array
    how: str
    free: tuple[str, ...]

    def poses(self, position: Array, quat: Array | None) -> tuple[Array, Array | None]:
        """Positions (n, 3) and quaternions (n, 4) of the platform, or the body's positions."""
        place = quat_rotate(self.turn, position) + self.shift
        if quat is None:
            return place, None
        turned = quat_multiply(quat_multiply(self.turn, quat), quat_conjugate(self.target_turn))
        # q and -q are the same rotation: people expect the one near 1 0 0 0
        turned = np.where(turned[:, :1] < 0.0, -turned, turned)
        return place - quat_rotate(turned, self.target_shift), turned


def as_they_are(target: Array | None) -> Frames:
    """A tracker that already reads in the base frame."""
    shift = np.zeros(3) if target is None else target
    return Frames(_NONE, np.zeros(3), _NONE, shift, "frames used as they are", ())


def off_commands(frames: Frames, position: Array, quat: Array | None, told: Array) -> list[str]:
    """How far readings in a frame that is used as it is are from the commands.

    With a warning where another frame, such as a turned one, would bring them much closer.
    """
    place, turned = frames.poses(position, quat)
    away = float(np.median(np.linalg.norm(place - told[:, :3], axis=1)))
    off = millimetres(away, 3)
    if turned is not None:
        inside = quat_multiply(quat_conjugate(told[:, 3:]), turned)
        angle = np.median(np.linalg.norm(rotvec_from_quat(inside), axis=1))
        off += f" and {np.degrees(angle):.3g} deg"
    notes = [f"the readings are {off} (median) from the commands"]
    spread = size_of_cloud(told[:, :3])
    try:
        other = to_commands(position, quat, told, None)
    except CrosscheckError:  # which another frame does not explain
        return notes
    left = np.linalg.norm(other.poses(position, quat)[0] - told[:, :3], axis=1)
    nearer = float(np.median(left))
    if away > LEFT * spread and away > _NEARER * nearer:
        turn = np.degrees(np.linalg.norm(rotvec_from_quat(other.turn)))
        notes.append(
            f"turned by {turn:.3g} deg and moved by {np.linalg.norm(other.shift):.3g} m they would "
            f"be {1e3 * nearer:.3g} mm from them: is the tracker's frame that of the robot? "
            "Without --aligned it is aligned"
        )
    return notes


def unturned(frames: Frames, position: Array, quat: Array | None, told: Array) -> list[str]:
    """That commands have one orientation while the platform turns: most likely it is not logged."""
    turned = frames.poses(position, quat)[1]
    if turned is None or np.ptp(told[:, 3:], axis=0).max() > 0.0:
        return []
    rms = _turning(turned)
    if rms <= _TURNED:
        return []
    return [
        f"all commands have one orientation, but the platform turns by {np.degrees(rms):.3g} deg "
        "(rms) about its mean: is the orientation missing in the log of commands? Add cmd_qw to "
        "cmd_qz, or cmd_rx_deg to cmd_rz_deg; otherwise these turns count as errors"
    ]


def by_points(names: Sequence[str], there: Array, here: Array) -> Frames:
    """The tracker's frame from points (k, 3) that are known in it and in the base frame.

    Raises:
        CrosscheckError: fewer than three points, points in one line, or inconsistent distances.
    """
    turn = turn_of_points(there, here)
    if turn is None:
        raise CrosscheckError(
            f"the frames cannot be aligned by {counted(len(names), 'point')} "
            f"({', '.join(names)}): expected three or more that are not on one line; "
            "name more with --point"
        )
    shift = here.mean(axis=0) - quat_rotate(turn, there).mean(axis=0)
    left = np.linalg.norm(quat_rotate(turn, there) + shift - here, axis=1)
    worst, spread = int(np.argmax(left)), size_of_cloud(here)
    if left[worst] > _LEFT_OF_POINTS * spread:
        raise CrosscheckError(
            f"the frames cannot be aligned: point {names[worst]} is {left[worst]:.3g} m from "
            f"where the other points put it, and all of them spread by {spread:.3g} m; check its "
            "coordinates in metres, and that both frames are right-handed"
        )
    how = (
        f"tracker's frame aligned by {len(names)} points, which fit to {1e3 * np.max(left):.2g} mm"
    )
    return Frames(turn, shift, _NONE, np.zeros(3), how, ("tracker_frame",))


def to_commands(position: Array, quat: Array | None, told: Array, target: Array | None) -> Frames:
    """The tracker's frame from commanded poses.

    Args:
        position, quat: (n, 3) [m] and (n, 4) or None, as tracked.
        told: (n, 7) commanded.
        target: (3,) [m] of the body's origin in the platform's frame, with parallel axes; None
            estimates both.

    Raises:
        CrosscheckError: fewer than three dwells, commands in one line, or large residuals.
    """
    if len(told) < _LEAST:
        raise CrosscheckError(
            f"the frames cannot be aligned by {counted(len(told), 'dwell')}: expected {_LEAST} or "
            "more at which a command was held; do the clocks of both logs agree (--clock)? If they "
            "do, name three points with --point"
        )
    home = told[:, 3:]
    shift = np.zeros(3) if target is None else target
    tilted = target is None and _turning(home) > _TURNED
    turn = None
    for _ in range(_ROUNDS if tilted else 1):
        turn = turn_of_points(position, told[:, :3] + quat_rotate(home, shift))
        if turn is not None and tilted:
            shift = _target(quat_rotate(turn, position), told)
    if turn is None:
        raise CrosscheckError(_ONE_LINE)
    away = told[:, :3] + quat_rotate(home, shift) - quat_rotate(turn, position)
    frames = Frames(turn, np.median(away, axis=0), _NONE, shift, "", ("tracker_frame",))
    left = np.linalg.norm(away - frames.shift, axis=1)
    _check(left, told, position)
    if np.median(left) > _aside(told[:, :3]):
        raise CrosscheckError(_ONE_LINE)
    how = (
        f"tracker's frame aligned to the commands of {counted(len(told), 'dwell')}: "
        f"{1e3 * float(np.sqrt(np.mean(left**2))):.3g} mm rms remain"
    )
    return with_target(replace(frames, how=how), quat, told, target)


def with_target(frames: Frames, quat: Array | None, told: Array, target: Array | None) -> Frames:
    """With the body's position ``target`` on the platform, or its rotation, which stays free."""
    if target is not None:
        return replace(frames, target_shift=target)
    free = (*frames.free, "tracker_target")
    if quat is None:
        return replace(frames, free=free)
    base = quat_multiply(frames.turn, quat)
    inside = quat_multiply(quat_conjugate(told[:, 3:]), base)
    turn, away = about_mean(inside)
    left = np.degrees(np.sqrt(np.mean(np.sum(away**2, axis=1))))
    angle = np.degrees(np.linalg.norm(rotvec_from_quat(turn)))
    how = (
        f"{frames.how}; the body's axes turned by {angle:.3g} deg into the platform's: {left:.2g} "
        "deg rms remain"
    )
    return replace(frames, target_turn=turn, how=how, free=free)


def place_of_target(frames: Frames, position: Array, told: Array) -> Frames:
    """The frames with the body's position on the platform, for a known tracker frame."""
    base = quat_rotate(frames.turn, position) + frames.shift
    inside = quat_rotate(quat_conjugate(told[:, 3:]), base - told[:, :3])
    return replace(frames, target_shift=np.median(inside, axis=0))


def _target(base: Array, told: Array) -> Array:
    """The position (3,) of the body from rotated commands: base = p + R target - shift."""
    n = len(told)
    turned = np.stack([quat_rotate(told[:, 3:], np.tile(e, (n, 1))) for e in np.eye(3)], axis=2)
    matrix = np.concatenate([np.tile(np.eye(3), (n, 1, 1)), turned], axis=2).reshape(3 * n, 6)
    found = np.linalg.lstsq(matrix, (base - told[:, :3]).ravel(), rcond=1e-3)[0]
    return np.asarray(found[3:])


def _turning(quat: Array) -> float:
    """The rms angle [rad] of rotations (n, 4) from their mean."""
    return float(np.sqrt(np.mean(np.sum(about_mean(quat)[1] ** 2, axis=1))))


def _aside(points: Array) -> float:
    """Typical distance of points (n, 3) from the line nearest to them."""
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(np.sqrt(np.sum(sizes[1:] ** 2) / len(points)))


def size_of_cloud(points: Array) -> float:
    """The rms distance of points (n, 3) from their mean."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def _check(left: Array, told: Array, position: Array) -> None:
    most, spread = float(np.quantile(left, MOST)), size_of_cloud(told[:, :3])
    if most > LEFT * spread:
        raise CrosscheckError(
            f"the frames cannot be aligned: errors of {1e3 * most:.3g} mm remain, and the commands "
            f"spread by {1e3 * spread:.3g} mm; expected the commands and the tracker's log of one "
            "recording; are they of the same robot, and do their clocks agree (--clock)?"
            f"{_of_units(size_of_cloud(position), spread)}"
        )


def _of_units(here: float, spread: float) -> str:
    """A question about the unit of readings that spread far more or less than the commands."""
    larger = here / max(spread, 1e-9)
    if 1.0 / _UNITS < larger < _UNITS or min(here, spread) <= 0.0:
        return ""
    many = f"{larger:.0f} times as far" if larger > 1.0 else f"{larger:.2g} of that"
    return f" The tracker's positions spread by {many}: are they in the unit that the file states?"
