"""Many poses in words: a sweep, a map, a correction."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.description.cables import rope_of
from seecr.description.mjcf import CABLES
from seecr.inverse.result import Correction
from seecr.pose import Array, pose_difference, rotvec_from_quat
from seecr.prediction.model import DataReach
from seecr.prediction.uncertainty import Spread
from seecr.show.pose_words import (
    NO_TURN,
    SAGS,
    direction_words,
    sag_lines,
    stiffness_words,
    three_figures,
)
from seecr.statics.solution import Solution
from seecr.units import in_si, millimetres, newtons, short
from seecr.workspace.grid import Workspace
from seecr.workspace.spans import SlackSpan
from seecr.workspace.stored import StoredMap

# A probability below this deserves attention.
_LIKELY = 0.95
# The largest one with two digits that is not certain.
_SURE = 0.99

# More zones of slack cables than these are not listed in a terminal.
_MOST_SPANS = 12


def span_lines(spans: Sequence[SlackSpan]) -> Iterator[str]:
    """Where on a sweep which cables are slack, and how wide these zones are."""
    if not spans:
        return
    if len(spans) == 1:
        yield f"on the whole way {spans[0].words}"
        return
    # a run that stays at one pose is no way
    spans = [span for span in spans if span.width > 0.0 or span.turn > NO_TURN]
    if not spans:
        return
    if all(span.slack == () for span in spans):
        ways = "the only way" if len(spans) == 1 else f"all {len(spans)} ways"
        yield f"on {ways} no cable is slack"
        return
    if len(spans) > _MOST_SPANS:
        yield f"{counted(len(spans), 'zone')} of slack cables, with their widths, in sweep.json"
        return
    within = max(max(span.within) for span in spans)
    near = f", edges to within {short(1e3 * within, 2)} mm" if within > 0.0 else ""
    yield f"zones of slack cables on the way{near}:"
    ends = np.array([[span.first[:3], span.last[:3]] for span in spans]).reshape(-1, 3)
    moves = np.ptp(ends, axis=0)
    axes = [k for k in range(3) if moves[k] > 1e-6 * max(moves.max(), 1e-300)]
    shown = axes if len(axes) == 1 else range(3)
    for span in spans:
        first, last = (
            " ".join(f"{1e3 * pose[k] + 0.0:.3f}" for k in shown)
            for pose in (span.first, span.last)
        )
        wide = f"{1e3 * span.width:.3f} mm wide" if span.width > 0.0 else ""
        turn = f"turned by {np.degrees(span.turn):.4g} deg" if span.turn > NO_TURN else ""
        size = ", ".join(part for part in (wide, turn) if part)
        name = " ".join("xyz"[k] for k in shown)
        yield f"  {name} {first} to {last} mm, {size}: {span.words}"


def jump_lines(solution: Solution) -> Iterator[str]:
    """Where the platform jumps on the path that was followed, two lines each."""
    if solution.jumps is None:
        return
    if not any(solution.jumps):
        yield "followed from the reference pose: the platform does not jump on the path"
    away = pose_difference(solution.command, solution.robot.reference_pose)[:, 3:]
    turns = bool(np.any(np.linalg.norm(away, axis=1) > NO_TURN))
    for i, jumps in enumerate(solution.jumps):
        for jump in jumps:
            command = f"{three_figures(1e3 * jump.command[:3], '.1f')} mm"
            if turns:
                angles = np.degrees(rotvec_from_quat(jump.command[3:]))
                command += f", turned by {three_figures(angles, '.2f')} deg about x y z"
            yield f"on the path to {solution.place(i)}, at command {command}: {jump.words}"
            last, then = (
                f"{three_figures(1e3 * one[:3], '.1f')} mm" for one in (jump.before, jump.after)
            )
            landed = np.isfinite(jump.after).all()
            yield f"  from {last} to {then}" if landed else f"  it was last at {last}"


def sweep_lines(
    solution: Solution, commanded: bool = True, spread: Spread | None = None
) -> list[str]:
    """A sweep in a few lines."""
    lines = solution.lines(commanded)
    counts = solution.slack[solution.converged].sum(axis=1)
    if len(counts) and counts.max() > 0:
        parts = [f"{int(np.sum(counts == k))} with {k}" for k in np.unique(counts)]
        lines.append(f"poses by number of slack cables: {', '.join(parts)}")
        lines += sag_lines(solution.tables)
    if spread is not None and len(counts):
        position, turned = (
            short(factor * float(np.nanmax(np.linalg.norm(part, axis=1))), 2)
            for factor, part in ((1e3, spread.position), (np.degrees(1.0), spread.rotation))
        )
        pulls = short(float(np.nanmax(spread.tensions)), 2)
        lines.append(
            f"uncertain by up to ± {position} mm, ± {turned} deg and ± {pulls} N: one standard "
            "deviation, from the uncertainty of the model"
        )
    return lines


def rope_lines(found: Correction, cable: str | None) -> Iterator[str]:
    """How near the largest tension is to the breaking load of a rope that ``--cable`` names."""
    if cable is None or cable in CABLES or in_si(cable, "N") is not None or not found.found.any():
        return
    rope, pulls = rope_of(cable), found.solution.tensions[:, found.robot.driven]
    part = 100.0 * float(np.nanmax(pulls)) / rope.breaks
    breaks = newtons(rope.breaks)
    yield f"a new {rope.name} breaks at {breaks}: cables pull up to {part:.3g} % of it"


def chance_lines(
    found: Correction, kept: Array | None, minimum: bool = False, limited: bool = True
) -> Iterator[str]:
    """The probability (n,) that tensions stay within their limits, if the model has a covariance.

    Poses that are reached and the nearest of others are counted apart: the latter lie at the edge
    of what the limits allow, so that no other distribution of tensions helps there. Tensions may
    have been as small as possible (``minimum``), and limits without a highest have no middle.
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
        if minimum and many and found.robot.n_driven > found.robot.n_dof:
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


def likely_lines(found: Workspace, at_least: float | None) -> Iterator[str]:
    """How much of the grid can be held with at least a given probability."""
    if at_least is not None:
        likely = found.likely(at_least)
        size = found.size_words(likely)
        yield (
            f"with a probability of {at_least:g} or more {counted(int(likely.sum()), 'pose')} can "
            f"be held{f', {size}' if size else ''}"
        )


def beyond_line(found: Workspace | StoredMap, reach: DataReach | None) -> Iterator[str]:
    """How much of the workspace is far from the data that the model was fitted to."""
    if reach is None:
        return
    if isinstance(found, StoredMap):
        count, most = found.sum("beyond"), max(part["beyond_m"] for part in found.parts)
    else:
        count, most = found.beyond(reach)
    if count:
        yield (
            "beyond the data that the model was fitted to: "
            f"{counted(count, 'pose')} of those that can be held "
            f"{'is' if count == 1 else 'are'} up to {millimetres(most, 3)} outside"
        )


def softest_line(found: Workspace) -> Iterator[str]:
    """The softest pose of those that can be held, and the direction in which it is soft."""
    at = found.softest_at
    if at is not None:
        direction = direction_words(found.robot, found.softest[at])
        soft = stiffness_words(found.robot, float(found.stiffness[at]), found.softest[at])
        yield f"softest of these at {found.place(at)}: {direction}, {soft}"


def sag_lines_of(elastic: bool, effects: Collection[str]) -> Iterator[str]:
    """What "slack" means on an elastic map of a model with these effects, if cables have weight."""
    if elastic and "cable_weight" in effects:
        yield SAGS


def edge_line(
    found: Workspace, edge: Array, tolerance: float, at_least: float | None = None
) -> str:
    """The number of poses (k, 7) on the edge, and the tolerance [m]; or why there is none, also of
    the edge that belongs to a probability.
    """
    if len(edge) == 0 and at_least is not None:
        every = bool(found.likely(at_least).all())
        which = "all poses of the grid are" if every else "no pose of the grid is"
        return f"no edge was found: {which} held with that probability"
    if len(edge) == 0:
        return "no edge was found: all poses of the grid can be held"
    return f"edge, to within {tolerance:g} m: {counted(len(edge), 'point')}"
