"""Certified solutions of a batch of poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.compiled.columns import (
    CABLE_LAW,
    CONVERGED,
    EA,
    FALLING,
    ITERATIONS,
    SINGULAR,
    SPINNING,
    STALLED,
    TOLERANCE,
    UNSTABLE,
)
from seecr.counted import between, counted, rows_words
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import (
    SMALLEST,
    Array,
    pose_difference,
    rotation_vectors,
)
from seecr.result import COORDINATES, Record, Result, named, rows_of
from seecr.statics import batch
from seecr.statics.starts import start_of
from seecr.statics.tables import (
    Tables,
    by_row,
    portions,
    rest_lengths_of,
    shared_cables,
    spanless,
    take,
)
from seecr.statics.vibration import modes_of
from seecr.units import joules, millimetres

if TYPE_CHECKING:
    from seecr.statics.verification import Verification


class Status(Enum):
    """How the solve of a pose ended; the value is the sentence that users read."""

    CONVERGED = "at rest: forces balance to 1e-9 of the load and the equilibrium is stable"
    UNSTABLE = "balanced but unstable: the platform would leave this pose at the slightest touch"
    SINGULAR = "balanced, but free to move along at least one direction without resistance"
    STALLED = "not at rest: steps no longer reduce the forces, though they do not balance"
    FALLING = "no equilibrium found: the platform fell beyond the reach of its cables"
    SPINNING = "no equilibrium found: the external moment kept turning the platform"
    CABLE_LAW = "no answer: a cable's own equations have no solution at this pose"
    NO_LENGTH = "no answer: a cable would have no length left, or less than none, to pay out"
    ITERATIONS = "not at rest: the iteration limit was reached before the forces balanced"
    GAVE_UP = "not at rest: SciPy's solver gave up before the forces balanced"


_OF_OUTCOME = {
    CONVERGED: Status.CONVERGED,
    UNSTABLE: Status.UNSTABLE,
    SINGULAR: Status.SINGULAR,
    STALLED: Status.STALLED,
    FALLING: Status.FALLING,
    CABLE_LAW: Status.CABLE_LAW,
    ITERATIONS: Status.ITERATIONS,
    SPINNING: Status.SPINNING,
}


# Where forces balance, whether or not the equilibrium is stable.
_BALANCED = (Status.CONVERGED, Status.UNSTABLE, Status.SINGULAR)
_PER_ROW = (
    "command", "pose", "deviation", "tensions", "slack", "rest_lengths", "iterations", "residual",
    "energy", "status",
)  # fmt: skip
# By outcome; the last is for whatever is none.
_STATUSES = np.array([*(_OF_OUTCOME[k] for k in range(len(_OF_OUTCOME))), Status.GAVE_UP])
_IS_BALANCED = np.array([one in _BALANCED for one in _STATUSES])
# Errors [mm, deg] that differ by less than this, or by this part of them, are alike.
_ALIKE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Jump(Result):
    """A point on the commanded path where the equilibrium that was followed ceases to exist.

    Attributes:
        command: (7,) commanded pose at that point.
        before: (7,) last pose of the equilibrium that was followed.
        after: (7,) pose where the platform comes to rest afterwards; NaN if nothing holds it.
        energy: [J] released by the jump; infinite if nothing holds the platform, NaN if there is no
            potential energy.
        certain: whether the platform lands there with rotations damped a tenth, once and ten times
            as much as translations, over the robot's length. Inertia is not considered.
    """

    command: Array
    before: Array
    after: Array
    energy: float
    certain: bool

    @property
    def size(self) -> Array:
        """(6,) [m, rad] displacement and rotation vector from ``before`` to ``after``."""
        return pose_difference(self.after, self.before)

    def as_json(self) -> Record:
        """One entry of a row's ``jumps`` in ``sweep.json``."""
        return {
            "command": self.command,
            "before": self.before,
            "after": self.after,
            "energy_J": self.energy,
            "certain": self.certain,
        }

    @property
    def words(self) -> str:
        """A sentence: how far the platform jumps and how much energy that releases."""
        if not np.isfinite(self.after).all():
            return "its equilibrium ends, and nothing holds it after that"
        moved, turned = np.linalg.norm(self.size[:3]), np.linalg.norm(self.size[3:])
        free = f", releasing {joules(self.energy)}" if np.isfinite(self.energy) else ""
        sure = "" if self.certain else "; where it lands depends on damping"
        return (
            f"its equilibrium ends and it jumps by {millimetres(moved)} and "
            f"{np.degrees(turned):.4g} deg{free}{sure}"
        )

    def lines(self) -> list[str]:
        """One line: the commanded position and ``words``."""
        place = ", ".join(f"{value:.4g}" for value in self.command[:3])
        return [f"at command ({place}) m: {self.words}"]

    def records(self) -> Sequence[Record]:
        """One row: the command, the pose before and after, and the energy released."""
        poses = (("command_{}", self.command), ("before_{}", self.before), ("after_{}", self.after))
        record: Record = {}
        for pattern, pose in poses:
            record |= named(pattern, COORDINATES, pose)
        return [{**record, "energy_J": float(self.energy), "certain": self.certain}]


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Result):
    """Solutions for n poses, each with a certificate recomputed from the result itself.

    It prints as a few lines, and ``to_frame`` gives one row per pose.

    Attributes:
        robot: the robot that was solved.
        tables: the problem, from which everything can be recomputed.
        evaluation: wrench, stiffness and cable states at the solution.
        command: (n, 7) commanded poses.
        pose: (n, 7) equilibrium poses.
        deviation: (n, 6) [m, rad] pose minus command: displacement and rotation vector, base
            frame. It carries more digits than the difference of the two poses.
        tensions: (n, m) [N] at the exit point; of a block and tackle, of its line.
        slack: (n, m) bool, as :func:`seecr.statics.batch.is_slack` defines it.
        rest_lengths: (n, m) [m].
        iterations: (n,) evaluations of the wrench.
        residual: (n,) unbalanced force, or torque over the robot's length if larger, relative to
            the load; recomputed at the returned deviation.
        energy: (n,) [J] elastic energy minus the work of the load since the commanded pose, and of
            the cables' weight since they hung straight there. NaN if there is no potential: with
            hysteresis, exit friction or a user's cable law, with cable weight over pulleys (the
            effect ``cable_weight`` says why), and under an external moment, whose work on a
            platform that turns freely depends on the way. If all hinges are parallel it does not;
            full turns are left out of it.
        status: (n,) of :class:`Status`.
        others: the other stable equilibria of each command, if they were asked for.
        jumps: the jumps on the path to each command, if it was followed.
        line: (n,) line of each command in its file; None without a file.
    """

    robot: Robot
    tables: Tables
    evaluation: batch.Evaluation
    command: Array
    pose: Array
    deviation: Array
    tensions: Array
    slack: NDArray[np.bool_]
    rest_lengths: Array
    iterations: NDArray[np.int64]
    residual: Array
    energy: Array
    status: NDArray[np.object_]
    others: tuple[Solution, ...] | None = None
    jumps: tuple[tuple[Jump, ...], ...] | None = None
    line: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(n,) bool, the pose is a stable equilibrium."""
        return np.asarray(self.status == Status.CONVERGED, dtype=bool)

    @cached_property
    def stiffness(self) -> Array:
        """Minus the derivative of the wrench with respect to the pose, (n, d, d).

        For a free platform [N/m, N/rad; N m/m, N m/rad], by translation and rotation vector in the
        base frame; else by the joints. An external moment whose work depends on the way makes it
        asymmetric. Where a cable is exactly as long as its rest length and the platform is free to
        move to one side, it is that of this side.
        """
        unit = self._units()
        return batch.stiffness(self.tables, self._softer_side) * unit[:, None] * unit[None, :]

    @cached_property
    def modes(self) -> tuple[Array, Array]:
        """Frequencies (n, d) [Hz] of small vibrations, ascending, and their shapes (n, d, d).

        They are those of the platform's inertia on massless cables without damping: zero along
        directions without stiffness, NaN where the stiffness is negative or there is no
        equilibrium. ``shapes[i, :, k]`` [m, rad] is the motion of ``frequencies[i, k]``, in the
        coordinates of :attr:`stiffness`.

        Raises:
            InputError: the platform's inertia is not known.
        """
        return modes_of(self.robot, self.tables, self.pose, self.stiffness)

    @property
    def frequencies(self) -> Array:
        """Frequencies of small vibrations, (n, d) [Hz], in ascending order; see :attr:`modes`."""
        return self.modes[0]

    @cached_property
    def balance(self) -> Array:
        """Unbalanced force or torque relative to the load, (n,), at most: with rounding included.

        ``residual`` is what the solver's own doubles leave, which on stiff cables is less than
        these resolve. Points and lengths are rounded to 1 in 2^52 of the frame's size, and the
        force of a taut cable by its stiffness times that.
        """
        taut = self.evaluation.tension > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            each = shared_cables(self.tables)[..., EA] / rest_lengths_of(self.tables)
            stiffness = np.where(taut, each, 0.0).sum(axis=1)
        hidden = np.finfo(float).eps * self.robot.reach * stiffness / self.tables.scale
        return np.asarray(self.residual + hidden)

    def verify(self) -> Verification:
        """Compute residual and stability again, from poses, points, lengths and loads alone.

        In plain NumPy, which shares no code with the solver. Straight cables of any robot can be
        verified, also with points, lengths, laws and loads that effects edited; rows with pulleys,
        sag, friction or the like are named.

        Example:
            >>> found = seecr.solve("demobot_cogiro", [0.4, 0.25, 0.15, 1, 0, 0, 0])
            >>> found.verify().holds.all()
            np.True_
        """
        from seecr.statics.verification import verification_of  # scipy.spatial takes a while

        return verification_of(self)

    def rows(self, index: ArrayLike) -> Solution:
        """Some rows, by index or by a mask (n,)."""
        at = np.arange(len(self))[np.asarray(index)]
        values: dict[str, Any] = {name: getattr(self, name)[at] for name in _PER_ROW}
        values["tables"] = take(self.tables, at)
        values["evaluation"] = self.evaluation.only(at)
        for name in ("others", "jumps"):
            whole = getattr(self, name)
            values[name] = None if whole is None else tuple(whole[k] for k in at)
        values["line"] = None if self.line is None else self.line[at]
        return replace(self, **values)

    @cached_property
    def _softer_side(self) -> batch.Evaluation:
        """The evaluation whose stiffness says what is free to move."""
        rows = np.flatnonzero(self.status == Status.SINGULAR)
        if len(rows) == 0:
            return self.evaluation
        # a cable that is exactly as long as its rest length has stiffness on one side only
        there = self.evaluation.only(rows)
        out = self.evaluation.copy()
        out.hessian[rows] = batch.without_idle(take(self.tables, rows), there).hessian
        return out

    @cached_property
    def _softest(self) -> tuple[Array, Array]:
        """Smallest eigenvalue of the scaled stiffness (n,), and the motion (n, 6) [m] along it."""
        from seecr.compiled.algebra import softest_batch, softest_motions  # take a while to import

        hessian = self._softer_side.hessian
        values, directions = np.empty(len(hessian)), np.empty((len(hessian), 6))
        if self.robot.joints:
            columns = batch.motions(self.tables, self.evaluation)
            by_row(softest_motions, hessian, columns, values, directions)
        else:
            by_row(softest_batch, hessian, values, directions)
        return values, directions

    @property
    def smallest_eigenvalue(self) -> Array:
        """Smallest eigenvalue of the stiffness, (n,) [N/m], rotations times the robot's length.

        It is of the platform's motions, translations of its origin and rotations, that its joints
        allow, whatever these are.
        """
        return self._softest[0]

    @property
    def softest_direction(self) -> Array:
        """The platform's motion of the smallest eigenvalue, (n, 6) [m, rad], base axes.

        Translation of its origin, then rotation vector. It has unit length and a positive largest
        component, with rotations times the robot's length. NaN if the stiffness is not known.
        """
        return np.asarray(self._softest[1] / np.repeat([1.0, self.robot.length], 3))

    def motion(self, i: int, coordinates: Array) -> Array:
        """The platform's motion (6,) [m, rad] along coordinates (d,) of :attr:`stiffness`, pose i.

        Translation of its origin, then rotation vector, base axes.
        """
        rows = np.array([i])
        at = self.evaluation.only(rows)
        columns = batch.motions(take(self.tables, rows), at)[0]
        whole = (coordinates * self._units()) @ columns
        return np.asarray(whole / np.repeat([1.0, self.robot.length], 3))

    def _units(self) -> Array:
        """The robot's length for rotations, 1 for translations, (d,)."""
        return np.where(self.robot.hinges, self.robot.length, 1.0)

    def lines(self, commanded: bool = True) -> list[str]:
        """How many poses came to rest, how far from their commands, and the cables' tensions.

        Args:
            commanded: whether poses were commanded, and not lengths.
        """
        there = f"{int(self.converged.sum())} of {counted(len(self), 'pose')}"
        out = [f"{self.robot.name}: {there} at rest"]
        for status in dict.fromkeys(self.status):
            if status is not Status.CONVERGED:
                rows = np.flatnonzero(self.status == status)
                out.append(f"{self.place(*rows)}: {self.sentence(int(rows[0]))}")
        known = np.flatnonzero(np.isfinite(self.pose).all(axis=1))
        if len(known) == 0:
            return out
        if commanded:
            out.append(self._furthest(known))
        pulls, slack = self.tensions[known], self.slack[known].sum(axis=1)
        out.append(
            f"tensions {between(pulls.min(), pulls.max(), lead='from ')} N; slack cables: "
            f"{between(slack.min(), slack.max(), 'd')} of {self.robot.n_cables}"
        )
        residuals = [self.balance[k] for k in known if self.status[k] in _BALANCED]
        if residuals:
            out.append(
                f"forces balance to {max(residuals):.1g} of the load or better, rounding included"
            )
        return out

    def _furthest(self, known: NDArray[np.intp]) -> str:
        """The largest position error and the largest rotation of some rows, with their poses."""
        away = 1e3 * np.linalg.norm(self.deviation[known, :3], axis=1)
        turned = np.degrees(np.linalg.norm(self.deviation[known, 3:], axis=1))
        away, turned = (np.where(one < _ALIKE, 0.0, one) for one in (away, turned))
        # rounding must not say which of two is further
        first = np.flatnonzero(away >= away.max() * (1.0 - _ALIKE) - _ALIKE)
        k = int(first[np.argmax(turned[first])])
        far = millimetres(1e-3 * away[k])
        by = f"largest deviation from the command: {self.place(known[k])}, {far}"
        if turned[k] >= turned.max() * (1.0 - _ALIKE) - _ALIKE:
            return f"{by} and {turned[k]:.4g} deg"
        t = int(np.argmax(turned))
        return (
            f"{by} ({turned[k]:.4g} deg); largest rotation: {self.place(known[t])}, "
            f"{turned[t]:.4g} deg"
        )

    def records(self) -> list[Record]:
        """One row per pose: command, pose, status, tensions and slack cables by name."""
        cables = self.robot.cable_names
        return rows_of(
            {
                "status": [status.name for status in self.status],
                **named("command_{}", COORDINATES, self.command),
                **named("{}", COORDINATES, self.pose),
                "residual": self.residual,
                "energy_J": self.energy,
                "smallest_eigenvalue_N_per_m": self.smallest_eigenvalue,
                **named("tension_{}_N", cables, self.tensions),
                **named("slack_{}", cables, self.slack),
            }
        )

    def as_json(self) -> Record:
        """``seecr`` of a case in ``results.json``: the results of all poses, by quantity."""
        return {
            "pose": self.pose,
            "deviation": self.deviation,
            "tensions_N": self.tensions,
            "slack": self.slack,
            "residual": self.residual,
            "smallest_eigenvalue_N_per_m": self.smallest_eigenvalue,
            "iterations": self.iterations,
            "status": self.status,
        }

    def place(self, *rows: int) -> str:
        """The names of rows: "line 24" of a file, or "pose 3", counted from 0, without one."""
        return rows_words(rows, self.line)

    def sentence(self, i: int) -> str:
        """The status of pose i, with the softest direction if it is singular or unstable."""
        status = self.status[i]
        if status not in (Status.SINGULAR, Status.UNSTABLE):
            return str(status.value)
        names, vector = ("x", "y", "z", "rx", "ry", "rz"), self._softest[1][i]
        parts = [
            f"{value:+.2f} {name}"
            for value, name in zip(vector, names, strict=True)
            if abs(value) > 0.05
        ]
        return f"{status.value} (direction {' '.join(parts)})"


def certify(robot: Robot, tables: Tables, found: batch.Evaluation) -> Solution:
    """Recompute wrench, stiffness and energy at the result, and derive its status."""
    # what is kept of many rows was evaluated where they rest
    known = isinstance(found, batch.Brief)
    check = found if known else batch.evaluate(tables, found, threads=None)
    check.count = found.count
    rest = rest_lengths_of(tables)
    ends = np.where(found.outcome < len(_OF_OUTCOME), found.outcome, len(_OF_OUTCOME))
    ends[(ends == CONVERGED) & ~(check.residual < TOLERANCE)] = STALLED
    no_length = np.zeros(len(ends), dtype=bool)
    if not rest.min(initial=np.inf) >= SMALLEST:
        no_length |= np.any(rest < SMALLEST, axis=1)
    # a pulley pays out some cable even where an anchor point is commanded to its exit point
    for rows in portions(np.flatnonzero(~_IS_BALANCED[ends])):
        no_length[rows] |= spanless(take(tables, rows)).any(axis=1)
    status = _STATUSES[ends]
    status[no_length] = Status.NO_LENGTH
    # not the deviations in ``found``: SciPy's search on joints leaves these at zero
    moved = check.deviation
    turned = np.ascontiguousarray(moved[:, 3:])
    lost = no_length | np.isin(found.outcome, (FALLING, CABLE_LAW, SPINNING))
    return Solution(
        robot=robot, tables=tables, evaluation=check, command=tables.poses,
        pose=_blank(batch.platform_poses(tables, moved), lost),
        deviation=_blank(np.concatenate([moved[:, :3], rotation_vectors(turned)], axis=1), lost),
        tensions=_blank(check.tension / robot.falls, lost), slack=batch.is_slack(tables, check),
        rest_lengths=rest, iterations=found.count,
        residual=np.where(lost, np.inf, check.residual),
        energy=_energies(robot, tables, check, status), status=status,
    )  # fmt: skip


def _energies(
    robot: Robot, tables: Tables, check: batch.Evaluation, status: NDArray[np.object_]
) -> Array:
    """Energies (n,) [J] of poses, whatever full turns a search made under a moment."""
    pushed = batch.under_moment(tables) if robot.joints else np.zeros(0, bool)
    rows = np.array([i for i in np.flatnonzero(pushed) if status[i] in _BALANCED], int)
    if len(rows) == 0:
        return check.energy
    out = check.energy.copy()
    for each in portions(rows):
        some, at = take(tables, each), check.only(each)
        poses = batch.platform_poses(some, at.deviation)
        start, values = start_of(robot, some, poses)
        assert start is not None and values is not None
        at.deviation, at.values = start, values
        out[each] = batch.evaluate(some, at).energy
    return out


def _blank(values: Array, rows: NDArray[np.bool_]) -> Array:
    """NaN in rows without a result."""
    values = values.copy()
    if rows.any():
        values[rows] = np.nan
    return values


def check_solution(given: object, start: str = "") -> None:
    """Check that a caller gave a solution; ``start`` is for the error.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(given, Solution):
        raise InputError(f"{start}expected a seecr.Solution, got {type(given).__name__}")
