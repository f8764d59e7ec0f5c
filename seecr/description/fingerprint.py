"""Which robot a model or a diagnosis belongs to, written so that a person sees what differs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit

from seecr.counted import counted
from seecr.errors import InputFileError, SeecrError
from seecr.units import millimetres

if TYPE_CHECKING:
    from seecr.description.robot import Robot

# Points that differ by less than this part of the longest cable are the same.
_SAME = 1e-6
# What a change of the other numbers means for a model.
_TWICE = "its effects may be counted twice; refit them (crosscheck add --refit)"
_POINTS = ("exit_points_m", "anchor_points_m", "reference_pose")
_ANEW = "use the robot it was made for, or make it again for this one"
_NOTED = ("mass_kg", "ea_N", "rest_lengths_m", "centre_of_mass_m")
# Decimals kept: more than anybody measures, few enough to read.
_DIGITS = 9
# Characters of a wrong value that are shown.
_SHOWN = 60


def fingerprint(robot: Robot) -> tomlkit.items.Table:
    """The table ``[robot]`` of a model, or ``robot`` of a diagnosis."""
    table = tomlkit.table()
    table["name"] = robot.name
    table["cables"] = list(robot.cable_names)
    numbers = {
        "exit_points_m": robot.exit_points,
        "anchor_points_m": robot.anchor_points,
        "reference_pose": robot.reference_pose,
        "mass_kg": robot.mass,
        "ea_N": robot.ea,
        "rest_lengths_m": robot.rest_lengths,
        "centre_of_mass_m": robot.centre_of_mass,
    }
    for key, value in numbers.items():
        table[key] = _toml(np.round(np.asarray(value, float), _DIGITS).tolist())
    return table


# What of a robot is words, by which no result is another.
_WORDS = ("name", "cable_names", "source", "read", "left_out")


def all_numbers(robot: Robot) -> dict[str, Any]:
    """All numbers of a robot, by their names."""
    return {one.name: getattr(robot, one.name) for one in fields(robot) if one.name not in _WORDS}


def _toml(value: Any) -> Any:
    """Points one per line, other numbers as they are."""
    if not (isinstance(value, list) and isinstance(value[0], list)):
        return value
    rows = tomlkit.array()
    rows.extend(value)
    return rows.multiline(True)


@dataclass(frozen=True)
class _Said:
    """What a file states about its robot, and on which lines."""

    path: Path
    table: Mapping[str, Any]
    line_of: Callable[[str], int | None]

    def error(self, key: str, words: str) -> InputFileError:
        return InputFileError.at(self.path, f"[robot] {key}: {words}", line=self.line_of(key))


def check_robot(
    path: Path, table: Any, robot: Robot, changed: str = _TWICE,
    line_of: Callable[[str], int | None] = lambda _key: None,
) -> tuple[str, ...]:  # fmt: skip
    """Check that a file's table ``[robot]``, if any, describes this robot.

    ``changed`` says what it means that mass or stiffness have changed, ``line_of`` gives a key's
    line.

    Returns:
        notes about mass, stiffness and the like that have changed since.

    Raises:
        InputFileError: another number of cables, points elsewhere, or values that are not numbers.
    """
    if table is None:
        return (f"{path} does not say which robot it was made for",)
    if not isinstance(table, Mapping):
        text = f"robot: expected a table [robot], got {table!r}"
        raise InputFileError.at(path, text, line=line_of("robot"))
    said = _Said(path, table, line_of)
    _check_cables(said, robot)
    own = fingerprint(robot)
    tolerance = _SAME * float(np.max(robot.nominal_lengths(robot.reference_pose[None])))
    for key in _POINTS:
        apart = _apart(said, key, own)
        if np.any(apart > tolerance):
            raise _elsewhere(path, table, key, apart, robot)
    notes = []
    for key in _NOTED:
        apart = _apart(said, key, own)
        size = float(np.max(np.abs(np.asarray(own[key], float)))) + tolerance
        if np.any(apart > 1e-6 * size):
            notes.append(
                f"{path} was made when {key} of robot {robot.name} was {_short(table[key])}; now "
                f"it is {_short(own[key])}: {changed}"
            )
    return tuple(notes)


def described(path: Path, table: Any) -> Robot:
    """A robot with the numbers of a table ``[robot]``: its sizes, without joints or gravity's turn.

    Raises:
        InputFileError: there is no such table, or its numbers describe no robot.
    """
    from seecr.description.robot import Robot

    wanted = "expected a table [robot], as crosscheck writes it"
    if not isinstance(table, Mapping):
        raise InputFileError.at(path, f"does not say which robot it was made for; {wanted}")
    said = _Said(path, table, lambda _key: None)
    values: dict[str, Any] = {}
    for key in (*_POINTS, *_NOTED):
        values[key] = _numbers(table.get(key))
        if values[key] is None:
            raise said.error(key, f"expected numbers, got {_cut(repr(table.get(key)))}; {wanted}")
    try:
        return Robot(
            name=str(table.get("name", "robot")),
            cable_names=tuple(map(str, table.get("cables", ()))),
            mass=float(values.pop("mass_kg")[0]),
            **{key.removesuffix("_m").removesuffix("_N"): value for key, value in values.items()},
        )
    except SeecrError as error:
        raise InputFileError.at(path, f"[robot]: {error}") from None


def _check_cables(said: _Said, robot: Robot) -> None:
    """Refuse a name that is no text, cables that are no names, or another number of them."""
    name, cables = said.table.get("name", "one"), said.table.get("cables")
    if not isinstance(name, str):
        raise said.error("name", f"expected a text, got {_cut(repr(name))}")
    if cables is None:
        return
    if not isinstance(cables, list) or not all(isinstance(cable, str) for cable in cables):
        raise said.error(
            "cables", f"expected a list of names, got {_cut(repr(cables))}; leave it out otherwise"
        )
    if len(cables) != robot.n_cables:
        raise InputFileError.at(
            said.path,
            f"made for another robot: {name} with {counted(len(cables), 'cable')}; "
            f"{robot.name} has {robot.n_cables}; {_ANEW}",
        )


def _apart(said: _Said, key: str, own: Mapping[str, Any]) -> Any:
    """Distance of each row of numbers from the robot's, (k,); 0 if the file has none."""
    here = np.atleast_1d(np.asarray(own[key], float))
    if key not in said.table:
        return np.zeros(len(here))
    there = _numbers(said.table[key])
    if there is None or there.shape != here.shape:
        expected = "a number" if here.size == 1 else f"numbers of shape {here.shape}"
        got = repr(said.table[key]) if there is None else f"those of shape {there.shape}"
        raise said.error(key, f"expected {expected}, got {_cut(got)}; leave it out otherwise")
    apart = np.abs(there - here)
    return apart.max(axis=1) if apart.ndim == 2 else apart


def _numbers(value: Any) -> Any:
    """An array; None if the value is not finite numbers."""
    try:
        array = np.atleast_1d(np.asarray(value, float))
    except (OverflowError, TypeError, ValueError):
        return None
    return array if np.all(np.isfinite(array)) else None


def _cut(text: str) -> str:
    """The beginning of a text that may be long."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} ..."


def _elsewhere(
    path: Path, table: Mapping[str, Any], key: str, apart: Any, robot: Robot
) -> InputFileError:
    name = table.get("name", "one")
    k = int(np.argmax(apart))
    if key == "reference_pose":
        now = _short(robot.reference_pose)
        what = f"its reference pose is {_short(table[key])}, here it is {now}"
    else:
        word = key.removesuffix("s_m").replace("_", " ")
        what = (
            f"its {word} of {robot.cable_names[k]} is {millimetres(apart[k], 3)} from that "
            f"{'of this robot' if robot.source is None else f'in {robot.source}'}"
        )
    other = f": {name}, not {robot.name}"
    if name == robot.name:
        other = f" of the same name, {name}"
    return InputFileError.at(path, f"made for another robot{other}: {what}; {_ANEW}")


def _short(value: Any) -> str:
    numbers = np.atleast_1d(np.asarray(value, float)).ravel()
    text = " ".join(f"{v:.6g}" for v in numbers[:7])
    return f"({text}{' ...' if len(numbers) > 7 else ''})" if len(numbers) > 1 else text
