"""The suite's effects: each that MuJoCo can express, on both DemoBots, as cases of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from crosscheck.suite import effect_cases
from crosscheck.suite.pool import Pool
from crosscheck.suite.run import EXIT_AGREES, EXIT_DIFFERS, EXIT_UNSOLVED
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.equilibrium import solve
from seecr.shipped import model_path

GROUP, PREFIX = "effects", "effect-"
ROBOTS = ("demobot_cogiro", "demobot_parallel")
# These take tens of times as long as any other: chains of many links.
_LONG = ("cable_weight",)


@dataclass(frozen=True)
class EffectTask:
    """One effect of one shipped robot, to be run.

    Attributes:
        robot: name of a shipped model.
        effect: one of ``TRUE_EFFECTS``.
        seed: of the effect's size.
    """

    robot: str
    effect: str
    seed: int = 0

    @property
    def name(self) -> str:
        """As on the terminal, in files and for ``--case``."""
        return f"{PREFIX}{self.robot}-{self.effect}"

    @property
    def model(self) -> Path:
        """MJCF of the robot."""
        return model_path(self.robot)

    @property
    def n_poses(self) -> int:
        """Number of commanded poses."""
        return len(effect_cases.effect_case(self.robot, self.effect, self.seed).commands)


@dataclass(frozen=True)
class EffectResult:
    """How far seecr's effect and MuJoCo's are apart.

    Attributes:
        task: what was run.
        agrees: whether all rows were compared and none differs by more than is allowed.
        position_m, orientation_rad, tension_N: largest differences of the rows compared.
        moved_m: the largest distance by which the effect moves a reading [m].
        rows: commanded poses.
        unsolved: those of them at which seecr or MuJoCo did not come to rest.
        wall_s: [s] it took.
    """

    task: EffectTask
    agrees: bool
    position_m: float
    orientation_rad: float
    tension_N: float
    moved_m: float
    rows: int
    unsolved: int
    wall_s: float

    @property
    def exit_status(self) -> int:
        """0 agrees, 1 differs by more than is allowed, 3 a row did not come to rest."""
        if self.agrees:
            return EXIT_AGREES
        near = (
            self.position_m <= effect_cases.POSITION_M
            and self.orientation_rad <= effect_cases.ORIENTATION_RAD
            and self.tension_N <= effect_cases.TENSION_N
        )
        return EXIT_UNSOLVED if near and self.unsolved else EXIT_DIFFERS


def effect_tasks(seed: int = 0) -> list[EffectTask]:
    """Every effect on both DemoBots."""
    return [EffectTask(robot, effect, seed) for robot in ROBOTS for effect in TRUE_EFFECTS]


def run_effect(task: EffectTask) -> EffectResult:
    """Settle one effect in MuJoCo, solve it with seecr, compare."""
    began = time.perf_counter()
    case = effect_cases.effect_case(task.robot, task.effect, task.seed)
    found = effect_cases.run_effect_case(case)
    return EffectResult(
        task,
        found.agrees,
        *found.worst,
        moved_m=found.moved_m,
        rows=len(found.compared),
        unsolved=int((~found.compared).sum()),
        wall_s=time.perf_counter() - began,
    )


def run_effects(
    tasks: Sequence[EffectTask], pool: Pool, tell: Callable[[EffectResult], None]
) -> list[EffectResult]:
    """Run effects, several at a time.

    Args:
        tasks: what to run.
        pool: where.
        tell: called with each result as it comes.

    Returns:
        the results in the order of the tasks.
    """
    if not tasks:
        return []
    if pool.jobs > 1:
        # Have the compiled loop on disk before several processes want it.
        robot = effect_cases.effect_case(tasks[0].robot, tasks[0].effect).robot
        solve(robot, robot.reference_pose[None])
    order = sorted(range(len(tasks)), key=lambda i: tasks[i].effect not in _LONG)
    return pool.run(run_effect, tasks, order, tell)
