"""What the tracker's clock shows more than that of the commands, found from where each rests.

Two programs that log one day seldom share a clock. How far apart two resting poses are is the same
in any frame: with the right shift the tracked distances are those between the commands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.importing.dwells import Dwells
from crosscheck.importing.join import HeldCommands, owners
from seecr.pose import Array

# So many rests show a pattern.
_LEAST = 4
# Shifts looked at: those by which most commands begin as the platform leaves a rest.
_MOST = 40
# Distances that are off by this part of their usual size still belong together; a shift is taken
# if all others are off by so many times as much, and no shift too if it is not so much worse.
_ALIKE, _CLEAR = 0.2, 1.5


@dataclass(frozen=True)
class Clock:
    """A shift between two clocks.

    Attributes:
        shift: [s] what the tracker's shows more.
        said: how it was found; nothing where the clocks are one, or nothing else can be told.
    """

    shift: float
    said: tuple[str, ...] = ()


def find_clock(held: HeldCommands, told: Array, rests: Dwells) -> Clock:
    """The shift that brings the rests to the commands.

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
    way = "more" if shift > 0.0 else "less"
    return Clock(
        shift,
        (
            f"the tracker's clock shows {abs(shift):.3f} s {way} than that of the commands, by {n} "
            f"commands with which the platform leaves its place (--clock {shift:.3f})",
        ),
    )


def _likely(begin: Array, end: Array) -> Array:
    """Shifts [s], none first, by which many commands begin as a rest ends."""
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
    """How far distances between rests are from those between commands, as a part of these.

    A command without a rest counts as one whose distances are nothing.
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
    """Usual time [s] from a command to the end of the rest before it, and of how many."""
    k = 1 + np.flatnonzero((number[:-1] >= 0) & (number[1:] >= 0))
    return float(np.median(rests.end_s[number[k - 1]] - begin[k])), len(k)
