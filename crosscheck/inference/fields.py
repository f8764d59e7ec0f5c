"""What an unknown effect may change: fields of columns that compete with the known effects.

Whatever the catalogue lacks moves the readings by some smooth function of the place, of the time or
of how far the winches have turned: y = g(theta) + F c + e with c ~ N(0, mu^2) (Kennedy and O'Hagan,
J. R. Statist. Soc. B 63, 2001). Some kinds have few coefficients, because a cubic of all readings
with its hundred numbers costs more evidence than a hose or a lens earns: a force and cable lengths
that change linearly with the position, a spring, one cable over an edge, winches that wind in
layers or go with their neighbours, an image that widens, a drift. All columns are in units of the
noise, scaled so that together they move a reading by its noise, in the rms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum

import numpy as np

from crosscheck.fit.algebra import monomials, waves
from crosscheck.fit.problem import BY_NAME, KINDS, POSITION, Rms, rms_by_kind
from crosscheck.fit.state import amplitude_columns
from crosscheck.inference.fit import Data, Fit
from crosscheck.inference.priors import FIELD_WIDTHS, UNKNOWN
from seecr.effects import Term, layout_of
from seecr.pose import Array

# Prior width of each degree of a smooth field over that of the degree before.
_SMOOTH = 0.3
# A wave over the room is forgotten after this part of half its range: a cubic follows longer ones.
# Shorter ones would need more columns than 144 rows can bear.
_SHORT = 0.3
# Of more cables than these, pairs have no numbers of their own: they would be hundreds.
_MOST_CABLES = 12
# The number of its kind.
_POSITION = KINDS.index(BY_NAME["position"])
# Number of fields drawn, the part that has to be seen, and the sizes tried, in units of the noise.
_DRAWN, _SEEN = 100, 0.9
_SIZES = np.geomspace(0.03, 300.0, 81)
_MOVE = (
    "move the tracker and measure some poses again; an error that moves with it comes from the "
    "tracker"
)
_FREE = (
    "take hoses and leads off the platform, or hang them elsewhere, and measure some poses again; "
    "an error that changes comes from their pull"
)


class Varying(StrEnum):
    """What may change without being an effect, in words, and how to find out about it."""

    POSITION = "something that varies smoothly over the workspace, in the position alone", _MOVE
    ORIENTATION = (
        "something that varies smoothly over the workspace, in the orientation alone",
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
    ONE_CABLE = (
        "the length of one cable that changes with the position, as over an edge",
        "see whether a cable touches anything on its way, on all sides of the workspace",
    )
    COUPLED = (
        "cable lengths that change with how far other winches have turned",
        "turn one winch at a time, and see whether any other cable moves",
    )

    advice: str

    def __new__(cls, word: str, advice: str) -> Varying:
        """Words with advice; the advice is "" if they name nothing that can be checked by hand."""
        varying = str.__new__(cls, word)
        varying._value_, varying.advice = word, advice
        return varying


def fields_about(fit: Fit) -> Iterator[tuple[Varying, Array]]:
    """What may vary, each with columns (N, k) in units of the noise, about a fit.

    One at a time: all together are a hundred times as large as the readings.
    """
    about = _FieldColumns(fit)
    parts = (about.readings, about.image, about.session, about.forces, about.lengths, about.drifts)
    for part in parts:
        for what, columns in part():
            if np.any(columns):
                yield what, columns


def over_place(fit: Fit, kind: int, length: float) -> Array:
    """(N, k) a function of the place for each channel of one kind of readings.

    It is a Gaussian process that is forgotten after so many times half the range of an axis.
    """
    problem = fit.data.problem
    shapes = waves(fit.state.prediction.pose[:, :3], length)[problem.row_of]
    return per_channel(fit.data, shapes, kind)


class _FieldColumns:
    """The columns about a model."""

    def __init__(self, fit: Fit) -> None:
        self.data, self.state = fit.data, fit.state
        self.problem = fit.data.problem
        self.row, self.place = self.problem.row_of, fit.state.prediction.pose[:, :3]

    def rates_by(self, name: str) -> Array:
        """(N, k) derivatives of the readings by the parameters of an effect at null."""
        layout = layout_of(name, self.problem.robot)
        return amplitude_columns(self.problem, self.state, Term(layout, layout.null))

    def readings(self) -> Iterator[tuple[Varying, Array]]:
        """A cubic in the position for each channel: by kind of reading, and for all together.

        Cubics of one kind, if there are others, are there twice: with degrees that are all as
        large, and with smaller ones the higher they are, as of a lens. What is shorter than a cubic
        can follow, as a ripple of rails or of a picture, is there for each kind by itself.
        """
        kinds = np.unique(self.data.chain.kind).tolist()
        for smooth in (1.0, _SMOOTH):
            shapes = monomials(self.place, 3, smooth)[self.row]
            if len(kinds) > 1 or smooth == 1.0:
                for kind in kinds:
                    yield Varying[KINDS[kind].name.upper()], per_channel(self.data, shapes, kind)
            if len(kinds) > 1 and smooth == 1.0:
                yield Varying.READINGS, per_channel(self.data, shapes)
        short = waves(self.place, _SHORT)[self.row]
        for kind in kinds:
            yield Varying[KINDS[kind].name.upper()], per_channel(self.data, short, kind)

    def image(self) -> Iterator[tuple[Varying, Array]]:
        """A picture that widens with the square of the distance from some point."""
        change = np.zeros((*self.problem.measured.shape, 16))
        change[:, POSITION] = widening(self.place)
        yield Varying.POSITION, in_units_of_noise(self.problem.whiten(self.state.factor, change))

    def session(self) -> Iterator[tuple[Varying, Array]]:
        """A cubic in the time for each coordinate; the pose on its way from the row before."""
        shapes = monomials(self.time[:, None], 3)[self.row]
        yield Varying.SESSION, per_channel(self.data, shapes, _POSITION)
        run, here = self.problem.data.run_index, self.state.prediction.readings
        before = np.maximum(np.arange(len(run)) - 1, 0)
        before[run[before] != run] += 1
        there = replace(here, position=here.position[before], quat_wxyz=here.quat_wxyz[before])
        step = self.problem.residuals(there) - self.problem.residuals(here)
        yield (
            Varying.LAG,
            in_units_of_noise(self.problem.whiten(self.state.factor, step)[:, None]),
        )

    @property
    def time(self) -> Array:
        """(n,) when each row was read: by the clock if it never goes back, else by row number."""
        clock = self.problem.data.t_s
        if clock is not None and np.all(np.diff(clock) >= 0.0) and np.ptp(clock) > 0.0:
            return clock
        return np.arange(self.problem.data.n_rows, dtype=float)

    def forces(self) -> Iterator[tuple[Varying, Array]]:
        """A force that is linear in the position, and a spring, which pulls towards a point."""
        force = self.rates_by("external_wrench")[:, :3]
        yield (
            Varying.FORCE,
            in_units_of_noise(products(force, monomials(self.place, 1)[self.row])),
        )
        off = (self.place - self.place.mean(axis=0))[self.row]
        towards = np.sum(force * off, axis=1, keepdims=True)
        both = np.hstack([in_units_of_noise(force), in_units_of_noise(towards)])
        yield Varying.SPRING, in_units_of_noise(both)

    def lengths(self) -> Iterator[tuple[Varying, Array]]:
        """Cable lengths that go with the position, or with how far winches have turned."""
        lengths = self.rates_by("cable_length_offset")
        yield (
            Varying.LENGTHS,
            in_units_of_noise(products(lengths, monomials(self.place, 1)[self.row])),
        )
        bent = monomials(self.place, 2)[self.row, 1:]
        for k in range(lengths.shape[1]):
            yield Varying.ONE_CABLE, in_units_of_noise(products(lengths[:, [k]], bent))
        setup = self.state.prediction.setup
        turned = setup.commanded_change[:, setup.robot.driven]
        turned = (turned / max(float(np.abs(turned).max(initial=0.0)), 1e-300))[self.row]
        every = lengths[:, :, None] * np.stack([turned, turned**2, turned**3], axis=-1)
        # alike for all winches, and for each by itself
        yield Varying.WINCHES, in_units_of_noise(every.sum(axis=1))
        yield Varying.WINCHES, in_units_of_noise(every.reshape(len(every), -1))
        others = [np.roll(turned, k, axis=1) for k in range(1, turned.shape[1])]
        if not others:
            return
        # of two cables each has the other as its only neighbour
        beside = [others[0], others[-1]][: len(others)]
        alike = [np.sum(lengths * other, axis=1) for other in beside]
        yield Varying.COUPLED, in_units_of_noise(np.stack(alike, axis=1))
        if turned.shape[1] <= _MOST_CABLES:
            own = np.hstack([lengths * other for other in others])
            yield Varying.COUPLED, in_units_of_noise(own)

    def drifts(self) -> Iterator[tuple[Varying, Array]]:
        """Changes of the robot that are quadratic in the time."""
        time = monomials(self.time[:, None], 2, _SMOOTH)[self.row, 1:]
        for what, name in (
            (Varying.EXIT_POINTS_MOVE, "exit_point_error"),
            (Varying.LENGTHS_DRIFT, "cable_length_offset"),
            (Varying.FORCE_DRIFTS, "external_wrench"),
        ):
            yield what, in_units_of_noise(products(self.rates_by(name), time))


def per_channel(data: Data, shapes: Array, kind: int | None = None) -> Array:
    """(N, k) shapes (N, l) for each channel of readings by itself, or for those of one kind."""
    column, count = data.problem.column_of, shapes.shape[1]
    channels = np.unique(column if kind is None else column[data.chain.kind == kind])
    out = np.zeros((len(column), count * len(channels)))
    for k, channel in enumerate(channels):
        own = column == channel
        out[own, k * count : (k + 1) * count] = shapes[own]
    return out


def widening(place: Array) -> Array:
    """(n, 3, 16) how places (n, 3) move in a picture that widens about any point.

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


def products(columns: Array, shapes: Array) -> Array:
    """(N, k l) products of each column (N, k) with each shape (N, l)."""
    return np.asarray((columns[:, :, None] * shapes[:, None, :]).reshape(len(columns), -1))


def in_units_of_noise(columns: Array) -> Array:
    """Columns (N, k), scaled so that all together move a reading by its noise, in the rms."""
    power = float(np.sum(columns**2)) / max(len(columns), 1)
    return columns / np.sqrt(power) if power > 0.0 else columns


def detectable_size(fit: Fit) -> Rms | None:
    """The rms size, by kind of reading, from which on a smooth unknown effect would be seen.

    Fields over the workspace are drawn at random, all of one size in units of the noise. What the
    fit's effects can imitate is subtracted, and what is left earns evidence. The size is the median
    of fields of which nine in ten would be called unknown; None if none that was tried is seen.
    """
    data, problem = fit.data, fit.data.problem
    shapes = monomials(fit.state.prediction.pose[:, :3], 3)[problem.row_of]
    field, free = per_channel(data, shapes), fit.free
    random = np.random.default_rng(0)
    drawn = random.standard_normal((field.shape[1], _DRAWN))
    drawn /= np.sqrt(np.mean((field @ drawn) ** 2, axis=0))
    both = np.hstack([fit.jacobian[:, free] * fit.width[free], field])
    normal, p = fit.metric.normal(both, fit.state.white)[0], int(free.sum())
    inner = normal[:p, :p] + np.eye(p)
    left = normal[p:, p:] - normal[p:, :p] @ np.linalg.solve(inner, normal[:p, p:])
    power, axes = np.linalg.eigh(left)
    power = np.maximum(power, 0.0)[:, None]
    signal, noise = power * (axes.T @ drawn), np.sqrt(power) * random.standard_normal(drawn.shape)
    square = np.array(FIELD_WIDTHS)[:, None, None] ** 2
    for size in _SIZES:
        along = size * signal + noise
        grown = 1.0 + square * power
        gains = 0.5 * np.sum(square * along**2 / grown - np.log(grown), axis=1)
        odds = np.logaddexp.reduce(gains, axis=0) - np.log(len(gains))
        if np.quantile(odds, 1.0 - _SEEN) > -UNKNOWN:
            sigma = np.broadcast_to(problem.reading_sigma, problem.measured.shape)
            every = [_rms_of(data, sigma, size * (field @ one)) for one in drawn.T]
            return {
                key: None if every[0][key] is None else float(np.median([r[key] for r in every]))
                for key in every[0]
            }
    return None


def _rms_of(data: Data, sigma: Array, white: Array) -> Rms:
    """The rms by kind of readings (N,) in units of the stated noise."""
    table = np.full(data.problem.measured.shape, np.nan)
    table[data.problem.row_of, data.problem.column_of] = white
    return rms_by_kind(data.problem, sigma * table)
