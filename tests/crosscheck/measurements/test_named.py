"""Measurements as columns: those with content, under the names of files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crosscheck.measurements.data import Measurements, named_columns
from seecr.commands import Loads

PLAIN = Measurements(
    path=Path("a.csv"),
    n_cables=3,
    run=np.array(["a", "b"]),
    command_lengths=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    position=np.array([[0.1, np.nan, np.nan], [np.nan] * 3]),
    tensions=np.array([[np.nan, 7.0, np.nan], [np.nan, 8.0, np.nan]]),
)


def columns(**changes: object) -> dict[str, list]:
    return dict(named_columns(replace(PLAIN, **changes)))  # type: ignore[arg-type]


def test_only_what_somebody_read_has_a_column_and_gaps_are_none() -> None:
    assert columns() == {
        "run": ["a", "b"],
        **{f"length_{i}_m": [float(i), 3.0 + i] for i in (1, 2, 3)},
        "meas_x_m": [0.1, None],
        "tension_2_N": [7.0, 8.0],
    }


def test_a_centre_of_no_payload_and_forces_of_zero_are_nothing() -> None:
    centre, wrench = np.array([0.1, 0.2, 0.3]), np.zeros((2, 6))
    wrench[1, 4] = 2.0
    there = columns(loads=Loads.of(2, centre=centre, wrench=wrench))
    assert {key: there[key] for key in there if key not in columns()} == {"moment_y_Nm": [0.0, 2.0]}
    hung = columns(loads=Loads.of(2, mass=np.array([0.0, 1.0]), centre=centre))
    assert hung["payload_kg"] == [0.0, 1.0] and hung["payload_z_m"] == [0.3, 0.3]
    own = columns(loads=Loads.of(2, mass=np.array(1.0)))
    assert "payload_kg" in own and "payload_x_m" not in own
