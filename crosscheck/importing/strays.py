"""Leaves out dwells at which the platform was where it had been, and not where it was commanded.

A run that crashes ends with a platform that does not move any more, whatever is commanded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.importing.align import LEFT, MOST, Frames, size_of_cloud
from crosscheck.importing.join import commanded
from crosscheck.importing.take import Take
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.pose import Array

# A dwell is not far from its command unless it is so many times as far as most.
_USUAL = 10.0
# It did not follow its command if it moved by less than this part of what was asked.
_FOLLOWED = 0.2


def without_strays(
    robot: Robot, takes: Sequence[Take], frames: Frames
) -> tuple[list[Take], list[str]]:
    """The recordings without dwells that did not follow their commands, and notes on them.

    Such a dwell is far from its command, by the measure by which frames cannot be aligned, much
    farther than most, and the platform has hardly moved since the dwell before, though it was told
    to. If more than a few of a recording are, it is no matter of single dwells: all stay.
    """
    told = [_told(robot, take) for take in takes]
    off = [_off(take, frames, own) for take, own in zip(takes, told, strict=True)]
    usual = float(np.median(np.concatenate(off)))
    limit = max(LEFT * size_of_cloud(np.concatenate(told)), _USUAL * usual)
    out, notes = list[Take](), list[str]()
    for take, own, commands in zip(takes, off, told, strict=True):
        far = (own > limit) & _stood_still(take, commands)
        if 0 < far.sum() <= (1.0 - MOST) * len(far) + 1e-9:
            notes.append(_note(take, far, own, usual))
            take = _without(take, far)
        out.append(take)
    return out, notes


def _stood_still(take: Take, told: Array) -> NDArray[np.bool_]:
    """(n,) whether the platform has hardly moved since the dwell before, though it was told to."""
    place = take.dwells.position[take.used]
    moved, asked = (np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (place, told))
    return np.concatenate([[False], moved < _FOLLOWED * asked])


def _told(robot: Robot, take: Take) -> Array:
    """Commanded positions (n, 3) [m] of the dwells that are used."""
    rows = take.held.log.rows(take.held.row[take.number >= 0])
    return commanded(robot, rows)[:, :3]


def _off(take: Take, frames: Frames, told: Array) -> Array:
    """Distances (n,) [m] of the dwells that are used from where they are told to be (n, 3)."""
    quat = take.dwells.quat_wxyz
    place, _turned = frames.poses(
        take.dwells.position[take.used], None if quat is None else quat[take.used]
    )
    return np.asarray(np.linalg.norm(place - told, axis=1))


def _without(take: Take, far: NDArray[np.bool_]) -> Take:
    number = take.number.copy()
    number[np.flatnonzero(number >= 0)[far]] = -1
    return replace(take, number=number)


def _note(take: Take, far: NDArray[np.bool_], off: Array, usual: float) -> str:
    dwells, gone = take.dwells, take.used[far]
    lines = ", ".join(str(int(line)) for line in take.stream.line[dwells.start[gone]])
    return (
        f"{take.stream.path.name}: {counted(len(gone), 'dwell')} left out, from line {lines} on: "
        f"up to {1e3 * float(np.max(off[far])):.4g} mm from where it is commanded, other dwells "
        f"{1e3 * usual:.3g} mm; did the platform stop moving, or do the clocks disagree (--clock)?"
    )
