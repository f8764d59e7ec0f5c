"""Which robots are solved again with a stiffness that is raised in stages, and which rows never."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr import Commands, Experiment, load_robot
from seecr.compiled.columns import CONVERGED, ITERATIONS
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble

SOFT = load_robot("demobot_parallel")
STIFF = replace(SOFT, ea=SOFT.ea * 1e4)
LIMIT = 30  # evaluations; most of these poses of the stiff robot need more


def tables_of(robot) -> Tables:
    poses = np.tile(robot.reference_pose, (40, 1))
    poses[:, :3] += np.random.default_rng(1).uniform(-0.15, 0.15, (40, 3))
    return assemble(Experiment(robot, Commands(poses)).setup(()))


def test_rows_of_a_stiff_robot_that_do_not_settle_are_solved_again_in_stages():
    tables = tables_of(STIFF)
    plain, found = (
        batch.descend(tables, limit=LIMIT, staged=False),
        batch.descend(tables, limit=LIMIT),
    )
    late = plain.outcome == ITERATIONS
    assert 0 < late.sum() < len(late) and np.all(plain.outcome[~late] == CONVERGED)
    assert np.all(found.outcome == CONVERGED) and np.all(found.residual < 1e-9)
    # what was found at once is not touched, and the others' first attempt counts
    assert np.array_equal(found.count[~late], plain.count[~late])
    assert np.array_equal(found.deviation[~late], plain.deviation[~late])
    assert np.all(found.count[late] > LIMIT)


def test_a_soft_robot_is_never_solved_in_stages():
    """It may come to another equilibrium by them."""
    found = batch.descend(tables_of(SOFT), limit=LIMIT // 3)
    assert np.any(found.outcome == ITERATIONS) and found.count.max() <= LIMIT // 3
