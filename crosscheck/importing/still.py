"""Refuses a recorded body that stands still while the robot is commanded to move: a wrong one."""

from __future__ import annotations

import numpy as np

from crosscheck.importing.align import size_of_cloud
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.dwells import LEAST, sample_noise
from crosscheck.importing.logged import Logged, Stream
from crosscheck.measurements.data import Measurements
from seecr.counted import some

# A body moves if it is farther from its middle than this many times its noise, or than rounding
# [m]. It should, if commands are so many times as far from theirs.
_NOISE, _ROUNDED, _COMMANDED = 6.0, 1e-9, 10.0
_MOST_NAMED = 12


def refuse_still(stream: Stream, export: Logged, log: Measurements, choices: ImportChoices) -> None:
    """Refuse a body that never moves, such as one on the robot's frame.

    Raises:
        InputFileError: it does not move, and the commands do.
    """
    seen = stream.position[stream.seen]
    if len(seen) < LEAST:  # which is refused for that
        return
    moved = size_of_cloud(seen)
    if moved > max(_NOISE * sample_noise(stream), _ROUNDED) or not _told_to_move(log, moved):
        return
    others = [name for name in export.bodies if name != choices.body]
    there = f" The file also has {some(others, _MOST_NAMED)}." if others else ""
    within = f"{1e3 * moved:.2g}" if moved > _ROUNDED else "0"
    raise stream.error(
        f"{_named(choices)} never moves: it stays within {within} mm (rms), while the "
        f"commands of {log.path.name} move the platform; expected the body on the platform: is it "
        f"another one (--body)?{there}"
    )


def _told_to_move(log: Measurements, moved: float) -> bool:
    """Whether commands move the platform by much more than ``moved`` [m]."""
    least = _COMMANDED * max(moved, _ROUNDED)
    if log.command_pose is not None:
        return size_of_cloud(log.command_pose[:, :3]) > least
    return bool(np.any(np.ptp(np.asarray(log.command_lengths), axis=0) > least))


def _named(choices: ImportChoices) -> str:
    if choices.markers:
        return f"the body of {', '.join(choices.markers)}"
    return f"the body {choices.body}" if choices.body else "the body"
