"""The law of one cable: straight, over a pulley, hanging; each against an independent truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest
from one_cable import UP as ABOVE
from one_cable import cable, in_direction, pull
from scipy.integrate import quad
from scipy.optimize import brentq, root

from seecr.compiled.cable_law import dahl, pulley_geometry, strain_of_tension, winch_tension
from seecr.compiled.catenary import bracketed_pull, catenary_span
from seecr.compiled.columns import (
    CREEP,
    CREEP_RATE,
    EA,
    ENERGY,
    HYSTERESIS_BEFORE,
    N_STATE,
    REST,
    SLACK,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    WINCH_TENSION,
)
from seecr.compiled.history import N_KEPT, keep_past, take_past

DIRECTIONS = (-40.0, 0.0, 20.0, 60.0, 89.0)
KINDS: dict[str, dict[str, float]] = {
    "straight": {},
    "pulley": {"RADIUS": 0.03},
    "hanging": {"WEIGHT": 0.4},
    "hanging-pulley": {"WEIGHT": 0.4, "RADIUS": 0.03},
    "nonlinear": {"QUADRATIC": 3.0, "CUBIC": 40.0},
    "series": {"WINCH_SIDE": 1.5, "COMPLIANCE": 2e-4, "CREEP": 1e-3, "CREEP_RATE": 1e-6},
    "hysteresis": {"HYSTERESIS": 1.5, "HYSTERESIS_STRETCH": 0.004},
    "friction": {"FRICTION": 0.2, "STUCK": 4.0, "WINCH_SIDE": 1.5},
    "yielding": {"COMPLIANCE": 2e-4, "LIFT": -1.5e-4},
    "yielding-up": {"LIFT": 3e-4, "QUADRATIC": 3.0},
    "yielding-pulley": {"RADIUS": 0.03, "COMPLIANCE": 2e-4, "LIFT": 3e-4},
    "hanging-series": {
        "WEIGHT": 0.4, "WINCH_SIDE": 1.5, "COMPLIANCE": 2e-4, "CREEP": 1e-3, "CREEP_RATE": 1e-6,
    },
    "yielding-hanging": {"WEIGHT": 0.4, "COMPLIANCE": 2e-4, "LIFT": -1.5e-4},
    "hanging-all": {
        "WEIGHT": 0.4, "QUADRATIC": 3.0, "WINCH_SIDE": 1.5, "COMPLIANCE": 2e-4, "RADIUS": 0.03,
        "CREEP_RATE": 1e-6,
    },
}  # fmt: skip


@pytest.mark.parametrize("below", DIRECTIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_stiffness_and_slope_against_differences(kind: str, below: float) -> None:
    row = cable(**KINDS[kind])
    for stretch in (0.01, 1e-5, -0.05):  # taut, barely, slack
        anchor = in_direction(below, row[REST] * (1 + row[CREEP]) + stretch)
        here = pull(row, anchor)
        assert here.ok
        size = 1e-7
        for k in range(3):
            step = size * np.eye(3)[k]
            ahead, behind = pull(row, anchor, step), pull(row, anchor, -step)
            top = 1e-6 * (np.abs(here.stiffness).max() + 1.0)
            stiffness = -(ahead.force - behind.force) / (2 * size)
            assert stiffness == pytest.approx(here.stiffness[:, k], rel=1e-5, abs=20 * top)
            slope = (ahead.tension - behind.tension) / (2 * size)
            assert slope == pytest.approx(here.slope[k], rel=1e-5, abs=20 * top)


@numba.njit  # type: ignore[misc]  # uncached: it would not notice that the law changes
def strain_of(row: np.ndarray, tension: float) -> float:
    """The strain at a tension, from a function that only compiled code calls."""
    return float(strain_of_tension(row, tension)[0])


def test_the_strain_of_a_cable_that_sticks_is_found_to_rounding() -> None:
    """About its last stretch it is five times as stiff; beyond, Newton's steps led to and fro."""
    row = cable(
        REST=0.57744, EA=300.0, HYSTERESIS=0.0747, HYSTERESIS_STRETCH=1e-5,
        STRETCH_BEFORE=1.28183e-3, HYSTERESIS_BEFORE=-0.057429,
    )  # fmt: skip
    for tension in (*np.linspace(0.55, 0.75, 2001), 0.604106):
        strain = strain_of(row, tension)
        assert row[EA] * strain + dahl(row, strain)[0] == pytest.approx(tension, rel=1e-13)


WITH_ENERGY = {
    **{k: KINDS[k] for k in ("straight", "pulley", "series", "hanging", "hanging-series")},
    **{k: KINDS[k] for k in ("yielding-hanging", "nonlinear", "yielding-up")},
    "softening": {"QUADRATIC": -30.0, "CUBIC": 400.0},
    "hardly soft": {"QUADRATIC": -80.0},
    "nonlinear-series": {**KINDS["series"], "QUADRATIC": 3.0, "CUBIC": 40.0},
    "nonlinear-pulley": {**KINDS["series"], "RADIUS": 0.03, "QUADRATIC": -20.0, "CUBIC": 900.0},
    "nonlinear-hanging": {**KINDS["hanging-series"], "QUADRATIC": 3.0, "CUBIC": 40.0},
    "softening-hanging": {**KINDS["hanging-series"], "QUADRATIC": -30.0, "CUBIC": 400.0},
}  # fmt: skip


@pytest.mark.parametrize("chord", [2.03, 2.004, 2.15, 1.9])
@pytest.mark.parametrize("kind", WITH_ENERGY)
def test_force_is_the_gradient_of_the_energy(kind: str, chord: float) -> None:
    row = cable(**WITH_ENERGY[kind])
    anchor = in_direction(25.0, chord)
    here = pull(row, anchor)
    for k in range(3):
        step = 1e-5 * np.eye(3)[k]
        energies = [pull(row, anchor, s).state[ENERGY] for s in (step, -step)]
        slope = -(energies[0] - energies[1]) / 2e-5
        assert slope == pytest.approx(here.force[k], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("kind", ["softening", "hardly soft", "nonlinear-series"])
def test_energy_of_a_curved_law_is_the_work_of_pulling(kind: str) -> None:
    """Through the soft part and beyond it, against a quadrature of the tension."""
    row = cable(**WITH_ENERGY[kind])

    def tension(stretch: float) -> float:
        return pull(row, [2.0 + stretch, 0, 0]).tension

    kinks = [2.0 * e for e in (0.0134, 0.0366, 0.0062)]  # of strains where a slope ends
    for stretch in (-0.1, 1e-4, 0.02, 0.06, 0.3):
        work, _ = quad(tension, 0.0, stretch, epsabs=1e-10, epsrel=1e-10, limit=300, points=kinks)
        energy = pull(row, [2.0 + stretch, 0, 0]).state[ENERGY]
        assert energy == pytest.approx(max(work, 0.0), rel=1e-7, abs=1e-9)


# --- straight ----------------------------------------------------------------------------------


def test_tension_is_equation_10_and_never_pushes() -> None:
    taut, slack = pull(cable(), [0, 0, -2.02]), pull(cable(), [0, 0, -1.9])
    assert taut.tension == pytest.approx(1000 * 0.02 / 2.0, rel=1e-13)
    assert taut.force == pytest.approx([0, 0, 10.0], rel=1e-13)
    assert taut.stiffness == pytest.approx(np.diag([10 / 2.02, 10 / 2.02, 500.0]), rel=1e-12)
    assert slack.tension == 0.0 and not np.any(slack.force) and not np.any(slack.stiffness)
    assert (taut.state[SLACK], slack.state[SLACK]) == (0.0, 1.0)


def test_a_stiff_cable_keeps_the_digits_of_a_tiny_stretch() -> None:
    row = cable(EA=1e7)
    anchor = in_direction(30.0, 2.0)
    away = anchor / np.linalg.norm(anchor)
    for stretch in (1e-8, 1e-11, 1e-14):
        taut = pull(row, anchor, away * stretch)
        first = pull(row, anchor).tension
        assert taut.tension - first == pytest.approx(1e7 * stretch / 2.0, rel=1e-5, abs=1e-9)


def test_what_is_in_series_adds_its_stretch() -> None:
    row = cable(**KINDS["series"])
    for tension in (0.5, 20.0):
        stretch = 2.0 * (tension / 1000 + 1e-3 + 1e-6 * tension)
        stretch += 1.5 / 1000 * tension + 2e-4 * tension
        assert pull(row, [2.0 + stretch, 0, 0]).tension == pytest.approx(tension, rel=1e-11)


def test_a_soft_cable_keeps_its_digits_far_out() -> None:
    """Where the polynomial itself would be a thousand times what the cable carries."""
    quadratic, cubic = -50.0, -2.3e5
    low = (-quadratic - math.sqrt(quadratic**2 - 3.0 * cubic * 0.99)) / (3.0 * cubic)
    assert 1.0 + 2.0 * quadratic * low + 3.0 * cubic * low**2 == pytest.approx(0.01)
    row = cable(QUADRATIC=quadratic, CUBIC=cubic)
    share = low + quadratic * low**2 + cubic * low**3
    work = 0.5 * low**2 + quadratic * low**3 / 3.0 + 0.25 * cubic * low**4
    for strain in (0.01, 0.2, 0.9):
        found, soft = pull(row, [2.0 * (1.0 + strain), 0, 0]), strain - low
        assert found.tension == pytest.approx(1000.0 * (share + 0.01 * soft), rel=1e-13)
        stored = work + share * soft + 0.005 * soft**2
        assert found.state[ENERGY] == pytest.approx(2000.0 * stored, rel=1e-13)


# --- pulley -------------------------------------------------------------------------------------


def brute_pulley(across: float, rise: float, r: float) -> tuple[float, np.ndarray]:
    """Length and leaving direction by search for the point of the rim where a tangent hits B."""
    centre, anchor = np.array([r, 0.0]), np.array([across, rise])

    def leaves(psi: float) -> np.ndarray:
        return centre + r * np.array([np.cos(psi), np.sin(psi)])

    def misses(psi: float) -> float:
        """How far B lies beside the tangent at psi."""
        return float((anchor - leaves(psi)) @ np.array([np.cos(psi), np.sin(psi)]))

    found = []
    grid = np.linspace(-np.pi / 2, np.pi, 4001)
    values = [misses(psi) for psi in grid]
    for a, b, fa, fb in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if fa * fb < 0:
            psi = brentq(misses, a, b, xtol=1e-15)
            tangent = np.array([np.sin(psi), -np.cos(psi)])  # onwards over the top
            free = float((anchor - leaves(psi)) @ tangent)
            if free > 0:
                found.append((free + r * (np.pi - psi), tangent))
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("r", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("place", [(1.0, -0.5), (0.9, 0.3), (0.5, -2.0), (2.0, 0.0), (0.41, -1.0)])
def test_pulley_by_search(place: tuple[float, float], r: float) -> None:
    length, direction = brute_pulley(*place, r)
    whole, free, tx, tz = pulley_geometry(*place, r)
    assert whole == pytest.approx(length, rel=1e-12)
    assert [tx, tz] == pytest.approx(direction, abs=1e-12)
    assert free == pytest.approx(np.sqrt((place[0] - r) ** 2 + place[1] ** 2 - r**2), rel=1e-12)


def test_pulley_of_no_radius_is_no_pulley() -> None:
    for place in ((1.0, -0.5), (0.5, 0.7)):
        assert pulley_geometry(*place, 0.0)[0] == pytest.approx(np.hypot(*place), rel=1e-15)
    differences = [pulley_geometry(1.0, -0.5, r)[0] - np.hypot(1, 0.5) for r in (1e-3, 1e-5)]
    assert differences[0] / differences[1] == pytest.approx(100, rel=0.01)


def test_pulley_swivels_to_face_its_anchor() -> None:
    row = cable(RADIUS=0.05, EXIT=0.2)
    for azimuth in (0.0, 1.0, 2.5, -2.0):
        anchor = np.array([0.2, 0, 0]) + in_direction(30.0, 2.1, azimuth)
        found = pull(row, anchor)
        turned = pull(row, np.array([0.2, 0, 0]) + in_direction(30.0, 2.1, 0.0))
        assert found.tension == pytest.approx(turned.tension, rel=1e-12)
        sideways = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        assert found.force @ sideways == pytest.approx(0, abs=1e-10)
        length, direction = brute_pulley(2.1 * np.cos(np.pi / 6), -1.05, 0.05)
        assert found.tension == pytest.approx(500 * (length - 2.0), rel=1e-10)
        assert found.force[2] == pytest.approx(-found.tension * direction[1], rel=1e-10)


# --- catenary ----------------------------------------------------------------------------------


def irvine(h: float, v: float, w: float, length: float, ea: float) -> tuple[float, float]:
    """Span of an elastic catenary by quadrature along it, from the lower end."""

    def part(s: float, horizontal: bool) -> float:
        tension = np.hypot(h, v + w * s)
        return float((h if horizontal else v + w * s) * (1 / tension + 1 / ea))

    spans = [quad(part, 0, length, args=(flag,), epsabs=1e-12, epsrel=1e-11, limit=200,
                  points=[min(max(-v / w, 0), length)])[0] for flag in (True, False)]  # fmt: skip
    return spans[0], spans[1]


HANGING = [(50.0, 3.0), (5.0, 0.2), (5.0, -0.9), (0.5, -0.3), (0.05, -0.4), (2.0, -3.0)]


@pytest.mark.parametrize(("h", "v"), HANGING)
def test_span_of_a_catenary_by_quadrature(h: float, v: float) -> None:
    x, z, xh, xv, zv, xl, zl = catenary_span(h, v, 0.4, 2.0, 1000.0)
    assert (x, z) == pytest.approx(irvine(h, v, 0.4, 2.0, 1000.0), rel=1e-10, abs=1e-11)
    at = np.array([h, v, 0.4, 2.0])
    for k, column in ((0, (xh, xv)), (1, (xv, zv)), (3, (xl, zl))):
        step = 1e-6 * np.eye(4)[k]
        ahead, behind = (catenary_span(*there, 1000.0) for there in (at + step, at - step))
        slope = (np.array(ahead[:2]) - behind[:2]) / 2e-6
        assert slope == pytest.approx(column, rel=1e-6, abs=1e-8 * max(1.0, abs(xh)))


@pytest.mark.parametrize("chord", [2.05, 2.0001, 1.99, 1.7, 0.8], ids=lambda c: f"chord{c}")
@pytest.mark.parametrize("below", [-50.0, 0.0, 35.0, 80.0])
def test_catenary_between_two_points_by_quadrature(below: float, chord: float) -> None:
    """Taut, near slack and slack: the pull at both ends, by a root search on the quadrature."""
    row = cable(WEIGHT=0.4)
    anchor = in_direction(below, chord)
    found = pull(row, anchor)
    assert found.ok
    across, rise = chord * np.cos(np.deg2rad(below)), chord * np.sin(np.deg2rad(below))
    start = np.array([max(np.hypot(*found.force[:2]), 1e-3), found.force[2] * -1.0]) * [1.2, 0.9]

    def misses(hv: np.ndarray) -> list[float]:
        x, z = irvine(abs(hv[0]), -hv[1] * -1.0, 0.4, 2.0, 1000.0)
        return [x - across, z - rise]

    truth = root(misses, [start[0], -start[1]], method="hybr", tol=1e-12)
    assert truth.success or np.abs(truth.fun).max() < 1e-10
    h, v = abs(truth.x[0]), truth.x[1]
    assert np.hypot(*found.force[:2]) == pytest.approx(h, rel=1e-6)
    assert found.force[2] == pytest.approx(v, rel=1e-6, abs=1e-8)
    assert found.tension == pytest.approx(np.hypot(h, v + 0.4 * 2.0), rel=1e-6)
    assert found.state[SLACK] == float(chord < 2.0)


def test_catenaries_by_brackets_are_those_by_quadrature() -> None:
    for across, rise, w in ((0.3, 0.8, 0.4), (1e-4, -0.9, 0.01), (2e-7, 0.5, 2.0)):
        h, v = bracketed_pull(across, rise, w, 1.0, 3000.0)
        assert irvine(h, v, w, 1.0, 3000.0) == pytest.approx((across, rise), rel=1e-6, abs=1e-9)


def test_cables_that_hang_nearly_straight_and_are_barely_slack_are_solved() -> None:
    """Newton's method alone leaves about one in ten of these."""
    random = np.random.default_rng(3)
    for _ in range(400):
        chord = 1.0 - 10.0 ** random.uniform(-9.0, -7.0)
        aside = 10.0 ** random.uniform(-4.5, -3.0)
        weight, ea = 10.0 ** random.uniform(-4.0, 1.0), 10.0 ** random.uniform(2.0, 6.0)
        row = cable(REST=1.0, WEIGHT=weight, EA=ea)
        anchor = chord * np.array([np.sin(aside), 0.0, random.choice([-1.0, 1.0]) * np.cos(aside)])
        assert pull(row, anchor).ok


def test_the_weight_of_a_hanging_cable_is_shared_by_its_ends() -> None:
    found = pull(cable(WEIGHT=0.4), in_direction(0.0, 1.5))
    assert found.force[2] == pytest.approx(-0.4, rel=1e-9)  # half of 0.8 N each
    straight_down = pull(cable(WEIGHT=0.4), [0, 0, -1.0])
    assert straight_down.ok
    # a loop: of 2 m, 1.5 m hang from the exit point and 0.5 m from the anchor, but for stretch
    assert straight_down.tension == pytest.approx(0.4 * 1.5, rel=1e-3)
    assert straight_down.force[2] == pytest.approx(-0.4 * 0.5, rel=1e-3)


SLOPES = [(b, r) for r in (0.0, 0.05) for b in (-40.0, 0.0, 30.0, 85.0)]


@pytest.mark.parametrize(("below", "radius"), SLOPES)
def test_no_weight_is_the_straight_law(below: float, radius: float) -> None:
    anchor = in_direction(below, 2.05)
    straight = pull(cable(RADIUS=radius), anchor)
    differences = []
    for weight in (1e-3, 1e-6, 1e-9, 1e-13):
        light = pull(cable(WEIGHT=weight, RADIUS=radius), anchor)
        assert light.ok
        differences.append(float(np.linalg.norm(light.force - straight.force)))
        if radius == 0.0:
            near = pytest.approx(straight.stiffness, rel=1e-3, abs=10 * weight + 1e-5)
            assert light.stiffness == near
    # of first order in the weight: the two cables share it
    assert differences[0] == pytest.approx(1e3 * differences[1], rel=0.05)
    assert differences[2] < 1e-8 and differences[3] < 1e-8


# --- hysteresis and friction -------------------------------------------------------------------


def follow(strains: np.ndarray, amplitude: float, turning: float) -> np.ndarray:
    """Hysteretic tension along a path of strains, carried from state to state."""
    row = cable(HYSTERESIS=amplitude, HYSTERESIS_STRETCH=turning)
    z = []
    for strain in strains:
        z.append(dahl(row, strain)[0])
        row[STRETCH_BEFORE], row[HYSTERESIS_BEFORE] = strain * row[REST], z[-1]
    return np.array(z)


def test_dahl_in_one_step_or_in_many() -> None:
    many = follow(np.linspace(0, 0.01, 1001), 1.5, 0.008)[-1]
    once = follow(np.array([0.0, 0.01]), 1.5, 0.008)[-1]
    assert many == pytest.approx(once, rel=1e-12)
    assert once == pytest.approx(1.5 * (1 - np.exp(-0.02 / 0.008)), rel=1e-12)


def test_dahl_loop_area_in_closed_form() -> None:
    """Work lost in a settled cycle of +-a: 4 Z (a - e_c tanh(a/e_c)) [J]."""
    amplitude, turning, a = 1.5, 0.008, 0.01
    cycle = np.concatenate([np.linspace(-a, a, 2001), np.linspace(a, -a, 2001)[1:]])
    stretch = np.concatenate([np.linspace(0, -a, 1001), np.tile(cycle, 6)])
    z = follow(stretch / 2.0, amplitude, turning)
    last = slice(-len(cycle), None)
    area = np.trapezoid(z[last], stretch[last])
    assert area == pytest.approx(4 * amplitude * (a - turning * np.tanh(a / turning)), rel=1e-5)
    assert z[last].max() == pytest.approx(amplitude * np.tanh(a / turning), rel=1e-6)


def test_capstan_band() -> None:
    """Euler-Eytelwein: between T e^-mu and T e^mu the winch side keeps what it had."""
    row = cable(FRICTION=0.2, STUCK=10.0)
    grip = np.exp(0.2)
    for tension, behind, slope in (
        (10.0, 10.0, 0.0),
        (10.0 * grip * 0.999, 10.0, 0.0),
        (10.0 / grip * 1.001, 10.0, 0.0),
        (20.0, 20.0 / grip, 1 / grip),
        (5.0, 5.0 * grip, grip),
        (0.0, 0.0, grip),
    ):
        assert winch_tension(row, tension) == pytest.approx((behind, slope), rel=1e-14)
    assert winch_tension(cable(STUCK=10.0), 3.0) == (3.0, 1.0)


def test_friction_holds_the_stretch_behind_the_exit_point() -> None:
    """While it sticks, the cable behind keeps its stretch and the free part works alone."""
    row = cable(FRICTION=0.2, STUCK=10.0, WINCH_SIDE=1.5)
    behind = 1.5 * 10.0 / 1000
    for tension in (9.0, 11.0):
        found = pull(row, [2.0 * (1 + tension / 1000) + behind, 0, 0])
        assert found.tension == pytest.approx(tension, rel=1e-9)
        assert found.state[WINCH_TENSION] == 10.0
        assert found.slope[0] == pytest.approx(1000 / 2.0, rel=1e-6)
    slipping = pull(row, [2.0 * 1.03 + 1.5 * 30 * np.exp(-0.2) / 1000, 0, 0])
    assert slipping.tension == pytest.approx(30.0, rel=1e-9)
    assert slipping.state[WINCH_TENSION] == pytest.approx(30 * np.exp(-0.2), rel=1e-9)


@pytest.mark.parametrize("part", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("curve", [(-218.0, 25278.0), (20.0, 14313.0)])
def test_far_stretched_a_curved_law_hangs_as_a_straight_cable(
    curve: tuple[float, float], part: float
) -> None:
    """None was found: the start was the tension of a linear cable, thousands of times too small.

    So robots whose first step went far fell, though a rest was near.
    """
    law, rng = dict(zip(("QUADRATIC", "CUBIC"), curve, strict=True)), np.random.default_rng(0)
    for weight in 10.0 ** rng.uniform(-3.0, 0.0, 40):
        anchor = in_direction(rng.uniform(-30.0, 89.0), 2.0 * (1.0 + part))
        hanging, straight = pull(cable(**law, WEIGHT=weight), anchor), pull(cable(**law), anchor)
        assert hanging.ok and hanging.tension == pytest.approx(straight.tension, rel=1e-3)


# --- An exit point that yields differently upwards: in series with its cable, else not at all


@pytest.mark.parametrize("law", [{}, {"QUADRATIC": -218.0, "CUBIC": 25278.0}, {"QUADRATIC": -40.0}])
@pytest.mark.parametrize("series", [{}, {"WINCH_SIDE": 4.5}, {"RADIUS": 0.03}])
def test_the_lift_is_found_also_about_kinks(
    law: dict[str, float], series: dict[str, float]
) -> None:
    """Newton steps went to and fro about the kink of a cable that is lifted till it is slack.

    After fifty of them the force was that of no lift, and rows that can be held had stalled.
    """
    rng, lifts = np.random.default_rng(2), []
    for more in 10.0 ** rng.uniform(-4.0, -2.0, 60):
        anchor = in_direction(rng.uniform(20.0, 89.0), 2.0 + rng.uniform(-0.01, 0.08))
        here = pull(cable(**law, **series, LIFT=more), anchor)
        lifts.append(-more * (ABOVE @ here.force))
        there = pull(cable(**law, **series), anchor, -lifts[-1] * ABOVE)
        assert here.ok
        assert here.force == pytest.approx(there.force, rel=1e-9, abs=1e-9)
    assert min(lifts) < -0.03


# --- The history of a cable: creep against its closed form, friction by hand


def from_python(function: Any) -> Callable[..., Any]:
    """A function that only compiled functions can call, with a wrapper for calls from Python."""

    @numba.njit  # type: ignore[misc]
    def call(*given):  # type: ignore[no-untyped-def]
        return function(*given)

    return call  # type: ignore[no-any-return]


take, keep = from_python(take_past), from_python(keep_past)
# Three per cent of an elastic strain of T / 1000 N creep, with 50 s.
CREEPS = {"CREEP_PART": 0.03, "CREEP_TIME": 50.0}


def crept(times: list[float], tensions: list[float]) -> float:
    """Creep strain after a tension that is linear between times [s], first held for ever."""
    row, kept = cable(**CREEPS), np.zeros(N_KEPT)
    for k, tension in enumerate(tensions):
        elapsed = 1e9 if k == 0 else times[k] - times[k - 1]
        take(row, kept, elapsed, k == 0)
        state = np.zeros(N_STATE)
        state[TENSION], state[STRAIN] = tension, tension / 1000.0
        keep(row, state, k == 0, kept)
    return float(row[CREEP] + row[CREEP_RATE] * tensions[-1])


@pytest.mark.parametrize("ramp", [1e-3, 0.02, 30.0])
def test_creep_goes_after_a_ramp_as_its_differential_equation_says(ramp: float) -> None:
    """y' = (x - y)/tau, x from 0 to 1 over r: y = 1 - tau/r (e^(r/tau) - 1) e^(-t/tau)."""
    tau, t = 50.0, ramp + 20.0
    full = 0.03 * 4.0 / 1000.0
    expected = full * (1.0 - tau / ramp * math.expm1(ramp / tau) * math.exp(-t / tau))
    assert crept([0.0, ramp, t], [0.0, 4.0, 4.0]) == pytest.approx(expected, rel=1e-9)


def test_creep_does_not_depend_on_rows_along_a_straight_way() -> None:
    """Also not where it lags far behind, nor for steps so short that a series takes over."""
    whole = crept([0.0, 10.0, 60.0], [1.0, 5.0, 10.0])
    parts = crept([0.0, 10.0, 10.04, 20.0, 60.0], [1.0, 5.0, 5.004, 6.0, 10.0])
    assert parts == pytest.approx(whole, rel=1e-12)


def test_paying_out_relaxes_the_cable_behind_its_exit_point() -> None:
    """2 mm on 1.6 m of 1000 N: 1.25 N less than before."""
    row, kept, state = (
        cable(**CREEPS, FRICTION=0.3, WINCH_SIDE=1.6), np.zeros(N_KEPT), np.zeros(N_STATE),
    )  # fmt: skip
    state[TENSION], state[WINCH_TENSION], state[STRAIN] = 3.0, 3.5, 0.003
    keep(row, state, False, kept)
    longer = cable(**CREEPS, FRICTION=0.3, WINCH_SIDE=1.6, REST=2.002)
    take(longer, kept, 1.0, False)
    assert longer[STUCK] == pytest.approx(3.5 - 1.25)
