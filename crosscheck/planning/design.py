"""What planned poses will be able to show, and which measurements to add to them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from crosscheck.fit.least_squares.imitation import imitated
from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import GivenCommands, commands_of
from crosscheck.planning.adding import NO_LIMITS, Limits
from crosscheck.planning.arguments import box_given, limits_given
from crosscheck.planning.detours import detours
from crosscheck.planning.extensions import extensions
from crosscheck.planning.greedy import Wanted
from crosscheck.planning.planned import (
    Planned,
    Reads,
    expected_sigma,
    kinds_of,
    near_slack,
    planned,
    slack_at,
)
from crosscheck.planning.proposer import propose
from crosscheck.planning.result import Plan, Visible
from crosscheck.planning.sight import all_visible
from crosscheck.planning.visibility import Signal, signals, signals_like
from crosscheck.preparation.prepare import Progress
from seecr.arguments import silent
from seecr.counted import counted, some
from seecr.effects import Term, Terms, layout_of
from seecr.equilibrium.solving import strained
from seecr.pose import Array

_MOST_LINES = 5


def make_plan(
    robot: GivenRobot,
    commands: GivenCommands,
    sigma: Sigma | None = None,
    progress: Progress = silent,
    *,
    reads: Collection[str] | str = (),
    limits: Limits = NO_LIMITS,
    box: Array | None = None,
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
        limits: lowest and highest tension [N] of poses that are proposed.
        box: (2, 3) [m] lowest and highest position of these.

    Raises:
        CrosscheckError: there is an unknown kind of reading.
        InputError: there are no commands; limits or a box of another form, or reversed.
    """
    robot = robot_of(robot)
    limits, box = limits_given(limits), box_given(box)
    commands = commands_of(commands, robot)
    stated = sigma or commands.sigma
    kinds = kinds_of(reads, stated)
    read = Reads.of_kinds(robot.n_cables, kinds)
    full, assumed = expected_sigma(robot, stated, kinds)
    free = [layout_of(name, robot) for name in commands.free]
    plan = planned(robot, commands, full, read, Terms(Term(one, one.null) for one in free))
    notes = [*robot.notes, *strained(robot), *commands.notes, *assumed, *_unsolved(plan)]
    loose = _loose(plan)
    notes += _loose_words(loose, plan)
    if not plan.problem.use.any():
        return Plan(plan, (), {}, ((), np.zeros((0, 0))), (), (), tuple(notes))
    progress("sensitivities", 0.1)
    own, missing = signals(plan)
    effects = all_visible(own)
    progress("what could be added", 0.4)
    suggestions = propose(
        [*extensions(plan, limits, box), *detours(plan)],
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
    )


def _loose(plan: Planned) -> tuple[tuple[int, tuple[str, ...]], ...]:
    """The lines at which cables are slack, with these cables' names."""
    names, slack = np.array(plan.problem.robot.cable_names), slack_at(plan)
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


def _unsolved(plan: Planned) -> list[str]:
    rows = np.flatnonzero(plan.unsolved)
    if len(rows) == 0:
        return []
    lines = plan.problem.data.lines_of(rows)
    status = plan.base.prediction.solution().status[rows[0]].value
    return [f"{lines} left out: {status}"]


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
