"""Known loads from columns: which number acts where, and what no robot carries."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from made_columns import columns_of
from rectangle import RECTANGLE

from seecr.columns.commands import known_loads
from seecr.errors import InputFileError

# A twentieth of E S of all four cables, and ten times the platform's weight.
MOST = 0.05 * 4 * 1000.0


def test_each_column_acts_along_its_own_axis() -> None:
    columns = columns_of(
        "moment_z_Nm,force_y_N,payload_kg,moment_x_Nm,force_x_kN", "6,2,0.5,4,0.001", n_cables=4
    )
    loads = known_loads(columns, RECTANGLE)
    assert loads is not None and loads.mass.tolist() == [0.5]
    assert loads.wrench.tolist() == [[1.0, 2.0, 0.0, 4.0, 0.0, 6.0]]


def test_forces_that_are_all_zero_are_no_loads_but_a_payload_of_nothing_is_one() -> None:
    assert known_loads(columns_of("force_x_N,moment_y_Nm", "0,0", "0,0"), RECTANGLE) is None
    assert known_loads(columns_of("payload_kg", "0"), RECTANGLE) is not None


# 10 m/s^2 of gravity, and 5 m from corner to corner
@pytest.mark.parametrize(
    ("name", "most"),
    [("payload_kg", MOST / 10.0), ("force_z_N", MOST), ("moment_y_Nm", MOST * 5.0)],
)
def test_the_most_is_what_would_strain_all_cables_by_a_twentieth(name: str, most: float) -> None:
    assert known_loads(columns_of(name, f"{most}"), RECTANGLE) is not None
    said = re.escape(f"at most {most:.3g} ")
    with pytest.raises(InputFileError, match=f"line 3, column {name}: .*{said}"):
        known_loads(columns_of(name, "0", f"{1.001 * most}"), RECTANGLE)


def test_soft_cables_carry_what_they_carry_already() -> None:
    """Of a heavy platform, or their own tension, ten times; a twentieth of E S would be less."""
    heavy = replace(RECTANGLE, mass=50.0)
    assert known_loads(columns_of("payload_kg", "500"), heavy) is not None
    with pytest.raises(InputFileError, match="at most 500 kg"):
        known_loads(columns_of("payload_kg", "501"), heavy)
    tight = replace(RECTANGLE, rest_lengths=np.full(4, 2.0))
    assert known_loads(columns_of("force_x_N", "-10000"), tight) is not None
    with pytest.raises(InputFileError, match="at most 1e"):
        known_loads(columns_of("force_x_N", "-10001"), tight)


@pytest.mark.parametrize(
    ("name", "cell", "guess"),
    [
        ("payload_kg", "300", r"got 300 kg; is it in g\? Name the column payload_g$"),
        ("payload_g", "300000", r"got 300 kg; check it$"),
        ("force_z_kN", "-0.3", r"got -300 N; is it in N\? Name the column force_z_N$"),
    ],
)
def test_the_unit_that_a_load_may_be_in_is_named(name: str, cell: str, guess: str) -> None:
    """300 g were taken for 300 kg, and cables stretched by a quarter without a word."""
    with pytest.raises(InputFileError, match=f"line 3, column {name}: .*{guess}"):
        known_loads(columns_of(name, "0", cell), RECTANGLE)


def test_a_payload_of_many_times_the_platform_is_noted() -> None:
    stiff = replace(RECTANGLE, ea=np.full(4, 1e6))
    for name, cell, notes in [
        ("payload_kg", "10.1", ["Column payload_kg is up to 10.1 kg, 5.05 times the mass of the "
                                "platform: if it is in g, name it payload_g."]),
        ("payload_kg", "9.9", []), ("payload_g", "10100", []),
    ]:  # fmt: skip
        columns = columns_of(name, "0", cell)
        assert known_loads(columns, stiff) is not None
        assert [note for note in columns.notes if "mass" in note] == notes


def test_without_gravity_a_payload_weighs_nothing() -> None:
    floating = replace(RECTANGLE, gravity=np.zeros(3))
    assert known_loads(columns_of("payload_kg", "1e6"), floating) is not None


def test_a_payload_may_take_mass_away_but_not_all_of_it() -> None:
    loads = known_loads(columns_of("payload_kg", "-1.999"), RECTANGLE)
    assert loads is not None and loads.mass.tolist() == [-1.999]
    with pytest.raises(InputFileError, match=r"some of its 2 kg, got -2 kg"):
        known_loads(columns_of("payload_kg", "-2"), RECTANGLE)


def test_a_centre_is_as_far_from_the_nearest_anchor_point_as_the_frame_is_large() -> None:
    names = "payload_kg,payload_x_m,payload_y_m,payload_z_m"
    assert known_loads(columns_of(names, "1,5.29,0.4,0"), RECTANGLE) is not None
    with pytest.raises(InputFileError, match=r"column payload_x_m: .* 5\.01 m from its anchor"):
        known_loads(columns_of(names, "1,5.31,0.4,0"), RECTANGLE)
