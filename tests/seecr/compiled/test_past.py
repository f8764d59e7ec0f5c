"""The history of a cable: creep against its closed form, friction by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from from_python import from_python
from one_cable import cable

from seecr.compiled.columns import (
    CREEP,
    CREEP_RATE,
    FRICTION,
    HYSTERESIS,
    N_STATE,
    STRAIN,
    STUCK,
    TENSION,
    WINCH_TENSION,
)
from seecr.compiled.history import N_KEPT, keep_past, take_past

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


def test_a_run_begins_without_hysteresis_and_friction() -> None:
    row = cable(**CREEPS, HYSTERESIS=2.0, FRICTION=0.3)
    take(row, np.ones(N_KEPT), 5.0, True)
    assert row[HYSTERESIS] == row[FRICTION] == 0.0


def test_paying_out_relaxes_the_cable_behind_its_exit_point() -> None:
    """2 mm on 1.6 m of 1000 N: 1.25 N less than before."""
    row, kept, state = (
        cable(**CREEPS, FRICTION=0.3, WINCH_SIDE=1.6),
        np.zeros(N_KEPT),
        np.zeros(N_STATE),
    )
    state[TENSION], state[WINCH_TENSION], state[STRAIN] = 3.0, 3.5, 0.003
    keep(row, state, False, kept)
    longer = cable(**CREEPS, FRICTION=0.3, WINCH_SIDE=1.6, REST=2.002)
    take(longer, kept, 1.0, False)
    assert longer[STUCK] == pytest.approx(3.5 - 1.25)
