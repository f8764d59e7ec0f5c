"""The files of a correction: commands that can be read again, and their results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from seecr.columns.commands import CommandFile
from seecr.columns.csv import table_text
from seecr.inverse.correction import Correction
from seecr.pose import Array, pose_difference
from seecr.report.commanded import load_columns, toml_beside
from seecr.result import COORDINATES

__all__ = ["chance_lines", "corrected_csv", "corrected_toml", "joint_lines", "turned_words"]

_WANT = [f"want_{name}" for name in COORDINATES]
# A probability below this deserves attention.
_LIKELY = 0.95
# The largest one with two digits that is not certain.
_SURE = 0.99


def corrected_csv(found: Correction, wanted: CommandFile) -> str:
    """The wanted poses and the lengths to command, one row per pose with an answer.

    Numbers have all their digits: a length rounded to a micrometre is off by as much.

    Args:
        found: the correction.
        wanted: the list that it is for, whose runs, times, temperatures and loads are kept.
    """
    columns: dict[str, Sequence[object] | Array] = dict(wanted.conditions)
    columns |= dict(zip(_WANT, found.wanted.T, strict=True))
    columns |= {f"length_{k + 1}_m": one for k, one in enumerate(found.lengths.T)}
    columns |= load_columns(wanted.commands.loads)
    kept = np.flatnonzero(found.found).tolist()
    return table_text({name: [one[i] for i in kept] for name, one in columns.items()})


def corrected_toml(wanted: CommandFile) -> str:
    """The TOML that states how the lengths are meant."""
    return toml_beside(True, wanted.commands)


def chance_lines(
    found: Correction, kept: Array | None, minimum: bool = False, limited: bool = True
) -> Iterator[str]:
    """The probability that tensions stay within their limits, if the model has a covariance.

    Poses that are reached and the nearest of others are counted apart: the latter lie at the edge
    of what the limits allow, so that no other distribution of tensions helps there.

    Args:
        found: the correction.
        kept: (n,) probability of each row.
        minimum: whether tensions were to be as small as possible.
        limited: whether there is a highest tension, and so a middle of the limits.
    """
    if kept is None:
        return
    known, reached = np.isfinite(kept), found.reached
    at, near = np.flatnonzero(known & reached), np.flatnonzero(known & ~reached)
    if len(at):
        many, all_of_them = int(np.sum(kept[at] < _LIKELY)), len(at) == len(kept)
        yield (
            f"tensions stay within the limits {_least_chance(found, kept, at)}; "
            f"below {_LIKELY:g} at {many} of {'' if all_of_them else 'the '}{len(at)} reached"
        )
        # without more cables than degrees of freedom there is nothing to distribute
        if minimum and many and found.robot.n_cables > found.robot.n_dof:
            yield (
                "  --aim minimum puts a cable at its lowest tension, where it stays within the "
                f"limits with about 0.5; --aim middle{'' if limited else ' with --highest'} "
                "keeps away from them as far as the balance leaves a choice"
            )
    if len(near):
        yield (
            "at the nearest poses, on the edge of what can be held, they stay within them "
            f"{_least_chance(found, kept, near)}"
        )


def _least_chance(found: Correction, kept: Array, rows: NDArray[np.intp]) -> str:
    """The smallest probability at some rows, and at which."""
    worst = int(rows[np.argmin(kept[rows])])
    # as 1.00 it would read as certain
    least = f"above {_SURE:g}" if kept[worst] > _SURE + 0.005 else f"of at least {kept[worst]:.2f}"
    return f"with a probability {least}, lowest at {found.place(worst)}"


def turned_words(found: Correction) -> str:
    """How far the platform turns where positions alone are wanted."""
    turned = pose_difference(found.solution.pose, found.robot.reference_pose)[found.reached, 3:]
    largest = np.degrees(np.max(np.linalg.norm(turned, axis=1), initial=0.0))
    return (
        "with fewer cables than degrees of freedom the platform turns as the balance demands, here "
        f"by up to {largest:.3g} deg from the reference pose; state an orientation to have no other"
    )


def joint_lines(wanted: Array, read: Array, seen: float) -> Iterator[str]:
    """How far off a tracker reads poses (n, 7) where joints keep the platform from others.

    Nothing if all are within ``seen`` [m, rad].
    """
    off = np.abs(pose_difference(wanted, read)).reshape(-1, 2, 3).max(axis=(0, 2))
    if off.max() > seen:
        yield (
            f"the joints allow readings no nearer than {1e3 * off[0]:.3g} mm and "
            f"{np.degrees(off[1]):.3g} deg along single axes"
        )
