"""The catalogue of ropes: its numbers by hand, and what is no rope."""

from __future__ import annotations

import re

import numpy as np
import pytest
from sources import ROOT

from seecr.description.cables import MATERIALS, breaking_words, ea_of, rope_of
from seecr.errors import InputError


def test_a_wire_rope_has_the_area_and_the_mass_of_the_standard() -> None:
    """EN 12385-4, for 6x19M around a strand: C = 0.418, W = 0.381 kg per 100 m and mm^2."""
    rope = rope_of("steel 7x19 3mm")
    np.testing.assert_allclose(rope.ea, 100e9 * 0.418 * 0.003**2)
    np.testing.assert_allclose(rope.weight, 0.381 * 9 / 100 * 9.80665)
    assert rope.name == "steel 7x19 3mm"
    np.testing.assert_allclose(rope_of("steel 6x19 6 mm").ea, 100e9 * 0.384 * 0.006**2)


def test_ropes_break_at_the_loads_of_tables() -> None:
    """DIN 3060 has 5.28 kN for 3 mm with a steel core; 6 mm of SK78 break at 40 to 48 kN."""
    assert abs(rope_of("steel 7x19 3mm").breaks - 5280.0) < 30.0
    assert 38e3 < rope_of("dyneema 6mm").breaks < 48e3
    steel, elongation = rope_of("steel 7x19 3mm"), 5280.0 / (100e9 * 0.418 * 0.003**2)
    assert breaking_words(0.99 * elongation) == ""
    assert breaking_words(1.01 * steel.breaks / steel.ea).endswith("steel 7x19 (1.4 %)")


def test_a_braid_is_near_what_rope_makers_say() -> None:
    """6 mm of SK78 stretches by about 1 % under 13 kN and weighs about 21 g/m."""
    rope = rope_of("dyneema 6mm")
    assert 0.008 < 13e3 / rope.ea < 0.012
    assert 0.017 < rope.weight / 9.81 < 0.023


@pytest.mark.parametrize("material", MATERIALS)
def test_stiffness_and_weight_grow_with_the_square_of_the_diameter(material: str) -> None:
    thin, thick = rope_of(f"{material} 2mm"), rope_of(f"  {material.upper()}   0.4 cm ")
    np.testing.assert_allclose([thick.ea, thick.weight], [4 * thin.ea, 4 * thin.weight])
    # no rope is stiffer than a solid bar of steel, or heavier
    area = np.pi * 0.001**2
    assert thin.ea < 210e9 * area and thin.weight < 7850 * 9.81 * area


def test_the_page_has_these_numbers() -> None:
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z\dx ]+)` \| ([\d.]+) \| ([\d.]+) \|", page, re.MULTILINE)
    assert [name for name, _ea, _weight in rows] == list(MATERIALS)
    for name, ea, weight in rows:
        rope = rope_of(f"{name} 1mm")
        assert float(ea) == pytest.approx(1e-3 * rope.ea, rel=2e-3)
        assert float(weight) == pytest.approx(1e3 * rope.weight / 9.80665, rel=2e-3)


def test_steel_alone_is_7x19_and_a_number_is_itself() -> None:
    assert rope_of("steel 3 mm") == rope_of("steel 7x19 3mm")
    assert ea_of("3e5N", "--ea") == (3e5, "")
    assert ea_of("300kN", "--ea")[0] == ea_of("300000", "--ea")[0] == 3e5
    ea, said = ea_of("vectran 1mm", "--ea")
    assert ea == rope_of("vectran 1mm").ea and "cable_weight" in said and "75 GPa" in said


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dynema 3mm", "known are dyneema, "),
        ("3e5 N/m", "expected E S such as 3e5N, or a rope by material and diameter such as"),
        ("steel", "expected E S such as 3e5N, or a rope"),
        (
            "steel 7x19",
            "a diameter from 0.1mm to 100mm after steel, such as 'steel 7x19 3mm', got '7x19'",
        ),
        ("steel 3", "after steel, such as 'steel 7x19 3mm', got '3' in 'steel 3'"),
        ("kevlar 3m", "got '3m'"),
        ("kevlar -3mm", "got '-3mm'"),
        ("0N", "expected E S from 0.001 to 1e+12 N"),
        ("-4kN", "expected E S from 0.001"),
    ],
)
def test_what_is_no_rope_is_told(text: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        ea_of(text, "--ea")
    assert str(caught.value).startswith("--ea: ") and told in str(caught.value)
