"""Very many rows are solved in portions: the same rests, in the memory that their results need."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest

import seecr
from seecr.statics.tables import PORTION

pytestmark = pytest.mark.slow

# A million rows are to fit into 2 GB, and Python with its libraries takes 0.3 GB of these. With
# eight cables 96 numbers stay of a row: its command, twice, and its pose (21), deviations (13),
# tensions, rest lengths and gaps (40), which cables are slack (2), and what is one number for each
# row. Three quarters more are there while these are made.
BYTES = 1700
MOMENT = (1.0, 0.0, 0.0, 0.0, 0.02, 0.0)
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "lanes": ("demobot_cogiro", {}),
    "a moment": ("demobot_cogiro", {"wrench": MOMENT}),
    "a moment on joints": ("planar_two_cable", {"wrench": MOMENT}),
    "sag": (
        "demobot_cogiro",
        {"effects": [seecr.Term.of("demobot_cogiro", "cable_weight", weight_N_per_m=0.05)]},
    ),
}


def poses_of(robot: seecr.Robot, n: int) -> np.ndarray:
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, [0, 2]] += 0.05 * np.random.default_rng(n).uniform(-1.0, 1.0, (n, 2))
    return poses


@pytest.mark.parametrize("kind", KINDS)
def test_a_million_rows_fit_into_2_gb(kind: str) -> None:
    name, more = KINDS[kind]
    robot = seecr.load_robot(name)

    def peak(n: int) -> int:
        """Of arrays: those of portions count in both of the numbers that are compared."""
        poses = poses_of(robot, n)
        tracemalloc.start()
        found = seecr.solve(robot, poses, **more)
        found.lines(), found.smallest_eigenvalue
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    seecr.solve(robot, poses_of(robot, 100), **more)
    assert (peak(3 * PORTION) - peak(2 * PORTION)) / PORTION < BYTES


@pytest.mark.parametrize("kind", KINDS)
def test_portions_rest_as_few_rows_do(kind: str) -> None:
    name, more = KINDS[kind]
    robot = seecr.load_robot(name)
    poses = poses_of(robot, PORTION + 100)
    rows = np.r_[0:100, PORTION - 50 : PORTION + 100]
    many, few = seecr.solve(robot, poses, **more), seecr.solve(robot, poses[rows], **more)
    assert len(many.evaluation.outcome) > PORTION and few.converged.all()
    for of in ("status", "deviation", "tensions", "slack", "energy", "iterations", "residual"):
        np.testing.assert_array_equal(getattr(many, of)[rows], getattr(few, of), of)
    # catenaries are evaluated from elsewhere, to their own tolerance
    assert np.allclose(many.evaluation.strain[rows], few.evaluation.strain, rtol=1e-9, atol=1e-15)
    assert np.allclose(many.balance[rows], few.balance, rtol=1e-12, atol=0.0)
    near = 1e-9 * np.abs(few.stiffness).max()
    for stiffness in (many.stiffness[rows], many.rows(rows).stiffness):
        assert np.allclose(stiffness, few.stiffness, rtol=0.0, atol=near)
    assert np.allclose(many.smallest_eigenvalue[rows], few.smallest_eigenvalue, rtol=0.0, atol=near)
