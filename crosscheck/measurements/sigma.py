"""How uncertain each kind of reading is: the TOML beside the measurements."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, fields
from pathlib import Path

from crosscheck.files import Toml, read_toml


@dataclass(frozen=True)
class Sigma:
    """One standard deviation of each kind of reading; None where nobody stated it.

    Attributes:
        position_m: of each measured coordinate [m].
        orientation_rad: of each measured rotation component [rad].
        tension_N: of each measured tension [N].
        length_m: of the *commanded* lengths [m]; reaches the pose through the robot.
    """

    position_m: float | None = None
    orientation_rad: float | None = None
    tension_N: float | None = None
    length_m: float | None = None


KNOWN = tuple(field.name for field in fields(Sigma))


def load_sigma(path: str | Path) -> Sigma:
    """Read ``[sigma]`` of a TOML file.

    Raises:
        InputFileError: missing or broken TOML, an unknown key, a value that is no positive
            finite number.
    """
    toml = read_toml(Path(path), "expected a TOML file with a table [sigma]")
    _check_tables(toml)
    table = toml.content.get("sigma", {})
    if not isinstance(table, dict):
        raise toml.error("sigma must be a table, [sigma]", "sigma")
    return Sigma(**{key: _value(toml, key, value) for key, value in table.items()})


def sigma_toml(sigma: Sigma) -> str:
    """The text that :func:`load_sigma` reads back, exactly."""
    lines = ["# one standard deviation of each kind of reading", "[sigma]"]
    for key in KNOWN:
        value = getattr(sigma, key)
        if value is not None:
            lines.append(f"{key} = {float(value)!r}")
    return "\n".join(lines) + "\n"


def _check_tables(toml: Toml) -> None:
    """Other tables are the user's own; a misspelt [sigma] must not be passed over."""
    for name in toml.content:
        if name in KNOWN:
            raise toml.error(f"{name} stands outside [sigma]; put it under that", name)
        if name != "sigma" and difflib.get_close_matches(name.lower(), ["sigma"], cutoff=0.7):
            raise toml.error(f"unknown table [{name}]; expected [sigma]", name)


def _value(toml: Toml, key: str, value: object) -> float:
    if key not in KNOWN:
        # Nearest first, so that the likely one is read first.
        likeness = {k: difflib.SequenceMatcher(None, key, k).ratio() for k in KNOWN}
        known = ", ".join(sorted(KNOWN, key=lambda k: -likeness[k]))
        raise toml.error(f"unknown key {key} in [sigma]; known are {known}", key)
    number = float(value) if isinstance(value, int | float) and value is not True else 0.0
    if not (math.isfinite(number) and number > 0):
        unit = key.rpartition("_")[2]
        text = f"{key} must be a positive number [{unit}], got {value!r}"
        raise toml.error(f"{text}; leave it out if it is not known", key)
    return number
