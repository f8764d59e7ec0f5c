"""Effects as fitted, and those that a diagnosis listed."""

from __future__ import annotations

import json
from collections.abc import Mapping
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
from seecr.units import measured, parameter_name


@dataclass(frozen=True, eq=False, repr=False)
class Fitted:
    """An effect as fitted.

    Attributes:
        term: with its values. stderr: (p,), inf if unseen. at_bound: (p,) bool.
    """

    term: Term
    stderr: Array
    at_bound: NDArray[np.bool_]

    def __repr__(self) -> str:
        """The effect with its first few values and their errors, in the units people read."""
        layout = self.term.layout
        rows = zip(layout.names, layout.units, self.term.vector, self.stderr, strict=True)
        values = [f"{parameter_name(k, unit)} = {measured(v, e, unit)}" for k, unit, v, e in rows]
        return f"{self.term.name}: {some(values)}"

    def as_json(self) -> dict[str, Any]:
        """Its parameters by name, in SI units."""
        layout = self.term.layout
        return {
            key: {
                "value": float(self.term.vector[i]),
                "stderr": float(self.stderr[i]),
                "unit": layout.units[i],
                "at_bound": bool(self.at_bound[i]),
            }
            for i, key in enumerate(layout.names)
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
