"""A bar on two cables may hang in several tilts: the map takes the one that is farthest inside.

The tilts are the roots of the paper's quartic, in closed form.
"""

from __future__ import annotations

import numpy as np

from seecr import bar_equilibria, load_robot, workspace_map

BAR = load_robot("planar_two_cable")
EXITS = BAR.exit_points[:, [0, 2]]
HALF = float(np.linalg.norm(BAR.anchor_points[0]))


def best_margin(x: float, z: float) -> float:
    """The largest lowest tension [N] of stable tilts; minus infinity where there is none."""
    weight = BAR.mass * float(np.linalg.norm(BAR.gravity))
    rests = [min(one.tensions) for one in bar_equilibria(EXITS, [x, z], HALF) if one.stable]
    return weight * max(rests, default=-np.inf)


def test_the_better_of_two_stable_tilts_is_taken():
    """0.227 N was said at one of the places, where the other stable tilt has 0.536 N."""
    xs, zs = np.array([0.02, 0.3, 0.93, 0.981]), np.array([0.6, 0.762, 0.9])
    expected = np.array([[best_margin(x, z) for z in zs] for x in xs])
    margin = workspace_map(BAR, xs, [0.0], zs).margin[:, 0, :]
    assert np.array_equal(np.isfinite(margin), np.isfinite(expected))
    held = np.isfinite(expected)
    np.testing.assert_allclose(margin[held], expected[held], rtol=1e-9)
    alone = workspace_map(BAR, [0.981], [0.0], [0.762]).margin
    np.testing.assert_allclose(alone, best_margin(0.981, 0.762), rtol=1e-9)
