"""Where the platform comes to rest: ``solve``, its ``Solution`` and their ``Status``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr import statics
from seecr.commands import Commands
from seecr.compiled.columns import REST, TENSION
from seecr.compiled.outcomes import (
    CABLE_LAW,
    CONVERGED,
    FALLING,
    ITERATIONS,
    SINGULAR,
    SPINNING,
    STALLED,
    TOLERANCE,
    UNSTABLE,
)
from seecr.errors import InputError
from seecr.joints import values_of_pose
from seecr.pose import Array, rotvec_from_quat
from seecr.robot import Robot
from seecr.setup import Setup, plain_setup
from seecr.tables import Tables, assemble, take

METHODS = ("newton", "fsolve", "least_squares")


class Status(Enum):
    """What became of a pose; the value is the sentence a user reads."""

    CONVERGED = "at rest: forces balance to 1e-9 of the load and the equilibrium is stable"
    UNSTABLE = "balanced but unstable: the platform would leave this pose at the slightest touch"
    SINGULAR = "balanced, but free to move along at least one direction without resistance"
    STALLED = "not at rest: steps no longer reduce the forces, though they do not balance"
    FALLING = "no equilibrium found: the platform fell beyond the reach of its cables"
    SPINNING = "no equilibrium found: the external moment turned the platform round and round"
    CABLE_LAW = "no answer: a cable's own equations have no solution at this pose"
    ITERATIONS = "not at rest: the limit of iterations was reached before the forces balanced"
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


@dataclass(frozen=True, eq=False)
class Solution:
    """Answers of n poses, each with the certificate recomputed from the answer itself.

    Attributes:
        robot: that was solved.
        tables: the problem, from which everything can be recomputed.
        command: (n, 7) commanded poses.
        pose: (n, 7) where the platform rests.
        deviation: (n, 6) [m, rad] pose less command: displacement and rotation vector, base
            frame. It carries more digits than the difference of the two poses.
        tensions: (n, m) [N] at the exit point.
        slack: (n, m) bool, as :func:`seecr.statics.is_slack` has it.
        rest_lengths: (n, m) [m].
        iterations: (n,) evaluations of the wrench.
        residual: (n,) unbalanced force, and torque over the robot's length, relative to the
            load; recomputed at the returned deviation.
        energy: (n,) [J] elastic energy less the work of the load since the commanded pose;
            nan where a law has none in closed form.
        status: (n,) of :class:`Status`.
    """

    robot: Robot
    tables: Tables
    evaluation: statics.Evaluation
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

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Where the answer is a stable equilibrium, (n,)."""
        return np.array([s is Status.CONVERGED for s in self.status], dtype=bool)

    @cached_property
    def stiffness(self) -> Array:
        """Minus the derivative of the wrench by the pose, (n, d, d).

        For a free platform [N/m, N/rad; N m/m, N m/rad], by translation and rotation vector
        in the base frame; else by the joints. An external moment, which has no potential,
        takes its symmetry.
        """
        unit = self._units()
        return statics.stiffness(self.tables, self.evaluation) * unit[:, None] * unit[None, :]

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        hessian = self.evaluation.hessian.copy()
        rows = np.flatnonzero(self.status == Status.SINGULAR)
        if len(rows):
            # a cable that is just as long as its rest length resists on one side only
            there = statics.take_evaluation(self.evaluation, rows)
            hessian[rows] = statics.without_idle(take(self.tables, rows), there).hessian
        finite = np.isfinite(hessian)
        values, vectors = np.linalg.eigh(np.where(finite, hessian, 0.0))
        values[~finite.all(axis=(1, 2))] = np.nan
        return values, vectors

    @property
    def smallest_eigenvalue(self) -> Array:
        """Of the stiffness, (n,) [N/m], rotations scaled by the robot's length."""
        return self._spectrum[0][:, 0]

    @property
    def softest_direction(self) -> Array:
        """Eigenvector of the smallest eigenvalue, (n, d) [m, rad], a unit step of it."""
        return self._spectrum[1][:, :, 0] / self._units()

    def _units(self) -> Array:
        """Robot's length for rotations, 1 for translations, (d,)."""
        return np.where(self.robot.hinges, self.robot.length, 1.0)

    def sentence(self, i: int) -> str:
        """What became of pose i, with the direction where it is singular or unstable."""
        status = self.status[i]
        if status not in (Status.SINGULAR, Status.UNSTABLE):
            return str(status.value)
        names = [joint.name for joint in self.robot.joints] or ["x", "y", "z", "rx", "ry", "rz"]
        vector = self._spectrum[1][i, :, 0]
        parts = [
            f"{value:+.2f} {name}"
            for value, name in zip(vector, names, strict=True)
            if abs(value) > 0.05
        ]
        return f"{status.value} (direction {' '.join(parts)})"


def solve(
    robot: Robot,
    poses: ArrayLike | None = None,
    *,
    rest_lengths: ArrayLike | None = None,
    method: str = "newton",
    wrench: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    start: ArrayLike | None = None,
    max_iterations: int = 400,
    threads: int | None = None,
) -> Solution:
    """Find where the platform rests (paper, section III-B) for a batch of commands.

    Args:
        robot: from :func:`seecr.load_robot`, or made by hand.
        poses: (n, 7) or (7,) commanded poses; the winches pay out the straight lengths there
            (eqs 1, 2).
        rest_lengths: (n, m) or (m,) [m] instead of, or beside, the poses: then the poses are
            only where the search starts, the reference pose by default.
        method: ``"newton"`` follows the energy downhill, compiled; ``"fsolve"`` and
            ``"least_squares"`` are the paper's own, on SciPy with its first guess (step 4).
        wrench: (6,) or (n, 6) external force [N] at the platform origin and moment [N m].
        gravity: (3,) [m/s^2] instead of the robot's.
        start: (n, 7) poses to start from instead of the commanded ones.
        max_iterations: most evaluations of the wrench, a pose and stage of stiffness.
        threads: by default one a processor.

    Returns:
        a :class:`Solution`; look at ``status`` or ``converged`` before using a pose.

    Raises:
        InputError: shapes, values that are not finite, an unknown method.
    """
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if max_iterations < 1:
        raise InputError(f"max_iterations must be at least 1, got {max_iterations}")
    if gravity is not None:
        robot = replace(robot, gravity=_array(gravity, (3,), "gravity"))
    commands = _commands(robot, poses, rest_lengths)
    setup = plain_setup(robot, commands, None if wrench is None else _finite(wrench, "wrench"))
    starts = None
    if start is not None:
        starts = _poses(start, "start")
        if len(starts) != len(commands):
            raise InputError(f"start must have {len(commands)} poses, got {len(starts)}")
    return solve_setup(setup, method, starts, max_iterations, threads)


def solve_setup(
    setup: Setup,
    method: str = "newton",
    start: Array | None = None,
    max_iterations: int = 400,
    threads: int | None = None,
) -> Solution:
    """Like :func:`solve`, for a setup that effects may have edited; history is not followed."""
    tables = assemble(setup)
    first, values = start_of(setup.robot, tables, start)
    if method == "newton":
        found = statics.descend(tables, first, max_iterations, threads, values)
    else:
        from seecr.scipy_search import solve_with_scipy

        found = solve_with_scipy(setup, tables, method, first, max_iterations, values)
    return certify(setup.robot, tables, found)


def start_of(
    robot: Robot, tables: Tables, start: Array | None
) -> tuple[Array | None, Array | None]:
    """Deviations and joint values of start poses (n, 7)."""
    if start is None:
        return None, None
    if not robot.joints:
        return statics.deviations(tables, start), None
    change = values_of_pose(robot, start)[0] - values_of_pose(robot, tables.poses)[0]
    return statics.deviations(tables, start), change * np.where(robot.hinges, robot.length, 1.0)


def certify(robot: Robot, tables: Tables, found: statics.Evaluation) -> Solution:
    """Recompute wrench, stiffness and energy at the answer, and say what it is worth."""
    check = statics.evaluate(tables, found, threads=None)
    check.count = found.count
    status = np.array([_OF_OUTCOME.get(o, Status.GAVE_UP) for o in found.outcome], dtype=object)
    balanced = check.residual < TOLERANCE
    status[(status == Status.CONVERGED) & ~balanced] = Status.STALLED
    # not found's own: a search in joint values alone leaves its deviations unplaced
    moved = check.deviation
    turn = np.where(moved[:, 3:4] < 0, -1.0, 1.0) * moved[:, 3:]
    lost = np.isin(found.outcome, (FALLING, CABLE_LAW, SPINNING))
    return Solution(
        robot=robot,
        tables=tables,
        evaluation=check,
        command=tables.poses,
        pose=_blank(statics.platform_poses(tables, moved), lost),
        deviation=_blank(np.concatenate([moved[:, :3], rotvec_from_quat(turn)], axis=1), lost),
        tensions=_blank(check.states[..., TENSION], lost),
        slack=statics.is_slack(tables, check),
        rest_lengths=tables.cables[..., REST],
        iterations=found.count,
        residual=np.where(lost, np.inf, check.residual),
        energy=check.energy,
        status=status,
    )


def _blank(values: Array, rows: NDArray[np.bool_]) -> Array:
    """No number where there is no answer."""
    values = values.copy()
    values[rows] = np.nan
    return values


def _commands(robot: Robot, poses: ArrayLike | None, lengths: ArrayLike | None) -> Commands:
    if lengths is None:
        if poses is None:
            raise InputError("solve needs commanded poses (n, 7) or rest_lengths (n, m); got none")
        return Commands(_poses(poses, "poses"))
    table = np.atleast_2d(_finite(lengths, "rest_lengths"))
    if table.ndim != 2 or table.shape[1] != robot.n_cables:
        raise InputError(
            f"rest_lengths must be (n, {robot.n_cables}) for {robot.name}, got {np.shape(lengths)}"
        )
    if np.any(table <= 0):
        raise InputError("rest_lengths must be positive [m]")
    start = robot.reference_pose[None] if poses is None else _poses(poses, "poses")
    if len(start) not in (1, len(table)):
        raise InputError(
            f"poses must be one or as many as the {len(table)} rows of rest_lengths, "
            f"got {len(start)}"
        )
    rows = np.broadcast_to(start, (len(table), 7)).copy()
    return Commands(rows, lengths=table)


def _finite(values: ArrayLike, name: str) -> Array:
    array = np.asarray(values, dtype=float)
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name} holds numbers that are not finite; expected finite ones")
    return array


def _array(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    array = _finite(values, name)
    if array.shape != shape:
        raise InputError(f"{name} must be {shape}, got {array.shape}")
    return array


def _poses(values: ArrayLike, name: str) -> Array:
    array = np.atleast_2d(_finite(values, name))
    if array.ndim != 2 or array.shape[1] != 7:
        raise InputError(f"{name} must be (n, 7), x y z qw qx qy qz, got {np.shape(values)}")
    norm = np.linalg.norm(array[:, 3:], axis=1)
    if np.any(np.abs(norm - 1.0) > 1e-3):
        row = int(np.argmax(np.abs(norm - 1.0)))
        raise InputError(
            f"{name} row {row} has a quaternion of norm {norm[row]:.4g}; expected a unit "
            "quaternion, scalar first"
        )
    out = array.copy()
    exact = np.abs(norm - 1.0) > 1e-15
    out[exact, 3:] /= norm[exact, None]
    return out
