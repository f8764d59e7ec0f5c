"""A bar on two cables may hang in several tilts: the map takes the one that is farthest inside.

The tilts are the roots of the paper's quartic, in closed form.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import approx_fprime, brentq, minimize

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


def lowest_by_energy(x: float, z: float) -> list[float]:
    """Lowest tensions [N] of all tilts that hold the bar's middle there and are energy minima.

    Forces give both tensions at a tilt, and the moment its roots. Whether the elastic bar stays
    there is asked of SciPy: it searches the least energy from a place beside it.
    """
    weight, ea = BAR.mass * 9.81, BAR.ea
    anchors = BAR.anchor_points[:, [0, 2]]

    def held(tilt: float, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Anchor points less the middle, lengths and directions to the exit points."""
        c, s = np.cos(tilt), np.sin(tilt)
        arms = anchors @ np.array([[c, s], [-s, c]])
        ways = EXITS - middle - arms
        lengths = np.linalg.norm(ways, axis=1)
        return arms, lengths, ways / lengths[:, None]

    def pulls(tilt: float) -> np.ndarray:
        return np.linalg.solve(held(tilt, np.array([x, z]))[2].T, [0.0, weight])

    def moment(tilt: float) -> float:
        arms, _, along = held(tilt, np.array([x, z]))
        return float(pulls(tilt) @ (arms[:, 0] * along[:, 1] - arms[:, 1] * along[:, 0]))

    tilts = np.linspace(-np.pi, np.pi, 4001)
    moments = np.array([moment(one) for one in tilts])
    found = []
    for k in np.flatnonzero(moments[1:] * moments[:-1] < 0.0):
        tilt = brentq(moment, tilts[k], tilts[k + 1], xtol=1e-14)
        pull = pulls(tilt)
        if abs(moment(tilt)) > 1e-8 or pull.min() < 0.0:  # a pole, or a cable that would push
            continue
        rest = held(tilt, np.array([x, z]))[1] / (1.0 + pull / ea)

        def energy(at: np.ndarray, rest: np.ndarray = rest) -> float:
            stretch = np.maximum(held(at[2], at[:2])[1] - rest, 0.0)
            return float(0.5 * np.sum(ea / rest * stretch**2) + weight * at[1])

        there = np.array([x, z, tilt])
        assert np.abs(approx_fprime(there, energy, 1e-7)).max() < 2e-3
        near = minimize(energy, there + np.array([1e-4, 1e-4, 1e-3]), method="Nelder-Mead",
                        options={"xatol": 1e-9, "fatol": 1e-13, "maxfev": 4000}).x  # fmt: skip
        if np.abs(near - there).max() < 1e-4:
            found.append(float(pull.min()))
    return found


@pytest.mark.parametrize(
    ("x", "best", "other"), [(0.981, 0.5355, 0.2269), (0.9807, 0.5436, 0.2304)]
)
def test_both_values_that_were_said_at_one_place_are_right(x: float, best: float, other: float):
    """0.5435 N and 0.5355 N: at places that differ by 0.3 mm, where the margin falls by 27 N/m."""
    rests = sorted(lowest_by_energy(x, 0.762))
    assert rests == pytest.approx([other, best], abs=1e-4)
    assert workspace_map(BAR, [x], [0.0], [0.762]).margin.item() == pytest.approx(rests[1])
