"""Equilibria followed along a trajectory from the reference pose, and where the platform jumps.

An equilibrium moves smoothly with the rest lengths until it ceases to exist, in a fold or where a
cable goes slack; there the platform jumps to another one. The equilibrium is continued from
waypoint to waypoint. A step is halved until the equilibrium moves as its stiffness predicts
(Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapter 2); if the
platform moves far however small the step is, that is a jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands, Path, waypoints_of
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.effects.setup import Setup
from seecr.pose import Array, changes_between, moved_by
from seecr.statics import batch
from seecr.statics.batch import under_moment
from seecr.statics.solution import Jump, Solution, certify
from seecr.statics.starts import start_of
from seecr.statics.tables import Tables, assemble, take

# Steps of a platform along its coordinates: poses if it is free, else the values of its joints.


def evaluated(robot: Robot, tables: Tables, poses: Array) -> batch.Evaluation:
    """Gradient, stiffness and energy with the platform at poses (n, 7)."""
    at = batch.Evaluation.empty(len(poses), tables.cables.shape[1], tables.n_dof)
    start, values = start_of(robot, tables, poses)
    at.deviation[:] = start
    if values is not None:
        at.values[:] = values
    return batch.evaluate(tables, at)


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Poses of a free platform, or joint values: what steps are added to."""

    robot: Robot

    def of(self, poses: Array) -> Array:
        """(n, 7), or (n, d) [m, rad], of poses (n, 7)."""
        return values_of_pose(self.robot, poses)[0] if self.robot.joints else poses

    def poses(self, there: Array) -> Array:
        """(n, 7) of coordinates (n, ...)."""
        return pose_of_values(self.robot, there)[0] if self.robot.joints else there

    def moved(self, there: Array, steps: Array) -> Array:
        """Coordinates after steps (n, d) [m]; rotations in a step are times the robot's length."""
        change = steps * np.where(self.robot.hinges, 1.0 / self.robot.length, 1.0)
        return there + change if self.robot.joints else moved_by(there, change)

    def between(self, there: Array, before: Array) -> Array:
        """Steps (n, d) [m] from ``before`` to other coordinates."""
        change = there - before if self.robot.joints else changes_between(there, before)
        return np.asarray(change * np.where(self.robot.hinges, self.robot.length, 1.0))

    def evaluated(self, tables: Tables, there: Array, commanded: Array) -> batch.Evaluation:
        """Gradient, stiffness and energy; tables are of coordinates ``commanded`` (1, ...)."""
        if not self.robot.joints:
            return evaluated(self.robot, tables, there)
        at = batch.Evaluation.empty(len(there), tables.cables.shape[1], tables.n_dof)
        at.deviation[:] = batch.deviations(tables, self.poses(there))
        at.values[:] = self.between(there, commanded)
        return batch.evaluate(tables, at)


def moved(robot: Robot, poses: Array, step: Array) -> Array:
    """Poses (n, 7) after steps (n, d) [m]; rotations in a step are times the robot's length."""
    by = Coordinates(robot)
    return by.poses(by.moved(by.of(poses), step))


def step_between(robot: Robot, poses: Array, before: Array) -> Array:
    """Steps (n, d) [m] from ``before`` to ``poses`` (n, 7), rotations times the robot's length."""
    by = Coordinates(robot)
    if not robot.joints:
        return by.between(poses, before)
    values = by.of(np.concatenate([poses, before]))
    return by.between(values[: len(poses)], values[len(poses) :])


# Largest motion of the command between two waypoints, as a part of the robot's length.
_WAY = 0.05
# A step is smooth if the platform moves with its command to within the first number (times the
# robot's length), or to within the second if the stiffness predicts that motion to within the third
# (relative). The last number is the smallest part of the step to a waypoint that is tried.
_SMALL, _LARGE, _FORETOLD, _LEAST = 0.005, 0.05, 0.2, 2.0**-20
# Damping of rotations relative to translations with which the landing of a jump is computed. The
# result with the first one is used, the others show whether it is certain.
_DAMPINGS = (1.0, 0.1, 10.0)
# Flow after a fold: longest step [robot's length], residual at which it ends [load], most steps.
_FLOW, _STILL, _STEPS = 0.05, 1e-6, 2000
# Smallest inverse time step [N/m]: slack cables have no stiffness.
_LEAST_PACE = 1e-12
# Ridge: curvature that counts as flat [largest stiffness], and the push off it [robot's length].
_FLAT, _TOUCH = 1e-10, 1e-3


SetupOf = Callable[[Commands, NDArray[np.integer]], Setup]
"""Function of N waypoints and the row (N,) that each belongs to; returns their setup."""


def follow_commands(robot: Robot, commands: Commands, setup_of: SetupOf) -> Solution:
    """Follow the equilibrium of each run from the reference pose along the commanded path.

    ``setup_of`` gives the setup of N waypoints, from these and the row (N,) of each. If the
    platform finds no equilibrium after a jump, the waypoint is solved from its own command.
    """
    path = waypoints_of(robot, commands, waypoints=_WAY)
    tables = assemble(setup_of(path.commands, path.source))
    followed = _Followed(robot, path, tables, setup_of)
    found = batch.Evaluation.at_commands(tables)
    jumps: list[list[Jump]] = [[] for _ in range(len(commands))]
    state = None
    for k in range(len(tables)):
        jumped: list[Jump] = []
        last = None if path.fresh[k] else state
        now = followed.afresh(k) if last is None else followed.on(k, last, jumped)
        found.put(np.array([k]), now)
        state = now if now.at_rest[0] else None
        jumps[path.source[k]] += jumped
    solution = certify(robot, take(tables, path.rows), found.only(path.rows))
    return replace(solution, jumps=tuple(tuple(some) for some in jumps))


@dataclass(frozen=True, eq=False)
class _Followed:
    """N waypoints as tables, and the continuation from one to the next."""

    robot: Robot
    path: Path
    tables: Tables
    setup_of: SetupOf

    def afresh(self, k: int) -> batch.Evaluation:
        """Solve waypoint k from its command."""
        return batch.descend(self._at(k), threads=1)

    def on(self, k: int, state: batch.Evaluation, jumps: list[Jump]) -> batch.Evaluation:
        """Continue the equilibrium at waypoint k - 1 to waypoint k."""
        pose = batch.platform_poses(self._at(k - 1), state.deviation)
        along = self._along(k)
        done, size = 0.0, 1.0
        while done < 1.0:
            size = min(size, 1.0 - done)
            trial = self._between(k, done + size)
            # the start deviates from its command as much as the last equilibrium did
            start = moved(self.robot, pose, size * along)
            found = self._descended(trial, start, state.guess)
            if not self._smooth(trial, start, found):
                if size > _LEAST:
                    size *= 0.5
                    continue
                found = self._landed(trial, pose, state.guess, jumps)
                if not found.at_rest[0]:
                    return self.afresh(k)
            pose = batch.platform_poses(trial, found.deviation)
            state, done, size = found, done + size, 2.0 * size
        return state

    def _between(self, k: int, part: float) -> Tables:
        """The tables at a fraction of the step to waypoint k, on the commanded path itself.

        Interpolated rest lengths are off by micrometres, which may lead past the other side of a
        fold.
        """
        row, last, now = np.array([k]), self._at(k - 1), self._at(k)
        if part == 1.0:
            return now
        told, before = self.path.commands.rows(row), self.path.commands.rows(row - 1)
        pose = moved(self.robot, before.pose, part * self._along(k))
        lengths = None
        if told.lengths is not None and before.lengths is not None:
            lengths = (1.0 - part) * before.lengths + part * told.lengths
        told = replace(told, pose=pose, lengths=lengths)
        out = assemble(self.setup_of(told, self.path.source[row]))
        # load and scale are interpolated, so that a change of the load comes in gradually
        load, scale = ((1.0 - part) * a + part * b for a, b in (
            (last.load, now.load), (last.scale, now.scale),
        ))  # fmt: skip
        return replace(out, load=load, scale=scale)

    def _at(self, k: int) -> Tables:
        return take(self.tables, np.array([k]))

    def _along(self, k: int) -> Array:
        """The commanded step (1, d) to waypoint k."""
        return self._steps[k - 1 : k]

    @cached_property
    def _steps(self) -> Array:
        """The commanded steps (N - 1, d) from waypoint to waypoint."""
        poses = self.tables.poses
        return step_between(self.robot, poses[1:], poses[:-1])

    def _descended(self, trial: Tables, pose: Array, guess: Array) -> batch.Evaluation:
        start, values = start_of(self.robot, trial, pose)
        return batch.descend(
            trial, start, threads=1, start_values=values, staged=False, guess=guess
        )

    def _smooth(self, trial: Tables, pose: Array, found: batch.Evaluation) -> bool:
        if not found.at_rest[0]:
            return False
        step = step_between(self.robot, batch.platform_poses(trial, found.deviation), pose)[0]
        size, length = float(np.linalg.norm(step)), self.robot.length
        if size <= _SMALL * length:
            return True
        at = evaluated(self.robot, trial, pose)
        told = -np.linalg.lstsq(at.hessian[0], at.gradient[0], rcond=None)[0]
        off = float(np.linalg.norm(step - told))
        return size <= _LARGE * length and off <= _FORETOLD * size

    def _landed(
        self, trial: Tables, pose: Array, guess: Array, jumps: list[Jump]
    ) -> batch.Evaluation:
        """Where the platform comes to rest after a pose that is no longer an equilibrium."""
        ends, turns = [], []
        for damping in _DAMPINGS:
            there, over = _flow(self.robot, trial, pose, damping)
            ends.append(self._descended(trial, there, guess))
            turns.append(over)
        places = [batch.platform_poses(trial, end.deviation) for end in ends]
        first, after = ends[0], places[0][0] if ends[0].at_rest[0] else np.full(7, np.nan)
        apart = [np.abs(step_between(self.robot, one, places[0])).max() for one in places]
        same = all(end.at_rest[0] for end in ends) and max(apart) < _SMALL * self.robot.length
        near = apart_from(self.robot, places[0], pose) <= _SMALL * self.robot.length
        if first.at_rest[0] and near:
            return first
        energies = [evaluated(self.robot, trial, one).energy[0] for one in (pose, places[0])]
        if turns[0] and under_moment(trial)[0]:
            energies[0] = np.nan  # the work of a moment on full turns is left out of energies
        lost = energies[0] - energies[1] if first.at_rest[0] else np.inf
        jumps.append(Jump(trial.poses[0].copy(), pose[0], after, float(lost), same))
        return first


def rest_below(robot: Robot, tables: Tables, pose: Array) -> Array:
    """Where an overdamped platform comes to rest from a pose (1, 7); NaN if nowhere.

    Also if a moment turns it past half a turn: its energy is then another one.
    """
    there, over = _flow(robot, tables, pose, 1.0)
    if over and under_moment(tables)[0]:
        return np.full((1, 7), np.nan)
    start, values = start_of(robot, tables, there)
    found = batch.descend(tables, start, threads=1, start_values=values, staged=False)
    there = batch.platform_poses(tables, found.deviation)
    return there if found.at_rest[0] else np.full((1, 7), np.nan)


def _flow(robot: Robot, tables: Tables, pose: Array, damping: float) -> tuple[Array, bool]:
    """Follow an overdamped platform down its energy until it stands still, (1, 7).

    Also whether a hinge turned past half a turn, where its value begins anew. Steps are linearly
    implicit: short where the energy is steep, Newton steps in the end.
    """
    weight, over = np.where(robot.hinges, damping, 1.0), False
    at = evaluated(robot, tables, pose)
    for _ in range(_STEPS):
        if not np.isfinite(at.gradient).all():
            break
        # scaled so that the damping is the identity
        root = 1.0 / np.sqrt(weight)
        values, vectors = np.linalg.eigh(at.hessian[0] * root[:, None] * root[None, :])
        slope = vectors.T @ (at.gradient[0] * root)
        if at.residual[0] < _STILL:
            if values[0] > -_FLAT * values[-1]:
                break
            # balanced on a ridge: any disturbance makes the platform leave it
            pose, wraps = _stepped(robot, pose, _TOUCH * robot.length * (root * vectors[:, 0]))
            at, over = evaluated(robot, tables, pose), over or wraps
            continue
        # the inverse of the time step: soft and unstable directions must not outrun the stiff ones
        pace = max(2.0 * max(-float(values[0]), 0.0), 1e-9 * float(values[-1]), _LEAST_PACE)
        while True:
            parts = slope / (values + pace)
            step = -root * (vectors @ parts)
            if np.linalg.norm(step) <= _FLOW * robot.length:
                there, wraps = _stepped(robot, pose, step)
                then = evaluated(robot, tables, there)
                # It goes down by the work along the step. Where a cable goes slack, a Newton step
                # may lead up, and the next one back, for ever.
                if not (at.gradient[0] + then.gradient[0]) @ step > 0.0:
                    break
            # with what the step met as stiffness, it becomes half as long or less
            pace = max(2.0 * pace, float(np.linalg.norm(slope) / np.linalg.norm(parts)))
        pose, at, over = there, then, over or wraps
    return pose, over


def _stepped(robot: Robot, pose: Array, step: Array) -> tuple[Array, bool]:
    """The pose (1, 7) after a step (d,), and whether a hinge's value jumped by a turn in it."""
    after = moved(robot, pose, step[None])
    if not robot.joints:
        return after, False
    jumped = np.abs(step_between(robot, after, pose)[0] - step)[robot.hinges]
    return after, bool(np.any(jumped > np.pi * robot.length))


def apart_from(robot: Robot, pose: Array, other: Array) -> float:
    """Distance of two poses (1, 7) [m]; rotations count times the robot's length."""
    return float(np.linalg.norm(step_between(robot, pose, other)))
