"""A scheme on the true robot, step by step: it turns winches, the robot rests, sensors read.

The reading of a step is used d steps later. Each wanted pose has a loop of its own, that begins
with what is fed forward there. About where it settles it is linearised: its state x changes by the
error of a reading that is d steps old, x(k+1) = x(k) - g M x(k-d), and falls apart into one such
loop for each eigenvalue of M.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.controlled.belief import Belief
from seecr.controlled.plant import Plant, Rows
from seecr.controlled.schemes import Feedback, Scheme
from seecr.description.robot import ABSURD, Robot
from seecr.inverse.lengths import REACHED
from seecr.pose import Array
from seecr.statics.solution import Solution

Complex = NDArray[np.complex128]

# Eigenvalues smaller than this are zero but for rounding: an exact model has eigenvalue one.
_NEUTRAL = 1e-9
# Steps of Newton's method to where a loop would settle.
_NEWTON = 40
# A loop is settled when its commands change by no more than this many standard deviations of what
# noise makes of them: one in a million is larger by chance.
_SIGMAS = 5.0
# It goes on until they change by less than this part of that, for its last digits.
_FINE = 1e-3
# Singular values below this part of the largest are rounding.
_SMALL = 1e-9


def loop_eigenvalues(matrix: Array, states: Array) -> Complex:
    """Eigenvalues (r,) of a loop M (k, k) for the states that its controller ever has.

    Args:
        matrix: M. states: (k, k) whose columns span these states.
    """
    left, sizes, _right = np.linalg.svd(states)
    basis = left[:, sizes > _NEUTRAL * max(float(sizes.max(initial=0.0)), 1e-300)]
    return np.asarray(np.linalg.eigvals(basis.T @ matrix @ basis), dtype=complex)


def spectral_radius(eigenvalues: Complex, gain: float, delay: int) -> float:
    """The factor by which errors change per step in the end: below one the loop settles.

    It is the largest root of z^(d+1) - z^d + g lambda = 0, over all eigenvalues.

    Args:
        eigenvalues: (r,) of M. gain: g. delay: d, in steps.
    """
    largest = 0.0
    for value in eigenvalues:
        polynomial = np.zeros(delay + 2, dtype=complex)
        polynomial[:2] = 1.0, -1.0
        polynomial[-1] += gain * value
        largest = max(largest, float(np.abs(np.roots(polynomial)).max(initial=0.0)))
    return largest


def largest_gain(eigenvalues: Complex, delay: int) -> float:
    """The gain below which the loop settles; zero if it does with none.

    A root leaves the unit circle at z = exp(i theta), where g lambda = z^d (1 - z). Its argument
    gives theta = (pi/2 - |arg lambda|)/(d + 1/2), and its size g = 2 sin(theta/2)/|lambda|. For
    lambda = 1 that is 2 sin(pi/(4 d + 2)) (Levin and May, Theoretical Population Biology 9, 1976).
    """
    room = 0.5 * np.pi - np.abs(np.angle(eigenvalues))
    size = np.abs(eigenvalues)
    if np.any(size <= _NEUTRAL) or np.any(room <= 0.0):
        return 0.0
    return float(np.min(2.0 * np.sin(room / (2 * delay + 1)) / size, initial=np.inf))


def largest_delay(eigenvalues: Complex, gain: float) -> int:
    """The most steps of delay with which a gain holds; -1 if it holds with none, or any do.

    The bound of :func:`largest_gain`, solved for the delay.
    """
    if len(eigenvalues) == 0 or not gain < largest_gain(eigenvalues, 0):
        return -1
    room = 0.5 * np.pi - np.abs(np.angle(eigenvalues))
    most = 0.5 * (room / np.arcsin(0.5 * gain * np.abs(eigenvalues)) - 1.0)
    return int(np.ceil(np.min(most))) - 1


@dataclass(frozen=True)
class Tuning:
    """How a feedback runs: gain, steps of delay, most steps, and parts of the pose that are read.

    Attributes:
        seen: (6,) of position and orientation.
    """

    gain: float
    delay: int
    steps: int
    seen: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class Course:
    """What a scheme did at n wanted poses.

    Attributes:
        told: (n, m) [m] last told lengths; NaN where the scheme has no command.
        solution: (n,) where that led.
        error: (k + 1, n, 6 + m) of the readings, but for noise, after each step; NaN after the end.
        steps: (n,) that the loop took until it was settled; -1 where it did not.
        travel: (n, m) [m] of rope that each winch wound at this row and on the way to it: of a
            block and tackle, with all its falls.
        eigenvalues: of the loop where it settles, for each row; None where no lengths hold the pose
            and for schemes without feedback.
    """

    told: Array
    solution: Solution
    error: Array
    steps: NDArray[np.int64]
    travel: Array
    eigenvalues: tuple[Complex | None, ...]


class Loop:
    """The feedbacks of a scheme at all n wanted poses, with what they believe.

    Attributes:
        gains: G (n, k, 6 + m) of all feedbacks together.
        rest: (n, k) the state that changes nothing. start: that at first: the same, or that of the
            reference pose for a loop alone.
    """

    def __init__(self, scheme: Scheme, belief: Belief, tuning: Tuning) -> None:
        self.scheme, self.belief, self.tuning = scheme, belief, tuning
        loops, seen = scheme.feedbacks, np.array(tuning.seen)
        self.gains = np.concatenate([one.gains(belief, seen) for one in loops], axis=1)
        each = [one.rest(belief) for one in loops]
        self.rest = np.concatenate(each, axis=1)
        self._by_tension = bool(self.gains[..., 6:].any())
        self._ends = np.cumsum([one.shape[1] for one in each])[:-1]
        self.start = self.rest
        if scheme.from_home:
            self.start = np.concatenate([one.start(belief) for one in loops], axis=1)

    def change(self, state: Array) -> Array:
        """(n, m) [m] of the told lengths in a state (n, k)."""
        return np.asarray(sum(one.change(self.belief, part) for one, part in self._parts(state)))

    def rates(self, state: Array) -> Array:
        """B (n, m, k), of the told lengths by the state (n, k)."""
        each = [one.rates(self.belief, part) for one, part in self._parts(state)]
        return np.concatenate(each, axis=2)

    def _parts(self, state: Array) -> Iterator[tuple[Feedback, Array]]:
        parts = np.split(state, self._ends, axis=1)
        return zip(self.scheme.feedbacks, parts, strict=True)

    def error(self, readings: tuple[Array, Array], rows: Rows) -> Array:
        """(r, 6 + m) [m, rad, N] of readings of rows (r,)."""
        return self.belief.error(*readings, rows, self._by_tension)

    def matrices(self, by_told: Array, rows: Rows, state: Array) -> Array:
        """M = G S B (r, k, k) of rows (r,), with S (r, 6 + m, m) of the readings by told lengths.

        The loop is x <- x - gain M x, about where it settles, a state (n, k).
        """
        return np.asarray(self.gains[rows] @ by_told @ self.rates(state)[rows])

    def eigenvalues(self, by_told: Array, rows: Rows, state: Array) -> list[Complex]:
        """Of these matrices, for the states that a row's loop ever has."""
        pairs = zip(self.matrices(by_told, rows, state), self.gains[rows], strict=True)
        return [loop_eigenvalues(*pair) for pair in pairs]

    def quiet(self, noise: Array) -> Array:
        """(n,) [m] by which told lengths may change in a loop that is settled.

        Args:
            noise: (6 + m,) one standard deviation of the readings.
        """
        moves = self.tuning.gain * (self.rates(self.rest) @ self.gains) * noise
        each = np.linalg.norm(moves, axis=2).max(axis=1)
        return np.asarray(np.maximum(REACHED, _SIGMAS * each))


def can_be_told(robot: Robot, lengths: Array) -> NDArray[np.bool_]:
    """(n,) whether winches can pay out lengths (n, m) [m]: some, and not ten times the frame."""
    known = (lengths > 0.0) & (lengths < ABSURD * robot.reach)
    return np.asarray((known | ~robot.driven).all(axis=1))


def loop_of(scheme: Scheme, belief: Belief, commands: Commands, tuning: Tuning) -> Loop | None:
    """The loop of a scheme about what it feeds forward; None without feedback."""
    return Loop(scheme, belief.aiming_at(commands.pose), tuning) if scheme.feedbacks else None


def run(scheme: Scheme, belief: Belief, plant: Plant, tuning: Tuning) -> Course:
    """What a scheme does at the wanted poses of a belief, on a true robot."""
    commands, found = scheme.forward.commands(belief)
    robot, n = belief.robot, len(belief.commands)
    forward = robot.rest_lengths + commands.change(robot)
    told = np.where(found[:, None], forward, np.nan)
    loop = loop_of(scheme, belief, commands, tuning)
    first, turned, pose = told.copy(), np.zeros_like(told), belief.commands.pose.copy()
    error = np.full((tuning.steps + 1 if loop else 0, n, 6 + robot.n_cables), np.nan)
    steps, values = np.where(found, 0 if loop is None else -1, -1), dict[int, Complex | None]()
    rows = np.flatnonzero(found)
    for at in [] if loop is None else _groups(rows, plant):
        assert loop is not None
        track = _Track(loop, plant, told, at)
        first[at] = track.told
        track.go()
        told[at], steps[at], turned[at] = track.told, track.steps(), track.turned
        pose[at] = track.pose()
        error[: len(track.errors), at] = np.array(track.errors)
        values |= track.eigenvalues()
    home = np.where(np.isnan(told), forward, told)
    turned += np.abs(first - belief.commands.before(home, robot.rest_lengths))
    solution = plant.led(commands, found) if loop is None else plant.solution(told, pose)
    every = tuple(values.get(k) for k in range(n))
    return Course(told, solution, error, steps, robot.falls * turned, every)


def _groups(rows: Rows, plant: Plant) -> list[Rows]:
    """Rows whose loops run together: with history each begins where the one before ended."""
    return [np.array([row]) for row in rows] if plant.has_history else [rows][: len(rows)]


class _Track:
    """The steps of some rows (r,) together.

    Attributes:
        told: (r, m) [m] now. rest: where that led. turned: (r, m) [m] by steps, to and fro.
        errors: (r, 6 + m) after each step, without noise.
    """

    def __init__(self, loop: Loop, plant: Plant, forward: Array, rows: Rows) -> None:
        self.loop, self.plant, self.rows = loop, plant, rows
        self.forward = forward[rows]
        self.wanted = plant.commands.pose[rows]
        self.turned, self.last = np.zeros_like(self.forward), np.zeros(len(rows), dtype=np.int64)
        self.ended = np.zeros(len(rows), dtype=bool)
        self.state = loop.start.copy()
        self.told = self._told()
        home = np.broadcast_to(plant.robot.reference_pose, self.wanted.shape)
        self.rest = plant.rest(rows, self.told, home if loop.scheme.from_home else self.wanted)
        self.errors = [loop.error(self.rest.readings, rows)]

    def _told(self) -> Array:
        return np.asarray(self.forward + self.loop.change(self.state)[self.rows])

    def go(self) -> None:
        """All steps, until nothing changes any more."""
        loop, tuning, rows = self.loop, self.loop.tuning, self.rows
        noise = self.plant.noise.of(self.plant.robot.n_cables)
        quiet = loop.quiet(noise)[rows]
        read: list[Array] = []
        moved = 0
        for step in range(1, tuning.steps + 1):
            read.append(loop.error(self.plant.noisy(*self.rest.readings), rows))
            before = self.told
            if len(read) > tuning.delay:
                self._turn(read[-1 - tuning.delay])
            change = np.abs(self.told - before)
            self.turned += change
            self.last[change.max(axis=1) > quiet] = step
            moved = step if np.any(change.max(axis=1) > _FINE * quiet) else moved
            self.rest = self.plant.rest(rows, self.told, self.pose())
            self.errors.append(loop.error(self.rest.readings, rows))
            if not noise.any() and step - moved > tuning.delay:
                return

    def _turn(self, error: Array) -> None:
        """Change the state by an error (r, 6 + m) as it was read.

        Rows that do not rest stay, and those whose winches have come to an end.
        """
        going = self.rest.at_rest & np.isfinite(error).all(axis=1) & ~self.ended
        by = (self.loop.gains[self.rows] @ np.where(going[:, None], error, 0.0)[..., None])[..., 0]
        before = self.state[self.rows].copy()
        self.state[self.rows] -= self.loop.tuning.gain * by
        self.ended |= ~can_be_told(self.plant.robot, self._told())
        self.state[self.rows[self.ended]] = before[self.ended]
        self.told = self._told()

    def pose(self) -> Array:
        """Where rows (r, 7) are, or are wanted where they rest nowhere."""
        pose = self.rest.pose
        known = np.asarray(np.isfinite(pose).all(axis=1))
        return np.where(known[:, None], pose, self.wanted)

    def steps(self) -> NDArray[np.int64]:
        """(r,) steps until settled, -1 where the loop is not."""
        settled = (len(self.errors) - 1 - self.last > self.loop.tuning.delay) & self.rest.at_rest
        return np.where(settled & ~self.ended, self.last, -1)

    def eigenvalues(self) -> dict[int, Complex | None]:
        """Of each row's loop where it would settle, by row; Newton's method leads there."""
        loop, rows, kept = self.loop, self.rows, (self.state.copy(), self.told)
        gains, rest, pose = loop.gains[rows], self.rest, self.pose()
        lost = self.steps() < 0  # from where those have come, no way may lead back
        self.state[rows[lost]], pose[lost] = loop.start[rows[lost]], self.wanted[lost]
        self.told = self._told()
        range_of = gains @ np.linalg.pinv(gains, rcond=_SMALL)
        for _ in range(_NEWTON):
            rest = self.plant.rest(rows, self.told, pose, keep=False)
            error = loop.error(rest.readings, rows)
            fine = np.asarray(rest.at_rest & np.isfinite(error).all(axis=1))
            pose[fine] = rest.pose[fine]
            off = (gains @ np.where(fine[:, None], error, 0.0)[..., None])[..., 0]
            by_told = np.where(fine[:, None, None], rest.by_told, 0.0)
            matrix = range_of @ loop.matrices(by_told, rows, self.state) @ range_of
            step = (np.linalg.pinv(matrix, rcond=_SMALL) @ off[..., None])[..., 0]
            self.state[rows] -= step
            before, self.told = self.told, self._told()
            left = (off[..., None] - matrix @ step[..., None])[..., 0]
            near = fine & (np.abs(self.told - before).max(axis=1) < REACHED)
            near &= np.abs(left).max(axis=1) < REACHED
            if near.all() or not fine.any():
                break
        found = loop.eigenvalues(by_told, rows, self.state)
        self.state, self.told = kept
        return {int(r): e if ok else None for r, e, ok in zip(rows, found, near, strict=True)}
