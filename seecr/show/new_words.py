"""A new robot in words: what it is, and whether it rests at its reference pose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seecr.counted import between, counted, some
from seecr.description.joints import unresisted
from seecr.pose import Array
from seecr.show.pose_words import at_rest, direction_words, softest_words
from seecr.statics.solution import Solution
from seecr.units import millimetres, short, significant


def home_lines(solution: Solution) -> Iterator[str]:
    """Whether the robot rests at its reference pose, and if not, why not."""
    yield f"sent to its reference pose: {solution.sentence(0)}"
    robot = solution.robot
    if at_rest(solution):
        away = solution.deviation[0]
        taut = robot.n_cables - int(solution.slack[0].sum())
        yield (
            f"  it comes to rest {millimetres(np.linalg.norm(away[:3]), 3)} and "
            f"{short(float(np.degrees(np.linalg.norm(away[3:]))))} deg off, {taut} of "
            f"{counted(robot.n_cables, 'cable')} taut, tensions "
            f"{between(solution.tensions[0].min(), solution.tensions[0].max())} N; softest: "
            f"{softest_words(solution)}, {significant(solution.smallest_eigenvalue[0], 3)} N/m"
        )
        return
    yield f"  {reason(solution)}"


def reason(solution: Solution) -> str:
    """Why a robot does not rest where it was sent: directions in which no cable resists."""
    robot, pose = solution.robot, solution.pose[0]
    if not np.isfinite(pose).all():
        pose = solution.command[0]
    free = unresisted(robot, pose, np.ones(robot.n_cables, dtype=bool))
    if len(free):
        return (
            f"no cable, taut or slack, resists {counted(len(free), 'motion')}: "
            f"{_motions(solution, free)}; expected more cables, or anchor points elsewhere"
        )
    slack = solution.slack[0]
    if slack.all():
        return (
            "no cable pulls there, since nothing loads them: tighten them with --pretension 10, "
            "which shortens them to 10 N or more"
        )
    loose = unresisted(robot, pose, ~slack) if slack.any() else free
    if len(loose):
        names = [name for name, hangs in zip(robot.cable_names, slack, strict=True) if hangs]
        return (
            f"with {some(names)} slack nothing but the weight resists: "
            f"{_motions(solution, loose)}; another pose (--at) may hold it"
        )
    if np.isfinite(solution.softest_direction[0]).all():
        return f"it gives way there: {softest_words(solution)}; another pose (--at) may hold it"
    return "no pose was found where its cables carry it; another reference pose (--at) may do"


def _motions(solution: Solution, motions: Array) -> str:
    return "; ".join(direction_words(solution.robot, one) for one in motions)
