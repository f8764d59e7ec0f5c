"""Write a model: fitted values into its tree, with comments kept, and the tree into its file."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit
from tomlkit.items import Comment, InlineTable, Table

from crosscheck.model.fitted import Fitted
from seecr.description.fingerprint import fingerprint
from seecr.description.robot import Robot
from seecr.effects import ApartLayout, Knowledge, Own, Term, Terms, Values
from seecr.effects.base import Layout
from seecr.errors import InputError, InputFileError
from seecr.files import check_writable, digits_of, written
from seecr.folders import folder_lock
from seecr.pose import Array
from seecr.prediction.effect_tables import UNSEEN
from seecr.prediction.experiment import predict
from seecr.prediction.model import (
    CALIBRATION,
    FIT,
    TABLE,
    DataReach,
    Model,
    its_model,
    read_document,
)
from seecr.prediction.uncertainty import CORRELATION, PARAMETERS, STDERR
from seecr.version import full_version

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

    from crosscheck.measurements.data import Measurements


# Fitted values of each file or run, as a model keeps them: by name, with what is usual.


@dataclass(frozen=True, eq=False)
class Kept:
    """An effect as a model keeps it.

    Attributes:
        usual: its values for other files or runs, together with those of the known ones.
        parts: newly fitted values by the model's names of files or runs.
    """

    usual: Fitted
    parts: Mapping[str, Fitted]


def kept(one: Fitted, before: Term | None) -> Kept:
    """What a model keeps of a fit, beside the same effect in the model before.

    For an unknown file or run the mean of the known ones is expected, with a standard error from
    their differences and uncertainties; if only one is known, with an expected size.
    """
    term, layout = one.term, one.term.layout
    if not isinstance(layout, ApartLayout):
        return Kept(one, {})
    values = dict(term.own.values) if term.own is not None else {}
    parts = {}
    for name in layout.parts:
        written = next((w for w in values if name == w or name.endswith(f"/{w}")), name)
        parts[written] = _part(one, layout, name)
        fitted = parts[written]
        values[written] = Values(fitted.term.vector, fitted.stderr, fitted.term.knowledge)
    vector, stderr = _usual(layout, values)
    knowledge = Knowledge.nothing(len(layout.base)) if before is None else before.knowledge
    vector = np.where(knowledge.fixed | knowledge.measured, layout.rest, vector)
    usual = Term(layout.base, vector, knowledge, Own(layout.kind, values))
    return Kept(Fitted(usual, stderr, np.zeros(len(vector), dtype=bool)), parts)


def _part(one: Fitted, layout: ApartLayout, name: str) -> Fitted:
    where, known = layout.part(name), one.term.knowledge
    knowledge = Knowledge(known.fixed[where], known.value[where], known.stderr[where])
    term = Term(layout.base, one.term.vector[where], knowledge)
    return Fitted(term, one.stderr[where], one.at_bound[where])


def _usual(layout: ApartLayout, values: Mapping[str, Values]) -> tuple[Array, Array]:
    """Mean of the values and how much a further one may differ, (p,) each."""
    every = np.array([one.vector for one in values.values()])
    if len(every) < 2:
        return every[0], layout.base.scale.copy()
    own = np.array([np.where(np.isfinite(one.stderr), one.stderr, 0.0) for one in values.values()])
    return every.mean(axis=0), np.hypot(every.std(axis=0, ddof=1), np.sqrt((own**2).mean(axis=0)))


def without_parts(fitted: Sequence[Fitted], covariance: Array) -> tuple[list[Fitted], Array]:
    """The effects that are the same everywhere, and their covariance."""
    same = np.array([not isinstance(one.term.layout, ApartLayout) for one in fitted], dtype=bool)
    own = np.repeat(same, [len(one.term.layout) for one in fitted])
    return (
        [one for one, yes in zip(fitted, same, strict=True) if yes],
        covariance[np.ix_(own, own)],
    )


# Where a model may be written.

_EXPECTED = "expected the name of a new file, or a model to be replaced"


def check_place(path: Path) -> None:
    """Check that a model can be written there, before the work that it is for.

    Raises:
        InputFileError: nothing can be written there, or the file there is not a model: a robot or
            measurements named by mistake may be the only copies.
    """
    check_writable(path)
    if path.exists():
        read_document(path, _EXPECTED)


# Comments that people wrote into tables which a fit writes anew.


def with_remarks(fresh: Any, old: Any) -> Any:
    """A fresh table with the comments that the old one had: at its beginning, and behind keys."""
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


Rms = Mapping[str, float | None]
_ERRORS = ("before", "after", "held_out")
# Digits of values and of standard errors, which are not known better.
_VALUE, _ERROR = 10, 3


@dataclass(frozen=True)
class Provenance:
    """Where values come from.

    Attributes:
        data: name of the data file. date: day of the fit. version: of the software.
        by: who or what put them there.
    """

    data: str
    date: str
    version: str
    by: str


def provenance_of(data: str, by: str) -> Provenance:
    """The provenance of values fitted today to a file by a command."""
    return Provenance(data, date.today().isoformat(), f"seecr {full_version()}", by)


def with_fit(
    model: Model,
    fitted: Sequence[Fitted],
    added: Sequence[str],
    provenance: Provenance,
    errors: Mapping[str, Rms],
    covariance: Array | None = None,
) -> Model:
    """The model with effects added (or fitted again), and all values as fitted.

    Args:
        model: not changed.
        fitted: all effects of the new model.
        added: names of the new ones, which get provenance and errors. The others, whose values have
            changed too, get a table ``refitted``.
        provenance: of the fit.
        errors: rms by kind: "before", "after", "held_out".
        covariance: (p, p) of the values in the order of ``fitted``. It is kept if all values are
            seen, since an unseen one has none. That of the previous fit is removed.
    """
    document = _copied(model.document)
    tables = {str(table["name"]): table for table in document.get("effect", [])}
    order = [*model.names, *(name for name in added if name not in model.names)]
    by_name = {one.usual.term.name: one for one in _kept(model, fitted)}
    for name in order:
        table = _put(document, tables, by_name[name])
        if name in added or name not in tables:
            _describe(table, provenance, errors)
        elif not by_name[name].usual.term.knowledge.fixed.all():
            table["refitted"] = with_remarks(tomlkit.item(vars(provenance)), table.get("refitted"))
    before = document.get(FIT)
    _forget_covariance(document)
    if covariance is not None:
        same = without_parts(fitted, covariance)
        if same[0] and np.all(np.isfinite(np.diag(same[1]))):
            together = tomlkit.table()
            together.trivia.indent = "\n"
            what = "Standard errors of the values above in full, and their correlations."
            together.add(tomlkit.comment(what))
            document[FIT] = with_remarks(_with_covariance(together, *same), before)
    return _with_values(replace(model, document=document), [by_name[name].usual for name in order])


def _copied(document: TOMLDocument) -> TOMLDocument:
    """A copy to change; it shares the correlations, most of the file, which are only replaced."""
    tables = (document.get(name) for name in (FIT, CALIBRATION))
    arrays = (table.get(CORRELATION) for table in tables if isinstance(table, Mapping))
    return copy.deepcopy(document, {id(array): array for array in arrays})


def _with_values(model: Model, fitted: Sequence[Fitted]) -> Model:
    return replace(
        model,
        terms=(terms := Terms(one.term for one in fitted)),
        written=terms,
        stderr={one.term.name: np.asarray(one.stderr, float) for one in fitted},
    )


def calibrated(
    model: Model,
    fitted: Sequence[Fitted],
    covariance: Array,
    provenance: Provenance,
    errors: Mapping[str, Rms],
) -> Model:
    """The model with all effects as fitted together, and the correlations of their errors.

    Args:
        model: not changed.
        fitted: all effects of the new model.
        covariance: (p, p) of their values in the order of ``fitted``.
        provenance: of the fit.
        errors: rms by kind: "before", "after", "held_out".
    """
    document = _copied(model.document)
    tables = {str(table["name"]): table for table in document.get("effect", [])}
    every = _kept(model, fitted)
    for one in every:
        _put(document, tables, one)
    before = document.pop(CALIBRATION, None)
    _forget_covariance(document)
    table = tomlkit.table()
    table.trivia.indent = "\n"
    _describe(table, provenance, errors)
    table = _with_covariance(table, *without_parts(fitted, covariance))
    document[CALIBRATION] = with_remarks(table, before)
    return _with_values(replace(model, document=document), [one.usual for one in every])


def _kept(model: Model, fitted: Sequence[Fitted]) -> list[Kept]:
    """What the model keeps of a fit."""
    names = model.terms.names
    return [kept(f, model.terms[f.term.name] if f.term.name in names else None) for f in fitted]


def _put(document: Any, tables: Mapping[str, Any], one: Kept) -> Any:
    """The table of an effect with its values, a new one at the end where it has none."""
    term = one.usual.term
    if term.name in tables:
        _fill(tables[term.name], one)
        return tables[term.name]
    table = tomlkit.table()
    table["name"] = term.name
    table["name"].comment(term.layout.effect.title)
    _fill(table, one)
    if "effect" not in document:
        document.append("effect", tomlkit.aot())
    document["effect"].append(table)
    table.trivia.indent = "\n"
    return table


def _forget_covariance(document: Any) -> None:
    """Remove what is stated about errors that a new fit has changed."""
    document.pop(FIT, None)
    table = document.get(CALIBRATION)
    for key in (PARAMETERS, STDERR, CORRELATION):
        if isinstance(table, MutableMapping):
            table.pop(key, None)


def _with_covariance(table: Any, fitted: Sequence[Fitted], covariance: Array) -> Any:
    """The table with the standard errors of the values with all digits, and their correlations.

    A row ends at its diagonal. Values of single files or runs are left out, as if uncorrelated.
    """
    if not fitted:
        return table
    stderr = np.sqrt(np.diag(covariance))
    known = np.where(stderr > 0.0, stderr, np.inf)
    correlation = covariance / np.outer(known, known)
    np.fill_diagonal(correlation, 1.0)
    names = [f"{one.term.name}.{key}" for one in fitted for key in one.term.layout.names]
    table[PARAMETERS] = _lines([f'"{name}"' for name in names])
    table[STDERR] = _lines([_floats([one]) for one in stderr])
    table[CORRELATION] = _lines([f"[{_floats(r[: i + 1])}]" for i, r in enumerate(correlation)])
    return table


def _floats(row: Iterable[float]) -> str:
    """Numbers that TOML reads as floats, none as an integer."""
    cells = (f"{one:.{_VALUE}g}" for one in row)
    return ", ".join(cell if {".", "e", "n"} & set(cell) else f"{cell}.0" for cell in cells)


def _lines(items: Sequence[str]) -> Any:
    """An array with an item on each line."""
    inside = "".join(f"    {item},\n" for item in items)
    return tomlkit.parse(f"x = [\n{inside}]\n")["x"]


def _fill(table: Any, one: Kept) -> None:
    """Write values into an effect's table, and those of files or runs into theirs."""
    own = one.usual.term.own
    if own is not None:
        table[f"per_{own.kind}"] = True
    _fill_cells(_table_in(table, "parameters"), one.usual)
    for name, part in one.parts.items():
        _fill_cells(_table_in(_table_in(table, "of", is_super_table=True), name), part)


def _table_in(table: Any, key: str, **how: bool) -> Any:
    if not isinstance(table.get(key), Mapping):
        table[key] = tomlkit.table(**how)
    return table[key]


def _fill_cells(parameters: Any, fitted: Fitted) -> None:
    layout = fitted.term.layout
    for i, key in enumerate(layout.names):
        if key in parameters and fitted.term.knowledge.fixed[i]:
            continue  # stays as somebody wrote it
        cell = _cell(layout, i, fitted)
        if isinstance(parameters.get(key), Mapping):
            _renew(parameters, key, cell)
        else:
            parameters[key] = _inline(cell | _known(fitted.term.knowledge, i))


def _renew(parameters: Any, key: str, cell: Mapping[str, object]) -> None:
    """Put fitted numbers into a cell; what else people wrote into it stays, with its comment."""
    old = parameters[key]
    values = {**{word: value for word, value in old.items() if word != "stderr"}, **cell}
    if not isinstance(old, InlineTable):
        old.update(cell)
        if "stderr" not in cell:
            old.pop("stderr", None)
        return
    fresh, comment = _inline(values), old.trivia.comment
    parameters[key] = fresh
    if comment:
        parameters[key].comment(comment)


def _known(knowledge: Knowledge, i: int) -> dict[str, object]:
    """What is known about a parameter from outside the data."""
    if knowledge.fixed[i]:
        return {"fixed": True}
    if not knowledge.measured[i]:
        return {}
    value, stderr = float(knowledge.value[i]), float(knowledge.stderr[i])
    return {"known": _inline({"value": value, "stderr": stderr})}


def _inline(cell: Mapping[str, object]) -> Any:
    """A table on one line, with the spaces that people write."""
    parts = [f"{word} = {tomlkit.item(value).as_string()}" for word, value in cell.items()]
    return tomlkit.parse(f"x = {{ {', '.join(parts)} }}\n")["x"]


def _cell(layout: Layout, i: int, fitted: Fitted) -> dict[str, object]:
    error = float(fitted.stderr[i])
    value = float(f"{float(fitted.term.vector[i]):.{_VALUE}g}")
    # rounding must not carry a value beyond its bound
    value = min(max(value, float(layout.lower[i])), float(layout.upper[i]))
    if math.isnan(error):  # somebody's number, not a fit's
        return {"value": value, "unit": layout.units[i]}
    return {
        "value": value,
        "stderr": float(f"{error:.{_ERROR}g}") if math.isfinite(error) else UNSEEN,
        "unit": layout.units[i],
        "at_bound": bool(fitted.at_bound[i]),
    }


def _describe(table: Any, provenance: Provenance, errors: Mapping[str, Rms]) -> None:
    table["provenance"] = with_remarks(tomlkit.item(vars(provenance)), table.get("provenance"))
    for name in (name for name in _ERRORS if name in errors):
        rms = {k: float(f"{v:.4g}") for k, v in errors[name].items() if v is not None}
        table[name] = with_remarks(tomlkit.item(rms), table.get(name))


def renewed(model: Model, robot: Robot, data: Measurements) -> Model:
    """The model with the robot's present numbers, as all values have just been fitted.

    Args:
        model: with its new values.
        robot, data: that they were fitted to; the range of the data is stored.
    """
    document = _copied(model.document)
    if document.get("robot") is None or model.notes:
        document["robot"] = fingerprint(robot)
    if not model.names:
        return replace(model, document=document, notes=())
    there = predict(robot, data.as_commands(robot), model)
    rows = data.read & there.solved
    reach = DataReach.of(there.pose[rows, :3], there.tensions[rows])
    before = document.pop(TABLE, None)
    if reach is not None:
        table = reach.as_toml()
        table.trivia.indent = "\n" if FIT in document else ""
        document[TABLE] = with_remarks(table, before)
    return replace(model, document=document, notes=(), reach=reach)


def save_model(path: str | Path, model: Model, replaces: str | None = None) -> None:
    """Write a model, such as a calibration's ``model``, with the comments that its file had.

    It is written to a temporary file first, so that the old one stays complete until then.

    Args:
        path: of the TOML; its folder is made if need be.
        model: as read, or the ``model`` of a diagnosis, a calibration or an addition.
        replaces: what the file must still be, as :func:`state_of` told when the model was read.

    Raises:
        InputFileError: the file cannot be written, is no model, or was changed since it was read.
        InputError: not a model.

    Example:
        ``crosscheck.save_model("new.toml", seecr.new_model(robot))``
    """
    if not isinstance(model, Model):
        raise InputError(
            "expected a model, such as the .model of a diagnosis, got "
            f"{type(model).__name__}{its_model(model)}"
        )
    path = Path(path)
    check_place(path)
    text = tomlkit.dumps(_in_step(model))
    with written(path, failure="the model cannot be written") as (partial,):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8", newline="\n")
        with folder_lock(path.parent):  # two commands at once would lose what one of them found
            if replaces is not None and state_of(path) != replaces:
                raise InputFileError.at(
                    path,
                    "was changed by another command since it was read; nothing was written: run "
                    "this command again",
                )
            partial.replace(path)


def state_of(path: Path) -> str:
    """What a model's file holds, as the first digits of its SHA-256; "" if there is none."""
    return digits_of(path) if path.is_file() else ""


def _in_step(model: Model) -> Any:
    """The document with the effects and values that the model has, where these were changed."""
    before = Terms() if model.written is None else model.written
    if before is model.terms:
        return model.document
    document = _copied(model.document)
    tables = {str(table["name"]): table for table in document.get("effect", [])}
    for name in before.names:
        if name not in model.terms:
            document["effect"].remove(tables[name])
    for term in model.terms:
        free = np.zeros(len(term.layout), dtype=bool)
        if term.name not in before:
            _put(document, tables, Kept(Fitted(term, model.errors_of(term.name), free), {}))
        elif not np.array_equal(term.vector, before[term.name].vector):
            changed = Fitted(term, np.full(len(free), np.nan), free)
            _fill_cells(_table_in(tables[term.name], "parameters"), changed)
    _forget_covariance(document)
    return document
