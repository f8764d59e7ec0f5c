"""The parts of a column's name."""

from __future__ import annotations

import pytest

from seecr.columns.csv import QUANTITY, is_number


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("t_s", "t", "s"),
        ("temperature_C", "temperature", "C"),
        ("cmd_rx_deg", "cmd_rx", "deg"),
        ("want_qw", "want_qw", None),
        ("length_12_mm", "length_12", "mm"),
        ("payload_kg", "payload", "kg"),
        ("payload_x_mm", "payload_x", "mm"),  # and no payload in a unit "x_mm"
        ("moment_z_Nm", "moment_z", "Nm"),
        ("meas_x_", "meas_x", ""),
    ],
)
def test_a_unit_comes_after_the_last_underscore(name: str, quantity: str, unit: str | None) -> None:
    found = QUANTITY.fullmatch(name)
    assert found is not None and found.groups() == (quantity, unit)
    assert is_number(f" {name} ")


@pytest.mark.parametrize(
    "name", ["", "run", "runs", "cmd_w_m", "cmd_qx_y_m", "length_m", "tension_A_N", "force_N", "ts"]
)
def test_columns_of_other_names_hold_no_numbers_that_are_read(name: str) -> None:
    assert not is_number(name)
