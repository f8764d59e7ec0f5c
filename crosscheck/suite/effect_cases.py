"""Every effect that MuJoCo can express, held against seecr's, pose for pose.

For each robot and effect a few commands are settled by :mod:`crosscheck.twin.measure`, where the
effect is part of MuJoCo's model, and solved by seecr with its own physics of the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.twin.hidden import Hidden, choose
from crosscheck.twin.measure import Truth, measure
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.experiment import Experiment
from seecr.mjcf import load_robot
from seecr.pose import Array, pose_difference
from seecr.robot import Robot
from seecr.setup import Commands
from seecr.shipped import model_path

ROBOTS = ("demobot_cogiro", "demobot_parallel", "planar_vertical")

# Both are exact but for rounding, so they agree as plain robots do: [m], [rad], [N].
POSITION_M, ORIENTATION_RAD, TENSION_N = 1e-8, 1e-7, 1e-6
# Chains this fine, extrapolated, are that near to the catenary.
_SEGMENTS = (16, 32)
# What happens between two rows is asked for at the same points by both.
_WAYPOINTS = (6, 2)
# Rows of each sweep; half the way that the robot's own twin would go.
_POINTS, _REACH = 4, 0.3
# Slow creep: seecr takes the tension as constant between waypoints, the truth as linear in time.
_CREEP_TIME_S = 2000.0


@dataclass(frozen=True, eq=False)
class EffectCase:
    """One effect of one robot.

    Attributes:
        name: ``robot-effect``.
        robot: as described.
        hidden: the effect with its values.
        commands: n rows.
    """

    name: str
    robot: Robot
    hidden: Hidden
    commands: Commands


@dataclass(frozen=True, eq=False)
class EffectAgreement:
    """How far seecr's effect and MuJoCo's are apart over n rows.

    Attributes:
        case: what was run.
        truth: MuJoCo's answers.
        position_m, orientation_rad, tension_N: (n,) largest differences of the readings.
        compared: (n,) rows at which both came to rest.
        moved_m: the largest distance by which the effect moves a reading [m].
    """

    case: EffectCase
    truth: Truth
    position_m: Array
    orientation_rad: Array
    tension_N: Array
    compared: NDArray[np.bool_]
    moved_m: float

    @property
    def worst(self) -> tuple[float, float, float]:
        """Largest differences [m], [rad], [N] of the rows compared."""
        rows = self.compared
        parts = (self.position_m, self.orientation_rad, self.tension_N)
        return tuple(float(np.max(part[rows], initial=0.0)) for part in parts)  # type: ignore[return-value]

    @property
    def agrees(self) -> bool:
        """Whether all rows were compared and none differs by more than is allowed."""
        position, orientation, tension = self.worst
        near = position <= POSITION_M and orientation <= ORIENTATION_RAD and tension <= TENSION_N
        return near and bool(np.all(self.compared))


def effect_cases(robots: Sequence[str | Path] = ROBOTS, seed: int = 0) -> list[EffectCase]:
    """All effects on the shipped robots, their sizes drawn from a seed.

    Args:
        robots: names of shipped models, or MJCF files.
        seed: of the sizes.
    """
    return [effect_case(robot, name, seed) for robot in robots for name in TRUE_EFFECTS]


def effect_case(robot: str | Path, effect: str, seed: int = 0) -> EffectCase:
    """One effect on a robot, the same as among all of them.

    Args:
        robot: name of a shipped model, or an MJCF file.
        effect: one of ``TRUE_EFFECTS``.
        seed: of its size.
    """
    path = robot if isinstance(robot, Path) else model_path(robot)
    loaded, commands = _robot_and_commands(path)
    random = np.random.default_rng([seed, TRUE_EFFECTS.index(effect)])
    hidden = choose(loaded, random, [effect])[0]
    return EffectCase(f"{path.stem}-{effect}", loaded, _slow(hidden), commands)


def run_effect_case(case: EffectCase) -> EffectAgreement:
    """Settle it in MuJoCo, solve it with seecr, compare the readings."""
    experiment = Experiment(case.robot, case.commands)
    effects = [case.hidden.effect()]
    ours, plain = experiment.predict(effects), experiment.predict()
    truth = measure(case.robot, case.commands, effects, segments=_SEGMENTS, waypoints=_WAYPOINTS)
    ours_pose = np.concatenate([ours.readings.position, ours.readings.quat_wxyz], axis=1)
    theirs = np.concatenate([truth.position, truth.quat_wxyz], axis=1)
    change = pose_difference(theirs, ours_pose)
    moved = ours.readings.position - plain.readings.position
    return EffectAgreement(
        case,
        truth,
        np.linalg.norm(change[:, :3], axis=1),
        np.linalg.norm(change[:, 3:], axis=1),
        np.max(np.abs(truth.tension_readings - ours.readings.tensions), axis=1),
        truth.at_rest & ours.solved,
        float(np.max(np.linalg.norm(moved, axis=1))),
    )


def _slow(hidden: Hidden) -> Hidden:
    vector = hidden.vector.copy()
    for k, name in enumerate(hidden.layout.names):
        if (hidden.name, name) == ("creep", "time_s"):
            vector[k] = _CREEP_TIME_S
    return Hidden(hidden.layout, vector)


@cache
def _robot_and_commands(path: Path) -> tuple[Robot, Commands]:
    robot = load_robot(path)
    return robot, _commands(robot)


def _commands(robot: Robot) -> Commands:
    """Two sweeps to and fro about the reference pose, and a change of temperature."""
    from crosscheck.twin.trajectory import trajectory

    way = trajectory(robot, _POINTS, _REACH)
    rows = np.isin(way.run, ("along_low_fwd", "along_low_back", "loop"))
    run: Any = np.unique(way.run[rows], return_inverse=True)[1]
    n = int(rows.sum())
    return Commands(
        pose=way.pose[rows],
        run=run,
        time=way.t_s[rows],
        temperature=20.0 + 4.0 * np.sin(np.arange(n)),
    )
