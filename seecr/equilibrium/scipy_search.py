"""The paper's own search: SciPy's fsolve and least_squares from its first guess (steps 4 to 10)."""

from __future__ import annotations

import warnings

import numpy as np
from scipy import optimize

from seecr.compiled.columns import (
    ANCHOR,
    CONVERGED,
    SINGULAR,
    SINGULAR_PART,
    STALLED,
    TOLERANCE,
    UNSTABLE,
)
from seecr.effects.setup import Setup
from seecr.pose import Array, quat_from_rotvec, quat_multiply, transform_points
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble, take

# Not an outcome of the compiled loop: SciPy reported that it failed.
GAVE_UP = 100


def first_guess(setup: Setup) -> Array:
    """How far [m] the platform falls at first, (n,): m g l_vmean / k_c (step 4).

    l_vmean is the mean vertical extent of the cables. The paper prints their sum and calls it the
    mean.
    """
    up = setup.robot.up
    poses = setup.commands.pose
    tables = assemble(setup)
    anchors = tables.cables[0, :, ANCHOR : ANCHOR + 3]
    vertical = (setup.exit_points - transform_points(poses, anchors)) @ up
    return np.asarray(setup.weight() * vertical.mean(axis=1) / float(np.mean(setup.ea)))


def solve_with_scipy(
    setup: Setup,
    tables: Tables,
    method: str,
    start: Array | None,
    limit: int,
    start_values: Array | None = None,
) -> batch.Evaluation:
    """Solve pose by pose; residuals are differenced numerically, as in the paper.

    Args:
        setup: what is solved.
        tables: assembled from it.
        method: ``"fsolve"`` or ``"least_squares"``.
        start: (n, 7) deviations to start from instead of the paper's first guess.
        limit: most iterations, each of which differences the Jacobian once.
        start_values: (n, d) the same for a platform on joints.
    """
    found = batch.Evaluation.at_commands(tables)
    fall = first_guess(setup)
    down = -setup.robot.up
    for i in range(len(tables)):
        one = take(tables, np.array([i]))
        point = batch.Evaluation.at_commands(one)
        base = np.array([0.0, 0, 0, 1, 0, 0, 0]) if start is None else start[i]
        counter = [0]

        def residual(x: Array, one=one, point=point, base=base, counter=counter) -> Array:  # type: ignore[no-untyped-def]
            counter[0] += 1
            _place(one, point, base, x)
            return np.asarray(batch.evaluate(one, point).gradient[0] / one.scale[0])

        x0 = np.zeros(tables.n_dof)
        if start is None:
            x0 = _falling(tables, i, down * fall[i])
        elif start_values is not None:
            x0 = start_values[i].copy()
        ok, x = _search(method, residual, x0, limit)
        _place(one, point, base, x)
        found.deviation[i], found.values[i] = point.deviation[0], point.values[0]
        found.count[i] = counter[0]
        # a pose that balances is an answer, even if SciPy reports that it could not get closer
        outcome = _judge(one, point)
        found.outcome[i] = outcome if ok or outcome != STALLED else GAVE_UP
    return found


def _search(method: str, residual, x0: Array, limit: int) -> tuple[bool, Array]:  # type: ignore[no-untyped-def]
    with warnings.catch_warnings():
        # MINPACK warns about slow progress; its flag says the same, and that is what we report
        warnings.simplefilter("ignore", RuntimeWarning)
        if method == "fsolve":
            x, _info, flag, _text = optimize.fsolve(
                residual, x0, full_output=True, xtol=1e-13, maxfev=limit * (len(x0) + 1)
            )
            return flag == 1, x
        result = optimize.least_squares(
            residual, x0, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=limit
        )
        return bool(result.success), result.x


def _falling(tables: Tables, i: int, fall: Array) -> Array:
    """The fall as a change of the unknowns: of those joints that can follow it."""
    x = np.zeros(tables.n_dof)
    if tables.screws.shape[1] == 0:
        x[:3] = fall
        return x
    for j, screw in enumerate(tables.screws[i]):
        if screw[0] == 0.0:
            x[j] = float(screw[1:4] @ fall)
    return x


def _place(tables: Tables, point: batch.Evaluation, base: Array, x: Array) -> None:
    if tables.screws.shape[1] > 0:
        point.values[0] = x
        return
    turn = quat_from_rotvec(x[3:] / tables.length)
    point.deviation[0, :3] = base[:3] + x[:3]
    point.deviation[0, 3:] = quat_multiply(turn, base[3:])


def _judge(one: Tables, point: batch.Evaluation) -> int:
    """The outcome at the point that SciPy returned, from its residual and stiffness."""
    at = batch.evaluate(one, point)
    point.deviation[0] = at.deviation[0]
    if not at.residual[0] < TOLERANCE:
        return STALLED
    eigenvalues = np.linalg.eigvalsh(at.hessian[0])
    floor = SINGULAR_PART * np.abs(np.diag(at.hessian[0])).max()
    if eigenvalues[0] < -floor:
        return UNSTABLE
    return CONVERGED if eigenvalues[0] > floor else SINGULAR
