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


@dataclass(frozen=True)
class Clock:
    """An offset between two clocks.

    Attributes:
        shift: [s] tracker's clock minus commands'.
        said: how it was found; empty if the clocks agree or nothing can be inferred.
    """

    shift: float
    said: tuple[str, ...] = ()


def find_clock(held: HeldCommands, told: Array, rests: Dwells) -> Clock:
    """The offset that matches the rests with the commands.

    Args:
        held: by the clock of the commands. told: (k, 3) [m] where they should bring the platform.
        rests: of the whole stream, not cut where commands begin.
    """
    assert held.begin_s is not None
    if min(len(held.row), len(rests)) < _LEAST:
        return Clock(0.0)
    shifts = _likely(held.begin_s, rests.end_s)
    whose = [owners(held.shifted(shift), rests) for shift in shifts]
    off = np.array([_off(told, rests.position, number) for number in whose])
    best = int(np.argmin(off))
    others = [o for o, number in zip(off, whose, strict=True) if (number != whose[best]).any()]
    clear = off[best] < _ALIKE and off[best] * _CLEAR < min(others, default=np.inf)
    if not clear or off[0] <= _CLEAR * off[best]:
        return Clock(0.0)
    shift, n = _leaves(held.begin_s, rests, whose[best])
    sign = "more" if shift > 0.0 else "less"
    return Clock(
        shift,
        (
            f"the tracker's clock shows {abs(shift):.3f} s {sign} than that of the commands, "
            f"estimated from {counted(n, 'command')} at which the platform starts to move (--clock "
            f"{shift:.3f})",
        ),
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


def _leaves(begin: Array, rests: Dwells, number: NDArray[np.int64]) -> tuple[float, int]:
    """Median time [s] from a command to the end of the rest before it, and the number of these."""
    k = 1 + np.flatnonzero((number[:-1] >= 0) & (number[1:] >= 0))
    return float(np.median(rests.end_s[number[k - 1]] - begin[k])), len(k)
