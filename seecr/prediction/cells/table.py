"""One effect in a model's file."""

from __future__ import annotations

import copy
import difflib
from collections.abc import Mapping, MutableMapping
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit

from seecr.counted import plural, some
from seecr.effects import Knowledge, Own, Term, Values, layout_of
from seecr.effects.base import Layout
from seecr.effects.terms import KINDS
from seecr.errors import InputError
from seecr.pose import Array
from seecr.prediction.cells.cell import Where, cell_of

if TYPE_CHECKING:
    from seecr.description.robot import Robot

_MOST_NAMED = 8
_OF_EFFECT = (
    "name", "fixed", "per_file", "per_run", "parameters", "of", "provenance", "refitted", "before",
    "after", "held_out",
)  # fmt: skip


def term_of(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> tuple[Term, Array]:
    """Effect k of the file with its values, and their standard errors (p,).

    Raises:
        InputFileError: an effect or parameter is unknown, missing, not a number or out of bounds.
    """
    layout = _layout(where, k, table, robot)
    kind = _kind(where, k, table, layout)
    given = table.get("parameters", {} if kind else None)
    if not isinstance(given, Mapping):
        raise where.error(
            f"effect {layout.name}: expected a table [effect.parameters] with "
            f"{some(layout.names, _MOST_NAMED)}", k,
        )  # fmt: skip
    fixed = _flag(where, k, table, layout, "fixed")
    if kind and not given:
        given = dict(zip(layout.names, layout.null.tolist(), strict=True))
    rest = _values(where, k, layout, given, fixed)
    own = _own(where, k, layout, table, kind, fixed)
    return Term(layout, rest.vector, rest.knowledge, own), rest.stderr


def _flag(where: Where, k: int, table: Mapping[str, Any], layout: Layout, key: str) -> bool:
    value = table.get(key, False)
    if not isinstance(value, bool):
        text = f"effect {layout.name}: {key} must be true or false, got {value!r}"
        raise where.error(text, k, key)
    return value


def _kind(where: Where, k: int, table: Mapping[str, Any], layout: Layout) -> str:
    """Whether the effect has values of its own for each "file" or "run", else ""."""
    said = [kind for kind in KINDS if _flag(where, k, table, layout, f"per_{kind}")]
    if len(said) > 1:
        text = "is both per_file and per_run; leave per_file out: each run has its own then"
        raise where.error(f"effect {layout.name}: {text}", k, "per_file")
    if "of" in table and not said:
        text = "has values of files or runs, but neither per_file = true nor per_run = true; add it"
        raise where.error(f"effect {layout.name}: {text}", k, "of")
    return said[0] if said else ""


def _own(
    where: Where, k: int, layout: Layout, table: Mapping[str, Any], kind: str, fixed: bool
) -> Own | None:
    """The values for each file or run that the model knows."""
    if not kind:
        return None
    tables = table.get("of", {})
    fine = isinstance(tables, Mapping) and all(isinstance(t, Mapping) for t in tables.values())
    if not fine:
        text = f'of: expected a table for each {kind}, such as [effect.of."monday/measured.csv"]'
        raise where.error(f"effect {layout.name}: {text}", k, "of")
    return Own(kind, {str(n): _values(where, k, layout, t, fixed) for n, t in tables.items()})


def _values(where: Where, k: int, layout: Layout, given: Mapping[str, Any], fixed: bool) -> Values:
    """The values, standard errors and knowledge in a table of all parameters."""
    given = _spread(layout, given)
    _check_names(where, k, layout, given)
    names = enumerate(layout.names)
    cells = [cell_of(where, k, layout, i, given[key], fixed) for i, key in names]
    knowledge = Knowledge(
        np.array([cell.fixed for cell in cells]),
        np.array([cell.known for cell in cells]),
        np.array([cell.known_stderr for cell in cells]),
    )
    value, stderr = (np.array([getattr(c, name) for c in cells]) for name in ("value", "stderr"))
    return Values(value, stderr, knowledge)


def _layout(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> Layout:
    """The layout of a table's effect; other keys are the user's own, unless misspelt."""
    name = table.get("name")
    if not isinstance(name, str):
        raise where.error(f'expected name = "..." of an effect, got {name!r}', k, "name")
    for key in table:
        near = difflib.get_close_matches(key.lower(), _OF_EFFECT, cutoff=0.7)
        if key not in _OF_EFFECT and near:
            raise where.error(f"effect {name}: unknown {key}; expected {near[0]}", k, key)
    try:
        return layout_of(str(name), robot)
    except InputError as error:
        raise where.error(str(error), k, "name") from None


def _spread(layout: Layout, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Copy what is stated for a whole group of components to each of them.

    If the mapping is the file's own tree it is edited in place, so that each component has a place
    to be written to.
    """
    for whole, parts in layout.groups.items():
        if whole in given and isinstance(given, MutableMapping):
            said = given.pop(whole)
            for key in parts:
                given[key] = _both(given.get(key), said)
    return given


def _both(own: Any, said: Any) -> Any:
    """What is stated for a component and for its whole group together; the component's own wins."""
    if own is None:
        return copy.deepcopy(said)
    cells = [cell if isinstance(cell, Mapping) else {"value": cell} for cell in (said, own)]
    whole = tomlkit.inline_table()
    whole.update({**cells[0], **cells[1]})
    return whole


def _check_names(where: Where, k: int, layout: Layout, given: Mapping[str, Any]) -> None:
    for key in given:
        if key not in layout.names:
            near = difflib.get_close_matches(key, layout.names, n=len(layout), cutoff=0.0)
            raise where.error(
                f"effect {layout.name}: unknown parameter {key}; known, nearest first: "
                f"{some(near, _MOST_NAMED)}", k, key,
            )  # fmt: skip
    missing = [key for key in layout.names if key not in given]
    if missing:
        raise where.error(
            f"effect {layout.name}: {plural(len(missing), 'parameter')} "
            f"{some(missing, _MOST_NAMED)} {'is' if len(missing) == 1 else 'are'} missing; "
            f"expected a line such as {missing[0]} = {{ value = {layout.null[0]:g} }}",
            k, "parameters",
        )  # fmt: skip
