"""Schemes of control in MuJoCo with time, beside what they come to at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.controlled.result import Control, Controlled
from seecr.counted import between, counted, rows_words
from seecr.pose import Array, pose_difference
from seecr.result import Record, Result, rows_of
from seecr.units import millimetres

# A platform that moves less than this [m], rotations times its length, in a period of its slowest
# vibration is at rest: what the suite allows after settling.
STILL_M, STILL_RAD = 1e-6, 1e-5


@dataclass(eq=False)
class Trace:
    """What happened, at k instants.

    Attributes:
        t: (k,) [s]. row: (k,) of the pose that it goes to. held: (k,) whether it is held there.
        told, paid: (k, m) [m] told lengths, and what winches have reached of them. pose: (k, 7).
        read: (k, 7) what the tracker reads, but for noise. tensions: (k, m) [N].
        ends: index of the last instant of each pose.
        ticks: errors (j, 6 + m) of the j readings that a feedback got, for each pose.
        speeds: of each pose, the platform's in the end [m/s], rotations times the robot's length.
    """

    t: Array
    row: Array
    held: Array
    told: Array
    paid: Array
    pose: Array
    read: Array
    tensions: Array
    ends: NDArray[np.int64]
    ticks: list[Array]
    speeds: Array


@dataclass(frozen=True, eq=False, repr=False)
class TimedScheme(Result):
    """One scheme in MuJoCo, at the rows (k,) for which it has a command.

    Attributes:
        trace: what happened. rest: what seecr.control says of it. rows: (k,) indices of the poses.
        period: [s] of the slowest vibration at home.
        frequencies: (k, d) [Hz] of the vibrations that seecr says where the platform rests.
    """

    trace: Trace
    rest: Controlled
    rows: NDArray[np.int64]
    period: float
    frequencies: Array

    @property
    def off(self) -> Array:
        """(k, 6) [m, rad] from where seecr says that it rests to where it is in the end."""
        return pose_difference(self.trace.pose[self.trace.ends], self.rest.solution.pose[self.rows])

    @property
    def error(self) -> Array:
        """(k, 6) [m, rad] from the wanted pose to where it is in the end."""
        there, wanted = self.trace.pose[self.trace.ends], self.rest.solution.command[self.rows]
        return pose_difference(there, wanted)

    @property
    def still(self) -> NDArray[np.bool_]:
        """(k,) whether it has come to rest."""
        return np.asarray(self.trace.speeds * self.period / (2.0 * np.pi) < STILL_M)

    @property
    def same(self) -> NDArray[np.bool_]:
        """(k,) whether it rests where seecr says, to the suite's thresholds."""
        away, turned = (np.linalg.norm(self.off[:, part], axis=1) for part in (_MOVED, _TURNED))
        return np.asarray(self.still & (away <= STILL_M) & (turned <= STILL_RAD))

    @property
    def overshoot(self) -> Array:
        """(k,) [m] by which it goes farthest beyond where it ends, while it is held there."""
        out = np.zeros(len(self.rows))
        for k, row in enumerate(self.rows):
            held = self.trace.held & (self.trace.row == row)
            away = self.trace.pose[held, :3] - self.trace.pose[self.trace.ends[k], :3]
            # the way there is no overshoot: what counts is on the other side of the end
            begins = away[0] if len(away) else np.zeros(3)
            along = begins / max(float(np.linalg.norm(begins)), 1e-300)
            out[k] = max(0.0, float(-(away @ along).min(initial=0.0)))
        return out

    @property
    def vibration(self) -> tuple[int, float] | None:
        """The pose (of k) where it vibrates most while it is held, and the frequency [Hz] of that.

        By the largest line of its spectrum, from when on the same cables pull as in the end: with
        others it has other frequencies. None with feedback, whose steps are no vibration, and where
        it moves less than what counts as rest.
        """
        if self.rest.radius is not None:
            return None
        found: tuple[float, int, float] = (STILL_M, -1, np.nan)
        for k, row in enumerate(self.rows):
            held = np.flatnonzero(self.trace.held & (self.trace.row == row))
            pulls = self.trace.tensions[held] > 0.0
            others = np.flatnonzero((pulls != pulls[-1]).any(axis=1))
            held = held[others[-1] + 1 if len(others) else 0 :]
            found = max(found, (*_swing(self.trace.t[held], self.trace.pose[held, :3], k),))
        return None if found[1] < 0 else (found[1], found[2])

    @property
    def growth(self) -> Array:
        """(k,) factor by which the errors that a feedback reads change per reading, over the last
        half of them; NaN without feedback.
        """
        return np.array([_growth(errors, self.rest.solution.robot.length)
                         for errors in self.trace.ticks])  # fmt: skip

    @property
    def diverges(self) -> NDArray[np.bool_]:
        """(k,) whether a feedback's errors grow."""
        return np.asarray(np.nan_to_num(self.growth) > 1.0)

    def place(self, some: NDArray[np.bool_]) -> str:
        """The names of some of the rows."""
        return rows_words(self.rows[some].tolist(), self.rest.solution.line)

    def lines(self) -> list[str]:
        """How far it is from where it should be, and from what it comes to without dynamics."""
        if not len(self.rows):
            return [f"{self.rest.scheme}: no command for any of the poses"]
        away, off = (np.linalg.norm(one[:, _MOVED], axis=1) for one in (self.error, self.off))
        n, same, lost = len(self.rows), self.same, self.diverges & ~self.same
        settled = self.rest.settled[self.rows]
        near = f"; {_mm(off[settled].max())} from seecr control" if settled.any() else ""
        out = [
            f"{self.rest.scheme}: error {_mm(away.max())} at most in the end, overshoot "
            f"{_mm(self.overshoot.max())}{near}"
        ]
        if (swing := self.vibration) is not None:
            k, rate = swing
            nearest = self.frequencies[k][np.argmin(np.abs(self.frequencies[k] - rate))]
            out.append(
                f"  vibrates at {rate:.3g} Hz; seecr says {nearest:.3g} Hz of its "
                f"{between(self.frequencies[k].min(), self.frequencies[k].max(), '.3g')} Hz there"
            )
        if same.all():
            out.append(f"  comes to rest where seecr says, at all {counted(n, 'pose')}")
        for some, words in (
            (lost, "the feedback diverges"),
            (~self.still & ~lost, "it still moves in the end: hold longer, or damp more"),
            (self.still & ~same & ~lost, "it rests elsewhere than seecr says"),
        ):
            if some.any():
                out.append(f"  {words} at {int(some.sum())} of {n}: {self.place(some)}")
        return out

    def records(self) -> list[Record]:
        """One row per pose."""
        radius = self.rest.radius
        return rows_of({
            "scheme": [self.rest.scheme] * len(self.rows), "pose": self.rows,
            "error_m": np.linalg.norm(self.error[:, _MOVED], axis=1),
            "error_rad": np.linalg.norm(self.error[:, _TURNED], axis=1),
            "from_rest_m": np.linalg.norm(self.off[:, _MOVED], axis=1),
            "from_rest_rad": np.linalg.norm(self.off[:, _TURNED], axis=1),
            "overshoot_m": self.overshoot, "still": self.still, "growth": self.growth,
            "spectral_radius": np.full(len(self.rows), np.nan) if radius is None
            else radius[self.rows],
            "slowest_Hz": self.frequencies[:, 0],
        })  # fmt: skip


_MOVED, _TURNED = slice(0, 3), slice(3, 6)


def _swing(t: Array, places: Array, row: int) -> tuple[float, int, float]:
    """The largest distance [m] of places (n, 3) from the last, row, and frequency [Hz] of that.

    It is the largest line in the spectrum of the velocities, since slow lags of winches have little
    of these; a parabola through the logarithms beside it says where in between it is.
    """
    if len(t) < 16:
        return 0.0, row, float("nan")
    away = float(np.linalg.norm(places - places[-1], axis=1).max())
    size = np.linalg.norm(np.fft.rfft(np.diff(places, axis=0), axis=0), axis=1)
    k = int(np.argmax(size[1:-1])) + 1
    if k == 1:  # it creeps with the winches, once
        return 0.0, row, float("nan")
    a, b, c = np.log(np.maximum(size[k - 1 : k + 2], 1e-300))
    shift = 0.5 * (a - c) / (a - 2.0 * b + c) if a + c < 2.0 * b else 0.0
    return away, row, float((k + shift) / (t[-1] - t[0]))


def _mm(size: float) -> str:
    """A length [m] in mm; what counts as rest is not told apart."""
    return f"under {1e3 * STILL_M:g} mm" if size < STILL_M else millimetres(size, 3)


def _growth(errors: Array, length: float) -> float:
    """The factor per reading over the last half of errors (k, 6 + m)."""
    if len(errors) < 4:
        return float("nan")
    size = np.linalg.norm(errors[:, :6] * np.repeat([1.0, length], 3), axis=1)
    half = len(size) // 2
    first, last = size[half // 2 : half].max(), size[-(half - half // 2) :].max()
    if not last > STILL_M:
        return 0.0
    return float((last / max(first, 1e-300)) ** (1.0 / half))


@dataclass(frozen=True, eq=False, repr=False)
class TimedControl(Result):
    """Several schemes in MuJoCo, with what they come to at rest.

    Attributes:
        at_rest: of seecr.control. schemes: results by name.
    """

    at_rest: Control
    schemes: Mapping[str, TimedScheme]

    def __getitem__(self, name: str) -> TimedScheme:
        return self.schemes[name]

    def lines(self) -> list[str]:
        """Those of each scheme."""
        n = len(self.at_rest.belief.commands)
        many = counted(len(self.schemes), "scheme")
        head = f"{self.at_rest.robot.name} in MuJoCo: {many} at {counted(n, 'pose')}"
        lines = [line for one in self.schemes.values() for line in one.lines()]
        return [head, *lines, *self.at_rest.notes]

    def records(self) -> list[Record]:
        """Those of each scheme."""
        return [row for one in self.schemes.values() for row in one.records()]
