"""Corrected commands: lengths to command so that the platform comes to rest at wanted poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.commands import Commands
from seecr.compiled.columns import RADIUS, STRAIN
from seecr.counted import between, counted, rows_words
from seecr.description.cables import NONE_BREAKS, breaking_words
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.errors import InputError
from seecr.inverse.in_place import poses_in_place
from seecr.inverse.lengths import REACHED, commanded_lengths, lengths_with_history
from seecr.inverse.nearest import Nearest, nearest
from seecr.inverse.nearest_problem import NearestProblem
from seecr.inverse.safe import narrowed, safe_margins
from seecr.pose import Array, changes_between
from seecr.prediction.experiment import Experiment, Prediction, effects_of
from seecr.prediction.model import GivenEffects, Model, model_given
from seecr.result import COORDINATES, MOTION, Record, Result, named, rows_of
from seecr.statics.solution import Solution
from seecr.statics.starts import Commanded, commands_from
from seecr.statics.tables import Tables, assemble, spanless, take
from seecr.tensions.balance import (
    bends,
    bridged_lengths,
    is_straight,
    least_of_heavy,
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
from seecr.tensions.passive import driven_tables, with_passive
from seecr.tensions.rest_lengths import Held, hold, holds_stably
from seecr.units import millimetres, newtons, without_rounding

PREFERENCES = ("pose", "position")
"""What may change at a pose that cannot be held: position and orientation, or the orientation
alone.
"""

# Strain of a cable up to which the nearest poses are sought where no highest tension is given: most
# ropes break before, fishing lines do not. Without an end, poses near the edge take any tension.
_STRAIN = 0.05
# The nearest pose leaves no cable shorter than this part of the shortest at the reference pose.
_SHORT = 1e-2
# Rotations below this [deg] are rounding, and displacements of nearest poses below this [m].
_TURNED, _MOVED = 1e-9, 1e-9
# Number of poses whose reason is printed.
_NAMED = 5


@dataclass(frozen=True, eq=False, repr=False)
class Correction(Result):
    """Lengths to command for n wanted poses.

    Attributes:
        wanted: (n, 7).
        aimed: (n, 7) the wanted poses if they can be held, else the nearest that can.
        lengths: (n, m) [m] to command, as told lengths: at the reference pose they are the rest
            lengths of the description, and for passive lines everywhere.
        held: (n,) bool, tensions within the limits can hold the wanted pose.
        found: (n,) bool, there are lengths for the wanted pose or for the nearest that can be held.
        settled: (n,) bool, ``aimed`` is the wanted pose itself, or meets the first-order conditions
            of a local minimum (Karush, Kuhn and Tucker) and the platform stays there. Of the local
            minima of many searches the nearest is taken.
        why_not: (n,) sentences, why a wanted pose cannot be held; "" if it can.
        solution: the certified equilibrium with these lengths.
        commands: the lengths as commands that every function accepts, with the runs, times,
            temperatures and loads that they are for.
        strain_limit: strain of each cable up to which the nearest poses were sought, because no
            highest tension was given; None if all cables had one.
    """

    robot: Robot
    wanted: Array
    aimed: Array
    lengths: Array
    held: NDArray[np.bool_]
    found: NDArray[np.bool_]
    settled: NDArray[np.bool_]
    solution: Solution
    commands: Commands
    why_not: tuple[str, ...]
    strain_limit: float | None = None

    def in_any_orientation(self) -> Correction:
        """The same if positions alone are wanted, which other orientations may hold as well."""
        off = np.linalg.norm(self.aimed[:, :3] - self.wanted[:, :3], axis=1)
        kept = self.found & (off <= _MOVED)
        said = zip(kept, self.why_not, strict=True)
        return replace(
            self,
            wanted=np.where(kept[:, None], self.aimed, self.wanted),
            held=self.held | kept,
            why_not=tuple("" if one else why for one, why in said),
        )

    @property
    def left(self) -> Array:
        """(n, 6) [m, rad] from the wanted pose to the platform's equilibrium."""
        return changes_between(self.solution.pose, self.wanted)

    @property
    def stays(self) -> NDArray[np.bool_]:
        """(n,) bool, the platform is at rest within a micrometre of ``aimed``, and stable."""
        return self.found & _rests_at(self.aimed, self.solution)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """(n,) bool, the platform is at rest within a micrometre of the wanted pose, and stable."""
        return self.held & self.stays

    def lines(self) -> list[str]:
        """How many poses are reached, the remaining errors, and which poses cannot be held."""
        n, left = len(self.wanted), self.left
        at, lost = self.reached, ~self.held
        out = [f"{self.robot.name}: {int(at.sum())} of {counted(n, 'pose')} reached"]
        if np.any(at):
            out.append(
                f"remaining error: at most {millimetres(_largest(left[at, :3]), 2)} and "
                f"{without_rounding(_degrees(left[at, 3:])):.2g} deg"
            )
            out.append(self._tensions(at))
        near, leaves = lost & self.found, self.found & ~self.stays
        if np.any(lost):
            out.append(f"{int(lost.sum())} cannot be held with tensions within the limits:")
            out += self._reasons()
        if np.any(near):
            out.append(
                f"the nearest poses that can be held are up to "
                f"{millimetres(_largest(left[near, :3]))} and "
                f"{_degrees(left[near, 3:]):.4g} deg away"
            )
            out.append(self._tensions(near))
        out += self._strain_lines(lost)
        for rows, text in (
            (lost & ~self.found, "of them: no pose nearby was found that can be held"),
            (self.held & ~self.found, "can be held, but a cable would have no length to pay out"),
            (near & ~self.settled, "of them: a nearer pose that can be held may exist"),
            (leaves, "where forces balance but the platform does not come to rest"),
        ):
            if np.any(rows):
                places = rows_words(np.flatnonzero(rows).tolist(), self.commands.line)
                out.append(f"{int(rows.sum())} {text}: {places}")
        if self.robot.weight == 0.0 and self.solution.slack[leaves].any():
            out[-1] += (
                ": without gravity, slack cables leave it free; give a lowest tension above 0"
            )
        return out

    def _tensions(self, rows: NDArray[np.bool_]) -> str:
        """The least and the largest tension of some poses."""
        pulls = self.solution.tensions[rows][:, self.robot.driven]
        return f"tensions there {between(pulls.min(), pulls.max(), lead='from ')} N"

    def place(self, row: int) -> str:
        """The name of a row: "line 24" of its file, or "pose 3", counted from 0, without a file."""
        return rows_words([row], self.commands.line)

    def _strain_lines(self, lost: NDArray[np.bool_]) -> list[str]:
        """How much cables are strained if nothing limits that, and which ropes this breaks."""
        driven = self.robot.driven
        every = np.where(self.found[:, None], self.solution.evaluation.states[..., STRAIN], 0.0)
        strains = every[:, driven]
        if not strains.any():
            return []
        row, k = np.unravel_index(int(np.argmax(strains)), strains.shape)
        strain, pull = float(strains[row, k]), float(self.solution.tensions[row][driven][k])
        endless, broken = self.strain_limit is not None, breaking_words(strain)
        out = []
        if endless or broken:
            name = self.robot.cable_names[int(np.flatnonzero(driven)[k])]
            given = "no highest tension was given" if endless else "cables may break"
            out.append(
                f"{given}: {name} pulls {newtons(pull)} at {self.place(int(row))}, which strains "
                f"it by {100.0 * strain:.3g} %, {broken or NONE_BREAKS}"
            )
        if endless and np.any(lost):
            out.append(
                "nearest poses are sought with cables strained by at most "
                f"{100.0 * _STRAIN:g} %; give a highest tension"
            )
        return out

    def _reasons(self) -> list[str]:
        """The first poses that cannot be held, each with the reason."""
        rows = np.flatnonzero(~self.held)
        named_rows = [f"  {self.place(i)}: {self.why_not[i]}" for i in rows[:_NAMED]]
        more = len(rows) - _NAMED
        return [*named_rows, f"  and {more} more, see why_not"] if more > 0 else named_rows

    def records(self) -> list[Record]:
        """One row per pose: wanted pose, lengths, remaining error, tensions."""
        cables, driven = self.robot.cable_names, np.flatnonzero(self.robot.driven)
        return rows_of(
            {
                **named("want_{}", COORDINATES, self.wanted),
                **named("length_{}_m", [str(k + 1) for k in driven], self.lengths[:, driven]),
                "held": self.held,
                "reached": self.reached,
                "why_not": self.why_not,
                **named("left_{}", MOTION, self.left),
                **named("tension_{}_N", cables, self.solution.tensions),
            }
        )

    def as_json(self, kept: Array | None = None) -> Record:
        """``correction.json``.

        Args:
            kept: (n,) probability that tensions stay within their limits, :func:`kept_chance`.
        """
        left, line, there = self.left, self.commands.line, self.solution
        return {
            "robot": self.robot.name,
            "cables": self.robot.cable_names,
            "poses": len(self.wanted),
            "reached": int(self.reached.sum()),
            "not_held": int((~self.held).sum()),
            "without_answer": int((~(self.found & there.converged)).sum()),
            "rows": [
                {
                    **({} if line is None else {"line": line[i]}),
                    "wanted": self.wanted[i],
                    "aimed": self.aimed[i] if self.found[i] else None,
                    "lengths_m": self.lengths[i],
                    "held": self.held[i],
                    "why_not": self.why_not[i] or None,
                    "reached": reached,
                    "left_m": left[i, :3],
                    "left_rad": left[i, 3:],
                    "within_limits_probability": None if kept is None else kept[i],
                    "tensions_N": there.tensions[i],
                    "status": there.status[i] if self.found[i] else "no_answer",
                }
                for i, reached in enumerate(self.reached)
            ],
        }


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
            margins = safe_margins(self.robot, told, self.safe, prediction)
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
        low, high = narrowed(tables, now.aim, (now.low, now.high), margins, rows)
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
        fine = there.fine & _rests_at(aimed[rows], solution)
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


def _largest(vectors: Array, rounding: float = _MOVED) -> float:
    """The longest of vectors (n, 3), displacements [m] or rotations [deg]; 0 for rounding."""
    longest = float(np.linalg.norm(vectors, axis=1).max())
    return 0.0 if longest < rounding else longest


def _degrees(turned: Array) -> float:
    """The largest of rotations (n, 3) [rad] in degrees; 0 where that is rounding."""
    return _largest(np.degrees(turned), _TURNED)


def _rests_at(poses: Array, solution: Solution) -> NDArray[np.bool_]:
    """(n,) whether the platform is at rest at poses (n, 7), to within a micrometre."""
    size = np.where(np.arange(6) < 3, 1.0, solution.robot.length)
    off = np.abs(changes_between(solution.pose, poses) * size).max(axis=1)
    return np.asarray(solution.converged & (off < REACHED))


def _without(solution: Solution, rows: NDArray[np.bool_]) -> Solution:
    """The solution with NaN in rows for which there are no lengths."""
    names = ("pose", "deviation", "tensions", "rest_lengths")
    kept: dict[str, Any] = {
        name: np.where(rows[:, None], np.nan, getattr(solution, name)) for name in names
    }
    return replace(solution, **kept) if np.any(rows) else solution
