"""Comments that people wrote into tables which a fit writes anew."""

from __future__ import annotations

from typing import Any

import tomlkit
from tomlkit.items import Comment, Table

__all__ = ["with_remarks"]


def with_remarks(fresh: Any, old: Any) -> Any:
    """A fresh table with the comments that the old one had: at its beginning, and behind keys.

    Args:
        fresh: the table that replaces another.
        old: the other; None if there was none.
    """
    if not isinstance(old, Table):
        return fresh
    table = tomlkit.table()
    table.trivia.indent = fresh.trivia.indent
    for line in (_lines_of(fresh) | _lines_of(old)).values():
        table.add(line)
    for key, value in fresh.items():
        if key not in old or isinstance(value, Table):
            table[key] = with_remarks(value, old.get(key))
            continue
        table[key] = value
        if old[key].trivia.comment:
            table[key].comment(old[key].trivia.comment)
    return table


def _lines_of(table: Table) -> dict[str, Comment]:
    """The comments on lines of their own, by their text."""
    return {
        item.as_string().strip(): item
        for key, item in table.value.body
        if key is None and isinstance(item, Comment)
    }
