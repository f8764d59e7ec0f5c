"""Comments of people in tables that a fit writes anew."""

from __future__ import annotations

import tomlkit

from crosscheck.model.write import with_remarks

OLD = """[fit]
# on a Monday
rms = 1.0 # without the outlier
gone = 2.0 # of something else

[fit.before]
# by hand
rms = 3.0 # twice
"""
FRESH = """[fit]
# Written by crosscheck.
rms = 1.5
new = 4.0

[fit.before]
rms = 3.5
"""


def merged(fresh: str, old: str) -> str:
    document = tomlkit.parse(fresh)
    document["fit"] = with_remarks(document["fit"], tomlkit.parse(old).get("fit"))
    return tomlkit.dumps(document)


def test_remarks_stay_with_their_keys_and_tables_and_values_are_the_new_ones() -> None:
    text = merged(FRESH, OLD)
    assert tomlkit.parse(text).unwrap() == tomlkit.parse(FRESH).unwrap()
    whole, _, before = text.partition("[fit.before]")
    assert "# on a Monday\n" in whole and "rms = 1.5 # without the outlier\n" in whole
    assert "# by hand\n" in before and "rms = 3.5 # twice\n" in before
    assert whole.count("# Written by crosscheck.\n") == 1 and "of something else" not in text


def test_to_write_again_changes_nothing_more() -> None:
    once = merged(FRESH, OLD)
    assert merged(FRESH, once) == once


def test_without_an_older_table_the_fresh_one_stays_as_it_is() -> None:
    assert merged(FRESH, "") == FRESH
    assert merged(FRESH, "fit = 3 # a number") == FRESH
