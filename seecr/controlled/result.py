"""What schemes of control did: errors, tensions, steps, and whether their loops hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.controlled.belief import Belief
from seecr.controlled.loop import (
    Complex,
    Course,
    Tuning,
    largest_delay,
    largest_gain,
    spectral_radius,
)
from seecr.controlled.schemes import Scheme
from seecr.counted import between, counted, rows_words
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.result import COORDINATES, MOTION, Record, Result, named, rows_of
from seecr.statics.solution import Solution
from seecr.units import millimetres, short

# A tension beyond its limit by less than this part of the load is rounding.
_ROUNDING = 1e-6
# A spectral radius as near to one as this is one.
_NEUTRAL = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Controlled(Result):
    """What one scheme did at n wanted poses.

    Attributes:
        scheme: its name.
        solution: where the true robot rests in the end; ``command`` is the wanted pose, and
            ``deviation`` (n, 6) [m, rad] the error. NaN where the scheme has no command.
        told: (n, m) [m] last told lengths; NaN where there are none.
        believed, read: (n, 7) where the believed robot would rest with these lengths, and what the
            tracker reads at the end, but for noise.
        within: (n,) whether tensions are within the limits.
        settled: (n,) whether the platform rests and, with feedback, the loop has settled.
        steps: (n,) that took, zero without feedback; -1 where it did not.
        travel: (n, m) [m] of rope that each winch wound on the way to the row and at it, to and
            fro; of a block and tackle, with all its falls.
        radius: (n,) spectral radius of the linearised loop where it settles; below 1 it does. None
            without feedback, NaN at a pose that no lengths of the scheme hold.
        gain, delay: (n,) the largest with which it holds, delays in steps: -1 where it holds with
            none; None without feedback.
        history: (k, n, 6 + m) [m, rad, N] errors of the readings, but for noise, after each step.
    """

    scheme: str
    solution: Solution
    told: Array
    believed: Array
    read: Array
    within: NDArray[np.bool_]
    settled: NDArray[np.bool_]
    steps: NDArray[np.int64]
    travel: Array
    radius: Array | None
    gain: Array | None
    delay: NDArray[np.int64] | None
    history: Array

    @classmethod
    def of(
        cls, scheme: Scheme, course: Course, seen: tuple[Array, Array],
        limits: tuple[Array, Array], tuning: Tuning,
    ) -> Controlled:  # fmt: skip
        """Of a course, with the poses that are believed and those that are read."""

        def of_loops(number: Callable[[Complex], float]) -> Array:
            """(n,) numbers; NaN where there is no loop that could settle."""
            return np.array([np.nan if e is None else number(e) for e in course.eigenvalues])

        solution, loops = course.solution, bool(scheme.feedbacks)
        radius = of_loops(lambda e: spectral_radius(e, tuning.gain, tuning.delay))
        room = _ROUNDING * solution.tables.scale[:, None]
        pulls = (solution.tensions * solution.robot.falls)[:, solution.robot.driven]
        low, high = limits[0] - room, limits[1] + room
        within = np.asarray(((pulls >= low) & (pulls <= high)).all(axis=1))
        rests = solution.converged & np.isfinite(solution.pose).all(axis=1)
        delays = np.nan_to_num(of_loops(lambda e: largest_delay(e, tuning.gain)), nan=-1.0)
        return cls(
            scheme.name, solution, course.told, *seen, within,
            rests & (course.steps >= 0) & ~(radius > 1.0 + _NEUTRAL), course.steps, course.travel,
            radius if loops else None,
            of_loops(lambda e: largest_gain(e, tuning.delay)) if loops else None,
            delays.astype(np.int64) if loops else None, course.error,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.told)

    def commands(self) -> Commands:
        """The last told lengths as commands for the wanted poses."""
        return Commands(self.solution.command, lengths=self.told, told=True)

    @property
    def rests(self) -> NDArray[np.bool_]:
        """(n,) whether the platform is at rest in the end."""
        return self.solution.converged & np.isfinite(self.solution.pose).all(axis=1)

    def _rms(self, part: slice) -> float | None:
        errors = self.solution.deviation[self.rests, part]
        return float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else None

    @property
    def position_rms(self) -> float | None:
        """Root mean square [m] of the distances from the wanted positions, over poses at rest."""
        return self._rms(slice(0, 3))

    @property
    def orientation_rms(self) -> float | None:
        """The same of the angles [rad] from the wanted orientations."""
        return self._rms(slice(3, 6))

    def place(self, rows: NDArray[np.bool_]) -> str:
        """The names of some rows."""
        return rows_words(np.flatnonzero(rows).tolist(), self.solution.line)

    def lines(self) -> list[str]:
        """Errors, tensions, and where something does not hold."""
        n, rests = len(self), self.rests
        out = [self._errors()]
        if rests.any():
            driven = self.solution.robot.driven
            pulls, slack = (
                one[rests][:, driven] for one in (self.solution.tensions, self.solution.slack)
            )
            most = int(slack.sum(axis=1).max())
            said = f"  tensions {between(max(pulls.min(), 0.0), pulls.max(), '.3g')} N"
            if most:
                said += f", up to {counted(most, 'cable')} slack"
            out.append(f"{said}; winches turn by {short(self.travel[rests].sum(), 3)} m in all")
        for rows, words in (
            (~rests, "the platform does not come to rest"),
            (rests & ~self.within, "tensions are beyond the limits"),
        ):
            if rows.any():
                out.append(f"  {words} at {int(rows.sum())} of {n}: {self.place(rows)}")
        return out + (self._loop_lines() if self.radius is not None else [])

    def _errors(self) -> str:
        position, turn = self.position_rms, self.orientation_rms
        if position is None or turn is None:
            return f"{self.scheme}: the platform rests at no pose"
        at = self.solution.deviation[self.rests]
        far = float(np.linalg.norm(at[:, :3], axis=1).max())
        turned = np.degrees(float(np.linalg.norm(at[:, 3:], axis=1).max()))
        return (
            f"{self.scheme}: error {millimetres(position, 3)} rms, {millimetres(far, 3)} at most; "
            f"{short(np.degrees(turn), 3)} deg rms, {short(turned, 3)} at most"
        )

    def _loop_lines(self) -> list[str]:
        """How the loops settle, and what they stand."""
        assert self.radius is not None and self.gain is not None and self.delay is not None
        known, done = np.isfinite(self.radius), self.settled
        neutral = np.abs(self.radius - 1.0) < _NEUTRAL
        holds = known & (self.radius < 1.0) & ~neutral
        out = []
        if done.any():
            steps = between(self.steps[done].min(), self.steps[done].max(), "d")
            out.append(f"  settles at {int(done.sum())} of {len(self)} after step {steps}")
        if holds.any():
            radius = between(self.radius[holds].min(), self.radius[holds].max(), ".3f")
            most = int(self.delay[holds].min())
            out.append(
                f"  each step leaves {radius} of an error (spectral radius); gains below "
                f"{self.gain[holds].min():.3g} hold, and delays of up to {counted(most, 'step')}"
            )
        for rows, words in (
            (known & ~holds & ~neutral, "the loop does not hold (spectral radius above 1)"),
            (neutral, "lengths do not change a part of the error (spectral radius 1)"),
            (~known & self.rests, "no lengths were found that hold the pose: the loop winds on"),
            (holds & ~done & self.rests, "the loop would hold, but has not settled yet"),
        ):
            if rows.any():
                out.append(f"  {words} at {int(rows.sum())}: {self.place(rows)}")
        return out

    def records(self) -> list[Record]:
        """One row per pose: errors, tensions, told lengths."""
        driven = np.flatnonzero(self.solution.robot.driven)
        cables = range(self.solution.robot.n_cables)
        m, winches = ([str(k + 1) for k in some] for some in (cables, driven))
        none = np.full(len(self), np.nan)
        return rows_of({
            "scheme": [self.scheme] * len(self),
            **named("want_{}", COORDINATES, self.solution.command),
            **named("pose_{}", COORDINATES, self.solution.pose),
            **named("error_{}", MOTION, self.solution.deviation),
            **named("length_{}_m", winches, self.told[:, driven]),
            **named("tension_{}_N", m, self.solution.tensions),
            "slack": self.solution.slack.sum(axis=1),
            "within_limits": self.within, "settled": self.settled, "steps": self.steps,
            "spectral_radius": none if self.radius is None else self.radius,
            **named("travel_{}_m", winches, self.travel[:, driven]),
        })  # fmt: skip

    def head_json(self) -> Record:
        """Everything but the rows, as in ``control.json``."""
        lost = None if self.delay is None else [None if d < 0 else int(d) for d in self.delay]
        return {
            "position_rms_m": self.position_rms,
            "orientation_rms_rad": self.orientation_rms,
            "spectral_radius": self.radius,
            "largest_gain": self.gain,
            "largest_delay_steps": lost,
            "settled": self.settled,
            "steps": [None if one < 0 else int(one) for one in self.steps],
            "within_limits": self.within,
            "winch_travel_m": self.travel,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Control(Result):
    """What several schemes did with the same robot at the same poses.

    Attributes:
        robot: as described. schemes: results by name, in the order asked for.
        asked: these schemes. belief, tuning: what their controllers know, and how loops run.
        notes: sentences.
    """

    robot: Robot
    schemes: Mapping[str, Controlled]
    asked: tuple[Scheme, ...]
    belief: Belief
    tuning: Tuning
    notes: Sequence[str] = ()

    def __getitem__(self, name: str) -> Controlled:
        return self.schemes[name]

    def lines(self) -> list[str]:
        """Those of each scheme."""
        n = len(next(iter(self.schemes.values())))
        head = f"{self.robot.name}: {counted(len(self.schemes), 'scheme')} at {counted(n, 'pose')}"
        return [head, *(line for one in self.schemes.values() for line in one.lines()), *self.notes]

    def records(self) -> list[Record]:
        """Those of each scheme."""
        return [row for one in self.schemes.values() for row in one.records()]
