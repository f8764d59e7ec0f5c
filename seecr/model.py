"""A model: a robot plus the effects added to it, in a TOML file that people keep in git.

    format = 1
    [robot]                      # whose model it is, to notice when it is used for another
    [[effect]]                   # in the order of adding
    name = "pulley_radius"
    fixed = true                 # optional: none of its values is ever fitted
    [effect.parameters]
    radius_m = { value = 0.0099, stderr = 0.0001, unit = "m", at_bound = false }
    [effect.provenance]          # data file, date, version, who or what put it there
    [effect.before]              # rms errors without it, with it, and on runs left out
    [effect.after]
    [effect.held_out]

``stderr = "unseen"`` stands for a parameter that the data do not see. A person may write a model
by hand: name, parameters and values are all that is needed. What a person knows beside the data
stands with the parameter (:mod:`seecr.cells`): ``fixed = true`` holds its value in every fit,
``known = { value = 0.03, stderr = 0.0005 }`` is a reading in every fit. A key without the
component's number or axis (``shift_m``, ``gain``) says the same of all components.
"""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit
from tomlkit import TOMLDocument
from tomlkit.exceptions import TOMLKitError

from seecr.cells import Where, cell_of
from seecr.effects import Knowledge, Term, Terms, catalogue, effect_named, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError, InputFileError
from seecr.files import read_text
from seecr.fingerprint import check_robot, fingerprint
from seecr.pose import Array
from seecr.result import Record, Result

if TYPE_CHECKING:
    from seecr.robot import Robot

FORMAT = 1
"""Of the file; raised when a key changes its meaning or goes."""

_EXPECTED = "expected a model as crosscheck add writes it"
_TABLES = ("format", "robot", "effect", "calibration")
_OF_EFFECT = (
    "name", "fixed", "parameters", "provenance", "refitted", "before", "after", "held_out",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Model(Result):
    """A robot's effects, as read from a file.

    It prints as one line per effect, and ``to_frame`` gives one row per parameter.

    Attributes:
        terms: the effects with their values.
        stderr: standard errors (p,) of each effect's parameters by its name; inf where unseen,
            NaN where the file gives none.
        document: the file's text as a tree, comments included.
        notes: sentences about what has changed since the model was made.
        path: the file.
    """

    terms: Terms
    stderr: Mapping[str, Array]
    document: TOMLDocument
    notes: tuple[str, ...] = ()
    path: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in the order of adding."""
        return tuple(self.stderr)

    def lines(self) -> list[str]:
        """Whose model it is, and the effects with their first few values."""
        table = self.document.get("robot")
        robot = table.get("name", "a robot") if isinstance(table, Mapping) else "a robot"
        count = f"{len(self.names)} effect{'' if len(self.names) == 1 else 's'}"
        return [
            f"model of {robot}: plain SEECR and {count}" if self.names else
            f"model of {robot}: plain SEECR, no effects",
            *(f"{name}: {_values(self.terms[name], self.stderr[name])}" for name in self.names),
            *self.notes,
        ]  # fmt: skip

    def records(self) -> list[Record]:
        """One row per parameter: its value and standard error, None where there is none."""
        return [
            {
                "effect": name,
                "parameter": key,
                "value": float(term.vector[i]),
                "stderr": float(error) if math.isfinite(error) else None,
                "unit": term.layout.units[i],
            }
            for name in self.names
            for term in [self.terms[name]]
            for i, (key, error) in enumerate(
                zip(term.layout.names, self.stderr[name], strict=True)
            )
        ]  # fmt: skip


def _values(term: Term, stderr: Array, most: int = 3) -> str:
    """Values of an effect for people, the first few."""
    parts = [
        f"{key} = {value:.6g}"
        + (" (fixed)" if fixed else f" +- {error:.2g}" if math.isfinite(error) else "")
        for key, value, error, fixed in zip(
            term.layout.names, term.vector, stderr, term.knowledge.fixed, strict=True
        )
    ]
    more = [f"{len(parts) - most} more"] if len(parts) > most else []
    return ", ".join([*parts[:most], *more])


def new_model(robot: Robot) -> Model:
    """A model without effects: the seed's plain SEECR."""
    document = tomlkit.document()
    document.add(tomlkit.comment("Effects that this robot has beyond plain SEECR, in the order"))
    document.add(tomlkit.comment("of adding. SI units. Written by crosscheck add; edit freely."))
    document["format"] = FORMAT
    document["robot"] = fingerprint(robot)
    return Model(Terms(), {}, document)


def load_model(path: str | Path, robot: Robot) -> Model:
    """Read a model for a robot.

    Args:
        path: the TOML file.
        robot: that it must have been made for.

    Raises:
        InputFileError: no such file, no TOML, made for another robot, an effect or parameter
            that is unknown, missing, given twice, no number or out of bounds.
    """
    path = Path(path)
    text = read_text(path, _EXPECTED)
    document = _parse(path, text)
    where = Where(path, text)
    _check_tables(where, document)
    notes = check_robot(path, document.get("robot"), robot)
    terms: list[Term] = []
    errors: dict[str, Array] = {}
    notes = (*notes, *_migrate(where, document))
    for k, table in enumerate(_effect_tables(where, document)):
        term, stderr = _term(where, k, table, robot)
        if term.name in errors:
            raise where.error(f"effect {term.name} is listed twice; expected it once", k, "name")
        terms.append(term)
        errors[term.name] = stderr
    return Model(Terms(terms), errors, document, notes, path)


def _parse(path: Path, text: str) -> TOMLDocument:
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        line = getattr(error, "line", None)
        text = f"is not TOML: {error}; {_EXPECTED}"
        raise InputFileError.at(path, text, line=line) from None


def _check_tables(where: Where, document: Mapping[str, Any]) -> None:
    """Tables of other names are the user's own; a misspelt one must not be passed over."""
    for name in document:
        near = difflib.get_close_matches(name.lower(), _TABLES, cutoff=0.7)
        if name not in _TABLES and near:
            raise where.error(f"unknown {name}; expected {near[0]}", key=name)
    if document and not any(name in document for name in _TABLES):
        has = ", ".join(document)
        raise where.error(f"is no model, it has {has}; {_EXPECTED}, with tables [[effect]]")
    version = document.get("format", FORMAT)
    if version != FORMAT:
        raise where.error(
            f"format {version!r} is not known to this version, which reads {FORMAT}; upgrade it",
            key="format",
        )


def _effect_tables(where: Where, document: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    tables = document.get("effect", [])
    if not isinstance(tables, list) or not all(isinstance(t, Mapping) for t in tables):
        raise where.error("effect: expected tables [[effect]], one per effect", key="effect")
    return tables


def _migrate(where: Where, document: Mapping[str, Any]) -> list[str]:
    """Put parameters that had another name when the model was written under those of today."""
    notes = []
    for table in _effect_tables(where, document):
        given, name = table.get("parameters"), table.get("name")
        if not isinstance(given, MutableMapping) or name not in catalogue():
            continue
        for old, now in catalogue()[str(name)].renamed.items():
            if old in given:
                cell = given.pop(old)
                for key in now:
                    given.setdefault(key, copy.deepcopy(cell))
                notes.append(f"effect {name}: {old} is read as {' and '.join(now)}, as it is now")
    return notes


def _term(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> tuple[Term, Array]:
    layout = _layout(where, k, table, robot)
    given = table.get("parameters")
    if not isinstance(given, Mapping):
        raise where.error(
            f"effect {layout.name}: expected a table [effect.parameters] with "
            f"{_some(layout.names)}", k,
        )  # fmt: skip
    fixed = table.get("fixed", False)
    if not isinstance(fixed, bool):
        text = f"effect {layout.name}: fixed must be true or false, got {fixed!r}"
        raise where.error(text, k, "fixed")
    given = _spread(layout, given)
    _check_names(where, k, layout, given)
    names = enumerate(layout.names)
    cells = [cell_of(where, k, layout, i, given[key], fixed) for i, key in names]
    knowledge = Knowledge(
        np.array([cell.fixed for cell in cells]),
        np.array([cell.known for cell in cells]),
        np.array([cell.known_stderr for cell in cells]),
    )
    term = Term(layout, np.array([cell.value for cell in cells]), knowledge)
    return term, np.array([cell.stderr for cell in cells])


def _layout(where: Where, k: int, table: Mapping[str, Any], robot: Robot) -> Layout:
    """The effect that a table is of; other keys are the user's own, if they are not misspelt."""
    name = table.get("name")
    if not isinstance(name, str):
        raise where.error(f'expected name = "..." of an effect, got {name!r}', k, "name")
    for key in table:
        near = difflib.get_close_matches(key.lower(), _OF_EFFECT, cutoff=0.7)
        if key not in _OF_EFFECT and near:
            raise where.error(f"effect {name}: unknown {key}; expected {near[0]}", k, key)
    try:
        return layout_of(effect_named(str(name)), robot)
    except InputError as error:
        raise where.error(str(error), k, "name") from None


def _spread(layout: Layout, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """What is said of a parameter as a whole, said of each of its components.

    In the file's tree itself where it is one, so that what is written has a place for each.
    """
    for whole, parts in layout.groups.items():
        if whole in given and isinstance(given, MutableMapping):
            said = given.pop(whole)
            for key in parts:
                given[key] = _both(given.get(key), said)
    return given


def _both(own: Any, said: Any) -> Any:
    """What a component says and what is said of all of its kind; its own word counts."""
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
                f"{_some(near)}", k, key,
            )  # fmt: skip
    missing = [key for key in layout.names if key not in given]
    if missing:
        raise where.error(
            f"effect {layout.name}: parameter {_some(missing)} is missing; expected a line such "
            f"as {missing[0]} = {{ value = {layout.null[0]:g} }}", k, "parameters",
        )  # fmt: skip


def _some(names: Sequence[str], most: int = 8) -> str:
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest
