"""Offset between the tracker's clock and that of the commands, found from the resting poses.

Two programs that log at the same time seldom share a clock. The distance between two resting poses
is the same in any frame: with the right offset the tracked distances are those between commands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.importing.dwells import Dwells
from crosscheck.importing.join import HeldCommands, owners
from seecr.counted import counted
from seecr.pose import Array

# Least number of rests that show a pattern.
_LEAST = 4
# Number of offsets tried: those at which most commands begin as the platform leaves a rest.
_MOST = 40
# Distances that are off by this part of their usual size still match. An offset is accepted if all
# others are worse by this factor, and no offset is preferred unless it is worse by as much.
_ALIKE, _CLEAR = 0.2, 1.5
# If the clocks match as they are, moves must begin late or early by times that differ by less than
# this part of the shift, for most commands, to say what the shift is.
_STEADY, _BULK = 0.25, 0.75


@dataclass(frozen=True)
class Clock:
    """An offset between two clocks.

    Attributes:
        shift: [s] tracker's clock minus commands'.
        said: how it was found; empty if the clocks agree or nothing can be inferred.
    """

    shift: float
    said: tuple[str, ...] = ()


def find_clock(held: HeldCommands, told: Array, rests: Dwells, least: float = 0.0) -> Clock:
    """The offset that matches the rests with the commands.

    A small offset leaves most rests with their commands, and so does a robot that begins to move
    late, or slowly. Readings do not tell which it is: that is said, and the offset is left alone.

    Args:
        held: by the clock of the commands. told: (k, 3) [m] where they should bring the platform.
        rests: of the whole stream, not cut where commands begin.
        least: [s] offsets smaller than this do not matter.
    """
    assert held.begin_s is not None and held.end_s is not None
    if min(len(held.row), len(rests)) < _LEAST:
        return Clock(0.0)
    shifts = _likely(held.begin_s, rests.end_s)
    whose = [owners(held.shifted(shift), rests) for shift in shifts]
    off = np.array([_off(told, rests.position, number) for number in whose])
    best = int(np.argmin(off))
    if off[0] <= _CLEAR * off[best]:
        best = 0
    others = [o for o, number in zip(off, whose, strict=True) if _other(number, whose[best])]
    if off[best] >= _ALIKE or off[best] * _CLEAR >= min(others, default=np.inf):
        return Clock(0.0)
    late = _late(held.end_s, rests, whose[best])
    if best == 0 and len(late) == 0:
        return Clock(0.0)
    shift, n = float(np.median(late)) if len(late) else float(shifts[best]), len(late)
    if best == 0:
        unsteady = float(np.quantile(np.abs(late - shift), _BULK)) > _STEADY * abs(shift)
        small = abs(shift) < max(least, 1e-9)
        return Clock(0.0, () if small or unsteady else (_late_words(shift),))
    sign = "more" if shift > 0.0 else "less"
    return Clock(
        shift,
        (
            f"the tracker's clock shows {abs(shift):.3f} s {sign} than that of the commands, "
            f"estimated from {_from_what(n)} (--clock {shift:.3f})",
        ),
    )


def _from_what(moves: int) -> str:
    if not moves:
        return "where the platform rests"
    return f"{counted(moves, 'command')} at which the platform starts to move"


def _late_words(shift: float) -> str:
    when = "after" if shift > 0.0 else "before"
    return (
        f"moves begin about {abs(shift):.3f} s {when} they are commanded; if that is the clocks "
        f"and not the robot, give --clock {shift:.3f}"
    )


def _likely(begin: Array, end: Array) -> Array:
    """Offsets [s], zero first, at which many commands begin as a rest ends."""
    every = np.sort((end[None, :] - begin[1:, None]).ravel())
    gap = 0.25 * float(np.min(np.diff(begin)))
    votes = np.searchsorted(every, every + gap) - np.searchsorted(every, every - gap)
    found: list[float] = [0.0]
    for k in np.argsort(-votes, kind="stable"):
        if all(abs(every[k] - other) > gap for other in found[1:]):
            found.append(float(every[k]))
        if len(found) > _MOST:
            break
    return np.array(found)


def _off(told: Array, place: Array, number: NDArray[np.int64]) -> float:
    """Relative error of the distances between rests, compared with those between commands.

    Missing rests count as if their distances were zero.
    """
    there = number >= 0
    every = min(len(told), len(place))
    if there.sum() < _LEAST:
        return np.inf
    wanted, got = _distances(told[there]), _distances(place[number[there]])
    usual = float(np.mean(_distances(told) ** 2))
    n = int(there.sum())
    lacking = max(every**2 - n**2, 0) * usual
    return float(np.sqrt((np.sum((wanted - got) ** 2) + lacking) / (max(every, n) ** 2 * usual)))


def _distances(points: Array) -> Array:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=-1))


def _other(number: NDArray[np.int64], best: NDArray[np.int64]) -> bool:
    """Whether rests belong to other commands, not only one more or less at an end."""
    both = (number >= 0) & (best >= 0)
    return bool(np.any(number[both] != best[both]) or 2 * both.sum() < (best >= 0).sum())


def _late(end: Array, rests: Dwells, number: NDArray[np.int64]) -> Array:
    """Times [s] from the end of each held command to that of its rest, if another one follows.

    A command ends with the next set point, which may only be passed on the way to the next rest.
    """
    k = np.flatnonzero((number[:-1] >= 0) & (number[1:] >= 0))
    return np.asarray(rests.end_s[number[k]] - end[k])
