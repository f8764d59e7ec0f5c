"""SEECR's stiffness and natural frequencies at rest are MuJoCo's."""

from __future__ import annotations

import numpy as np
import pytest
from mujoco_modes import mujocos_modes

from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import shipped_cases
from crosscheck.suite.run import run_case

NAMES = (
    "cogiro-vectran-turned", "parallel-fishing-turned", "parallel-vectran-tilted", "uneven-turned",
    "off-centre-turned", "planar-two-cable-inverted", "planar-vertical-vectran-turned",
    "planar-horizontal-fishing-turned", "cogiro-large-sweep", "ipanema-sweep", "camera-sweep",
)  # fmt: skip


@pytest.fixture(scope="module")
def shipped():
    return {case.name: case for case in shipped_cases(n_random=1)}


@pytest.mark.parametrize("name", NAMES)
def test_stiffness_and_frequencies_at_rest_are_mujocos(name, shipped):
    result = run_case(shipped[name], load_thresholds())
    solution, mujoco = result.solution, result.case.settler()
    np.testing.assert_allclose(
        solution.smallest_eigenvalue, result.settling.smallest_eigenvalue, rtol=1e-5
    )
    scale = np.where(solution.robot.hinges, solution.robot.length, 1.0)
    for i in range(0, len(result), 5):
        command, pose = solution.command[i], result.settling.pose[i]
        stiffness, frequencies = mujocos_modes(mujoco, pose, command)
        own = np.linalg.eigvalsh(solution.stiffness[i] / np.outer(scale, scale))
        np.testing.assert_allclose(own, stiffness, rtol=1e-5, atol=1e-6 * stiffness[-1])
        np.testing.assert_allclose(solution.frequencies[i], frequencies, rtol=1e-5)
