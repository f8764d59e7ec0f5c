"""Where a platform rests, in words: pose, cables, stiffness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seecr.pose import Array, rxyz_from_quat
from seecr.solution import Solution, Status

__all__ = ["at_rest", "cable_lines", "pose_lines", "sweep_lines"]


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
    yield "  quaternion " + " ".join(f"{q + 0.0:.7f}" for q in pose[3:])
    if commanded:
        yield (
            f"off its command by {_three(1e3 * away[:3], '+.4f')} mm "
            f"({1e3 * np.linalg.norm(away[:3]):.4g} mm), turned by "
            f"{np.degrees(np.linalg.norm(away[3:])):.4g} deg"
            f" ({_three(np.degrees(away[3:]), '+.4f')} deg about x y z)"
        )
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
