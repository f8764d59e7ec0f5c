"""A robot, its commands and its effects: predicted readings, row by row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands, Path, waypoints_of
from seecr.compiled.columns import CONVERGED, ITERATIONS, SINGULAR, STALLED, STRAIN
from seecr.description.joints import reachable
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.base import Effect, Readings, unfed
from seecr.effects.edits import Edits, edit_readings
from seecr.effects.setup import Setup, plain_setup
from seecr.effects.terms import Term
from seecr.errors import InputError
from seecr.pose import Array, pose_add, pose_difference
from seecr.result import COORDINATES, Record, Result, named, rows_of
from seecr.statics import batch
from seecr.statics.solution import Solution, certify
from seecr.statics.starts import Commanded, answered, commands_from, poses_from_lengths, start_of
from seecr.statics.tables import Tables, assemble, relengthened, take

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects


# Rounds of linearising users' cable laws at the strains of the last round.
_LAW_ROUNDS = 30
_LIMIT = 400
# If more rows than this, and than a quarter of all, are unsolved, only so many are tried first.
_MANY, _SAMPLE = 16, 4
# So few rows are solved at once from where a nearby prediction has them: to part them takes longer.
_AT_ONCE = 48

# Rows by their indices, or a slice of them.
Rows = NDArray[np.intp] | slice


@dataclass(eq=False, repr=False)
class Prediction(Result):
    """Solved rows, and the readings that the sensors would report.

    It prints as a few lines, and ``to_frame`` gives one row of readings per command.

    Attributes:
        setup: as the effects left it, for the n rows.
        tables, found: the problem and its solution, for the n rows.
        readings: what the sensors would report.
        has_history: whether rows depend on the rows before.
        sensors: effects that edit the readings.
        walk: the equilibria at all N waypoints, if the path was solved in order.
        solved: (n,) bool, a stable equilibrium was found.
        notes: sentences on effects that are left out, because commands have no times or
            temperatures.
    """

    setup: Setup
    tables: Tables
    found: batch.Evaluation
    readings: Readings
    has_history: bool
    sensors: tuple[Effect, ...] = ()
    walk: batch.Evaluation | None = field(default=None, repr=False)
    kept: dict[str, Array] = field(default_factory=dict, repr=False)
    notes: tuple[str, ...] = ()

    @property
    def solved(self) -> NDArray[np.bool_]:
        return self.found.solved

    @property
    def singular(self) -> NDArray[np.bool_]:
        """(n,) rows in equilibrium at which the platform is free to move along some direction."""
        return np.asarray(self.found.outcome == SINGULAR)

    @property
    def pose(self) -> Array:
        """(n, 7) equilibrium pose of the platform."""
        if "pose" not in self.kept:
            self.kept["pose"] = batch.platform_poses(self.tables, self.found.deviation)
        return self.kept["pose"]

    @property
    def slack(self) -> NDArray[np.bool_]:
        """(n, m) slack cables, as :func:`seecr.statics.batch.is_slack` defines them."""
        return batch.is_slack(self.tables, self.found)

    @property
    def tensions(self) -> Array:
        """(n, m) [N]; of a block and tackle, of its line."""
        return np.asarray(self.pulls / self.setup.robot.falls)

    @property
    def pulls(self) -> Array:
        """(n, m) [N] how each cable pulls the platform, with all falls of its line."""
        return self.found.tension

    def with_rows(self, other: Prediction, rows: NDArray[np.bool_]) -> Prediction:
        """The same with some rows (n,) of another prediction that differs only in length errors.

        Neither may have a history: rows that depend on the rows before cannot be exchanged.
        """

        def put(one: Any, two: Any, *names: str) -> Any:
            some = {name: mixed(rows, getattr(one, name), getattr(two, name)) for name in names}
            return replace(one, **some)

        return replace(
            self,
            setup=put(self.setup, other.setup, "extra_length"),
            tables=put(self.tables, other.tables, "cables", "load", "scale", "reach"),
            found=put(self.found, other.found, *(f.name for f in fields(batch.Evaluation))),
            readings=put(self.readings, other.readings, *(f.name for f in fields(Readings))),
            walk=None,
            kept={
                k: mixed(rows, v, other.kept[k]) for k, v in self.kept.items() if k in other.kept
            },
        )

    def lines(self) -> list[str]:
        """How many rows came to rest, and where, as for a solution."""
        return [*self.solution().lines(), *self.notes]

    def as_json(self) -> Record:
        """The rows, and the notes."""
        return {"rows": self.records(), "notes": self.notes}

    def records(self) -> list[Record]:
        """The readings, one row per command."""
        read = self.readings
        return rows_of(
            {
                "solved": self.solved,
                **named("{}", COORDINATES, np.hstack([read.position, read.quat_wxyz])),
                **named("tension_{}_N", self.setup.robot.cable_names, read.tensions),
            }
        )

    def solution(self) -> Solution:
        """The rows as a certified :class:`seecr.Solution`."""
        return certify(self.setup.robot, self.tables, self.found)


def mixed(rows: NDArray[np.bool_], one: Array, other: Array) -> Array:
    """An array (n, ...) with some rows (n,) of another."""
    return np.where(rows.reshape(-1, *[1] * (one.ndim - 1)), other, one)


@dataclass(eq=False)
class Experiment:
    """A robot and its commands (n rows); predicts the readings under any effects.

    ``length_errors`` (n, m) [m], by which rest lengths differ from the commanded ones, are noise of
    the winches, not an effect.
    """

    robot: Robot
    commands: Commands
    length_errors: Array | None = None
    _path: list[Path] = field(default_factory=list, repr=False)
    # keyed by the identity of the commands, which the setup keeps alive, so that no id is reused
    _plain: dict[int, Setup] = field(default_factory=dict, repr=False)
    _edits: dict[int, Edits] = field(default_factory=dict, repr=False)
    _led: list[Array | None] = field(default_factory=list, repr=False)

    @property
    def path(self) -> Path:
        """The rows with their waypoints, for effects with history."""
        if not self._path:
            self._path.append(waypoints_of(self.robot, self.commands))
        return self._path[0]

    def error_of_steps(self, effects: Sequence[Effect], found: Solution) -> Array:
        """How far (n, 2) [m, rad] rests may be off because the way to them is taken in steps.

        A cable that goes slack, or taut, between two waypoints turns its hysteresis or friction
        round there, and not where the steps end. That error shrinks with the step, so that it is
        about twice what half the steps change; rows of ``found`` are those of this experiment.
        """
        path = waypoints_of(self.robot, self.commands, times=2)
        finer = Experiment(self.robot, self.commands, self.length_errors, [path])
        change = pose_difference(finer.predict(effects).solution().pose, found.pose)
        return np.asarray(2.0 * np.linalg.norm(change.reshape(-1, 2, 3), axis=2))

    def with_length_errors(self, errors: Array | None) -> Experiment:
        """The same experiment with other errors of the paid-out lengths."""
        kept = (self._path, self._plain)
        return Experiment(self.robot, self.commands, errors, *kept, _led=self._led)

    def setup(self, effects: Sequence[Effect], commands: Commands | None = None) -> Setup:
        """The setup as the effects leave it."""
        setup = self._edits_of(self.commands if commands is None else commands).by(effects)
        if setup.backlash.any():
            # backlash also depends on what the winches did on the way to the rows
            path = self.path
            setup.commands = path.given_turning if commands is None else path.turning
        return setup

    def _edits_of(self, commands: Commands) -> Edits:
        """Edits of effects to the setup of commands, cached: fits need them thousands of times."""
        if id(commands) not in self._edits:
            if id(commands) not in self._plain:
                self._plain[id(commands)] = plain_setup(self.robot, commands)
            setup = self._plain[id(commands)].shared()
            if self.length_errors is not None:
                rows = slice(None) if commands is self.commands else self.path.source
                setup.extra_length = setup.extra_length + self.length_errors[rows]
            self._edits[id(commands)] = Edits(setup)
        return self._edits[id(commands)]

    def predict(
        self, effects: Sequence[Effect] = (), near: Prediction | None = None,
        needed: NDArray[np.bool_] | None = None,
    ) -> Prediction:  # fmt: skip
        """Solve all rows and compute what the sensors would report.

        Args:
            effects: in the order in which they act.
            near: a prediction with slightly different effects to start from; by default the search
                starts at the commanded poses.
            needed: (n,) rows without which all is useless: if one of them has no solution, others
                may be given up. By default every row is solved that has one.
        """
        setup = self.setup(effects)
        if setup.has_history:
            return self._predict_path(effects, needed)
        if near is not None and near.has_history:
            near = None
        return _predicted(effects, setup, *self._solve(setup, near))

    def readings_at(self, effects: Sequence[Effect], poses: Array) -> Readings:
        """What the sensors would report if the platform were at poses (n, 7); no tensions."""
        none = np.zeros((len(poses), self.robot.n_cables))
        return read(effects, self.setup(effects), poses, none)

    def from_other_starts(
        self, effects: Sequence[Effect], at: Prediction, rows: NDArray[np.intp], poses: Array
    ) -> Prediction:
        """The same with some rows solved again from poses (k, 7), for other equilibria."""
        tables = take(at.tables, rows)
        start, values = start_of(self.robot, tables, poses)
        again = batch.descend(tables, start, _LIMIT, start_values=values, staged=False)
        found = at.found.copy()
        found.put(rows, again)
        return _predicted(effects, at.setup, at.tables, found, at.has_history)

    def _solve(self, setup: Setup, near: Prediction | None) -> tuple[Tables, batch.Evaluation]:
        def run(tables: Tables, start: batch.Evaluation | None) -> batch.Evaluation:
            if start is None and self._first is None:
                return batch.descend(tables, limit=_LIMIT)

            def warm(rows: Rows) -> batch.Evaluation:
                assert start is not None
                return batch.descend(
                    take(tables, rows), start.deviation[rows], _LIMIT,
                    start_values=start.values[rows], staged=False, guess=start.guess[rows],
                )  # fmt: skip

            def afresh(rows: NDArray[np.intp], poses: Array | None = None) -> batch.Evaluation:
                some = take(tables, rows)
                there = None if poses is None else poses[rows]
                first, values = start_of(self.robot, some, there)
                return batch.descend(some, first, _LIMIT, start_values=values)

            if start is None:
                found = batch.Evaluation.at_commands(tables)
                found.outcome[:] = ITERATIONS
            elif len(tables) <= _AT_ONCE:
                found = warm(slice(None))
            else:
                found = start.copy()
                found.outcome[:] = ITERATIONS
                found = _among(found, warm)
            for poses in (self._first, None) if self._first is not None else (None,):
                found = _among(found, partial(afresh, poses=poses))
            return found

        start = None if near is None else near.found
        if near is not None and _differ_in_length(setup, near.setup):
            # three of four calls in fits of noisy lengths come here
            tables = relengthened(near.tables, setup)
            return tables, run(tables, start)
        return _with_laws(setup, run, start)

    @property
    def _first(self) -> Array | None:
        """Poses (n, 7) at which searches start if lengths are commanded; computed once."""
        if not self._led:
            self._led.append(poses_from_lengths(self.robot, self.commands))
        return self._led[0]

    def walk(
        self, effects: Sequence[Effect], needed: NDArray[np.bool_] | None = None
    ) -> tuple[Tables, batch.Evaluation]:
        """Solve all waypoints of the path in order, each from the one before."""
        path = self.path
        setup = self.setup(effects, path.commands)

        def run(tables: Tables, _start: batch.Evaluation | None) -> batch.Evaluation:
            return batch.walk(tables, path, _LIMIT, needed)

        return _with_laws(setup, run, None)

    def _predict_path(
        self, effects: Sequence[Effect], needed: NDArray[np.bool_] | None
    ) -> Prediction:
        path = self.path
        tables, whole = self.walk(effects, needed)
        rows = take(tables, path.rows)
        found = whole.only(path.rows)
        lost = _after_lost_waypoints(path, whole)
        found.outcome[lost & (found.outcome == CONVERGED)] = STALLED
        return _predicted(effects, self.setup(effects), rows, found, True, whole)


def _predicted(
    effects: Sequence[Effect], setup: Setup, tables: Tables, found: batch.Evaluation,
    has_history: bool = False, walk: batch.Evaluation | None = None,
) -> Prediction:  # fmt: skip
    """A prediction of solved rows, with what the sensors report of them."""
    pose = batch.platform_poses(tables, found.deviation)
    readings, sensors = read(effects, setup, pose, found.tension), sensors_among(effects)
    kept = {"pose": pose}
    return Prediction(setup, tables, found, readings, has_history, sensors, walk, kept)


def predict(robot: GivenRobot, commands: Commanded, model: GivenEffects = ()) -> Prediction:
    """Predict where a robot with effects comes to rest, and what its sensors would report.

    Args:
        robot: as described, or its MJCF.
        commands: commanded poses (n, 7), :class:`seecr.Commands` with runs, times or lengths, or
            ``crosscheck.Measurements``, of which only the commands count.
        model: from :func:`seecr.load_model`, its file, or effects with values; none by default.

    Returns:
        a :class:`Prediction`; check ``solved`` before using a row, and ``notes``.

    Raises:
        InputError: poses, robot or effects of a wrong type or shape, or a row without lengths.

    Example:
        ``seecr.predict(robot, poses, [seecr.Term.of(robot, "pulley_radius", radius_m=0.01)])``
    """
    robot = robot_of(robot)
    told = answered(commands_from(commands, robot))
    effects = effects_of(model, robot)
    found = Experiment(robot, told).predict(effects)
    found.notes = unfed(effects, told)
    return found


def effects_of(given: GivenEffects, robot: Robot) -> list[Effect]:
    """The effects of a model, of its file, of terms with values, or effects as they are.

    Raises:
        InputFileError: there is no such file, or it holds no model of this robot.
        InputError: something other than effects with values.
    """
    from seecr.prediction.model import effects_given  # takes a while to import

    terms, _notes = effects_given(given, robot)
    return [one.effect() if isinstance(one, Term) else one for one in terms]


def read(effects: Sequence[Effect], setup: Setup, poses: Array, tensions: Array) -> Readings:
    """What the sensors report of poses (n, 7) and tensions (n, m); a line's where it is reeved."""
    line = tensions / setup.robot.falls
    readings = Readings(poses[:, :3].copy(), poses[:, 3:].copy(), line)
    for effect in sensors_among(effects):
        edit_readings(effect, readings, setup)
    return readings


def sensors_among(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """The effects that edit readings."""
    return tuple(effect for effect in effects if senses(type(effect)))


def senses(effect: type[Effect]) -> bool:
    """Whether an effect edits readings."""
    return effect.edit_readings is not Effect.edit_readings


def _differ_in_length(one: Setup, other: Setup) -> bool:
    """Whether two setups of the same commands differ in ``extra_length`` at most."""
    alike = one.robot is other.robot and one.commands is other.commands
    return alike and not (one.laws or other.laws) and one.differs(other) <= {"extra_length"}


def _after_lost_waypoints(path: Path, whole: batch.Evaluation) -> NDArray[np.bool_]:
    """Rows (n,) at or after a waypoint of their run that was not solved: they are not valid."""
    assert path.commands.run is not None
    run = np.unique(path.commands.run[path.rows], return_inverse=True)[1]
    lost, first = path.source[~whole.at_rest], np.full(len(run), len(run))
    np.minimum.at(first, run[lost], lost)
    return np.asarray(np.arange(len(run)) >= first[run])


def _among(
    found: batch.Evaluation, solve: Callable[[NDArray[np.intp]], batch.Evaluation]
) -> batch.Evaluation:
    """Solve the rows that are not solved yet; a few of them first, if these are most.

    With values under which no pose can be held (a step of a fit that went too far), the solver
    would try every row up to its limit.
    """
    lost = found.outcome != CONVERGED
    if not lost.any():
        return found
    rows = np.flatnonzero(lost)
    first, rest = rows, rows[:0]
    if len(rows) > max(_MANY, len(lost) // 4):
        some = np.zeros(len(rows), dtype=bool)
        some[np.linspace(0, len(rows) - 1, _SAMPLE).astype(int)] = True
        first, rest = rows[some], rows[~some]
    if len(first):
        found.put(first, solve(first))
    if len(rest) and np.any(found.outcome[first] == CONVERGED):
        found.put(rest, solve(rest))
    return found


def _with_laws(
    setup: Setup,
    run: Callable[[Tables, batch.Evaluation | None], batch.Evaluation],
    start: batch.Evaluation | None,
) -> tuple[Tables, batch.Evaluation]:
    """Solve; users' cable laws are linearised at the strains found, repeatedly until these stay."""
    strains = None
    if setup.laws and start is not None:
        strains = start.states[..., STRAIN]
    tables = assemble(setup, strains)
    found = run(tables, start)
    if not setup.laws:
        return tables, found
    for _ in range(_LAW_ROUNDS):
        before = strains
        strains = np.maximum(found.states[..., STRAIN], 0.0)
        tables = assemble(setup, strains)
        found = run(tables, found)
        if before is not None and np.allclose(strains, before, rtol=1e-12, atol=1e-15):
            return tables, found
    found.outcome[found.outcome == CONVERGED] = STALLED
    return tables, found


# From the platform's pose to what its tracker reads, and back.

# Most rounds of the search for a pose, and how exactly it must be read as wanted [m, rad].
_ROUNDS, _READ = 50, 1e-12


def tracked(robot: GivenRobot, commands: Commanded, effects: GivenEffects) -> Array:
    """Poses (n, 7) that a model's tracker reads when the platform is at the commanded poses.

    Args:
        robot: as described, or its MJCF.
        commands: poses (n, 7), or what has poses.
        effects: a model, its file, or effects with values.

    Returns:
        (n, 7) [m], quaternions scalar first.

    Raises:
        InputError: poses, robot or effects of a wrong type or shape.

    Example:
        ``seecr.tracked(robot, poses, "model.toml")``
    """
    robot = robot_of(robot)
    return _tracked(robot, commands_from(commands, robot), effects_of(effects, robot))


def placed(robot: GivenRobot, commands: Commanded, effects: GivenEffects) -> Commands:
    """Commands at whose poses a model's tracker reads the poses of ``commands``.

    These are what :func:`seecr.correct` takes to bring the platform to where its tracker reads the
    wanted poses, as ``seecr correct --as-read`` does.

    How a calibration shares an error between tracker and robot hardly matters for what is read, but
    matters much for where the platform is taken to be. Joints keep a platform from some poses: it
    is then read as nearly so as they allow.

    Args:
        robot: as described, or its MJCF.
        commands: poses (n, 7) to be read, or what has poses.
        effects: a model, its file, or effects with values.

    Returns:
        the commands, with other poses.

    Raises:
        InputError: poses, robot or effects of a wrong type or shape, or no pose is read so.

    Example:
        ``seecr.placed(robot, poses, "model.toml").pose``
    """
    robot = robot_of(robot)
    commands = commands_from(commands, robot)
    acting, at = effects_of(effects, robot), commands
    for _ in range(_ROUNDS):
        missed = pose_difference(commands.pose, _tracked(robot, at, acting))
        aimed = reachable(robot, pose_add(at.pose, missed))
        if np.abs(pose_difference(aimed, at.pose)).max(initial=0.0) < _READ:
            return at
        at = replace(at, pose=aimed)
    raise InputError("the model's tracker reads no pose as wanted; expected one near the robot's")


def _tracked(robot: Robot, commands: Commands, effects: Sequence[Effect]) -> Array:
    readings = Experiment(robot, commands).readings_at(effects, commands.pose)
    return np.concatenate([readings.position, readings.quat_wxyz], axis=1)
