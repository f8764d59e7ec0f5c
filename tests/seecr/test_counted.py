"""Numbers in sentences, and that no sentence counts without the helper."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from seecr.counted import between, counted, figures, plural, some

ROOT = Path(__file__).resolve().parents[2]
NOUNS = "row|pose|run|cable|line|effect|parameter|file|column|cell|command|case|step|reading"
# A number and a plural that it does not choose, in a text that is put together: {n} rows.
COUNTED = re.compile(rf"\{{[^{{}}]*\}} (?:(?!on )\w+ )?(?:{NOUNS})s\b")
# What is no number, and numbers that are never one.
ALLOWED = {
    "{name} rows", "{what} columns", "{kind.name} readings", "{effect.name} leaves readings",
    "{MOST_POSES:.0e} poses", "{_ROWS} rows", "{tried} effects", "{m} cables",
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
