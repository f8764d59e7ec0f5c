"""What nobody knows, as what changes smoothly: readings, the pull on the platform, lengths.

A hose pulls differently everywhere, and known effects imitate in all readings at once what few
numbers of a force say. So beside cubics of the readings there are a constant force and constant
lengths of cables that change linearly with the place, and a spring, which pulls all the same
towards a point. A tracker that moves shows over the session, wherever the platform is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.calibration.field import field_of
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.fit.problem import KINDS, POSITION
from crosscheck.fit.smooth import field_columns, monomials
from crosscheck.fit.state import derivatives
from seecr.effects import Term, Terms, catalogue
from seecr.effects.base import layout_of
from seecr.pose import Array


def varying(setting: Setting, joint: JointFit) -> dict[str, Array]:
    """Columns (N, k) of each kind, in units of the noise, by what they are in words."""
    return {
        words: columns
        for part in (_of_readings, _of_tracker, _of_robot)
        for words, columns in part(setting, joint)
        if np.any(columns)
    }


def _of_readings(setting: Setting, joint: JointFit) -> Iterator[tuple[str, Array]]:
    """A cubic for each channel, of each kind of readings and of all."""
    columns = field_of(setting.problem, joint.state.prediction.pose[:, :3])
    if not columns.shape[1]:
        return
    kind_of = setting.chain.kind[np.argmax(columns != 0.0, axis=0)]
    kinds = np.unique(kind_of)
    for kind in kinds:
        words = f"something smooth over the workspace in the {KINDS[kind].name} alone"
        yield words, columns[:, kind_of == kind]
    if len(kinds) > 1:
        yield "something smooth over the workspace in all readings", columns


def _of_tracker(setting: Setting, _joint: JointFit) -> Iterator[tuple[str, Array]]:
    """A cubic of the time for each channel of the position."""
    columns = field_columns(setting.problem, _session(setting)[:, None], POSITION.stop)
    yield "something smooth over the session in the position", columns


def _session(setting: Setting) -> Array:
    """(n,) when each row was read: by a clock that never goes back, else by its number."""
    data = setting.problem.data
    clock = data.t_s
    if clock is not None and np.all(np.diff(clock) >= 0.0) and np.ptp(clock) > 0.0:
        return clock
    return np.arange(data.n_rows, dtype=float)


def _of_robot(setting: Setting, joint: JointFit) -> Iterator[tuple[str, Array]]:
    """What moves the platform itself."""
    place = joint.state.prediction.pose[:, :3]
    linear = monomials(place, 1)[setting.problem.row_of]
    force = _rates(setting, joint, "external_wrench")[:, :3]
    yield "a force on the platform that changes with the place", _scaled(_products(force, linear))
    off = place - place.mean(axis=0)
    towards = np.sum(force * off[setting.problem.row_of], axis=1, keepdims=True)
    yield (
        "something that pulls the platform like a spring",
        _scaled(np.hstack([_scaled(force), _scaled(towards)])),
    )
    lengths = _rates(setting, joint, "cable_length_offset")
    yield "lengths of the cables that change with the place", _scaled(_products(lengths, linear))


def _rates(setting: Setting, joint: JointFit, name: str) -> Array:
    """(N, k) how readings change with the parameters of an effect, from nothing on."""
    layout = layout_of(catalogue()[name], setting.problem.robot)
    terms = Terms([*joint.terms.without(name), Term(layout, layout.null)])
    rates = derivatives(setting.problem, joint.state.of(terms), frozen=True)
    return np.asarray(rates[:, terms.own(name)])


def _products(columns: Array, shapes: Array) -> Array:
    """(N, k l) of each column (N, k) with each shape (N, l)."""
    return np.asarray((columns[:, :, None] * shapes[:, None, :]).reshape(len(columns), -1))


def _scaled(columns: Array) -> Array:
    """So that all together move a reading by its noise, on average."""
    power = float(np.sum(columns**2)) / max(len(columns), 1)
    return columns / np.sqrt(power) if power > 0.0 else columns
