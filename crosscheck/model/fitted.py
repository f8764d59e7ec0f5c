"""Effects as fitted, and those that a diagnosis listed."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.counted import some
from seecr.description.fingerprint import check_robot
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, apart, effect_named, layout_of
from seecr.errors import InputError, InputFileError
from seecr.files import digits_of, path_of, read_text
from seecr.pose import Array
from seecr.prediction.effect_tables import number_of
from seecr.result import Record
from seecr.units import measured, parameter_name, shown


@dataclass(frozen=True, eq=False, repr=False)
class Fitted:
    """An effect as fitted.

    Attributes:
        term: the effect with its values.
        stderr: (p,) standard errors in the units of the values; inf if unidentifiable.
        at_bound: (p,) bool, values that are on a bound.
    """

    term: Term
    stderr: Array
    at_bound: NDArray[np.bool_]

    def __repr__(self) -> str:
        """The effect with its first few values and their errors, in the units people read."""
        return f"{self.term.name}: {some(self.value_lines())}"

    def _rows(self) -> Iterator[tuple[str, str, float, float, bool]]:
        """Name, unit, value, standard error of each parameter, and whether it is on a bound."""
        layout, columns = self.term.layout, (self.term.vector, self.stderr, self.at_bound)
        values = (np.asarray(column).tolist() for column in columns)
        yield from zip(layout.names, layout.units, *values, strict=True)

    def value_lines(self) -> list[str]:
        """A line for each parameter: its name, value and standard error."""
        out = list[str]()
        for name, unit, value, error, bound in self._rows():
            stop = " (at its bound)" if bound else ""
            # what is at its bound is known to be there, without an error
            at = bound and np.isinf(error)
            known = shown(value, unit) if at else measured(value, error, unit)
            out.append(f"{parameter_name(name, unit)} = {known}{stop}")
        return out

    def value_records(self) -> list[Record]:
        """A record for each parameter, SI; ``stderr`` None if unidentifiable."""
        return [
            {
                "effect": self.term.name, "parameter": name, "value": value,
                "stderr": error if np.isfinite(error) else None, "unit": unit, "at_bound": bound,
            }
            for name, unit, value, error, bound in self._rows()
        ]  # fmt: skip

    def parameters(self) -> dict[str, Any]:
        """The parameters by name, in SI units, as JSON has them."""
        return {
            name: {"value": value, "stderr": error, "unit": unit, "at_bound": bound}
            for name, unit, value, error, bound in self._rows()
        }


# Effects that a diagnosis listed, read from its `diagnosis.json`.

_EXPECTED = "expected diagnosis.json as crosscheck diagnose writes it"


def load_diagnosed(path: str | Path, robot: GivenRobot) -> tuple[Terms, tuple[str, ...]]:
    """The missing effects that a diagnosis lists, with the values that it found.

    Args:
        path: a ``diagnosis.json``.
        robot: the robot that was diagnosed, or its MJCF.

    Returns:
        the effects, as :func:`crosscheck.add_effects` takes them, and notes about what has changed
        of the robot since.

    Raises:
        InputFileError: no such file, not a diagnosis, of another robot, or without missing effects.
        InputError: no path.

    Example:
        ``crosscheck.load_diagnosed("diagnosis.json", robot)``
    """
    path, robot = path_of(path, "a diagnosis"), robot_of(robot)
    document = diagnosis_document(path)
    notes = _check_robot(path, document, robot)
    terms = listed_in(path, document, robot)
    if not terms:
        raise InputFileError.at(
            path, f"lists no missing effect ({document['verdict']}); there is nothing to add"
        )
    return terms, notes


def diagnosis_document(path: Path) -> Mapping[str, Any]:
    """The content of a ``diagnosis.json``.

    Raises:
        InputFileError: no such file, or not a diagnosis.
    """
    document = _document(path)
    if not isinstance(document.get("missing"), list) or "verdict" not in document:
        raise InputFileError.at(path, f"has no verdict and no list of missing effects; {_EXPECTED}")
    return document


def listed_in(path: Path, document: Mapping[str, Any], robot: Robot) -> Terms:
    """The missing effects that a diagnosis lists, with its values.

    Raises:
        InputFileError: an effect or a value that is none.
    """
    terms = [_term(path, item, robot) for item in document["missing"]]
    try:
        return Terms(terms)
    except InputError as error:
        raise InputFileError.at(path, str(error)) from None


def _check_robot(path: Path, document: Mapping[str, Any], robot: Robot) -> tuple[str, ...]:
    """Notes on changes of the robot, by its numbers, since files are moved and edited."""
    table, made = document.get("robot"), document.get("made")
    hashes = made.get("sha256") if isinstance(made, Mapping) else None
    now = None if robot.source is None else digits_of(robot.source)
    read = list(hashes.values()) if isinstance(hashes, Mapping) else [now]
    if table is None and now in read and hashes:
        return ()
    notes = check_robot(path, table, robot, "the fit begins at what was found then")
    if notes or now is None or now in read:
        return notes
    return (
        f"{path} was made from a different text of {robot.source}; cables, points, mass and "
        "stiffness are the same",
    )


def _document(path: Path) -> Mapping[str, Any]:
    text = read_text(path, _EXPECTED)
    try:
        document = json.loads(text)
    except RecursionError:
        raise InputFileError.at(path, f"nests too deeply; {_EXPECTED}") from None
    except json.JSONDecodeError as error:
        said = f"is not JSON: {error.msg}; {_EXPECTED}"
        raise InputFileError.at(path, said, line=error.lineno) from None
    except ValueError:
        said = f"has a whole number of thousands of digits; {_EXPECTED}"
        raise InputFileError.at(path, said) from None
    return document if isinstance(document, Mapping) else {}


def _term(path: Path, item: Any, robot: Robot) -> Term:
    name = item.get("effect") if isinstance(item, Mapping) else None
    given = item.get("parameters") if isinstance(item, Mapping) else None
    if not isinstance(name, str) or not isinstance(given, Mapping):
        raise InputFileError.at(
            path, f"an item of missing without effect and parameters; {_EXPECTED}"
        )
    values = {
        key: number_of(cell.get("value")) if isinstance(cell, Mapping) else None
        for key, cell in given.items()
    }
    try:
        if "per" in item:
            term = _apart(robot, name, str(item["per"]), values)
        else:
            term = Term.of(robot, name, **{k: v for k, v in values.items() if v is not None})
    except InputError as error:
        raise InputFileError.at(path, str(error)) from None
    lacking = [key for key in term.layout.names if values.get(key) is None]
    if lacking:
        raise InputFileError.at(
            path, f"effect {name}: expected a number for {lacking[0]}; is it of another robot?"
        )
    return term


def _apart(robot: Robot, name: str, per: str, values: Mapping[str, float | None]) -> Term:
    """An effect with other values in each file or run: keys are "part: parameter"."""
    if per not in ("file", "run"):
        raise InputError(f'effect {name}: per must be "file" or "run", got {per!r:.60}')
    base = layout_of(effect_named(name), robot)
    parts = tuple(dict.fromkeys(key.rpartition(": ")[0] for key in values))
    layout = apart(base, per, parts, base.null)
    vector = [values.get(key) for key in layout.names]
    null = layout.null.tolist()
    known = [n if v is None else v for v, n in zip(vector, null, strict=True)]
    return Term(layout, np.array(known))
