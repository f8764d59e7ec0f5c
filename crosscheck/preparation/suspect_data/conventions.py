"""Orientations that were written by another convention than they are read by.

Quaternions with the scalar last, rotations of the base as seen from the platform, angles about the
axes in another order: each makes other rotations of the same numbers. If the rotations that one
such reading makes are near those that the model expects, and those of the file many times farther,
no effect of a robot is to be sought in the difference.

Where platforms turn little, conventions differ little: angles in another order by their products.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import BY_NAME, Problem
from seecr.effects.base import Readings
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)
from seecr.units import short

# Another convention brings four rows in five so many times nearer to what the model expects, also
# if the target may sit on the platform, or the tracker stand, in any orientation. If it brings them
# only rather nearer, that is said, and no more.
_NEARER, _RATHER_NEARER = 2.0, 1.5
# One that makes quite other rotations also brings them nearer to the commands: a platform that the
# model takes for heavier on the wrong side tilts the other way, without any convention.
# On a platform that rests far from its commands it need only be so many times nearer than a tilt.
_NEARER_TO_COMMANDS, _FAR_NEARER = 2.0, 10.0
_PART = 0.8
# What is off by less [rad], or by less than so many times the stated noise, is not worth a word.
_LEAST, _NOISE = np.radians(0.01), 3.0
_LEAST_ROWS = 8


class Convention(Enum):
    """How else orientations may be meant; the values are what people read, after "if"."""

    SCALAR_LAST = "the last number of each quaternion is the scalar"
    INVERTED = "every rotation is inverted"
    SCALAR_LAST_INVERTED = (
        "the last number of each quaternion is the scalar and every rotation is inverted"
    )
    NEGATED = "all three angles have the other sign"
    ROTATION_VECTOR = "the three angles are a rotation vector"
    XZY = "the angles are those of R = Rx(rx) Rz(rz) Ry(ry)"
    YXZ = "the angles are those of R = Ry(ry) Rx(rx) Rz(rz)"
    YZX = "the angles are those of R = Ry(ry) Rz(rz) Rx(rx)"
    ZXY = "the angles are those of R = Rz(rz) Rx(rx) Ry(ry)"
    ZYX = "the angles are those of R = Rz(rz) Ry(ry) Rx(rx)"
    YAW_FIRST = "rx holds yaw, ry pitch and rz roll, of R = Rz(yaw) Ry(pitch) Rx(roll)"
    YAW_FIRST_FIXED = "rx holds the angle about z and rz that about x, of R = Rx Ry Rz"


_Reading = Callable[[Array], Array]


def _turns(order: str, columns: str, sign: float = 1.0) -> _Reading:
    """Quaternions of the same angles, taken as turns about moving axes in an order.

    Args:
        order: axes, such as "zyx". columns: the columns that hold these turns, such as "xyz".
    """

    def read(quat: Array) -> Array:
        angles = sign * rxyz_from_quat(quat)
        out = np.tile([1.0, 0.0, 0.0, 0.0], (len(quat), 1))
        for axis, column in zip(order, columns, strict=True):
            turn = np.zeros_like(angles)
            turn[:, "xyz".index(axis)] = angles[:, "xyz".index(column)]
            out = quat_multiply(out, quat_from_rotvec(turn))
        return out

    return read


_READINGS: dict[Convention, _Reading] = {
    Convention.SCALAR_LAST: lambda quat: np.roll(quat, 1, axis=1),
    Convention.INVERTED: quat_conjugate,
    Convention.SCALAR_LAST_INVERTED: lambda quat: quat_conjugate(np.roll(quat, 1, axis=1)),
    Convention.NEGATED: _turns("xyz", "xyz", -1.0),
    Convention.ROTATION_VECTOR: lambda quat: quat_from_rotvec(rxyz_from_quat(quat)),
    Convention.XZY: _turns("xzy", "xzy"),
    Convention.YXZ: _turns("yxz", "yxz"),
    Convention.YZX: _turns("yzx", "yzx"),
    Convention.ZXY: _turns("zxy", "zxy"),
    Convention.ZYX: _turns("zyx", "zyx"),
    Convention.YAW_FIRST: _turns("zyx", "xyz"),
    Convention.YAW_FIRST_FIXED: _turns("xyz", "zyx"),
}
# These agree with the file's convention to first order in the angles.
_ALIKE = {
    Convention.ROTATION_VECTOR, Convention.XZY, Convention.YXZ, Convention.YZX, Convention.ZXY,
    Convention.ZYX,
}  # fmt: skip


@dataclass(frozen=True)
class Misread:
    """Orientations that another convention brings near to what the model expects.

    Attributes:
        convention: how they seem to be meant.
        file: name of the file that they are in; "" if there is only one.
        here, there: median angle [rad] to what is expected, as they stand and by that convention.
        certain: whether so much nearer that no verdict is to be passed on them.
    """

    convention: Convention
    file: str
    here: float
    there: float
    certain: bool

    @property
    def words(self) -> str:
        """A sentence that asks about it."""
        file = f"{self.file}: " if self.file else ""
        return (
            f"{file}The measured orientations are {self.off} from those that the model expects, "
            f"and {self.left} if {self.convention.value}: is that how they are written?"
        )

    @property
    def off(self) -> str:
        """The angle as they stand, in words."""
        return _in_words(self.here)

    @property
    def left(self) -> str:
        """The angle by that convention, in words."""
        return _in_words(self.there)


def _in_words(angle: float) -> str:
    return f"{short(np.degrees(angle))} deg"


def misread_orientations(problem: Problem, readings: Readings) -> Misread | None:
    """The file whose orientations seem to be of another convention; None without one.

    The first one for which that is certain; if none is, the first one.

    Args:
        problem: the data with their noise. readings: what the model as it stands predicts.
    """
    data = problem.data
    if data.quat_wxyz is None:
        return None
    whole = problem.counted[:, BY_NAME["orientation"].columns].all(axis=1)
    whole &= np.isfinite(readings.quat_wxyz).all(axis=1)
    found = []
    for k in np.unique(data.file):
        rows = whole & (data.file == k)
        if rows.sum() >= _LEAST_ROWS:
            found += _of_rows(problem, readings, rows, data.files[k] if data.files else "")
    return min(found, key=lambda one: not one.certain, default=None)


def _of_rows(
    problem: Problem, readings: Readings, rows: NDArray[np.bool_], file: str
) -> list[Misread]:
    """What seems to be the convention of some rows; empty if it is the file's."""
    assert problem.data.quat_wxyz is not None
    read, expected = problem.data.quat_wxyz[rows], readings.quat_wxyz[rows]
    apart = _angles(read, expected)
    least = _LEAST
    if problem.data.sigma.orientation_rad is not None:
        noise = problem.reading_sigma[rows][:, BY_NAME["orientation"].columns]
        least = max(least, _NOISE * float(np.median(noise)))
    here = min(map(_most, (apart, *_mounted(read, expected))))
    if here < least:
        return []
    by = {which: meant(read) for which, meant in _READINGS.items()}
    best = min(by, key=lambda which: _most(_angles(by[which], expected)))
    near = _angles(by[best], expected)
    if here < _RATHER_NEARER * _most(near):
        return []
    told = _told(problem)[rows]
    if best not in _ALIKE and not _is_no_tilt(read, expected, told, by[best]):
        return []
    certain = here >= _NEARER * _most(near)
    return [Misread(best, file, float(np.median(apart)), float(np.median(near)), certain)]


def _is_no_tilt(read: Array, expected: Array, told: Array, meant: Array) -> bool:
    """Whether what a convention makes of rotations is more than a tilt to the other side.

    It is if it is nearer to the commands, or far nearer to what is expected than that would be
    which tilts from the commands to the other side by as much.
    """
    if _most(_angles(read, told)) >= _NEARER_TO_COMMANDS * _most(_angles(meant, told)):
        return True
    back = quat_multiply(told, quat_multiply(quat_conjugate(expected), told))
    least = min(_most(_angles(read, back)), _most(_angles(read, expected)))
    return least > _FAR_NEARER * _most(_angles(meant, expected))


def _mounted(read: Array, expected: Array) -> Iterator[Array]:
    """Angles (n,) if the target sits in another orientation, or the tracker stands in one."""
    target = _mean(quat_multiply(quat_conjugate(expected), read))
    yield _angles(read, quat_multiply(expected, np.tile(target, (len(read), 1))))
    frame = _mean(quat_multiply(read, quat_conjugate(expected)))
    yield _angles(read, quat_multiply(np.tile(frame, (len(read), 1)), expected))


def _mean(quat: Array) -> Array:
    """Mean rotation (4,) of quaternions (n, 4): the largest eigenvector of their moment matrix."""
    _values, vectors = np.linalg.eigh(quat.T @ quat)
    return np.asarray(vectors[:, -1])


def _told(problem: Problem) -> Array:
    """Commanded quaternions (n, 4); the reference pose's if lengths are commanded."""
    told = problem.data.command_pose
    home = problem.robot.reference_pose[3:]
    return np.tile(home, (problem.data.n_rows, 1)) if told is None else told[:, 3:]


def _angles(read: Array, expected: Array) -> Array:
    """Angles (n,) [rad] between quaternions."""
    turn = quat_multiply(read, quat_conjugate(expected))
    return np.asarray(np.linalg.norm(rotvec_from_quat(turn), axis=1))


def _most(angles: Array) -> float:
    """What four angles in five are below: one row in ten may be an outlier."""
    return float(np.quantile(angles, _PART))
