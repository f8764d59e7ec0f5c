"""Limits on the errors of a model, with units, from the command line or a TOML file."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from crosscheck.comparison.result import Comparison
from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import KINDS, Kind
from crosscheck.measurements.data import EXAMPLE, parse_quantity
from seecr.arguments import check_kind, finite
from seecr.errors import InputError
from seecr.files import path_of, read_toml


@dataclass(frozen=True)
class Limits:
    """Largest errors allowed, in SI; None for no limit.

    Attributes:
        max_position, max_orientation, max_tension: rms over all compared rows and the components
            that were read, as reported everywhere.
        max_position_worst, max_orientation_worst, max_tension_worst: length of the error vector (or
            largest tension error) of the worst row.
    """

    max_position: float | None = None
    max_orientation: float | None = None
    max_tension: float | None = None
    max_position_worst: float | None = None
    max_orientation_worst: float | None = None
    max_tension_worst: float | None = None

    def but(self, texts: Mapping[str, str | None]) -> Limits:
        """The same with some limits replaced by texts such as ``"0.5mm"``; those of None stay.

        Raises:
            CrosscheckError: a text is no positive number with a unit of that kind.
        """
        given = {name: parse_limit(name, text) for name, text in texts.items() if text is not None}
        return replace(self, **given)


RULES = {
    f"max_{kind.name}{end}": (kind, worst)
    for end, worst in (("", False), ("_worst", True))
    for kind in KINDS
}
"""The kind of reading that each field of :class:`Limits` is on, and whether in the worst row."""


@dataclass(frozen=True)
class Exceeded:
    """A limit that is exceeded.

    Attributes:
        name: name of the limit. limit, value: in SI. words: a sentence that says where.
    """

    name: str
    limit: float
    value: float
    words: str


def parse_limit(name: str, text: str) -> float:
    """Parse a limit, one of RULES, with its unit; SI.

    Raises:
        CrosscheckError: the text is no positive number with a unit of that kind.
    """
    return parse_quantity(option(name), RULES[name][0].name, text)


def option(name: str) -> str:
    """The name of the option on the command line."""
    return "--" + name.replace("_", "-")


def load_limits(path: str | Path) -> Limits:
    """Limits from a TOML file: ``max_position = "0.5mm"``, keys as on the command line.

    Args:
        path: of the TOML.

    Returns:
        the limits, SI.

    Raises:
        InputFileError: the file is no TOML or empty, has an unknown key or a value without a unit.
        InputError: no path.

    Example:
        ``crosscheck.load_limits("limits.toml")``
    """
    expected = 'expected a TOML file with lines such as max_position = "0.5mm"'
    toml = read_toml(path_of(path, "limits"), expected)
    if not toml.content:  # nothing could ever exceed such limits
        raise toml.error(f"is empty; {expected}")
    values: dict[str, float] = {}
    for key, value in toml.content.items():
        name = key.replace("-", "_")
        if name not in RULES:
            near = difflib.get_close_matches(name, RULES, n=len(RULES), cutoff=0.0)
            raise toml.error(
                (f"{key} is not a limit; expected one of, nearest first: {', '.join(near)}"), key
            )
        if not isinstance(value, str):
            example = EXAMPLE[RULES[name][0].name]
            text = f'{key}: expected a text such as "{example}", got {value!r}'
            raise toml.error(text, key)
        try:
            values[name] = parse_limit(name, value)
        except CrosscheckError as error:
            raise toml.error(str(error), key) from None
    return Limits(**values)


def exceeded(limits: Limits, found: Comparison) -> list[Exceeded]:
    """The limits that a comparison exceeds: each with its ``name``, ``limit``, ``value`` and words.

    Args:
        limits: some or all. found: the comparison.

    Returns:
        those that are exceeded; none if all hold.

    Raises:
        CrosscheckError: a limit is on something that was not measured, or nothing can exceed it.
        InputError: other arguments.

    Example:
        ``crosscheck.exceeded(crosscheck.load_limits("limits.toml"), found)``
    """
    check_kind(limits, Limits, "limits", "such as Limits(max_position=0.001)")
    check_kind(found, Comparison, "found", "as compare returns it")
    out = []
    for name, (kind, worst) in RULES.items():
        limit = getattr(limits, name)
        if limit is None:
            continue
        if finite(limit, name).shape:
            raise InputError(f"{name}: expected one number, got {limit!r}")
        data = found.problem.data
        if not getattr(data, f"has_{kind.name}"):
            raise CrosscheckError(
                f"{option(name)}: {data.path} has no {kind.name} readings; expected limits on "
                "what was measured"
            )
        _check_gate(name, limit, kind, found)
        sizes = found.errors_of(kind.name)
        if not np.isfinite(sizes).any():
            continue
        value = float(np.nanmax(sizes)) if worst else found.rms[kind.key]
        if value is not None and value > limit:
            out.append(Exceeded(name, limit, value, _words(found, kind, worst, limit, value)))
    return out


def _check_gate(name: str, limit: float, kind: Kind, found: Comparison) -> None:
    """Check that a limit can be exceeded: with a typing error in its unit it would never fail."""
    robot = found.problem.robot
    most = {"position": robot.reach, "orientation": np.pi, "tension": float(np.sum(robot.ea))}
    if limit >= most[kind.name]:
        what = {
            "position": "the robot's frame, across", "orientation": "half a turn",
            "tension": "what stretches all cables to twice their lengths",
        }  # fmt: skip
        raise CrosscheckError(
            f"{option(name)}: expected less than {kind.factor * most[kind.name]:.3g} {kind.unit}, "
            f"{what[kind.name]}; got {kind.factor * limit:.4g} {kind.unit}, which nothing exceeds"
        )


def _words(found: Comparison, kind: Kind, worst: bool, limit: float, value: float) -> str:
    factor, unit = kind.factor, kind.unit
    sizes = found.errors_of(kind.name)
    what = f"worst {kind.name} error" if worst else f"{kind.name} error (rms)"
    k = int(np.nanargmax(sizes))
    data = found.problem.data
    return (
        f"{what} {factor * value:.4g} {unit} exceeds {factor * limit:.4g} {unit} by "
        f"{factor * (value - limit):.4g} {unit}; worst at line {data.place(k)}, run "
        f"{data.run[k]}, {found.place(k)}: {factor * float(sizes[k]):.4g} {unit}"
    )
