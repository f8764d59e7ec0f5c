"""Measurements that nobody has made yet: planned commands with the noise to be expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.candidates import null_fit
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Measurements, Sigma
from seecr.compiled.columns import REST, STRAIN, TENSION
from seecr.effects import Terms
from seecr.pose import Array
from seecr.robot import Robot

# Noise of a good tracker over the mean cable length (30 micrometres on a DemoBot), of its angles,
# and of load cells over the mean tension.
_POSITION, _ORIENTATION_RAD, LOAD_CELL = 6e-5, 3.5e-4, 0.01
# A cable stretched or loose by less than this part of the usual stretch may switch.
_NEAR_SLACK = 0.05


@dataclass(frozen=True, eq=False)
class Planned:
    """A problem whose readings are the plain model's own.

    Attributes:
        problem: rows that have an equilibrium count. base: the plain model on it.
        factor: noise factors.
    """

    problem: Problem
    base: Fit
    factor: Array

    @property
    def unsolved(self) -> np.ndarray:
        """(n,) bool rows without an equilibrium."""
        return ~np.asarray(self.base.state.prediction.solved)


def expected_sigma(robot: Robot, stated: Sigma) -> tuple[Sigma, tuple[str, ...]]:
    """The noise to plan with: what is stated, else that of a good tracker; and what was assumed."""
    length = float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))
    notes = []
    sigma = stated
    if sigma.position_m is None:
        sigma = replace(sigma, position_m=float(f"{_POSITION * length:.1e}"))
        notes.append(f"noise of positions is not stated: {1e3 * sigma.position_m:.3g} mm assumed")  # type: ignore[operator]
    if sigma.orientation_rad is None:
        sigma = replace(sigma, orientation_rad=_ORIENTATION_RAD)
        degrees = np.degrees(_ORIENTATION_RAD)
        notes.append(f"noise of angles is not stated: {degrees:.2g} deg assumed")
    return sigma, tuple(notes)


def planned(robot: Robot, commands: Measurements, sigma: Sigma, kinds: Sequence[str]) -> Planned:
    """The problem of commands as they would be measured.

    Args:
        robot: as described.
        commands: planned; readings in it are ignored.
        sigma: noise of every kind wanted.
        kinds: what will be read: any of "pose" and "tension".
    """
    blank = _with_readings(commands, None, kinds)
    problem = Problem(robot, blank, sigma, np.ones(commands.n_rows, dtype=bool))
    prediction = problem.experiment.predict()
    full = _with_readings(commands, prediction, kinds)
    problem = Problem(robot, full, sigma, np.asarray(prediction.solved))
    factor = problem.noise(prediction)
    return Planned(problem, null_fit(problem, Terms(), factor, refit=False), factor)


def _with_readings(
    commands: Measurements, prediction: object, kinds: Sequence[str]
) -> Measurements:
    n, m = commands.n_rows, commands.n_cables
    readings = getattr(prediction, "readings", None)
    position, quat = np.full((n, 3), np.nan), None
    tensions = np.full((n, m), np.nan)
    if "pose" in kinds:
        position = np.zeros((n, 3)) if readings is None else readings.position.copy()
        quat = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        quat = quat if readings is None else readings.quat_wxyz.copy()
    if "tension" in kinds:
        tensions = np.zeros((n, m)) if readings is None else readings.tensions.copy()
    return replace(
        commands,
        position=position,
        quat_wxyz=quat,
        angles_rad=np.full((n, 3), np.nan),
        tensions=tensions,
        position_mask=np.isfinite(position).any(axis=0),
        angle_mask=np.zeros(3, dtype=bool),
        tension_mask=np.isfinite(tensions).any(axis=0),
    )


def near_slack(plan: Planned) -> list[tuple[int, int]]:
    """Rows and cables about to go slack or taut: there small errors change what pulls."""
    states = plan.base.state.prediction.found.states
    rest = plan.base.state.prediction.tables.cables[..., REST]
    stretch = states[..., STRAIN] * rest
    taut = states[..., TENSION] > 0
    if not taut.any():
        return []
    usual = float(np.mean(stretch[taut]))
    close = (np.abs(stretch) < _NEAR_SLACK * usual) & plan.problem.use[:, None]
    return [(int(k), int(i)) for k, i in np.argwhere(close)]
