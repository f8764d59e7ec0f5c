"""Every effect compared with a robot in MuJoCo that really has it, pose for pose; and control.

For each robot and effect a few commands are settled by :mod:`crosscheck.twin.measure`, where the
effect is part of the robot, and solved by seecr with its own physics of the effect. Each scheme of
control moves a robot that is not as its controller believes from its reference pose to one near
it and holds it there, with lagging winches, damped cables and a tracker.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.controlled.control import Timing, control_in_time
from crosscheck.controlled.machine import Winches
from crosscheck.suite.agreement import gap
from crosscheck.suite.verdicts import Outcome
from crosscheck.twin.hidden import CONTAINED, choose
from crosscheck.twin.lab import trajectory
from crosscheck.twin.measure import measure
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.commands import Commands, Loads
from seecr.counted import counted, some
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Effect, Term
from seecr.parallel import run_tasks
from seecr.pose import Array
from seecr.prediction.experiment import Experiment

GROUP, PREFIX = "effects", "effect-"
LOADS = "known_loads"
"""In place of an effect: payloads and wrenches, different ones in each row."""
CONTROL = "control"
"""In place of an effect: schemes of control, in MuJoCo with time."""
ROBOTS = ("demobot_cogiro", "demobot_parallel")
_LARGE = "cogiro_large"

# Both are exact to within rounding, so the limits are those of plain robots: [m], [rad], [N].
_EXACT = 1e-8, 1e-7, 1e-6
# What control comes to has moved until then: the limits are those after settling [m], [rad], and
# what they make of tensions, by the stiffness of DemoBot's cables [N].
_MOVED = 1e-6, 1e-5, 1e-2
# Tensions scale with the weight: the limit is for DemoBot's and for smaller weights [N].
_WEIGHT_N = 0.4 * 9.81
# Chains with so many segments, extrapolated, are that close to the catenary.
_SEGMENTS = (16, 32)
# Rows of each sweep, and its reach; the robot's own twin goes twice as far.
_POINTS, _REACH = 4, 0.3
# Creep is slow: seecr takes the tension as constant between waypoints, the truth as linear in time.
_CREEP_TIME_S = 2000.0
# These take tens of times as long as any other: chains of many links.
_LONG = ("cable_weight", CONTROL)
SCHEMES = (
    "geometric", "elastic", "stiffness", "pose_feedback", "elastic+pose_feedback",
    "tension_feedback",
)  # fmt: skip
# Largest tension [weight], which the scheme stiffness needs.
_HIGHEST = 3.0
# Slow: a gain of 0.8 leaves 0.2 of an error per reading, and 24 of these nothing of a metre; the
# winches reach what they are told in a second, vibrations die out in half of one.
_TIMING, _WINCHES, _GAIN = Timing(speed=0.02, hold=16.0, rate=1.5), Winches(5.0, np.inf, 0.2), 0.8


class Counterpart(Enum):
    """What seecr's mathematics of an effect is compared with."""

    MUJOCO = "MuJoCo's own means"
    OURS = "our own mathematics, written a second time"


# MuJoCo has no winches, no such sensors, and no cables with a history. crosscheck.twin implements
# these effects from their definitions; MuJoCo settles the robot with them.
_OURS = frozenset({
    "cable_length_offset", "length_scale", "drum_gain", "drum_eccentricity", "backlash",
    "thermal_expansion", "hysteresis", "creep", "exit_friction", "tracker_frame", "tracker_target",
    "tracker_scale", "tension_scale",
})  # fmt: skip


@dataclass(frozen=True)
class EffectCase:
    """One effect of one robot.

    Attributes:
        model: MJCF of the robot as described.
        effect: one of ``TRUE_EFFECTS``, or ``LOADS``.
        seed: of the effect's size.
    """

    model: Path
    effect: str
    seed: int = 0

    @property
    def name(self) -> str:
        """The name on the terminal, in files and for ``--case``."""
        if self.effect == CONTROL:
            return f"{CONTROL}-{self.model.stem}"
        return f"{PREFIX}{self.model.stem}-{self.effect}"

    @property
    def against(self) -> Counterpart:
        """What seecr's mathematics of the effect is compared with."""
        return Counterpart.OURS if self.effect in _OURS else Counterpart.MUJOCO

    def __len__(self) -> int:
        """Number of commanded poses, or of schemes of control."""
        return len(SCHEMES) if self.effect == CONTROL else len(self.commands)

    @property
    def robot(self) -> Robot:
        """The robot as described."""
        return _robot_and_commands(self.model)[0]

    @property
    def commands(self) -> Commands:
        """Two sweeps to and fro about the reference pose, with a change of temperature."""
        return _robot_and_commands(self.model)[1]

    @property
    def loads(self) -> Loads | None:
        """Known loads, for the case of loads; half of them at the platform's own centre."""
        if self.effect != LOADS:
            return None
        robot, n = self.robot, len(self)
        random = np.random.default_rng(self.seed)
        centre = robot.length * random.uniform(-0.5, 0.5, (n, 3))
        centre[::2] = np.nan
        push = robot.weight * random.uniform(-0.1, 0.1, (n, 6))
        return Loads.of(
            n,
            mass=robot.mass * random.uniform(0.0, 0.5, n),
            centre=centre,
            wrench=push * np.repeat([1.0, 0.5 * robot.length], 3),
        )

    @property
    def effects(self) -> list[Effect]:
        """The effect with its values; empty for the case of loads."""
        return [] if self.effect == LOADS else [self.term.effect()]

    @property
    def term(self) -> Term:
        """The effect with its values, as a term."""
        # those contained in others come last, so that they shift no other's seed
        order = [*(name for name in TRUE_EFFECTS if name not in CONTAINED), *CONTAINED]
        random = np.random.default_rng([self.seed, order.index(self.effect)])
        term = choose(self.robot, random, [self.effect])[0]
        if self.effect != "creep":
            return term
        times = np.array([name == "time_s" for name in term.layout.names])
        return replace(term, vector=np.where(times, _CREEP_TIME_S, term.vector))


@dataclass(frozen=True, eq=False)
class EffectResult:
    """Differences between seecr's effect and MuJoCo's over n rows.

    Attributes:
        case: what was run.
        position_m, orientation_rad, tension_N: (n,) differences of the readings; of tensions the
            largest.
        compared: (n,) rows at which both came to rest.
        moved_m: the largest distance by which the effect moves a reading [m]; of control, by which
            schemes differ.
        wall_s: [s] time taken.
    """

    case: EffectCase
    position_m: Array
    orientation_rad: Array
    tension_N: Array
    compared: NDArray[np.bool_]
    moved_m: float
    wall_s: float = np.nan

    def __len__(self) -> int:
        return len(self.compared)

    @property
    def worst(self) -> tuple[float, float, float]:
        """Largest differences [m], [rad], [N] over the compared rows."""
        position, orientation, tension = (
            float(np.max(part[self.compared], initial=0.0))
            for part in (self.position_m, self.orientation_rad, self.tension_N)
        )
        return position, orientation, tension

    @property
    def unsolved(self) -> int:
        """Number of rows at which seecr or MuJoCo did not come to rest."""
        return int(np.sum(~self.compared))

    @property
    def limits(self) -> tuple[float, float, float]:
        """Allowed differences [m], [rad], [N]."""
        moved = self.case.effect == CONTROL
        position, orientation, tension = _MOVED if moved else _EXACT
        return position, orientation, tension * max(1.0, self.case.robot.weight / _WEIGHT_N)

    @property
    def outcome(self) -> Outcome:
        """How the comparison ended."""
        near = all(part <= limit for part, limit in zip(self.worst, self.limits, strict=True))
        if not near:
            return Outcome.DIFFER
        return Outcome.NOT_CONVERGED if self.unsolved else Outcome.AGREE

    def as_json(self) -> dict[str, Any]:
        """As in ``results.json``."""
        position, orientation, tension = self.worst
        return {
            "name": self.case.name,
            "robot": self.case.model.stem,
            "effect": self.case.effect,
            "against": self.case.against,
            "agrees": self.outcome is Outcome.AGREE,
            "exit_status": self.outcome.exit_status,
            "position_m": position,
            "orientation_rad": orientation,
            "tension_N": tension,
            "moved_m": self.moved_m,
            "poses": {"total": len(self.compared), "unsolved": self.unsolved},
            "wall_s": self.wall_s,
        }


def effect_cases(robots: Sequence[str | Path] = ROBOTS, seed: int = 0) -> list[EffectCase]:
    """All effects and known loads on robots, with sizes drawn from a seed.

    Args:
        robots: names of shipped models, or MJCF files.
        seed: of the sizes.
    """
    paths = [robot if isinstance(robot, Path) else model_path(robot) for robot in robots]
    names = (*TRUE_EFFECTS, LOADS)
    return [EffectCase(path, effect, seed) for path in paths for effect in names]


def shipped_effect_cases(seed: int = 0) -> list[EffectCase]:
    """All effects, known loads and control on DemoBots, and sag on a robot where it is large."""
    control = [EffectCase(model_path(robot), CONTROL, seed) for robot in ROBOTS]
    sag = EffectCase(model_path(_LARGE), "cable_weight", seed)
    return [*effect_cases(seed=seed), *control, sag]


def run_effect(case: EffectCase) -> EffectResult:
    """Settle one effect in MuJoCo, solve it with seecr, and compare the readings."""
    began = time.perf_counter()
    if case.effect == CONTROL:
        return _run_control(case, began)
    plain = Experiment(case.robot, case.commands).predict()
    commands = replace(case.commands, loads=case.loads)
    experiment = Experiment(case.robot, commands)
    ours = experiment.predict(case.effects)
    # both sides evaluate the motion between two rows at as many points
    steps = experiment.path.steps
    truth = measure(case.robot, commands, case.effects, segments=_SEGMENTS, steps=steps)
    position_m, orientation_rad = gap(_seen(truth), _seen(ours.readings))
    moved = np.linalg.norm(ours.readings.position - plain.readings.position, axis=1)
    return EffectResult(
        case,
        position_m,
        orientation_rad,
        np.max(np.abs(truth.tension_readings - ours.readings.tensions), axis=1),
        truth.at_rest & ours.solved,
        float(np.max(moved)),
        time.perf_counter() - began,
    )


def _run_control(case: EffectCase, began: float) -> EffectResult:
    """Move the robot in MuJoCo under each scheme, and compare where it comes to rest.

    The true robot's cables are softer by a tenth, and its platform is heavier by a twentieth.
    """
    robot, random = case.robot, np.random.default_rng([case.seed, len(SCHEMES)])
    wanted = robot.reference_pose.copy()
    wanted[:3] += 0.02 * robot.reach * random.uniform(-1.0, 1.0, 3)
    true = [
        Term.of(robot, "stiffness", factor=0.9),
        Term.of(robot, "platform_mass", added_kg=0.05 * robot.mass),
    ]
    found = control_in_time(
        robot, wanted, scheme=SCHEMES, true=true, winches=_WINCHES, timing=_TIMING, gain=_GAIN,
        highest=_HIGHEST * robot.weight,
    )  # fmt: skip
    there = [(one.trace, one.rest.solution) for one in found.schemes.values()]
    rests = np.array([solution.pose[0] for _, solution in there])
    apart = gap(np.array([trace.pose[-1] for trace, _ in there]), rests)
    pulls = [np.abs(trace.tensions[-1] - solution.tensions[0]).max() for trace, solution in there]
    known, away = np.isfinite(apart[0]), float(np.max(gap(rests, rests[:1])[0]))
    seconds = time.perf_counter() - began
    return EffectResult(case, *apart, np.array(pulls), known, away, seconds)


def run_effects(
    cases: Sequence[EffectCase], executor: Executor | None, tell: Callable[[EffectResult], None]
) -> list[EffectResult]:
    """Run effects, several at a time.

    Args:
        cases: what to run.
        executor: runs them; this process if None.
        tell: called with each result as it comes.

    Returns:
        the results in the order of the cases.
    """
    order = sorted(range(len(cases)), key=lambda i: cases[i].effect not in _LONG)
    return run_tasks(run_effect, cases, executor, order, tell)


def _seen(readings: Any) -> Array:
    """Poses (n, 7) as the tracker reads them."""
    return np.concatenate([readings.position, readings.quat_wxyz], axis=1)


@cache
def _robot_and_commands(path: Path) -> tuple[Robot, Commands]:
    robot = load_robot(path)
    way = trajectory(robot, _POINTS, _REACH)
    rows = np.isin(way.run, ("along_low_fwd", "along_low_back", "loop"))
    run: Any = np.unique(way.run[rows], return_inverse=True)[1]
    temperature = 20.0 + 4.0 * np.sin(np.arange(rows.sum()))
    commands = Commands(pose=way.pose[rows], run=run, time=way.t_s[rows], temperature=temperature)
    return robot, commands


EFFECT_HEADS = [
    "effect", "robot", "moves [m]", "position [m]", "orientation [rad]", "tension [N]", "result",
    "against",
]  # fmt: skip


def effects_line(results: Sequence[EffectResult]) -> str:
    """How many effects agree, with what, the worst differences, and those that do not agree."""
    every = [result.case.model for result in results]
    robots = {model for model in every if every.count(model) > 1} or set(every)
    alone = [f"{r.case.effect} on {r.case.model.stem}" for r in results
             if r.case.model not in robots]  # fmt: skip
    found = {result.case.effect for result in results}
    effects = found - {LOADS, CONTROL}
    what = [counted(len(effects), "effect")] if effects or CONTROL not in found else []
    what += ["known loads"] if LOADS in found else []
    what += ["schemes of control"] if CONTROL in found else []
    bad = [result.case.name for result in results if result.outcome is not Outcome.AGREE]
    verdict = "all agree"
    if bad:
        verb = "does" if len(bad) == 1 else "do"
        verdict = f"{len(bad)} of {counted(len(results), 'case')} {verb} not agree: {some(bad)}"
    worst = max(results, key=lambda result: result.worst[0])
    orientation = max(result.worst[1] for result in results)
    tension = max(result.worst[2] for result in results)
    return (
        f"{' and '.join(what)} on {counted(len(robots), 'robot')}"
        f"{''.join(f', {name}' for name in alone)} against "
        f"{_counterparts(results)}: {verdict}; worst {worst.worst[0]:.1e} m "
        f"({worst.case.name}), {orientation:.1e} rad, {tension:.1e} N."
    )


def _counterparts(results: Sequence[EffectResult]) -> str:
    """How many effects are compared with what, in words."""
    found = _by_counterpart(results)
    counts = {kind: len(found.get(kind, {}).keys() - {LOADS, CONTROL}) for kind in Counterpart}
    parts = [f"{kind.value} ({count})" for kind, count in counts.items() if count]
    return " and ".join(parts) or Counterpart.MUJOCO.value


def against_line(results: Sequence[EffectResult]) -> str:
    """What seecr's mathematics was compared with: MuJoCo's own means, or our own, written again."""
    found = _by_counterpart(results).items()
    return " ".join(f"Checked against {kind.value}: {', '.join(names)}." for kind, names in found)


def _by_counterpart(results: Sequence[EffectResult]) -> dict[Counterpart, dict[str, None]]:
    """Names of effects, each once and in their order, by what they are compared with."""
    out: dict[Counterpart, dict[str, None]] = {}
    for result in results:
        out.setdefault(result.case.against, {})[result.case.effect] = None
    return out


def effect_text(result: EffectResult) -> str:
    """One effect's differences, the allowed ones, and the size of the effect itself."""
    position, orientation, tension = result.worst
    most, turn, pull = result.limits
    control = result.case.effect == CONTROL
    who = "schemes differ" if control else "the effect moves a reading"
    parts = [
        f"position {position:.1e} m, orientation {orientation:.1e} rad, tension {tension:.1e} N",
        f"allowed {most:.0e} m, {turn:.0e} rad, {pull:.0e} N",
        f"{who} by {result.moved_m:.1e} m",
    ]
    if result.unsolved:
        parts.append(
            f"no equilibrium at {result.unsolved} of {counted(len(result.compared), 'pose')}"
        )
    return "; ".join(parts)


def effect_failures(results: Sequence[EffectResult]) -> list[str]:
    """One line for each effect that fails."""
    bad = [result for result in results if result.outcome is not Outcome.AGREE]
    return [f"{result.case.name}: {effect_text(result)}" for result in bad]


def effect_cells(result: EffectResult) -> list[str]:
    """An effect as a row: name, robot, how far it moves a reading, differences, result."""
    values = (f"{value:.1e}" for value in (result.moved_m, *result.worst))
    case = result.case
    return [case.effect, case.model.stem, *values, result.outcome.value, case.against.value]
