"""Planned measurements: commands with the model's own predictions and expected noise."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import Problem
from crosscheck.fit.state import State, evaluate
from crosscheck.measurements.data import Measurements, Sigma
from seecr.compiled.columns import REST, STRAIN, TENSION
from seecr.description.robot import Robot
from seecr.effects import Terms, catalogue
from seecr.effects.base import Readings
from seecr.pose import Array, rxyz_from_quat
from seecr.prediction.experiment import Experiment
from seecr.workspace.margins import load_scale

# Noise of a good tracker relative to the mean cable length (30 micrometres on a DemoBot), of its
# angles, and of load cells relative to the mean tension.
_POSITION, _ORIENTATION_RAD, LOAD_CELL = 6e-5, 3.5e-4, 0.01
NEAR_SLACK = 0.05
"""A cable whose stretch or slack is less than this part of the usual stretch may switch."""

# Smallest noise of a load cell [N].
_LEAST_CELL = 1e-9
READ = ("position", "orientation", "tension")
"""Kinds of readings."""


@dataclass(frozen=True, eq=False)
class Reads:
    """What is read at a pose.

    Attributes:
        position: (3,) bool coordinates. orientation: whether all of it.
        angles: (3,) bool single angles. tensions: (m,) bool cables.
    """

    position: NDArray[np.bool_]
    orientation: bool
    angles: NDArray[np.bool_]
    tensions: NDArray[np.bool_]

    @classmethod
    def of(cls, data: Measurements) -> Reads:
        """What some measurements contain."""
        whole = data.quat_wxyz is not None
        return cls(data.position_mask, whole, data.angle_mask, data.tension_mask)

    @classmethod
    def of_kinds(cls, n_cables: int, kinds: Collection[str] = READ[:2]) -> Reads:
        """Complete positions, orientations and tensions, as far as they are named; else the pose.

        Raises:
            CrosscheckError: a name is unknown, or there is none.
        """
        wrong = [kind for kind in kinds if kind not in READ]
        if wrong or not kinds:
            got = repr(wrong[0]) if wrong else "nothing"
            raise CrosscheckError(f"reads: expected some of {', '.join(READ)}, got {got}")
        every = np.full(3, "position" in kinds)
        tensions = np.full(n_cables, "tension" in kinds)
        return cls(every, "orientation" in kinds, np.zeros(3, dtype=bool), tensions)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the kinds of readings."""
        there = (self.position.any(), self.orientation or self.angles.any(), self.tensions.any())
        return tuple(kind for kind, some in zip(READ, there, strict=True) if some)

    @property
    def whole_pose(self) -> bool:
        """Whether the complete pose is read."""
        return self.orientation and bool(self.position.all())


@dataclass(frozen=True, eq=False)
class Planned:
    """A problem whose readings are a model's own predictions.

    Attributes:
        problem: the data; rows with an equilibrium count. base: the model on them.
        factor: noise factors. reads: what is read in each row.
    """

    problem: Problem
    base: State
    factor: Array
    reads: Reads

    @property
    def unsolved(self) -> np.ndarray:
        """(n,) bool rows without an equilibrium."""
        return ~np.asarray(self.base.prediction.solved)


def kinds_of(reads: Collection[str] | str, sigma: Sigma) -> tuple[str, ...]:
    """The kinds that are named; by default the pose, and tensions if their noise is stated."""
    given = (reads,) if isinstance(reads, str) else tuple(reads)
    return given or (READ if sigma.tension_N is not None else READ[:2])


def usual_cell(tension: float) -> float:
    """The noise [N] of a load cell for tensions of this usual size [N]."""
    return float(f"{max(LOAD_CELL * tension, _LEAST_CELL):.1g}")


def expected_sigma(
    robot: Robot, stated: Sigma, kinds: Collection[str] = READ[:2]
) -> tuple[Sigma, tuple[str, ...]]:
    """The noise to plan with, as stated or else that of good sensors, and notes on assumptions.

    Assumptions about kinds that are not read are not noted.
    """
    length = float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))
    notes = []
    sigma = stated
    if sigma.position_m is None:
        sigma = replace(sigma, position_m=float(f"{_POSITION * length:.1e}"))
        if "position" in kinds:
            notes.append(
                f"noise of positions is not stated: {1e3 * sigma.position_m:.3g} mm assumed"  # type: ignore[operator]
            )
    if sigma.orientation_rad is None:
        sigma = replace(sigma, orientation_rad=_ORIENTATION_RAD)
        degrees = np.degrees(_ORIENTATION_RAD)
        if "orientation" in kinds:
            notes.append(f"noise of angles is not stated: {degrees:.2g} deg assumed")
    if sigma.tension_N is None and "tension" in kinds:
        sigma = replace(sigma, tension_N=usual_cell(load_scale(robot) / robot.n_cables))
        notes.append(f"noise of tensions is not stated: {sigma.tension_N:g} N assumed")
    return sigma, tuple(notes)


def planned(
    robot: Robot, commands: Measurements, sigma: Sigma, reads: Reads, terms: Terms | None = None,
    considered: frozenset[str] = frozenset(),
) -> Planned:  # fmt: skip
    """The problem of commands as they would be measured, whatever readings they have.

    Args:
        robot, commands: what is planned. sigma: noise of every kind that is read.
        reads: what will be read. terms: effects of the model; by default none.
        considered: names of effects; by default those of the catalogue.

    Raises:
        CrosscheckError: the robot's joints lock all that will be read.
    """
    model = Terms() if terms is None else terms
    prediction = Experiment(robot, commands.as_commands(robot)).predict(model.effects)
    full = _as_read(commands, prediction.readings, reads)
    asked = considered or frozenset(catalogue())
    problem = Problem(robot, full, sigma, np.asarray(prediction.solved), considered=asked)
    if prediction.solved.any() and not problem.measured.any():
        raise CrosscheckError(
            f"robot {robot.name}: its joints lock all that would be read "
            f"({', '.join(reads.kinds)}); expected readings of what moves, or of tension"
        )
    factor = problem.noise(prediction)
    return Planned(problem, evaluate(problem, model, factor), factor, reads)


def _as_read(commands: Measurements, readings: Readings, reads: Reads) -> Measurements:
    """Commands with the readings that would be made, except at way points.

    Way points are rows without readings among others that have some: a list of commands has none.
    """
    stops = (commands.read | ~commands.read.any())[:, None]
    angles = np.zeros((commands.n_rows, 3))
    if reads.angles.any():
        angles = rxyz_from_quat(readings.quat_wxyz)
    return replace(
        commands,
        position=np.where(stops & reads.position, readings.position, np.nan),
        quat_wxyz=np.where(stops, readings.quat_wxyz, np.nan) if reads.orientation else None,
        angles_rad=np.where(stops & reads.angles, angles, np.nan),
        tensions=np.where(stops & reads.tensions, readings.tensions, np.nan),
    )


def near_slack(plan: Planned) -> list[tuple[int, int]]:
    """Rows and cables about to go slack or taut, where small errors change which cables pull."""
    states = plan.base.prediction.found.states
    rest = plan.base.prediction.tables.cables[..., REST]
    stretch = states[..., STRAIN] * rest
    driven = plan.problem.robot.driven  # bands and springs stretch as they please
    taut = (states[..., TENSION] > 0) & driven
    if not taut.any():
        return []
    usual = float(np.mean(stretch[taut]))
    close = (np.abs(stretch) < NEAR_SLACK * usual) & driven & plan.problem.use[:, None]
    return [(int(k), int(i)) for k, i in np.argwhere(close)]


# The kinds of measurements that could be added, each with words and a plan of its readings.

MORE_POSES = 6
"""Most poses that are added."""


class Adding(StrEnum):
    """Kinds of measurements that could be added, in the words of ``plan.json``."""

    TENSIONS = "tensions"
    POSE = "pose"
    PAYLOAD = "payload"
    PAYLOAD_ASIDE = "payload_aside"
    WAY_BACK = "way_back"
    WAY_POINTS = "way_points"
    LATER = "later"
    POSES = "poses"


@dataclass(frozen=True, eq=False)
class Extension:
    """Readings that could be added.

    Attributes:
        kind: what is added. words: what to do. plan: the added readings.
        poses: (k, 7) commanded poses, if poses are added.
    """

    kind: Adding
    words: str
    plan: Planned
    poses: Array | None = None


def like(
    plan: Planned, data: Measurements, reads: Reads | None = None, sigma: Sigma | None = None
) -> Planned:
    """A plan with other rows or sensors, everything else unchanged."""
    return planned(
        plan.problem.robot, data, sigma or plan.problem.sigma, reads or plan.reads,
        plan.base.terms, plan.problem.considered,
    )  # fmt: skip
