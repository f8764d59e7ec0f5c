"""Units as files spell them and results show them, and numbers in sentences."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from seecr.counted import between, counted, figures, plural, some
from seecr.units import (
    UNITS,
    chance,
    in_unit,
    measured,
    millimetres,
    of_columns,
    parameter_name,
    short,
    with_error,
)


def test_columns_of_millimetres_are_rounded_once() -> None:
    # 103 * 1e-3 is another double than 0.103
    assert of_columns("m")["mm"].to_si(np.array([103.0]))[0] == 0.103 != 103.0 * 1e-3
    assert set(of_columns("m")) == {"m", "cm", "mm", "um"}
    assert set(of_columns("rad")) == {"rad", "deg"} and set(of_columns("N")) == {"N", "kN"}
    assert set(of_columns("kg")) == {"kg", "g"} and set(of_columns("s")) == {"s", "ms"}
    assert of_columns("rad")["deg"].to_si(180.0) == np.deg2rad(180.0)


@pytest.mark.parametrize(
    ("si", "factor", "name"),
    [
        ("m", 1e3, "mm"),
        ("rad", 180.0 / math.pi, "deg"),
        ("C", 1.0, "°C"),
        ("Nm", 1.0, "N m"),
        ("m_per_N", 1e3, "mm/N"),
        ("1_per_K", 1e6, "µm/(m K)"),
        ("N_per_m", 1.0, "N/m"),
        ("", 1.0, ""),
    ],
)
def test_results_are_shown_in(si: str, factor: float, name: str) -> None:
    assert in_unit(si) == (factor, name)


def test_each_spelling_and_each_shown_unit_is_there_once() -> None:
    spelt = [name for unit in UNITS for name in (unit.suffix, *unit.also)]
    assert len(spelt) == len(set(spelt))
    shown = [unit.si for unit in UNITS if unit.shown]
    assert len(shown) == len(set(shown))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.0296, "0.0296"), (-4.274, "-4.27"), (123456.0, "123456"),
     (1.234e-7, "1.23e-7"), (3e-11, "0"), (-3e-11, "0"),
     (9.9e9, "9.90e9"), (np.nan, "–"), (None, "–")],
)  # fmt: skip
def test_short_numbers(value: float | None, text: str) -> None:
    assert short(value) == text


@pytest.mark.parametrize(
    ("length", "digits", "text"),
    [(0.0, 4, "0 mm"), (0.035039, 4, "35.04 mm"), (9.9994, 4, "9999 mm"), (9.9996, 4, "10000 mm"),
     (124.9981, 4, "124998 mm"), (7.76012, 3, "7760 mm"), (-0.0123456, 3, "-12.3 mm"),
     (3e-14, 4, "0 mm"), (-3e-14, 4, "0 mm"), (2e-12, 4, "2e-09 mm")],
)  # fmt: skip
def test_lengths_of_many_metres_have_no_exponent(length: float, digits: int, text: str) -> None:
    assert millimetres(length, digits) == text
    assert millimetres(np.float64(length), digits) == text


@pytest.mark.parametrize(
    ("value", "error", "texts"),
    [(10.00238, 0.005576, ("10.0024", "0.0056")), (1.3988, np.inf, ("1.40", "undetermined")),
     (-1437.0, 210.0, ("-1440", "210")), (1.5, 0.0, ("1.50000", "0")),
     (4.53e6, 0.0, ("4530000", "0")), (4.5312e6, 23456.0, ("4531000", "23000")),
     (1928.0, 24149.0, ("2000", "24000")), (148033.0, 207421.0, ("150000", "210000")),
     (-400.0, 24149.0, ("0", "24000")),
     (-1234567.89, 0.31, ("-1234567.89", "0.31")), (4.5e9, 2e5, ("4.50000e9", "200000")),
     (-0.004, 0.31, ("0.00", "0.31"))],
)  # fmt: skip
def test_values_show_two_digits_of_their_error(
    value: float, error: float, texts: tuple[str, str]
) -> None:
    assert with_error(value, error) == texts


def test_what_rounding_leaves_of_a_value_without_an_error_is_nothing() -> None:
    assert with_error(5.31e-14, np.inf) == ("0", "undetermined")
    assert with_error(-1.5e-13, 0.0) == ("0", "0")
    assert with_error(2e-9, np.inf)[0] == "2.00e-9" and with_error(0.0, np.inf)[0] == "0"


def test_names_and_chances() -> None:
    assert parameter_name("radius_m", "m") == "radius" and parameter_name("gain", "") == "gain"
    assert chance(1e-20) == "< 1e-12" and chance(0.25) == "0.25"
    assert chance(3e-11) == "3.0e-11"


def test_a_value_has_the_digits_of_its_error() -> None:
    assert measured(0.0083702, 1.3e-5, "m") == "8.370 ± 0.013 mm"
    assert measured(0.0083702, np.inf, "m") == "not determined by these data"
    assert measured(0.0083702, 0.0, "m") == "8.37 mm (fixed)"
    assert measured(np.deg2rad(1.5), np.deg2rad(0.12), "rad") == "1.50 ± 0.12 deg"


# --- Numbers in sentences, and that no sentence counts without the helper


ROOT = Path(__file__).resolve().parents[2]
NOUNS = "row|pose|run|cable|line|effect|parameter|file|column|cell|command|case|step|reading"
# A number and a plural that it does not choose, in a text that is put together: {n} rows.
COUNTED = re.compile(rf"\{{[^{{}}]*\}} (?:(?!on )\w+ )?(?:{NOUNS})s\b")
# What is no number, and numbers that are never one.
ALLOWED = {
    "{name} rows", "{what} columns", "{kind.name} readings", "{effect.name} leaves readings",
    "{most:.0e} poses", "{_STRETCH} rows", "{_ROWS} rows", "{tried} effects", "{m} cables",
    "{_MOST_CHANGES} poses",
}  # fmt: skip


def test_one_is_no_plural() -> None:
    assert counted(1, "row") == "1 row" and counted(0, "row") == "0 rows"
    assert counted(2, "more pose", "4d") == "   2 more poses"
    assert plural(1, "line") == "line" and plural(3, "line") == "lines"


def test_one_number_is_no_range() -> None:
    assert between(0, 0, "d") == "0" and between(0, 3, "d") == "0 to 3"
    assert between(1.00001, 1.00002, lead="from ") == "1"
    assert between(1.0, 2.5, lead="from ") == "from 1 to 2.5"


def test_nothing_has_no_sign() -> None:
    assert between(-0.0, 3.0) == "0 to 3" and between(-1e-17, 3.0) == "0 to 3"
    assert between(-2.0, 1e-16, ".2f", "from ") == "from -2.00 to 0.00"
    assert between(-1e-17, -2e-18) == "-1e-17 to -2e-18"
    assert figures(-0.0004, ".3f") == "0.000" and figures(-0.0006, ".3f") == "-0.001"
    assert figures(-0.00001, "+.4f") == "+0.0000" and figures(float("nan"), ".1f") == "nan"


def test_of_a_long_list_the_first_few_and_how_many_more() -> None:
    assert some("abc", 3) == "a, b, c" and some([]) == ""
    assert some("abcde", 3) == "a, b, c and 2 more"
    assert some("abcde", 3, "; ") == "a; b; c; and 2 more"


@pytest.mark.parametrize("package", ["seecr", "crosscheck"])
def test_no_sentence_counts_by_itself(package: str) -> None:
    """``only 1 poses``: whatever is counted in a text goes through the helper."""
    found = {
        match
        for path in (ROOT / package).rglob("*.py")
        for match in COUNTED.findall(path.read_text(encoding="utf-8"))
    }
    assert found - ALLOWED == set()
