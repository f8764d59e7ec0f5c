"""The true robot, as a controller meets it: told lengths in, readings out, always at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.compiled.columns import TENSION
from seecr.controlled.belief import readings_by_told
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.pose import Array, moved_by
from seecr.prediction.experiment import Experiment, Prediction, read, sensors_among
from seecr.statics import batch
from seecr.statics.solution import Solution
from seecr.statics.starts import start_of
from seecr.statics.tables import assemble

_LIMIT = 400  # evaluations of the wrench per pose

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class SensorNoise:
    """One standard deviation of a reading: position [m], orientation [rad], tension [N]."""

    position: float = 0.0
    orientation: float = 0.0
    tension: float = 0.0
    seed: int = 0

    def of(self, cables: int) -> Array:
        """(6 + m,) [m, rad, N] of all readings."""
        sizes = (self.position, self.orientation, self.tension)
        return np.repeat(np.array(sizes, float), (3, 3, cables))


@dataclass(eq=False)
class Plant:
    """A robot with its true effects and n wanted poses, at which it may be told other lengths.

    With history, rows must be visited in their order: all that a run was told before counts. Steps
    take no time, so that creep goes by the times of the rows alone.

    Attributes:
        robot: as described. effects: that it really has. commands: the wanted poses.
        noise: of its readings.
    """

    robot: Robot
    effects: Sequence[Effect]
    commands: Commands
    noise: SensorNoise = SensorNoise()
    _past: list[tuple[int, Array]] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.noise.seed)
        setup = Experiment(self.robot, self.commands).setup(self.effects)
        self.has_history = setup.has_history
        self._by_law = bool(setup.laws)

    def rest(self, rows: Rows, told: Array, start: Array, keep: bool = True) -> AtRest:
        """Where rows (k,) rest with told lengths (k, m) [m], released at poses (k, 7).

        Args:
            rows: in their order, where there is history. told: what the winches are told.
            start: where the platform was; not used with history.
            keep: whether this becomes part of the past.
        """
        if self.has_history:
            past = [*self._past, *zip(rows.tolist(), told, strict=True)]
            if keep:
                self._past = past
            which, lengths = np.array([row for row, _ in past]), np.array([at for _, at in past])
            whole = self._told(which, lengths).predict(self.effects)
            return AtRest(self, whole, np.arange(len(past))[-len(rows) :])
        experiment, every = self._told(rows, told), np.arange(len(rows))
        if self._by_law:
            return AtRest(self, experiment.predict(self.effects), every)
        setup = experiment.setup(self.effects)
        tables = assemble(setup)
        first, values = start_of(self.robot, tables, start)
        found = batch.descend(tables, first, _LIMIT, start_values=values)
        pose = batch.platform_poses(tables, found.deviation)
        seen = read(self.effects, setup, pose, found.states[..., TENSION])
        sensors = sensors_among(self.effects)
        at = Prediction(setup, tables, found, seen, False, sensors, kept={"pose": pose})
        return AtRest(self, at, every)

    def led(self, commands: Commands, found: NDArray[np.bool_]) -> Solution:
        """Where n commands lead, one after the other; NaN where there is none (n,)."""
        if commands.lengths is not None or np.any(commands.pose != self.commands.pose):
            lengths = self.robot.rest_lengths + commands.change(self.robot)
            rigid = self.robot.commanded_lengths(self.commands.pose)
            lengths = np.where(found[:, None], lengths, rigid)
            commands = replace(commands, lengths=lengths, told=True)
        wanted = replace(commands, pose=self.commands.pose)
        return self._blank(Experiment(self.robot, wanted).predict(self.effects).solution(), found)

    def solution(self, told: Array, poses: Array) -> Solution:
        """All n rows, certified, with their last told lengths (n, m) [m]; poses (n, 7) are where.

        Rows without lengths are NaN.
        """
        found = np.asarray(np.isfinite(told).all(axis=1))
        if self.has_history:
            which = [row for row, _ in self._past]
            last = {row: k for k, row in enumerate(which)}
            whole = self._told(np.array(which), np.array([at for _, at in self._past]))
            at = [last.get(row, 0) for row in range(len(told))]
            out = whole.predict(self.effects).solution().rows(at)
        else:
            rigid = self.robot.commanded_lengths(self.commands.pose)
            lengths = np.where(found[:, None], told, rigid)
            out = self.rest(np.arange(len(told)), lengths, poses).solution
        return self._blank(out, found)

    def _blank(self, out: Solution, found: NDArray[np.bool_]) -> Solution:
        """The rows of the wanted poses, without an answer where there was no command (n,)."""
        names = ("command", "pose", "deviation", "tensions", "rest_lengths")
        blank = {name: getattr(out, name).copy() for name in names}
        for name, values in blank.items():
            values[~found] = np.nan if name != "command" else self.commands.pose[~found]
        return replace(out, line=self.commands.line, **blank)

    def read(self, solution: Solution) -> Array:
        """What the tracker reads (n, 7) of poses at rest, but for noise."""
        setup = Experiment(self.robot, self.commands).setup(self.effects)
        pulls = solution.tensions * self.robot.falls
        seen = read(self.effects, setup, solution.pose, pulls)
        return np.concatenate([seen.position, seen.quat_wxyz], axis=1)

    def _told(self, rows: Rows, told: Array) -> Experiment:
        return Experiment(self.robot, replace(self.commands.rows(rows), lengths=told, told=True))

    def noisy(self, poses: Array, tensions: Array) -> tuple[Array, Array]:
        """Readings, poses (k, 7) and tensions (k, m) [N], with noise."""
        size = self.noise.of(self.robot.n_cables)
        if not size.any():
            return poses, tensions
        off = self._random.normal(size=(len(poses), len(size))) * size
        return moved_by(poses, off[:, :6]), tensions + off[:, 6:]


@dataclass(frozen=True, eq=False)
class AtRest:
    """Where some rows (k,) of a plant came to rest: the last of a path, or all of a batch."""

    plant: Plant
    at: Prediction
    rows: Rows

    @property
    def pose(self) -> Array:
        """(k, 7) of the platform."""
        return self.at.pose[self.rows]

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """(k,) whether it is a stable equilibrium."""
        return self.at.solved[self.rows]

    @property
    def readings(self) -> tuple[Array, Array]:
        """What is read but for noise: poses (k, 7) and tensions (k, m) [N]."""
        seen = self.at.readings
        pose = np.concatenate([seen.position, seen.quat_wxyz], axis=1)
        return pose[self.rows], seen.tensions[self.rows]

    @property
    def by_told(self) -> Array:
        """Derivatives (k, 6 + m, m) of the readings by told lengths."""
        return readings_by_told(self.plant.robot, self.plant.effects, self.at)[self.rows]

    @property
    def solution(self) -> Solution:
        """The rows, certified."""
        return self.at.solution().rows(self.rows)
