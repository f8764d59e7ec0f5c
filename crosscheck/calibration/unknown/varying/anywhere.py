"""What an unknown effect may change smoothly: readings, the force on the platform, cable lengths.

A hose pulls differently at each place. A few numbers describe such a force, but known effects can
imitate what it does to all readings. So besides cubics of the readings, the candidates are a force
and cable lengths that change linearly with the position, a spring, which pulls towards a point, one
cable's length, as over an edge, and lengths that are a cubic of how far each winch has turned, or
go with how far others have. Of a lens a few numbers describe all as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.unknown.field import field_of
from crosscheck.calibration.unknown.varying.columns import (
    SMOOTH,
    in_units_of_noise,
    products,
    rates_by,
)
from crosscheck.calibration.unknown.varying.in_time import varying_in_time
from crosscheck.calibration.unknown.varying.kinds import Varying
from crosscheck.fit.least_squares.problem import KINDS, POSITION
from crosscheck.fit.noise.smooth import monomials
from seecr.pose import Array

# Of more cables than these, pairs have no numbers of their own: they would be hundreds.
_MOST_CABLES = 12
_ALONE = {
    "position": Varying.POSITION, "orientation": Varying.ORIENTATION, "tension": Varying.TENSION,
}  # fmt: skip


def varying(setting: Setting, joint: JointFit) -> list[tuple[Varying, Array]]:
    """Candidates that move a reading: what varies, and columns (N, k) in units of the noise.

    Cubics of one kind of reading, if there are others, are there twice: with degrees that are all
    as large, and with smaller ones the higher they are. What a lens does is mostly linear and
    quadratic, and a prior as wide for all coefficients would cost it more than it explains. In all
    readings together whatever is known is smooth as well, so that this tells nothing there.
    """
    parts = (_of_readings, _of_one_kind, _of_lens, _of_robot)
    every = (one for part in parts for one in part(setting, joint))
    there = [(what, columns) for what, columns in every if np.any(columns)]
    return there + varying_in_time(setting, joint)


def in_all_readings(setting: Setting, joint: JointFit) -> Array:
    """(N, k) a cubic in the position for each channel."""
    return field_of(setting.problem, joint.state.prediction.pose[:, :3])


def _of_readings(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """A cubic in the position for each channel: by kind of reading, and for all together."""
    kinds = _by_kind(setting, joint, 1.0)
    yield from kinds
    if len(kinds) > 1:
        yield Varying.READINGS, np.concatenate([columns for _kind, columns in kinds], axis=1)


def _of_one_kind(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """The same of one kind among others, with smaller coefficients of the higher degrees."""
    kinds = _by_kind(setting, joint, SMOOTH)
    yield from kinds if len(kinds) > 1 else []


def _by_kind(setting: Setting, joint: JointFit, smooth: float) -> list[tuple[Varying, Array]]:
    """A cubic in the position for each channel, by kind of reading."""
    columns = field_of(setting.problem, joint.state.prediction.pose[:, :3], smooth)
    if not columns.shape[1]:
        return []
    kind_of = setting.chain.kind[np.argmax(columns != 0.0, axis=0)]
    kinds = np.unique(kind_of)
    return [(_ALONE[KINDS[kind].name], columns[:, kind_of == kind]) for kind in kinds]


def _of_lens(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """A picture that widens with the square of the distance from some point.

    It has few coefficients where a cubic of the position has sixty: with the latter alone, what
    else has few would be likelier than the lens that is there.
    """
    problem, state = setting.problem, joint.state
    place = state.prediction.pose[:, :3]
    change = np.zeros((*problem.measured.shape, 16))
    change[:, POSITION] = widening(place)
    yield Varying.POSITION, in_units_of_noise(problem.whiten(state.factor, change))


def widening(place: Array) -> Array:
    """(n, 3, 16) how places (n, 3) move in such a picture, about any point.

    Moving the point adds what is quadratic, linear and constant in the place; the linear part is
    left free, as for a tracker whose axes have scales of their own.
    """
    off = place - 0.5 * (place.max(axis=0) + place.min(axis=0))
    off = off / max(float(np.abs(off).max()), 1e-300)
    axes = np.broadcast_to(np.eye(3), (len(off), 3, 3))
    square = np.sum(off**2, axis=1)[:, None, None]
    linear = np.einsum("nj,ik->nikj", off, np.eye(3)).reshape(len(off), 3, 9)
    quadratic = square * axes + 2.0 * off[:, :, None] * off[:, None, :]
    cubic = square * off[:, :, None]
    return np.concatenate([axes, linear, quadratic, cubic], axis=2)


def _of_robot(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """Candidates that move the platform itself: a force, a spring, cable lengths."""
    place = joint.state.prediction.pose[:, :3]
    linear = monomials(place, 1)[setting.problem.row_of]
    force = rates_by(setting, joint, "external_wrench")[:, :3]
    yield Varying.FORCE, in_units_of_noise(products(force, linear))
    off = place - place.mean(axis=0)
    towards = np.sum(force * off[setting.problem.row_of], axis=1, keepdims=True)
    yield (
        Varying.SPRING,
        in_units_of_noise(np.hstack([in_units_of_noise(force), in_units_of_noise(towards)])),
    )
    lengths = rates_by(setting, joint, "cable_length_offset")
    yield Varying.LENGTHS, in_units_of_noise(products(lengths, linear))
    bent = monomials(place, 2)[setting.problem.row_of, 1:]
    for k in range(lengths.shape[1]):
        yield Varying.ONE_CABLE, in_units_of_noise(products(lengths[:, [k]], bent))
    turned = _turned(setting, joint)
    every = lengths[:, :, None] * np.stack([turned, turned**2, turned**3], axis=-1)
    # alike for all winches, and for each by itself
    yield Varying.WINCHES, in_units_of_noise(every.sum(axis=1))
    yield Varying.WINCHES, in_units_of_noise(every.reshape(len(every), -1))
    for columns in _by_others(lengths, turned):
        yield Varying.COUPLED, columns


def _by_others(lengths: Array, turned: Array) -> Iterator[Array]:
    """Each cable's length by how far others have turned: its neighbours alike, and every other.

    Args:
        lengths: (N, m) derivatives by each cable's length. turned: (N, m) how far each has turned.
    """
    others = [np.roll(turned, k, axis=1) for k in range(1, turned.shape[1])]
    if not others:
        return
    # of two cables each has the other as its only neighbour
    beside = [others[0], others[-1]][: len(others)]
    alike = [np.sum(lengths * other, axis=1) for other in beside]
    yield in_units_of_noise(np.stack(alike, axis=1))
    if turned.shape[1] <= _MOST_CABLES:
        yield in_units_of_noise(np.hstack([lengths * other for other in others]))


def _turned(setting: Setting, joint: JointFit) -> Array:
    """(N, m) how far each winch has turned for each reading, at most one."""
    turned = joint.state.prediction.setup.commanded_change
    turned = turned / max(float(np.abs(turned).max(initial=0.0)), 1e-300)
    return np.asarray(turned[setting.problem.row_of])
