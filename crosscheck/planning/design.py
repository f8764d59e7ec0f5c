"""What planned poses will be able to show, and which measurements to add to them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.fit.algebra import imitated
from crosscheck.given import GivenNames, GivenRobot, names_of, robot_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import GivenCommands, commands_of
from crosscheck.planning.places import (
    detours,
    extensions,
    held_within,
    in_room,
    tilted_grid,
    trustworthy,
    upright,
)
from crosscheck.planning.planned import (
    Planned,
    Reads,
    expected_sigma,
    kinds_of,
    near_slack,
    planned,
)
from crosscheck.planning.proposer import chosen_poses, propose
from crosscheck.planning.result import Plan, Visible, all_visible
from crosscheck.planning.room import Demand, Room, usual_tension
from crosscheck.planning.visibility import (
    EXACT,
    Signal,
    Wanted,
    signal_left,
    signals,
    signals_like,
)
from crosscheck.preparation.prepare import Progress
from seecr.arguments import silent, whole
from seecr.counted import counted, some
from seecr.description.joints import pose_of_values
from seecr.description.robot import ITS_A_POINT, Robot
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.equilibrium.strange import strange
from seecr.pose import Array

_MOST_LINES = 5


def make_plan(
    robot: GivenRobot,
    commands: GivenCommands,
    sigma: Sigma | None = None,
    progress: Progress = silent,
    *,
    reads: Collection[str] | str = (),
    limits: ArrayLike | None = None,
    box: ArrayLike | None = None,
    tilt: float = 0.0,
    floor: float | None = None,
    effects: GivenNames = (),
) -> Plan:
    """Predict what planned commands will show of each effect.

    Args:
        robot: a robot, or its MJCF file.
        commands: planned poses (n, 7), or a file of poses or lengths, or what was read from it;
            readings in it are ignored.
        sigma: expected noise; by default that of the commands.
        progress: called with what is being done and the fraction that is done.
        reads: kinds of readings there will be, of "position", "orientation" and "tension", or one
            of them; by default the pose, and tensions if their noise is stated.
        limits: lowest and highest tension [N] of poses that are proposed; None, also for one of
            the two, for what a laboratory may run: all cables taut with a margin where the robot
            can be, and none pulls more than twice what is usual.
        box: (2, 3) [m] lowest and highest position of these; by default inside the frame of the
            exit points, with a margin.
        tilt: [rad] of these, besides level ones.
        floor: [m] its height against gravity; by default that of the robot's file.
        effects: of one's own, to be considered beside those of the catalogue.

    Returns:
        what each effect's smallest visible size is, and what to add. About 1 s for 144 rows.

    Raises:
        CrosscheckError: there is an unknown kind of reading.
        InputError: there are no commands; limits, a box, a tilt or a floor of another form.

    Example:
        ``crosscheck.make_plan(robot, "measured.csv").effects``
    """
    robot = robot_of(robot)
    room = Room.of(robot, limits=limits, box=box, tilt=tilt, floor=floor)
    commands = commands_of(commands, robot)
    stated = sigma or commands.sigma
    kinds = kinds_of(reads, stated)
    read = Reads.of_kinds(robot.n_cables, kinds)
    full, assumed = expected_sigma(robot, stated, kinds)
    free = [layout_of(name, robot) for name in commands.free]
    model = Terms(Term(one, one.null) for one in free)
    plan = planned(robot, commands, full, read, model, _beside_catalogue(effects))
    notes = [*robot.notes, *strange(robot), *commands.notes, *assumed]
    if plan.unsolved.any():
        status = plan.base.prediction.solution().status[int(np.argmax(plan.unsolved))].value
        notes.append(f"{commands.lines_of(plan.unsolved)} left out: {status}")
    loose = _loose(plan)
    notes += _loose_words(loose, plan)
    if not plan.problem.use.any():
        return Plan(plan, (), {}, ((), np.zeros((0, 0))), (), (), tuple(notes))
    progress("sensitivities", 0.1)
    own, missing = signals(plan)
    effects = all_visible(own)
    progress("what could be added", 0.4)
    suggestions = propose(
        [one for one in (*extensions(plan, room), *detours(plan, room)) if room.allows(one.plan)],
        own,
        _wanted(own, effects),
        lambda there: signals_like(there, own),
        lambda text, part: progress(text, 0.5 + 0.5 * part),
    )
    names = robot.cable_names
    return Plan(
        planned=plan,
        effects=tuple(sorted(effects.values(), key=lambda v: v.factor)),
        missing=missing,
        confusion=_confusion(own),
        suggestions=suggestions,
        slack=tuple((int(commands.line[k]), names[i]) for k, i in near_slack(plan)),
        notes=tuple(dict.fromkeys(notes)),
        loose=loose,
        demand=Demand.of(plan),
    )


def _beside_catalogue(effects: GivenNames) -> frozenset[str]:
    """Names of the catalogue's effects and of further ones."""
    return frozenset({*catalogue(), *names_of(effects, "effects")})


def _loose(plan: Planned) -> tuple[tuple[int, tuple[str, ...]], ...]:
    """The lines at which cables are slack, with these cables' names."""
    names, slack = np.array(plan.problem.robot.cable_names), plan.base.prediction.slack
    rows = np.flatnonzero(plan.problem.use & slack.any(axis=1))
    line = plan.problem.data.line
    return tuple((int(line[k]), tuple(names[slack[k]].tolist())) for k in rows)


def _loose_words(loose: Sequence[tuple[int, tuple[str, ...]]], plan: Planned) -> list[str]:
    if not loose:
        return []
    lines = [f"line {line} ({' '.join(cables)})" for line, cables in loose]
    rows = counted(int(plan.problem.use.sum()), "pose")
    return [
        f"cables are slack at {len(loose)} of {rows}: {some(lines, _MOST_LINES)}; a lowest tension "
        "above zero leaves such poses out of what is chosen or proposed"
    ]


def _confusion(own: Mapping[str, Signal]) -> tuple[tuple[str, ...], Array]:
    part = [
        [1.0 if a is b else imitated(a.columns, b.basis) for b in own.values()]
        for a in own.values()
    ]
    return tuple(own), np.array(part).reshape(len(own), len(own))


def _wanted(own: Mapping[str, Signal], effects: Mapping[str, Visible]) -> list[Wanted]:
    """What these poses do not show or tell apart.

    Exact twins are included: no pose separates them, but a payload or a sensor may.
    """
    out = []
    for name, v in effects.items():
        if not v.visible:
            out.append(Wanted(name, "", own[name].power, v.needed))
            continue
        out += [Wanted(name, other, value, v.needed) for other, value in v.confused]
        out += [Wanted(name, twin, 0.0, v.needed) for twin in v.twins]
    return out


# Chooses poses to measure for a robot, those that tell most, and arranges them in runs.

# Candidates along x, y, z; number of random ones for joints; most candidates that are evaluated.
_GRID, _JOINT_POSES, _MOST = (6, 6, 4), 400, 240
# How far hinges turn [rad] in any case where there are no slides, so that nothing else moves.
_TURN = 0.2
# An effect should be told from so many others, those that are most like it.
_RIVALS = 3
# Number of candidates that each step of the choice tries.
_SAMPLE = 40
# Rows of a run, and least number of runs: diagnoses hold out one after the other.
_ROWS_A_RUN, _LEAST_RUNS = 12, 3


def choose_poses(
    robot: GivenRobot,
    rows: int,
    *,
    sigma: Sigma | None = None,
    reads: Collection[str] | str = (),
    limits: ArrayLike | None = None,
    box: ArrayLike | None = None,
    tilt: float = 0.0,
    floor: float | None = None,
    progress: Progress = silent,
    effects: GivenNames = (),
) -> Measurements:
    """Choose poses to measure: those that together show and tell apart most effects.

    Args:
        robot: a robot, or its MJCF file.
        rows: number of poses.
        sigma: expected noise; by default that of good sensors.
        reads: kinds of readings there will be; see :func:`make_plan`.
        limits, box, tilt, floor: where the robot may be sent; see :func:`make_plan`.
        progress: called with what is being done and the fraction that is done.
        effects: of one's own, to be shown too.

    Returns:
        Commands, in runs that go from each pose to one nearby.

    Raises:
        CrosscheckError: the robot can hold too few poses within the limits.
        InputError: ``rows`` is not a whole number from 1 on; limits, a box, a tilt or a floor of
            another form.

    Example:
        ``crosscheck.choose_poses("robot.xml", 12).command_pose``
    """
    robot, rows = robot_of(robot), whole(rows, "rows", least=1)
    room = Room.of(robot, limits=limits, box=box, tilt=tilt, floor=floor)
    progress("looking for poses", 0.0)
    kinds = kinds_of(reads, sigma or Sigma())
    full, _assumed = expected_sigma(robot, sigma or Sigma(), kinds)
    tried, channels = candidate_poses(room), Reads.of_kinds(robot.n_cables, kinds)
    there_are = _beside_catalogue(effects)
    plan, found = None, 0
    if robot.n_driven >= robot.n_dof:
        held = held_within(robot, tried, room.bounds)
        plan = _usable(room, held, rows, full, channels, there_are)
        found = 0 if plan is None else plan.problem.data.n_rows
    if robot.n_driven <= robot.n_dof and found < rows:  # few cables hold little, but rest nearby
        plan = _usable(room, tried, rows, full, channels, there_are)
        found = 0 if plan is None else plan.problem.data.n_rows
    if plan is None or found < rows:
        cure = "ask for fewer rows, a wider range of tensions, or another box"
        raise CrosscheckError(
            f"robot {robot.name} can be held at {found} of {counted(len(tried), 'pose')} that "
            f"were tried; expected {rows} or more; {ITS_A_POINT if robot.is_point else cure}"
        )
    progress("sensitivities", 0.2)
    there = signals(plan)[0]
    nothing = {n: Signal(s.layout, s.shape, s.columns[:0]) for n, s in there.items()}
    progress("choosing poses", 0.4)
    chosen = chosen_poses(
        nothing, there, plan.problem.row_of, _wanted_of_each(there), rows, _SAMPLE
    )
    pose = plan.problem.data.command_pose
    assert pose is not None
    pose = pose[sorted(chosen)]
    pose = pose[_way(robot, pose)]
    runs = max(_LEAST_RUNS, round(rows / _ROWS_A_RUN))
    run = np.array([f"run {1 + k * runs // len(pose)}" for k in range(len(pose))])
    path, noise = Path("poses.csv"), sigma or Sigma()
    return Measurements(path, robot.n_cables, run, command_pose=pose, sigma=noise)


def candidate_poses(room: Room) -> Array:
    """Poses (n, 7) all over a room."""
    robot, box = room.robot, room.box
    frame = upright(robot) if box is None else np.eye(3)
    points = np.concatenate([room.points, robot.reference_pose[None, :3]]) @ frame
    low, high = room.extent(
        frame, *((points.min(axis=0), points.max(axis=0)) if box is None else box)
    )
    if robot.joints:
        slides = ~robot.hinges
        axes = np.array([joint.axis for joint in robot.joints]) @ frame
        turn = room.tilt or (_TURN if robot.hinges.all() else 0.0)
        reach = np.where(slides, 0.5 * np.abs(axes @ (high - low)), turn)
        home = robot.reference_pose[:3] @ frame
        middle = np.where(slides, axes @ (0.5 * (low + high) - home), 0.0)
        random = np.random.default_rng(0).uniform(-1.0, 1.0, (_JOINT_POSES, len(reach)))
        return in_room(room, pose_of_values(robot, middle + reach * random)[0])
    return in_room(room, tilted_grid(robot, low, high, _GRID, frame, room.tilt))


def _usable(
    room: Room, poses: Array, rows: int, sigma: Sigma, reads: Reads,
    considered: frozenset[str] = frozenset(),
) -> Planned | None:  # fmt: skip
    """The plan of those poses at which the plain robot rests, stiff and where it may be sent."""
    robot = room.robot
    if len(poses) == 0:
        return None
    every = _plan(robot, poses, sigma, reads, considered)
    if not every.problem.use.any():
        return None
    # a robot works about its home more than at the edge, where tensions grow without end
    away = np.linalg.norm(poses[:, :3] - robot.reference_pose[:3], axis=1)
    usual = usual_tension(every, away <= np.median(away))
    kept = np.flatnonzero(room.may_run(every, trustworthy(every, every), usual, rows))
    if len(kept) == 0:
        return None
    # a selection spread over all of them, as they are in the order of the grid
    kept = kept[np.unique(np.linspace(0, len(kept) - 1, min(_MOST, len(kept))).astype(int))]
    return _plan(robot, poses[kept], sigma, reads, considered)


def _plan(
    robot: Robot, poses: Array, sigma: Sigma, reads: Reads, considered: frozenset[str]
) -> Planned:
    run = np.array([f"pose {k + 1}" for k in range(len(poses))])
    data = Measurements(Path("poses.csv"), robot.n_cables, run, command_pose=poses)
    return planned(robot, data, sigma, reads, considered=considered)


def _wanted_of_each(there: dict[str, Signal]) -> list[Wanted]:
    """Each effect that all poses together show, and the effects that are most like it."""
    out = []
    for name, found in all_visible(there).items():
        if not found.visible:
            continue
        out.append(Wanted(name, "", 0.0, found.needed))
        left = {
            other: signal_left(there[name], signal)
            for other, signal in there.items()
            if other != name and other not in found.twins
        }
        hard = [o for o in sorted(left, key=lambda o: left[o]) if left[o] > EXACT * found.needed]
        out += [Wanted(name, other, 0.0, found.needed) for other in hard[:_RIVALS]]
    return out


def _way(robot: Robot, poses: Array) -> NDArray[np.int64]:
    """An order in which each pose is followed by the nearest one that is left."""
    at, left, out = robot.reference_pose[:3], list(range(len(poses))), []
    while left:
        nearest = min(left, key=lambda k: float(np.linalg.norm(poses[k, :3] - at)))
        left.remove(nearest)
        out.append(nearest)
        at = poses[nearest, :3]
    return np.array(out)
