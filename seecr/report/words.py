"""Where a platform rests, in words: pose, cables, stiffness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seecr.pose import Array, pose_difference, rxyz_from_quat
from seecr.solution import Solution, Status

__all__ = [
    "at_rest",
    "cable_lines",
    "other_lines",
    "pose_lines",
    "softest_words",
    "sweep_lines",
]

# A part of a direction below this is not worth a word.
_PART = 0.1


def pose_lines(solution: Solution, i: int = 0, commanded: bool = True) -> Iterator[str]:
    """Where pose i rests and how far that is from its command.

    Args:
        solution: the answers.
        i: which of them.
        commanded: whether a pose was commanded, and not lengths.
    """
    yield f"{solution.robot.name}: {solution.sentence(i)}"
    pose, away = solution.pose[i], solution.deviation[i]
    if not np.isfinite(pose).all():
        return
    angles = _three(np.degrees(rxyz_from_quat(pose[3:])), ".3f")
    yield f"rests at x y z {_three(1e3 * pose[:3], '.3f')} mm, turned rx ry rz {angles} deg"
    yield "  quaternion " + " ".join(f"{q + 0.0:.7f}" for q in np.round(pose[3:], 9))
    if commanded:
        yield (
            f"off its command by {_three(1e3 * away[:3], '+.4f')} mm "
            f"({1e3 * np.linalg.norm(away[:3]):.4g} mm), turned by "
            f"{np.degrees(np.linalg.norm(away[3:])):.4g} deg"
            f" ({_three(np.degrees(away[3:]), '+.4f')} deg about x y z)"
        )
    soft = solution.smallest_eigenvalue[i]
    yield f"softest: {softest_words(solution, i)}, {soft:.4g} N/m"
    yield f"forces balance to {solution.residual[i]:.1g} of the load"


def cable_lines(solution: Solution, i: int = 0) -> Iterator[str]:
    """One line per cable: tension, rest length, how far it is stretched."""
    robot = solution.robot
    wide = max(len("cable"), *(len(name) for name in robot.cable_names))
    yield f"{'cable':<{wide}}  tension [N]  rest length [m]"
    for k, name in enumerate(robot.cable_names):
        slack = "  slack" if solution.slack[i, k] else ""
        tension, rest = solution.tensions[i, k] + 0.0, solution.rest_lengths[i, k]
        yield f"{name:<{wide}}  {tension:11.4f}  {rest:15.6f}{slack}"


def softest_words(solution: Solution, i: int = 0) -> str:
    """The direction in which pose i is softest, such as "turn about y"."""
    robot, direction = solution.robot, solution.softest_direction[i].copy()
    if not np.isfinite(direction).all():
        return "no direction"
    if robot.joints:
        parts = zip(robot.joints, direction, robot.hinges, strict=True)
        sizes = [
            (joint.name, abs(v) * (robot.length if turns else 1.0)) for joint, v, turns in parts
        ]
        return "along " + " and ".join(name for name, size in sizes if size > _PART)
    words = []
    for verb, part in (("move along", direction[:3]), ("turn about", robot.length * direction[3:])):
        size = float(np.linalg.norm(part))
        if size > _PART:
            axes = [a for a, v in zip("xyz", part / size, strict=True) if abs(v) > 2 * _PART]
            words.append(f"{verb} {' and '.join(axes)}")
    return ", ".join(words)


def other_lines(solution: Solution, others: Solution | None, i: int = 0) -> Iterator[str]:
    """Where else the platform could rest; by how much its energy would be higher there."""
    if others is None:
        return
    gaps = pose_difference(others.pose, np.repeat(solution.pose[i : i + 1], len(others), axis=0))
    apart = np.linalg.norm(gaps[:, :3], axis=1) / solution.robot.length
    away = np.flatnonzero(np.maximum(apart, np.linalg.norm(gaps[:, 3:], axis=1)) > 1e-6)
    if len(away) == 0:
        yield "no other stable equilibrium was found"
    for k in away:
        slack = [n for n, s in zip(solution.robot.cable_names, others.slack[k], strict=True) if s]
        yield (
            f"could also rest {1e3 * np.linalg.norm(gaps[k, :3]):.4g} mm and "
            f"{np.degrees(np.linalg.norm(gaps[k, 3:])):.4g} deg away, "
            f"{1e3 * (others.energy[k] - solution.energy[i]):+.4g} mJ, "
            f"slack: {' '.join(slack) or 'none'}"
        )


def sweep_lines(solution: Solution, commanded: bool = True) -> list[str]:
    """A sweep in a few lines."""
    lines = solution.lines()
    if not commanded:
        lines = [line for line in lines if not line.startswith("furthest from")]
    counts = solution.slack[solution.converged].sum(axis=1)
    if len(counts) and counts.max() > 0:
        parts = [f"{int(np.sum(counts == k))} with {k}" for k in np.unique(counts)]
        lines.append(f"poses by number of slack cables: {', '.join(parts)}")
    return lines


def _three(values: Array, form: str) -> str:
    return ", ".join(f"{value + 0.0:{form}}" for value in np.round(values, 6))


def at_rest(solution: Solution) -> bool:
    """Whether every pose rests, be it free to move along some direction."""
    return all(s in (Status.CONVERGED, Status.SINGULAR) for s in solution.status)
