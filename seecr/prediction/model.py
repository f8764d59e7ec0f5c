"""A model: a robot and the effects added to it, in a TOML file to be kept under version control.

    format = 1
    [robot]                      # fingerprint: notices use of the model for another robot
    [[effect]]                   # in the order of adding
    name = "pulley_radius"
    fixed = true                 # optional: none of its values is ever fitted
    [effect.parameters]
    radius_m = { value = 0.0099, stderr = 0.0001, unit = "m", at_bound = false }
    [effect.provenance]          # data file, date, version, who or what put it there
    [effect.before]              # rms errors without it, with it, and on test runs
    [effect.after]
    [effect.held_out]
    [fit]                        # correlations of the errors of these values
    [fitted_to]                  # range of those data: positions and tensions

An effect whose values differ between files or runs, such as a tracker that is set up anew, says
``per_file = true`` or ``per_run = true``. The values for each are in tables named after them,
``[effect.of."monday/measured.csv"]``. Those under ``parameters`` are what is expected for a further
file or run, and may be left out.

``stderr = "unseen"`` marks a parameter that the data do not determine. A model may be written by
hand: effect names, parameters and values suffice. Knowledge from outside the data is stated with
the parameter (:mod:`seecr.prediction.effect_tables`): ``fixed = true`` holds its value in every
fit, ``known = { value = 0.03, stderr = 0.0005 }`` counts as a reading in every fit. A key without
the component's number or axis (``shift_m``, ``gain``) applies to all components.
"""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Iterable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import tomlkit
from numpy.typing import ArrayLike, NDArray
from tomlkit import TOMLDocument
from tomlkit.exceptions import TOMLKitError

from seecr.counted import between, counted
from seecr.description.fingerprint import check_robot, fingerprint
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects import Effect, Term, Terms, known
from seecr.errors import InputError
from seecr.files import Toml, path_of, read_toml
from seecr.pose import Array
from seecr.prediction.effect_tables import Where, term_of
from seecr.result import Record, Result
from seecr.units import in_unit, measured, millimetres, parameter_name

if TYPE_CHECKING:
    from seecr.statics.solution import Solution


# The range of the data that a model was fitted to, and what lies beyond it.

TABLE = "fitted_to"
"""The table of a model that holds the range."""

_POSITION, _TENSION = "position_m", "tension_N"
# Beyond the data is a tension of so many times the largest one, and a position outside the box of
# the data by this part of its diagonal, or of the robot's length if all data are at about one
# place.
_TENSE, _OUTSIDE, _SPOT = 1.2, 0.1, 0.02
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class DataReach:
    """The range of positions and tensions in the data, as the model predicts them.

    Attributes:
        low, high: (3,) [m] corners of the box of the positions, base frame.
        least, largest: [N] of all tensions.
    """

    low: Array
    high: Array
    least: float
    largest: float

    @classmethod
    def of(cls, positions: Array, tensions: Array) -> DataReach | None:
        """The range of positions (n, 3) [m] and tensions (n, m) [N]; None if there are no rows."""
        if len(positions) == 0:
            return None
        ends = positions.min(axis=0), positions.max(axis=0)
        return cls(*ends, float(tensions.min()), float(tensions.max()))

    @classmethod
    def read(cls, where: Where, document: Mapping[str, Any]) -> DataReach | None:
        """The range in a model's document; None if it states none.

        Raises:
            InputFileError: values that are not numbers, or corners in the wrong order.
        """
        table = document.get(TABLE)
        if table is None:
            return None
        try:
            low, high = np.asarray(table[_POSITION], float)
            least, largest = np.asarray(table[_TENSION], float)
            fine = low.shape == high.shape == (3,) and np.all(low <= high) and least <= largest
        except (OverflowError, TypeError, ValueError, KeyError):
            fine = False
        if not fine:
            raise where.error(
                f"[{TABLE}]: expected {_POSITION} = [[x, y, z], [x, y, z]], the corners of the "
                f"data, and {_TENSION} = [least, largest]; leave it out if it is not known",
                key=TABLE,
            )
        return cls(low, high, float(least), float(largest))

    def as_toml(self) -> tomlkit.items.Table:
        """The table of a model that holds the range."""
        table = tomlkit.table()
        table.add(tomlkit.comment("Where the platform was in the data, and its cable tensions."))
        corners, pulls = np.stack([self.low, self.high]), np.array([self.least, self.largest])
        table[_POSITION] = _rounded(corners).tolist()
        table[_TENSION] = _rounded(pulls).tolist()
        return table

    def outside(self, positions: ArrayLike, length: float) -> NDArray[np.float64]:
        """Distance (n,) [m] of positions (n, 3) from the box; 0 inside, near it, and of NaN."""
        positions = np.asarray(positions, float)
        over = np.maximum(np.maximum(self.low - positions, positions - self.high), 0.0)
        away = np.nan_to_num(np.linalg.norm(over, axis=1))
        near = max(_OUTSIDE * float(np.linalg.norm(self.high - self.low)), _SPOT * length)
        return np.where(away > near, away, 0.0)

    def beyond(self, positions: Array, tensions: Array, length: float) -> tuple[str, ...]:
        """A sentence on rows with positions (n, 3) or tensions (n, m) beyond the data, if any."""
        away = self.outside(positions, length)
        pulls = np.nan_to_num(tensions).max(axis=1, initial=0.0)
        tense = pulls > _TENSE * self.largest
        rows = (away > 0.0) | tense
        if not np.any(rows):
            return ()
        parts = []
        if np.any(tense):
            parts.append(
                f"tensions up to {pulls.max():.4g} N, whereas the data have "
                f"{between(self.least, self.largest)} N"
            )
        if np.any(away > 0.0):
            parts.append(f"up to {millimetres(away.max(), 3)} outside the region of the data")
        which = "" if len(rows) == 1 else f" at {int(rows.sum())} of {counted(len(rows), 'pose')}"
        return (
            f"beyond the data that the model was fitted to{which}: {', '.join(parts)}; "
            "predictions there are extrapolated",
        )


def _rounded(values: Array) -> Array:
    """Values rounded to some digits of their spread: a base frame may be far from the robot."""
    apart = float(np.ptp(values, axis=0).max()) or float(np.abs(values).max()) or 1.0
    return np.asarray(np.round(values, _DIGITS - int(np.ceil(np.log10(apart)))) + 0.0)


FORMAT = 1
"""Version of the file format; raised when a key changes its meaning or is removed."""

_EXPECTED = "expected a model as crosscheck add writes it"
CALIBRATION, FIT = "calibration", "fit"
"""Tables about all values at once: the quality of a calibration, and the correlations of the last
fit (:mod:`seecr.prediction.uncertainty`).
"""

_TABLES = ("format", "robot", "effect", CALIBRATION, FIT, TABLE)


@dataclass(frozen=True, eq=False, repr=False)
class Model(Result):
    """A robot's effects, as read from a file.

    It prints as one line per effect, and ``to_frame`` gives one row per parameter.

    Attributes:
        terms: the effects with their values.
        stderr: standard errors (p,) of each effect's parameters, by its name; inf if unseen, NaN if
            the file states none.
        document: the file as a TOML tree, comments included.
        notes: sentences about what has changed since the model was made.
        path: the file.
        reach: the range of the data that the values were fitted to, if the file states it.
        written: the effects with the values that the document has; they differ from ``terms`` if
            those were replaced.
    """

    terms: Terms
    stderr: Mapping[str, Array]
    document: TOMLDocument
    notes: tuple[str, ...] = ()
    path: Path | None = None
    reach: DataReach | None = None
    written: Terms | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.written is None:
            object.__setattr__(self, "written", self.terms)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in the order of adding."""
        added = [name for name in self.stderr if name in self.terms]
        return (*added, *(name for name in self.terms.names if name not in self.stderr))

    def errors_of(self, name: str) -> Array:
        """Standard errors (p,) of an effect's parameters; NaN where nobody knows them."""
        return np.asarray(self.stderr.get(name, np.full(len(self.terms[name].layout), np.nan)))

    def beyond(self, solution: Solution) -> tuple[str, ...]:
        """A sentence about equilibria of a solution beyond the data, if there are any."""
        if self.reach is None:
            return ()
        rests = solution.converged
        places, tensions = solution.pose[rests, :3], solution.tensions[rests]
        return self.reach.beyond(places, tensions, solution.robot.length)

    def as_json(self) -> Record:
        """The robot's name, one row per parameter, and the notes."""
        return {"robot": self._robot, "rows": self.records(), "notes": self.notes}

    @property
    def _robot(self) -> str | None:
        """The robot's name, if the file states it."""
        table = self.document.get("robot")
        return table.get("name") if isinstance(table, Mapping) else None

    def lines(self) -> list[str]:
        """The robot's name, and each effect with its first few values."""
        robot = self._robot or "a robot"
        count = counted(len(self.names), "effect")
        return [
            f"model of {robot}: plain SEECR and {count}" if self.names else
            f"model of {robot}: plain SEECR, no effects",
            *(f"{name}: {_shown(self.terms[name], self.errors_of(name))}" for name in self.names),
            *self.notes,
        ]  # fmt: skip

    def records(self) -> list[Record]:
        """One row per parameter: value and standard error, None if the latter is unknown.

        ``of`` names the file or run if the effect has values of its own for each.
        """
        return [
            {
                "effect": name,
                "of": of,
                "parameter": key,
                "value": float(vector[i]),
                "stderr": float(stderr[i]) if math.isfinite(stderr[i]) else None,
                "unit": self.terms[name].layout.units[i],
            }
            for name in self.names
            for of, vector, stderr in self._tables(name)
            for i, key in enumerate(self.terms[name].layout.names)
        ]

    def _tables(self, name: str) -> list[tuple[str, Array, Array]]:
        """Values and standard errors of an effect, then those for each file or run by name."""
        term = self.terms[name]
        own = {} if term.own is None else term.own.values
        tables = [(of, one.vector, one.stderr) for of, one in own.items()]
        return [("", term.vector, self.errors_of(name)), *tables]


def _known(value: float, error: float, unit: str) -> str:
    """A value with its standard error, to the digits that are known; alone if there is none."""
    if math.isfinite(error) and error > 0.0:
        return measured(value, error, unit)
    factor, word = in_unit(unit)
    return f"{factor * value:.6g} {word}".rstrip()


def _shown(term: Term, stderr: Array, most: int = 3) -> str:
    """The first few values of an effect, as text."""
    layout, fixed = term.layout, term.knowledge.fixed
    rows = zip(layout.names, layout.units, term.vector, stderr, fixed, strict=True)
    parts = [
        f"{parameter_name(key, unit)} = {_known(value, error, unit)}{' (fixed)' if held else ''}"
        for key, unit, value, error, held in rows
    ]
    more = [f"{len(parts) - most} more"] if len(parts) > most else []
    words = ", ".join([*parts[:most], *more])
    if term.own is None:
        return words
    return (
        f"separate values for each {term.own.kind}, {len(term.own.values)} known; elsewhere {words}"
    )


GivenEffects: TypeAlias = Model | Iterable[Term | Effect] | str | Path
"""A model, the path of its TOML, or effects with their values."""


def effects_given(
    given: GivenEffects, robot: Robot
) -> tuple[tuple[Term | Effect, ...], tuple[str, ...]]:
    """Effects of a model, of its file, or as they are; and the model's notes.

    Raises:
        InputFileError: there is no such file, or it holds no model of this robot.
        InputError: something other than effects with values, or an effect twice.
    """
    if isinstance(given, Model | str | Path):
        model = model_given(given, robot)
        return tuple(model.terms), model.notes
    every = tuple(given) if isinstance(given, Iterable) else (None,)
    wrong = [one for one in every if not isinstance(one, Term | Effect)]
    if wrong:
        raise no_effects(wrong[0] if isinstance(given, Iterable) else given)
    names = [one.name for one in every]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"effect {name} is in the list twice; expected it once")
    return every, ()


def no_effects(got: object) -> InputError:
    """The error about an argument that is not effects with values."""
    what = repr(got) if isinstance(got, str) else type(got).__name__
    if isinstance(got, type):
        what = f"the class {got.__name__}, which has none; {got.__name__}(...) makes an instance"
    return InputError(
        "expected a model, its path, or a list of effects with their values, as "
        f"seecr.Term.of(robot, name, ...) gives each, got {what}{its_model(got)}"
    )


def its_model(got: object) -> str:
    """Of a result that has a model, such as a diagnosis: that it has."""
    has = hasattr(type(got), "model") or "model" in getattr(got, "__dict__", {})
    return "; its .model is one" if has else ""


def model_given(given: Model | str | Path, robot: Robot) -> Model:
    """The model, read from its file if a path is given.

    Raises:
        InputFileError: there is no such file, or it holds no model of this robot.
        InputError: neither a model nor a path.
    """
    if isinstance(given, Model):
        return given
    if isinstance(given, str | Path):
        return load_model(given, robot)
    raise InputError(f"expected a model or its path, got {type(given).__name__}{its_model(given)}")


def new_model(robot: GivenRobot) -> Model:
    """A model without effects for a robot, or for the robot in an MJCF: the paper's plain SEECR.

    Args:
        robot: as described, or its MJCF.

    Returns:
        the model; crosscheck.save_model keeps it.

    Example:
        ``seecr.new_model(robot)``
    """
    robot = robot_of(robot)
    document = tomlkit.document()
    document.add(tomlkit.comment("Effects that this robot has beyond plain SEECR, in the order"))
    document.add(tomlkit.comment("of adding. SI units. Written by crosscheck; edit freely."))
    document["format"] = FORMAT
    document["robot"] = fingerprint(robot)
    return Model(Terms(), {}, document)


def load_model(path: str | Path, robot: GivenRobot) -> Model:
    """Read the model of a robot.

    Args:
        path: the TOML file.
        robot: the robot that the model must have been made for, or its MJCF.

    Returns:
        the model; it prints each effect with its values.

    Raises:
        InputFileError: there is no such file, it is not TOML, it was made for another robot, or an
            effect or parameter is unknown, missing, given twice, not a number or out of bounds.

    Example:
        ``seecr.load_model("model.toml", robot).terms``
    """
    path, robot = path_of(path, "a model"), robot_of(robot)
    toml, document = read_document(path)
    where = Where(path, toml.text)
    notes = check_robot(path, document.get("robot"), robot, line_of=toml.line_of)
    terms: list[Term] = []
    errors: dict[str, Array] = {}
    notes = (*notes, *_migrate(where, document))
    tables = _effect_tables(where, document)
    _check_once(where, tables)
    for k, table in enumerate(tables):
        term, stderr = term_of(where, k, table, robot)
        terms.append(term)
        errors[term.name] = stderr
    reach = DataReach.read(where, document)
    return Model(Terms(terms), errors, document, notes, path, reach)


def read_document(path: Path, expected: str = _EXPECTED) -> tuple[Toml, TOMLDocument]:
    """Read a model's file, whatever robot it is for: its text, and a tree that keeps the layout.

    Raises:
        InputFileError: there is no such file, it is not TOML, or it is not a model.
    """
    toml = read_toml(path, expected)
    try:
        document = tomlkit.parse(toml.text)
    except TOMLKitError as error:  # valid TOML that this parser alone rejects
        raise toml.error(f"cannot be kept with its comments: {error}; {expected}") from None
    if not document:
        raise toml.error(f"is empty; {expected}")
    _check_tables(Where(path, toml.text), document, expected)
    return toml, document


def _check_tables(where: Where, document: Mapping[str, Any], expected: str) -> None:
    """Refuse misspelt tables and unknown formats; tables of other names are the user's own."""
    for name in document:
        near = difflib.get_close_matches(name.lower(), _TABLES, cutoff=0.7)
        if name not in _TABLES and near:
            raise where.error(f"unknown {name}; expected {near[0]}", key=name)
    if document and not any(name in document for name in _TABLES):
        has = ", ".join(document)
        raise where.error(f"is not a model, it has {has}; {expected}, with tables [[effect]]")
    version = document.get("format", FORMAT)
    if version != FORMAT or isinstance(version, bool):
        raise where.error(
            f"format {version!r} is not known to this version, which reads {FORMAT}; upgrade it",
            key="format",
        )


def _effect_tables(where: Where, document: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    tables = document.get("effect", [])
    if not isinstance(tables, list) or not all(isinstance(t, Mapping) for t in tables):
        raise where.error("effect: expected tables [[effect]], one per effect", key="effect")
    return tables


def _check_once(where: Where, tables: Sequence[Mapping[str, Any]]) -> None:
    """Refuse effects listed twice, before missing keys are reported that the other table has."""
    names = [table.get("name") for table in tables]
    for k, name in enumerate(names):
        if isinstance(name, str) and name in names[:k]:
            raise where.error(f"effect {name} is listed twice; expected it once", k, "name")


def _migrate(where: Where, document: Mapping[str, Any]) -> list[str]:
    """Rename parameters that had another name when the model was written."""
    notes = []
    for table in _effect_tables(where, document):
        given, name = table.get("parameters"), table.get("name")
        if not isinstance(given, MutableMapping) or not isinstance(name, str):
            continue
        if name not in (every := known()):
            continue
        for old, now in every[name].renamed.items():
            if old in given:
                cell = given.pop(old)
                for key in now:
                    given.setdefault(key, copy.deepcopy(cell))
                notes.append(
                    f"effect {name}: {old} of an older version is read as {' and '.join(now)}"
                )
    return notes
