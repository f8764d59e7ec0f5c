"""What an unknown effect may change smoothly: readings, the force on the platform, cable lengths.

A hose pulls differently at each place. A few numbers describe such a force, but known effects can
imitate what it does to all readings. So besides cubics of the readings, the candidates are a force
and cable lengths that change linearly with the position, a spring, which pulls towards a point, and
lengths that are a cubic of how far each winch has turned. Of a lens a few numbers describe all as
well. A tracker that moves shows over the session, wherever the platform is; so do exit points that
move and cables that grow, but their platform moves as they make it. And readings that are taken too
early lag behind the last step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum

import numpy as np

from crosscheck.calibration.field import field_of
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.fit.problem import KINDS, POSITION
from crosscheck.fit.smooth import field_columns, monomials
from crosscheck.fit.state import derivatives
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.pose import Array

SMOOTH = 0.3
"""Prior width of each degree of a smooth field over that of the degree before."""

_MOVE = (
    "move the tracker and measure some poses again; an error that moves with it comes from the "
    "tracker"
)
_FREE = (
    "take hoses and leads off the platform, or hang them elsewhere, and measure some poses again; "
    "an error that changes comes from their pull"
)


class Varying(StrEnum):
    """What may change smoothly without being an effect, in words, and how to find out about it."""

    POSITION = "something that varies smoothly over the workspace, in the position alone", _MOVE
    ORIENTATION = (
        ("something that varies smoothly over the workspace, in the orientation alone"),
        _MOVE,
    )
    TENSION = (
        "something that varies smoothly over the workspace, in the tensions alone",
        "hang a known weight on each load cell, as it is mounted, at several angles of its cable",
    )
    READINGS = "something that varies smoothly over the workspace, in all readings", ""
    SESSION = (
        "something that varies smoothly over the session, in the position",
        "read a stationary target before, between and after the runs, and measure the first poses "
        "again at the end",
    )
    LAG = (
        "readings that lag behind the last step, as if the platform were still on its way",
        "wait longer after each step before reading, and come to some poses from the other side",
    )
    EXIT_POINTS_MOVE = (
        "exit points that move over the session",
        "survey the exit points before and after the runs, and measure the first poses again at "
        "the end",
    )
    LENGTHS_DRIFT = (
        "cable lengths that change over the session",
        "mark the cables where they leave the winches, see whether the marks come back to their "
        "places, and measure the first poses again at the end",
    )
    FORCE_DRIFTS = (
        "a force on the platform that changes over the session",
        "weigh the platform before and after the runs, and measure the first poses again at the "
        "end",
    )
    FORCE = "a force on the platform that changes with its position", _FREE
    SPRING = "something that pulls the platform like a spring", _FREE
    LENGTHS = (
        "cable lengths that change with the position",
        "measure what each winch pays out, at several lengths and with the other winches elsewhere",
    )
    WINCHES = (
        "lengths that change with how far the winches have turned, as with rope in layers",
        "measure what each winch pays out turn by turn, over all of its travel",
    )

    advice: str

    def __new__(cls, word: str, advice: str) -> Varying:
        """Words with advice; the advice is "" if they name nothing that can be checked by hand."""
        varying = str.__new__(cls, word)
        varying._value_, varying.advice = word, advice
        return varying


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
    parts = (_of_readings, _of_one_kind, _of_lens, _of_tracker, _of_steps, _of_robot, _of_drifts)
    every = (one for part in parts for one in part(setting, joint))
    return [(what, columns) for what, columns in every if np.any(columns)]


def in_all_readings(setting: Setting, joint: JointFit) -> Array:
    """(N, k) a cubic in the position for each channel."""
    return field_of(setting.problem, joint.state.prediction.pose[:, :3])


def varying_in_time(setting: Setting, joint: JointFit) -> list[tuple[Varying, Array]]:
    """The candidates of :func:`varying` that depend on when a row was read, or on that before."""
    parts = (_of_tracker, _of_steps, _of_drifts)
    every = (one for part in parts for one in part(setting, joint))
    return [(what, columns) for what, columns in every if np.any(columns)]


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
    yield Varying.POSITION, _scaled(problem.whiten(state.factor, change))


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


def _of_tracker(setting: Setting, _joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """A cubic in the time for each channel of the position."""
    columns = field_columns(setting.problem, _session(setting)[:, None], POSITION.stop)
    yield Varying.SESSION, columns


def _session(setting: Setting) -> Array:
    """(n,) when each row was read: by the clock if it never goes back, else by row number."""
    data = setting.problem.data
    clock = data.t_s
    if clock is not None and np.all(np.diff(clock) >= 0.0) and np.ptp(clock) > 0.0:
        return clock
    return np.arange(data.n_rows, dtype=float)


def _of_steps(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """The pose of each row on its way from that of the row before in its run."""
    problem, state = setting.problem, joint.state
    run, here = problem.data.run_index, state.prediction.readings
    before = np.maximum(np.arange(len(run)) - 1, 0)
    before[run[before] != run] += 1
    there = replace(here, position=here.position[before], quat_wxyz=here.quat_wxyz[before])
    step = problem.residuals(there) - problem.residuals(here)
    yield Varying.LAG, _scaled(problem.whiten(state.factor, step)[:, None])


def _of_drifts(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """Changes of the robot that are quadratic in the time."""
    time = monomials(_session(setting)[:, None], 2, SMOOTH)[setting.problem.row_of, 1:]
    for what, name in (
        (Varying.EXIT_POINTS_MOVE, "exit_point_error"),
        (Varying.LENGTHS_DRIFT, "cable_length_offset"),
        (Varying.FORCE_DRIFTS, "external_wrench"),
    ):
        yield what, _scaled(_products(_rates(setting, joint, name), time))


def _of_robot(setting: Setting, joint: JointFit) -> Iterator[tuple[Varying, Array]]:
    """Candidates that move the platform itself: a force, a spring, cable lengths."""
    place = joint.state.prediction.pose[:, :3]
    linear = monomials(place, 1)[setting.problem.row_of]
    force = _rates(setting, joint, "external_wrench")[:, :3]
    yield Varying.FORCE, _scaled(_products(force, linear))
    off = place - place.mean(axis=0)
    towards = np.sum(force * off[setting.problem.row_of], axis=1, keepdims=True)
    yield Varying.SPRING, _scaled(np.hstack([_scaled(force), _scaled(towards)]))
    lengths = _rates(setting, joint, "cable_length_offset")
    yield Varying.LENGTHS, _scaled(_products(lengths, linear))
    every = _of_turns(setting, joint, lengths)
    # alike for all winches, and for each by itself
    yield Varying.WINCHES, _scaled(every.sum(axis=1))
    yield Varying.WINCHES, _scaled(every.reshape(len(every), -1))


def _of_turns(setting: Setting, joint: JointFit, lengths: Array) -> Array:
    """(N, m, 3) derivatives by what is linear, quadratic and cubic in each winch's own turning.

    Args:
        lengths: (N, m) derivatives by each cable's length.
    """
    turned = joint.state.prediction.setup.commanded_change
    turned = turned / max(float(np.abs(turned).max(initial=0.0)), 1e-300)
    powers = np.stack([turned, turned**2, turned**3], axis=-1)[setting.problem.row_of]
    return np.asarray(lengths[:, :, None] * powers)


def _rates(setting: Setting, joint: JointFit, name: str) -> Array:
    """(N, k) derivatives of the readings by the parameters of an effect at null."""
    layout = layout_of(catalogue()[name], setting.problem.robot)
    terms = Terms([*joint.terms.without(name), Term(layout, layout.null)])
    rates = derivatives(setting.problem, joint.state.of(terms), frozen=True)
    return np.asarray(rates[:, terms.own(name)])


def _products(columns: Array, shapes: Array) -> Array:
    """(N, k l) products of each column (N, k) with each shape (N, l)."""
    return np.asarray((columns[:, :, None] * shapes[:, None, :]).reshape(len(columns), -1))


def _scaled(columns: Array) -> Array:
    """Columns (N, k), scaled so that all together move a reading by its noise, in the rms."""
    power = float(np.sum(columns**2)) / max(len(columns), 1)
    return columns / np.sqrt(power) if power > 0.0 else columns
