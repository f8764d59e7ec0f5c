"""A guess of what a name means never chooses an axis or a cable."""

from __future__ import annotations

import pytest

from seecr.columns.known import (
    meant_by,
    no_cable_note,
    numbered,
    of_no_cable,
    other_rotations,
    unused_note,
)

POSITION = ("cmd_x_m", "cmd_y_m", "cmd_z_m")


@pytest.mark.parametrize(
    ("name", "absent", "meant"),
    [
        ("cmdy_m", POSITION, "cmd_y_m"),
        ("CMD_Z_M", POSITION, "cmd_z_m"),
        ("tension3_N", ("tension_1_N", "tension_3_N"), "tension_3_N"),
        ("temperatur_C", ("temperature_C",), "temperature_C"),
        ("timestamp", ("t_s",), "t_s"),
    ],
)
def test_another_spelling_is_the_name_that_is_missing(
    name: str, absent: tuple[str, ...], meant: str
) -> None:
    assert meant_by([name], absent) == {name: meant}


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("cmd_y_mm", ("cmd_x_m", "cmd_z_m")),  # y is there already
        ("cmd_m", POSITION),
        ("tension_4_N", ("tension_1_N", "tension_3_N")),
        ("tension_13_N", ("tension_1_N", "tension_3_N")),
        ("meas_q", ("meas_qw",)),
        ("timestamp", POSITION),
        ("operator", POSITION),
    ],
)
def test_of_which_axis_or_cable_is_not_guessed(name: str, absent: tuple[str, ...]) -> None:
    assert meant_by([name], absent) == {}


def test_words_for_rotations_are_neither_guessed_nor_found_within_others() -> None:
    turns = ["Roll", "yaw_deg", "euler_x", "meas_rotvec_1", "phi", "meas_theta_deg", "rot_x"]
    others = ["graphite", "delphi", "rotor_speed", "scroll_", "epsilon", "psig"]
    assert other_rotations([*turns, *others]) == [*turns, "scroll_"]
    assert meant_by(["meas_rot_rx_deg"], ["meas_rx_deg"]) == {}


def test_one_column_is_not_several() -> None:
    (one,) = unused_note([], ["yaw"])
    several, rest = unused_note(["a", "b"], ["roll", "yaw"])
    assert one.startswith("Column yaw is not used, because ")
    assert several.startswith("Columns roll yaw are not used, because ")
    assert rest == "Not used: a, b." and unused_note([], []) == []


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("length_left_mm", "length_1_mm"),
        ("tension_upper_left_N", "tension_2_N"),
        ("tension_upper_N", "tension_3_N"),
        ("tension_left", "tension_1"),
        ("tension_4_N", "tension_4_N"),  # the fourth, though the first has that name
        ("tension_Left_N", "tension_Left_N"),
        ("tension_left_stderr_N", "tension_left_stderr_N"),
        ("meas_left_m", "meas_left_m"),
    ],
)
def test_a_cable_is_its_number_or_its_name(name: str, same: str) -> None:
    assert numbered(name, ("left", "upper_left", "upper", "1")) == same


def test_what_is_of_no_cable_is_said_with_those_there_are() -> None:
    results = ["tension_1_stderr_N", "length_scale_of_all", "cmd_x_m", "tensions_N"]
    assert of_no_cable(["length_rear_mm", "tension_rear", *results]) == [
        "length_rear_mm", "tension_rear",
    ]  # fmt: skip
    assert no_cable_note(["length_rear_mm"], ("left", "right")) == [
        "Column length_rear_mm is not used: the robot's cables are 1 (left), 2 (right), by number "
        "or name."
    ]
    assert no_cable_note(["length_a_m", "length_b_m"], ("left",))[0].startswith(
        "Columns length_a_m, length_b_m are not used: "
    )
    assert no_cable_note([], ("left",)) == []


@pytest.mark.parametrize("cables", [("a_m", "a"), ("a", "a_m")])
def test_a_cable_named_like_another_with_a_unit_is_meant_by_its_whole_name(
    cables: tuple[str, str],
) -> None:
    """Which was meant depended on their order."""
    first, second = cables.index("a") + 1, cables.index("a_m") + 1
    assert numbered("length_a_m", cables) == f"length_{first}_m"
    assert numbered("length_a_m_m", cables) == f"length_{second}_m"
