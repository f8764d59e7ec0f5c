"""Corrected commands: lengths to command so that the platform comes to rest at wanted poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.commands import Commands
from seecr.compiled.columns import HYSTERESIS, RADIUS
from seecr.counted import counted
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.errors import InputError
from seecr.inverse.in_place import poses_in_place
from seecr.inverse.lengths import commanded_lengths, lengths_with_history
from seecr.inverse.nearest import Nearest, nearest
from seecr.inverse.nearest_problem import NearestProblem
from seecr.inverse.result import Correction, rests_at
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, Prediction, effects_of
from seecr.prediction.model import GivenEffects, Model, model_given
from seecr.prediction.uncertainty import spread_of
from seecr.statics.solution import Solution
from seecr.statics.starts import Commanded, commands_from
from seecr.statics.tables import Tables, assemble, spanless, take
from seecr.tensions.balance import (
    bends,
    bridged_lengths,
    driven_tables,
    is_straight,
    least_of_heavy,
    with_passive,
    with_rest,
)
from seecr.tensions.distribution import (
    SAFE,
    of_driven,
    tension_limits,
    wanted_tensions,
    why_not_held,
    without_span,
)
from seecr.tensions.max_margin import balances, counted_balance, holds_tightly
from seecr.tensions.rest_lengths import Held, hold, holds_stably

PREFERENCES = ("pose", "position")
"""What may change at a pose that cannot be held: position and orientation, or the orientation
alone.
"""

# Strain of a cable up to which the nearest poses are sought where no highest tension is given: most
# ropes break before, fishing lines do not. Without an end, poses near the edge take any tension.
_STRAIN = 0.05
# The nearest pose leaves no cable shorter than this part of the shortest at the reference pose.
_SHORT = 1e-2


def correct(
    robot: GivenRobot,
    poses: Commanded,
    *,
    effects: GivenEffects = (),
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    aim: str | ArrayLike = SAFE,
    prefer: str = "pose",
    any_orientation: bool = False,
) -> Correction:
    """Lengths to command so that the platform comes to rest at wanted poses.

    Elasticity and all effects are taken into account. With more cables than degrees of freedom,
    the tensions are as near to ``aim`` as the limits allow. If a pose cannot be held, the nearest
    one that can is used instead; without a highest tension, the nearest of those that strain no
    cable by more than 5 %.

    A cable with weight pulls at least about what it weighs. If a pose can only be held with less,
    it hangs loosely, but is never more than half as long again as its span.

    Args:
        robot: as described, or its MJCF.
        poses: (n, 7) wanted, or :class:`seecr.Commands` with runs and times, for effects that
            depend on them, or ``crosscheck.Measurements``, of which only the commands count.
        effects: a model, its file, or effects with values.
        lowest: (m,) or one [N], not negative. A cable with zero tension is made a little longer
            than its span.
        highest: (m,) or one [N]; infinite for none.
        aim: "safe", "minimum", "middle" (of the limits), or tensions (m,) or (n, m) [N]. The safe
            ones are the smallest that, as uncertain as the model is, stay within the limits with a
            probability of 0.99, and with its hysteresis whichever way a pose is reached; as near to
            that as the balance allows. Without a model that keeps its covariance they are the
            smallest.
        prefer: what is nearest to a pose that cannot be held. "pose" minimises
            position^2 + (length x rotation)^2; "position" changes only the orientation, if that
            suffices.
        any_orientation: positions alone are wanted: a pose counts as wanted with the orientation
            that holds its position, the nearest to that given. For robots with fewer cables than
            degrees of freedom, which turn as the balance demands.

    Returns:
        the lengths and what they lead to; check ``reached`` before using a row.

    Raises:
        InputError: wrong shapes, limits that contradict each other, an unknown aim or preference.

    Example:
        ``seecr.correct(robot, poses, effects="model.toml").commands.lengths``
    """
    if prefer not in PREFERENCES:
        raise InputError(f"prefer must be one of {', '.join(PREFERENCES)}, got {prefer!r}")
    search = _search_of(robot_of(robot), poses, effects, lowest, highest, aim)
    found = search.run(any_orientation or prefer == "position")
    return found.in_any_orientation() if any_orientation else found


def margins_in_place(
    robot: Robot, poses: Array, effects: GivenEffects, lowest: ArrayLike, highest: ArrayLike,
    thorough: bool = True,
) -> Array:  # fmt: skip
    """(n,) [N] how far inside their limits the tensions are that hold positions: for maps.

    Like :func:`correct` with ``prefer="position"``, but any orientation will do, and no other
    positions are tried. Of the orientations found, that with the largest margin counts, so a larger
    one may exist. Minus infinity if none was found that holds and in which the platform stays.
    Searches that are not ``thorough`` begin where straight cables or neighbours lead, no more.
    """
    search = _search_of(robot, poses, effects, lowest, highest, "minimum")
    return search.margins_in_place(thorough)


def _search_of(
    robot: Robot, poses: Commanded, effects: GivenEffects, lowest: ArrayLike, highest: ArrayLike,
    aim: str | ArrayLike,
) -> _Search:  # fmt: skip
    """A search with checked arguments."""
    given = commands_from(poses, robot)
    if given.lengths is not None:
        raise InputError("correct needs wanted poses (n, 7); got lengths")
    low, high = tension_limits(robot, lowest, highest)
    given_aim = aim if isinstance(aim, str) else of_driven(robot, np.asarray(aim, float))
    falls = robot.falls[robot.driven]  # an aim is of the line, as limits are
    target = falls * wanted_tensions(given_aim, low / falls, high / falls, also=(SAFE,))
    if target.ndim == 2 and len(target) != len(given):
        raise InputError(f"aim must have {counted(len(given), 'row')}, got {len(target)}")
    limits = _Limits(np.broadcast_to(target, (len(given), len(low))), low, high)
    model = model_given(effects, robot) if isinstance(effects, Model | str | Path) else None
    safe = model if isinstance(aim, str) and aim == SAFE else None
    acting = effects_of(effects if model is None else model, robot)
    return _Search(robot, given, acting, limits, safe)


@dataclass(frozen=True, eq=False)
class _Limits:
    """Aim (n, k) and limits (k,) or (n, k) [N] of the driven cables."""

    aim: Array
    low: Array
    high: Array

    def rows(self, some: NDArray[np.intp]) -> _Limits:
        """Those of some rows."""
        return replace(self, aim=self.aim[some])

    def strained(self, tables: Tables) -> _Limits:
        """The same, and strains within theirs where no highest tension is given.

        A model's cables may be softer than the robot's, or soften as they are stretched: it is
        their own law that says at which tension they are strained so much.
        """
        from seecr.compiled.rates import tensions_at_strain  # takes a while to import

        each = np.empty(tables.cables.shape[:2])
        tensions_at_strain(tables.cables, _STRAIN, each)
        most = each.min(axis=0, initial=np.inf)
        ends = np.isinf(self.high) & (self.low < most)
        return replace(self, high=np.where(ends, most, self.high))


@dataclass(frozen=True, eq=False)
class _Search:
    """One call of :func:`correct`."""

    robot: Robot
    given: Commands
    effects: Sequence[Effect]
    limits: _Limits
    safe: Model | None = None

    def run(self, fix_position: bool) -> Correction:
        held, tables = self._held(self.given)
        found, aimed, settled = held.fine.copy(), self.given.pose.copy(), held.fine.copy()
        lost = np.flatnonzero(~held.fine)
        high = self.limits.high
        if len(lost):
            strained = self.limits.strained(tables)
            high = np.where(held.fine[:, None], high, strained.high)
            near = replace(self, limits=strained)
            best = near._nearest(lost, tables.scale, fix_position)
            aimed[lost], found[lost], settled[lost] = best.poses, best.found, best.settled
        commands = replace(self.given, pose=aimed)
        mixed = replace(self, limits=replace(self.limits, high=high))
        there = mixed._held(commands)[0] if len(lost) else held
        found &= there.fine
        lengths, prediction = mixed._lengths(commands, there)
        if self.safe is not None:
            told = replace(commands, lengths=lengths, told=True)
            margins = _safe_margins(self.robot, told, self.safe, prediction)
            if margins is not None:
                mixed = mixed._within(commands, margins, held.fine & found)
                there = mixed._held(commands)[0]
                lengths, prediction = mixed._lengths(commands, there)
        # beside its exit point a cable could pull any way, but there is none to wind in
        found &= lengths.min(axis=1) > 0.0
        lengths[~found] = np.nan
        solution = prediction.solution()
        return Correction(
            self.robot, self.given.pose, aimed, lengths, held.fine, found, settled & found,
            _without(solution, ~found), replace(commands, lengths=lengths, told=True),
            self._why_not(lost, tables),
            _STRAIN if np.isinf(self.limits.high).any() else None,
        )  # fmt: skip

    def _within(self, commands: Commands, margins: Array, rows: NDArray[np.bool_]) -> _Search:
        """The same with limits that are narrower by margins (n, m) [N], at some rows (n,)."""
        now, tables = self.limits, self._tables(commands)
        low, high = _narrowed(tables, now.aim, (now.low, now.high), margins, rows)
        return replace(self, limits=replace(now, low=low, high=high))

    def margins_in_place(self, thorough: bool) -> Array:
        """(n,) [N] margins of positions; minus infinity if they are not held or not stable."""
        tables, rows = self._tables(self.given), np.arange(len(self.given))
        problem = self._nearest_problem(rows, tables.scale, fix_position=True)
        aimed, found = poses_in_place(problem, tables, thorough)
        margins, rows = np.full(len(rows), -np.inf), np.flatnonzero(found)
        if len(rows) == 0:
            return margins
        own = replace(self, limits=self.limits.rows(rows))
        commands = replace(self.given.rows(rows), pose=aimed[rows])
        there = own._held(commands)[0]
        solution = own._lengths(commands, there)[1].solution()
        inside = np.minimum(there.tensions - self.limits.low, self.limits.high - there.tensions)
        fine = there.fine & rests_at(aimed[rows], solution)
        margins[rows[fine]] = np.maximum(inside[fine].min(axis=1), 0.0)
        return margins

    def _why_not(self, lost: NDArray[np.intp], tables: Tables) -> tuple[str, ...]:
        """(n,) sentences; "" for rows that can be held."""
        out, limits = [""] * len(self.given), self.limits
        if len(lost) == 0:
            return tuple(out)
        some = take(tables, lost)
        weighs, robot = least_of_heavy(some), self.robot
        names = [robot.cable_names[i] for i in np.flatnonzero(robot.driven)]
        gone, pulleys = spanless(some), some.cables[..., RADIUS] > 0.0
        for k in np.flatnonzero(gone.any(axis=1)):
            out[lost[k]] = without_span(gone[k], pulleys[k], names)
        free = np.flatnonzero(~gone.any(axis=1))
        some, weighs, lost = take(some, free), weighs[free], lost[free]
        for i, w, row in zip(lost, weighs, balances(some, limits.low, limits.high), strict=True):
            matrix, load, low, high = row
            out[i] = why_not_held(matrix, load, low, high, names, w)
        return tuple(out)

    def _tables(self, commands: Commands) -> Tables:
        """Tables of the driven cables at the commanded poses; rest lengths do not matter."""
        return driven_tables(self._whole_tables(commands), self.robot)

    def _whole_tables(self, commands: Commands) -> Tables:
        """Those of all lines."""
        plain = self.robot.commanded_lengths(commands.pose)
        trial = replace(commands, lengths=plain, told=True)
        return assemble(Experiment(self.robot, trial).setup(self.effects))

    def _held(self, commands: Commands) -> tuple[Held, Tables]:
        tables, limits = self._tables(commands), self.limits
        return hold(tables, limits.aim, limits.low, limits.high), tables

    def _nearest_problem(
        self, rows: NDArray[np.intp], scale: Array, *, fix_position: bool
    ) -> NearestProblem:
        """The problem of the nearest poses for some rows."""
        limits, mine = self.limits, self.given.rows(rows)
        ends = limits.low, limits.high
        own, home = self._tables(mine), np.tile(self.robot.reference_pose, (len(rows), 1))
        straight = is_straight(own, self._tables(replace(mine, pose=home)))
        # beside its exit point a cable may pull any way, so that much seems to be held there; but
        # the platform is at the winch, which is no place to stay
        least = _SHORT * float(np.min(self.robot.reference_lengths))

        def at(poses: Array, some: NDArray[np.intp]) -> Commands:
            return replace(self.given.rows(rows[some]), pose=poses)

        def balance(
            poses: Array, some: NDArray[np.intp], about: Array | None = None
        ) -> tuple[Array, Array]:
            return counted_balance(self._tables(at(poses, some)), *ends, about)

        def stays(poses: Array, some: NDArray[np.intp]) -> NDArray[np.bool_]:
            there = at(poses, some)
            whole = self._whole_tables(there)
            tables = driven_tables(whole, self.robot)
            spans = bridged_lengths(whole)
            told = commanded_lengths(self.robot, there, self.effects, spans)
            shortest = np.minimum(spans, np.nan_to_num(told, nan=np.inf)).min(axis=1)

            def held(rest: Array) -> Tables:
                return with_rest(whole, with_passive(self.robot, rest))

            stable = holds_stably(tables, limits.aim[rows[some]], *ends, held)
            return np.asarray(stable & (shortest > least))

        def holds(poses: Array, some: NDArray[np.intp]) -> NDArray[np.bool_]:
            return holds_tightly(self._tables(at(poses, some)), *ends)

        return NearestProblem.within(
            self.robot, self.given.pose[rows], balance, stays, ends, scale[rows],
            fix_position=fix_position, straight=own if straight else None,
            holds=holds if bends(own) and self.robot.n_driven >= self.robot.n_dof else None,
        )  # fmt: skip

    def _nearest(self, rows: NDArray[np.intp], scale: Array, fix_position: bool) -> Nearest:
        best = nearest(self._nearest_problem(rows, scale, fix_position=fix_position))
        again = np.flatnonzero(~best.stable)
        if fix_position and len(again):
            # the position cannot be kept either
            other = self._nearest(rows[again], scale, False)
            better = other.stable | (other.found & ~best.found[again])
            best.put(again[better], other.only(better))
        return best

    def _lengths(self, commands: Commands, held: Held) -> tuple[Array, Prediction]:
        """Lengths to command that pay out those of ``held``, and the prediction with them."""
        limits = self.limits.aim, self.limits.low, self.limits.high
        return lengths_with_history(self.robot, commands, self.effects, held, limits)


def _without(solution: Solution, rows: NDArray[np.bool_]) -> Solution:
    """The solution with NaN in rows for which there are no lengths."""
    names = ("pose", "deviation", "tensions", "rest_lengths")
    kept: dict[str, Any] = {
        name: np.where(rows[:, None], np.nan, getattr(solution, name)) for name in names
    }
    return replace(solution, **kept) if np.any(rows) else solution


# How far inside their limits tensions should be, given what is not known of a model.

# Probability that all tensions of a pose stay within limits, if these are as far away as is safe:
# one pose in a hundred may still touch one.
_SAFE = 0.99
# Where no tensions are so far inside, they are as far as the first of these parts that holds.
_PARTS = np.linspace(1.0, 0.1, 10)


def _safe_margins(
    robot: Robot, commands: Commands, model: Model, prediction: Prediction
) -> Array | None:
    """Margins (n, k) [N] that keep tensions within limits; None if the model has no covariance.

    They are of the k driven cables, with all falls of their lines.

    Each is so many standard errors of the tension that by Bonferroni's inequality all cables stay
    inside with the probability above, and what hysteresis may add if a pose is reached another way.
    NaN for a row without an answer.
    """
    assert commands.lengths is not None
    lost = np.asarray(np.isnan(commands.lengths).any(axis=1))
    lengths = np.where(lost[:, None], robot.rest_lengths, commands.lengths)
    spread = spread_of(robot, replace(commands, lengths=lengths), model)
    if spread is None:
        return None
    times = NormalDist().inv_cdf(1.0 - (1.0 - _SAFE) / robot.n_driven)
    margins = times * robot.falls * spread.tensions + prediction.tables.cables[..., HYSTERESIS]
    margins = margins[:, robot.driven]
    margins[lost] = np.nan
    return margins


def _narrowed(
    tables: Tables, aim: Array, limits: tuple[Array, Array], margins: Array, rows: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Limits (n, k) [N] that are narrower by these margins, or the largest part of them that holds.

    Args:
        tables: of n poses, of the driven cables. aim: (n, k) tensions. limits: (k,) or (n, k).
        margins: (n, k). rows: (n,) which poses can be held.
    """
    low, high = (np.array(np.broadcast_to(one, margins.shape)) for one in limits)
    left = np.flatnonzero(rows & np.isfinite(margins).all(axis=1) & margins.any(axis=1))
    for part in _PARTS:
        least, most = low[left] + part * margins[left], high[left] - part * margins[left]
        wide = (least <= most).all(axis=1)
        tried = np.flatnonzero(wide)
        held = hold(take(tables, left[wide]), aim[left[wide]], least[wide], most[wide]).fine
        fine = tried[held]
        low[left[fine]], high[left[fine]] = least[fine], most[fine]
        left = np.delete(left, fine)
    return low, high
